"""Patches and curves for the engine's tests, and their points as scipy computes them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from proximity_monitor import engine

_ROOT = np.sqrt(0.5)
QUARTER = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
"""Control points of a quarter circle. Their weights are 1, √½ and 1."""
QUARTER_WEIGHTS = np.array([1.0, _ROOT, 1.0])


def clamped(rng, count, degree):
    """Return knots from 0 to 1 with repeated ends and random inner knots."""
    inner = np.sort(rng.random(count - degree - 1))
    return np.concatenate((np.zeros(degree + 1), inner, np.ones(degree + 1)))


def unclamped(rng, count, degree):
    """Return knots without repetition."""
    return np.cumsum(rng.uniform(0.1, 1.0, count + degree + 1)) - 3.0


def torn(rng, count, degree):
    """Return clamped knots with an inner one repeated like the ends: the patch may tear there."""
    repeated = np.full(min(degree + 1, count - degree - 1), 0.4)
    inner = np.concatenate((repeated, 0.4 + 0.6 * rng.random(count - degree - 1 - len(repeated))))
    return np.concatenate((np.zeros(degree + 1), np.sort(inner), np.ones(degree + 1)))


def patch(seed, shape=(7, 6), degrees=(3, 2), knots=clamped, decades=0.0, **how):
    """Return a patch with random control points, and weights that spread over `decades` decades."""
    rng = np.random.default_rng(seed)
    pairs = zip(shape, degrees, strict=True)
    given = [knots(rng, count, degree) for count, degree in pairs]
    weights = 10.0 ** rng.uniform(-0.5 * decades, 0.5 * decades, shape) if decades else None
    return engine.Patch(rng.normal(size=(*shape, 3)), *given, weights, **how)


def curve(seed, count=7, degree=3, knots=clamped, decades=0.0, columns=3, **how):
    """Return a curve with random control points; the other arguments are as for `patch`."""
    rng = np.random.default_rng(seed)
    given = knots(rng, count, degree)
    weights = 10.0 ** rng.uniform(-0.5 * decades, 0.5 * decades, count) if decades else None
    return engine.Curve(rng.normal(size=(count, columns)), given, weights, **how)


def bumps(seed, count=10):
    """Return a bicubic patch with uniform knots and bumps over the unit square."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, count)], indexing="ij")
    knots = np.concatenate((np.zeros(3), np.linspace(0.0, 1.0, count - 2), np.ones(3)))
    control = np.stack((x, y, 0.2 * rng.normal(size=x.shape)), axis=-1)
    return engine.Patch(control, knots, knots)


def revolved(profile, weights):
    """Revolve a Bezier profile (n, 2), radius and z, about z into four patches; u goes around."""
    made = []
    for turn in range(4):
        c, s = np.round((np.cos(turn * np.pi / 2), np.sin(turn * np.pi / 2)))
        around = QUARTER @ np.array([[c, s], [-s, c]])
        control = np.empty((3, len(profile), 3))
        control[..., :2] = around[:, None] * np.asarray(profile)[None, :, :1]
        control[..., 2] = np.asarray(profile)[:, 1]
        made.append(engine.Patch(control, weights=np.outer(QUARTER_WEIGHTS, weights)))
    return made


def sphere_patches():
    """Return the unit sphere as eight patches, each with an edge that collapses to a pole."""
    upper = QUARTER
    lower = QUARTER[::-1] * (1.0, -1.0)
    return [*revolved(lower, QUARTER_WEIGHTS), *revolved(upper, QUARTER_WEIGHTS)]


def torus_patches(major=1.0, minor=0.3):
    """Return a closed torus around z as sixteen patches."""
    made = []
    for turn in range(4):
        c, s = np.round((np.cos(turn * np.pi / 2), np.sin(turn * np.pi / 2)))
        profile = QUARTER @ np.array([[c, s], [-s, c]]) * minor + (major, 0.0)
        made += revolved(profile, QUARTER_WEIGHTS)
    return made


def by_scipy(patch, u, v, order_u=0, order_v=0):
    """Return numerators and weights (k, 4) of a patch's points or derivatives, by scipy."""
    weights = np.ones(patch.control.shape[:2]) if patch.weights is None else patch.weights
    net = np.concatenate((patch.control, np.ones((*weights.shape, 1))), axis=-1)
    net = net * weights[..., None]
    p, q = patch.degrees
    rows = BSpline(patch.knots_u, net, p)(u, order_u)
    each = [BSpline(patch.knots_v, row, q)(at, order_v) for row, at in zip(rows, v, strict=True)]
    return np.array(each)
