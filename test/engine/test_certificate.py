"""What proofs of convexity rest on, ranges of derivatives; and the searches that they shorten."""

import numpy as np
import pytest
from engine_bodies import from_python
from engine_surfaces import patch, torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.state import CELL, NONE
from proximity_monitor.engine.kernels.surface import cells as kernel
from proximity_monitor.engine.kernels.surface import evaluate, ranges
from proximity_monitor.study import shapes

root_cell, divide_cell = from_python(kernel.root_cell), from_python(kernel.divide_cell)
jet_at, ranges_of = from_python(evaluate.jet_at), from_python(ranges.ranges_of)
SAMPLES = np.linspace(0.0, 1.0, 7)


def cells_of(tree, count):
    """The first cells of a model: a piece, and what it is divided into again and again."""
    cells, width = np.zeros(count, CELL), int(7 * tree.pieces["room"].max())
    nets, roots = np.empty(count * width), np.full(len(tree.pieces), NONE, np.int32)
    _, used = root_cell(tree, 0, cells, nets, roots, 0)
    i = 0
    while used + 4 <= count:
        used = divide_cell(tree, i, cells, nets, used, np.inf)
        i += 1
    return cells, nets, used


@pytest.mark.parametrize("decades", [0.0, 0.5, None])
def test_ranges_hold_every_derivative_of_a_cell(decades):
    """Of rational cells too; where weights differ too much they are infinite."""
    model = patch(3, decades=decades) if decades is not None else None
    model = model or engine.ParametricSurface(torus_patches())
    tree, rng = model._hierarchy.tree, np.random.default_rng(4)
    cells, nets, used = cells_of(tree, 60)
    finite = 0
    for i, cell in enumerate(cells[:used]):
        piece, d = tree.pieces[cell["element"]], rng.normal(size=3)
        d /= np.linalg.norm(d)
        bounds = ranges_of(
            piece, nets, i * (len(nets) // len(cells)), tuple(d), tuple(cell["centre"])
        )
        widths = cell["high"] - cell["low"]
        jets = np.array(
            [
                jet_at(piece, tree.nets, *(cell["low"] + np.array([s, t]) * widths))
                for s in SAMPLES
                for t in SAMPLES
            ]
        )
        scales = [widths[0], widths[1], widths[0] ** 2, widths[0] * widths[1], widths[1] ** 2]
        du, dv, *seconds = (jets[:, 1 + k] * scales[k] for k in range(5))
        for middle, spread, found in (
            (bounds.along_u, bounds.spread_u, du),
            (bounds.along_v, bounds.spread_v, dv),
        ):
            assert (np.linalg.norm(found - middle, axis=1) <= spread + 1e-12).all()
        finite += np.isfinite(bounds.spread_u)
        for name, found in zip(("uu", "uv", "vv"), seconds, strict=True):
            middle, half, most = (
                getattr(bounds, f"{k}_{name}") for k in ("middle", "half", "most")
            )
            assert (np.abs(found @ d - middle) <= half + 1e-12).all()
            assert (np.linalg.norm(found, axis=1) <= most + 1e-12).all()
            # They are no idle bounds either: of the order of what varies.
            if np.isfinite(half) and cell["splits"] >= 4:
                assert half <= 0.5 * np.linalg.norm(found, axis=1).max() + 1e-3
    assert finite > 40


@pytest.mark.parametrize("turned", [False, True])
def test_points_that_triangles_share_end_a_search(turned):
    """The nearest point lies on an edge, then at a corner: each triangle there has its proof."""
    ring = engine.ParametricSurface(torus_patches())
    ball = engine.TriangleMesh(*shapes.sphere(1.0), name="sphere")
    for offset in ((-1.99698451, 0.44653429, 0.99856802), (0.4, 0.3, 1.9), (2.05, 0.4, 1.3)):
        pose = np.eye(4)
        pose[:3, 3] = offset
        models, poses = (ring, ball), (np.eye(4), pose)
        if turned:
            models, poses = models[::-1], poses[::-1]
        answer = engine.distance(models[0], poses[0], models[1], poses[1])
        assert answer.status is engine.Status.EXACT
        # Without these proofs, and with ways that are tilted along a triangle, 10^5 and more.
        assert answer.bound_tests < 40_000
