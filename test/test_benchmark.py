"""The benchmark runs, and its engines agree. No test checks how fast they are."""

from __future__ import annotations

import csv
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = Path(__file__).resolve().parents[1] / "benchmark"
sys.path.insert(0, str(BENCHMARK))

import budget  # noqa: E402 - its folder holds programs and is no package

COMPARE = BENCHMARK / "compare.py"
PEERS = [name for name in ("fcl", "coal") if importlib.util.find_spec(name)]


def compare(*arguments: str) -> subprocess.CompletedProcess[str]:
    # A script finds the modules beside it only if this variable is not set.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    command = [sys.executable, str(COMPARE), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.long
@pytest.mark.skipif(not PEERS, reason="neither python-fcl nor coal is installed")
def test_engines_agree_side_by_side(tmp_path):
    done = compare("--quick", "--scene", "chain", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    with (tmp_path / "compare.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["scene"] == "chain"
    assert int(row["queries"]) == 45 * 32 * 2
    assert float(row["disagreement"]) < 1e-9
    positive = {
        "triangles",
        "bound_tests",
        "ideal_bound_tests",
        "primitive_tests",
        "bound_tests_10",
        "primitive_tests_10",
    }
    positive |= {"bytes_per_triangle", "ours_build_s"}
    for name in ("ours", "ours_10", "batch", "batch_10", *PEERS):
        positive |= {f"{name}_median_us", f"{name}_mean_us"}
    for peer in PEERS:
        positive |= {f"{peer}_build_s", f"{peer}_ratio", f"{peer}_ratio_10"}
        positive |= {f"{peer}_ratio_means", f"{peer}_ratio_batch", f"{peer}_ratio_batch_10"}
    assert {name for name in positive if not float(row[name]) > 0.0} == set()
    # A pair remembers its last pose, which saves some of the tests that an ideal search must make.
    assert 0.5 <= float(row["bound_tests_to_ideal"]) <= 1.5
    assert "geometric mean" in done.stdout
    assert done.stdout == (tmp_path / "compare.md").read_text()


@pytest.mark.skipif(not PEERS, reason="neither python-fcl nor coal is installed")
def test_unknown_scene_is_refused_with_the_known_ones(tmp_path):
    done = compare("--scene", "nosuch", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "nosuch" in done.stderr
    assert "cave/random" in done.stderr


@pytest.mark.skipif(not PEERS, reason="neither python-fcl nor coal is installed")
def test_a_folder_without_pqp_is_refused(tmp_path):
    done = compare("--pqp", str(tmp_path), "--out", str(tmp_path))
    assert done.returncode == 1
    assert done.stderr.startswith("--pqp: missing sources of PQP: ")
    assert str(tmp_path / "PQP.cpp") in done.stderr


def test_overruns_are_those_of_the_calls_that_the_budget_ended_in_every_column(capsys):
    """Of the first scene, most calls ended by themselves, long before the budget of 1000 µs."""
    early, late = np.full((99, 2), -900e-6), np.array([[30e-6, 40e-6]])
    few, many = np.concatenate((early, late)), np.full((100, 2), 10e-6)
    budget._print(
        {"asked": [("first", 1000, few), ("second", 1000, many)], "none": [("s", 9, early)]}
    )
    *_, row, none = capsys.readouterr().out.splitlines()
    assert row == "| asked | 101 | 10 | 10 | 30 | 10 | 40 | first, 1000 µs: 30 |"
    assert none == "| none | 0 | | | | | | |"
