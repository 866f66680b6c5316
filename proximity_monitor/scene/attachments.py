"""Attachments: bodies that other bodies carry while an assembly step joins them.

A child follows its parent from the moment when both poses are known and fresh. It keeps the pose
that it then has in the parent's frame, which is computed from poses of one moment if these are
known. Its own poses are ignored until it is detached. A parent may be another body's child; a fixed
body may be a parent, but not a child. A child is stale if its parent is stale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from proximity_monitor.scene.description import Body
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.report import meant
from proximity_monitor.scene.state import PoseSample

Samples = dict[str, PoseSample | None]

Together = Callable[[str, str], tuple[np.ndarray, np.ndarray]]
"""Returns the poses (4, 4) of two moving bodies at one moment; neither body is carried."""


@dataclass(slots=True)
class _Hold:
    """A held child: its pose in its parent's frame, and its last pose in the world."""

    offset: np.ndarray
    parent_pose: np.ndarray | None = None
    pose: np.ndarray | None = None

    def put(self, parent_pose: np.ndarray) -> np.ndarray:
        """Return the child's pose: the same array again if the parent's is the same array."""
        if parent_pose is not self.parent_pose:
            self.parent_pose, self.pose = parent_pose, parent_pose @ self.offset
        return self.pose


class Attachments:
    """Which moving body is attached to which body, and where."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        """Begin with no body of the scene attached."""
        self._fixed = {b.name: PoseSample(b.pose) for b in bodies if not b.moving}
        self._moving = {body.name: body for body in bodies if body.posed}
        self._parents: dict[str, str] = {}  # parent by child; a child follows its own parent
        self._holds: dict[str, _Hold] = {}

    @property
    def held(self) -> Mapping[str, str]:
        """The parent by child, for children that are carried now."""
        return {child: self._parents[child] for child in self._holds}

    @property
    def waiting(self) -> Mapping[str, str]:
        """The parent by child, for children that will be carried once both poses are fresh.

        Until then the child's own poses count, and its pair with the parent is watched.
        """
        return {c: parent for c, parent in self._parents.items() if c not in self._holds}

    def refusal(self, parents: Mapping[str, str]) -> str:
        """Return a sentence that says why these attachments are impossible; empty if possible.

        Args:
            parents: the parent by child; both may be anything that a user typed.
        """
        for child, parent in parents.items():
            if child not in self._moving:
                return f"{child} cannot be attached, because it is not a moving body"
            if self._moving[child].topic is None:
                return (
                    f"{child} is a robot link, which its joints move; attach the other body to it"
                )
            if parent not in self._moving and parent not in self._fixed:
                known = sorted({*self._moving, *self._fixed} - {child})
                return (
                    f"{child} cannot be attached: no body is named '{parent}'{meant(parent, known)}"
                )
            chain = [child]
            while chain[-1] in parents:
                chain.append(parents[chain[-1]])
                if chain[-1] == child:
                    ring = " -> ".join(chain)
                    return f"the attachments {ring} form a cycle; detach one of them first"
                if len(chain) > len(parents) + 1:
                    break  # a circle that this child only leads to; its members report it
        return ""

    def attach(self, parents: Mapping[str, str]) -> None:
        """Attach children to these parents from now on.

        A child that had the same parent before stays where it is. A body that `parents` does not
        name as a child is free.

        Raises:
            ValueError: as `refusal` says; nothing has changed.
        """
        if reason := self.refusal(parents):
            raise ValueError(reason)
        self._holds = {
            child: hold
            for child, hold in self._holds.items()
            if parents.get(child) == self._parents[child]
        }
        self._parents = {}
        for child in parents:
            chain = [child]
            while chain[-1] in parents:
                chain.append(parents[chain[-1]])
            for each in reversed(chain[:-1]):
                self._parents[each] = parents[each]

    def carry(self, samples: Samples, together: Together | None = None) -> Samples:
        """Return the poses, with those of the carried bodies replaced.

        A waiting child is held from now on if both poses are known and fresh.

        Args:
            samples: the pose samples of all moving bodies by name.
            together: called once when a child begins to be held, because samples may be of
                different moments; None: they are all of one moment.
        """
        if not self._parents:
            return samples
        carried = dict(samples)
        for child, parent in self._parents.items():
            above = self._fixed[parent] if parent in self._fixed else carried[parent]
            hold = self._holds.get(child)
            if hold is None:
                own = carried[child]
                if own is None or own.stale or above is None or above.stale:
                    continue
                at = above.pose, own.pose
                if together is not None and (root := self.root(parent)) not in self._fixed:
                    base, pose = together(root, child)
                    at = base @ self._on_root(parent), pose
                hold = self._holds[child] = _Hold(_offset(*at))
            # If a parent loses its pose, as after a clock jump, so do its children.
            carried[child] = above and PoseSample(hold.put(above.pose), above.stale)
        return carried

    def root(self, name: str) -> str:
        """Return the body whose poses move a body: the end of its chain of parents."""
        while name in self._holds:
            name = self._parents[name]
        return name

    def course(self, name: str, root: Course | None) -> Course | None:
        """Return the course of a body, computed from the course of its `root`."""
        if root is None or name not in self._holds:
            return root
        offset = self._on_root(name)
        return Course(root.before @ offset, root.after @ offset, root.seconds)

    def _on_root(self, name: str) -> np.ndarray:
        """Return the pose of a body in the frame of its `root`."""
        offset = np.eye(4)
        while name in self._holds:
            offset = self._holds[name].offset @ offset
            name = self._parents[name]
        return offset

    def forget(self) -> None:
        """Let every child wait again for fresh poses."""
        self._holds.clear()


def _offset(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Return the child's pose in the parent's frame, its rotation made exactly orthogonal.

    Each rotation may deviate from an orthogonal one by the tolerance of poses. The product of two
    could deviate by more, and the product of a chain by more still.
    """
    offset = np.eye(4)
    u, _, v = np.linalg.svd(parent[:3, :3].T @ child[:3, :3])
    offset[:3, :3] = u @ v
    offset[:3, 3] = parent[:3, :3].T @ (child[:3, 3] - parent[:3, 3])
    return offset
