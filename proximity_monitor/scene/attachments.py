"""Bodies that are carried by others: an assembly step makes two parts one, another parts them.

A child follows its parent from the moment when both are known and fresh: what the child's pose is
in the parent's frame at that moment is kept, and the child's own poses are not looked at until it
is detached. A parent may be a child of another body; a fixed body may be a parent, not a child. A
child is as stale as what it hangs on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from proximity_monitor.scene.description import Body
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.state import PoseSample

Samples = dict[str, PoseSample | None]


@dataclass(slots=True)
class _Hold:
    """A child that is held: its pose in its parent's frame, and where that put it last."""

    offset: np.ndarray
    parent_pose: np.ndarray | None = None
    pose: np.ndarray | None = None

    def put(self, parent_pose: np.ndarray) -> np.ndarray:
        """Return the child's pose; the same array while the parent's is the same one."""
        if parent_pose is not self.parent_pose:
            self.parent_pose, self.pose = parent_pose, parent_pose @ self.offset
        return self.pose


class Attachments:
    """Which moving body hangs on which body, and where."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        """Begin with all bodies of a scene by themselves."""
        self._fixed = {b.name: PoseSample(b.pose) for b in bodies if not b.moving}
        self._moving = {body.name for body in bodies if body.posed}
        self._parents: dict[str, str] = {}  # each after its own parent
        self._holds: dict[str, _Hold] = {}

    @property
    def held(self) -> Mapping[str, str]:
        """By a child that is carried now, its parent."""
        return {child: self._parents[child] for child in self._holds}

    @property
    def waiting(self) -> Mapping[str, str]:
        """By a child that is to be carried as soon as both poses are known and fresh, its parent.

        Until then its own poses count, and its pair with the parent is watched.
        """
        return {c: parent for c, parent in self._parents.items() if c not in self._holds}

    def refusal(self, parents: Mapping[str, str]) -> str:
        """Return why bodies cannot hang on each other so, in a sentence; empty if they can.

        Args:
            parents: by each child its parent; both may be anything that a user typed.
        """
        for child, parent in parents.items():
            if child not in self._moving:
                return f"{child} is no moving body, so it cannot be attached"
            if parent not in self._moving and parent not in self._fixed:
                known = ", ".join(sorted({*self._moving, *self._fixed} - {child}))
                return f"no body is named '{parent}' to attach {child} to; known are {known}"
            chain = [child]
            while chain[-1] in parents:
                chain.append(parents[chain[-1]])
                if chain[-1] == child:
                    return f"{' -> '.join(chain)} is a circle; detach one of them first"
                if len(chain) > len(parents) + 1:
                    break  # a circle that this child only leads to: told for its own members
        return ""

    def want(self, parents: Mapping[str, str]) -> None:
        """Let bodies hang on each other so from now on.

        Who had this parent before stays where it is on it; who has none is free.

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

    def carry(self, samples: Samples) -> Samples:
        """Return the poses with those of the carried bodies in place of their own.

        Children that are waiting are taken hold of where both poses are known and fresh.

        Args:
            samples: of all moving bodies by name.
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
                hold = self._holds[child] = _Hold(_offset(above.pose, own.pose))
            # A parent that lost its pose, as after a jump of the clock, takes its children along.
            carried[child] = above and PoseSample(hold.put(above.pose), above.stale)
        return carried

    def root(self, name: str) -> str:
        """Return the body whose poses move a body: the end of the chain that it hangs on."""
        while name in self._holds:
            name = self._parents[name]
        return name

    def course(self, name: str, root: Course | None) -> Course | None:
        """Return the course of a body from that of its `root`."""
        if root is None or name not in self._holds:
            return root
        offset = np.eye(4)
        while name in self._holds:
            offset = self._holds[name].offset @ offset
            name = self._parents[name]
        return Course(root.before @ offset, root.after @ offset, root.seconds)

    def forget(self) -> None:
        """Let every child wait again, for poses that are still to come."""
        self._holds.clear()


def _offset(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Return the child's pose in the parent's frame, its rotation made exactly orthogonal.

    Both rotations may be off by as much as a pose is allowed to be; the product of two would not be
    allowed any more, nor would be that of a chain.
    """
    offset = np.eye(4)
    u, _, v = np.linalg.svd(parent[:3, :3].T @ child[:3, :3])
    offset[:3, :3] = u @ v
    offset[:3, 3] = parent[:3, :3].T @ (child[:3, 3] - parent[:3, 3])
    return offset
