"""Mass, centre and inertia of the solid that a closed mesh encloses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.engine.models.model import DisplayMesh

_ROUNDING = 32.0 * np.finfo(np.float64).eps
"""A volume below this share of the sum of its tetrahedra's volumes may be only rounding."""


@dataclass(frozen=True)
class MassProperties:
    """Mass properties of a homogeneous solid, in the frame of its mesh.

    Attributes:
        mass: kilograms.
        centre: (3,) metres, the centre of mass.
        inertia: (3, 3) kg m², about the centre of mass, along the axes of the mesh's frame.
        thickness: metres, volume over surface area: half the thickness of a thin plate, half the
            radius of a long rod, a third of the radius of a ball.
    """

    mass: float
    centre: NDArray[np.float64]
    inertia: NDArray[np.float64]
    thickness: float


def mass_properties(mesh: DisplayMesh, density: float, closed: bool = False) -> MassProperties:
    """Return the mass properties of the solid that triangles enclose; they may face out or in.

    Each face and a fixed point form a signed tetrahedron; the moments of the tetrahedra add up to
    the solid's. A tetrahedron with corners 0, a, b, c has ``V = det(a, b, c) / 6`` and
    ``∫ x xᵀ dV = V / 20 (a aᵀ + b bᵀ + c cᵀ + s sᵀ)`` with ``s = a + b + c``.

    Args:
        mesh: the triangles.
        density: kilograms per cubic metre.
        closed: whether the mesh is known to be closed, to rounding.

    Raises:
        ValueError: the mesh encloses no volume.
    """
    vertices, faces = mesh[:2]
    if not closed:
        _check_closed(mesh.welded().astype(np.int64))
    middle = vertices.mean(axis=0)
    corners = (vertices - middle)[faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = volumes.sum()
    if abs(volume) <= _ROUNDING * np.abs(volumes).sum():
        raise ValueError("it encloses no volume, so it has no mass")
    sums = corners.sum(axis=1)
    centre = (volumes @ sums) / (4.0 * volume)
    second = np.einsum("i,ijk,ijl->kl", volumes, corners, corners)
    second = (second + np.einsum("i,ik,il->kl", volumes, sums, sums)) / 20.0
    if volume < 0.0:
        volume, second = -volume, -second
    second -= volume * np.outer(centre, centre)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return MassProperties(
        mass=density * volume,
        centre=middle + centre,
        inertia=density * (np.trace(second) * np.eye(3) - second),
        thickness=volume / area,
    )


def _check_closed(faces: NDArray[np.int64]) -> None:
    """Check that the faces pass each edge equally often in both directions.

    Raises:
        ValueError: they do not.
    """
    edges = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    edges = edges[edges[:, 0] != edges[:, 1]]
    size = faces.max() + 1
    forth, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    odd = np.count_nonzero(np.sort(forth) != np.sort(back))
    if odd:
        raise ValueError(
            "it is not closed, or its faces are not oriented consistently, so it encloses no "
            "volume and has no mass; repair the mesh, or fix the body with a 'pose'"
        )
