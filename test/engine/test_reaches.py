"""How far parts of a profile reach along vectors of its plane, by stored reaches and by search."""

import math

import numpy as np
import pytest
from numba import njit

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.revolution import reach
from proximity_monitor.scene import bundled

_reach_of = reach._reach_of
VECTORS = [(math.cos(turn), math.sin(turn)) for turn in np.linspace(0.0, 2.0 * math.pi, 173)]


@njit(pipeline_class=ROOT)
def reaches_of(arcs, kept, part, fine, x, z, floor):
    return _reach_of(arcs, arcs[:0], kept, part, fine, x, z, floor)


def comb(count):
    """Return a rod with many grooves."""
    rho = np.where(np.arange(count) % 2 == 0, 0.2, 0.25)
    rho[0] = rho[-1] = 0.0
    points = np.stack((rho, np.linspace(0.0, 1.0, count)), axis=1)
    knots = np.concatenate(([0.0], np.arange(count), [count - 1.0]))  # straight pieces
    return SolidOfRevolution([Curve(points, knots)])


def chess(name):
    return engine.load(bundled("chess").parent / "models" / f"{name}.json", unit=1e-3)


@pytest.mark.parametrize(
    "made", [lambda: chess("table"), lambda: chess("cup"), lambda: comb(301)],
    ids=["table", "cup", "comb"],
)  # fmt: skip
def test_parts_reach_no_less_than_their_points_and_little_more(made):
    hierarchy = made()._hierarchy
    arcs, curves, kept = hierarchy.arcs, hierarchy.curves, hierarchy.reaches
    assert len(kept) <= len(arcs)
    size = np.abs(hierarchy.samples[:, :2]).max()
    for part in range(0, len(kept), 7):
        own = points_under(arcs, curves, part)
        for x, z in VECTORS[:: 1 if part == 0 else 12]:
            most = (own @ (x, z)).max()
            coarse = reaches_of(arcs, kept, part, np.inf, x, z, -np.inf)
            fine = reaches_of(arcs, kept, part, 0.0, x, z, -np.inf)
            assert most <= fine <= coarse * (1.0 + math.copysign(1e-12, coarse)) + 1e-12 * size
            assert coarse <= most + 0.1 * size
            assert fine <= most + 1e-4 * size
            # The reach is proportional to the vector's length, for any vector.
            assert reaches_of(arcs, kept, part, np.inf, 7.0 * x, 7.0 * z, -np.inf) == pytest.approx(
                7.0 * coarse, abs=1e-12 * size
            )
            # A part that reaches no farther than the floor is not searched.
            assert reaches_of(arcs, kept, part, 0.0, x, z, most + size) == most + size


def points_under(arcs, curves, part):
    """Return points (k, 2) of a profile's pieces that lie under a part: rho and z, metres."""
    arc = arcs[part]
    if arc["curve"] >= 0:
        return points_of(curves[arc["curve"]], np.linspace(arc["low"], arc["high"], 65))
    child = int(arc["child"])
    return np.concatenate([points_under(arcs, curves, k) for k in (child, child + 1)])


def points_of(curve, t):
    """Return points (k, 2) of a piece, by its Bernstein polynomials."""
    degree = int(curve["degree"])
    control = curve["control"][: 3 * (degree + 1)].reshape(-1, 3)
    i, t = np.arange(degree + 1), t[:, None]
    choose = np.array([math.comb(degree, k) for k in i])
    found = (choose * t**i * (1.0 - t) ** (degree - i)) @ control
    return found[:, :2] / found[:, 2:]
