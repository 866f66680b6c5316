"""Bundled scenes: their tools remake their files, and clearances are as their comments say.

The engine measures the clearances along the scene's own motion. Those of the peg also follow from
its radii.
"""

import filecmp
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import fcl
import numpy as np
import pytest
import trimesh
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from proximity_monitor import engine, motion, scene
from proximity_monitor.scene.opening import load_models

ROOT = Path(__file__).resolve().parents[2]
MM = 1e-3


class Played:
    """A scene and the clearances along its motion, in its unit."""

    def __init__(self, name):
        self.scene = scene.load_scene(scene.bundled(name))
        self.models = load_models(self.scene)
        self.motion = motion.from_scene(self.scene, self.models)
        self._pairs = {(pair.a, pair.b): pair for pair in self.scene.pairs}
        self._poses = {}  # by time

    def poses(self, t):
        """The poses of all bodies at a time."""
        if t in self._poses:
            return self._poses[t]
        poses = {body.name: body.pose for body in self.scene.bodies if not body.moving}
        for robot in self.scene.robots:
            poses |= robot.poses(self.motion.joints(t))
        self._poses[t] = poses | self.motion.poses(t)
        return self._poses[t]

    def clearance(self, a, b, times):
        """Return the exact distances (k,) of two bodies at `times`, in the scene's unit."""
        poses = [self.poses(t) for t in times]
        found = engine.distances(
            self.models[a],
            np.array([each[a] for each in poses]),
            self.models[b],
            np.array([each[b] for each in poses]),
        )
        return found.upper / self.scene.unit.to_metre

    def times(self, count):
        return np.linspace(0.0, self.motion.period_s, count)

    def pair(self, a, b):
        return self._pairs[a, b]

    def warnings(self, a, b, clearances):
        """Return how often a warning begins along these clearances."""
        warned = clearances * self.scene.unit.to_metre <= self.pair(a, b).thresholds.warn
        return int((warned[1:] & ~warned[:-1]).sum())


@pytest.fixture(scope="module")
def cave():
    return Played("cave")


@pytest.fixture(scope="module")
def peg():
    return Played("peg")


@pytest.fixture(scope="module")
def probe():
    return Played("probe")


@pytest.fixture(scope="module")
def arm():
    try:
        return Played("arm")
    except scene.SceneError as error:
        if "pip install example-robot-data" not in str(error):
            raise
        pytest.skip("needs example-robot-data: pip install example-robot-data")


@pytest.fixture(scope="module")
def turbine():
    return Played("turbine")


@pytest.fixture(scope="module")
def chess():
    return Played("chess")


@pytest.mark.long
@pytest.mark.parametrize("name", ["cave", "chess", "interlocked-rings", "peg", "probe", "turbine"])
def test_the_tool_makes_the_bundled_files_again(name, tmp_path):
    tool = ROOT / "tools" / f"make_{name.replace('-', '_')}_scene.py"
    environment = os.environ | {"PYTHONSAFEPATH": ""}  # the tools import each other
    subprocess.run(
        [sys.executable, str(tool), str(tmp_path)], env=environment, check=True, capture_output=True
    )
    bundled = scene.bundled(name).parent
    files = [file.relative_to(tmp_path) for file in tmp_path.rglob("*") if file.is_file()]
    assert {file.suffix for file in files} <= {".ply", ".csv", ".json"}
    same, other, missing = filecmp.cmpfiles(tmp_path, bundled, files, shallow=False)
    assert (set(same), other, missing) == (set(files), [], [])


def closed(path):
    mesh = trimesh.load(path, process=False, force="mesh")
    return mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0


def test_solids_are_closed_and_face_outwards():
    for name, file in (
        ("peg", "peg"), ("peg", "block"), ("probe", "pebble"), ("cave", "torus"),
    ):  # fmt: skip
        assert closed(scene.bundled(name).parent / "meshes" / f"{file}.ply"), file


def test_every_motion_closes_its_loop(cave, chess, peg, probe, arm, turbine):
    for played in (cave, chess, peg, probe, arm, turbine):
        first, last = played.poses(0.0), played.poses(played.motion.period_s - 1e-9)
        for name, pose in first.items():
            np.testing.assert_allclose(pose, last[name], atol=1e-6)


# cave


def test_the_torus_threads_the_cave_and_stays_clear(cave):
    assert len(cave.models["torus"].faces) == 20_000
    assert len(cave.models["cave"].faces) == 50_992
    found = cave.clearance("torus", "cave", cave.times(4001))
    assert 0.0083 < found.min() < 0.0086
    assert 0.14 < np.median(found) < 0.15
    assert cave.warnings("torus", "cave", found) == 4
    assert found.min() > cave.pair("torus", "cave").thresholds.stop


# peg


def test_the_block_has_a_square_top_with_a_round_hole():
    mesh = trimesh.load(scene.bundled("peg").parent / "meshes" / "block.ply", process=False)
    top = (mesh.triangles[:, :, 2] == 0.0).all(axis=1)
    hole = 80 * 11.0**2 * math.tan(math.pi / 80)  # circumscribed about 11 mm
    assert mesh.area_faces[top].sum() == pytest.approx(60.0**2 - hole)
    np.testing.assert_allclose(mesh.face_normals[top][:, 2], 1.0)


def fcl_distance(peg, t):
    """Return the distance by FCL, which shares no code with the engine, in millimetres."""
    objects = []
    for name, pose in peg.poses(t).items():
        mesh = peg.models[name]
        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices), len(mesh.faces))
        model.addSubModel(mesh.vertices, mesh.faces)
        model.endModel()
        objects.append(fcl.CollisionObject(model, fcl.Transform(pose[:3, :3], pose[:3, 3])))
    return fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult()) / MM


@pytest.mark.parametrize(
    ("t", "expected"),
    [
        (4.6, 0.02),  # 0.03 mm off the axis
        (5.5, 0.035),  # 0.015 mm off it
        (6.0, 0.05),
        (11.7, 0.05),  # on the axis, at some depth
        (14.0, 0.05),  # at rest above the floor
    ],
)
def test_the_clearance_of_the_peg_is_the_radii_s(peg, t, expected):
    assert peg.clearance("peg", "block", [t])[0] == pytest.approx(expected, abs=1e-8)
    assert fcl_distance(peg, t) == pytest.approx(expected, abs=1e-8)


def test_the_tilted_peg_is_nearest_where_its_comment_says(peg):
    """At 24 mm, the tip is 23 mm below the mouth's edge, which is 1 mm down.

    There the tilted axis is off by 23 mm times the tilt's tangent.
    """
    about = 0.05 - 23.0 * math.tan(math.radians(0.1))
    assert about == pytest.approx(0.0098, abs=1e-4)
    (found,) = peg.clearance("peg", "block", [9.0])
    assert found == pytest.approx(about, abs=1e-4)
    assert found == pytest.approx(0.0098, abs=5e-5)
    assert fcl_distance(peg, 9.0) == pytest.approx(found, abs=1e-8)


def test_the_peg_never_touches_and_never_reaches_the_floor(peg):
    times = peg.times(2001)
    found = peg.clearance("peg", "block", times)
    assert times[found.argmin()] == pytest.approx(9.0)
    assert found.min() * MM > peg.pair("peg", "block").thresholds.stop
    assert peg.warnings("peg", "block", found) == 2
    deepest = min(peg.poses(t)["peg"][2, 3] for t in times)
    assert deepest == pytest.approx(-39.5 * MM)


# probe


def test_the_tip_comes_near_three_times_and_never_touches(probe):
    assert (probe.scene.rate_hz, probe.scene.budget_s) == (1000.0, 0.0005)
    times = probe.times(12001)
    found = probe.clearance("tip", "pebble", times)
    assert 0.305 < found.min() < 0.315
    assert probe.warnings("tip", "pebble", found) == 3
    began = times[1:][(found[1:] <= 2.0) & (found[:-1] > 2.0)]
    nearest = [t + np.argmin(found[(times >= t) & (times < t + 2.0)]) * times[1] for t in began]
    assert [near - t for near, t in zip(nearest, began, strict=True)] == pytest.approx(
        [0.9] * 3, abs=0.05
    )


def test_the_closest_feature_is_that_of_the_pebble(probe):
    """The feature's triangle and the parameters on it reproduce the closest point."""
    pebble = probe.models["pebble"]
    for t in (0.0, 3.9, 4.1):
        poses = probe.poses(t)
        found = engine.distance(probe.models["tip"], poses["tip"], pebble, poses["pebble"])
        assert found.feature_a.kind == "vertex"
        corners = pebble.vertices[pebble.faces[found.feature_b.index]]
        np.testing.assert_allclose(found.feature_b.parameters @ corners, found.point_b, atol=1e-12)
        np.testing.assert_allclose(found.point_a, poses["tip"][:3, 3], atol=1e-15)


# turbine


def tip_edges():
    """Return points on the tip edges of a blade's two sides, by scipy, in millimetres."""
    text = (scene.bundled("turbine").parent / "models" / "blade.json").read_text()
    made = []
    for patch, end in zip(json.loads(text)["shape"]["data"], (0, -1), strict=False):
        net = np.array(patch["control_points"]["points"])
        edge = net.reshape(patch["size_u"], patch["size_v"], 3)[:, end]
        made.append(BSpline(patch["knotvector_u"], edge, 3)(np.linspace(0.0, 1.0, 2001)))
    return np.concatenate(made)


def to_the_flare(points):
    """Return the distances of points (n, 3) in the shroud to its inner wall, millimetres.

    The wall has radius 100 + 0.08 x + 0.0005 x² about an axis at y = 0.25 mm.
    """
    x, radius = points[:, 0], np.hypot(points[:, 1] - 0.25, points[:, 2])
    foot = x.copy()
    for _ in range(50):  # Newton's method for the foot point on the parabola
        wall, slope = 100.0 + 0.08 * foot + 5e-4 * foot**2, 0.08 + 1e-3 * foot
        wrong = (foot - x) + (wall - radius) * slope
        foot -= wrong / (1.0 + slope**2 + (wall - radius) * 1e-3)
    return np.hypot(foot - x, 100.0 + 0.08 * foot + 5e-4 * foot**2 - radius)


def test_a_blade_is_as_near_to_its_shroud_as_its_comment_says(turbine):
    times = turbine.times(121)
    found = turbine.clearance("blade_1", "shroud", times)
    assert found.min() == pytest.approx(0.2490, abs=1e-4)
    assert found.max() == pytest.approx(0.7474, abs=2e-4)
    assert turbine.warnings("blade_1", "shroud", found) == 1
    assert (found <= 0.4).mean() * 360.0 == pytest.approx(138.0, abs=3.0)
    tip = tip_edges()
    for t, clearance in zip(times[::10], found[::10], strict=True):
        turn = turbine.poses(t)["blade_1"][:3, :3]
        assert to_the_flare(tip @ turn.T).min() == pytest.approx(clearance, abs=1e-5)
    assert turbine.clearance("blade_1", "blade_2", [0.0])[0] == pytest.approx(29.62, abs=0.005)


def test_the_turbine_s_models_close_up_and_face_outwards():
    for file in sorted((scene.bundled("turbine").parent / "models").iterdir()):
        shown = engine.load(file, solid=True).display_mesh(1e-3)
        volume = np.linalg.det(shown.corners()).sum() / 6.0
        assert volume > 0.0, file


# chess


SHAPES = ("pawn", "cup", "bottle", "table", "light_mill")


def outline(name):
    """Return points (n, 2) of a profile, rho and z in mm, by scipy."""
    file = scene.bundled("chess").parent / "models" / f"{name}.json"
    (curve,) = json.loads(file.read_text())["revolution"]["profile"]
    points = np.array(curve["control_points"]["points"])
    made = BSpline(curve["knotvector"], points, curve["degree"])
    return made(np.linspace(*np.array(curve["knotvector"])[[0, -1]], 4001))


def test_the_pawn_dips_into_the_cup_as_its_comment_says(chess):
    found = chess.clearance("pawn", "cup", chess.times(201))
    assert found.min() == pytest.approx(1.109, abs=1e-3)
    assert chess.warnings("pawn", "cup", found) == 1
    # The same clearance, from points of the pawn's surface to the cup's profile in its half-plane.
    at = np.linalg.inv(chess.poses(11.5)["cup"]) @ chess.poses(11.5)["pawn"]
    rho, z = outline("pawn")[::4].T
    turn = np.linspace(0.0, math.tau, 180, endpoint=False)[:, None]
    points = np.stack((rho * np.cos(turn), rho * np.sin(turn), 0 * turn + z), axis=-1)
    x, y, z = (points.reshape(-1, 3) @ at[:3, :3].T + at[:3, 3] / MM).T
    near, _ = cKDTree(outline("cup")).query(np.column_stack((np.hypot(x, y), z)))
    assert 1.109 - 1e-3 <= near.min() < 1.12


def test_the_cup_over_the_board_is_as_near_all_around_and_known_soon(chess):
    described = scene.load_scene(scene.bundled("chess"))
    pair = next(each for each in described.pairs if {each.a, each.b} == {"cup", "board"})
    board = next(body for body in described.bodies if body.name == "board").pose
    models, cup = chess.models, chess.poses(0.0)["cup"]
    found = engine.distance(models["cup"], cup, models["board"], board, abs_err=pair.abs_err)
    assert found.status is engine.Status.WITHIN_TOLERANCE
    assert found.bound_tests < 2000


def test_the_changing_solid_is_each_of_the_five_and_stays_clear(chess):
    """It is a solid at every time: `deform` raises if its profile would cross itself."""
    model, rest = chess.models["changing"], chess.models["changing"].control_points
    for k, shape in enumerate(SHAPES):
        points = chess.motion.control_points(4.0 * k)["changing"]
        np.testing.assert_allclose(
            points, chess.models.get(shape, model).control_points, atol=1e-15
        )
    least = {}
    for t in chess.times(101):
        model.deform(chess.motion.control_points(t)["changing"])
        for name in ("cup", "table", "light_mill", "bottle"):
            (found,) = chess.clearance(name, "changing", [t])
            least[name] = min(least.get(name, np.inf), found)
    model.deform(rest)
    across = 2.0 * outline("table")[:, 0].max()
    assert least["table"] == pytest.approx(113.0 + 5.0 - across, abs=1e-4)
    assert least["table"] <= chess.pair("table", "changing").thresholds.warn / MM
    assert min(least.values()) == least["table"]


# arm


STATED = {
    ("jaw_2", "panda_leftfinger"): 12.0,
    ("jaw_1", "panda_rightfinger"): 12.0,
    ("jaw_1", "panda_hand"): 27.4,
    ("jaw_2", "panda_hand"): 27.4,
    ("wall", "panda_leftfinger"): 20.5,
    ("wall", "panda_rightfinger"): 20.5,
    ("table", "panda_leftfinger"): 40.5,
    ("panda_leftfinger", "panda_rightfinger"): 20.0,
    ("panda_link5", "panda_link7"): 21.5,
}


@pytest.mark.parametrize(("pair", "stated"), STATED.items(), ids=map(" ".join, STATED))
def test_the_arm_is_as_near_as_its_comment_says(arm, pair, stated):
    found = arm.clearance(*pair, arm.times(601))
    assert found.min() == pytest.approx(stated, abs=0.06)


def test_nothing_of_the_arm_stops_it_and_what_it_reaches_for_warns(arm):
    warned = set()
    for pair in arm.scene.pairs:
        nearest = arm.clearance(pair.a, pair.b, arm.times(121)).min() * MM
        assert nearest > pair.thresholds.stop, (pair.a, pair.b)
        if nearest <= pair.thresholds.warn:
            warned.add((pair.a, pair.b))
    assert warned == {pair for pair in STATED if pair[0] in ("jaw_1", "jaw_2", "wall")}


def test_neighbouring_links_of_the_arm_are_not_watched(arm):
    pairs = {frozenset((pair.a, pair.b)) for pair in arm.scene.pairs}
    for i in range(7):
        assert frozenset((f"panda_link{i}", f"panda_link{i + 1}")) not in pairs
    assert frozenset(("panda_hand", "panda_leftfinger")) not in pairs
    assert frozenset(("panda_link7", "panda_hand")) not in pairs
    assert frozenset(("panda_leftfinger", "panda_rightfinger")) in pairs
