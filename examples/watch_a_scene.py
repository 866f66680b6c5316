"""Watch a scene without ROS: the motion gives poses, each tick gives bounds, bounds give alerts.

python watch_a_scene.py [SCENE]
"""

from __future__ import annotations

import sys

import numpy as np

from proximity_monitor import motion
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.alerts import Alerts
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import find_scene, load_models
from proximity_monitor.scene.state import PoseSample


def main() -> None:
    """Play twenty seconds of the scene's motion, ten ticks a second, as fast as possible."""
    scene = load_scene(find_scene(sys.argv[1] if len(sys.argv) > 1 else "peg"))
    models = load_models(scene)
    moves = motion.from_scene(scene, models)
    monitor, alerts = Monitor(scene, models), Alerts(scene.pairs, scene.unit)
    thresholds = [pair.thresholds for pair in scene.pairs]
    for seconds in np.arange(0.0, 20.0, 0.1).tolist():
        poses = {name: PoseSample(pose) for name, pose in moves.poses(seconds).items()}
        tick = monitor.tick(poses, budget_s=1.0)  # ample, because nothing waits for the tick
        for change in alerts.update(tick, thresholds, seconds):
            print(f"{seconds:4.1f} s  {change.a} - {change.b}: {change.new.value}: {change.reason}")
        monitor.keep(alerts.held)  # ticks list these pairs, however far apart they are


if __name__ == "__main__":
    main()
