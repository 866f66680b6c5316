"""Nothing is read or written beyond an array: numba's own check watches a few questions."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent


@pytest.mark.long
def test_every_index_is_in_bounds(tmp_path):
    """All kernels are compiled anew, which takes two minutes: `make indices` does it alone."""
    # Not optimised: the check takes longer to compile than to run.
    environment = {
        **os.environ,
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_OPT": "0",
        "NUMBA_CACHE_DIR": str(tmp_path),
        # For PYTHONSAFEPATH would hide the script's own folder.
        "PYTHONPATH": os.pathsep.join(filter(None, (str(FOLDER), os.environ.get("PYTHONPATH")))),
    }
    command = [sys.executable, str(FOLDER / "ask_everything.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "every index was in bounds"
    # All was compiled for this run, as it said, once.
    said = [line for line in done.stderr.splitlines() if "compiling" in line]
    assert len(said) == 1
    assert str(tmp_path) in said[0]
