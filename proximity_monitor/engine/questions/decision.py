"""Yes-or-no answers. A no is certain. If the budget ends first, the answer is an undecided yes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from .contacts import Met, Touching, no_contacts
from .touching import MetPieces
from .witness import witness_points


@dataclass(frozen=True, eq=False)
class Clearance:
    """The answer to "is anything nearer than this?": no, yes, or not known in time.

    Attributes:
        row: (ANSWER,) the answer as numbers, as a search writes them.
        clearance: metres; the clearance in question.
        ended: whether the search came to an end before its budget, or its room for parts of
            surfaces, was used up.
    """

    row: NDArray[np.float64]
    clearance: float
    ended: bool

    @property
    def within(self) -> bool:
        """False only if the surfaces are certainly farther apart than `clearance`.

        True if they are as near, or if rounding or the end of the budget leaves that open; see
        `decided`.
        """
        return self.lower <= self.clearance

    @property
    def decided(self) -> bool:
        """False if budget or room ended before the answer was known: `within` may be wrong."""
        return self.ended or not self.within or self.upper <= self.clearance

    @property
    def lower(self) -> float:
        """Metres; certified lower bound of the distance, above `clearance` if `within` is False."""
        return float(self.row[index.LOWER])

    @property
    def upper(self) -> float:
        """Metres; certified upper bound, attained by the witness points."""
        return float(self.row[index.UPPER])

    @property
    def point_a(self) -> NDArray[np.float64]:
        """(3,) metres, world; witness on a. It is as near as asked if `within` is a decided yes."""
        return witness_points(self.row)[0]

    @property
    def point_b(self) -> NDArray[np.float64]:
        """(3,) metres, world; witness on b."""
        return witness_points(self.row)[1]

    @property
    def bound_tests(self) -> int:
        """Bounding volume pairs tested."""
        return int(self.row[index.TESTS])

    @property
    def primitive_tests(self) -> int:
        """Pairs of elements tested, such as triangles."""
        return int(self.row[index.TESTS + 1])

    def __repr__(self) -> str:
        """The answer and the bounds."""
        return (
            f"Clearance(within={self.within}, decided={self.decided}, lower={self.lower!r}, "
            f"upper={self.upper!r})"
        )


@dataclass(frozen=True, eq=False)
class Collision:
    """Whether two surfaces touch or cross: no, yes, or not known in time.

    Attributes:
        row: (ANSWER,) the answer as numbers, as a search writes them.
        met: the elements that touch or cross; contacts are made from them when they are read.
        complete: whether the search came to an end before its budget, or its room for parts of
            surfaces, was used up. Then the answer is decided and, if all contacts were wanted, none
            is missing and each is a true contact.
    """

    row: NDArray[np.float64]
    met: Met | MetPieces
    complete: bool

    @property
    def colliding(self) -> bool:
        """False only if the surfaces certainly neither touch nor cross.

        True if they do, or if rounding or the end of the budget leaves that open; see `decided`.
        """
        return bool(self.row[index.LOWER] == 0.0)

    @property
    def decided(self) -> bool:
        """False if the budget ended before the answer was known; then `colliding` may be wrong."""
        return self.complete or not self.colliding or self.met.touching

    @property
    def contacts(self) -> NDArray[np.int32]:
        """(k, 2) int32; elements of a and of b that touch or cross: triangles, patches, curves.

        One pair; or every pair, if all were asked for and the answer is `complete`. A surface is
        cut into some 512 Bezier pieces or more, and every pair of pieces counts. So two patches
        that cross along a curve are named once for each two pieces that meet on it, with one of
        their points. Pieces that the search could not decide about for lack of room are named, too.
        """
        return self._found[0]

    @property
    def points(self) -> NDArray[np.float64]:
        """(k, 3) metres, world; a point of each contact, on both surfaces up to rounding.

        If the surfaces touch only because the models may deviate, it lies on a.
        """
        return self._found[1]

    @property
    def normals(self) -> NDArray[np.float64]:
        """(k, 3) unit vectors, world; the normal of each contact, from a to b.

        Pushing b along it separates the two. If balls touch, it is the line of their centres.
        Otherwise it is the outward normal of a's triangle or the inward normal of b's, whichever
        parts the two triangles sooner; the order of corners says which way is outward. A piece of a
        surface uses its normal at the contact. For segments and curves that cross, the normal is
        perpendicular to both; for points that coincide it is zero.
        """
        return self._found[2]

    @cached_property
    def _found(self) -> Touching:
        """Contacts, points and normals; made when they are first read, which no budget counts."""
        touching = self.colliding and self.decided
        return self.met.contacts() if touching else no_contacts()

    @property
    def bound_tests(self) -> int:
        """Bounding volume pairs tested."""
        return int(self.row[index.TESTS])

    @property
    def primitive_tests(self) -> int:
        """Pairs of elements tested, such as triangles."""
        return int(self.row[index.TESTS + 1])

    def __repr__(self) -> str:
        """The answer and how many contacts were found."""
        return (
            f"Collision(colliding={self.colliding}, decided={self.decided}, "
            f"complete={self.complete}, {len(self.contacts)} contacts)"
        )
