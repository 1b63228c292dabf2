"""Rotations, poses and the constant changes of convention.

`R_ab` turns b-coordinates into a-coordinates, so equal inner letters cancel: `R_fb = R_fc @ R_cb`.
Frames: f inertial (z up, yaw free) · b robot body · c camera (x = optical axis, y left, z up) · v
virtual camera · o OpenCV optical (z forward, x right, y down) · d W3C device · e W3C earth.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Triple = tuple[float, float, float]
"""Plain floats of an array (3,), as messages carry them."""

GRAVITY = 9.80665
"""Standard gravity [m/s²]; ^f g = (0, 0, -GRAVITY)."""

UP: Array = np.array([0.0, 0.0, 1.0])
"""In f, and in b while the robot is level."""

R_co: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""OpenCV optical axes in camera axes: z forward → x, x right → −y, y down → −z."""

R_cd_portrait: Array = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""W3C device axes in camera axes: rear camera, phone upright in its natural orientation."""

for _constant in (UP, R_co, R_cd_portrait):
    _constant.setflags(write=False)


def R_cd(screen_angle_deg: float) -> Array:
    """Device axes in camera axes when the picture is turned with the screen by `screen_angle_deg`.

    The sensors stay with the device, the picture follows the screen: at `screen.orientation.angle`
    = 90° the device was turned anticlockwise (as its holder sees it), so the picture's up is the
    device's +x.
    """
    return rotation_about_x(-float(np.deg2rad(screen_angle_deg))) @ R_cd_portrait


def triple(v: Array) -> Triple:
    """Plain floats of an array (3,)."""
    return float(v[0]), float(v[1]), float(v[2])


def skew(v: Array) -> Array:
    """Cross product matrix (3, 3): `skew(a) @ b` = a × b; Ṙ_ab = skew(ω) R_ab. Eq. (2)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def cross(a: Array, b: Array) -> Array:
    """a × b for 3-vectors; np.cross costs eight times as much."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def exp(theta: Array) -> Array:
    """Rotation matrix of the rotation vector `theta` [rad] (Rodrigues)."""
    x, y, z = float(theta[0]), float(theta[1]), float(theta[2])
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-12:
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = sqrt(angle2)
        a, b = sin(angle) / angle, (1.0 - cos(angle)) / angle2
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def log(R: Array) -> Array:
    """Rotation vector [rad] of `R`, |theta| ≤ π; exact near 0 and near π."""
    w, x, y, z = wxyz_from_R(R)
    n2 = x * x + y * y + z * z
    if n2 < 1e-16:
        scale = 2.0 - n2 / 3.0
    else:
        n = sqrt(n2)
        scale = 2.0 * atan2(n, w) / n
    return np.array([scale * x, scale * y, scale * z])


def wxyz_from_R(R: Array) -> tuple[float, float, float, float]:
    """Unit quaternion with w ≥ 0 (Shepperd's choice of the largest component)."""
    r00, r11, r22 = float(R[0, 0]), float(R[1, 1]), float(R[2, 2])
    candidates = (r00 + r11 + r22, r00 - r11 - r22, r11 - r00 - r22, r22 - r00 - r11)
    largest = candidates.index(max(candidates))
    s = 2.0 * sqrt(max(1.0 + candidates[largest], 1e-300))
    d21, d02, d10 = float(R[2, 1] - R[1, 2]), float(R[0, 2] - R[2, 0]), float(R[1, 0] - R[0, 1])
    s10, s20, s21 = float(R[1, 0] + R[0, 1]), float(R[2, 0] + R[0, 2]), float(R[2, 1] + R[1, 2])
    w, x, y, z = (
        (s / 4.0, d21 / s, d02 / s, d10 / s),
        (d21 / s, s / 4.0, s10 / s, s20 / s),
        (d02 / s, s10 / s, s / 4.0, s21 / s),
        (d10 / s, s20 / s, s21 / s, s / 4.0),
    )[largest]
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)


def R_from_wxyz(wxyz: npt.ArrayLike) -> Array:
    """Rotation matrix of a quaternion of any non-zero length."""
    w, x, y, z = (float(q) for q in np.asarray(wxyz, dtype=np.float64))
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    )


def rotation_about_x(angle: float) -> Array:
    """Rotation by `angle` [rad] about x."""
    c, s = cos(angle), sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_about_y(angle: float) -> Array:
    """Rotation by `angle` [rad] about y."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_about_z(angle: float) -> Array:
    """Rotation by `angle` [rad] about z."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def R_from_rpy(eta: Array) -> Array:
    """Rotation of (roll, pitch, yaw) [rad], ZYX convention: R_z(yaw) R_y(pitch) R_x(roll)."""
    return rotation_about_z(eta[2]) @ rotation_about_y(eta[1]) @ rotation_about_x(eta[0])


def rpy_from_R(R: Array) -> Array:
    """(roll, pitch, yaw) [rad] of `R`, ZYX; at pitch = ±90° roll is set to 0."""
    cos_pitch = sqrt(float(R[0, 0]) ** 2 + float(R[1, 0]) ** 2)
    pitch = atan2(-R[2, 0], cos_pitch)
    if cos_pitch < 1e-9:
        return np.array([0.0, pitch, atan2(-R[0, 1], R[1, 1])])
    return np.array([atan2(R[2, 1], R[2, 2]), pitch, atan2(R[1, 0], R[0, 0])])


def S_in_b(eta: Array) -> Array:
    """Rates of roll-pitch-yaw to angular velocity in b: ^b ω_{b/a} = S_in_b(η_{b/a}) η̇_{b/a}.

    Eq. (3). Singular (determinant cos pitch) at pitch = ±90°.
    """
    sin_roll, cos_roll = sin(eta[0]), cos(eta[0])
    sin_pitch, cos_pitch = sin(eta[1]), cos(eta[1])
    return np.array(
        [
            [1.0, 0.0, -sin_pitch],
            [0.0, cos_roll, sin_roll * cos_pitch],
            [0.0, -sin_roll, cos_roll * cos_pitch],
        ]
    )


def S_in_a(eta: Array) -> Array:
    """The same in a: ^a ω_{b/a} = S_in_a(η_{b/a}) η̇_{b/a}. Eq. (3)."""
    sin_yaw, cos_yaw = sin(eta[2]), cos(eta[2])
    sin_pitch, cos_pitch = sin(eta[1]), cos(eta[1])
    return np.array(
        [
            [cos_yaw * cos_pitch, -sin_yaw, 0.0],
            [sin_yaw * cos_pitch, cos_yaw, 0.0],
            [-sin_pitch, 0.0, 1.0],
        ]
    )


def wrap(angle: Array) -> Array:
    """Angles brought to (−π, π]."""
    wrapped: Array = -np.remainder(-angle + np.pi, 2.0 * np.pi) + np.pi
    return wrapped


def R_fc_level_from_specific_force(f_in_c: Array) -> Array:
    """An attitude whose z agrees with the direction of a specific force measured at rest."""
    up = f_in_c / sqrt(float(f_in_c @ f_in_c))
    return R_between(up, np.array([0.0, 0.0, 1.0]))


def R_between(a: Array, b: Array) -> Array:
    """The smallest rotation that turns unit vector `a` onto unit vector `b`."""
    axis = cross(a, b)
    sine, cosine = sqrt(float(axis @ axis)), float(a @ b)
    if sine < 1e-12:
        if cosine > 0.0:
            return np.eye(3)
        helper = np.array([1.0, 0.0, 0.0]) if abs(a[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        normal = cross(a, helper)
        return exp(np.pi * normal / sqrt(float(normal @ normal)))
    return exp(axis / sine * atan2(sine, cosine))
