"""The effect of contacts in one step: collisions, springs, non-penetration, friction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.motion.dynamics import solver
from proximity_monitor.motion.dynamics.memory import Contacts
from proximity_monitor.motion.dynamics.settings import Forces
from proximity_monitor.motion.dynamics.state import RigidBodyState

_SWEEPS = 40
"""Most sweeps over all contacts. A resting pile of a dozen bodies starts from the last step's
impulses and needs fewer. If they do not suffice, the step is undone and halved."""

_TOUCHING = 1.25
"""Surfaces nearer than this many kept distances count as touching, and pass on a collision. The
excess over 1 allows for the gap that linear motion in a step leaves between surfaces."""

_SUNK, _RAISED = 0.5, 0.2
"""Surfaces nearer than _SUNK of the kept distance are moved apart up to it. Each step moves them by
_RAISED of the rest, so that the motion is not visible."""

_DEEP = 0.25
"""Replaces _SUNK for bodies without enough kinetic energy to pay for the move. Surfaces nearer than
this are moved apart even so, because otherwise the bodies could not move at all."""

_CLOSEST = 0.125
"""If surfaces come nearer than this share of the kept distance, the step is undone."""

_SLACK = 0.05
"""The share of the kept distance by which two bodies may move before their contacts are searched
again. It is small compared with that distance, and large compared with the motion of resting
bodies."""

_SPRING_STOP = 0.25
"""Under a penalty, springs begin at the margin; the kept distance is this share of the margin."""


class ContactForces:
    """The contact law of a world, and its memory from step to step."""

    def __init__(
        self,
        forces: Forces,
        inverse_mass: NDArray[np.float64],
        gravity: NDArray[np.float64],
        step_s: float,
    ) -> None:
        law = forces.contacts
        self._margin = law.margin
        self._stiffness = law.stiffness if law.method == "penalty" else 0.0
        self.kept = law.margin * (_SPRING_STOP if law.method == "penalty" else 1.0)
        """Metres: the distance that impulses keep, to the accuracy of a linear step."""
        self.closest = _CLOSEST * self.kept
        """Metres: a step that brings surfaces nearer than this is undone."""
        self.every = law.method == "penalty"
        """Whether all pairs of pieces have contacts: one spring each makes a smooth potential."""
        self.slack = 0.0 if self.every else _SLACK * self.kept
        """Metres: resting contacts are searched again only after this much motion."""
        self.reach = 2.0 * law.margin
        """Metres: contacts are found up to this distance, plus what bodies may travel in a step."""
        self._friction = forces.friction or 0.0
        self._restitution = forces.restitution or 0.0
        # A speed that gravity alone gives a resting body in two steps is no collision.
        self._slow = 2.0 * step_s * float(np.linalg.norm(gravity, axis=1).max(initial=0.0))
        self._step_s = step_s
        self._inverse_mass = inverse_mass
        self._gravity = gravity
        self.rubbings = 0
        self.restart()

    def restart(self) -> None:
        """Forget the last step."""
        self._guess = np.empty(0, np.int64), np.empty(0), np.empty((0, 3))
        self.active = np.empty(0, np.bool_)
        """(k,) whether each contact of the step had an impulse."""

    def start(
        self,
        h: float,
        state: RigidBodyState,
        contacts: Contacts,
        inverse_inertia: NDArray[np.float64],
        gently: bool,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Advance velocities from the start of a step of h seconds to its middle.

        Surfaces that are too near are moved apart a little. The impulses of the last step are the
        first guess. If `gently`, there is no guess, and only the nearest surfaces are moved apart.

        Returns:
            Velocities (n, 3) and angular momenta (n, 3) with which to move the bodies. They are
            those of the state, unless surfaces have to be moved apart.
        """
        arms = contacts.points - state.centre[contacts.bodies]
        geometry = contacts.bodies, arms, contacts.normals
        response = self._inverse_mass, inverse_inertia
        if gently:
            self.restart()
        self.active = np.zeros(len(contacts), np.bool_)
        if self._restitution > 0.0:
            self._collide(h, state, contacts, geometry, response)
        state.velocity += 0.5 * h * self._gravity
        self._spring(h, state, contacts, geometry, response)
        key, pressed, rubbed = self._guessed(h, contacts)
        gaps, kept = contacts.gaps, self.kept
        targets = np.where(gaps >= kept, (kept - gaps) / h, 0.0)
        least = (_DEEP if gently else _SUNK) * kept
        sunk = gaps < least
        moving = state.copy() if sunk.any() else state
        self._prevent(state, geometry, response, targets, self._friction, pressed, rubbed)
        if moving is not state:
            # These further normal impulses only move positions, and add no friction.
            targets = np.where(sunk, _RAISED * (least - gaps) / self._step_s, targets)
            self._prevent(moving, geometry, response, targets, 0.0, pressed.copy(), rubbed.copy())
        self.active |= pressed > 0.0
        self._guess = key, pressed / h, rubbed / h
        return moving.velocity, moving.momentum

    def end(
        self,
        h: float,
        state: RigidBodyState,
        contacts: Contacts,
        inverse_inertia: NDArray[np.float64],
    ) -> None:
        """Advance velocities from the middle of a step to its end, at the new contacts.

        The springs act for the second half of the step, and touching surfaces stop approaching.
        Surfaces fast enough to bounce keep approaching; they bounce at the start of the next step.
        """
        arms = contacts.points - state.centre[contacts.bodies]
        geometry = contacts.bodies, arms, contacts.normals
        response = self._inverse_mass, inverse_inertia
        self._spring(h, state, contacts, geometry, response)
        touching = contacts.gaps <= _TOUCHING * self.kept
        if self._restitution > 0.0:
            speeds = solver.approach(state.velocity, _spins(state, inverse_inertia), *geometry)
            touching &= speeds >= -self._slow
        if touching.any():
            contacts = Contacts(*(column[touching] for column in contacts))
            geometry = contacts.bodies, arms[touching], contacts.normals
            key, pressed, rubbed = self._guessed(h, contacts)
            targets = np.zeros(len(contacts))
            self._prevent(state, geometry, response, targets, self._friction, pressed, rubbed)
            self._guess = key, pressed / h, rubbed / h

    def stored(self, contacts: Contacts) -> NDArray[np.float64]:
        """Return the energy (k,) in the springs of contacts, joules."""
        return 0.5 * self._stiffness * np.maximum(self._margin - contacts.gaps, 0.0) ** 2

    def _collide(self, h, state, contacts, geometry, response) -> None:
        """Let fast bodies bounce, together with all bodies that touch them."""
        v, w = state.velocity.copy(), _spins(state, response[1])
        speeds = solver.approach(v, w, *geometry)
        pull = self._gravity[contacts.bodies[:, 0]] - self._gravity[contacts.bodies[:, 1]]
        ahead = h * (speeds + 0.5 * h * np.einsum("ij,ij->i", contacts.normals, pull))
        fast = (speeds < -self._slow) & (contacts.gaps + ahead < self.kept)
        if not fast.any():
            return
        hit = fast | (contacts.gaps <= _TOUCHING * self.kept)
        bounce = self._restitution * self._islands_of(fast, hit, contacts)
        pressed, rubbed = np.empty(len(contacts)), np.empty((len(contacts), 3))
        solver.collide(
            v, w, *geometry, hit, bounce, self._friction, pressed, rubbed, *response, _SWEEPS
        )
        self.rubbings += self._friction > 0.0
        self.active |= pressed > 0.0
        self._apply(state, geometry, pressed, rubbed)

    def _islands_of(self, chosen, joined, contacts: Contacts) -> NDArray[np.bool_]:
        """Return (k,) whether each contact is on the island of a chosen contact."""
        island = solver.islands(contacts.bodies, joined, self._inverse_mass)
        movable = self._inverse_mass[contacts.bodies[:, 0]] > 0.0
        of = island[np.where(movable, contacts.bodies[:, 0], contacts.bodies[:, 1])]
        return np.isin(of, of[chosen])

    def _spring(self, h, state, contacts, geometry, response) -> None:
        """Apply the penalty's springs, and friction under them, for half a step."""
        pressed = 0.5 * h * self._stiffness * np.maximum(self._margin - contacts.gaps, 0.0)
        if not pressed.any():
            return
        rubbed = np.zeros((len(contacts), 3))
        self._apply(state, geometry, pressed, rubbed)
        if self._friction > 0.0:
            v, w = state.velocity.copy(), _spins(state, response[1])
            solver.rub(v, w, *geometry, self._friction, pressed, rubbed, *response, _SWEEPS)
            self.rubbings += 1
            self._apply(state, geometry, np.zeros(len(contacts)), rubbed)

    def _prevent(self, state, geometry, response, targets, friction, pressed, rubbed) -> None:
        """Raise each contact's normal velocity to its target or more; write pressed and rubbed."""
        v, w = state.velocity.copy(), _spins(state, response[1])
        solver.prevent(v, w, *geometry, targets, friction, pressed, rubbed, *response, _SWEEPS)
        self.rubbings += friction > 0.0
        self._apply(state, geometry, pressed, rubbed)

    def _apply(self, state, geometry, pressed, rubbed) -> None:
        bodies, arms, normals = geometry
        impulses = pressed[:, None] * normals + rubbed
        solver.apply(impulses, bodies, arms, state.velocity, state.momentum, self._inverse_mass)

    def _guessed(self, h: float, contacts: Contacts):
        """Return contacts' keys as single numbers, and guesses (N s) from the last impulses."""
        key = (contacts.keys[:, 0] << 40) + (contacts.keys[:, 1] << 20) + contacts.keys[:, 2]
        pressed, rubbed = np.zeros(len(key)), np.zeros((len(key), 3))
        known, pressure, rubbing = self._guess
        if len(known) and len(key):
            at = np.minimum(np.searchsorted(known, key), len(known) - 1)
            same = known[at] == key
            pressed[same] = h * pressure[at[same]]
            rubbed[same] = h * rubbing[at[same]]
        return key, pressed, rubbed


def _spins(state: RigidBodyState, inverse_inertia: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angular velocities (n, 3) of a state."""
    return np.einsum("nij,nj->ni", inverse_inertia, state.momentum)
