"""Finds watched pairs that cannot detect one body inside the other.

The larger body of such a pair is a surface, so that nothing counts as inside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor import engine

if TYPE_CHECKING:
    from proximity_monitor.scene.description import Scene

_NAMED = 5
"""How many pairs, and how many bodies, are named."""


@dataclass(frozen=True)
class Unseen:
    """Watched pairs whose larger body is a surface, so that nothing counts as inside it."""

    count: int
    """How many such pairs there are."""
    pairs: tuple[tuple[str, str], ...]
    """The first few of them, by the names of their bodies."""
    reasons: Mapping[str, str]
    """Why the larger bodies are no solids, by name."""

    def __str__(self) -> str:
        """Describe the pairs and the remedy in a few lines; empty if there are no such pairs."""
        if not self.count:
            return ""
        named = ", ".join(f"{a} - {b}" for a, b in self.pairs)
        more = f" and {self.count - len(self.pairs)} more" if self.count > len(self.pairs) else ""
        what = "pair cannot" if self.count == 1 else "pairs cannot"
        lines = [
            f"{self.count} watched {what} detect one body inside the other, because the "
            f"larger is not a solid: {named}{more}; repair its model, or set 'solid: robust' if it "
            "is a mesh"
        ]
        reasons = list(self.reasons.items())
        lines += [f"not a solid: {name}: {reason}" for name, reason in reasons[:_NAMED]]
        if len(reasons) > _NAMED:
            lines.append(f"not a solid: {len(reasons) - _NAMED} more bodies")
        return "\n".join(lines)


def unseen_containment(scene: Scene, models: Mapping[str, engine.Model]) -> Unseen:
    """Find the watched pairs that cannot detect one body inside the other.

    Args:
        scene: the bodies and pairs.
        models: by body name.
    """
    watched, names = scene.pairs, [body.name for body in scene.bodies]
    each = [models[name] for name in names]
    size, index = np.array([model.radius for model in each]), np.arange(len(names))
    # Points and lines cannot contain anything.
    hollow = np.array([not model.is_solid and model.has_area for model in each], dtype=bool)
    count, first, reasons = 0, [], {}
    for i in np.flatnonzero(hollow):
        held = (size < size[i]) | ((size == size[i]) & (~hollow | (index > i)))
        others = index[held & (watched.moving | watched.moving[i])]
        a, b = np.minimum(others, i), np.maximum(others, i)
        kept = watched.kind(a, b) >= 0
        found = list(zip(a[kept].tolist(), b[kept].tolist(), strict=True))
        if found:
            count += len(found)
            first += [(names[j], names[k]) for j, k in found[: _NAMED - len(first)]]
            reasons[names[i]] = each[i].not_solid
    return Unseen(count, tuple(first), reasons)
