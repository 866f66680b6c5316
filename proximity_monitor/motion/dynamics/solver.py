"""The arithmetic of one step, compiled: rotation, impulses, friction, islands.

Bodies are rows of arrays: `v` (n, 3) is the velocity of the centre of mass, `w` (n, 3) the angular
velocity; `inverse_mass` (n,) and `inverse_inertia` (n, 3, 3, world) are zero for bodies that cannot
move. Contacts are rows too: `bodies` (k, 2), `arms` (k, 2, 3) from each centre of mass to its
witness point, `normals` (k, 3) from the second body to the first. All are in SI units and the world
frame. `pressed` (k,) are normal impulses, `rubbed` (k, 3) friction impulses.

Numba notices only changes of this file, so helpers that `engine.compiling` lacks must be in it.
"""

from __future__ import annotations

import math

import numpy as np

from proximity_monitor.engine.compiling import cross, dot, entry, helper

ENOUGH = 1e-6
"""Metres per second: sweeps end when no contact changes its velocity by more. A micrometre per
second is not visible."""

_LEAST_TURN = 1e-15
"""Radians: the iteration for the midpoint ends here, below the last digit of an orientation."""

_PART = 0.1
"""Radians: if a body turns farther in a step, the turn is split into parts with their own axes, so
that the iteration converges fast."""

_MOST_PARTS = 100_000
"""The most parts of a turn. More would take too long for one step."""


@helper
def _times(m, x):
    return (
        m[0, 0] * x[0] + m[0, 1] * x[1] + m[0, 2] * x[2],
        m[1, 0] * x[0] + m[1, 1] * x[1] + m[1, 2] * x[2],
        m[2, 0] * x[0] + m[2, 1] * x[1] + m[2, 2] * x[2],
    )


@helper
def _times_transposed(m, x):
    return (
        m[0, 0] * x[0] + m[1, 0] * x[1] + m[2, 0] * x[2],
        m[0, 1] * x[0] + m[1, 1] * x[1] + m[2, 1] * x[2],
        m[0, 2] * x[0] + m[1, 2] * x[1] + m[2, 2] * x[2],
    )


@helper
def _row(a, i):
    return a[i, 0], a[i, 1], a[i, 2]


@entry
def orient(turn, inverse_inertia_body, rotation, inverse_inertia):
    """Write the rotation matrices and world inverse inertias for unit quaternions (n, 4) wxyz."""
    for i in range(len(turn)):
        a, b, c, d = turn[i]
        r = rotation[i]
        r[0, 0], r[0, 1], r[0, 2] = (
            1 - 2 * (c * c + d * d),
            2 * (b * c - a * d),
            2 * (b * d + a * c),
        )
        r[1, 0], r[1, 1], r[1, 2] = (
            2 * (b * c + a * d),
            1 - 2 * (b * b + d * d),
            2 * (c * d - a * b),
        )
        r[2, 0], r[2, 1], r[2, 2] = (
            2 * (b * d - a * c),
            2 * (c * d + a * b),
            1 - 2 * (b * b + c * c),
        )
        for column in range(3):
            # R I⁻¹ Rᵀ, one column at a time: R times (I⁻¹ times a row of R).
            x = _times(r, _times(inverse_inertia_body[i], _row(r, column)))
            for k in range(3):
                inverse_inertia[i, k, column] = x[k]


@helper
def _half_turn(start, spin, inverse_inertia, h):
    """Return the vector part k Ω / 2 of a turn for h seconds, and its momentum (M₀ + M₁) / 2.

    `start` is M₀, and `spin` a first guess of Ω. See `turn_freely`.
    """
    half = middle = start
    # A contraction, because h times the spin is small; if it is not, stop after fifty rounds.
    for _ in range(50):
        size = math.sqrt(dot(spin, spin))
        k = math.tan(0.5 * h * size) / size if size > 0.0 else 0.0
        half = (k * spin[0], k * spin[1], k * spin[2])
        # m = (M₀ + M₁) / 2 is M₀ turned back halfway: solve m + half × m = M₀ for m.
        along, weight = dot(half, start), 1.0 + dot(half, half)
        side = cross(half, start)
        middle = (
            (start[0] + along * half[0] - side[0]) / weight,
            (start[1] + along * half[1] - side[1]) / weight,
            (start[2] + along * half[2] - side[2]) / weight,
        )
        new = _times(inverse_inertia, middle)
        moved = abs(new[0] - spin[0]) + abs(new[1] - spin[1]) + abs(new[2] - spin[2])
        spin = new
        if moved * h <= _LEAST_TURN:
            break
    return half, middle


@entry
def turn_freely(turn, momentum, inverse_inertia_body, rotation, h):
    """Turn each body for h seconds with its angular momentum (n, 3, world), which stays constant.

    This is the implicit midpoint rule for Euler's equations, with Cayley's map for the orientation
    (Austin, Krishnaprasad, Wang 1993). With M = Rᵀ L in the body's frame, Ω = I⁻¹ (M₀ + M₁) / 2 and
    R₁ = R₀ cay(k Ω). Then M₁ - M₀ = k (M₀ + M₁) / 2 × Ω, which means R₁ M₁ = R₀ M₀. The rule keeps
    quadratic invariants, so it also keeps the energy M · I⁻¹ M / 2, whatever k is. Cayley's map of
    k Ω is the rotation of the normalised quaternion (1, k Ω / 2), by 2 atan(k |Ω| / 2). With
    k = 2 tan(h |Ω| / 2) / |Ω|, it turns by h |Ω|. So a turn about a principal axis is exact.
    """
    for i in range(len(turn)):
        start = _times_transposed(rotation[i], momentum[i])
        spin = _times(inverse_inertia_body[i], start)
        size = math.sqrt(dot(spin, spin))
        if size == 0.0:
            continue
        parts = max(1, int(min(math.ceil(h * size / _PART), _MOST_PARTS)))
        for _ in range(parts):
            half, middle = _half_turn(start, spin, inverse_inertia_body[i], h / parts)
            start = (
                2.0 * middle[0] - start[0],
                2.0 * middle[1] - start[1],
                2.0 * middle[2] - start[2],
            )
            spin = _times(inverse_inertia_body[i], start)
            b, c, d = half
            q0, q1, q2, q3 = turn[i]
            p0 = q0 - q1 * b - q2 * c - q3 * d
            p1 = q1 + q0 * b + q2 * d - q3 * c
            p2 = q2 + q0 * c + q3 * b - q1 * d
            p3 = q3 + q0 * d + q1 * c - q2 * b
            size = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
            turn[i, 0], turn[i, 1], turn[i, 2], turn[i, 3] = (
                p0 / size,
                p1 / size,
                p2 / size,
                p3 / size,
            )


@helper
def _relative(v, w, a, b, arm_a, arm_b):
    """Return the velocity of the witness point on a relative to that on b."""
    p, q = cross(w[a], arm_a), cross(w[b], arm_b)
    return (
        v[a, 0] + p[0] - v[b, 0] - q[0],
        v[a, 1] + p[1] - v[b, 1] - q[1],
        v[a, 2] + p[2] - v[b, 2] - q[2],
    )


@helper
def _push_one(v, w, body, arm, impulse, sign, inverse_mass, inverse_inertia):
    change = _times(inverse_inertia[body], cross(arm, impulse))
    for k in range(3):
        v[body, k] += sign * inverse_mass[body] * impulse[k]
        w[body, k] += sign * change[k]


@helper
def _push(v, w, a, b, arms, impulse, inverse_mass, inverse_inertia):
    """Apply an impulse to a and its opposite to b."""
    _push_one(v, w, a, arms[0], impulse, 1.0, inverse_mass, inverse_inertia)
    _push_one(v, w, b, arms[1], impulse, -1.0, inverse_mass, inverse_inertia)


@helper
def _response(a, b, arms, d, inverse_mass, inverse_inertia):
    """Return the change of the relative velocity at a contact by a unit impulse along d."""
    p = cross(_times(inverse_inertia[a], cross(arms[0], d)), arms[0])
    q = cross(_times(inverse_inertia[b], cross(arms[1], d)), arms[1])
    m = inverse_mass[a] + inverse_mass[b]
    return m * d[0] + p[0] + q[0], m * d[1] + p[1] + q[1], m * d[2] + p[2] + q[2]


@helper
def _masses(bodies, arms, normals, inverse_mass, inverse_inertia):
    """Return (k, 2): each contact's effective mass along its normal, and the least across it.

    The mass across is 1 / λ, where λ is the greater eigenvalue of the response to impulses in the
    tangent plane. A step with this mass never overshoots, so friction never adds energy.
    """
    masses = np.empty((len(bodies), 2))
    for i in range(len(bodies)):
        a, b, n = bodies[i, 0], bodies[i, 1], _row(normals, i)
        masses[i, 0] = 1.0 / dot(n, _response(a, b, arms[i], n, inverse_mass, inverse_inertia))
        side = cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0))
        size = math.sqrt(dot(side, side))
        s = (side[0] / size, side[1] / size, side[2] / size)
        t = cross(n, s)
        by_s = _response(a, b, arms[i], s, inverse_mass, inverse_inertia)
        by_t = _response(a, b, arms[i], t, inverse_mass, inverse_inertia)
        ss, st, tt = dot(s, by_s), dot(t, by_s), dot(t, by_t)
        masses[i, 1] = 2.0 / (ss + tt + math.sqrt((ss - tt) ** 2 + 4.0 * st * st))
    return masses


@helper
def _rub(v, w, i, bodies, arms, normals, mass, most, rubbed, inverse_mass, inverse_inertia):
    """Apply Coulomb's friction at one contact: an impulse of at most `most` in the tangent plane.

    Return the change of the tangential velocity.
    """
    a, b, n = bodies[i, 0], bodies[i, 1], normals[i]
    u = _relative(v, w, a, b, arms[i, 0], arms[i, 1])
    un = dot(n, u)
    p0 = rubbed[i, 0] - mass * (u[0] - un * n[0])
    p1 = rubbed[i, 1] - mass * (u[1] - un * n[1])
    p2 = rubbed[i, 2] - mass * (u[2] - un * n[2])
    size = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    if size > most:
        p0, p1, p2 = p0 * most / size, p1 * most / size, p2 * most / size
    step = (p0 - rubbed[i, 0], p1 - rubbed[i, 1], p2 - rubbed[i, 2])
    rubbed[i, 0], rubbed[i, 1], rubbed[i, 2] = p0, p1, p2
    _push(v, w, a, b, arms[i], step, inverse_mass, inverse_inertia)
    return math.sqrt(dot(step, step)) / mass


@helper
def _press(v, w, i, bodies, arms, normals, mass, target, pressed, inverse_mass, inverse_inertia):
    """Apply the normal impulse at one contact, so that it parts at `target` or faster.

    Return the change of the normal velocity.
    """
    a, b, n = bodies[i, 0], bodies[i, 1], normals[i]
    un = dot(n, _relative(v, w, a, b, arms[i, 0], arms[i, 1]))
    total = max(pressed[i] - mass * (un - target), 0.0)
    step = total - pressed[i]
    pressed[i] = total
    push = (step * n[0], step * n[1], step * n[2])
    _push(v, w, a, b, arms[i], push, inverse_mass, inverse_inertia)
    return abs(step) / mass


@entry
def prevent(
    v, w, bodies, arms, normals, targets, friction, pressed, rubbed, inverse_mass, inverse_inertia,
    sweeps,
):  # fmt: skip
    """Apply impulses by which every contact's normal velocity is `targets` (k,) or more.

    The method is projected Gauss-Seidel on ``0 <= pressed ⊥ (normal velocity - target) >= 0`` and
    Coulomb's cone (Moreau 1988; Jean 1999). It changes v and w in place, and also `pressed` (k,)
    and `rubbed` (k, 3), which hold a first guess.
    """
    masses = _masses(bodies, arms, normals, inverse_mass, inverse_inertia)
    for i in range(len(bodies)):
        n = normals[i]
        # The guess is from another moment: project its friction into the present tangent plane.
        along = dot(n, rubbed[i])
        for k in range(3):
            rubbed[i, k] -= along * n[k]
        push = (
            pressed[i] * n[0] + rubbed[i, 0],
            pressed[i] * n[1] + rubbed[i, 1],
            pressed[i] * n[2] + rubbed[i, 2],
        )
        _push(v, w, bodies[i, 0], bodies[i, 1], arms[i], push, inverse_mass, inverse_inertia)
    for _ in range(sweeps):
        change = 0.0
        for i in range(len(bodies)):
            if friction > 0.0:
                step = _rub(
                    v, w, i, bodies, arms, normals, masses[i, 1], friction * pressed[i], rubbed,
                    inverse_mass, inverse_inertia,
                )  # fmt: skip
                change = max(change, step)
            step = _press(
                v, w, i, bodies, arms, normals, masses[i, 0], targets[i], pressed,
                inverse_mass, inverse_inertia,
            )  # fmt: skip
            change = max(change, step)
        if change <= ENOUGH:
            return


@entry
def collide(
    v, w, bodies, arms, normals, hit, restitution, friction, pressed, rubbed, inverse_mass,
    inverse_inertia, sweeps,
):  # fmt: skip
    """Apply the impulses of a collision at the contacts in `hit` (k,), at one instant.

    First, impulses p without friction end every approach. Then each is applied again, multiplied by
    `restitution` (k, of the contact's island): p takes pᵀ M⁻¹ p / 2 of the energy, and applying it
    twice gives that back (Moreau 1988). If the sweeps have not converged, the second part is
    limited, by one share for all islands, so that it returns no more than the first part took. So
    no collision gains energy. Friction comes last, bounded by the whole normal impulse. v, w,
    `pressed` (k,) and `rubbed` (k, 3) are written.
    """
    count = len(bodies)
    masses = _masses(bodies, arms, normals, inverse_mass, inverse_inertia)
    before = np.zeros(count)
    pressed[:] = 0.0
    rubbed[:] = 0.0
    for i in range(count):
        a, b = bodies[i, 0], bodies[i, 1]
        before[i] = dot(normals[i], _relative(v, w, a, b, arms[i, 0], arms[i, 1]))
    for _ in range(sweeps):
        change = 0.0
        for i in range(count):
            if hit[i]:
                step = _press(
                    v, w, i, bodies, arms, normals, masses[i, 0], 0.0, pressed,
                    inverse_mass, inverse_inertia,
                )  # fmt: skip
                change = max(change, step)
        if change <= ENOUGH:
            break
    took, size = 0.0, 0.0
    for i in range(count):
        a, b = bodies[i, 0], bodies[i, 1]
        after = dot(normals[i], _relative(v, w, a, b, arms[i, 0], arms[i, 1]))
        if restitution[i] > 0.0:
            took -= pressed[i] * before[i]
            size += pressed[i] * (after - before[i])
    # s p changes the energy by s pᵀu + s² pᵀM⁻¹p / 2: no gain up to s = -2 pᵀu / pᵀM⁻¹p.
    most = 2.0 * took / size - 1.0 if size > 0.0 else 0.0
    for i in range(count):
        again = max(min(restitution[i], most), 0.0) * pressed[i]
        pressed[i] += again
        n = normals[i]
        push = (again * n[0], again * n[1], again * n[2])
        _push(v, w, bodies[i, 0], bodies[i, 1], arms[i], push, inverse_mass, inverse_inertia)
    if friction > 0.0:
        rub(v, w, bodies, arms, normals, friction, pressed, rubbed, inverse_mass, inverse_inertia,
            sweeps)  # fmt: skip


@entry
def rub(
    v, w, bodies, arms, normals, friction, pressed, rubbed, inverse_mass, inverse_inertia, sweeps
):
    """Apply friction alone, for given normal impulses (k,)."""
    masses = _masses(bodies, arms, normals, inverse_mass, inverse_inertia)
    for _ in range(sweeps):
        change = 0.0
        for i in range(len(bodies)):
            step = _rub(
                v, w, i, bodies, arms, normals, masses[i, 1], friction * pressed[i], rubbed,
                inverse_mass, inverse_inertia,
            )  # fmt: skip
            change = max(change, step)
        if change <= ENOUGH:
            return


@entry
def apply(impulses, bodies, arms, velocity, momentum, inverse_mass):
    """Add impulses (k, 3) to velocities and angular momenta of bodies that can move."""
    for i in range(len(bodies)):
        for side in range(2):
            body = bodies[i, side]
            if inverse_mass[body] > 0.0:
                sign = 1.0 - 2.0 * side
                moment = cross(arms[i, side], impulses[i])
                for k in range(3):
                    velocity[body, k] += sign * inverse_mass[body] * impulses[i, k]
                    momentum[body, k] += sign * moment[k]


@entry
def islands(bodies, joined, inverse_mass):
    """Return the island (n,) of each body: a number shared by movable bodies that contacts join."""
    island = np.arange(len(inverse_mass))
    changed = True
    while changed:
        changed = False
        for i in range(len(bodies)):
            a, b = bodies[i, 0], bodies[i, 1]
            if joined[i] and inverse_mass[a] > 0.0 and inverse_mass[b] > 0.0:
                least = min(island[a], island[b])
                if island[a] != least or island[b] != least:
                    island[a] = island[b] = least
                    changed = True
    return island


@entry
def approach(v, w, bodies, arms, normals):
    """Return the normal velocity (k,) of each contact; positive if it parts."""
    speeds = np.empty(len(bodies))
    for i in range(len(bodies)):
        a, b = bodies[i, 0], bodies[i, 1]
        speeds[i] = dot(normals[i], _relative(v, w, a, b, arms[i, 0], arms[i, 1]))
    return speeds
