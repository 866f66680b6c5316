"""Rigid motions for the page. Poses (7,) are x y z and the quaternion w x y z."""

from __future__ import annotations

import math

import numpy as np

SHARP = 30.0
"""Degrees between the normals of two triangles; beyond this angle their edge is sharp."""

SMOOTH = 10.0
"""Degrees between a surface's own normals at one place; up to this angle it is smooth there."""

LOCKED = 1e-9
"""Within this many radians of a pitch of 90 degrees, roll and yaw cannot be told apart."""

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def rotate(quaternion: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Rotate points (..., 3) by a unit quaternion w x y z, or each by its own, (..., 4)."""
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    twice = 2.0 * np.cross(axis, points)
    return points + w * twice + np.cross(axis, twice)


def moved(pose: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return the pose whose origin is at `offset` (3,) in the frame of `pose`."""
    return np.concatenate((pose[:3] + rotate(pose[3:], offset), pose[3:]))


def from_degrees(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the quaternion of turns about the fixed x, y and z axes, in this order."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(a), math.cos(a)) for a in (math.radians(x) / 2.0 for x in (roll, pitch, yaw))
    )
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def to_degrees(quaternion: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw in degrees: pitch within -90 to 90, the others within -180 to 180.

    At a pitch of 90 or -90 degrees, roll and yaw turn about the same axis, and yaw is 0.
    """
    w, x, y, z = quaternion.tolist()
    # Half the sum and half the difference of roll and yaw, and how well each is determined.
    half_sum, sum_known = math.atan2(x + z, w - y), math.hypot(x + z, w - y)
    half_less, less_known = math.atan2(x - z, w + y), math.hypot(x - z, w + y)
    if sum_known < LOCKED:
        half_sum = half_less
    elif less_known < LOCKED:
        half_less = half_sum
    pitch = math.degrees(2.0 * math.atan2(less_known, sum_known)) - 90.0
    roll, yaw = (math.degrees(angle) for angle in (half_sum + half_less, half_sum - half_less))
    return math.remainder(roll, 360.0), pitch, math.remainder(yaw, 360.0)


def shared(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make triangles share equal corners, so that a viewer computes each corner only once.

    Args:
        corners: (3n, 3) of the triangles.

    Returns:
        (k,) the row of the first corner at each place; (n, 3) the places of each triangle.
    """
    rows = np.ascontiguousarray(corners + 0.0)  # -0.0 has other bytes than 0.0
    whole = rows.view(np.dtype((np.void, rows.itemsize * 3))).reshape(-1)
    _, first, index = np.unique(whole, return_index=True, return_inverse=True)
    return first, index.reshape(-1, 3)


def face_normals(corners: np.ndarray) -> np.ndarray:
    """Return the unit normals (n, 3) of triangles with corners (3n, 3); 0 if degenerate."""
    normals = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def feature_edges(corners: np.ndarray, degrees: float = SHARP) -> np.ndarray:
    """Return the edges (m, 2, 3) of a mesh that are sharp or open.

    Args:
        corners: (3n, 3) of the triangles.
        degrees: minimum angle between the normals of the two triangles at a sharp edge.
    """
    first, faces = shared(np.round(corners, 9))
    points = corners[first]
    normals = face_normals(corners)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(edges.T)
    edges, face = edges[order], face[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    first = np.flatnonzero(same)
    flat = np.einsum("ij,ij->i", normals[face[first]], normals[face[first + 1]])
    keep = np.ones(len(edges), bool)
    keep[1:][same] = False  # an edge is kept once
    keep[first[flat > math.cos(math.radians(degrees))]] = False
    return points[edges[keep]]


def smoothed(
    corners: np.ndarray, normals: np.ndarray, degrees: float = SMOOTH
) -> tuple[np.ndarray, np.ndarray]:
    """Make triangles share corners where their surface is smooth.

    A viewer computes the normal at a corner from the triangles that share it. So corners at one
    place are merged if the surface's own normals agree there, and creases stay sharp.

    Args:
        corners: (3n, 3) of the triangles.
        normals: (3n, 3) unit normals of the surface there; 0 where it has none.
        degrees: largest angle between normals that agree.

    Returns:
        (k, 3) corners; (n, 3) the rows of the corners of each triangle.
    """
    place = shared(np.round(corners, 9))[1].reshape(-1)
    index, left, first_free = np.empty(len(corners), np.int64), np.arange(len(corners)), 0
    chosen = []
    while len(left):
        # At each place, take the first corner that is left and all corners that agree with it.
        at, first, which = np.unique(place[left], return_index=True, return_inverse=True)
        first = left[first]
        agree = np.einsum("ij,ij->i", normals[left], normals[first][which])
        same = (agree > math.cos(math.radians(degrees))) | (first[which] == left)
        index[left[same]] = first_free + which[same]
        chosen.append(first)
        first_free += len(at)
        left = left[~same]
    return corners[np.concatenate(chosen)], index.reshape(-1, 3)


def borders(faces: np.ndarray) -> np.ndarray:
    """Return the edges (m, 2) that only one of the triangles (n, 3) has, as pairs of corners.

    A triangle with two equal corners has no edges: there an edge of a patch shrinks to a point.
    """
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return edges[count == 1]


def multiply(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the product of two quaternions: a turn by the second, then by the first."""
    (w, x), (v, y) = (first[0], first[1:]), (second[0], second[1:])
    return np.concatenate(([w * v - x @ y], w * y + v * x + np.cross(x, y)))


def conjugate(quaternion: np.ndarray) -> np.ndarray:
    """Return the inverse of a unit quaternion."""
    return quaternion * (1.0, -1.0, -1.0, -1.0)


def to_rotation_vector(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) of a unit quaternion; its length is the angle, 0 to pi."""
    w, axis = quaternion[0], quaternion[1:]
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.zeros(3)
    angle = 2.0 * math.atan2(sine, abs(w))
    return axis * (math.copysign(angle, w) / sine)


def from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Return the unit quaternion of a rotation vector (3,), whose length is the angle."""
    angle = float(np.linalg.norm(vector))
    half = 0.5 * np.sinc(angle / (2.0 * math.pi))  # sin(angle / 2) / angle
    return np.concatenate(([math.cos(angle / 2.0)], half * vector))


def between(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Return the pose (7,) at a share, 0 to 1, of the way from one pose to the other."""
    turn = to_rotation_vector(multiply(conjugate(first[3:]), second[3:]))
    place = first[:3] + share * (second[:3] - first[:3])
    return np.concatenate((place, multiply(first[3:], from_rotation_vector(share * turn))))
