"""Kernels read and write only inside arrays: numba's own check watches a few queries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent


@pytest.mark.long
def test_every_index_is_in_bounds(tmp_path):
    """This compiles all kernels anew, which takes two minutes. `make indices` runs it alone."""
    # Not optimised: compiling with the check takes longer than running.
    environment = {
        **os.environ,
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_OPT": "0",
        "NUMBA_CACHE_DIR": str(tmp_path),
        # PYTHONSAFEPATH would hide the script's own folder.
        "PYTHONPATH": os.pathsep.join(filter(None, (str(FOLDER), os.environ.get("PYTHONPATH")))),
    }
    command = [sys.executable, str(FOLDER / "ask_everything.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "every index was in bounds"
    # The process compiled its kernels itself, and announced it once.
    said = [line for line in done.stderr.splitlines() if "compiling" in line]
    assert len(said) == 1
    assert str(tmp_path) in said[0]
