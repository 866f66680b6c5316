"""Meshes of primitives, in metres."""

import dataclasses
import math

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import (
    UNITS,
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Point,
    Sphere,
    Torus,
    load_model,
)
from proximity_monitor.scene.description import Compound, Part

MM = UNITS["mm"]
BODY = Body(
    name="thing",
    model=None,
    primitive=Box((0.1, 0.2, 0.3)),
    scale=1.0,
    pose=None,
    topic="thing",
    colour=(1.0, 1.0, 1.0, 1.0),
)


def with_shape(primitive, scale=1.0):
    return dataclasses.replace(BODY, primitive=primitive, scale=scale)


def volume(mesh):
    """Return the signed volume. It is positive if the faces are closed and look outward."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def edges_match(mesh):
    """Return whether each edge is used once in each direction, as in a closed surface."""
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    forward = sorted(map(tuple, edges.tolist()))
    return forward == sorted(map(tuple, edges[:, ::-1].tolist())) and len(set(forward)) == len(
        forward
    )


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_box(scale):
    mesh = load_model(with_shape(Box((0.1, 0.2, 0.3)), scale), MM)
    assert mesh.name == "thing"
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.05 * scale, 0.1 * scale, 0.15 * scale])
    np.testing.assert_allclose(mesh.vertices.min(axis=0), -mesh.vertices.max(axis=0))
    assert volume(mesh) == pytest.approx(0.006 * scale**3)
    assert edges_match(mesh)


def to_cylinder(points, radius, height):
    """Return the signed distances of points (n, 3) to a cylinder about z, analytically."""
    across = np.hypot(points[:, 0], points[:, 1]) - radius
    along = np.abs(points[:, 2]) - height / 2
    outside = np.hypot(np.maximum(across, 0.0), np.maximum(along, 0.0))
    return outside + np.minimum(np.maximum(across, along), 0.0)


def random_pose(rng, spread):
    """Return a pose with a random rotation, by a unit quaternion, and a random place."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, spread * rng.normal(size=3)
    return pose


@pytest.mark.parametrize("segments", [None, 3, 64])
def test_a_cylinder_is_one_within_its_deviation(segments):
    mesh = load_model(with_shape(Cylinder(0.5, 2.0, segments), scale=2.0), MM)
    assert mesh.is_solid
    if segments is None:
        assert mesh.deviation < 1e-14
    else:
        assert edges_match(mesh)
        assert mesh.deviation == pytest.approx(math.tan(math.pi / segments / 2) ** 2)
    ball = engine.points([[0.0, 0.0, 0.0]], radius=0.3)
    rng = np.random.default_rng(1)
    for _ in range(60):
        pose, place = random_pose(rng, 2.0), random_pose(rng, 2.0)
        local = (place[:3, 3] - pose[:3, 3]) @ pose[:3, :3]
        true = to_cylinder(local[None], 1.0, 4.0)[0] - 0.3
        found = engine.signed_distance(mesh, pose, ball, place)
        assert found.lower <= true or true < 0.0
        assert max(true, -0.6) <= found.upper
        if true > 2.0 * mesh.deviation:
            assert found.upper - found.lower <= 2.0 * mesh.deviation + 1e-11


def test_a_cylinder_is_a_prism_where_it_has_to_be_a_mesh():
    body = with_shape(Cylinder(0.5, 2.0))
    for made in (
        load_model(dataclasses.replace(body, deforming=True), MM),
        load_model(dataclasses.replace(body, solid="robust"), MM),
        load_model(body, MM, volume="pss"),
    ):
        assert edges_match(made) and len(made.faces) == 4 * 64
    assert load_model(body, MM).kind == "solid of revolution"


@pytest.mark.parametrize("subdivisions", [0, 3])
def test_a_sphere_that_is_to_be_a_mesh_is_one_within_its_deviation(subdivisions):
    mesh = load_model(with_shape(Sphere(0.25, subdivisions)), MM)
    assert len(mesh.faces) == 20 * 4**subdivisions
    assert edges_match(mesh) and volume(mesh) > 0.0
    normals = np.cross(*(np.diff(mesh.vertices[mesh.faces], axis=1)[:, i] for i in range(2)))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = np.einsum("ij,ij->i", normals, mesh.vertices[mesh.faces[:, 0]]).min()
    corners = np.linalg.norm(mesh.vertices, axis=1)
    assert corners.max() - 0.25 <= mesh.deviation and 0.25 - inside <= mesh.deviation
    assert mesh.deviation == pytest.approx(max(corners.max() - 0.25, 0.25 - inside), rel=1e-6)


def test_spheres_and_capsules_are_exact():
    ball = load_model(with_shape(Sphere(0.25), scale=2.0), MM)
    capsule = load_model(with_shape(Capsule(0.1, 0.6), scale=2.0), MM)
    assert ball.is_solid and capsule.is_solid and ball.deviation == capsule.deviation == 0.0
    rng = np.random.default_rng(2)
    for _ in range(50):
        pose, place = random_pose(rng, 2.0), random_pose(rng, 2.0)
        local = (place[:3, 3] - pose[:3, 3]) @ pose[:3, :3]
        local[2] -= np.clip(local[2], -0.6, 0.6)
        true = np.linalg.norm(local) - 0.2 - 0.5
        found = engine.signed_distance(capsule, pose, ball, place)
        expected = max(true, -0.4)
        assert found.lower - 1e-15 <= expected <= found.upper + 1e-15
        assert found.upper - found.lower < 1e-12


@pytest.mark.parametrize("solid", [None, False])
@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize(
    "shape, distances",
    [  # of points at (rho, z); the walls of the cones have slopes of 3 : 4
        (
            Cone(0.3, 0.4),
            {
                (0.0, 0.5): 0.3,  # over the apex
                (0.1, -0.5): 0.3,
                (0.35, 0.15): 0.25,  # from the middle of the wall
                (0.6, -0.6): 0.5,  # from the rim
                (0.0, -0.1): -0.1,
            },
        ),
        (
            Cone(0.1, 0.4, 0.4),
            {
                (0.3, 0.3): 0.1,
                (0.05, -0.3): 0.1,
                (0.45, -0.15): 0.25,
                (0.7, 0.6): 0.5,
                (0.2, 0.15): -0.05,
            },
        ),
        (
            Torus(0.3, 0.1),
            {(0.0, 0.0): 0.2, (0.6, 0.4): 0.4, (0.0, 0.4): 0.4, (0.3, 0.02): -0.08},
        ),
        (Torus(0.2, 0.2), {(0.0, 0.0): 0.0, (0.0, 0.15): 0.05, (0.5, 0.4): 0.3, (0.1, 0.0): -0.1}),
    ],
)
def test_cones_and_tori_are_exact(shape, distances, scale, solid):
    model = load_model(dataclasses.replace(with_shape(shape, scale), solid=solid), MM)
    assert (model.is_solid, model.name) == (solid is None, "thing")
    assert model.deviation < 1e-14
    pose = random_pose(np.random.default_rng(4), 2.0)
    for angle, ((rho, z), true) in enumerate(distances.items()):
        probe = scale * np.array([[rho * math.cos(angle), rho * math.sin(angle), z]])
        found = engine.signed_distance(model, pose, engine.points(probe), pose)
        expected = scale * (true if solid is None else abs(true))
        assert found.lower - 1e-14 <= expected <= found.upper + 1e-14
        # From the axis, a whole circle is nearest: bounds are wider. A depth has a relative error.
        width = (1e-11 if rho else 1e-5) + 0.003 * max(-expected, 0.0)
        assert found.upper - found.lower <= width


def test_a_cone_in_a_ring():
    """The centre circle of the tube, at rho = 0.3 and z = 0, is 0.12 from the cone's wall."""
    cone, ring = (
        load_model(with_shape(Cone(0.3, 0.4)), MM),
        load_model(with_shape(Torus(0.3, 0.1)), MM),
    )
    found = engine.signed_distance(cone, np.eye(4), ring, np.eye(4))
    assert found.lower <= 0.02 + 1e-14 and found.upper == pytest.approx(0.02, abs=1e-12)
    box = load_model(with_shape(Box((1.0, 1.0, 0.2))), MM)
    below = np.eye(4)
    below[2, 3] = -0.5
    for round_one, gap in ((cone, 0.2), (ring, 0.3)):
        found = engine.signed_distance(round_one, np.eye(4), box, below)
        assert found.lower <= gap + 1e-14 and found.upper == pytest.approx(gap, abs=1e-12)
        assert found.upper - found.lower < 1e-9


def test_pictures_of_swept_models_lie_on_their_surfaces():
    for shape, enclosed in (
        (Sphere(0.25), 4 / 3 * math.pi * 0.25**3),
        (Capsule(0.1, 0.6), 4 / 3 * math.pi * 0.1**3 + math.pi * 0.1**2 * 0.6),
    ):
        model = load_model(with_shape(shape), MM)
        sizes = []
        for tolerance in (0.03, 0.01, 0.0015):
            drawn = model.display_mesh(tolerance)
            sizes.append(len(drawn.faces))
            assert edges_match(drawn)
            mesh = engine.TriangleMesh(drawn.vertices, drawn.faces, solid=True)
            away = engine.closest_points(model, np.eye(4), drawn.vertices)
            assert (away.upper < 1e-12).all()
            inside = engine.closest_points(model, np.eye(4), drawn.corners().mean(axis=1))
            assert (inside.upper <= tolerance).all()
            core = np.linalg.norm(drawn.vertices, axis=1).max() - shape.radius
            ends = np.linspace([0, 0, -core], [0, 0, core], 200)
            axis = engine.shapes.polyline(ends)
            middles = engine.closest_points(axis, np.eye(4), drawn.corners().mean(axis=1))
            depth = shape.radius - middles.lower.min()  # of the faces below the surface
            assert 0.5 * drawn.off < depth <= drawn.off <= tolerance
            assert volume(mesh) < enclosed
        assert volume(mesh) == pytest.approx(enclosed, rel=0.02)
        assert sizes == sorted(set(sizes)), "the finer, the more"


def test_a_compound_of_spheres_is_exact_and_one_of_unlike_parts_deviates():
    at = {"scale": (1.0, 1.0, 1.0), "rpy": (0.0, 0.0, 0.0)}
    balls = Compound(
        (Part(Sphere(0.1), xyz=(0, 0, 0), **at), Part(Sphere(0.1), xyz=(1, 0, 0), **at))
    )
    model = load_model(with_shape(balls), MM)
    assert (model.swept_radius, model.deviation, len(model.faces)) == (0.1, 0.0, 2)
    for other in (Box((0.1, 0.1, 0.1)), Sphere(0.2), Capsule(0.2, 0.3)):
        parts = (Part(Sphere(0.1), xyz=(0, 0, 0), **at), Part(other, xyz=(1, 0, 0), **at))
        model = load_model(with_shape(Compound(parts)), MM)
        assert model.swept_radius == 0.0 and 0.0 < model.deviation < 0.003 and model.is_solid
        probe = engine.points([[0, 0, 0]], radius=0.05)
        rng = np.random.default_rng(3)
        for _ in range(20):
            way = rng.normal(size=3) * (0.2, 1.0, 1.0)
            way[0] = -abs(way[0])
            place = np.eye(4)
            place[:3, 3] = way / np.linalg.norm(way) * 0.16  # on the side of the small sphere
            found = engine.distance(model, np.eye(4), probe, place)
            assert found.lower <= 0.01 <= found.upper


def test_a_cylinder_with_a_ball_at_either_end_is_a_capsule():
    """The Panda's collision model has such parts. Two capsules may share a ball, at an elbow."""
    turn = (0.0, math.pi / 2.0, 0.0)
    at = {"scale": (1.0, 1.0, 1.0), "rpy": turn}
    rod = Part(Cylinder(0.09, 0.03), xyz=(-0.075, 0.0, 0.06), **at)
    balls = tuple(Part(Sphere(0.09), xyz=(x, 0.0, 0.06), **at) for x in (-0.06, -0.09))
    model = load_model(with_shape(Compound((balls[0], rod, balls[1])), 2.0), MM)
    assert model.swept_radius == 0.18 and len(model.faces) == 1 and model.deviation < 1e-15
    np.testing.assert_allclose(np.sort(model.vertices[:, 0]), (-0.18, -0.12))
    np.testing.assert_allclose(model.vertices[:, 1:], [(0.0, 0.12)] * 2, atol=1e-15)
    other = Part(Cylinder(0.09, 0.2), xyz=(-0.06, 0.0, 0.16), **at | {"rpy": (0.0, 0.0, 0.0)})
    last = Part(Sphere(0.09), xyz=(-0.06, 0.0, 0.26), **at)
    elbow = load_model(with_shape(Compound((rod, other, *balls, last))), MM)
    assert elbow.swept_radius == 0.09 and len(elbow.faces) == 2
    for parts in (
        (rod, balls[0]),  # one end is flat
        (rod, balls[0], Part(Sphere(0.08), xyz=balls[1].xyz, **at)),
        (rod, balls[0], Part(Sphere(0.09), xyz=(-0.0901, 0.0, 0.06), **at)),
    ):
        assert load_model(with_shape(Compound(parts)), MM).swept_radius == 0.0


@pytest.mark.parametrize("solid", [None, "robust", False])
def test_a_part_of_a_compound_encloses_what_it_does_whatever_the_others_are(tmp_path, solid):
    """An open part, a box without its lid, is a surface. The other parts stay solids."""
    box = load_model(with_shape(Box((1.0, 1.0, 1.0))), MM)
    lines = [f"v {x + 3.0} {y} {z}" for x, y, z in box.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in box.faces[:-2]]
    (tmp_path / "open.obj").write_text("\n".join(lines))
    at = {"scale": (1.0, 1.0, 1.0), "xyz": (0.0, 0.0, 0.0), "rpy": (0.0, 0.0, 0.0)}
    parts = (Part(Box((1.0, 1.0, 1.0)), **at), Part(tmp_path / "open.obj", **at))
    body = dataclasses.replace(with_shape(Compound(parts)), solid=solid)
    model, probe, place = load_model(body, MM), engine.points([[0, 0, 0]]), np.eye(4)
    assert model.is_solid is (solid is not False)
    depths = []
    for x in (0.1, 3.1, 1.5):
        place[0, 3] = x
        depths.append(engine.signed_distance(model, np.eye(4), probe, place))
    closed, opened, beside = depths
    assert (closed.upper == pytest.approx(-0.4)) is (solid is not False)
    assert (opened.upper < 0.0) is (solid == "robust")
    assert opened.lower > 0.0 or solid == "robust"
    assert beside.lower == pytest.approx(1.0)
    only = load_model(with_shape(Compound(parts[1:])), MM)
    assert not only.is_solid and len(only.faces) == 10


def test_a_deforming_sphere_is_a_mesh():
    body = dataclasses.replace(BODY, primitive=Sphere(0.25), deforming=True)
    mesh = load_model(body, MM)
    assert len(mesh.faces) == 1280 and mesh.swept_radius == 0.0


@pytest.mark.parametrize(
    "shape",
    [
        Box((0.2, 0.2, 0.2)), Sphere(0.1), Sphere(0.1, 1), Cylinder(0.1, 0.2), Capsule(0.1, 0.2),
        Cylinder(0.1, 0.2, 5), Cone(0.1, 0.2, 0.1), Torus(0.1, 0.1), Point(),
    ],
)  # fmt: skip
@pytest.mark.parametrize("deviation", [0.0, 0.003])
def test_bounds_of_what_deforms_hold_the_gap_of_its_primitive(shape, deviation):
    body = dataclasses.replace(with_shape(shape, 1.5), deviation=deviation)
    still, soft = (
        load_model(dataclasses.replace(body, deforming=deforming), MM) for deforming in (0, 1)
    )
    tip = load_model(with_shape(Point()), MM)
    for away in np.random.default_rng(1).normal(size=(20, 3)):
        pose = np.eye(4)
        pose[:3, 3] = away * 0.4 / np.linalg.norm(away)
        exact = engine.distance(load_model(with_shape(shape, 1.5), MM), np.eye(4), tip, pose)
        for model in (still, soft):
            found = engine.distance(model, np.eye(4), tip, pose)
            assert found.lower <= exact.upper - deviation + 1e-12
            assert found.upper >= exact.lower + deviation - 1e-12


@pytest.mark.parametrize("shape", [Cone(0.3, 0.4), Torus(0.3, 0.1)])
def test_a_deforming_cone_or_torus_is_told_the_control_points_of_its_profile(shape):
    body = dataclasses.replace(BODY, primitive=shape, deforming=True)
    model = load_model(body, MM)
    assert (model.kind, model.control_name) == ("solid of revolution", "control points")
    model.deform(2.0 * model.control_points)
    larger, tip = load_model(with_shape(shape, 2.0), MM), engine.points([[0.5, 0.9, 0.7]])
    found, true = (engine.distance(each, np.eye(4), tip, np.eye(4)) for each in (model, larger))
    assert found.upper == pytest.approx(true.upper, abs=1e-12) and found.lower <= true.upper


def test_point():
    mesh = load_model(with_shape(Point(), 3.0), MM)
    assert (len(mesh.vertices), len(mesh.faces), mesh.radius) == (1, 1, 0.0)
    found = engine.distance(mesh, np.eye(4), load_model(with_shape(Box((2.0, 2.0, 2.0))), MM),
                            np.eye(4))  # fmt: skip
    assert found.upper == pytest.approx(1.0)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_scale_must_be_positive(scale):
    with pytest.raises(ValueError, match="body 'thing': scale must be greater than 0"):
        load_model(with_shape(BODY.primitive, scale), MM)
