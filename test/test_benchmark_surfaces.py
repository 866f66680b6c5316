"""The benchmark of parametric surfaces runs, and no answer contradicts another."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SURFACES = Path(__file__).resolve().parents[1] / "benchmark" / "surfaces.py"
HAS_OCCT = importlib.util.find_spec("OCP") is not None


def surfaces(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    command = [sys.executable, str(SURFACES), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("scene", ["mesh", "wavy", "coaxial", "points"])
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


def test_an_unknown_scene_is_refused_with_the_known_ones(tmp_path):
    done = surfaces("--scene", "nosuch", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "nosuch" in done.stderr
    assert "coaxial" in done.stderr
