"""The motion section: SI units, exact directions, and faults with their lines."""

import math

import numpy as np
import pytest

TEXT = """\
version: 1
unit: mm
bodies:
  - {name: block, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}
  - {name: shaft, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: piston, primitive: {box: {size: [1, 1, 1]}}, moving: true}
motion:
  slider_crank:
    crank: shaft
    crank_origin: [0, 0, 50]
    crank_axis: [0, 2, 0]
    slide_direction: [0, 0.0007, 1]
    crank_radius: 30
    rod_length: 110
    rpm: 60
    pistons:
      piston: {phase_deg: 90, offset: [0, 20, 0]}
"""


def test_settings_are_in_si_units(load):
    ((effect, settings),) = load(TEXT).motion.items()
    assert effect == "slider_crank"
    assert set(settings) == {
        "crank",
        "crank_origin",
        "crank_axis",
        "slide_direction",
        "crank_radius",
        "rod_length",
        "speed",
        "pistons",
    }
    assert settings["crank"] == "shaft"
    np.testing.assert_allclose(settings["crank_origin"], [0.0, 0.0, 0.05])
    assert settings["crank_radius"] == pytest.approx(0.03)
    assert settings["rod_length"] == pytest.approx(0.11)
    assert settings["speed"] == pytest.approx(math.tau)
    assert list(settings["pistons"]) == ["piston"]
    assert settings["pistons"]["piston"]["phase"] == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(settings["pistons"]["piston"]["offset"], [0.0, 0.02, 0.0])


def test_directions_become_unit_and_perpendicular(load):
    settings = load(TEXT).motion["slider_crank"]
    np.testing.assert_array_equal(settings["crank_axis"], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(settings["slide_direction"], [0.0, 0.0, 1.0], atol=1e-15)


def test_settings_cannot_be_changed(load):
    motion = load(TEXT).motion
    with pytest.raises(TypeError):
        motion["slider_crank"]["speed"] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        motion["slider_crank"]["crank_origin"][0] = 1.0


FAULTS = {
    "unknown effect": (
        "slider_crank:",
        "slider_crnk:",
        "8: motion.slider_crnk: unknown key; did you mean 'slider_crank'?",
    ),
    "no effect": (
        TEXT[TEXT.index("motion:") :],
        "motion: {}\n",
        "7: motion: must have at least 1 key",
    ),
    "key missing": ("    rpm: 60\n", "", "8: motion.slider_crank: needs the key 'rpm'"),
    "unknown key": ("rpm: 60", "rpm: 60\n    rmp: 1", "16: motion.slider_crank.rmp: unknown key"),
    "standing still": ("rpm: 60", "rpm: 0", "15: motion.slider_crank.rpm: must be greater than 0"),
    "unknown crank": (
        "crank: shaft",
        "crank: shft",
        "9: motion.slider_crank.crank: no body is named 'shft'; did you mean 'shaft'?",
    ),
    "fixed crank": (
        "crank: shaft",
        "crank: block",
        "9: motion.slider_crank.crank: 'block' is fixed; to move it, give it 'moving: true'",
    ),
    "unknown piston": (
        "      piston:",
        "      pistol:",
        "17: motion.slider_crank.pistons.pistol: no body is named 'pistol'",
    ),
    "fixed piston": (
        "      piston:",
        "      block:",
        "17: motion.slider_crank.pistons.block: 'block' is fixed",
    ),
    "crank as piston": (
        "      piston:",
        "      shaft:",
        "17: motion.slider_crank.pistons.shaft: 'shaft' is already driven by "
        "motion.slider_crank.crank (line 9)",
    ),
    "no piston": (
        TEXT[TEXT.index("    pistons:") :],
        "    pistons: {}\n",
        "16: motion.slider_crank.pistons: must have at least 1 key (got 0)",
    ),
    "offset missing": (
        ", offset: [0, 20, 0]",
        "",
        "17: motion.slider_crank.pistons.piston: needs the key 'offset'",
    ),
    "offset aside": (
        "[0, 20, 0]",
        "[1, 20, 0]",
        "17: motion.slider_crank.pistons.piston.offset: must be parallel to crank_axis (it is",
    ),
    "no axis": (
        "[0, 2, 0]",
        "[0, 0, 0]",
        "11: motion.slider_crank.crank_axis: must be a direction",
    ),
    "no direction": (
        "[0, 0.0007, 1]",
        "[0, 0, 0]",
        "12: motion.slider_crank.slide_direction: must be a direction",
    ),
    "oblique": (
        "[0, 0.0007, 1]",
        "[0, 1, 1]",
        "12: motion.slider_crank.slide_direction: must be perpendicular to crank_axis (got 45 deg",
    ),
    "short rod": (
        "rod_length: 110",
        "rod_length: 30",
        "14: motion.slider_crank.rod_length: must be more than crank_radius, 30 mm, or the crank",
    ),
}


@pytest.mark.parametrize("old, new, expected", FAULTS.values(), ids=FAULTS)
def test_faults(problems, old, new, expected):
    assert old in TEXT
    found = problems(TEXT.replace(old, new))
    assert any(line.startswith(expected) for line in found), found
