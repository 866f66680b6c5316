"""Where the bodies are, how certain that is, and which pairs need no watch for that reason."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping

import numpy as np
from rclpy.node import Node

from proximity_monitor.ros.cloud_bodies import CloudBodies
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.still_clock import REASON, StillClock
from proximity_monitor.scene import Scene
from proximity_monitor.scene.attachments import Attachments, Samples
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.watch import UNWATCHED


class Whereabouts:
    """Combines the inputs of bodies, their attachments, and the watchdog on the clock."""

    unwatched: Mapping[int, str]
    """Why pairs are not watched now, by index."""
    attached_pairs: tuple[int, ...]
    """The indices of unwatched pairs whose bodies are attached to each other, in order."""

    def __init__(
        self,
        node: Node,
        scene: Scene,
        inputs: Inputs,
        clouds: CloudBodies,
        ignore: Callable[[Collection[int]], None],
    ) -> None:
        """Begin without attachments.

        Args:
            node: gives its clock and its log.
            scene: gives bodies and pairs.
            inputs: the poses, and how fresh they are.
            clouds: the bodies that are point clouds.
            ignore: takes the pairs that need no watch from now on.
        """
        self.attachments = Attachments(scene.bodies)
        self.clock = StillClock(node.get_clock())
        self.unwatched, self.attached_pairs = {}, ()
        self._unwatched_for = {}, frozenset()
        self._log = node.get_logger()
        self._pairs = scene.pairs
        self._at = {name: i for i, name in enumerate(scene.pairs.names)}
        self._inputs = inputs
        self._clouds = clouds
        self._ignore = ignore
        self._changeable = [body.name for body in scene.bodies if body.moving or body.deforming]
        self._fixed = {
            body.name: Course(body.pose, body.pose, np.inf)
            for body in scene.bodies
            if not body.moving
        }

    def samples(self, now_ns: int) -> Samples:
        """Return the poses of all moving bodies, after carrying attached bodies and clouds."""
        self._look_at_clock(now_ns)
        samples = self.attachments.carry(self._inputs.samples(now_ns), self._together)
        held = self.attachments.held
        self._inputs.attached = frozenset(held)
        silent = self.silent({}, now_ns)
        self._clouds.place(samples, silent)
        self._leave_out(held, self._clouds.absent(silent))
        return samples

    def silent(self, samples: Samples, now_ns: int) -> dict[str, str]:
        """Return why bodies are unreliable, by name."""
        if self.clock.still:
            return dict.fromkeys(self._changeable, REASON)
        return self._inputs.silent(samples, now_ns)

    def attach(self, parents: Mapping[str, str], now_ns: int) -> None:
        """Attach bodies to these parents, each from the moment when both poses are known."""
        before, carried = self.attachments.held, self.samples(now_ns)
        roots = {child: self.attachments.root(child) for child in before}
        self.attachments.attach(parents)
        for child in before.keys() - self.attachments.held.keys():
            if (at := carried[child]) is not None:  # it stays where it was carried to
                stamp_ns = self._inputs.stamp_ns(roots[child])
                self._inputs.place(child, at.pose, now_ns if stamp_ns is None else stamp_ns)
        self.samples(now_ns)

    def course(self, name: str) -> Course | None:
        """Return a body's last motion, or None if it is unknown."""
        if name in self._clouds.dropped:
            return None  # a cloud has other points each time
        root = self.attachments.root(name)
        fixed = self._fixed.get(root)
        return fixed or self.attachments.course(name, self._inputs.course(root))

    def stamp_ns(self, name: str) -> int | None:
        """Return the stamp of the oldest message that a body's pose and shape depend on."""
        pose_ns = self._inputs.stamp_ns(self.attachments.root(name))
        stamps = [ns for ns in (pose_ns, self._inputs.shape_stamp_ns(name)) if ns is not None]
        return min(stamps, default=None)

    def forget(self) -> None:
        """Forget all messages, because the clock went back."""
        self._inputs.forget()
        self.attachments.forget()

    def _together(self, parent: str, child: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses that place a child on its parent; warn if they are of two moments."""
        *poses, apart_s = self._inputs.together(parent, child)
        if apart_s:
            self._log.warning(
                f"{child} is attached to {parent} by poses that are {apart_s:.3g} s apart, the "
                "closest ones known: if both move, attach it again while one of them rests"
            )
        return poses[0], poses[1]

    def _look_at_clock(self, now_ns: int) -> None:
        if self.clock.update(now_ns, self._inputs.timeout_s):
            if self.clock.still:
                self._log.warning("/clock stands still: all bodies are stale until it moves again")
            else:
                self._log.info("/clock moves again")

    def _leave_out(self, held: Mapping[str, str], absent: frozenset[str]) -> None:
        """Stop watching attached bodies against each other, and clouds without points."""
        if (held, absent) == self._unwatched_for:
            return
        self._unwatched_for, unwatched = (held, absent), {}
        names = self._pairs.names
        for name in absent:
            for i, other in self._pairs_of(name, np.arange(len(names))):
                nothing = absent & {name, names[other]}
                unwatched[i] = f"no points in {' and '.join(sorted(nothing))}"
        couples = ((child, np.array([self._at[parent]])) for child, parent in held.items())
        attached_pairs = [i for couple in couples for i, _ in self._pairs_of(*couple)]
        unwatched.update(dict.fromkeys(attached_pairs, "attached to each other: not watched"))
        self.unwatched, self.attached_pairs = unwatched, tuple(sorted(attached_pairs))
        self._ignore(unwatched)

    def _pairs_of(self, name: str, others: np.ndarray) -> Iterator[tuple[int, int]]:
        """Yield the watched pairs of a body with `others` (k,): pair's index and other body."""
        own = self._at[name]
        others = others[others != own]
        a, b = np.minimum(others, own), np.maximum(others, own)
        watched = self._pairs.kind(a, b) != UNWATCHED
        watched &= self._pairs.moving[a] | self._pairs.moving[b]
        places = self._pairs.positions(a[watched], b[watched])
        return zip(places.tolist(), others[watched].tolist(), strict=True)
