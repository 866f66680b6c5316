"""The effect `dynamics`: rigid bodies that fall, bounce, slide and rest, in real time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from proximity_monitor import engine
from proximity_monitor.motion.deform import Deform
from proximity_monitor.motion.dynamics.settings import Forces, RigidBody
from proximity_monitor.motion.dynamics.world import World
from proximity_monitor.motion.motion import Motion
from proximity_monitor.scene.naming import counted


class Dynamics(Motion):
    """Rigid bodies whose motion is simulated as time goes on.

    The simulation advances in steps of `substep_s`, and a pose belongs to the step nearest to the
    requested time. So the motion is the same, bit by bit, whichever times are requested.

    A limit (`max_substeps`, `budget_s`) is for real time. If it ends a call early, the simulated
    time falls behind by `lag_s` and stays behind: the motion is slower, but otherwise the same. Up
    to the time given to `seek` there is no limit. If the clock is set back in real time, the bodies
    wait, unless the new time is not after the time given to `seek`: then they begin again.
    """

    def __init__(
        self,
        bodies: Sequence[RigidBody],
        forces: Forces,
        *,
        substep_s: float,
        max_substeps: int | None = None,
        budget_s: float | None = None,
        period_s: float | None = None,
        deform: Deform | None = None,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Put the bodies at their start, and compile everything that they may need.

        Args:
            bodies: the bodies that move, and the obstacles.
            forces: all forces on the bodies.
            substep_s: seconds; the longest step of the simulation.
            max_substeps: the most steps in one call of `poses`; None: no limit.
            budget_s: seconds of computing in one call of `poses`, exceeded by at most one step;
                None: no limit.
            period_s: seconds after which all begins again; None: never.
            deform: gives bodies their shapes at simulated times; None: no body deforms.
            stopped: returns whether the motion is no longer needed. It is called before every step.
                Once it returns True, calls return early, with poses of other times than requested.

        Raises:
            ValueError: a body that moves encloses no volume, or two bodies touch at the start.
        """
        self.world = World(bodies, forces, substep_s)
        self._deform = deform
        self._names = tuple(body.name for body in bodies if body.density is not None)
        self._rows = [i for i, body in enumerate(bodies) if body.density is not None]
        self._stopped = stopped
        self._live = max_substeps is not None or budget_s is not None
        self._most = math.inf if max_substeps is None else max_substeps
        self._budget_s = math.inf if budget_s is None else budget_s
        self._steps_a_period = None if period_s is None else max(1, round(period_s / substep_s))
        self._sought = 0
        self._touched: tuple[str, str] | None = None
        if forces.contacts is not None:
            _compile(forces, substep_s)
        self._restart()

    def _restart(self) -> None:
        self.world.restart()
        self._asked = 0
        self._lost = 0
        self._done = 0

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that move, in the scene's order."""
        return self._names

    @property
    def period_s(self) -> float | None:
        """Seconds of simulated time after which all begins again; None if it never does."""
        steps = self._steps_a_period
        return None if steps is None else steps * self.world.step_s

    @property
    def lag_s(self) -> float:
        """Seconds by which the limits have delayed the simulation."""
        return self._lost * self.world.step_s

    def seek(self, t: float) -> None:
        """Simulate up to t seconds without limits, now and after each restart of the motion.

        Raises:
            ValueError: t is not finite.
        """
        self._sought = self._steps_until(t)
        if self._sought < self._done:
            self._restart()
        self._asked, self._lost = self._sought, 0
        self._advance(self._sought)

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Simulate up to t seconds and return the poses (4, 4) of all bodies that move.

        Raises:
            ValueError: t is not finite.
        """
        steps = self._steps_until(t)
        if steps < self._asked and not (self._live and steps > self._sought):
            self._restart()
        self._asked = max(steps, self._asked)
        self._advance(self._asked - self._lost)
        poses = self.world.poses()
        return {name: poses[row] for name, row in zip(self._names, self._rows, strict=True)}

    @property
    def control_names(self) -> dict[str, str]:
        """The name of the control points of each deforming body."""
        return {} if self._deform is None else self._deform.control_names

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points (n, 3) of each deforming body at the time of the poses.

        Raises:
            ValueError: t is not finite.
        """
        self._steps_until(t)
        return {} if self._deform is None else self._deform.control_points(self.world.time_s)

    @property
    def trouble(self) -> str:
        """A message about the first two bodies that touched, as none should; empty if none did."""
        if self._touched is None:
            return ""
        first, second = self._touched
        return (
            f"dynamics: {first!r} and {second!r} touched, so they are stuck; use shorter "
            "steps (substep_ms), a slower deformation, or a wider margin"
        )

    def describe(self) -> str:
        """Return e.g. ``dynamics: 10 bodies, contacts by impulse, damping, steps of 2.5 ms``."""
        named = [counted(len(self._names), "body", "bodies")]
        forces = self.world.forces
        if forces.gravity is not None:
            named.append(f"gravity {np.linalg.norm(forces.gravity):g} m/s²")
        if forces.contacts is not None:
            named.append(f"contacts by {forces.contacts.method}")
        for name in ("friction", "restitution"):
            if (value := getattr(forces, name)) is not None:
                named.append(f"{name} {value:g}")
        if forces.linear_damping is not None or forces.angular_damping is not None:
            named.append("damping")
        named.append(f"steps of {1e3 * self.world.step_s:g} ms")
        if self._lost:
            named.append(f"{self.lag_s:.3g} s late")
        if self.world.stops:
            named.append(f"stopped {counted(self.world.stops, 'time', 'times')}")
        deform = "" if self._deform is None else f"\n{self._deform.describe()}"
        return f"dynamics: {', '.join(named)}{deform}"

    def _steps_until(self, t: float) -> int:
        if not math.isfinite(t):
            raise ValueError(f"t: must be finite (got {t})")
        return max(0, round(t / self.world.step_s))

    def _advance(self, target: int) -> None:
        """Simulate until `target` steps since the start are done, or a limit is reached."""
        if self._passes(target) > self._passes(self._done):
            self._done = self._passes(target) * self._steps_a_period
            self.world.restart()
        while self._done < min(target, self._sought) and not self._stopped():
            self._step()
        deadline, most = perf_counter() + self._budget_s, self._done + self._most
        while self._done < target and not self._stopped():
            if self._done >= most or perf_counter() >= deadline:
                self._lost += target - self._done
                break
            self._step()

    def _passes(self, steps: int) -> int:
        """Return how many periods are over before the last of these steps.

        A period includes its end.
        """
        period = self._steps_a_period
        return 0 if period is None else max(steps - 1, 0) // period

    def _step(self) -> None:
        self.world.step(self._stopped)
        self._touched = self._touched or self.world.touched
        self._done += 1


def _compile(forces: Forces, substep_s: float) -> None:
    """Let a box fall on another one, so that no kernel is compiled during the first contact."""
    size = 40.0 * forces.contacts.margin
    box = engine.shapes.box((size, size, size))
    above = np.eye(4)
    above[2, 3] = size + forces.contacts.margin
    speed = np.array([0.1, 0.0, -1.0]) * (
        1.0 if forces.gravity is None else max(1.0, np.abs(forces.gravity).max())
    )
    moving = RigidBody("falling", box, above, density=1000.0, velocity=speed)
    world = World([moving, RigidBody("fixed", box, np.eye(4))], forces, substep_s)
    for _ in range(3):
        world.step()
