"""The distance of two circles in space: certified, and right however they lie."""

import mpmath
import numpy as np
import pytest
from engine_bodies import pose

from proximity_monitor.engine.kernels.revolution.circles import circles_apart


def reference(motion, turned, height_b, radius, height_a):
    """The distance to 25 digits: the nearest of samples, and a minimum of d² beside each."""
    with mpmath.workdps(30):
        m = [mpmath.mpf(float(x)) for x in motion]
        w, r, big, high = (mpmath.mpf(float(x)) for x in (height_b, turned, radius, height_a))

        def square(t):
            c, s = mpmath.cos(t), mpmath.sin(t)
            p = [m[9 + i] + w * m[3 * i + 2] + r * (m[3 * i] * c + m[3 * i + 1] * s)
                 for i in range(3)]  # fmt: skip
            return (p[2] - high) ** 2 + (mpmath.hypot(p[0], p[1]) - big) ** 2

        t = np.linspace(0.0, 2.0 * np.pi, 721)
        c, s = np.cos(t), np.sin(t)
        f = np.asarray(motion, float)
        x, y, z = (
            f[9 + i] + height_b * f[3 * i + 2] + turned * (f[3 * i] * c + f[3 * i + 1] * s)
            for i in range(3)
        )
        d = np.hypot(z - height_a, np.hypot(x, y) - radius)
        around = np.flatnonzero((d <= np.roll(d, 1)) & (d <= np.roll(d, -1)))
        found = []
        for k in around[np.argsort(d[around])][:2]:
            low, high_ = (mpmath.mpf(float(t[k])) + step * 2 * mpmath.pi / 720 for step in (-1, 1))
            for _ in range(90):  # golden sections
                a, b = low + (high_ - low) * 0.382, low + (high_ - low) * 0.618
                low, high_ = (low, b) if square(a) < square(b) else (a, high_)
            found.append(mpmath.sqrt(square((low + high_) / 2)))
        return min(found)


def cases():
    """Circles at random, about nearly one axis, touching, and of very unlike radii."""
    rng, made = np.random.default_rng(5), []
    for k in range(24):
        matrix, size = pose(rng, 1.0), 1.0
        r, big = 10.0 ** rng.uniform(-1.0, 1.0, 2)
        kind = ("random", "near coaxial", "touching", "unlike", "parallel", "tiny tilt")[k % 6]
        if kind in ("near coaxial", "tiny tilt"):
            a = 10.0 ** rng.uniform(-3.0, -1.0) if kind == "near coaxial" else 1e-9
            matrix[:3, :3] = [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]
            matrix[:3, 3] *= a
        if kind == "parallel":
            matrix[:3, :3] = np.eye(3)
        if kind == "unlike":
            r, big = 10.0 ** rng.uniform(-6.0, -3.0), 10.0 ** rng.uniform(0.0, 3.0)
            size = big
        heights = rng.normal(size=2)
        if kind == "touching":  # the point of B at t = 0 lies on A, or beside it by 1e-12
            t = rng.uniform(0.0, 2.0 * np.pi)
            on = np.array([big * np.cos(t), big * np.sin(t), heights[1]])
            on[2] += 1e-12 * (k % 4)
            matrix[:3, 3] = on - matrix[:3, :3] @ [r, 0.0, heights[0]]
        motion = np.concatenate((matrix[:3, :3].ravel(), size * matrix[:3, 3]))
        if kind == "touching":
            motion[9:] = matrix[:3, 3]
        made.append((kind, (motion, r, heights[0], big, heights[1])))
    return made


@pytest.mark.parametrize(("kind", "circles"), cases())
def test_bounds_hold_and_meet(kind, circles):
    lower, upper, c, s = circles_apart(*circles)
    true = reference(*circles)
    motion, r, w, big, high = circles
    size = r + big + abs(w) + abs(high) + np.abs(motion[9:]).sum()
    assert lower <= true <= upper
    assert upper - lower <= 1e-12 * size
    point = motion[9:] + motion[:9].reshape(3, 3) @ [r * c, r * s, w]
    off = np.hypot(point[2] - high, np.hypot(point[0], point[1]) - big)
    assert abs(off - upper) <= 1e-13 * size


def test_circles_about_one_axis():
    """Where every point is nearest, that is known at once."""
    motion = np.concatenate((np.eye(3).ravel(), [0.0, 0.0, 0.5]))
    lower, upper, _, _ = circles_apart(motion, 1.0, 0.25, 2.0, -0.25)
    assert lower <= np.sqrt(2.0) <= upper
    assert upper - lower < 1e-13


def test_four_minima():
    """Circles that cross each other's planes at right angles have equal minima: either will do."""
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    motion = np.concatenate((turn.ravel(), [0.0, 0.0, 0.0]))
    lower, upper, _, _ = circles_apart(motion, 2.0, 0.0, 1.0, 0.0)
    assert lower <= 1.0 <= upper
    assert upper - lower < 1e-13
