"""Forward kinematics: computes the poses of a robot's links from its joint positions.

A link's pose is its parent's pose, times the joint's origin, times the joint's own motion: a turn
about its axis or a move along it. All joints of one depth in the tree are computed at once, so a
call costs as many matrix products as the robot is deep, for one set of positions or for many.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from proximity_monitor.scene.poses import rotations


class KinematicsError(ValueError):
    """Links and joints do not make a tree that can be computed; the message names them."""


@dataclass(frozen=True)
class Mimic:
    """A joint follows another: its position is ``multiplier * position of joint + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """The connection of a link to its parent."""

    name: str
    kind: str
    """`fixed`, `revolute`, `continuous` or `prismatic`."""
    parent: str
    child: str
    origin: NDArray[np.float64]
    """(4, 4) pose of the joint in the parent link, metres."""
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Direction in the joint's frame, of any length above 0."""
    lower: float = -math.inf
    """Lower limit, radians or metres."""
    upper: float = math.inf
    mimic: Mimic | None = None


class Kinematics:
    """A tree of links."""

    def __init__(self, links: Sequence[str], joints: Sequence[Joint]) -> None:
        """Sort the links by depth in the tree.

        Args:
            links: names. Every link except the root is the child of exactly one joint.
            joints: the joints between them.

        Raises:
            KinematicsError: a name occurs twice, a joint names a link or joint that does not exist,
                the links form no tree, or joints mimic each other in a cycle.
        """
        self._check(links, joints)
        above = {joint.child: joint for joint in joints}
        self.root = next(link for link in links if link not in above)
        """The link that stands at the robot's base."""
        depth = _depths(links, above)
        self.links: tuple[str, ...] = tuple(sorted(links, key=depth.__getitem__))
        """In the order of `poses`: the root first, each link after its parent."""
        self._order = {link: index for index, link in enumerate(self.links)}
        self.joints: tuple[Joint, ...] = tuple(above[link] for link in self.links[1:])
        """In the order of the links that they carry: that of `links` without the root."""
        self.free: tuple[Joint, ...] = tuple(
            each for each in joints if each.kind != "fixed" and each.mimic is None
        )
        """The joints whose positions are given, in the order of the file."""
        self._gain, self._offset = _followers(self.joints, self.free)
        self._origins = np.array([each.origin for each in self.joints]).reshape(-1, 4, 4)
        self._turn, self._slide = _axes(self.joints)
        levels = np.array([depth[link] for link in self.links[1:]], dtype=int)
        starts = np.searchsorted(levels, np.arange(1, levels.max(initial=0) + 2))
        parents = np.array([self._order[each.parent] for each in self.joints], dtype=int)
        self._levels = [
            (first, last, parents[first:last])
            for first, last in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)
        ]

    @staticmethod
    def _check(links: Sequence[str], joints: Sequence[Joint]) -> None:
        _once(links, "link")
        _once([joint.name for joint in joints], "joint")
        known = set(links)
        parents: dict[str, str] = {}
        for joint in joints:
            for link in (joint.parent, joint.child):
                if link not in known:
                    raise KinematicsError(f"joint '{joint.name}': there is no link '{link}'")
            if joint.child in parents:
                raise KinematicsError(
                    f"link '{joint.child}' is the child of '{parents[joint.child]}' and of "
                    f"'{joint.name}'; a link can have only one parent"
                )
            parents[joint.child] = joint.name
        roots = [link for link in links if link not in parents]
        if len(roots) != 1:
            found = ", ".join(roots) or "none"
            raise KinematicsError(
                f"exactly one link, the root, must not be a joint's child (got {found})"
            )

    def above(self, link: str) -> Joint | None:
        """Return the joint that a link hangs on; None for the root."""
        index = self._order[link]
        return self.joints[index - 1] if index else None

    def path(self, link: str) -> list[Joint]:
        """Return the joints between the root and a link, the nearest to the link first."""
        found = []
        while joint := self.above(link):
            found.append(joint)
            link = joint.parent
        return found

    def drivers(self, link: str) -> frozenset[str]:
        """Return the names of the free joints that a link's pose depends on."""
        used = np.zeros(len(self.free), dtype=bool)
        for joint in self.path(link):
            used |= self._moving(joint)
        return frozenset(each.name for each, on in zip(self.free, used, strict=True) if on)

    def unit(self, link: str) -> str:
        """Return the link nearest to the root that a link is rigidly joined to, or itself."""
        for joint in self.path(link):
            if self._moving(joint).any():
                break
            link = joint.parent
        return link

    def _moving(self, joint: Joint) -> NDArray[np.bool_]:
        """Return which of the n free joints move a joint, (n,)."""
        return self._gain[self._order[joint.child] - 1] != 0.0

    def values(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the positions (n,) of the free joints, as `poses` takes them; 0 for absent names.

        Names of other joints are ignored.
        """
        return np.array([positions.get(each.name, 0.0) for each in self.free], dtype=np.float64)

    def poses(self, values: ArrayLike, base: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the poses of all links.

        Args:
            values: (n,) or (k, n) positions of the n joints `free`; radians or metres.
            base: (4, 4) pose of the root link in the world; None: the world's origin.

        Returns:
            (m, 4, 4) or (k, m, 4, 4) poses of the m `links`, model to world, metres.

        Raises:
            ValueError: `values` has another shape, or a value is not finite.
        """
        given = np.asarray(values, dtype=np.float64)
        if given.ndim not in (1, 2) or given.shape[-1] != len(self.free):
            raise ValueError(
                f"values: shape {given.shape}, expected ({len(self.free)},) or "
                f"(k, {len(self.free)})"
            )
        if not np.isfinite(given).all():
            raise ValueError("values: every joint position must be finite")
        positions = given @ self._gain.T + self._offset
        local = self._origins @ self._moved(positions)
        poses = np.empty((*given.shape[:-1], len(self.links), 4, 4))
        poses[..., 0, :, :] = np.eye(4) if base is None else base
        for first, last, parents in self._levels:
            np.matmul(
                poses[..., parents, :, :],
                local[..., first:last, :, :],
                out=poses[..., first + 1 : last + 1, :, :],
            )
        return poses

    def _moved(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the joints' own motions, rotations or translations, at (..., m - 1) positions."""
        moved = np.zeros((*positions.shape, 4, 4))
        moved[..., 3, 3] = 1.0
        moved[..., :3, :3] = rotations(self._turn, positions)
        moved[..., :3, 3] = positions[..., None] * self._slide
        return moved


def _once(names: Sequence[str], what: str) -> None:
    seen = set()
    for name in names:
        if name in seen:
            raise KinematicsError(f"{what} '{name}' is defined twice; each needs its own name")
        seen.add(name)


def _depths(links: Sequence[str], above: Mapping[str, Joint]) -> dict[str, int]:
    """Return the number of joints between the root and each link."""
    depth: dict[str, int] = {}
    for link in links:
        way = []
        while link not in depth and link in above:
            way.append(link)
            link = above[link].parent
            if link in way:
                ring = ", ".join(way[way.index(link) :])
                raise KinematicsError(f"links {ring} form a cycle; they must form a tree")
        first = depth.setdefault(link, 0)
        for steps, each in enumerate(reversed(way), first + 1):
            depth[each] = steps
    return depth


def _followers(
    joints: Sequence[Joint], free: Sequence[Joint]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return gain (m, n) and offset (m,): positions of all joints = gain @ free ones + offset."""
    column = {joint.name: index for index, joint in enumerate(free)}
    by_name = {joint.name: joint for joint in joints}
    gain, offset = np.zeros((len(joints), len(free))), np.zeros(len(joints))
    for row, joint in enumerate(joints):
        factor, shift, seen = 1.0, 0.0, [joint.name]
        while joint.mimic is not None:
            # A joint may mimic a joint that mimics another one: compose the linear functions.
            shift += factor * joint.mimic.offset
            factor *= joint.mimic.multiplier
            if joint.mimic.joint not in by_name:
                raise KinematicsError(
                    f"joint '{joint.name}' mimics '{joint.mimic.joint}', which does not exist"
                )
            joint = by_name[joint.mimic.joint]
            if joint.name in seen:
                raise KinematicsError(f"joints {', '.join(seen)} mimic each other in a cycle")
            seen.append(joint.name)
        offset[row] = shift
        if joint.name in column:  # a fixed joint stays at 0
            gain[row, column[joint.name]] = factor
    return gain, offset


def _axes(joints: Sequence[Joint]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the axes that joints turn about and the axes they slide along, (m, 3) each; else 0."""
    turn, slide = np.zeros((len(joints), 3)), np.zeros((len(joints), 3))
    for row, joint in enumerate(joints):
        if joint.kind == "fixed":
            continue
        axis = np.array(joint.axis, dtype=np.float64)
        axis /= np.abs(axis).max()  # first, so that no length is too small or too large
        (slide if joint.kind == "prismatic" else turn)[row] = axis / np.linalg.norm(axis)
    return turn, slide
