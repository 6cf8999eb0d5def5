"""Changes of axes for whole columns: the array forms of `autopilot.geometry.frames`, and angles.

Every function takes arrays with the components along the last axis. World ENU, body FLU; the wire is NED
and FRD.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SQRT_HALF = np.sqrt(0.5)


def enu_from_ned(v: Floats) -> Floats:
    """(..., 3) north, east, down -> (..., 3) east, north, up."""
    return np.stack((v[..., 1], v[..., 0], -v[..., 2]), axis=-1)


def flu_from_frd(v: Floats) -> Floats:
    """(..., 3) forward, right, down -> (..., 3) forward, left, up."""
    return np.stack((v[..., 0], -v[..., 1], -v[..., 2]), axis=-1)


def quat_enu_flu_from_ned_frd(quat_wxyz: Floats) -> Floats:
    """(..., 4) attitude FRD -> NED rewritten as attitude FLU -> ENU, with w >= 0.

    This is the product (0, 1, 1, 0)/sqrt(2) * q * (0, 1, 0, 0), written out: a half turn on each side.
    """
    w, x, y, z = (quat_wxyz[..., i] for i in range(4))
    rotated = _SQRT_HALF * np.stack((w + z, x + y, x - y, w - z), axis=-1)
    return np.asarray(np.where(rotated[..., :1] < 0.0, -rotated, rotated), dtype=np.float64)


def roll_pitch_yaw(quat_wxyz: Floats) -> Floats:
    """(..., 4) attitude FLU -> ENU to (..., 3) angles in rad: R = Rz(yaw) Ry(pitch) Rx(roll).

    Yaw is counted from east towards north; positive pitch puts the nose down.
    """
    w, x, y, z = (quat_wxyz[..., i] for i in range(4))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack((roll, pitch, yaw), axis=-1)


def tilt(quat_wxyz: Floats) -> Floats:
    """(..., 4) attitude FLU -> ENU to the angle in rad between the thrust axis and the vertical, 0 ... pi."""
    _, x, y, _ = (quat_wxyz[..., i] for i in range(4))
    return np.asarray(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)), dtype=np.float64)


def body_axes(quat_wxyz: Floats) -> tuple[Floats, Floats]:
    """(..., 4) attitude FLU -> ENU to the forward and the left axis of the body, each (..., 3) in ENU."""
    w, x, y, z = (quat_wxyz[..., i] for i in range(4))
    forward = np.stack((1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)), axis=-1)
    left = np.stack((2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)), axis=-1)
    return forward, left


def cable_angles(q_cable: Floats) -> Floats:
    """(..., 3) unit vector from vehicle to load, ENU, to (..., 2) angles phi_L, theta_L in rad.

    q = Ry(theta_L) Rx(phi_L) (0, 0, -1): phi_L swings the load towards +y, theta_L towards -x; both are
    zero for a load that hangs straight down.
    """
    x, y, z = (q_cable[..., i] for i in range(3))
    return np.stack((np.arctan2(y, np.hypot(x, z)), np.arctan2(-x, -z)), axis=-1)


def swing(q_cable: Floats) -> Floats:
    """(..., 3) unit vector from vehicle to load, ENU, to its angle in rad from straight down, 0 ... pi."""
    x, y, z = (q_cable[..., i] for i in range(3))
    return np.asarray(np.arctan2(np.hypot(x, y), -z), dtype=np.float64)
