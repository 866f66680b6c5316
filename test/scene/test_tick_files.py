"""A tick passes through few files from poses to bounds, so that a reader can follow it."""

import sys
from collections import defaultdict
from pathlib import Path

import pytest
from crowds import assert_certified, exact, samples, text, walk

import proximity_monitor
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models

COUNT = 8
PACKAGE = Path(proximity_monitor.__file__).parent
KERNELS = "proximity_monitor.engine.kernels."
MOST = 9


def files_of(call):
    """Return a call's result and the functions that it ran, by the package's files without kernels.

    A kernel is compiled with all that it calls, so Python does not see the files that it uses.
    """
    functions = defaultdict(set)

    def note(frame, event, _):
        module = frame.f_globals.get("__name__", "")
        if event == "call" and module.startswith("proximity_monitor.") and KERNELS not in module:
            functions[module].add(frame.f_code.co_name)

    sys.setprofile(note)
    try:
        return call(), functions
    finally:
        sys.setprofile(None)


@pytest.mark.parametrize("body", ["", ", solid: false"])
@pytest.mark.parametrize("head", ["", "range: 1.0"])
def test_a_tick_passes_through_nine_files_at_most(load, head, body):
    """Ticks with an overlap do not count: finding its depth leads on into `engine/questions`."""
    scene = load(text(COUNT, head=head, body=body))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    counted = listed = came = 0
    for poses in walk(COUNT, 12, spread=2.5):
        tick, functions = files_of(lambda poses=poses: monitor.tick(samples(poses), 10.0))
        assert_certified(tick, exact(models, poses))
        assert tick.searched and tick.left == 0
        if tick.clearance() > 0.0:
            counted += 1
            listed += len(tick.pairs)
            came += "begin" in functions["proximity_monitor.engine.assembly.schedule"]
            names = sorted(functions)
            assert len(names) <= MOST, f"{len(names)} files: {', '.join(names)}"
    assert counted > 5 and listed > 12 and (came > 1 or not head), "pairs were met on the way"
