"""A time budget: whenever it ends a search, the bounds hold, and the next call continues.

    python budget.py

Two concentric spheres are nearly equally far apart everywhere, so an exact answer takes long. If a
budget cuts most searches, the order "breadth_first" brings the bounds together soonest.
"""

from __future__ import annotations

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine import shapes


def main() -> None:
    """Ask the same question again and again, for half a millisecond each time."""
    outer, inner = shapes.sphere(1.0, 5, solid=False), shapes.sphere(0.5, 5, solid=False)
    pair, here = engine.Pair(outer, inner), np.eye(4)
    for call in range(1, 10_000):
        answer = pair.distance(here, here, budget_s=0.0005, order="breadth_first")
        if call in (1, 2, 5, 10, 20, 50, 100) or answer.status is not engine.Status.OUT_OF_TIME:
            print(f"call {call}: {answer.lower:.6f} .. {answer.upper:.6f} m, {answer.status.value}")
        if answer.status is not engine.Status.OUT_OF_TIME:
            break
    print(f"within 10 %: {pair.distance(here, here, rel_err=0.1).status.value}")


if __name__ == "__main__":
    main()
