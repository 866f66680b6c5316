"""A configured monitor and its tick, which gathers, decides and publishes."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from threading import Thread

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.task import Future
from rclpy.time import Time as RosTime

from proximity_monitor import engine
from proximity_monitor.engine import compiling
from proximity_monitor.ros import spin
from proximity_monitor.ros.cloud_bodies import CloudBodies
from proximity_monitor.ros.diagnostics import Health, NodeState
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.outputs import Outputs
from proximity_monitor.ros.preparing import saying
from proximity_monitor.ros.qos import Incompatible
from proximity_monitor.ros.recorder import dump
from proximity_monitor.ros.scene_parameters import Settings
from proximity_monitor.ros.services import Services
from proximity_monitor.ros.sources import Sources
from proximity_monitor.ros.spin import interruptible
from proximity_monitor.ros.strangers import namesakes, strangers
from proximity_monitor.ros.ticking import Ticking
from proximity_monitor.ros.whereabouts import Whereabouts
from proximity_monitor.scene import Scene
from proximity_monitor.scene.alerts import Alert, Alerts, Level
from proximity_monitor.scene.attachments import Samples
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.recording import Recording
from proximity_monitor.scene.state import NO_POSE_YET, Tick
from proximity_monitor.scene.unseen import Unseen, unseen_containment

SLICE_S = 0.2
"""Seconds. A longer budget is spent in slices of this length, so that a signal ends the node soon
and cleanly, after it has published its results."""

LOGGED = 20
"""How many changes of one tick are logged, one line each."""


class Session:
    """Everything that lives from configure to cleanup.

    The steady clock times ticks and diagnostics, so that they go on while simulated time stands
    still. The node's clock gives stamps, and measures the ages of poses.
    """

    def __init__(self, node: LifecycleNode, scene: Scene, settings: Settings) -> None:
        """Create the publishers; `prepare` creates everything else, and `start` begins to tick.

        Args:
            node: creates the publishers.
            scene: the scene to watch.
            settings: the settings in force at first.
        """
        self.scene = scene
        self.settings = settings
        self._node = node
        self._tick: Tick | None = None
        self._distance_ticks = 0
        self._now_ns = 0
        self._prepared = False
        self._unseen = Unseen(0, (), {})
        self._namesakes = 0
        self._said = ""  # the last text about progress
        self._alerts = Alerts(scene.pairs, scene.unit)
        self._recording = Recording(scene.pairs)
        self._inputs = Inputs(
            [body.name for body in scene.bodies if body.posed],
            settings.frame,
            [robot.name for robot in scene.robots if robot.root is not None],
        )
        self._changeable = [body.name for body in scene.bodies if body.moving or body.deforming]
        self._health = Health(node.get_fully_qualified_name().lstrip("/"), settings.frame)
        self._incompatible = Incompatible(node)
        self._outputs = Outputs(node, scene, settings, self._incompatible)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def prepare(self) -> None:
        """Load the models, prepare the search, and subscribe.

        Meanwhile the topics exist already, and the diagnostics report the progress.

        Raises:
            OSError, ValueError: a model cannot be used, or a parameter's value is illegal.
            KeyboardInterrupt: a signal came.
        """
        node, scene, settings = self._node, self.scene, self.settings
        progress = compiling.Progress(compiling.WATCHING)
        with saying(partial(self._say_progress, progress)), progress, interruptible():
            models = self._models = load_models(scene)
            self._monitor = Monitor(scene, models, threads=settings.threads)
            self._unseen = unseen_containment(scene, models)
        if self._unseen.count:
            node.get_logger().warning(str(self._unseen))
        self._inputs.expect_shapes(
            {body.name: models[body.name].control_name for body in scene.bodies if body.deforming}
            | {body.name: "cloud" for body in scene.bodies if body.cloud is not None}
        )
        self._outputs.show(models)
        self._sources = Sources(
            node,
            scene,
            models,
            settings,
            self._inputs,
            self._incompatible,
            deform=self._deform,
            on_poses=self._take_poses,
        )
        self._clouds = CloudBodies(
            node,
            scene.bodies,
            settings.frame,
            self._inputs,
            self._incompatible,
            self._replace_model,
        )
        self._where = Whereabouts(node, scene, self._inputs, self._clouds, self._monitor.ignore)
        self._services = Services(
            node, reset=self._reset_minima, pause=self._pause, dump=self._dump_recording
        )
        self._ticking = Ticking(node, settings.rate_hz, self._inputs, self._step)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._seconds = node.create_timer(1.0, self._on_second, clock=steady)
        self._prepared = True
        self.apply(settings)

    def apply(self, settings: Settings) -> None:
        """Put new settings in force from the next tick on."""
        before, self.settings = self.settings, settings
        first = self._tick is None
        if first or (before.rel_err, before.abs_err) != (settings.rel_err, settings.abs_err):
            self._monitor.set_tolerance(settings.rel_err, settings.abs_err)
        if first or before.thresholds != settings.thresholds:
            self._monitor.set_thresholds(settings.thresholds)
        if _effort(before) != _effort(settings):
            self._health.timing.forget_window()  # its percentiles are of the old settings
        self._ticking.limit(settings.rate_hz)
        self._ticking.on_pose = settings.tick_on_pose
        self._inputs.timeout_s = settings.pose_timeout_s
        self._outputs.apply(settings)
        self._where.attach(settings.attachments, self._node.get_clock().now().nanoseconds)

    def start(self) -> None:
        """Begin to tick."""
        self._health.timing.forget_window()
        self._alerts.interrupt()
        self._ticking.start()

    def stop(self) -> None:
        """Stop ticking, and remove the last tick's markers from viewers."""
        self._ticking.stop()
        self._outputs.take_down(self._node.get_clock().now().to_msg())

    def close(self) -> None:
        """Stop, and destroy everything that was created."""
        if self._prepared:
            self.stop()
            self._sources.destroy()
            self._clouds.destroy()
            self._services.destroy()
            self._ticking.destroy()
            self._node.destroy_timer(self._seconds)
        self._outputs.destroy()
        self._node.destroy_publisher(self._diagnostics)
        # Each callback forms a reference cycle. Python never collects cycles of objects that
        # existed when `spin` began, so meshes and search trees would stay in memory.
        vars(self).clear()

    def _take_poses(self) -> None:
        self._ticking.take_poses()

    def _step(self) -> None:
        started = time.perf_counter()
        now = self._now()
        stamp = now.to_msg()
        self._clouds.build(now.nanoseconds)
        samples = self._where.samples(now.nanoseconds)
        held = self._inputs.attached
        self._inputs.await_again(
            name for name, at in samples.items() if at and not at.stale and name not in held
        )

        silent = self._where.silent(samples, now.nanoseconds)
        tick = self._tick = self._search(samples, silent)
        changes = self._alerts.update(
            tick,
            self.settings.thresholds,
            started,
            courses=self._where.course,
            unwatched=self._where.unwatched,
            silent=silent,
        )
        self._monitor.keep(self._alerts.held)
        self._outputs.publish(
            stamp,
            tick,
            self._alerts.levels,
            changes,
            silent,
            self._where.stamp_ns,
        )
        self._outputs.publish_scene(self._where.attachments.held, self._where.attached_pairs)
        self._outputs.publish_poses(samples, stamp)
        self._outputs.publish_parts(samples, started)
        self._recording.add(now.nanoseconds, tick, changes)
        self._log(changes)
        ended = time.perf_counter()
        self._health.timing.record(ended, tick, ended - started, 1.0 / self.settings.rate_hz)
        self._where.clock.pardon(ended - started)

    def _now(self) -> RosTime:
        """Return the time; if it went back, forget all messages from before."""
        now = self._node.get_clock().now()
        if now.nanoseconds < self._now_ns:
            self._where.forget()
            if self._sources.joints is not None:
                self._sources.joints.forget()
            self._node.get_logger().warning("the clock went back: waiting for new poses")
        self._now_ns = now.nanoseconds
        return now

    def _search(self, samples: Samples, silent: Mapping[str, str]) -> Tick:
        """Spend the budget, or less if a signal comes; return the tick."""
        distances = self._outputs.check_demand() or self.settings.record_distances
        self._distance_ticks += distances
        budget, spent, searched = self.settings.budget_s, 0.0, ()
        while True:
            left_s = budget - spent
            tick = self._monitor.tick(
                samples, min(left_s, SLICE_S), silent=silent, distances=distances
            )
            spent += tick.elapsed_s
            searched += tick.searched
            # A slice ends a little early, because a tick sets time aside for its end.
            if not tick.left or left_s <= SLICE_S or spent >= budget or spin.asked_to_stop():
                break
        if left_s == budget:
            return tick
        return replace(tick, elapsed_s=spent, budget_s=budget, searched=searched)

    def _replace_model(self, name: str, model: engine.Model) -> None:
        self._models[name] = model
        self._monitor.replace_model(name, model)
        self._outputs.reshape(name)

    def _deform(self, name: str, points: np.ndarray) -> None:
        self._monitor.deform(name, points)
        self._outputs.reshape(name)

    def _log(self, changes: Sequence[Alert]) -> None:
        logger = self._node.get_logger()
        for change in changes[:LOGGED]:
            line = f"{change.a} - {change.b}: {change.new.value}: {change.reason}"
            # Two calls: rclpy refuses one place in the source that logs with varying severity.
            if change.new in (Level.STOP, Level.STALE):
                logger.warning(line)
            else:
                logger.info(line)
        if len(changes) > LOGGED:
            more = counted(len(changes) - LOGGED, "more pair", "more pairs")
            logger.warning(f"and {more} changed state")

    def _say_progress(self, progress: compiling.Progress) -> None:
        """Publish that the node is not ready yet, and why."""
        doing = "preparing the search"
        if progress.started:
            doing = str(progress)
            if doing != self._said:
                self._said = doing
                self._node.get_logger().info(doing)
        silent = dict.fromkeys(self._changeable, NO_POSE_YET)
        self._tell_state(self._node.get_clock().now().to_msg(), doing, silent, {})

    def _on_second(self) -> None:
        now = self._now()  # also while it is paused
        for name in self._inputs.note_strangers(strangers(self._node, self._sources.topics)):
            self._node.get_logger().warning(
                f"poses of {name} are published, but {self.scene.path.name} has no such moving body"
            )
        self._note_namesakes()
        activity = "inactive" if self._ticking.stopped else "active"
        if self._ticking.paused and activity == "active":
            activity = "paused"
        silent = self._where.silent(self._where.samples(now.nanoseconds), now.nanoseconds)
        joints = self._sources.joints
        self._tell_state(now.to_msg(), activity, silent, joints.rejected if joints else {})

    def _note_namesakes(self) -> None:
        """Warn when other nodes of this name come, and say when they have gone."""
        before, self._namesakes = self._namesakes, namesakes(self._node)
        logger, name = self._node.get_logger(), self._node.get_fully_qualified_name()
        if self._namesakes > before:
            logger.warning(
                f"another node is called {name}: they publish on the same topics, and their results"
                " are mixed; give one of them another name or namespace (-r __ns:=/other)"
            )
        elif self._namesakes < before and not self._namesakes:
            logger.info(f"no other node is called {name} any more")

    def _tell_state(
        self,
        stamp: Time,
        activity: str,
        silent: Mapping[str, str],
        refused_joints: Mapping[str, int],
    ) -> None:
        """Publish the diagnostics."""
        state = NodeState(
            activity=activity,
            settings=self.settings,
            tick=self._tick,
            levels=self._alerts.levels,
            watched=len(self.scene.pairs),
            inputs=self._inputs,
            silent=silent,
            refused_joints=refused_joints,
            held=self._where.attachments.held if self._prepared else {},
            waiting=self._where.attachments.waiting if self._prepared else {},
            built=self._outputs.built,
            alerts_left_out=self._outputs.alerts_left_out,
            distance_ticks=self._distance_ticks,
            incompatible=self._incompatible.count,
            unseen=self._unseen,
            namesakes=self._namesakes,
            dropped=self._clouds.dropped if self._prepared else {},
            clouds=self._clouds.built if self._prepared else {},
        )
        self._diagnostics.publish(self._health.message(stamp, state))

    def _reset_minima(self) -> str:
        self._monitor.reset_minima()
        return f"reset the minima of {counted(len(self.scene.pairs), 'pair', 'pairs')}"

    def _pause(self, wanted: bool) -> str:
        was, self._ticking.paused = self._ticking.paused, wanted
        self._health.timing.forget_window()
        if was == wanted:
            return f"already {'paused' if was else 'running'}"
        if wanted:
            return "paused: nothing is watched or published until it resumes"
        self._alerts.interrupt()
        return "running again"

    def _dump_recording(self) -> Future:
        """Write the recording in a thread, because it may take seconds; return a future."""
        name, settings = self._node.get_fully_qualified_name(), self.settings
        taken, done = self._recording.snapshot(), Future(executor=self._node.executor)

        def write() -> None:
            try:
                paths = dump(taken, settings.recording_dir, name, settings.frame)
            except Exception as error:  # any error; it is raised where the future is awaited
                done.set_exception(error)
            else:
                done.set_result(", ".join(map(str, paths)))

        Thread(target=write).start()
        return done


def _effort(settings: Settings) -> tuple[float | None, ...]:
    """Return the settings that decide how long a search takes."""
    return settings.budget_s, settings.rel_err, settings.abs_err
