"""The bodies of a scene as its effects see them: at most one effect drives each."""

from __future__ import annotations

from collections.abc import Sequence

from proximity_monitor.scene.description import Body, Robot
from proximity_monitor.scene.report import Keys, Report, spelled


class Cast:
    """Knows which bodies exist, and notes what drives them."""

    def __init__(
        self, bodies: tuple[Body, ...], report: Report, robots: Sequence[Robot] = ()
    ) -> None:
        """Begin with nothing driven."""
        self.bodies = bodies
        self._robots = {robot.name: robot for robot in robots}
        self._known = {body.name: body for body in bodies}
        self._report = report
        self._driven: dict[str, Keys] = {}

    def find(self, name: str, keys: Keys) -> Body | None:
        """Return the body that the value at `keys` names; a problem goes to the report."""
        if name not in self._known:
            self._report.add(keys, f"no body is named '{name}'", (name, self._known))
        return self._known.get(name)

    def drive(self, name: str, keys: Keys, *, or_root: bool = False) -> None:
        """Claim a body, or with `or_root` a robot's root, for the effect's value at `keys`.

        If it does not exist, is fixed or is already driven, that goes to the report.
        """
        if or_root and name in self._robots:
            problem = None
            if self._robots[name].root is None:
                problem = (
                    "is a robot with a fixed root; to move it, give it 'root: {}' instead of 'pose'"
                )
        elif (body := self.find(name, keys)) is not None:
            problem = _problem(body)
        else:
            return
        if (problem := problem or self._taken(name)) is not None:
            self._report.add(keys, f"'{name}' {problem}")
        else:
            self._driven[name] = keys

    def _taken(self, name: str) -> str | None:
        if name not in self._driven:
            return None
        first = self._driven[name]
        where = f"{spelled(first)} (line {self._report.line(first)})"
        return f"is already driven by {where}; only one effect can drive a body"


def _problem(body: Body) -> str | None:
    """Return why no effect can drive a body; None if one can."""
    if not body.moving:
        return "is fixed; to move it, give it 'moving: true' instead of 'pose'"
    if body.topic is None:
        return "is a robot link, which only its joints can move"
    return None
