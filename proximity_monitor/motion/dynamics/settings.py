"""The settings of a dynamics effect: its bodies and forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine


@dataclass(frozen=True, eq=False)
class RigidBody:
    """One body and its initial state.

    Attributes:
        name: the body's name in messages.
        model: its shape, which encloses a volume unless the body is an obstacle. A model of flat
            faces is cut into pieces; a curved, swept or deforming model is searched whole.
        pose: (4, 4) model to world at the start, metres.
        density: kilograms per cubic metre; None for an obstacle, which never moves.
        velocity: (3,) metres per second, of the centre of mass.
        spin: (3,) radians per second, about the world's axes.
        shape: for a body that deforms: returns its model's control points (n, 3) at a time in
            seconds. The model is changed, so no other body may share it; its mass and inertia stay.
            The surface must change slowly: in a step, by less than a twentieth of the distance that
            contacts keep. Bodies that touch nevertheless are stuck; see `Dynamics.trouble`.
    """

    name: str
    model: engine.Model
    pose: NDArray[np.float64]
    density: float | None = None
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    spin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    shape: Callable[[float], NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class ContactLaw:
    """The law that keeps bodies apart.

    Attributes:
        method: "impulse": impulses stop surfaces that would come nearer than the margin. "penalty":
            a spring begins at the margin, and impulses at a quarter of it are the last stop.
        margin: metres; the distance to keep. Surfaces of rigid bodies never touch.
        stiffness: newtons per metre; of the penalty's spring between two pieces.
    """

    method: Literal["impulse", "penalty"]
    margin: float
    stiffness: float = 0.0


@dataclass(frozen=True, eq=False)
class Forces:
    """The forces on the bodies; a force that is None is not computed.

    Attributes:
        gravity: (3,) metres per second squared.
        contacts: the contact law; None: bodies pass through each other.
        friction: Coulomb's coefficient, for all contacts.
        restitution: speed at which bodies part, as a share of the approach speed, 0 to 1.
        linear_damping: d per second; the velocity decays by exp(-d t).
        angular_damping: d per second; the angular momentum decays by exp(-d t).
    """

    gravity: NDArray[np.float64] | None = None
    contacts: ContactLaw | None = None
    friction: float | None = None
    restitution: float | None = None
    linear_damping: float | None = None
    angular_damping: float | None = None
