"""Models made from dimensions: closed, turned outwards, and as large as they should be."""

import math
from itertools import pairwise, product

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.engine import shapes

HERE = np.eye(4)
EXACT = {
    "box": (lambda: shapes.box((1.0, 2.0, 3.0)), 6.0),
    "cylinder": (lambda: shapes.cylinder(0.5, 2.0, 96), math.pi * 0.5),
    "sphere": (lambda: shapes.sphere(0.5, 4), math.pi / 6.0),
}


def volume(model):
    a, b, c = model.display_mesh(0.0).corners().swapaxes(0, 1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


@pytest.mark.parametrize("name", EXACT)
def test_a_shape_is_closed_and_turned_outwards(name):
    make, enclosed = EXACT[name]
    model = make()
    faces = model.display_mesh(0.0).welded()
    edges = np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)]).tolist()
    assert sorted(edges) == sorted(edge[::-1] for edge in edges)
    assert len(set(map(tuple, edges))) == len(edges)
    assert model.name == name and model.is_solid
    assert volume(model) == pytest.approx(enclosed, rel=2e-3)
    assert shapes.triangles(*model.display_mesh(0.0)[:2], solid=True).is_solid


def test_what_is_given_besides_reaches_the_model():
    for make in (
        lambda **how: shapes.box((1.0, 1.0, 1.0), **how),
        lambda **how: shapes.cylinder(1.0, 1.0, 8, **how),
        lambda **how: shapes.sphere(1.0, 1, **how),
        lambda **how: shapes.sphere(1.0, **how),
        lambda **how: shapes.capsule(1.0, 2.0, **how),
        lambda **how: shapes.compound([shapes.Part(shapes.sphere(1.0), HERE)], **how),
    ):
        own = make().deviation
        model = make(name="part", deviation=0.25, volume="pss", solid=False)
        assert (model.name, model.volume, model.is_solid) == ("part", "pss", False)
        assert model.deviation == own + 0.25


def test_a_part_is_placed_scaled_and_mirrored():
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], (10.0, 0.0, 0.0)
    box = shapes.box((1.0, 2.0, 3.0))
    made = shapes.compound([shapes.Part(box, pose, (-2.0, 1.0, 1.0))])
    vertices = made.control_points
    np.testing.assert_allclose(vertices.min(axis=0), (9.0, -1.0, -1.5))
    np.testing.assert_allclose(vertices.max(axis=0), (11.0, 1.0, 1.5))
    assert volume(made) == pytest.approx(12.0), "its faces still point outwards"
    ball = shapes.compound([shapes.Part(shapes.sphere(0.5), pose, (2.0, 2.0, -2.0))])
    found = engine.distance(ball, HERE, shapes.points([[13.0, 0.0, 0.0]]), HERE)
    assert found.lower <= 2.0 <= found.upper and ball.deviation == 0.0
    with pytest.raises(
        engine.ModelError, match=r"compound: sphere: .*all factors must have the same"
    ):
        shapes.compound([shapes.Part(shapes.sphere(0.5), pose, (2.0, 2.0, 1.0))])


def test_unlike_round_parts_become_a_mesh_whose_deviation_holds():
    at = np.eye(4)
    at[0, 3] = 3.0
    made = shapes.compound(
        [shapes.Part(shapes.sphere(0.5), HERE), shapes.Part(shapes.capsule(0.2, 1.0), at)]
    )
    vertices, faces = made.display_mesh(0.0)[:2]
    corners = vertices[faces]
    rng = np.random.default_rng(5)
    inner = np.einsum("kfc,fcx->kfx", rng.dirichlet((0.3,) * 3, (20, len(faces))), corners)
    for places in (vertices, inner.reshape(-1, 3)):
        near = places[:, 0] < 1.5
        off = np.linalg.norm(places[near], axis=1) - 0.5
        x, y, z = (places[~near] - at[:3, 3]).T
        along = np.linalg.norm(np.stack((x, y, z - np.clip(z, -0.5, 0.5))), axis=0) - 0.2
        assert max(np.abs(off).max(), np.abs(along).max()) <= made.deviation
    assert made.deviation < 0.003


def test_shapes_that_differ_in_anything_but_the_name_have_different_digests():
    models = [
        shapes.sphere(0.5),
        shapes.sphere(0.5, deviation=0.1),
        shapes.sphere(0.6),
        shapes.points([[0.0, 0.0, 1.0]], radius=0.5),
        shapes.points([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], radius=0.5),
        shapes.sphere(0.5, 0),
    ]
    assert len({model.digest() for model in models}) == len(models)
    assert shapes.sphere(0.5, name="other").digest() == models[0].digest()
    moved = shapes.sphere(0.5)
    moved.deform([[0.0, 0.0, 1.0]])
    assert moved.digest() == models[3].digest()


def test_meshes_of_which_one_has_an_inside_have_different_digests():
    """Nor has a robust one the inside of one that must enclose it."""
    box = shapes.box((1.0, 1.0, 1.0))
    every = None, True, False, "robust"
    made = [engine.TriangleMesh(box.vertices, box.faces, solid=solid) for solid in every]
    assert len({model.digest() for model in made}) == len(made)


def test_a_solid_of_revolution_alone_stays_one():
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], (1.0, 2.0, 3.0)
    cone = shapes.cone(0.5, 0.2, 1.0, deviation=0.01)
    made = shapes.compound([shapes.Part(cone, pose, (2.0, 2.0, -2.0))], name="tip", deviation=0.1)
    assert isinstance(made, engine.SolidOfRevolution) and made.name == "tip"
    np.testing.assert_array_equal(made.axis, (-1.0, 0.0, 0.0))
    assert made.deviation == pytest.approx(0.12)
    point = shapes.points([[-1.0, 2.0, 3.0]])  # 1 m beyond the narrow end, which is at x = 0
    found = engine.distance(made, HERE, point, HERE)
    assert found.upper == pytest.approx(1.0 + 0.12) and found.lower == pytest.approx(1.0 - 0.12)
    for part, how in (
        (shapes.Part(cone, pose, (2.0, 2.0, 1.0)), {}),
        (shapes.Part(cone, pose), {"solid": False}),
    ):
        other = shapes.compound([part], **how)
        assert type(other) is engine.ParametricSurface
    assert type(shapes.compound([shapes.Part(cone, HERE)] * 2)) is engine.ParametricSurface


def test_solids_of_patches_make_a_union_whichever_way_their_patches_point():
    """Formerly, a point in two parts with opposite normals was taken to be outside."""
    profile = [[0.0, -0.5], [0.4, -0.5], [0.4, 0.5], [0.0, 0.5]]
    up, down = (
        engine.SolidOfRevolution(list(map(engine.Curve, pairwise(corners))))
        for corners in (profile, profile[::-1])
    )
    pose = np.eye(4)
    pose[0, 3] = 0.3
    inside_both, outside = shapes.points([[0.15, 0.0, 0.1]]), shapes.points([[-0.5, 0.0, 0.1]])
    solids = [up, down]
    solids += [
        engine.ParametricSurface.of(solid.nets, name="of", deviation=0.0, solid=True)
        for solid in solids
    ]
    for a, b in product(solids, repeat=2):
        for scale in ((1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)):
            made = shapes.compound([shapes.Part(a, HERE), shapes.Part(b, pose, scale)])
            assert made.is_solid
            depth = engine.signed_distance(inside_both, HERE, made, HERE)
            assert depth.upper == pytest.approx(-0.25, abs=0.01)  # to the wall of b at x = -0.1
            assert engine.signed_distance(outside, HERE, made, HERE).lower > 0.09


def test_patches_make_one_surface_and_none_with_meshes():
    corners = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0.0]]])
    patch = engine.Patch(corners, name="lid", deviation=0.1)
    pose = np.eye(4)
    pose[:3, 3] = 5.0
    parts = [shapes.Part(patch, HERE), shapes.Part(patch, pose, (-2.0, 1.0, 1.0))]
    made = shapes.compound(parts, name="lids", deviation=0.2)
    assert (made.name, made.describe(str)) == (
        "lids",
        "2 patches of degree 1 x 1, 8 control points",
    )
    assert made.deviation == pytest.approx(0.4)
    first, second = np.split(made.control_points, 2)
    assert np.array_equal(first, corners.reshape(-1, 3))
    np.testing.assert_array_equal(second.min(axis=0), (3.0, 5.0, 5.0))
    np.testing.assert_array_equal(second.max(axis=0), (5.0, 6.0, 5.0))
    assert (made.display_mesh(0.0).normals == (0.0, 0.0, 1.0)).all()
    with pytest.raises(
        engine.ModelError, match="compound: lid: a parametric surface, which cannot"
    ):
        shapes.compound([shapes.Part(shapes.box((1, 1, 1)), HERE), parts[0]])
    with pytest.raises(engine.ModelError, match="volume and solid='robust' are only for meshes"):
        shapes.compound(parts, volume="obb")


def test_dimensions_that_are_none_are_refused():
    for make, message in (
        (lambda: shapes.sphere(1.0, 0, deviation=-0.1), "deviation = -0.1"),
        (lambda: shapes.sphere(1.0, -1), "subdivisions = -1: must be at least 0"),
        (lambda: shapes.cylinder(1.0, 1.0, 0), "segments"),
        (lambda: shapes.cylinder(1.0, 1.0, 2), "segments = 2"),
    ):
        with pytest.raises(ValueError, match=message):
            make()
    for make in (lambda: shapes.cylinder(1.0, 1.0, 2.5), lambda: shapes.sphere(1.0, 1.5)):
        with pytest.raises(TypeError, match=r"= [12]\.5: expected a whole number"):
            make()


def test_a_prism_of_many_sides_deviates_by_what_rounding_does():
    for sides in (5_000, 100_000):
        prism = shapes.cylinder(1.0, 1.0, sides)
        radii = np.hypot(*prism.vertices[: 2 * sides, :2].T)
        assert prism.deviation >= np.abs(radii - 1.0).max() + 2.0**-53
