"""Contacts from the engine's closest points: one for each pair of pieces that are near.

If a surface has a deviation, its contact points lie outside of it by the deviation. If two bodies
are one piece each, they also keep contacts at earlier nearest points (see `memory`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.motion.dynamics import candidates
from proximity_monitor.motion.dynamics.memory import NONE, Contacts, Memory, Seen
from proximity_monitor.motion.dynamics.pieces import Pieces, around, cut

_SPACING = 0.2
"""Least distance between two contacts of bodies that are searched whole, as a share of the smaller
body's radius."""

_WHOLE_ERROR = 0.01
"""Tolerance of the distances of bodies that are searched whole, as a share of the kept distance. If
the nearest points form a continuum, as for a ring that lies flat, a tighter one takes too long."""


class ContactFinder:
    """Finds contacts of bodies; lower bounds tell which pairs need a search.

    Args:
        models: one per body; a model that bodies share is cut once.
        pairs: (k, 2) the bodies that may touch.
        slack: metres; how far a pair may move before its contacts are searched again.
        every: True: each near pair of pieces has a contact; False: only local minima of the
            distance are contacts.
        kept: metres; the distance that the contact law keeps.
        deforming: (n,) whether each body deforms; a body that deforms must not share its model.
    """

    def __init__(
        self,
        models: Sequence[engine.Model],
        pairs: NDArray[np.int64],
        slack: float,
        every: bool,
        kept: float,
        deforming: Sequence[bool],
    ) -> None:
        cuts: dict[int, Pieces] = {
            id(model): cut(model, soft) for model, soft in zip(models, deforming, strict=True)
        }
        each = [cuts[id(model)] for model in models]
        sizes = [len(part.models) for part in each]
        self.pairs = pairs
        self._slack = slack
        self._every = every
        self.searches = 0
        """The number of searches of pairs of pieces so far."""
        self._owner = np.repeat(np.arange(len(models)), sizes)
        self._first = np.concatenate(([0], np.cumsum(sizes)))
        self._spheres = np.concatenate([part.spheres for part in each])
        self._boxes = np.concatenate([part.boxes for part in each])
        self._assembly = engine.Assembly([model for part in each for model in part.models])
        self._soft = [(self._first[i], models[i]) for i in np.flatnonzero(deforming)]
        whole = np.array([not len(part.corners) for part in each])
        self._deviation = np.array([model.deviation for model in models])
        self._error = _WHOLE_ERROR * kept * whole[self._owner]
        self._memory = Memory(
            whole[pairs].all(axis=1) & (not every),
            _SPACING
            * np.array([model.radius for model in models])[pairs].min(axis=1, initial=np.inf),
            kept,
        )
        self._rows = np.empty((1024, 3), np.int64)
        self._surfaces(list(cuts.values()))
        starts = dict(
            zip(cuts, np.cumsum([0, *(len(c.places) for c in cuts.values())]), strict=False)
        )
        faces = [
            np.where(numbers < 0, -1, starts[id(model)] + numbers)
            for model, part in zip(models, each, strict=True)
            for numbers in part.triangles
        ]
        self._face_last = np.array([len(part) - 1 for part in faces])
        self._face_start = np.concatenate(([0], np.cumsum(self._face_last + 1)))
        self._faces = np.concatenate(faces)
        self.restart()

    def _surfaces(self, cuts: Sequence[Pieces]) -> None:
        """Concatenate the triangles and places of all models, with the triangles at each place."""
        triangles, places, entries = 0, 0, 0
        parts = []
        for part in cuts:
            parts.append(
                (
                    part.corners,
                    part.places + places,
                    part.first[:-1] + entries,
                    part.around + triangles,
                )
            )
            triangles += len(part.places)
            places += len(part.first) - 1
            entries += len(part.around)
        corners, numbers, first, around = (np.concatenate(x) for x in zip(*parts, strict=True))
        self._corners, self._places = np.ascontiguousarray(corners), numbers
        self._place_first, self._around = np.append(first, entries), around

    def restart(self) -> None:
        """Forget everything that was found, because the bodies may be anywhere."""
        count = len(self.pairs)
        self._seen = Seen(
            np.zeros(count), np.full(count, np.inf), np.zeros(count), NONE, NONE.points
        )
        self._memory.restart()

    @property
    def lower(self) -> NDArray[np.float64]:
        """(k,) metres; a certified lower bound of each pair's distance."""
        return self._seen.lower

    def remember(self) -> Seen:
        """Return the present knowledge, for `recall`."""
        seen = self._seen
        return seen._replace(lower=seen.lower.copy(), moved=seen.moved.copy())

    def recall(self, seen: Seen, met: NDArray[np.bool_]) -> None:
        """Go back to earlier knowledge, because the bodies go back as well.

        Pairs that came too near in the step that is undone (`met`, (k,)) keep their new contacts.
        """
        self._seen = self._memory.learn(seen, self._seen, met)

    def doubt(self, chosen: NDArray[np.bool_]) -> None:
        """Have the chosen (k,) pairs searched again, even if they do not move."""
        self._seen.moved[chosen] = np.inf

    def moved(self, distance: NDArray[np.float64]) -> None:
        """Widen the bounds of the pairs by how far (k,) their bodies approached at most, metres."""
        self._seen.lower[:] -= distance
        self._seen.moved[:] += distance

    def reshape(self, poses: NDArray[np.float64]) -> Contacts:
        """Update the contacts to the new shapes of deforming bodies, and return them.

        The contact point of a deforming body becomes the point nearest to the other body's point.
        """
        contacts, local = self._seen.contacts, self._seen.local.copy()
        for row, model in self._soft:
            self._spheres[row], self._boxes[row] = (each[0] for each in around(model))
            pose = poses[self._owner[row]]
            for side in range(2):
                at = np.flatnonzero(contacts.bodies[:, side] == self._owner[row])
                if len(at):
                    facing = contacts.points[at, 1 - side]
                    found = engine.closest_points(model, pose, facing).points
                    found = _outward(found, facing, self._deviation[self._owner[row]])
                    local[at, side] = (found - pose[:3, 3]) @ pose[:3, :3]
        turn, place = poses[contacts.bodies, :3, :3], poses[contacts.bodies, :3, 3]
        points = np.einsum("ksij,ksj->ksi", turn, local) + place
        apart = points[:, 0] - points[:, 1]
        gaps = np.linalg.norm(apart, axis=1)
        soft = np.isin(contacts.bodies, [self._owner[row] for row, _ in self._soft]).any(axis=1)
        soft &= gaps > 0.0
        normals, lengths = contacts.normals.copy(), contacts.gaps.copy()
        normals[soft], lengths[soft] = apart[soft] / gaps[soft, None], gaps[soft]
        contacts = Contacts(contacts.bodies, points, normals, lengths, contacts.keys)
        self._seen = self._seen._replace(contacts=contacts, local=local)
        return contacts

    def find(
        self, poses: NDArray[np.float64], reach: NDArray[np.float64], closest: float
    ) -> Contacts:
        """Return the contacts of every pair whose distance may be within its reach.

        If a pair moved by no more than `slack` since its last search, it keeps its contacts, which
        move with the bodies. So resting bodies cost no search. The pair is searched again if its
        lower bound is below `closest`. Two bodies that are one piece each also keep contacts at
        earlier nearest points.

        Args:
            poses: (n, 4, 4) model to world of every body, metres.
            reach: (k,) metres, up to which contacts are needed.
            closest: metres, below which a lower bound must be found again.
        """
        seen = self._seen
        close = seen.lower <= reach
        still = (seen.moved <= self._slack) & (reach <= seen.reach) & (seen.lower >= closest)
        kept = _placed(poses, seen.contacts, seen.local, (close & still)[seen.contacts.keys[:, 0]])
        anew = close & ~still
        if not anew.any():
            contacts, local = kept
        else:
            found = self._search(poses, np.where(anew, reach, -np.inf))
            older = _placed(poses, seen.contacts, seen.local, anew[seen.contacts.keys[:, 0]])
            older = self._memory.join(found, older, reach)
            parts = (*kept[0], kept[1]), found, older
            joined = [np.concatenate(each) for each in zip(*parts, strict=True)]
            order = np.lexsort(joined[4].T[::-1])
            *fields, local = (each[order] for each in joined)
            contacts = Contacts(*fields)
        moved, reached = seen.moved, seen.reach.copy()
        moved[anew] = 0.0
        reached[anew] = reach[anew]
        # A pair out of reach has no contacts, so it must be searched when it comes back.
        moved[~close] = np.inf
        self._seen = Seen(seen.lower, moved, reached, contacts, local)
        return contacts

    def _search(
        self, poses: NDArray[np.float64], reach: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], ...]:
        """Search the pairs whose lower bound is within reach; return their contacts' columns.

        The columns are those of `Contacts`, and the points (k, 2, 3) in the models' frames.
        """
        spheres = candidates.spheres_at(poses, self._owner, self._spheres)
        lower = self.lower.copy()
        while True:
            self.lower[:] = lower
            count = candidates.near_pieces(
                poses, self.pairs, reach, self.lower, self._first, spheres, self._boxes, self._rows
            )
            if count <= len(self._rows):
                break
            self._rows = np.empty((2 * count, 3), np.int64)
        rows = self._rows[:count]
        self.searches += count
        error = self._error[rows[:, 1:]].max(axis=1, initial=0.0)
        found = self._assembly.distances(poses[self._owner], rows[:, 1:], abs_err=error)
        np.minimum.at(self.lower, rows[:, 0], found.lower)
        off = self._deviation[self.pairs[rows[:, 0]]]
        nearest = found.upper - 2.0 * off.sum(axis=1)  # the upper bound includes the deviations
        within = np.flatnonzero((nearest <= reach[rows[:, 0]]) & (found.lower > 0.0))
        keys = rows[within]
        points = np.stack((found.points_a[within], found.points_b[within]), axis=1)
        bodies = self.pairs[keys[:, 0]]
        kept = np.ones(len(within), np.bool_)
        if not self._every:
            elements = np.minimum(found.elements[within], self._face_last[keys[:, 1:]])
            faces = self._faces[self._face_start[keys[:, 1:]] + elements]
            candidates.local_minima(
                poses, bodies, faces, found.parameters[within], points,
                self._corners, self._places, self._place_first, self._around, kept,
            )  # fmt: skip
        bodies, points, keys, off = bodies[kept], points[kept], keys[kept], off[within][kept]
        apart = points[:, 0] - points[:, 1]
        gaps = np.sqrt((apart * apart).sum(axis=1))
        normals = apart / gaps[:, None]
        points = _outward(points, points[:, ::-1], off)
        gaps -= off.sum(axis=1)
        turn, place = poses[bodies, :3, :3], poses[bodies, :3, 3]
        local = np.einsum("ksji,ksj->ksi", turn, points - place)
        return bodies, points, normals, gaps, keys, local


def _outward(
    points: NDArray[np.float64], facing: NDArray[np.float64], off: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Move points (..., 3) towards the points they face, by the deviation `off`, but no farther."""
    apart = facing - points
    gaps = np.sqrt((apart * apart).sum(axis=-1))
    share = np.divide(np.minimum(off, gaps), gaps, where=gaps > 0.0, out=np.zeros_like(gaps))
    return points + share[..., None] * apart


def _placed(
    poses: NDArray[np.float64],
    contacts: Contacts,
    local: NDArray[np.float64],
    chosen: NDArray[np.bool_],
) -> tuple[Contacts, NDArray[np.float64]]:
    """Return the chosen contacts, with their points moved along with the bodies.

    The normals stay, so that sliding along a surface does not change the gap.
    """
    bodies, local, normals = contacts.bodies[chosen], local[chosen], contacts.normals[chosen]
    points = np.einsum("ksij,ksj->ksi", poses[bodies, :3, :3], local) + poses[bodies, :3, 3]
    gaps = np.einsum("ki,ki->k", normals, points[:, 0] - points[:, 1])
    return Contacts(bodies, points, normals, gaps, contacts.keys[chosen]), local
