"""The number of parts into which each span of a patch is cut."""

import numpy as np
import pytest
from engine_surfaces import revolved
from test_trim import circle

from proximity_monitor import engine
from proximity_monitor.engine.models.parts import even_parts, parts_of
from proximity_monitor.engine.models.surface_tree import check_surface_tree
from proximity_monitor.engine.models.trim import Trim


def rectangle(width, height, trim=None):
    """Return a flat patch of one span in either direction."""
    control = [[[u, v, 0.0] for v in (0.0, height)] for u in (0.0, width)]
    return engine.Patch(control, trim=trim)


def nets_of(*patches):
    return [net for patch in patches for net in patch.nets]


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_pieces_of_large_and_of_small_patches_are_about_equally_long(size):
    sides = np.array([[8.0, 8.0], [8.0, 1.0], [0.5, 1.0], [4.0, 2.0]] * 8)
    parts = np.array(parts_of(nets_of(*(rectangle(*size * each) for each in sides))))
    assert 900 <= parts.prod(axis=1).sum() <= 1024
    lengths = sides / parts
    cut = (parts > 1) & (parts < 8)  # uncut spans are shorter, and 8 parts are the most
    assert lengths[cut].max() < 1.6 * lengths[cut].min()
    assert lengths[parts == 1].max() <= lengths[cut].max()


def test_a_patch_that_loops_trim_is_cut_into_shorter_pieces():
    trim = Trim([circle((0.5, 0.5), 0.4)], (0, 0), (1, 1))
    whole, trimmed = parts_of(nets_of(*[rectangle(1.0, 1.0)] * 20, rectangle(1.0, 1.0, trim)))[-2:]
    assert trimmed[0] >= 1.5 * whole[0]


def test_curves_points_and_many_spans():
    line = engine.Curve([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert parts_of(line.nets) == ((8, 1),)
    nowhere = engine.Curve([[1.0, 2.0, 3.0]] * 3)
    assert parts_of(nowhere.nets) == ((1, 1),)
    wall = revolved(np.array([[1.0, 0.0], [1.0, 1.0]]), np.ones(2))
    nets = nets_of(*wall) * 300
    assert parts_of(nets) == even_parts(nets) == ((1, 1),) * len(nets)


def test_a_model_that_is_deformed_keeps_its_parts():
    """A deformed model keeps its tree's structure, though other patches are now the long ones."""
    model = engine.ParametricSurface([rectangle(8.0, 1.0), rectangle(1.0, 1.0)])
    before = model._hierarchy
    points = model.control_points.copy()
    points[:4, 0] /= 8.0
    points[4:, 0] *= 8.0
    model.deform(points)
    after = model._hierarchy
    assert after.parts == before.parts != parts_of(model.nets)
    assert after.tree.children is before.tree.children
    check_surface_tree(after.tree)
    found = engine.closest_points(model, np.eye(4), [[4.0, 0.5, 2.0]])
    assert found.lower == pytest.approx([2.0])
