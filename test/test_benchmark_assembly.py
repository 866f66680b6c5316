"""The scheduler's benchmark runs, and its bounds hold. No test checks how fast it is."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

ASSEMBLY = Path(__file__).resolve().parents[1] / "benchmark" / "assembly.py"


@pytest.mark.long
def test_bounds_hold_in_a_crowd_and_of_hard_pairs(tmp_path):
    # A script finds the modules beside it only if this variable is not set.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    command = [sys.executable, str(ASSEMBLY), "--quick", "--bodies", "12", "--out", str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "assembly.csv").open(newline="") as file:
        rows = {row["scene"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["crowd/12", "pair/close", "pair/nested"]
    assert int(rows["crowd/12"]["pairs"]) == 66
    assert all(int(row["wrong"]) == 0 for row in rows.values())
    for row in rows.values():
        for name in ("median_ms", "p99_ms", "max_ms", "cpu_median_ms", "near", "searched"):
            assert float(row[name]) > 0.0, (row["scene"], name)
    assert "crowd/12" in done.stdout
    assert (tmp_path / "assembly.md").read_text() == done.stdout
