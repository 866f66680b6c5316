"""The last answers about many pairs of bodies, kept certified while the bodies move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels.assembly import carry as kernel
from ..kernels.base import state as index
from ..kernels.inside.solids import HALF
from ..models.model import Model
from ..models.solid import sides_of
from ..poses import check_pose
from ..questions.run import check_models
from ..questions.witness import surface_points

_UNKNOWN = (math.nan, math.nan, math.nan, -1.0)
"""The feature of an unknown point: parameters and element."""

_NOTHING = np.full(index.ANSWER, math.nan)
_NOTHING[[index.LOWER, index.UPPER]] = 0.0, math.inf
"""The row of a pair without an answer."""


class CertifiedIntervals(NamedTuple):
    """Bounds of k pairs at the present poses: ``lower <= true distance <= upper``."""

    lower: NDArray[np.float64]
    """(k,) metres."""
    upper: NDArray[np.float64]
    """(k,) metres; inf if nothing is known."""
    points: NDArray[np.float64]
    """(k, 2, 3) metres, world: the witness points of the answer, moved along with their bodies."""
    still: NDArray[np.bool_]
    """(k,) whether the bodies did not move relative to each other by more than rounding."""
    same: NDArray[np.bool_]
    """(k,) whether neither body moved at all, so that the bounds are exactly the answer's."""


def no_answers(count: int) -> NDArray[np.float64]:
    """Return rows (count, ANSWER) for unsigned distances of pairs that were not searched."""
    rows = np.empty((count, index.ANSWER))
    rows[:] = _NOTHING
    return rows


class Answers:
    """What is known about pairs of bodies at every tick, between one search and the next.

    A distance shrinks by at most the relative motion of the bodies, so the old lower bound minus
    that motion still holds. The two witness points, moved along with their bodies, still give an
    upper bound (`kernels/assembly/carry.py` proves both, rounding included). Pairs are rows of a
    table; `add` allocates rows, and `drop` frees them. Rows and bodies are given as numpy arrays
    of any integer type.

    Args:
        models: the bodies' models; several bodies may share one.
        names: the bodies' names in errors.

    Raises:
        TypeError: an element of `models` is no model.
    """

    __slots__ = (
        "_balls", "_first", "_first_features", "_free", "_hierarchies", "_models", "_names",
        "_places", "_versions", "poses", "table",
    )  # fmt: skip

    poses: NDArray[np.float64]
    """(n, 4, 4) model to world; at first the identity. Only `move` changes them."""

    table: NDArray
    """(m,) the rows as the kernels take them; see `kernels/assembly/carry.py`."""

    def __init__(self, models: Sequence[Model], names: Sequence[str]) -> None:
        self._models = check_models(models)
        count = len(self._models)
        self._hierarchies = [model._hierarchy for model in self._models]
        self._names = tuple(names)
        self.poses = np.tile(np.eye(4), (count, 1, 1))
        self._versions = np.zeros(count, np.int64)
        self._balls = np.zeros(count, kernel.BALL)
        self._first = np.zeros((count, 3))  # some point of each body
        self._first_features = np.zeros((count, 4))  # the feature of that point
        self._places = np.zeros(count, kernel.PLACE)
        self.table = np.zeros(0, kernel.ANSWER)
        self._free = np.empty(0, np.int64)
        everything = np.arange(count)
        for body in everything:
            self._measure(body)
        self._place(everything, self.poses, True)

    def __copy__(self) -> Answers:
        """Return a copy that shares the models and has its own table."""
        shared = (*self._models, *self._hierarchies)
        return deepcopy(self, {id(each): each for each in shared})

    @property
    def centres(self) -> NDArray[np.float64]:
        """(n, 3) metres, world: the centres of the bodies' balls."""
        return self._places["centre"]

    def radii(self) -> NDArray[np.float64]:
        """Return the radii (n,) of balls that hold the bodies, rounding included; metres.

        If two such balls are farther apart than a range, so are the bodies.
        """
        balls, places = self._balls, self._places
        defect = places["defect"].max(initial=0.0)
        slack = (kernel.ROUNDING + kernel.NON_RIGID * defect) * places["size"]
        return balls["core"] + balls["swept"] + balls["deviation"] + slack

    @property
    def bodies(self) -> tuple[NDArray, ...]:
        """The bodies as the kernels take them: poses, versions, balls and places."""
        return self.poses, self._versions, self._balls, self._places

    def move(self, bodies: NDArray[np.int64], poses: ArrayLike) -> int:
        """Put bodies (m,) at poses (m, 4, 4); return how many of them had another pose before.

        Raises:
            ValueError: a pose is no rigid motion. The message names the body; no pose has changed.
        """
        bodies = np.require(bodies, np.int64, "CAWE")
        return self._place(bodies, np.require(poses, np.float64, "CAWE"), False)

    def _place(self, bodies: NDArray[np.int64], poses: NDArray[np.float64], anew: bool) -> int:
        moved = kernel.place(
            bodies, poses, anew, self._balls, self.poses, self._versions, self._places
        )
        if moved < 0:
            bad = -1 - moved
            check_pose(poses[bad], f"pose of {self._names[bodies[bad]]}")
        return moved

    def reshape(self, body: int, displacement: float) -> None:
        """Take note that the model of a body was deformed.

        Args:
            body: the body's index.
            displacement: metres; no point moved farther (see `Model.deform`). inf: unknown.
        """
        self._measure(body)
        if self._hierarchies[body].solid == "robust":
            self._sign_anew(self._rows_of(body))
        stretch = self._places["stretch"][body] + displacement
        if math.isinf(stretch):
            self._forget(self._rows_of(body))
        else:
            self._places["stretch"][body] = math.nextafter(stretch, math.inf)
        self._place(np.array([body]), self.poses[[body]], True)

    def _sign_anew(self, rows: NDArray[np.int64]) -> None:
        """Set the kinds of signed rows again; forget answers whose kind changed.

        The kind changes if a solid gets its first hole or loses its last one.
        """
        before = self.table["kind"][rows]
        self.sign(rows, before != kernel.UNSIGNED)
        self._forget(rows[self.table["kind"][rows] != before])

    def deformed(self) -> list[int]:
        """Return the bodies whose models were deformed since the last `reshape`."""
        pairs = enumerate(zip(self._models, self._hierarchies, strict=True))
        return [body for body, (model, known) in pairs if model._hierarchy is not known]

    def replace(self, body: int, model: Model) -> NDArray[np.int64]:
        """Give a body another model; return the rows of its pairs, whose answers are forgotten."""
        models = list(self._models)
        models[body] = model
        self._models = tuple(models)
        self.reshape(body, math.inf)
        return self._rows_of(body)

    def add(self, pairs: NDArray[np.int64], signed: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Allocate and return rows (k,) for pairs of bodies (k, 2) that were never searched.

        `signed` (k,) says whether a body of the pair is a solid, so that the distance may be
        negative.
        """
        if len(pairs) > len(self._free):
            self._grow(len(pairs) - len(self._free))
        rows, self._free = np.split(self._free, [len(pairs)])
        self.table["bodies"][rows] = pairs
        self.sign(rows, signed)
        self._forget(rows)
        return rows

    def pairs(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the bodies (k, 2) of rows (k,)."""
        return self.table["bodies"][rows]

    def sign(self, rows: NDArray[np.int64], signed: NDArray[np.bool_]) -> None:
        """Set whether a body of each pair is a solid, for rows (k,) that have no answer yet."""
        self.table["kind"][rows] = signed * self._kinds(self.pairs(rows))

    def _kinds(self, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the kinds of the signed distances of pairs (k, 2): CONTINUOUS or JUMPING."""
        robust = [
            i for i in np.unique(pairs).tolist() if self._models[i]._hierarchy.solid == "robust"
        ]
        holed = [i for i in robust if sides_of(self._models[i]).region.inside == HALF]
        jumping = np.isin(pairs, holed).any(axis=1)
        return np.where(jumping, kernel.JUMPING, kernel.CONTINUOUS)

    def drop(self, rows: NDArray[np.int64]) -> None:
        """Free rows; they must not be used any more."""
        self.table["bodies"][rows] = -1
        self._free = np.concatenate((rows, self._free))

    def intervals(self, rows: NDArray[np.int64]) -> CertifiedIntervals:
        """Return the certified intervals of rows (k,) at the present poses."""
        rows = np.require(rows, np.int64, "CAWE")
        bounds, points = np.empty((len(rows), 2)), np.empty((len(rows), 2, 3))
        motions = np.empty(len(rows), np.int8)
        kernel.carry(
            self.poses, self._versions, self._balls, self._places, rows, self.table, bounds,
            points, motions,
        )  # fmt: skip
        radii = self._balls["swept"][self.pairs(rows)]
        return CertifiedIntervals(
            bounds[:, 0],
            bounds[:, 1],
            np.stack(surface_points(points[:, 0], points[:, 1], radii), axis=1),
            motions != kernel.MOVED,
            motions == kernel.SAME,
        )

    def keep(
        self,
        rows: NDArray[np.int64],
        bounds: NDArray[np.float64],
        points: NDArray[np.float64],
        features: NDArray[np.float64] | None = None,
    ) -> None:
        """Store answers for rows (k,) at the present poses.

        Args:
            rows: the rows, each at most once.
            bounds: (k, 2) metres, certified.
            points: (k, 2, 3) metres, world: the points of the models' cores that attain the upper
                bounds. If balls sweep the models, the bound is their distance less the radii.
            features: (k, 2, 4) where the points lie on the models: three parameters and the
                element, as `Model.feature` takes them; None: not known.
        """
        rows = np.require(rows, np.int64, "CAWE")
        bounds = np.require(bounds, np.float64, "CAWE")
        points = np.require(points, np.float64, "CAWE")
        if features is None:
            features = np.tile(_UNKNOWN, (len(rows), 2, 1))
        features = np.require(features, np.float64, "CAWE")
        kernel.keep(
            self.poses, self._versions, self._places, rows, bounds, points, features, self.table
        )

    def _measure(self, body: int) -> None:
        core = self._hierarchies[body] = self._models[body]._hierarchy
        self._balls[body] = core.centre, core.core_radius, core.swept_radius, core.deviation
        self._first[body], self._first_features[body] = core.some_point, core.some_feature

    def _rows_of(self, body: int) -> NDArray[np.int64]:
        pairs = self.table["bodies"]
        return np.flatnonzero((pairs == body).any(axis=1))

    def _forget(self, rows: NDArray[np.int64]) -> None:
        """Forget the answers of rows, so that only one point of each body is known."""
        fresh = np.zeros(len(rows), kernel.ANSWER)
        fresh["bodies"] = bodies = self.table["bodies"][rows]
        fresh["kind"] = self.table["kind"][rows]
        fresh["seen"] = -1
        fresh["lower"], fresh["upper"] = -np.inf, np.inf
        fresh["witness"], fresh["features"] = self._first[bodies], self._first_features[bodies]
        # NaN equals no pose, so that the pair does not count as still.
        fresh["rotation"] = fresh["translation"] = np.nan
        fresh["stretch"] = self._places["stretch"][bodies]
        self.table[rows] = fresh

    def _grow(self, least: int) -> None:
        old = len(self.table)
        new = old + max(least, old, 64)
        more = np.zeros(new - old, kernel.ANSWER)
        more["bodies"] = -1
        self.table = np.concatenate((self.table, more))
        self._free = np.concatenate((self._free, np.arange(old, new)))
