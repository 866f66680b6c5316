"""The poses of a scene's bodies, how fresh they are, and the bodies' models."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.poses import check_pose
from proximity_monitor.scene.description import Body
from proximity_monitor.scene.primitives import check_solid
from proximity_monitor.scene.state import PoseSample


class Placing:
    """The bodies, with a table of the answers about their pairs.

    Attributes:
        names: of all n bodies, in the scene's order.
        models: their models.
        kinds: the kinds of the models.
        solid: (n,) whether each is a solid.
        known: (n,) whether each has a pose.
        silent: (n,) whether each is unreliable, for example because its pose is unknown or too old.
        answers: the table; it also holds the poses.
    """

    def __init__(self, bodies: Sequence[Body], models: Mapping[str, engine.Model]) -> None:
        """Begin with the fixed bodies at their poses; the moving bodies have none yet.

        Raises:
            engine.ModelError: a body must be a solid, but its model is none; names the body.
        """
        self.names = tuple(body.name for body in bodies)
        self.models = tuple(models[name] for name in self.names)
        self.kinds = tuple(type(model) for model in self.models)
        for body, model in zip(bodies, self.models, strict=True):
            check_solid(body, model)
        self.solid = np.array([model.is_solid for model in self.models], dtype=bool)
        moving = np.array([body.moving for body in bodies], dtype=bool)
        self.known, self.silent = ~moving, moving.copy()
        self.answers = Answers(self.models, self.names)
        fixed = np.flatnonzero(~moving)
        if len(fixed):
            self.answers.move(fixed, np.stack([bodies[i].pose for i in fixed]))
        self._moved = False
        self._at = {name: i for i, name in enumerate(self.names)}
        self._moving = np.flatnonzero(moving)
        self._everybody = np.ones(len(self._moving), dtype=bool)
        self._moving_names = [self.names[i] for i in self._moving]

    def take(self, poses: Mapping[str, PoseSample | None], silent: Collection[str] = ()) -> bool:
        """Take the poses of moving bodies by name; return whether anything moved or was reshaped.

        The result covers all changes since the last call of `settle`. So if a tick ends early, the
        next tick still learns of its changes.

        Args:
            poses: by name; None or a missing name: not known.
            silent: bodies that are unreliable, whatever their poses say.

        Raises:
            KeyError: there is no such silent body; nothing has changed.
            ValueError: a pose is no rigid motion; names the body, and nothing has changed.
        """
        unreliable = [self._at[name] for name in silent]
        samples = [poses.get(name) for name in self._moving_names]
        given = [sample.pose for sample in samples if sample is not None]
        known = self._everybody
        if len(given) < len(samples):
            known = np.array([sample is not None for sample in samples], dtype=bool)
        if given:
            bodies = self._moving[known]
            stacked = self._stacked(given, bodies)
            # Set before the bodies move, because Ctrl-C may come at any moment.
            moved_before, self._moved = self._moved, True
            self._moved = self.answers.move(bodies, stacked) > 0 or moved_before
        self.known[self._moving] = known
        self.silent[:] = False
        self.silent[self._moving] = [sample is None or sample.stale for sample in samples]
        self.silent[unreliable] = True
        self._look_for_deformed()
        return self._moved

    def settle(self) -> None:
        """Note that the caller has handled all motions and new shapes so far."""
        self._moved = False

    def model(self, name: str) -> engine.Model:
        """Return the model of a body.

        Raises:
            KeyError: there is no such body.
        """
        return self.models[self._at[name]]

    def replace(self, name: str, model: engine.Model) -> tuple[int, np.ndarray]:
        """Give a body another model; return the body's index and the rows of its pairs.

        Raises:
            KeyError: there is no such body.
        """
        body = self._at[name]
        self.models = (*self.models[:body], model, *self.models[body + 1 :])
        self.kinds = tuple(type(each) for each in self.models)
        self._moved = True
        self.solid[body] = model.is_solid
        rows = self.answers.replace(body, model)
        a, b = self.answers.pairs(rows).T
        self.answers.sign(rows, self.solid[a] | self.solid[b])
        return body, rows

    def deform(self, name: str, points: np.ndarray) -> None:
        """Move the control points (n, 3) of a body's model, for every body that shares it.

        Raises:
            KeyError: there is no such body.
            engine.ModelError: see `engine.Model.deform`; or a solid would no longer be a solid.
                Nothing has changed.
        """
        model = self.model(name)
        before, solid = model.control_points, self.solid[self._at[name]]
        displacement = model.deform(points)
        if solid and (reason := model.not_solid):
            model.deform(before)
            self._reshape(model, 0.0)
            raise engine.ModelError(
                f"body '{name}' is a solid, but would no longer be one: {reason}; set "
                "'solid: false' in the scene if it may be a surface"
            )
        self._reshape(model, displacement)

    def _stacked(self, given: list[np.ndarray], bodies: np.ndarray) -> np.ndarray:
        """Return the given poses of bodies (k,) as one array (k, 4, 4)."""
        try:
            stacked = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            stacked = np.empty(0)
        if stacked.shape != (len(given), 4, 4):
            for pose, body in zip(given, bodies, strict=True):
                check_pose(pose, f"pose of {self.names[body]}")
        return stacked

    def _look_for_deformed(self) -> None:
        """Forget the answers about models that were deformed other than by `deform`."""
        for body in self.answers.deformed():
            self._reshape(self.models[body], np.inf)

    def _reshape(self, model: engine.Model, displacement: float) -> None:
        self._moved = True
        for i, each in enumerate(self.models):
            if each is model:
                self.answers.reshape(i, displacement)
