"""Make the bundled scene `turbine`: a blade, the hub that carries eight of it, and their shroud.

    python tools/make_turbine_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are millimetres; the axis is x, and the blade stands
along z. All three surfaces are closed, with their normals outward.

The blade is a loft: airfoils at six radii, interpolated by cubic splines along and across. An
airfoil is NACA's four-digit thickness (Abbott and von Doenhoff 1959, section 6.3) about a parabola.
Its parameter is the square root of the chordwise position, which makes it smooth round its nose.
There it is cut into a suction and a pressure side. Ruled patches close the trailing edge, the root
and the tip. Sections lie on surfaces of revolution, so the tip follows the shroud, 0.5 mm away in
the middle of the chord and a little more at its ends.

Hub and shroud are exact rational surfaces of revolution: each profile curve makes four quarters.
The shroud's axis lies 0.25 mm off that of the hub, so that a blade's clearance varies as it turns.

Coordinates are rounded to a millionth of a millimetre. So every machine writes the same files,
although sines differ in the last bit between machines.
"""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import insert, make_interp_spline

from proximity_monitor import engine

SCENE = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled" / "turbine"

HUB_RADIUS = 50.0
SECTIONS, POINTS = 6, 17
MEAN_GAP = 0.5
OFFSET = 0.25  # of the shroud's axis, along y
THICKNESS = 6.0  # of the shroud
HALF_LENGTH = 28.0

Reals = NDArray[np.float64]


def casing(x: Reals | float) -> Reals | float:
    """Return the radius of the shroud's inner surface at x: a flare."""
    return 100.0 + 0.08 * x + 5e-4 * x * x


def airfoil(share: float) -> tuple[Reals, Reals, Reals]:
    """Return an airfoil, root (0) to tip (1): parameter (n,), axial and tangential positions.

    The points run from the trailing edge along the pressure side to the nose, and back along the
    suction side.
    """
    chord = 38.0 - 6.0 * share
    thick = 0.16 - 0.08 * share
    camber = 0.14 - 0.08 * share
    stagger = math.radians(18.0 + 34.0 * share)
    t = np.linspace(-1.0, 1.0, POINTS)
    at = t * t
    half = 5.0 * thick * (0.2969 * np.abs(t) - 0.126 * at - 0.3516 * at**2 + 0.2843 * at**3
                          - 0.1015 * at**4)  # fmt: skip
    line, slope = 4.0 * camber * at * (1.0 - at), np.arctan(4.0 * camber * (1.0 - 2.0 * at))
    along = at - np.sign(t) * half * np.sin(slope) - 0.4
    across = line + np.sign(t) * half * np.cos(slope) - 0.6 * camber
    c, s = chord * math.cos(stagger), chord * math.sin(stagger)
    return t, along * c + across * s, across * c - along * s


def section(share: float) -> Reals:
    """Return the points (n, 3) of an airfoil that is bent onto its surface of revolution."""
    _, x, across = airfoil(share)
    tip = casing(x) - MEAN_GAP - 4e-4 * x * x
    radius = HUB_RADIUS + share * (tip - HUB_RADIUS)
    angle = across / radius
    return np.stack((x, radius * np.sin(angle), radius * np.cos(angle)), axis=1)


def blade() -> engine.ParametricSurface:
    """Return the blade: suction and pressure side, trailing edge, tip and root."""
    t, *_ = airfoil(0.0)
    shares = np.linspace(0.0, 1.0, SECTIONS)
    along = make_interp_spline(shares, np.stack([section(s) for s in shares]), 3)
    across = make_interp_spline(t, along.c.swapaxes(0, 1), 3)
    across = insert(0.0, across, m=2)  # a knot of full multiplicity at the nose, to cut there
    control = rounded(across.c[: len(across.t) - 4])  # the spline pads its coefficients with zeros
    first = int(np.searchsorted(across.t, 0.0))
    in_v, in_u = along.t, np.append(0.0, across.t[first:])
    pressure, suction = control[first - 1 :: -1], control[first - 1 :]
    if not np.array_equal(in_u, np.append(0.0, -across.t[first + 2 :: -1])):
        raise AssertionError("the two sides must have the same knots")

    def ruled(a: Reals, b: Reals, knots: Reals) -> engine.Patch:
        """Return the patch between two curves (n, 3)."""
        return engine.Patch(np.stack((a, b)), None, knots)

    return closed(
        [
            engine.Patch(suction[:, ::-1], in_u, 1.0 - in_v[::-1]),
            engine.Patch(pressure, in_u, in_v),
            ruled(pressure[-1], suction[-1], in_v),
            ruled(pressure[:, 0], suction[:, 0], in_u),
            ruled(suction[:, -1], pressure[:, -1], in_u),
        ],
        "blade",
    )


def revolved(
    curves: list[tuple[Reals, Reals | None]], name: str, y: float = 0.0
) -> engine.ParametricSurface:
    """Return a closed surface of profile curves: (n, 2) axial positions and radii, with knots.

    Args:
        curves: one after the other; each turns about an axis along x by four quarters.
        name: of the model.
        y: of the axis.
    """
    arc = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    made = []
    for profile, knots in curves:
        weights = np.outer([1.0, math.sqrt(0.5), 1.0], np.ones(len(profile)))
        for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            around = arc @ np.array([[c, s], [-s, c]])
            control = np.empty((3, len(profile), 3))
            control[..., 0] = profile[:, 0]
            control[..., 1:] = around[:, None] * profile[:, 1:] + np.array([y, 0.0])
            made.append(engine.Patch(rounded(control), None, knots, weights))
    return closed(made, name)


def closed(patches: list[engine.Patch], name: str) -> engine.ParametricSurface:
    """Return the patches as one surface; an error if they leave it open."""
    return engine.ParametricSurface(patches, name=name, solid=True)


def rounded(points: Reals) -> Reals:
    """Return rounded coordinates, which are the same on every machine."""
    return np.round(points, 6) + 0.0


def hub() -> engine.ParametricSurface:
    """Return the hub: a nose, a drum and a back."""
    nose = np.array([[-62.0, 0.0], [-62.0, 24.0], [-44.0, HUB_RADIUS], [-20.0, HUB_RADIUS]])
    drum = np.array([[-20.0, HUB_RADIUS], [24.0, HUB_RADIUS]])
    back = np.array([[24.0, HUB_RADIUS], [24.0, 0.0]])
    return revolved([(nose, None), (drum, None), (back, None)], "hub")


def shroud() -> engine.ParametricSurface:
    """Return the shroud: the flare inside, two ends, and a cylinder outside."""
    x = np.linspace(-HALF_LENGTH, HALF_LENGTH, 7)
    flare = make_interp_spline(x, np.stack((x, casing(x)), axis=1), 3)
    knots = (flare.t - flare.t[0]) / (flare.t[-1] - flare.t[0])
    begin, end, outside = flare.c[0], flare.c[-1], casing(HALF_LENGTH) + THICKNESS
    corners = [begin, np.array([begin[0], outside]), np.array([end[0], outside]), end]
    rest = [(np.stack(pair), None) for pair in pairwise(corners)]
    return revolved([(flare.c[::-1], 1.0 - knots[::-1]), *rest], "shroud", OFFSET)


def main(folder: Path) -> None:
    """Write the three models."""
    models = folder / "models"
    models.mkdir(parents=True, exist_ok=True)
    for made in (blade(), hub(), shroud()):
        file = models / f"{made.name}.json"
        engine.save_geomdl(made, file)
        print(f"{file.name}: {made.describe('{:g} mm'.format)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
