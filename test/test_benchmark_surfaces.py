"""The benchmark of parametric surfaces runs, and no answer contradicts another."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine

SURFACES = Path(__file__).resolve().parents[1] / "benchmark" / "surfaces.py"
sys.path.insert(0, str(SURFACES.parent))

from surface_scenes import teapot  # noqa: E402 - its folder holds programs and is no package

HAS_OCCT = importlib.util.find_spec("OCP") is not None


def surfaces(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    command = [sys.executable, str(SURFACES), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.long
@pytest.mark.parametrize("scene", ["mesh", "wavy", "coaxial", "teapot", "points"])
def test_bounds_hold_beside_the_peer(scene, tmp_path):
    if scene != "mesh" and not HAS_OCCT:
        pytest.skip("cadquery-ocp is not installed")
    done = surfaces("--scene", scene, "--poses", "2", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    (row,) = json.loads((tmp_path / "surfaces.json").read_text())
    assert row["scene"] == scene
    assert row["contradicted"] == 0
    assert min(row[name] for name in ("queries", "ours_ms", "peer_ms", "ratio", "asked_peer")) > 0
    assert done.stdout == (tmp_path / "surfaces.md").read_text()


def test_the_teapot_is_newells():
    pot = teapot()
    assert len(pot.nets) == 32
    assert len(np.unique(pot.control_points + 0.0, axis=0)) == 290
    extent = np.ptp(pot.control_points, axis=0)
    assert extent == pytest.approx([6.525, 4.0, 3.15])
    collapsed = [net.control[0].std(axis=0).max() == 0.0 for net in pot.nets]
    assert sum(collapsed) == 8  # of the knob and the bottom
    of_nets = engine.ParametricSurface.of
    open_pot = of_nets(pot.nets, name=pot.name, deviation=0.0, solid=None)
    assert "do not close up" in open_pot.not_solid


@pytest.mark.long
def test_rates_of_a_deforming_surface(tmp_path):
    done = surfaces("--scene", "deform", "--poses", "1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "surfaces.json").read_text())
    assert [row["scene"] for row in rows] == ["deform"] * 4
    assert min(row["rate"] for row in rows) > 0.0


@pytest.mark.long
@pytest.mark.skipif(not HAS_OCCT, reason="cadquery-ocp is not installed")
def test_rates_of_an_assembly(tmp_path):
    done = surfaces("--scene", "step", "--poses", "1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    opened, tick, whole = json.loads((tmp_path / "surfaces.json").read_text())
    assert opened["what"].startswith("544 faces in 19 parts")
    assert "76 pairs" in tick["what"]
    assert whole["ms"] > 0.0


def test_an_unknown_scene_is_refused_with_the_known_ones(tmp_path):
    done = surfaces("--scene", "nosuch", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "nosuch" in done.stderr
    assert "coaxial" in done.stderr
