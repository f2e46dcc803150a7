"""Rigid motions and planes: matrices in, matrices out.

``T_a_b`` is a (4, 4) float64 matrix that maps coordinates in frame b to frame a; metres, radians,
z up, right-handed. A leaf, as ``slam/core.py``, which hands these on.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.floating]


def transform_points(T_a_b: Array, points_b: Floats) -> Array:
    """Points (N, 3) in frame b, expressed in frame a."""
    return np.asarray(points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3], dtype=np.float64)


def inverse(T_a_b: Array) -> Array:
    """T_b_a of a rigid motion T_a_b."""
    T_b_a = np.eye(4)
    T_b_a[:3, :3] = T_a_b[:3, :3].T
    T_b_a[:3, 3] = -T_a_b[:3, :3].T @ T_a_b[:3, 3]
    return T_b_a


def pose(rotation: Array, translation: Array) -> Array:
    """(4, 4) rigid motion from a (3, 3) rotation and a (3,) translation."""
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def orthonormal(T_a_b: Array) -> Array:
    """The rigid motion nearest to a (4, 4) matrix whose rotation has lost its digits."""
    u, _, v = np.linalg.svd(T_a_b[:3, :3])
    return pose(u @ v, T_a_b[:3, 3])


def skew(v: Array) -> Array:
    """(..., 3, 3) matrices with skew(v) @ u = v x u."""
    v = np.asarray(v, dtype=np.float64)
    matrices = np.zeros((*v.shape, 3))
    for row, column, axis in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        matrices[..., row, column] = v[..., axis]
        matrices[..., column, row] = -v[..., axis]
    return matrices


def so3_exp(rotation_vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad] (Rodrigues)."""
    w = np.asarray(rotation_vectors, dtype=np.float64)
    half_turns = np.sqrt(np.einsum("...i,...i->...", w, w))[..., None, None] / np.pi
    K = skew(w)
    # sin(a) / a and (1 - cos(a)) / a^2, without their gaps at 0.
    return np.eye(3) + np.sinc(half_turns) * K + 0.5 * np.sinc(0.5 * half_turns) ** 2 * (K @ K)


def rotate(rotation_vector: Array, fractions: Array, points: Array) -> Array:
    """Points (N, 3), each turned by its fraction (N,) of one rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle < 1e-12:
        return np.array(points, dtype=np.float64)
    K = skew(rotation_vector / angle)
    angles = angle * fractions[:, None]
    turned = points + np.sin(angles) * (points @ K.T)
    turned += (1.0 - np.cos(angles)) * (points @ (K @ K).T)
    return np.asarray(turned, dtype=np.float64)


def so3_log(rotation: Array) -> Array:
    """Rotation vector (3,) [rad] of a rotation matrix, angle in [0, pi]."""
    return quaternion_log(quaternion_xyzw(rotation))


def quaternion_log(q_xyzw: Array) -> Array:
    """Rotation vector (3,) [rad] of a unit quaternion."""
    q = q_xyzw if q_xyzw[3] >= 0.0 else -q_xyzw
    sine = float(np.linalg.norm(q[:3]))
    if sine < 1e-12:
        return 2.0 * q[:3]
    return q[:3] * (2.0 * np.arctan2(sine, q[3]) / sine)


def quaternion_xyzw(rotation: Array) -> Array:
    """Unit quaternion (4,) in x, y, z, w order of a rotation matrix (Shepperd's method)."""
    m = np.asarray(rotation)
    candidates = np.array([m[0, 0], m[1, 1], m[2, 2], np.trace(m)])
    i = int(np.argmax(candidates))
    q = np.empty(4)
    if i == 3:
        q[:] = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + candidates[3]]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 - candidates[3] + 2.0 * m[i, i]
        q[j] = m[j, i] + m[i, j]
        q[k] = m[k, i] + m[i, k]
        q[3] = m[k, j] - m[j, k]
    q /= np.linalg.norm(q)
    return q if q[3] >= 0.0 else -q


def rotation_from_quaternion_xyzw(q_xyzw: Array) -> Array:
    """(3, 3) rotation of a quaternion in x, y, z, w order (normalised here)."""
    x, y, z, w = np.asarray(q_xyzw, dtype=np.float64) / np.linalg.norm(q_xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def yaw_of(T_a_b: Array) -> float:
    """Heading [rad] of b's x axis in frame a."""
    return float(np.arctan2(T_a_b[1, 0], T_a_b[0, 0]))


def interpolate(T_a_start: Array, T_a_end: Array, fractions: Array) -> tuple[Array, Array]:
    """Rotations (N, 3, 3) and translations (N, 3) at ``fractions`` (N,) of the way start -> end.

    Constant angular velocity about a fixed axis and constant linear velocity: what a base does
    within a tenth of a second. Fractions outside [0, 1] extrapolate.
    """
    delta = T_a_start[:3, :3].T @ T_a_end[:3, :3]
    steps = so3_exp(np.asarray(fractions)[:, None] * so3_log(delta))
    rotations = T_a_start[:3, :3] @ steps
    translations = T_a_start[:3, 3] + np.asarray(fractions)[:, None] * (
        T_a_end[:3, 3] - T_a_start[:3, 3]
    )
    return rotations, translations


# --- planes --------------------------------------------------------------------------------------

HORIZONTAL = 0.7
"""Of a unit normal, the height beyond which its plane is a floor or a ceiling; a wall's is less."""


def transform_plane(T_a_b: Array, normal_b: Array, d_b: float) -> tuple[Array, float]:
    """Plane n.x + d = 0 of frame b, expressed in frame a."""
    normal_a = T_a_b[:3, :3] @ normal_b
    return normal_a, float(d_b - normal_a @ T_a_b[:3, 3])


def plane_axes(normal: Array) -> tuple[Array, Array]:
    """Two unit tangents of a plane: ``first``, and ``normal x first``.

    For a wall the first one is level, to the right of who looks at it from the normal's side; for
    a floor or ceiling it is the x axis, brought into the plane.
    """
    x, y, z = (float(component) for component in normal)
    a, b, c = (1.0 - x * x, -x * y, -x * z) if abs(z) > HORIZONTAL else (-y, x, 0.0)
    length = math.sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    return np.array([a, b, c]), np.array([y * c - z * b, z * a - x * c, x * b - y * a])
