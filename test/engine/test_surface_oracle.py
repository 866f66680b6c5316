"""The oracle of surface distances against scipy, and its 30 digits against finite differences."""

import mpmath
import numpy as np
from engine_surfaces import by_scipy
from test_surface_distance import made


def test_the_oracle_evaluates_as_scipy_does_and_its_digits_are_right():
    for name in ("rational", "8 decades", "torn", "unclamped", "degree 15"):
        model, oracle = made(name)
        (spans,) = oracle.groups
        rng = np.random.default_rng(1)
        which = rng.integers(len(spans.low), size=20)
        at = spans.low[which] + rng.random((20, 2)) * (spans.high - spans.low)[which]
        jets = spans.jets(which, at)
        h = by_scipy(model, *at.T)
        np.testing.assert_allclose(jets[:, 0], h[:, :3] / h[:, 3:], atol=1e-12)
        with mpmath.workdps(30):
            digits = spans.jets(which[:2], np.vectorize(mpmath.mpf, otypes=[object])(at[:2]), True)
            tiny = mpmath.mpf(10) ** -12
            later = np.vectorize(mpmath.mpf, otypes=[object])(at[:2]) + [[tiny, 0]] * 2
            slope = (spans.points(which[:2], later, True) - digits[:, 0]) / tiny
        np.testing.assert_allclose(digits.astype(float), jets[:2], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(slope.astype(float), jets[:2, 1], rtol=1e-6, atol=1e-6)
