"""Rigid bodies and one step of their motion.

Without contacts, a step is velocity Verlet for the centres of mass, which is exact under constant
gravity, and the implicit midpoint rule for the rotations, which keeps their energy. Contacts are
found at both ends of every step. If surfaces came too near, the step is undone and halved, so rigid
bodies never touch. Rounding, the order and the linearisation of contacts could add energy; it is
taken from the velocities again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.motion.dynamics import solver
from proximity_monitor.motion.dynamics.candidates import ROUNDING
from proximity_monitor.motion.dynamics.contacts import ContactFinder
from proximity_monitor.motion.dynamics.forces import ContactForces
from proximity_monitor.motion.dynamics.mass import MassProperties, mass_properties
from proximity_monitor.motion.dynamics.memory import Contacts, Seen
from proximity_monitor.motion.dynamics.settings import Forces, RigidBody
from proximity_monitor.motion.dynamics.state import RigidBodyState, quaternion

_HALVINGS = 16
"""The most halvings in one step. After that, bodies that are too near are stopped, because more
halvings would not be worth the time."""


class World:
    """Bodies, obstacles and the forces on them.

    Args:
        bodies: the bodies that move, which have a density, and the obstacles, which have none.
        forces: the forces.
        step_s: seconds; the longest step.

    Raises:
        ValueError: a body with a density encloses no volume, or two bodies touch at the start. The
            message names them.
    """

    def __init__(self, bodies: Sequence[RigidBody], forces: Forces, step_s: float) -> None:
        self.bodies = tuple(bodies)
        self.forces = forces
        self.step_s = step_s
        self._mass = [_mass_of(body) for body in bodies]
        self._movable = np.array([body.density is not None for body in bodies])
        self._masses = np.array([m.mass if m else np.inf for m in self._mass])
        self._inverse_mass = np.array([1.0 / m.mass if m else 0.0 for m in self._mass])
        self._inverse_inertia_body = np.array(
            [np.linalg.inv(m.inertia) if m else np.zeros((3, 3)) for m in self._mass]
        )
        self._offset = np.array([m.centre if m else np.zeros(3) for m in self._mass])
        self._soft = [i for i, body in enumerate(bodies) if body.shape is not None]
        self._measure()
        self._gravity = np.zeros((len(bodies), 3))
        if forces.gravity is not None:
            self._gravity[self._movable] = forces.gravity
        self._rotation = np.empty((len(bodies), 3, 3))
        self._inverse_inertia = np.empty((len(bodies), 3, 3))
        self._poses = np.tile(np.eye(4), (len(bodies), 1, 1))
        self._finder: ContactFinder | None = None
        if forces.contacts is not None:
            pairs = [
                (i, j)
                for i, j in combinations(range(len(bodies)), 2)
                if self._movable[i] or self._movable[j]
            ]
            self._law = ContactForces(forces, self._inverse_mass, self._gravity, step_s)
            models = [body.model for body in bodies]
            pairs = np.array(pairs, np.int64).reshape(-1, 2)
            law, soft = self._law, [body.shape is not None for body in bodies]
            self._finder = ContactFinder(models, pairs, law.slack, law.every, law.kept, soft)
            self._pull = self._apart(self._gravity)
            thickness = np.array([m.thickness if m else 0.0 for m in self._mass])
            self._thickness = thickness[self._finder.pairs].sum(axis=1)
        self.restart()

    def restart(self) -> None:
        """Put everything back to its start. The motion then repeats bit by bit."""
        turns = np.array([quaternion(body.pose[:3, :3]) for body in self.bodies])
        self.state = RigidBodyState(
            centre=np.array(
                [
                    b.pose[:3, :3] @ c + b.pose[:3, 3]
                    for b, c in zip(self.bodies, self._offset, strict=True)
                ]
            ),
            turn=turns,
            velocity=np.array([body.velocity for body in self.bodies], dtype=np.float64),
            momentum=np.zeros((len(self.bodies), 3)),
        )
        for i, (body, mass) in enumerate(zip(self.bodies, self._mass, strict=True)):
            if mass is not None:
                turn = body.pose[:3, :3]
                self.state.momentum[i] = turn @ mass.inertia @ turn.T @ body.spin
        self.stops = 0
        """How often bodies were stopped because even the shortest step was too long."""
        self.touched: tuple[str, str] | None = None
        """The first two bodies stopped because they touch; only bodies that deform can."""
        self._place()
        self._steps = 0
        self._reshape()
        self._contacts: Contacts | None = None
        if self._finder is not None:
            self._finder.restart()
            self._law.restart()
            self._contacts = self._finder.find(self._poses, self._reach(), self._law.closest)
            self._refuse_touching()
        self._too_near = np.empty(0, np.bool_)
        self._cannot_pay = False

    def step(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Advance by `step_s`, in several steps if bodies are too fast for one.

        These may be many. `stopped` is called before each; once it returns True, skip the rest.
        """
        self._steps += 1
        self._reshape()
        left, taken_back = self.step_s, 0
        while left > 0.0 and not stopped():
            h = left / self._parts(left)
            gently = False
            while not self._go(h, gently):
                if self._cannot_pay:
                    gently = True
                    continue
                h *= 0.5
                taken_back += 1
                if taken_back > _HALVINGS:
                    self._stop()  # then nothing moves for the rest of this step
                    return
            left = left - h if left > 1.5 * h else 0.0

    @property
    def time_s(self) -> float:
        """Seconds since the start."""
        return self._steps * self.step_s

    def poses(self) -> NDArray[np.float64]:
        """Return (n, 4, 4) model to world of every body, metres."""
        return self._poses.copy()

    def energy(self) -> float:
        """Return the total energy, joules; the potential of gravity is zero at the origin."""
        total = float(self._energies().sum())
        if self._contacts is not None:
            total += float(self._law.stored(self._contacts).sum())
        return total

    def momentum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the momentum, kg m/s, and the angular momentum about the origin, kg m²/s."""
        linear = self._masses[self._movable, None] * self.state.velocity[self._movable]
        orbital = np.cross(self.state.centre[self._movable], linear)
        return linear.sum(axis=0), (orbital + self.state.momentum[self._movable]).sum(axis=0)

    @property
    def searches(self) -> int:
        """The number of distances of two pieces that were searched so far; 0 without contacts."""
        return 0 if self._finder is None else self._finder.searches

    @property
    def rubbings(self) -> int:
        """The number of times that friction was computed."""
        return 0 if self._finder is None else self._law.rubbings

    def clearance(self) -> float:
        """Return a certified lower bound of every distance, metres; infinity without contacts."""
        return np.inf if self._finder is None else float(self._finder.lower.min(initial=np.inf))

    def _measure(self) -> None:
        """Derive from the models how far the bodies reach from their centres of mass."""
        reach = [
            body.model.radius + np.linalg.norm(body.model.centre - offset)
            for body, offset in zip(self.bodies, self._offset, strict=True)
        ]
        self._radius = np.array(reach)
        # In any orientation, no point of a body is faster than |v| + _reeling |L|.
        self._reeling = self._radius * np.linalg.norm(
            self._inverse_inertia_body, ord=2, axis=(1, 2)
        )

    def _reshape(self) -> None:
        """Give the deforming bodies their shapes at the present time."""
        if not self._soft:
            return
        self._rise = moved = np.zeros(len(self.bodies))
        for i in self._soft:
            moved[i] = self.bodies[i].model.deform(self.bodies[i].shape(self.time_s))
        self._measure()
        if self._finder is not None:
            self._finder.moved(moved[self._finder.pairs].sum(axis=1))
            self._contacts = self._finder.reshape(self._poses)

    def _go(self, h: float, gently: bool) -> bool:
        """Try a step of h seconds; return whether it succeeded. If not, undo it.

        A step fails if surfaces come too near. It also fails if bodies gain energy from contacts,
        and have no motion from which to take it, unless they were pushed `gently`.
        """
        self._cannot_pay = False
        if self._finder is None:
            self._drift(h, self.state.velocity + 0.5 * h * self._gravity, self.state.momentum)
            self.state.velocity += h * self._gravity
            self._damp(h)
            return True
        before, seen = self.state, self._finder.remember()
        energies, stored = self._energies(), self._law.stored(self._contacts)
        self.state = before.copy()
        moving = self._law.start(h, self.state, self._contacts, self._inverse_inertia, gently)
        # Impulses may have made a body faster than the step allows.
        self._too_near = h * self._speeds(*moving) > np.maximum(seen.lower, self._thickness)
        if not self._too_near.any():
            self._drift(h, *moving)
            self._finder.moved(self._moved(before))
            found = self._finder.find(self._poses, self._reach(), self._law.closest)
            self._too_near = self._finder.lower < self._law.closest
        if self._too_near.any():
            return self._take_back(before, seen)
        self.state.velocity += 0.5 * h * self._gravity
        self._law.end(h, self.state, found, self._inverse_inertia)
        self._damp(h)
        if not self._keep_energy(energies, stored, found, h) and not gently:
            self._cannot_pay = True
            return self._take_back(before, seen)
        self._contacts = found
        return True

    def _take_back(self, before: RigidBodyState, seen: Seen) -> bool:
        """Undo the step; search the pairs that came too near again, as contacts were missing."""
        self.state = before
        self._place()
        self._finder.recall(seen, self._too_near)
        if self._too_near.any():
            self._finder.doubt(self._too_near)
            self._contacts = self._finder.find(self._poses, self._reach(), self._law.closest)
        return False

    def _drift(
        self, h: float, velocity: NDArray[np.float64], momentum: NDArray[np.float64]
    ) -> None:
        self.state.centre += h * velocity
        inertia = self._inverse_inertia_body
        solver.turn_freely(self.state.turn, momentum, inertia, self._rotation, h)
        self._place()

    def _place(self) -> None:
        """Derive rotations, inertias and poses from the state."""
        solver.orient(
            self.state.turn, self._inverse_inertia_body, self._rotation, self._inverse_inertia
        )
        self._poses[:, :3, :3] = self._rotation
        offset = np.einsum("nij,nj->ni", self._rotation, self._offset)
        self._poses[:, :3, 3] = self.state.centre - offset

    def _speeds(
        self, velocity: NDArray[np.float64], momentum: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return upper bounds (k,) of how fast any two points of each pair's bodies approach."""
        turning = self._reeling * np.sqrt((momentum**2).sum(axis=1))
        return self._apart(velocity) + turning[self._finder.pairs].sum(axis=1)

    def _apart(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lengths (k,) of the differences of each pair's vectors (n, 3)."""
        first, second = self._finder.pairs.T
        return np.sqrt(((vectors[first] - vectors[second]) ** 2).sum(axis=1))

    def _parts(self, left: float) -> int:
        """Return into how many steps to cut these seconds, so that no body passes through another.

        In a step, no pair may travel further than its distance (less the contacts' reach) or than
        the sum of its bodies' `thickness`, whichever is greater. To pass through each other in one
        step, bodies must travel further than both are thick together. For plates, that is twice the
        sum of their volumes over areas; for other bodies, more. Half of that is allowed.
        """
        if self._finder is None:
            return 1
        speeds = self._speeds(self.state.velocity, self.state.momentum) + left * self._pull
        room = np.maximum(self._finder.lower - self._law.reach, self._thickness)
        return max(1, int(np.ceil(left * (speeds / room).max(initial=0.0))))

    def _reach(self) -> NDArray[np.float64]:
        """Return the distances (k,) from which surfaces may meet in the next step; see `_parts`."""
        speeds = self._speeds(self.state.velocity, self.state.momentum)
        travel = self.step_s * (speeds + self.step_s * self._pull)
        return self._law.reach + np.minimum(travel, self._thickness)

    def _moved(self, before: RigidBodyState) -> NDArray[np.float64]:
        """Return upper bounds (k,) of how far two points of each pair's bodies approached.

        A turn by θ moves a point by at most 2 sin(θ/2) times its distance from the centre. It
        changes the quaternion by 2 sin(θ/4), which is at least half of 2 sin(θ/2).
        """
        turned = np.sqrt(((self.state.turn - before.turn) ** 2).sum(axis=1))
        # The model's own coordinates count too, because it may be drawn far from its origin.
        size = np.abs(self.state.centre).sum(axis=1) + np.abs(self._offset).sum(axis=1)
        rounding = ROUNDING * (size + self._radius)
        each = 2.0 * turned * self._radius + rounding
        return self._apart(self.state.centre - before.centre) + each[self._finder.pairs].sum(axis=1)

    def _damp(self, h: float) -> None:
        if self.forces.linear_damping is not None:
            self.state.velocity *= np.exp(-self.forces.linear_damping * h)
        if self.forces.angular_damping is not None:
            self.state.momentum *= np.exp(-self.forces.angular_damping * h)

    def _stop(self) -> None:
        """Stop the bodies whose surfaces come too near even in the shortest step."""
        self.stops += 1
        touching = np.flatnonzero(self._too_near & (self._finder.lower <= 0.0))
        if self.touched is None and len(touching):
            self.touched = tuple(self.bodies[i].name for i in self._finder.pairs[touching[0]])
        bodies = self._finder.pairs[self._too_near].reshape(-1)
        self.state.velocity[bodies] = 0.0
        self.state.momentum[bodies] = 0.0

    def _kinetic(self) -> NDArray[np.float64]:
        """Return the kinetic energy (n,) of each body, joules."""
        v, momentum = self.state.velocity[self._movable], self.state.momentum[self._movable]
        energy = np.zeros(len(self.bodies))
        energy[self._movable] = 0.5 * self._masses[self._movable] * (v * v).sum(axis=1)
        spins = np.einsum("nij,nj->ni", self._inverse_inertia[self._movable], momentum)
        energy[self._movable] += 0.5 * (momentum * spins).sum(axis=1)
        return energy

    def _energies(self) -> NDArray[np.float64]:
        """Return the kinetic and potential energy (n,) of each body, joules."""
        energy = self._kinetic()
        height = (self._gravity[self._movable] * self.state.centre[self._movable]).sum(axis=1)
        energy[self._movable] -= self._masses[self._movable] * height
        return energy

    def _keep_energy(
        self, energies: NDArray[np.float64], stored: NDArray[np.float64], found: Contacts, h: float
    ) -> bool:
        """Slow down islands of bodies in contact that have more energy than before the step.

        Contacts only transfer energy or take it. Rounding, a linear step along a curved surface,
        and moving surfaces apart can add some; it is taken from the island's velocities. Return
        whether that was possible. A deforming body may lift its island by twice the motion of its
        surface: once for this motion, and once for earlier motion that the island lags behind.
        """
        old, new = self._law.active | (stored > 0.0), (after := self._law.stored(found)) > 0.0
        bodies = np.concatenate((self._contacts.bodies[old], found.bodies[new]))
        if not len(bodies):
            return True
        island = solver.islands(bodies, np.ones(len(bodies), np.bool_), self._inverse_mass)
        kinetic = self._kinetic()
        gain = self._per_island(island, self._energies() - energies)
        gain += self._per_island(island[self._one_of(found)], after)
        gain -= self._per_island(island[self._one_of(self._contacts)], stored)
        weight = np.where(self._movable, self._masses, 0.0) * np.linalg.norm(self._gravity, axis=1)
        for i in self._soft:
            near = bodies[(bodies == i).any(axis=1)]
            given = 2.0 * self._rise[i] * h / self.step_s * self._per_island(island, weight)
            raised = np.unique(island[near[self._movable[near]]])
            gain[raised] -= given[raised]
        total = self._per_island(island, kinetic)
        touched = np.zeros(len(island), np.bool_)
        touched[island[bodies.reshape(-1)]] = True
        slower = np.flatnonzero(touched & (gain > 0.0))
        for each in slower:
            share = max(1.0 - gain[each] / total[each], 0.0) if total[each] > 0.0 else 0.0
            self.state.velocity[island == each] *= np.sqrt(share)
            self.state.momentum[island == each] *= np.sqrt(share)
        return bool((gain[slower] <= total[slower]).all())

    def _per_island(
        self, island: NDArray[np.int64], amounts: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.bincount(island, amounts, minlength=len(self.bodies))

    def _one_of(self, contacts: Contacts) -> NDArray[np.int64]:
        """Return a body of each contact that can move."""
        first, second = contacts.bodies.T
        return np.where(self._movable[first], first, second)

    def _refuse_touching(self) -> None:
        near = np.flatnonzero(self._finder.lower < self._law.closest)
        if len(near):
            a, b = (self.bodies[i].name for i in self._finder.pairs[near[0]])
            raise ValueError(
                f"dynamics: {a!r} and {b!r} touch, or nearly touch, at the start; move one of "
                f"them until they are {self._law.kept:g} m apart"
            )


def _mass_of(body: RigidBody) -> MassProperties | None:
    if body.density is None:
        return None
    mesh = body.model.display_mesh(0.0)
    try:
        # A curved solid is proven to be closed; its triangles meet up to rounding.
        return mass_properties(mesh, body.density, mesh.normals is not None and body.model.is_solid)
    except ValueError as error:
        raise ValueError(f"dynamics.bodies.{body.name}: {error}") from None
