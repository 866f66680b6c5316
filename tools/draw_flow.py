"""Draw docs/images/flow.png: from file to message, in two rows.

    python tools/draw_flow.py [OUT.png]

It needs matplotlib: pip install '.[study]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "flow.png"

ROWS = (
    (
        "once",
        1.62,
        "#e3edf7",
        (
            ("files", "STL, OBJ, glTF, STEP,\nURDF, scene.yaml"),
            ("models", "triangles, patches,\nprofiles, points"),
            ("hierarchies", "swept rectangles,\nsixteen to a node"),
            ("watched pairs", "thresholds, range,\ntolerance"),
        ),
    ),
    (
        "every tick",
        0.0,
        "#e8f3e6",
        (
            ("inputs", "poses, joints, shapes:\nchecked, or stale"),
            ("broad phase", "pairs in range; others\ncertified farther"),
            ("carried answers", "last bounds less\nthe motion since"),
            ("search", "until the budget ends;\nbounds hold anyway"),
            ("judge", "clear, warn, stop\nby the lower bound"),
            ("messages", "closest points, alerts,\nmarkers, diagnostics"),
        ),
    ),
)
WIDTH, HEIGHT, STEP = 1.9, 0.92, 2.14


def main() -> None:
    """Draw both rows, and the arrow between them."""
    figure, axes = plt.subplots(figsize=(12.4, 3.3), dpi=110)
    for label, y, colour, steps in ROWS:
        axes.text(
            -0.15, y + HEIGHT / 2, label, ha="right", va="center", fontsize=11, style="italic"
        )
        for k, (title, text) in enumerate(steps):
            x = k * STEP
            box = FancyBboxPatch(
                (x, y), WIDTH, HEIGHT, boxstyle="round,pad=0.02,rounding_size=0.08", fc=colour,
                ec="#5b6b7b",
            )  # fmt: skip
            axes.add_patch(box)
            middle = x + WIDTH / 2
            axes.text(middle, y + 0.72, title, ha="center", va="center", fontsize=10, weight="bold")
            axes.text(middle, y + 0.30, text, ha="center", va="center", fontsize=8.6)
            if k:
                _arrow(axes, (x - STEP + WIDTH + 0.03, y + HEIGHT / 2), (x - 0.03, y + HEIGHT / 2))
    _arrow(axes, (3 * STEP + WIDTH / 2, 1.58), (3 * STEP + WIDTH / 2, HEIGHT + 0.05))
    axes.set_xlim(-1.1, 5 * STEP + WIDTH + 0.1)
    axes.set_ylim(-0.12, 2.66)
    axes.set_axis_off()
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else OUT, bbox_inches="tight", pad_inches=0.06)


def _arrow(axes: plt.Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "-|>", "color": "#5b6b7b", "lw": 1.3}
    axes.annotate("", end, start, arrowprops=style)


if __name__ == "__main__":
    main()
