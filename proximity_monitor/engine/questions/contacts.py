"""The contacts of two models, made from the elements that a search found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.elements import contacts as kernel
from ..kernels.elements.swept import lower_of, reach_of
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .contact_surface import are_divided, contacts_of
from .run import Search, least

Touching = tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]
"""Contacts, points and normals, as in `Collision`."""


def no_contacts() -> Touching:
    """Return the answer for models that do not meet."""
    return np.empty((0, 2), np.int32), np.empty((0, 3)), np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Met:
    """The triangles that touch or cross, as a search keeps them; `contacts` makes the answer.

    A point and a normal take a microsecond, and there may be thousands of contacts. So they are
    made when they are read, outside the budget of the search.
    """

    models: tuple[Model, Model]
    hierarchies: tuple[Hierarchy, Hierarchy]
    """The hierarchies as the search saw them: a model may be refitted later."""
    pose_a: NDArray[np.float64]
    row: NDArray[np.float64]
    """(ANSWER,) the answer."""
    blocks: tuple[NDArray[np.float64], ...]
    """Rows of `State.collected`."""
    motions: NDArray[np.float64]
    progress: np.void
    """`Search.motions`, and the state of the search, as PROGRESS."""

    @property
    def poses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The poses of both models, (4, 4); b's is made from a's and the relative motion."""
        pose_b = np.eye(4)
        pose_b[:3, :3], pose_b[:3, 3] = self.motions[0, :9].reshape(3, 3), self.motions[0, 9:]
        return self.pose_a, self.pose_a @ pose_b

    @property
    def touching(self) -> bool:
        """Whether the nearest triangles found touch or cross, or rounding hides whether they do."""
        progress = self.progress
        certain = progress["distance"] - progress["slack"]
        return bool(lower_of.py_func(certain, progress["radii"], progress["deviations"]) <= 0.0)

    def contacts(self) -> Touching:
        """Make the contacts from the rows."""
        a, b = self.hierarchies
        progress = self.progress
        if are_divided(a, b):
            return contacts_of(self.row[None], (a, b), self.poses, float(progress["slack"]))
        reach = reach_of.py_func(0.0, progress["radii"], progress["deviations"])
        rows = np.concatenate(
            [each[least(each, progress["slack"]) <= reach] for each in self.blocks]
        )
        if not len(rows) and self.touching:  # rounding hides whether they do
            rows = self.row[None, [index.TREE_A, index.TREE_B]]
        pairs = rows[:, :2].astype(np.int32)
        points, normals = np.empty((len(pairs), 3)), np.empty((len(pairs), 3))
        # Use another search: the one that found the rows may go on meanwhile.
        own = Search(*self.models, coherent=False)
        own.state.motions[:], own.state.progress[0] = self.motions, progress
        tables = a.table_of_all, b.table_of_all
        kernel.contacts(*tables, own.memory, self.pose_a, pairs, points, normals)
        contacts = np.stack((a.numbers[pairs[:, 0]], b.numbers[pairs[:, 1]]), axis=1)
        return contacts, points, normals


def met(search: Search, pose_a: NDArray[np.float64]) -> Met:
    """Take the contacts from a search at this pose of a: all if it collects them, else one."""
    a, b = search.models
    blocks = search.collected()
    if not len(search.state.collected):
        answer = search.answer
        blocks = (np.array([[answer[index.TREE_A], answer[index.TREE_B], 0.0]]),)
    return Met(
        search.models,
        (a._hierarchy, b._hierarchy),
        pose_a.copy(),
        search.answer,
        blocks,
        search.motions.copy(),
        search.progress_now(),
    )
