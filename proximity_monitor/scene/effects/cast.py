"""The bodies of a scene as its effects see them: each is driven by one of them at most."""

from __future__ import annotations

from proximity_monitor.scene.description import Body
from proximity_monitor.scene.report import Keys, Report, spelled


class Cast:
    """Says which bodies exist, and takes note of what drives them."""

    def __init__(self, bodies: tuple[Body, ...], report: Report) -> None:
        """Begin with nothing driven."""
        self.bodies = bodies
        self._known = {body.name: body for body in bodies}
        self._report = report
        self._driven: dict[str, Keys] = {}

    def find(self, name: str, keys: Keys) -> Body | None:
        """Return a body that the value at `keys` names; a problem goes to the report."""
        if name not in self._known:
            self._report.add(keys, f"no body is named '{name}'; known are {', '.join(self._known)}")
        return self._known.get(name)

    def drive(self, name: str, keys: Keys) -> Body | None:
        """Return a body that an effect is to move, claimed for the value at `keys`.

        None, with a problem in the report, if it does not exist, is fixed, or is driven already.
        """
        body = self.find(name, keys)
        if body is None:
            return None
        if (problem := self._problem(body)) is not None:
            self._report.add(keys, f"'{name}' {problem}")
            return None
        self._driven[name] = keys
        return body

    def _problem(self, body: Body) -> str | None:
        """Why nothing, or nothing else, can drive a body."""
        if not body.moving:
            return "is fixed; give it 'moving: true' in place of its pose"
        if body.topic is None:
            return "is the link of a robot, which moves by its joints"
        if body.name not in self._driven:
            return None
        first = self._driven[body.name]
        where = f"{spelled(first)} (line {self._report.line(first)})"
        return f"is driven by {where} already; a body follows one effect"
