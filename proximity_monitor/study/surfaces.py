"""The parametric surfaces of benchmark and study, from fixed seeds; lengths in metres."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.engine.models.nurbs import HIGHEST_DEGREE

from .scenes import StudyScene, Track, identities, random_rotations, rotation_poses

Reals = NDArray[np.float64]

POINT = "point"
"""The name of the point in pairs of a point and a patch."""
_STEPS = 192


def wavy(seed: int, count: int, height: float = 0.1, degree: int = 3) -> engine.Patch:
    """Return a net of count x count points over the unit square: uniform knots, random heights."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, count)], indexing="ij")
    inner = np.linspace(0.0, 1.0, count + 1 - degree)
    knots = np.concatenate((np.zeros(degree), inner, np.ones(degree)))
    control = np.stack((x, y, height * rng.normal(size=x.shape)), axis=-1)
    return engine.Patch(control, knots, knots)


def degrees(count: int) -> StudyScene:
    """Return two nets at each degree they allow: points against one, and both against each other.

    Nets of a low degree reach close to their outermost control points; a few of them may touch.
    The 1997 paper takes one net of 10 x 10 points at different orders (section 3.1.2).
    """
    random = np.random.default_rng(1997)
    points = identities(_STEPS)
    points[:, :3, 3] = random.uniform((-0.5, -0.5, -1.0), (1.5, 1.5, 1.0), (_STEPS, 3))
    poses = _beside(random)
    surfaces: dict[str, engine.Model] = {POINT: engine.points(np.zeros((1, 3)))}
    tracks = []
    for degree in range(2, min(count - 1, HIGHEST_DEGREE) + 1):
        a, b = f"{degree} a", f"{degree} b"
        surfaces[a], surfaces[b] = wavy(1, count, degree=degree), wavy(2, count, degree=degree)
        tracks += [Track(POINT, a, points, identities(_STEPS)),
                   Track(a, b, identities(_STEPS), poses)]  # fmt: skip
    return StudyScene({}, tracks, block=32, quick_blocks=1, surfaces=surfaces)


def random_nets() -> StudyScene:
    """Return two bicubic nets of 10 x 10 points at random poses, apart."""
    poses = _beside(np.random.default_rng(11))
    return _two(wavy(1, 10), wavy(2, 10), poses)


def parallel_nets() -> StudyScene:
    """Return two flat bicubic nets of 30 x 30 points, one above the other and nearly parallel."""
    random = np.random.default_rng(12)
    tilt = random.normal(size=(_STEPS, 3)) * (1.0, 1.0, 0.0)
    tilt /= np.linalg.norm(tilt, axis=1, keepdims=True)
    poses = rotation_poses(tilt, random.uniform(0.0, 0.02, _STEPS))
    poses[:, 2, 3] = random.uniform(0.13, 0.2, _STEPS)
    return _two(wavy(3, 30, 0.02), wavy(4, 30, 0.02), poses)


def _two(a: engine.Patch, b: engine.Patch, poses: NDArray[np.float64]) -> StudyScene:
    """Return a scene of two nets: a at the origin, and b at these poses, certainly apart.

    Raises:
        ValueError: the nets may touch at a pose; says which.
    """
    pair = engine.Pair(a, b)
    for k, pose in enumerate(poses):
        if pair.distance(np.eye(4), pose, rel_err=0.5).lower <= 0.0:
            raise ValueError(f"the nets touch, or nearly so, at pose {k}: take another seed")
    track = Track("a", "b", identities(len(poses)), poses)
    return StudyScene({}, [track], block=32, quick_blocks=1, surfaces={"a": a, "b": b})


def _beside(random: np.random.Generator) -> NDArray[np.float64]:
    """Return poses of a net over the unit square, centred 1.2 to 2.0 from the net at the origin.

    Nets this near may touch, as a net reaches some 0.7 from its centre.
    """
    poses, middle = random_rotations(random, _STEPS), np.array([0.5, 0.5, 0.0])
    way = random.normal(size=(_STEPS, 3))
    way *= random.uniform(1.2, 2.0, (_STEPS, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    poses[:, :3, 3] = middle + way - poses[:, :3, :3] @ middle
    return poses


def _sheet(height: Callable[[Reals, Reals], Reals]) -> engine.ParametricSurface:
    """Return sixteen bicubic patches over a square of side 2, through points of these heights."""
    t = np.linspace(0.0, 1.0, 4)
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    inverse, patches = np.linalg.inv(basis), []
    for i, j in np.ndindex(4, 4):
        x, y = np.meshgrid(0.5 * (i + t) - 1.0, 0.5 * (j + t) - 1.0, indexing="ij")
        points = np.stack((x, y, height(x, y)), axis=-1)
        patches.append(engine.Patch(np.einsum("ij,jkc,lk->ilc", inverse, points, inverse)))
    return engine.ParametricSurface(patches)


def _sheets(
    above: Callable[[Reals, Reals], Reals], below: Callable[[Reals, Reals], Reals]
) -> StudyScene:
    track = Track("a", "b", identities(1), identities(1))
    return StudyScene({}, [track], block=1, surfaces={"a": _sheet(above), "b": _sheet(below)})


def facing() -> StudyScene:
    """Return two domes, 0.2 apart."""
    return _sheets(
        lambda x, y: 0.1 + 0.3 * (x * x + y * y), lambda x, y: -0.1 - 0.3 * (x * x + y * y)
    )


def nested() -> StudyScene:
    """Return a dome in a bowl that is bent a little less: nearly parallel, 0.02 apart."""
    return _sheets(lambda x, y: 0.3 * (x * x + y * y), lambda x, y: -0.02 + 0.29 * (x * x + y * y))


def waves() -> StudyScene:
    """Return two sheets with the same waves, a little farther apart at their rims."""
    return _sheets(
        lambda x, y: 0.1 * np.sin(3.0 * x + y),
        lambda x, y: 0.1 * np.sin(3.0 * x + y) - 0.05 - 0.01 * (x * x + y * y),
    )


SURFACES: dict[str, Callable[[], StudyScene]] = {
    **{f"degrees/{count}": partial(degrees, count) for count in (10, 16)},
    "nets/random": random_nets,
    "nets/parallel": parallel_nets,
    "sheets/facing": facing,
    "sheets/nested": nested,
    "sheets/waves": waves,
}
"""The makers of scenes by name; the word before the slash names a family."""
