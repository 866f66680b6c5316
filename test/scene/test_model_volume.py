"""The kind of bounding volume of a scene's models."""

import dataclasses
from pathlib import Path

import pytest

from proximity_monitor import engine
from proximity_monitor.scene import UNITS, Body, Sphere, load_model

BALL = Body("ball", None, Sphere(0.5, 2), 1.0, None, "ball", (1.0, 1.0, 1.0, 1.0))


@pytest.mark.parametrize("from_file", [False, True])
def test_it_can_be_chosen(tmp_path, from_file):
    body = BALL
    if from_file:
        path = Path(tmp_path / "ball.off")
        path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
        body = dataclasses.replace(BALL, model=path, primitive=None)
    assert load_model(body, UNITS["m"]).volume == "rss"
    assert load_model(body, UNITS["m"], volume="pss").volume == "pss"
    with pytest.raises(engine.ModelError, match=r"ball.*: volume = 'cube': unknown"):
        load_model(body, UNITS["m"], volume="cube")
