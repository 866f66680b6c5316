"""The time left in an alert does not depend on whether somebody asks for distances."""

import math

import numpy as np
import pytest
from crowds import placed, samples

from proximity_monitor.scene.alerts import Alerts, Level
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.relative_motion import Course

SCENE = """version: 1
unit: m
thresholds: {warn: 0.3, stop: 0.1}
bodies:
  - {name: torus, primitive: {cylinder: {radius: 1.0, height: 0.4, segments: 96}}, moving: true}
  - {name: ball, primitive: {sphere: {radius: 0.5, subdivisions: 4}}, moving: true}
pairs: all
"""
PERIOD_S = 0.02
TURN = np.array([0.3, 0.2, 0.5, 0.8])


def alerts_of(scene, models, distances):
    """Return all alerts while the ball comes down on the turned cylinder's rim and touches it."""
    monitor, alerts = Monitor(scene, models), Alerts(scene.pairs, scene.unit)
    limits, before, made = [pair.thresholds for pair in scene.pairs], None, []
    for k in range(120):
        poses = {
            "torus": placed([0.0, 0.0, 0.0], TURN),
            "ball": placed([0.7, 0.2, 2.2 - 0.015 * k], [0.1 * k, 0.0, 0.0, 1.0]),
        }
        tick = monitor.tick(samples(poses), 1.0, distances=distances)
        courses = {
            name: Course(before[name], pose, PERIOD_S) if before else None
            for name, pose in poses.items()
        }
        made += alerts.update(tick, limits, k * PERIOD_S, courses.get)
        before = poses
    return made


def test_the_time_left_is_the_same_whether_anybody_wants_distances(load):
    scene = load(SCENE)
    models = load_models(scene)
    asked, alone = (alerts_of(scene, models, distances) for distances in (True, False))
    assert [(a.old, a.new) for a in asked] == [(a.old, a.new) for a in alone]
    assert {Level.WARN, Level.STOP} <= {a.new for a in alone}
    for with_, without in zip(asked, alone, strict=True):
        assert math.isnan(without.seconds_left) == math.isnan(with_.seconds_left)
        if with_.new in (Level.WARN, Level.STOP):
            assert without.seconds_left == pytest.approx(with_.seconds_left, rel=0.02)
            assert without.motion.closing == pytest.approx(with_.motion.closing, rel=0.02)
