"""Bodies that change their shape: bounds stay certified, and invalid shapes are refused."""

import numpy as np
import pytest
from crowds import assert_certified, exact, placed, samples, text, walk
from scipy.interpolate import BSpline

from proximity_monitor import engine
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PoseSample

COUNT = 8


def told(tick):
    """Return everything that a tick says about pairs except their ages."""
    return [
        (p.index, p.lower, p.upper, p.point_a.tolist(), p.point_b.tolist(), p.status)
        for p in tick.pairs
    ]


def bent(vertices, phase):
    """Bend a body sideways; it stays a solid."""
    lift = 0.15 * np.sin(3.0 * vertices[:, 2] + phase)
    return vertices + np.stack((lift, np.zeros_like(lift), np.zeros_like(lift)), axis=1)


@pytest.mark.parametrize("body", ["", ", solid: false"])
@pytest.mark.parametrize("head", ["", "range: 0.3"])
@pytest.mark.parametrize("budget_s", [0.0, 2e-4, 1.0])
def test_bounds_hold_while_bodies_deform(load, body, head, budget_s):
    scene = load(text(COUNT, head=head, body=body))
    models = load_models(scene)
    model = models["b1"]  # b1 gets its own copy below
    models["b1"] = engine.TriangleMesh(model.vertices, model.faces, solid=model.solid)
    rest = {name: models[name].vertices for name in ("b0", "b1")}
    monitor = Monitor(scene, models)
    for k, poses in enumerate(walk(COUNT, 15, spread=1.2)):
        for name, vertices in rest.items():
            monitor.deform(name, bent(vertices, 0.05 * k))
        tick = monitor.tick(samples(poses), budget_s)
        true = exact(models, poses)
        listed = assert_certified(tick, true)
        assert all(pair in listed or at.upper > 0.3 for pair, at in true.items())


@pytest.mark.long
@pytest.mark.parametrize("budget_s", [0.0, 2e-4, 1.0])
def test_bounds_hold_while_the_control_points_of_a_surface_move(load, tmp_path, budget_s):
    """A sail over a plane so large that it always holds the nearest point, against scipy's splines.

    The sail also swings, so bounds are carried by displacement and by motion at once.
    """
    x, y = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 8)], indexing="ij")
    knots = np.concatenate((np.zeros(3), np.linspace(0.0, 1.0, 6), np.ones(3)))
    rest = np.stack((x, y, np.zeros_like(x)), axis=-1)
    engine.save_geomdl(engine.Patch(rest, knots, knots), tmp_path / "sail.json")
    engine.save_geomdl(engine.Patch(9.0 * rest[::7, ::7]), tmp_path / "deck.json")
    scene = load(
        "version: 1\nunit: m\nbodies:\n"
        "  - {name: deck, model: deck.json, pose: {position: [0, 0, 0]}}\n"
        "  - {name: sail, model: sail.json, moving: true, deforming: true}\n"
    )
    monitor = Monitor(scene, load_models(scene))
    dense = np.linspace(0.0, 1.0, 201)
    basis = BSpline(knots, np.eye(8), 3)(dense)
    at, net = np.eye(4), rest.copy()
    for k in range(25):
        net[..., 2] = 0.2 * np.sin(4.0 * x + 0.11 * k) * np.cos(3.0 * y - 0.07 * k)
        angle = 0.2 * np.sin(0.05 * k)
        at[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        at[2, 3] = 0.6 + 0.02 * np.sin(k)
        monitor.deform("sail", net.reshape(-1, 3))
        (pair,) = monitor.tick(samples({"sail": at.copy()}), budget_s).pairs
        shape = np.einsum("iu,jv,uvc->ijc", basis, basis, net)
        true = (shape @ at[2, :3] + at[2, 3]).min()
        assert pair.lower <= true and true - 1e-4 <= pair.upper  # sampled, so `true` may be larger
        assert budget_s < 1.0 or pair.upper - pair.lower < 1e-9


def test_a_deformation_alone_asks_for_a_new_search(load):
    scene = load(text(3))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    poses = next(walk(3, 1))
    monitor.tick(samples(poses), 1.0)
    monitor.deform("b0", bent(models["b0"].vertices, 1.0))
    tick = monitor.tick(samples(poses), 1.0)
    assert {i for i, p in enumerate(tick.pairs) if "b0" in (p.a, p.b)} == set(tick.searched)
    assert_certified(tick, exact(models, poses))


def test_a_model_that_somebody_else_refits_is_seen(load):
    scene = load(text(3))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    poses = next(walk(3, 1))
    monitor.tick(samples(poses), 1.0)
    models["b0"].deform(5.0 * models["b0"].vertices)
    for budget_s in (0.0, 1.0):
        assert_certified(monitor.tick(samples(poses), budget_s), exact(models, poses))


def test_a_deformation_that_is_none_is_refused_and_changes_nothing(load):
    scene = load(text(3))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    poses = next(walk(3, 1))
    before = monitor.tick(samples(poses), 1.0)
    with pytest.raises(engine.ModelError, match="vertices"):
        monitor.deform("b0", np.full_like(models["b0"].vertices, np.nan))
    assert told(monitor.tick(samples(poses), 0.0)) == told(before)


@pytest.mark.parametrize("by_itself", [True, False])
def test_a_body_that_grows_into_range_while_all_stand_still_is_met(load, by_itself):
    scene = load(text(2, head="range: 0.5"))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    poses = {f"b{i}": placed([3.0 * i, 0.0, 0.0], [0, 0, 0, 1]) for i in range(2)}
    assert monitor.tick(samples(poses), 1.0).far == 1
    grown = 9.0 * models["b0"].vertices
    if by_itself:
        models["b0"].deform(grown)
    else:
        monitor.deform("b0", grown)
    (near,) = monitor.tick(samples(poses), 1.0).pairs
    assert near.lower == exact(models, poses)["b0", "b1"].lower < 0.5


def flattened(vertices):
    return np.zeros_like(vertices)


def torn(vertices):
    """Pull one of the vertices that share a place away from the others."""
    made = vertices.copy()
    made[0] += 0.1
    return made


@pytest.mark.parametrize("change", [flattened, torn])
def test_a_solid_keeps_its_shape_where_the_new_one_encloses_none(load, change):
    scene = load(text(2, body=", solid: true"))
    models = load_models(scene)
    soup = models["b0"].vertices[models["b0"].faces].reshape(-1, 3)
    models["b0"] = engine.TriangleMesh(soup, np.arange(len(soup)).reshape(-1, 3))
    monitor = Monitor(scene, models)
    poses = {f"b{i}": placed([0.2 * i, 0.0, 0.0], [0, 0, 0, 1]) for i in range(2)}
    before = monitor.tick(samples(poses), 1.0)
    with pytest.raises(
        engine.ModelError, match=r"body 'b0' is a solid, but would no longer be one: .*"
    ):
        monitor.deform("b0", change(soup))
    assert (models["b0"].vertices == soup).all()
    after = monitor.tick(samples(poses), 1.0)
    assert_certified(after, exact(models, poses))
    assert after.pairs[0].lower == pytest.approx(before.pairs[0].lower, abs=1e-12)


def test_vertices_of_a_body_that_is_not_there(load):
    scene = load(text(2))
    monitor = Monitor(scene, load_models(scene))
    with pytest.raises(KeyError, match="b7"):
        monitor.deform("b7", np.zeros((3, 3)))


def test_a_body_that_deforms_shares_its_model_with_nobody(load):
    """Otherwise rigid bodies of the same shape would change their shape with it."""
    ball = "primitive: {sphere: {radius: 1}}, moving: true"
    bodies = [f"{{name: {name}, {ball}}}" for name in ("one", "two")]
    bodies += [f"{{name: {name}, {ball}, deforming: true}}" for name in ("soft", "softer")]
    models = load_models(load("\n  - ".join(("version: 1\nunit: m\nbodies:", *bodies)) + "\n"))
    assert models["one"] is models["two"]
    assert len({id(model) for model in models.values()}) == 3


def test_a_robust_solid_that_opens_and_closes_has_no_carried_signs(load, tmp_path):
    """While the lid is up, the ball gets inside far from any surface, so its sign jumps."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    quads = ((0, 2, 6, 4), (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (8, 9, 10, 11))
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    vertices = np.concatenate((corners, corners[[1, 5, 7, 3]]))  # the lid has its own
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "box.obj").write_text("\n".join(lines))
    scene = load(
        "version: 1\nunit: m\nthresholds: {warn: 0.1, stop: 0.05}\nbodies:\n"
        f"  - {{name: box, model: {tmp_path / 'box.obj'}, solid: robust, deforming: true,\n"
        "     pose: {position: [0, 0, 0]}}\n"
        "  - {name: ball, primitive: {sphere: {radius: 0.05}}, moving: true}\n"
    )
    models = load_models(scene)
    monitor = Monitor(scene, models)
    ways = [(3.0, 0.0), (3.0, 2.0), (1.5, 2.0), (1.0, 2.0), (0.6, 2.0), (0.3, 2.0), (0.0, 2.0)]
    ways += [(0.0, 1.0), (0.0, 0.3), (0.0, 0.01), (0.05, 0.0), (0.05, 0.5)]
    rest = np.array(models["box"].control_points)
    for height, lift in ways:
        points = rest.copy()
        points[-4:, 2] += lift
        monitor.deform("box", points)
        at = np.eye(4)
        at[2, 3] = height
        (seen,) = monitor.tick({"ball": PoseSample(at)}, 1.0).pairs
        true = engine.signed_distance(models["box"], np.eye(4), models["ball"], at)
        assert seen.lower <= true.upper + 1e-9
        assert true.lower <= seen.upper + 1e-9


def test_a_tick_that_fails_loses_no_motion(load):
    scene = load(
        "version: 1\nunit: m\nthresholds: {warn: 0.2, stop: 0.1}\nbodies:\n"
        "  - {name: a, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}\n"
        "  - {name: b, primitive: {box: {size: [1, 1, 1]}}, moving: true}\n"
        "pairs: {watch: [{between: [a, b], range: 0.5}]}\n"
    )
    monitor = Monitor(scene, load_models(scene))
    far, near = np.eye(4), np.eye(4)
    far[0, 3], near[0, 3] = 5.0, 1.01
    assert not monitor.tick({"b": PoseSample(far)}, 1.0).pairs
    with pytest.raises(KeyError):
        monitor.tick({"b": PoseSample(near)}, 1.0, silent=["bb"])
    (seen,) = monitor.tick({"b": PoseSample(near)}, 1.0).pairs
    assert seen.upper == pytest.approx(0.01)
    assert not monitor.tick({"b": PoseSample(far)}, 1.0).pairs

    def interrupted(*_):
        raise KeyboardInterrupt

    update, monitor._near.update = monitor._near.update, interrupted
    with pytest.raises(KeyboardInterrupt):
        monitor.tick({"b": PoseSample(near)}, 1.0)
    monitor._near.update = update
    (seen,) = monitor.tick({"b": PoseSample(near)}, 1.0).pairs
    assert seen.upper == pytest.approx(0.01)


def test_what_is_not_watched_has_no_part_in_the_minima(load):
    scene = load(
        "version: 1\nunit: m\nbodies:\n"
        "  - {name: a, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}\n"
        "  - {name: b, primitive: {box: {size: [1, 1, 1]}}, moving: true}\n"
    )
    monitor = Monitor(scene, load_models(scene))
    for ignored, x in (((), 3.0), ((0,), 1.5), ((), 2.5)):
        monitor.ignore(ignored)
        at = np.eye(4)
        at[0, 3] = x
        tick = monitor.tick({"b": PoseSample(at)}, 1.0)
    (seen,) = tick.pairs
    assert seen.session_min == pytest.approx(1.5)
