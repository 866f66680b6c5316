"""Contacts, and the memory of earlier ones, which gives two curved bodies more than one contact.

The engine finds one pair of nearest points between two bodies that are searched whole. A ring that
lies on a plate needs at least three. It gets them as it rocks: when the nearest points jump to
another place, the previous pair stays a contact as long as it is one. Physics engines do this for
convex bodies (Coumans, Bullet, 2005: persistent manifolds).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_SERIALS = 1 << 20


class Contacts(NamedTuple):
    """Places where two surfaces are near, one per row; metres, world.

    Attributes:
        bodies: (k, 2) indices of the two bodies.
        points: (k, 2, 3) the witness points on the two bodies.
        normals: (k, 3) unit vectors from the second point to the first.
        gaps: (k,) the distances of the points along the normals.
        keys: (k, 3) indices of the pair of bodies and of the two pieces; rows are sorted by them.
            If both bodies are searched whole, the last is a serial number that the contact keeps.
    """

    bodies: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    gaps: NDArray[np.float64]
    keys: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of contacts."""
        return len(self.gaps)


class Seen(NamedTuple):
    """The knowledge about pairs: one row per pair, except for contacts and their local points."""

    lower: NDArray[np.float64]  # metres: certified lower bound of the distance
    moved: NDArray[np.float64]  # metres since the last search; infinity: there was none
    reach: NDArray[np.float64]  # metres: the reach of that search
    contacts: Contacts
    local: NDArray[np.float64]  # (k, 2, 3) the contacts' points, model frames


NONE = Contacts(
    np.empty((0, 2), np.int64),
    np.empty((0, 2, 3)),
    np.empty((0, 3)),
    np.empty(0),
    np.empty((0, 3), np.int64),
)


class Memory:
    """Decides which earlier contacts of pairs that are searched whole are still contacts.

    Args:
        whole: (p,) whether each pair of bodies is searched whole.
        spacing: (p,) metres; the least distance of two contacts of a pair.
        aside: metres; how far the points of a contact may slide apart.
    """

    def __init__(
        self, whole: NDArray[np.bool_], spacing: NDArray[np.float64], aside: float
    ) -> None:
        self._whole, self._spacing, self._aside = whole, spacing, aside
        self.restart()

    def restart(self) -> None:
        """Number contacts from 0 again."""
        self._next = 0

    def learn(self, seen: Seen, failed: Seen, met: NDArray[np.bool_]) -> Seen:
        """Return the knowledge before a step that failed, with the contacts that it lacked.

        A pair may meet at other points than its nearest ones. The start of the step does not show
        these points, and without them the step would fail again.

        Args:
            seen: the knowledge at the start of the step.
            failed: the knowledge at its end.
            met: (p,) whether each pair came too near at its end.
        """
        keys = failed.contacts.keys
        known = seen.contacts.keys[self._whole[seen.contacts.keys[:, 0]], 2]
        lacked = (met & self._whole)[keys[:, 0]] & ~np.isin(keys[:, 2], known)
        if not lacked.any():
            return seen
        columns = zip(seen.contacts, failed.contacts, strict=True)
        contacts = Contacts(*(np.concatenate((a, b[lacked])) for a, b in columns))
        local = np.concatenate((seen.local, failed.local[lacked]))
        return seen._replace(contacts=contacts, local=local)

    def join(
        self,
        found: tuple[NDArray, ...],
        older: tuple[Contacts, NDArray[np.float64]],
        reach: NDArray[np.float64],
    ) -> tuple[NDArray, ...]:
        """Return the columns of the older contacts that stay, and number the contacts found.

        An older contact stays if it is within reach, its points did not slide apart, and it is not
        near the new contact of its pair. If it is near, the new contact takes its number.

        Args:
            found: the columns of new contacts and their local points; their keys are written.
            older: the earlier contacts of the same pairs, at the bodies' present poses.
            reach: (p,) metres.
        """
        _, points, _, gaps, keys, _ = found
        nearest = {int(pair): i for i, pair in enumerate(keys[:, 0]) if self._whole[pair]}
        for i in nearest.values():
            keys[i, 2] = -1
        before, local = older
        apart = before.points[:, 0] - before.points[:, 1]
        slid = np.linalg.norm(apart - before.gaps[:, None] * before.normals, axis=1)
        stays = np.zeros(len(before), np.bool_)
        for k, pair in enumerate(before.keys[:, 0]):
            i = nearest.get(int(pair))
            if i is None or before.gaps[k] > reach[pair] or slid[k] > self._aside:
                continue
            near = np.linalg.norm(before.points[k, 0] - points[i, 0]) < self._spacing[pair]
            stays[k] = not near
            if near and keys[i, 2] < 0:
                keys[i, 2] = before.keys[k, 2]
            # The new contact is the nearest place, so no gap is smaller than its gap.
            before.gaps[k] = max(before.gaps[k], gaps[i])
        for i in nearest.values():
            if keys[i, 2] < 0:
                keys[i, 2], self._next = self._next, (self._next + 1) % _SERIALS
        return *(column[stays] for column in before), local[stays]
