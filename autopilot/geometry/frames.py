"""The one place where axes change: ENU <-> NED for the world, FLU <-> FRD for the body.

Functions are named result_from_source. Inside Plumbline the world is ENU (x east, y north, z up) and the body
FLU (x forward, y left, z up); on the wire both are MAVLink's NED and FRD.
"""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat, quat_multiply

_HALF = sqrt(0.5)
# converts ENU coordinates to NED coordinates: half a turn about (1, 1, 0)/sqrt(2)
_NED_ENU: Quat = (0.0, _HALF, _HALF, 0.0)
# converts FLU coordinates to FRD coordinates: half a turn about x
_FRD_FLU: Quat = (0.0, 1.0, 0.0, 0.0)


@kernel
def ned_from_enu(v: Vec3) -> Vec3:
    """(east, north, up) -> (north, east, down)."""
    return (v[1], v[0], -v[2])


@kernel
def enu_from_ned(v: Vec3) -> Vec3:
    """(north, east, down) -> (east, north, up)."""
    return (v[1], v[0], -v[2])


@kernel
def frd_from_flu(v: Vec3) -> Vec3:
    """(forward, left, up) -> (forward, right, down)."""
    return (v[0], -v[1], -v[2])


@kernel
def flu_from_frd(v: Vec3) -> Vec3:
    """(forward, right, down) -> (forward, left, up)."""
    return (v[0], -v[1], -v[2])


@kernel
def quat_ned_frd_from_enu_flu(quat_wxyz: Quat) -> Quat:
    """Attitude FLU -> ENU converted to attitude FRD -> NED, with w >= 0."""
    q = quat_multiply(quat_multiply(_NED_ENU, quat_wxyz), _FRD_FLU)
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    return q


@kernel
def quat_enu_flu_from_ned_frd(quat_wxyz: Quat) -> Quat:
    """Attitude FRD -> NED converted to FLU -> ENU, with w >= 0: the same map, as both axis changes are half
    turns."""
    return quat_ned_frd_from_enu_flu(quat_wxyz)
