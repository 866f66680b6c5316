"""The scenes of benchmark and study are what their descriptions say, whatever their seeds."""

import numpy as np
import pytest

from proximity_monitor.study import surfaces


def test_nets_that_touch_at_a_pose_are_no_scene_of_nets_that_are_apart(monkeypatch):
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = 1.0, 2.0, 0.0
    monkeypatch.setattr(surfaces, "_beside", lambda random: poses)
    with pytest.raises(ValueError, match="touch, or nearly so, at pose 2: take another seed"):
        surfaces.random_nets()
    poses[2, 2, 3] = 1.5
    assert len(surfaces.random_nets().tracks[0].poses_b) == 3
