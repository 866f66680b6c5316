"""Makes the oracles of this folder importable: importlib mode leaves sys.path alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER))


@pytest.fixture(scope="session", autouse=True)
def bounds_checked(request, tmp_path_factory):
    """The process of test_bounds_check and its cache: a minute, beside the folder's other tests."""
    if not any(item.path.name == "test_bounds_check.py" for item in request.session.items):
        yield None
        return
    cache = tmp_path_factory.mktemp("bounds_checked")
    # Hardly optimised: the check takes longer to compile than to run.
    environment = {
        **os.environ,
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_OPT": "1",
        "NUMBA_CACHE_DIR": str(cache),
        # For PYTHONSAFEPATH would hide the script's own folder.
        "PYTHONPATH": os.pathsep.join(filter(None, (str(FOLDER), os.environ.get("PYTHONPATH")))),
    }
    with subprocess.Popen(
        [sys.executable, str(FOLDER / "ask_everything.py")],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        yield cache, process
        process.kill()
