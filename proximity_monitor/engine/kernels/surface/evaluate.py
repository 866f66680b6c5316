"""Points of a rational Bezier piece, and their derivatives, from its control net."""

from __future__ import annotations

from ..base.jit import fused, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack

_MOST = 16
"""Most control points in one direction: degree 15."""


@kernel
def bernstein(degree, t, basis):
    """Write the Bernstein polynomials at t, and two derivatives, to the rows of `basis` (3, 16).

    Each polynomial is a sum of products of t and 1 - t. Neither is negative for t in 0..1, so the
    relative error is at most 3 `degree` u.
    """
    # If the compiler knows the degree, it unrolls the loops: see `jet_at`.
    if degree == 3:
        _put_basis(3, t, basis)
    elif degree == 2:
        _put_basis(2, t, basis)
    else:
        _put_basis(degree, t, basis)


@inlined
def _put_basis(degree, t, basis):
    s = 1.0 - t
    basis[0, 0] = 1.0
    for k in range(degree):
        if k == degree - 2:  # `basis` holds values of degree - 2: they give second derivatives
            _second_differences(basis, k, degree * (degree - 1.0))
        if k == degree - 1:
            _first_differences(basis, k, float(degree))
        last = 0.0
        for i in range(k + 1):
            value = basis[0, i]
            basis[0, i] = last + s * value
            last = t * value
        basis[0, k + 1] = last
    if degree < 2:
        for i in range(degree + 1):
            basis[2, i] = 0.0
        if degree == 0:
            basis[1, 0] = 0.0


@inlined
def _first_differences(basis, k, factor):
    """Write first derivatives of the polynomials of degree k + 1 from values of degree k."""
    last = 0.0
    for i in range(k + 1):
        value = basis[0, i]
        basis[1, i] = factor * (last - value)
        last = value
    basis[1, k + 1] = factor * last


@inlined
def _second_differences(basis, k, factor):
    """Write second derivatives of the polynomials of degree k + 2 from values of degree k."""
    before = last = 0.0
    for i in range(k + 1):
        value = basis[0, i]
        basis[2, i] = factor * (before - 2.0 * last + value)
        before, last = last, value
    basis[2, k + 1] = factor * (before - 2.0 * last)
    basis[2, k + 2] = factor * last


@kernel
def point_at(piece, nets, u, v):
    """Return the point of a piece at u, v in 0..1, metres."""
    basis_u, basis_v = table_on_stack(3, _MOST, 0.0), table_on_stack(3, _MOST, 0.0)
    bernstein(piece.degree_u, u, basis_u)
    bernstein(piece.degree_v, v, basis_v)
    p, q = piece.degree_u + 1, piece.degree_v + 1
    x = y = z = w = 0.0
    at = piece.net
    room = piece.room
    for i in range(p):
        for j in range(q):
            weight = basis_u[0, i] * basis_v[0, j]
            x += weight * nets[at]
            y += weight * nets[at + room]
            z += weight * nets[at + 2 * room]
            w += weight * nets[at + 3 * room]
            at += 1
    if piece.rational:
        return (x / w, y / w, z / w)
    return (x, y, z)


@shared
def jet_at(piece, nets, u, v):
    """Return the point at u, v and the derivatives by u, v, uu, uv and vv: six vectors, metres."""
    basis_u, basis_v = table_on_stack(3, _MOST, 0.0), table_on_stack(3, _MOST, 0.0)
    jet = on_stack(24, 0.0)
    bernstein(piece.degree_u, u, basis_u)
    bernstein(piece.degree_v, v, basis_v)
    p, q = piece.degree_u + 1, piece.degree_v + 1
    rows = 4 if piece.rational else 3
    for row in range(rows):
        at = piece.net + row * piece.room
        # If the compiler knows the sizes, it unrolls the loops: 4 suits most splines, 3 surfaces of
        # revolution.
        if p == 4 and q == 4:
            _put_row(nets, at, 4, 4, basis_u, basis_v, jet, row)
        elif p == 3 and q == 3:
            _put_row(nets, at, 3, 3, basis_u, basis_v, jet, row)
        else:
            _put_row(nets, at, p, q, basis_u, basis_v, jet, row)
    if piece.rational:
        _project(jet)
    return (
        (jet[0], jet[1], jet[2]), (jet[4], jet[5], jet[6]), (jet[8], jet[9], jet[10]),
        (jet[12], jet[13], jet[14]), (jet[16], jet[17], jet[18]), (jet[20], jet[21], jet[22]),
    )  # fmt: skip


@fused
def _put_row(nets, at, p, q, basis_u, basis_v, jet, row):
    """Write one coordinate and its derivatives to `jet`."""
    f = fu = fv = fuu = fuv = fvv = 0.0
    for i in range(p):
        a = b = c = 0.0
        for j in range(q):
            x = nets[at + i * q + j]
            a += basis_v[0, j] * x
            b += basis_v[1, j] * x
            c += basis_v[2, j] * x
        f += basis_u[0, i] * a
        fv += basis_u[0, i] * b
        fvv += basis_u[0, i] * c
        fu += basis_u[1, i] * a
        fuv += basis_u[1, i] * b
        fuu += basis_u[2, i] * a
    jet[row], jet[4 + row], jet[8 + row] = f, fu, fv
    jet[12 + row], jet[16 + row], jet[20 + row] = fuu, fuv, fvv


@kernel
def _project(jet):
    """Project a jet from homogeneous coordinates to space, by the quotient rule."""
    w = 1.0 / jet[3]
    wu, wv, wuu, wuv, wvv = jet[7], jet[11], jet[15], jet[19], jet[23]
    for k in range(3):
        f = jet[k] * w
        fu = (jet[4 + k] - wu * f) * w
        fv = (jet[8 + k] - wv * f) * w
        jet[12 + k] = (jet[12 + k] - 2.0 * wu * fu - wuu * f) * w
        jet[16 + k] = (jet[16 + k] - wu * fv - wv * fu - wuv * f) * w
        jet[20 + k] = (jet[20 + k] - 2.0 * wv * fv - wvv * f) * w
        jet[k], jet[4 + k], jet[8 + k] = f, fu, fv
