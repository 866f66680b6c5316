"""Numbers that the papers give, to stand beside ours.

All but the last are of the 1999 paper (Larsen, Gottschalk, Lin and Manocha): its test counts are
totals of a whole benchmark, its times are means of one query.
"""

from __future__ import annotations

from dataclasses import dataclass

VOLUMES = ("pss", "aabb", "obb", "lss", "rss", "hybrid")
"""The bounding volumes in the order of the paper's tables, which call the first one "Sphere"."""


@dataclass(frozen=True)
class Cost:
    """A cell of the paper's tables: tests in all, and milliseconds a query."""

    bound_tests: float
    primitive_tests: float
    mean_ms: float


@dataclass(frozen=True)
class Application:
    """One of the paper's four benchmarks.

    Attributes:
        name: as in the paper's tables.
        scenes: our scenes; the first one that is available is taken.
        differs: how our scene differs from the paper's.
        queries: how many queries there were, if the paper says so.
    """

    name: str
    scenes: tuple[str, ...]
    differs: str
    queries: int | None = None


APPLICATIONS = (
    Application(
        "Virtual Prototyping",
        ("engine/piston-block",),
        "our own engine: four pistons in the bores of a block, 0.02 mm of clearance, one turn",
    ),
    Application(
        "Falling Tori",
        ("falling-tori", "tori"),
        "`falling-tori` is the paper's own data; `tori` is generated after its description",
        2398,
    ),
    Application(
        "Path Planning",
        ("cave/random",),
        "a generated cave and torus of the same sizes, at random poses in all of the cave",
        2880,
    ),
    Application(
        "Dynamic Simulation",
        ("chain",),
        "a generated chain of ten rings of 256 triangles; every pair of rings is a query",
    ),
)

QUESTIONS = {"collide": "Table 2", "exact": "Table 3", "10 %": "Table 4"}
"""Questions, and the table of the paper that has each."""

# For each application: bound tests and triangle tests in millions, and milliseconds a query.
_TABLES = {
    "collide": """
        4.92 1.44  173.92   6.15 0.70  7.2947   70.5  30.9   449.06    23.1  8.68  119.43
        0.61 0.05  19.200   5.64 0.38  9.4972   7.22  1.45   40.328    15.6  2.46  70.819
        0.39 .002  31.883   0.99 0.01  4.9359   1.92  0.20   25.974    2.10  .082  20.604
        1.89 .208  80.504   3.20 0.20  7.3875   4.20  1.02   34.097    1.97  .253  10.674
        0.37 .002  36.650   0.75 0.01  4.6245   1.85  0.21   29.965    1.42  .081  18.094
        0.43 .002  31.024   0.92 0.01  4.7934   1.97  0.21   29.134    1.55  .085  17.795""",
    "exact": """
        6.45 2.06  721.40   9.54 1.474 41.05    95.59 42.704 1577.869  83.49 33.67 938.063
        1.58 0.31  170.75   9.25 1.00  37.764   9.56  2.11   103.69    73.9  16.5  616.34
        1.76 0.12  1443.8   1.56 0.04  75.565   1.14  .042   92.443    12.2  0.91  625.36
        3.01 0.49  289.46   5.36 0.51  23.947   4.1   .975   51.279    13.2  2.15  111.37
        1.70 .11   213.30   1.50 0.051 9.02     1.70  .196   25.018    10.5  0.90  121.88
        1.80 .12   220.07   1.70 0.05  9.47     1.92  .209   26.743    11.0  0.94  129.08""",
    "10 %": """
        6.30 2.005 748.64   8.92 1.307 38.23    89.58 39.97  1494.2    45.7  17.4  609.01
        1.47 0.28  167.27   8.58 .855  34.60    8.18  1.70   88.104    40.8  7.02  358.78
        1.53 .072  1347.9   1.36 .018  66.995   0.93  0.01   78.835    5.43  .173  363.22
        2.90 0.463 279.87   4.95 0.445 21.93    3.62  0.84   45.874    4.15  .506  42.603
        1.47 .071  174.86   1.32 .028  7.73     1.54  0.164  23.026    3.74  .173  50.44
        1.57 .075  180.24   1.50 .028  8.13     1.72  0.17   24.10     3.85  .179  51.724""",
}


def volume_cost(question: str, application: str, volume: str) -> Cost:
    """Return a cell of Tables 2 to 4."""
    cells = _TABLES[question].split()
    column = [each.name for each in APPLICATIONS].index(application)
    at = 12 * VOLUMES.index(volume) + 3 * column
    bound, primitive, mean_ms = map(float, cells[at : at + 3])
    return Cost(1e6 * bound, 1e6 * primitive, mean_ms)


CORE_COSTS = {"pss": 1.0, "lss": 1.83, "rss": 3.10}
"""Table 1: time of a test of two volumes, as a multiple of that of two point swept spheres."""

SEARCHES = {
    ("computation", "depth_first", "none"): Cost(25.93e6, 5.514e6, 219.55),
    ("computation", "priority", "none"): Cost(1.389e6, 0.162e6, 20.61),
    ("computation", "depth_first", "cached"): Cost(11.385e6, 2.353e6, 101.911),
    ("computation", "priority", "cached"): Cost(1.378e6, 0.159e6, 20.295),
    ("computation", "ideal", "given"): Cost(1.126e6, 0.121e6, 16.517),
    ("verification", "depth_first", "none"): Cost(23.54e6, 5.279e6, 294.95),
    ("verification", "priority", "none"): Cost(0.783e6, 0.099e6, 9.771),
    ("verification", "depth_first", "cached"): Cost(0.736e6, 0.086e6, 9.841),
    ("verification", "priority", "cached"): Cost(0.683e6, 0.076e6, 8.397),
    ("verification", "ideal", "given"): Cost(0.679e6, 0.075e6, 6.164),
}
"""Table 5, by sequence, order, and what is known beforehand: nothing, the last query's nearest
triangles, or the distance itself."""

SEQUENCES = {"computation": ("cave/random", 2880), "verification": ("cave/path", 487)}
"""Table 5's sequences: our scene, and how many queries there were."""

PQP = {"exact": (3.005e6 / 2398, 0.0932e6 / 2398), "10 %": (2.269e6 / 2398, 0.0302e6 / 2398)}
"""Bound and triangle tests a query that PQP 1.3, the authors' program, makes on the falling tori
with triangle caching. They are not from the paper, but from the description of that data."""

CLOSEST_POINT_HZ, SURFACES_HZ = (10, 50), (2, 20)
"""From the 1997 paper (Johnson and Cohen), section 3.1.2: queries a second for the point of a
surface closest to a point, to 1e-6 of the parameters; and for the distance of two surfaces."""
