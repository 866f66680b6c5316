"""Curves of a profile that lie along its axis: they close a drawing but do not bound the solid."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .nurbs import Net, frozen, scaled_weights

Reals = NDArray[np.float64]


def lies_along(pieces: Reals, near: float) -> NDArray[np.bool_]:
    """Tell which Bezier pieces lie along the axis.

    Args:
        pieces: (s, n, 3) homogeneous control points: rho w, z w and w.
        near: how far from the axis counts as on it, metres.

    Returns:
        (s,) whether no control point is farther from the axis, so that no point of the piece is.
    """
    return (np.abs(pieces[..., 0] / pieces[..., 2]) <= near).all(axis=1)


def off_axis(nets: Sequence[Net], pieces: Sequence[Reals], near: float) -> list[tuple[int, Net]]:
    """Remove the parts along the axis from a chain of curves.

    The remaining curves keep their order and begin where the chain leaves the axis. If they would
    not form one chain, all curves are returned as they are.

    Args:
        nets: the curves of the chain.
        pieces: the Bezier pieces (s, n, 3) of each curve, as for `lies_along`.
        near: how far from the axis counts as on it, metres.

    Returns:
        The remaining curves, each with the number of the given curve that it is part of.
    """
    parts = [
        (k, part, not along)
        for k, (net, own) in enumerate(zip(nets, pieces, strict=True))
        for part, along in _parted(net, lies_along(own, near))
    ]
    is_off = [off for *_, off in parts]
    begins = [i for i, off in enumerate(is_off) if off and not is_off[i - 1]]
    first, last = pieces[0][0, 0], pieces[-1][-1, -1]
    is_loop = np.linalg.norm(first[:2] / first[2] - last[:2] / last[2]) <= near
    if len(begins) != 1 or (is_off[0] and is_off[-1] and not is_loop):
        return list(enumerate(nets))
    turned = [*range(begins[0], len(parts)), *range(begins[0])]
    return [parts[i][:2] for i in turned if is_off[i]]


def _parted(net: Net, along: NDArray[np.bool_]) -> Iterator[tuple[Net, bool]]:
    """Cut a curve where it reaches or leaves the axis; yield parts and whether each lies along it.

    It is cut only at corners: knots repeated at least as often as the degree. There a control point
    lies on the curve, so each part has a subset of the same control points.
    """
    degree, knots = net.degrees[0], net.knots_u
    first, begin, head, after = 0, 0, knots[:0], 0
    for i in np.flatnonzero(along[1:] != along[:-1]) + 1:
        t = net.spans[0].low[i]
        knot, end = np.searchsorted(knots, t), np.searchsorted(knots, t, "right")
        torn = int(end - knot) - degree  # 1: each side of the knot has its own control point
        if torn < 0:
            continue
        stretch = np.concatenate((head, knots[after : knot + degree], [t]))
        yield _part(net, begin, int(knot), stretch), bool(along[first:i].all())
        first, begin, head, after = (
            int(i),
            int(knot) - 1 + torn,
            knots[knot : knot + 1],
            knot + torn,
        )
    if first == 0:
        yield net, bool(along.all())
        return
    stretch = np.concatenate((head, knots[after:]))
    yield _part(net, begin, len(net.control), stretch), bool(along[first:].all())


def _part(net: Net, begin: int, end: int, knots: Reals) -> Net:
    """Return the curve of the control points `begin` to `end`, with the given knots."""
    weights = None if net.weights is None else scaled_weights(net.weights[begin:end])
    control = frozen(net.control[begin:end].copy())
    return replace(net, control=control, weights=weights, knots_u=frozen(knots))
