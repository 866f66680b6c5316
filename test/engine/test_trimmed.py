"""Distances of trimmed patches, against analytic answers and against samples of what is left."""

import math

import numpy as np
import pytest
from engine_bodies import box
from engine_surfaces import revolved
from numba import njit
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from test_trim import CENTRE, HOLE, RADIUS, circle, frame, polygon

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.surface import sides
from proximity_monitor.engine.kernels.surface.edges import point_on, put_edge
from proximity_monitor.engine.kernels.surface.trim import INSIDE
from proximity_monitor.engine.kernels.surface.trim_entries import classify_points
from proximity_monitor.engine.models.compound import Part
from proximity_monitor.engine.models.trim import Trim, joined

HERE = np.eye(4)
PLATE = engine.Patch(
    [[[u, v, 0.0] for v in (0.0, 5.0)] for u in (0.0, 10.0)],
    *(np.repeat([0.0, size], 2) for size in (10.0, 5.0)), trim=HOLE,
)  # fmt: skip
"""A plate of 10 by 5 with a hole."""


def to_plate(points):
    """Return the distances of points to the plate, exact but for rounding."""
    x, y, z = np.asarray(points).T
    outside = np.maximum(np.maximum(-x, x - 10.0), np.maximum(np.maximum(-y, y - 5.0), 0.0))
    assert (outside == 0.0).all()
    inside = np.maximum(RADIUS - np.hypot(x - CENTRE[0], y - CENTRE[1]), 0.0)
    return np.hypot(inside, z)


def test_points_near_a_hole_s_edge_have_their_distance():
    random = np.random.default_rng(4)
    angle, away = random.uniform(0, 2 * math.pi, 300), 10.0 ** random.uniform(-9, 0.3, 300)
    out = RADIUS + 0.4 * away * random.choice([-1.0, 1.0], 300)
    height = away * random.normal(size=300)
    at = CENTRE + out[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.column_stack([np.clip(at, 0.0, [10.0, 5.0]), height])
    truth = to_plate(points)
    found = engine.closest_points(PLATE, HERE, points)
    assert (found.lower <= truth + 1e-14).all()
    assert (truth <= found.upper + 1e-14).all()
    assert (found.upper - found.lower)[away > 1e-4].max() < 1e-10
    assert found.upper == pytest.approx(truth, abs=1e-11)


def test_a_pin_in_a_hole_is_no_nearer_than_its_clearance():
    """The pin would pierce a plate without the hole. The nearest points are a whole circle."""
    pin = engine.ParametricSurface(
        revolved(np.array([[1.9, -3.0], [1.9, 3.0]]), np.ones(2)), name="pin"
    )
    pose = np.eye(4)
    pose[:3, 3] = *CENTRE, 0.0
    found = engine.distance(PLATE, HERE, pin, pose)
    assert found.lower <= 0.1 <= found.upper + 1e-12
    assert found.upper == pytest.approx(0.1, abs=1e-9)
    assert found.lower > 0.099
    pose[:2, 3] += 0.06, 0.0
    found = engine.distance(PLATE, HERE, pin, pose)
    assert 0.0399 < found.lower <= 0.04 + 1e-12
    assert found.upper == pytest.approx(0.04, abs=1e-9)
    pose[:2, 3] += 0.05, 0.0
    assert engine.distance(PLATE, HERE, pin, pose).lower == 0.0
    assert engine.collide(PLATE, HERE, pin, pose)


def window():
    """Return what a loop, given in angles, leaves of a quarter of a cylinder's wall."""
    quarter = revolved(np.array([[2.0, 0.0], [2.0, 1.0]]), np.ones(2))[0]
    control, weights = quarter.nets[0].control, quarter.nets[0].weights
    low, high = np.array([0.0, 0.0]), np.array([math.pi / 2, 1.0])
    loop = polygon((0.3, 0.2), (0.9, 0.2), (0.9, 0.8), (0.3, 0.8))
    knots = np.repeat([0.0, math.pi / 2], 3), np.repeat([0.0, 1.0], 2)
    trim = Trim([loop], low, high, arcs=(1, 0))
    return engine.ParametricSurface([engine.Patch(control, *knots, weights, trim=trim)])


def test_arcs_are_trimmed_in_their_angle():
    cut = window()
    angles = np.array([0.0, 0.3, 0.6, 0.9, 1.4])
    for height in (0.0, 0.5):
        points = np.column_stack(
            [3 * np.cos(angles), 3 * np.sin(angles), np.full(len(angles), height)]
        )
        near = np.clip(angles, 0.3, 0.9)
        feet = np.column_stack(
            [2 * np.cos(near), 2 * np.sin(near), np.full(len(near), max(height, 0.2))]
        )
        truth = np.linalg.norm(feet - points, axis=1)
        found = engine.closest_points(cut, HERE, points)
        assert found.lower == pytest.approx(truth, abs=1e-10)
        assert found.upper == pytest.approx(truth, abs=1e-10)
        np.testing.assert_allclose(found.points, feet, atol=1e-6)


def random_patch(random, rational):
    """Return a bumpy patch with a round hole, or of which only a disc or a ring is left."""
    count = int(random.integers(4, 7))
    x, y = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, count)], indexing="ij")
    control = np.stack([x, y, 0.4 * random.normal(size=x.shape)], axis=-1)
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, count - 2), np.ones(3)])
    centre, radius = random.uniform(0.4, 0.6, 2), random.uniform(0.1, 0.35)
    loops = [circle(centre, radius)]
    if random.random() < 0.5:
        loops.append(frame((0.0, 0.0), (1.0, 1.0)))
    elif random.random() < 0.5:
        loops.append(circle(centre, 0.5 * radius))
    weights = np.exp(0.5 * random.normal(size=x.shape)) if rational else None
    return engine.Patch(control, knots, knots, weights, trim=Trim(loops, (0, 0), (1, 1)))


def sampled(patch, count=250):
    """Return points of what is left of a patch."""
    u, v = np.meshgrid(*2 * [np.linspace(0.0, 1.0, count)])
    places = np.column_stack([u.ravel(), v.ravel()])
    found = np.empty(len(places), np.int8)
    classify_points(joined([patch.nets[0].trim]), 0, places, found)
    return patch.evaluate(*places[found == INSIDE].T)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_no_sample_of_what_is_left_is_nearer_than_the_bounds(seed):
    random = np.random.default_rng(seed)
    a, b = random_patch(random, seed % 2 == 1), random_patch(random, seed % 3 == 0)
    of_a, of_b = cKDTree(sampled(a)), sampled(b)
    for _ in range(4):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.random(random_state=random.integers(1 << 30)).as_matrix()
        way = random.normal(size=3)
        pose[:3, 3] = way / np.linalg.norm(way) * random.uniform(0.3, 4.0)
        truth = of_a.query(of_b @ pose[:3, :3].T + pose[:3, 3])[0].min()
        found = engine.distance(a, HERE, b, pose)
        assert found.lower <= truth + 1e-12
        assert found.upper <= truth + 1e-9
        assert truth < found.upper + 0.03
        assert found.upper - found.lower < 1e-9 or found.lower == 0.0
        for feature, patch, point, place in (
            (found.feature_a, a, found.point_a, HERE), (found.feature_b, b, found.point_b, pose),
        ):  # fmt: skip
            u, v = feature.parameters
            own = patch.evaluate(u, v) @ place[:3, :3].T + place[:3, 3]
            np.testing.assert_allclose(own, point, atol=1e-12)


@njit(pipeline_class=ROOT)
def parts_of(tree, element, levels, nets, points, told):
    """Set nets (k, 48) of an edge's parts, level by level, five points and the bend of each."""
    bends = np.empty(1 << levels)
    bends[0] = tree.pieces[element].bend
    k = 0
    for level in range(1, levels + 1):
        count = 1 << level
        for i in range(count - 1, -1, -1):
            low, high = i / count, (i + 1) / count
            piece = tree.pieces[element]
            bends[i] = put_edge(tree, piece, low, high, 0.25 * bends[i // 2], nets[k], 0)
            told[k] = bends[i]
            for j in range(5):
                at = point_on(tree, element, low + (high - low) * (j + 0.5) / 5.0, 0.0)
                points[k, j, 0], points[k, j, 1], points[k, j, 2] = at
            k += 1


@pytest.mark.parametrize("seed", range(4))
def test_boxes_around_parts_of_edges_hold_the_curve(seed):
    """This holds however the first bend is bounded, and whatever direction a part's chord has."""
    random = np.random.default_rng(seed)
    tree = random_patch(random, seed % 2 == 0)._hierarchy.tree
    ways = random.normal(size=(40, 3))
    for element in np.flatnonzero(tree.pieces["edge"] >= 0):
        nets, points, told = np.empty((62, 48)), np.empty((62, 5, 3)), np.empty(62)
        parts_of(tree, element, 5, nets, points, told)
        control = nets.reshape(62, 3, 16)[:, :, :10].swapaxes(1, 2)
        assert ((points @ ways.T).max(axis=1) <= (control @ ways.T).max(axis=1) + 1e-13).all()
        second = 25.0 * np.linalg.norm(np.diff(points, 2, axis=1), axis=-1)
        assert (second.max(axis=1) / 8.0 <= told * (1.0 + 1e-6) + 1e-12).all()


def test_a_deformed_patch_keeps_its_loops():
    patch = engine.Patch(PLATE.control_points.reshape(2, 2, 3).copy(), *(
        np.repeat([0.0, size], 2) for size in (10.0, 5.0)), trim=HOLE)  # fmt: skip
    patch.deform(patch.control_points * [1.0, 1.0, 0.0] + [0.0, 0.0, 2.0])
    found = engine.closest_points(patch, HERE, np.array([[*CENTRE, 3.0], [1.0, 1.0, 3.0]]))
    assert found.upper == pytest.approx([math.hypot(RADIUS, 1.0), 1.0], abs=1e-9)


def test_only_what_is_left_reaches_into_a_solid():
    """A cube of edge 2 in the middle of the hole. The part that is cut off would be far deeper."""
    pose = np.eye(4)
    pose[:3, 3] = *CENTRE, 0.0
    cube = box((2.0, 2.0, 2.0))
    found = engine.signed_distance(cube, pose, PLATE, HERE)
    assert found.lower == pytest.approx(RADIUS - math.sqrt(2.0), abs=1e-9)
    pose[0, 3] += 1.2
    found = engine.signed_distance(cube, pose, PLATE, HERE, depth_err=1e-3)
    x = (2.4 + math.sqrt(26.24)) / 4.0  # where 2.2 - x = 1 - y on the hole's edge
    depth = 2.2 - x
    assert found.lower <= -depth <= found.upper + 1e-12
    assert found.upper - found.lower <= 2e-3 * depth


@njit(pipeline_class=ROOT)
def near_to(tree, x, y, z, found):
    """Set `found` to the place that `near` finds for a point, model frame, from an edge."""
    stack, bounds, gaps = np.empty(512, np.int32), np.empty(512), np.empty(16, np.float32)
    edge, begin = len(tree.pieces) - 1, (0.5, 0.0, 0.0)
    element, at = sides.near(tree, (x, y, z), edge, begin, 64, 0.0, stack, bounds, gaps)
    found[0], found[1], found[2] = point_on(tree, element, at[0], at[1])


def test_what_loops_have_cut_off_is_not_taken_for_near():
    """A disc is left of a square. The square's corners would be nearer to points beyond them."""
    square = [[[u, v, 0.0] for v in (-5.0, 5.0)] for u in (-5.0, 5.0)]
    knots = np.repeat([-5.0, 5.0], 2)
    trim = Trim([circle((0.0, 0.0), 5.0)], (-5, -5), (5, 5))
    tree = engine.Patch(square, knots, knots, trim=trim)._hierarchy.tree
    found = np.empty(3)
    for angle in np.linspace(0.0, 2.0 * math.pi, 25):
        point = np.array([7.0 * math.cos(angle), 7.0 * math.sin(angle), 0.5])
        near_to(tree, *point, found)
        assert np.hypot(*found[:2]) < 5.0 + 1e-9
        assert np.linalg.norm(found - point) < math.hypot(2.0, 0.5) + 0.02


def test_a_loop_that_leaves_its_rectangle_is_refused():
    control = [[[u, v, 0.0] for v in (0.0, 1.0)] for u in (0.0, 1.0)]
    loops = [circle(np.array([0.9, 0.5]), 0.3)]
    patch = engine.Patch(control, trim=Trim(loops, (0, 0), (1, 1)))
    with pytest.raises(engine.ModelError, match="patch 0: a trimming loop leaves the"):
        engine.distance(patch, HERE, PLATE, HERE)


def test_what_is_cut_off_is_cut_off_in_the_mirror_too():
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirrored = engine.shapes.compound([Part(PLATE, HERE, (-1.0, 1.0, 1.0))])
    assert mirrored.nets[0].trim is not None
    random = np.random.default_rng(2)
    points = random.uniform((0.0, 0.0, -1.0), (10.0, 5.0, 1.0), (200, 3))
    points[0] = *CENTRE, 0.0
    found = engine.closest_points(mirrored, HERE, points @ mirror[:3, :3])
    assert found.upper == pytest.approx(to_plate(points), abs=1e-11)
    again = engine.shapes.compound([Part(mirrored, HERE, (-1.0, 1.0, 1.0))])
    assert again.digest() == engine.shapes.compound([Part(PLATE, HERE)]).digest()
    # Along arcs, loops are given by angles, and mirroring keeps the angles.
    wall = engine.shapes.compound([Part(window(), HERE, (-1.0, 1.0, 1.0))])
    points = np.column_stack([3 * np.cos(random.uniform(0, 1.5, 50)), random.uniform(1, 3, 50)])
    points = np.column_stack([points, random.uniform(0, 1, 50)])
    one = engine.closest_points(window(), HERE, points)
    other = engine.closest_points(wall, HERE, points @ mirror[:3, :3])
    assert other.upper == pytest.approx(one.upper, abs=1e-11)
