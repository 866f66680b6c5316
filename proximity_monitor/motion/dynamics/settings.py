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
    """One body and its start.

    Attributes:
        name: its name in messages.
        model: its shape; it encloses a volume unless the body is an obstacle. A mesh of flat faces
            is cut into pieces; one that is curved, swept by a ball or deforms is asked whole.
        pose: (4, 4) model to world at the start, metres.
        density: kilograms per cubic metre; None for an obstacle, which never moves.
        velocity: (3,) metres per second, of the centre of mass.
        spin: (3,) radians per second, about the world's axes.
        shape: of a body that deforms: its model's control points (n, 3) at a time in seconds. The
            model is changed, so it is no other body's; its mass and inertia stay. The surface must
            change slowly: in a step by less than a twentieth of the distance that contacts keep.
            Where bodies touch all the same they are stuck, which `Dynamics.trouble` tells.
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
        method: by impulses, which stop what would come nearer than the margin; or by a penalty,
            a spring that begins at the margin, with impulses at a quarter of it as a last stop.
        margin: metres; the distance that is kept. Surfaces of rigid bodies never touch.
        stiffness: newtons per metre, of the penalty's spring between two pieces.
    """

    method: Literal["impulse", "penalty"]
    margin: float
    stiffness: float = 0.0


@dataclass(frozen=True, eq=False)
class Forces:
    """The forces on the bodies; those that are None are not computed.

    Attributes:
        gravity: (3,) metres per second squared.
        contacts: None lets bodies pass through each other.
        friction: Coulomb's coefficient, of all contacts.
        restitution: share of the approach speed at which bodies part, 0 to 1.
        linear_damping: per second; v decays by exp(-d t).
        angular_damping: per second; so does the angular momentum.
    """

    gravity: NDArray[np.float64] | None = None
    contacts: ContactLaw | None = None
    friction: float | None = None
    restitution: float | None = None
    linear_damping: float | None = None
    angular_damping: float | None = None
