"""Combine several models into one, such as the shapes of a robot's link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from .checks import ModelError
from .facets import Facets, How, deviation_of, icosphere
from .mesh import TriangleMesh
from .model import Model
from .nurbs import Net
from .patch import Curve
from .revolution import SolidOfRevolution
from .surface import ParametricSurface, Surface
from .tessellate import tessellated

_SUBDIVISIONS = 3
"""How often the icosahedron is subdivided that replaces a ball in a mesh."""

_FINENESS = 1e-2, 1e-3, 1e-4
"""Tolerances, as shares of a model's radius, of the meshes that tell whether its normals point
inward. They are tried in this order, because thin shells need finer meshes."""


class Part(NamedTuple):
    """A model in a compound."""

    model: Model
    pose: NDArray[np.float64]
    """(4, 4) model to compound, metres."""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors along the model's own axes, applied before the pose; not 0. A negative one mirrors
    the model."""


def compound(parts: Sequence[Part], *, name: str = "compound", **how: Unpack[How]) -> Model:
    """Combine several models into one.

    Patches and curves stay exact. In a mirrored patch u and v are swapped, so that its normals
    still point outward. A solid of revolution that is the only part stays one, unless its scale
    factors differ in size or ``solid=False``. A part that encloses a solid stays solid, whatever
    the other parts are and whichever way its normals point: if parts differ in that, all are turned
    outward. With ``solid="robust"`` the inside is that of all parts together. If balls sweep only
    some parts, or their radii differ, the swept parts become meshes, with a deviation.

    Args:
        parts: the models with their poses and scales; all parametric surfaces, or none.
        name: what messages call the compound.
        how: `deviation` (metres, added to those of the parts), `volume` and `solid`, as for
            `TriangleMesh`.

    Returns:
        A `TriangleMesh`, a `ParametricSurface`, or a `SolidOfRevolution` in the compound's frame.

    Raises:
        ModelError: the factors that scale a swept part differ in size; parametric surfaces are
            beside meshes, or have a `volume` or ``solid="robust"``, which are for meshes alone;
            else as for the kind that is returned.
    """
    surfaces = [part.model for part in parts if isinstance(part.model, Surface)]
    if surfaces and len(surfaces) < len(parts):
        raise ModelError(
            f"{name}: {surfaces[0].name}: a parametric surface, which cannot be combined with "
            "meshes in one model; make it a body of its own"
        )
    if surfaces and (revolved := _revolved(parts, name, how)):
        return revolved
    if surfaces:
        return _surface(parts, name, how)
    placed = [_placed(part, name) for part in parts]
    if len({each.radius for each in placed}) > 1:
        placed = [_unswept(each) for each in placed]
    if how.get("solid") != "robust":
        # Add each face of an open part once more, reversed. Then each of its edges is passed both
        # ways, the part adds nothing to a winding number, and its surface is the same.
        closed = [TriangleMesh(each.vertices, each.faces).is_solid for each in placed]
        if any(closed):
            placed = [
                each if is_closed else each._replace(faces=_both_ways(each.faces))
                for each, is_closed in zip(placed, closed, strict=True)
            ]
    starts = np.cumsum([0] + [len(each.vertices) for each in placed[:-1]])
    return Facets(
        np.concatenate([each.vertices for each in placed]),
        np.concatenate([each.faces + i for each, i in zip(placed, starts, strict=True)]),
        placed[0].radius,
        max(each.deviation for each in placed),
    ).model(name, how)


def _surface(parts: Sequence[Part], name: str, how: How) -> ParametricSurface:
    """Return the patches and curves of all parts in the frame of their compound."""
    _check_surface(name, how)
    nets: list[Net] = []
    # Where parts of opposite orientation overlap, their winding numbers would cancel.
    encloses = len(parts) > 1 and how.get("solid") is not False
    inward = [encloses and _is_inward(part.model) for part in parts]
    turned = inward if not all(inward) else [False] * len(parts)
    for (model, pose, scale), is_turned in zip(parts, turned, strict=True):
        placed = [
            net.moved(net.points * scale @ pose[:3, :3].T + pose[:3, 3]) for net in model.nets
        ]
        # Mirroring turns normals inward.
        swaps = is_turned != (math.prod(scale) < 0.0)
        nets += [net.swapped() for net in placed] if swaps else placed
    own = max(model.deviation * float(np.abs(scale).max()) for model, _, scale in parts)
    deviation = own + how.get("deviation", 0.0)
    return ParametricSurface.of(nets, name=name, deviation=deviation, solid=how.get("solid"))


def _is_inward(model: Surface) -> bool:
    """Tell whether the normals of a solid's patches point inward; False if it is no solid.

    If a shell is too thin even for the finest mesh, the sign of that mesh's volume decides.
    """
    if isinstance(model, SolidOfRevolution):
        return model.profile.leftward
    if not model.is_solid:
        return False
    for share in _FINENESS:
        shown = model.display_mesh(share * model.radius)
        vertices, faces = shown.vertices, shown.faces
        corners = shown.corners()
        thick = shown.off if math.isfinite(shown.off) else share * model.radius
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        volume = _volume(vertices, faces)
        # Both are six times a volume: of the mesh, and of the layer on both sides of it in which
        # the surface may lie.
        if abs(volume) > 6.0 * thick * np.linalg.norm(area, axis=1).sum():
            break
    return volume < 0.0


def _revolved(parts: Sequence[Part], name: str, how: How) -> SolidOfRevolution | None:
    """Return the only part in the frame of the compound if it stays a solid of revolution, or None.

    A mirror through the axis maps the solid to itself. So mirroring moves only the axis.
    """
    model, pose, scale = parts[0]
    factor = float(np.abs(scale).max())
    alike = float(np.abs(scale).min()) == factor and how.get("solid") is not False
    if len(parts) > 1 or not isinstance(model, SolidOfRevolution) or not alike:
        return None
    _check_surface(name, how)
    turn = pose[:3, :3]
    curves = [
        Curve(
            net.points[:, :2] * factor,
            net.knots_u,
            None if net.weights is None else net.weights[:, 0],
        )
        for net in model.profile.nets
    ]
    return SolidOfRevolution(
        curves, turn @ (model.origin * scale) + pose[:3, 3], turn @ (model.axis * scale),
        name=name, deviation=model.deviation * factor + how.get("deviation", 0.0),
    )  # fmt: skip


def _check_surface(name: str, how: How) -> None:
    if how.get("volume", "rss") != "rss" or how.get("solid") == "robust":
        raise ModelError(f"{name}: volume and solid='robust' are only for meshes, not for surfaces")


def _both_ways(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.concatenate((faces, faces[:, ::-1]))


def _placed(part: Part, name: str) -> Facets:
    """Return the triangles of a part in the frame of its compound."""
    core, scale = part.model._hierarchy, np.abs(part.scale)
    if core.swept_radius > 0.0 and np.ptp(scale) > 0.0:
        raise ModelError(
            f"{name}: {part.model.name}: scale = {part.scale}: a ball sweeps it, so all factors "
            "must have the same absolute value"
        )
    vertices = core.vertices * part.scale @ part.pose[:3, :3].T + part.pose[:3, 3]
    faces = core.faces
    if math.prod(part.scale) < 0.0:  # mirroring turns normals inward
        faces = faces[:, ::-1]
    if _volume(vertices, faces) < 0.0:
        faces = faces[:, ::-1]  # else the winding numbers of overlapping parts would cancel
    return Facets(
        vertices, faces, core.swept_radius * float(scale[0]), core.deviation * float(scale.max())
    )


def _volume(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Return six times the volume that faces enclose; negative if they point inward."""
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def unswept(model: Model, *, name: str = "mesh", **how: Unpack[How]) -> Model:
    """Convert a mesh to one that no ball sweeps, so that its vertices may be moved anywhere.

    Args:
        model: a mesh, perhaps swept by a ball. A swept one becomes a mesh of its surface, whose
            deviation says how far it may be from that.
        name: what messages call the new mesh.
        how: see `How`; its deviation is added to those of the model and of the new mesh.

    Raises:
        ModelError: as for TriangleMesh.
    """
    core = model._hierarchy
    given = Facets(core.vertices, core.faces, core.swept_radius, core.deviation)
    return _unswept(given).model(name, how)


def _unswept(given: Facets) -> Facets:
    """Return the same surface as a mesh that no ball sweeps.

    A mesh with its corners on the surface has its faces inside. This one is made larger, so that
    it deviates only half as much, to either side.
    """
    radius = given.radius
    if radius == 0.0:
        return given
    if len(given.faces) == 1 and not np.ptp(given.vertices, axis=0).any():
        ball = icosphere(radius, _SUBDIVISIONS)
        return ball._replace(
            vertices=ball.vertices + given.vertices[0], deviation=ball.deviation + given.deviation
        )
    inside = tessellated(given.vertices, given.faces, radius, 0.0)[2]
    larger = 2.0 * radius**2 / (radius + inside)
    vertices, faces, _ = tessellated(given.vertices, given.faces, larger, 0.0)
    deviation = deviation_of(larger, radius) + given.deviation
    return Facets(vertices, faces, deviation=deviation)
