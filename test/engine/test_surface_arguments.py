"""What models of patches refuse: the message names the argument."""

import numpy as np
import pytest
from engine_bodies import box
from engine_surfaces import curve, patch

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ParametricSurface, Patch

PATCH, CURVE = patch(1), curve(2)


@pytest.mark.parametrize("given", [PATCH, 3, None])
def test_patches_must_be_a_list(given):
    with pytest.raises(ValueError, match="wing: patches: expected a list of Patch and Curve, got"):
        ParametricSurface(given, name="wing")


@pytest.mark.parametrize("given", ["all", 3])
def test_a_trim_must_be_one(given):
    with pytest.raises(ValueError, match="wing: trim: expected a Trim, got"):
        Patch(PATCH.control, PATCH.knots_u, PATCH.knots_v, name="wing", trim=given)


def test_the_order_of_a_derivative_must_be_a_count():
    for ask in (
        lambda order: PATCH.derivatives(0.5, 0.5, order),
        lambda order: CURVE.derivatives(0.5, order),
    ):
        with pytest.raises(ValueError, match="order = -1: must be at least 0"):
            ask(-1)
        for order in (1.5, "2", True):
            with pytest.raises(TypeError, match=r"order = .*: expected a whole number"):
                ask(order)
        assert ask(np.int8(2)).shape[-2] == 3


def test_parameters_must_have_matching_shapes():
    with pytest.raises(ValueError, match=r"patch: the shapes of u \(3,\) and v \(2,\) do not"):
        PATCH.evaluate([0.1, 0.2, 0.3], [0.1, 0.2])


@pytest.mark.parametrize(
    "model",
    [
        PATCH,
        CURVE,
        box(),
        engine.shapes.sphere(1.0),
        engine.SolidOfRevolution([Curve([[0.0, 0.0], [1.0, 1.0], [0.0, 2.0]])]),
    ],
    ids=lambda model: type(model).__name__ + " " + model.name,
)
@pytest.mark.parametrize("tolerance", [-1.0, np.nan])
def test_the_tolerance_of_a_display_must_not_be_negative(model, tolerance):
    with pytest.raises(ValueError, match=r"tolerance = .*: must be a number of at least 0"):
        model.display_mesh(tolerance)
