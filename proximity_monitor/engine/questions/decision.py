"""Yes-or-no answers: no is certain; if a budget ends first, the answer is an undecided yes."""

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
        row: (ANSWER,) the answer as numbers in a row, as a search writes them.
        clearance: metres; the clearance in question.
        ended: whether the search came to an end before its budget did, or the room for parts of
            surfaces.
    """

    row: NDArray[np.float64]
    clearance: float
    ended: bool

    @property
    def within(self) -> bool:
        """False only where it is certain that the surfaces are farther apart than asked.

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
        """(3,) metres, world; witness on a, as near as asked where `within` is decided."""
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
        """Triangle pairs tested."""
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
        row: (ANSWER,) the answer as numbers in a row, as a search writes them.
        met: the elements that touch or cross; contacts are made of them when they are read.
        complete: whether the search came to an end before its budget did, or the room for parts of
            surfaces. Then the answer is decided and, if all contacts were wanted, none is missing
            and each is one.
    """

    row: NDArray[np.float64]
    met: Met | MetPieces
    complete: bool

    @property
    def colliding(self) -> bool:
        """False only where it is certain that they do neither.

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

        One pair, or every pair where all of them were asked for and the answer is `complete`. Of a
        surface, which is cut into some 512 Bezier pieces or more, every pair of pieces counts: two
        patches that cross along a curve are named once for each two pieces that meet on it, with
        one of their points. So are pieces of which the room for parts did not suffice to tell.
        """
        return self._found[0]

    @property
    def points(self) -> NDArray[np.float64]:
        """(k, 3) metres, world; a point of each contact, on both surfaces to rounding.

        It lies on a, if the surfaces touch only because the models may deviate.
        """
        return self._found[1]

    @property
    def normals(self) -> NDArray[np.float64]:
        """(k, 3) unit vectors, world; the way from a to b of each contact.

        Pushing b along it separates the two. Where balls touch, it is the line of their centres.
        Else it is the outward normal of a's triangle or the inward normal of b's, whichever parts
        the two triangles sooner; the order of their corners says which way is outward. A piece of a
        surface has the normal of that point for it. For segments and curves that cross it is
        perpendicular to both, and for points that coincide it is zero.
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
        """Triangle pairs tested."""
        return int(self.row[index.TESTS + 1])

    def __repr__(self) -> str:
        """The answer and how many contacts were found."""
        return (
            f"Collision(colliding={self.colliding}, decided={self.decided}, "
            f"complete={self.complete}, {len(self.contacts)} contacts)"
        )
