"""Deforming bodies: closed forms of the fields, the scene section, and refitted models."""

import math

import numpy as np
import pytest
from dynamics_bodies import box_arrays

from proximity_monitor import engine, motion, scene
from proximity_monitor.engine.models.model import DisplayMesh
from proximity_monitor.motion import Field
from proximity_monitor.motion.dynamics.mass import mass_properties

X, Y, Z = np.eye(3)
REST, FACES = box_arrays(0.02, 0.04, 0.2)
FIELDS = {
    "stretch": {"amplitude": 0.3, "axis": Z},
    "breathe": {"amplitude": 0.2},
    "twist": {"amplitude": math.radians(50.0), "axis": Z},
    "bend": {"amplitude": math.radians(70.0), "axis": Z, "across": X},
    "wave": {"amplitude": 0.01, "axis": Z, "across": X, "wavelength": 0.1},
}


def field(kind, **changes):
    return Field(kind, frequency_hz=0.5, **FIELDS[kind] | changes)


@pytest.mark.parametrize("kind", ["stretch", "breathe", "twist", "bend"])
def test_at_rest_in_the_beginning_and_after_a_period(kind):
    moved = field(kind)
    assert moved.moved(REST, 0.0) == pytest.approx(REST, abs=1e-16)
    assert moved.moved(REST, 2.0) == pytest.approx(REST, abs=1e-15)
    assert np.abs(moved.moved(REST, 0.5) - REST).max() > 0.001


@pytest.mark.parametrize(("kind", "factor"), [("stretch", 1.0), ("breathe", math.exp(0.6))])
def test_volumes_of_the_linear_fields(kind, factor):
    volume = mass_properties(DisplayMesh(REST, FACES), 1.0).mass
    found = mass_properties(DisplayMesh(field(kind).moved(REST, 0.5), FACES), 1.0).mass
    assert found == pytest.approx(factor * volume)


def test_stretch_lengthens_along_its_axis():
    assert np.ptp(field("stretch").moved(REST, 0.5), axis=0) == pytest.approx(
        [0.02 * math.exp(-0.15), 0.04 * math.exp(-0.15), 0.2 * math.exp(0.3)]
    )


def test_twist_turns_the_ends_and_leaves_the_axis():
    points = np.array([[0.01, 0.0, 0.1], [0.01, 0.0, -0.1], [0.0, 0.0, 0.05], [0.01, 0.0, 0.0]])
    c, s = math.cos(math.radians(50.0)), math.sin(math.radians(50.0))
    expected = [
        [0.01 * c, 0.01 * s, 0.1],
        [0.01 * c, -0.01 * s, -0.1],
        [0.0, 0.0, 0.05],
        [0.01, 0, 0],
    ]
    assert field("twist", centre=np.zeros(3)).moved(points, 0.5) == pytest.approx(
        np.array(expected)
    )


def test_bend_makes_the_axis_an_arc_of_the_same_length():
    axis = np.linspace(-0.1, 0.1, 2001)[:, None] * Z
    bent = field("bend").moved(axis, 0.5)
    lengths = np.linalg.norm(np.diff(bent, axis=0), axis=1)
    assert lengths.sum() == pytest.approx(0.2, rel=1e-6)
    radius = 0.1 / math.radians(70.0)
    assert np.linalg.norm(bent - radius * X, axis=1) == pytest.approx(np.full(2001, radius))
    end = bent[-1] - bent[-2]
    assert math.atan2(end[0], end[2]) == pytest.approx(math.radians(70.0), abs=1e-3)


def test_bend_keeps_distances_from_the_axis():
    points = np.array([[0.01, 0.02, 0.1], [0.0, 0.0, 0.1], [0.0, 0.0, -0.1]])
    bent = field("bend").moved(points, 0.5)
    assert np.linalg.norm(bent[0] - bent[1]) == pytest.approx(math.hypot(0.01, 0.02))


def test_a_wave_travels_along_its_axis():
    moved = field("wave", centre=np.zeros(3))
    # A quarter of a period later the same lift is a quarter of a wavelength further on.
    at_zero = moved.moved(0.03 * Z[None], 0.0)
    later = moved.moved(0.055 * Z[None], 0.5)
    assert later[0, 0] == pytest.approx(at_zero[0, 0])
    assert abs(at_zero[0, 0]) > 0.001


@pytest.mark.parametrize("t", [0.0, 0.7, 1.0, 1.9, 3.0, 4.4, 6.0, 7.5])
def test_a_morph_goes_through_all_shapes_and_back(t):
    """Three shapes in six seconds; half-way between two all points are in the middle."""
    shapes = np.stack((2.0 * REST, REST + 1.0))
    moved = Field("morph", frequency_hz=1.0 / 6.0, shapes=shapes).moved(REST, t)
    stops = REST, *shapes, REST
    before, share = divmod(t % 6.0 / 2.0, 1.0)
    way = 0.5 - 0.5 * math.cos(math.pi * share)
    expected = stops[int(before)] + way * (stops[int(before) + 1] - stops[int(before)])
    assert moved == pytest.approx(expected, abs=1e-14)


SCENE = """
version: 1
frame: world
unit: mm
bodies:
  - name: bellows
    primitive: {cylinder: {radius: 20, height: 100}}
    pose: {position: [0, 0, 0]}
    deforming: true
  - {name: wall, primitive: {box: {size: [200, 200, 10]}}, pose: {position: [0, 0, 85]}}
motion:
  deform:
    bodies:
      bellows: {field: stretch, amplitude: 0.25, axis: [0, 0, 2], frequency_hz: 0.5}
"""


def load(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return scene.load_scene(path)


def test_a_scene_deforms_what_it_names_and_moves_nothing(tmp_path):
    described = load(tmp_path, SCENE)
    assert [body.deforming for body in described.bodies] == [True, False]
    made = motion.from_scene(described)
    assert made.bodies == ()
    assert made.poses(1.0) == {}
    assert made.period_s == pytest.approx(2.0)
    assert made.describe() == "deform: 1 body, stretch at 0.5 Hz"
    (name,) = made.control_points(0.5)
    assert name == "bellows"
    assert made.control_points(0.5)[name][:, 2].max() == pytest.approx(0.05 * math.exp(0.25))
    with pytest.raises(ValueError, match=r"t: must be finite \(got nan\)"):
        made.control_points(math.nan)


def test_bodies_of_different_frequencies_repeat_at_once(tmp_path):
    wave = "      wall: {field: breathe, amplitude: 1, frequency_hz: 0.2}\n"
    text = SCENE.replace("[0, 0, 85]}}", "[0, 0, 85]}, deforming: true}")
    made = motion.from_scene(load(tmp_path, text + wave))
    assert (made.period_s, made.once_s) == (pytest.approx(10.0), pytest.approx(5.0))
    for name, points in made.control_points(1.3).items():
        assert made.control_points(11.3)[name] == pytest.approx(points, abs=1e-12)


def test_a_refitted_mesh_is_as_near_as_a_new_one(tmp_path):
    described = load(tmp_path, SCENE)
    models = {body.name: scene.load_model(body, described.unit) for body in described.bodies}
    made = motion.from_scene(described, models)
    poses = {body.name: body.pose for body in described.bodies}
    pair = engine.Pair(models["bellows"], models["wall"])
    for t in np.linspace(0.0, 2.0, 9):
        models["bellows"].deform(made.control_points(t)["bellows"])
        found = pair.distance(poses["bellows"], poses["wall"])
        top = 0.05 * math.exp(0.25 * math.sin(math.pi * t))
        assert found.lower <= 0.08 - top + 1e-15
        assert found.upper == pytest.approx(0.08 - top + models["bellows"].deviation)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("    deforming: true\n", "", "'bellows' is rigid; give it 'deforming: true'"),
        ("axis: [0, 0, 2], ", "", "the field 'stretch' needs the key 'axis'"),
        ("axis: [0, 0, 2]", "axis: [0, 0, 0]", "axis: must be a direction"),
        ("field: stretch", "field: bend", "the field 'bend' needs the key 'towards'"),
        ("field: stretch", "field: bend, towards: [0, 1, 1]", "towards: must be perpendicular"),
        ("field: stretch", "field: breathe", "axis: cannot be used with the field 'breathe'"),
        ("field: stretch", "field: twist, wavelength: 3", "wavelength: cannot be used"),
        ("field: stretch", "field: melt", "field: must be one of"),
        ("amplitude: 0.25", "amplitude: -120", r"amplitude: must be from -10 to 10 for the field"),
        ("amplitude: 0.25, ", "", "the field 'stretch' needs the key 'amplitude'"),
        ("amplitude: 0.25", "amplitude: 0.25, through: [a.json]", "through: cannot be used"),
        (
            "field: stretch, amplitude: 0.25, axis: [0, 0, 2]",
            "field: morph",
            "the field 'morph' needs the key 'through'",
        ),
        (
            "field: stretch, amplitude: 0.25, axis: [0, 0, 2]",
            "field: morph, through: [a.json]",
            r"through\[0\]: no such file: .*a.json",
        ),
        (
            "field: stretch, amplitude: 0.25, axis: [0, 0, 2]",
            "field: morph, amplitude: 1, through: [scene.yaml]",
            "amplitude: cannot be used with the field 'morph'",
        ),
        ("      bellows:", "      balloon:", "no body is named 'balloon'"),
    ],
)
def test_bad_settings_are_refused_by_key(tmp_path, old, new, words):
    with pytest.raises(scene.SceneError, match=words):
        load(tmp_path, SCENE.replace(old, new, 1))


MORPH = """
version: 1
unit: mm
bodies:
  - {name: drop, model: rest.json, scale: 2, deforming: true, pose: {position: [0, 0, 0]}}
  - {name: wall, primitive: {box: {size: [9, 9, 9]}}, pose: {position: [900, 0, 0]}}
motion: {deform: {bodies: {drop: {field: morph, through: [OTHER.json], frequency_hz: 0.5}}}}
"""


def test_a_morph_between_files(tmp_path):
    """The other shapes have the unit and scale of the body's own, and need as many points."""
    corners = np.array([[0.0, 0], [20, 0], [30, 40], [0, 50]])
    shapes = {"rest": corners, "wide": corners * [1.5, 1], "few": corners[[0, 2, 3]]}
    for name, points in shapes.items():
        knots = [0, *range(len(points)), len(points) - 1]
        made = engine.SolidOfRevolution([engine.Curve(points, knots)])
        engine.save_geomdl(made, tmp_path / f"{name}.json")
    made = motion.from_scene(load(tmp_path, MORPH.replace("OTHER", "wide")))
    assert made.describe() == "deform: 1 body, morph at 0.5 Hz"
    across = np.column_stack((corners[:, 0], 0 * corners[:, 0], corners[:, 1])) * 0.002
    for t, width in ((0.0, 1.0), (0.5, 1.25), (1.0, 1.5), (1.5, 1.25)):
        expected = across * [width, 1, 1]
        assert made.control_points(t)["drop"] == pytest.approx(expected, abs=1e-15)
    with pytest.raises(ValueError, match=r"scene.yaml: .*few.json has 3 control points, .* has 4"):
        motion.from_scene(load(tmp_path, MORPH.replace("OTHER", "few")))
