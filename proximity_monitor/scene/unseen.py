"""Which watched pairs cannot see one body inside the other: two surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor import engine

if TYPE_CHECKING:
    from proximity_monitor.scene.description import Scene

_NAMED = 5
"""So many pairs and bodies are named."""


@dataclass(frozen=True)
class Unseen:
    """Watched pairs of which neither body is a solid, though one has a surface that could be."""

    count: int
    """How many there are."""
    pairs: tuple[tuple[str, str], ...]
    """The first few, by the names of their bodies."""
    reasons: Mapping[str, str]
    """Why their bodies are no solids, by name."""

    def __str__(self) -> str:
        """Say so in a few lines, and how to change it; nothing where there are none."""
        if not self.count:
            return ""
        named = ", ".join(f"{a} - {b}" for a, b in self.pairs)
        more = f" and {self.count - len(self.pairs)} more" if self.count > len(self.pairs) else ""
        what = "pair cannot" if self.count == 1 else "pairs cannot"
        lines = [
            f"{self.count} watched {what} see one body inside the other, as neither is a solid: "
            f"{named}{more}; make one of each a solid: repair its model, or say 'solid: robust'"
        ]
        reasons = list(self.reasons.items())
        lines += [f"no solid: {name}: {reason}" for name, reason in reasons[:_NAMED]]
        if len(reasons) > _NAMED:
            lines.append(f"no solid: {len(reasons) - _NAMED} more bodies")
        return "\n".join(lines)


def unseen_containment(scene: Scene, models: Mapping[str, engine.TriangleMesh]) -> Unseen:
    """Find the watched pairs that cannot see one body inside the other.

    Args:
        scene: the bodies and pairs.
        models: by name of the body.
    """
    watched, names = scene.pairs, [body.name for body in scene.bodies]
    surfaces = np.flatnonzero([not models[name].is_solid for name in names])
    # Points and lines could hold nothing in any case.
    could = np.array([_has_area(models[names[i]]) for i in surfaces], dtype=bool)
    count, first, bodies = 0, [], set()
    for k, i in enumerate(surfaces):
        others = surfaces[k + 1 :][could[k + 1 :] | could[k]]
        others = others[watched.moving[others] | watched.moving[i]]
        others = others[watched.kind(np.full(len(others), i), others) >= 0]
        count += len(others)
        first += [(names[i], names[j]) for j in others[: _NAMED - len(first)]]
        bodies.update((i, *others.tolist()) if len(others) else ())
    reasons = {names[i]: models[names[i]].not_solid for i in sorted(bodies)}
    return Unseen(count, tuple(first), reasons)


def _has_area(model: engine.TriangleMesh) -> bool:
    """Whether any face has three corners."""
    a, b, c = model.faces.T
    return bool(((a != b) & (b != c) & (c != a)).any())
