"""Drag of the vehicle in the air, and the direction in which there is none."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm, scale

GUST_TIME_S = 2.0  # for which gusts last
# 1/sqrt(s), random walk of the wind's force, as a share of this force: gusts are a fifth of the wind, and the
# drag, c u^2, changes by 2 c u times the gust
GUST_RANDOM_WALK = 2.0 * 0.2 * sqrt(2.0 / GUST_TIME_S)
UNKNOWN_FRAME_SHARE = 0.5  # of the air's force on a vehicle of which nothing was learned yet
MIN_UPWARD = 0.25  # least upward part of the rotors' axis: a larger tilt counts as this one


class Drag(NamedTuple):
    """Drag of the vehicle, -(linear + quadratic |v|) v."""

    linear: float  # N s/m
    quadratic: float  # N s^2/m^2


@kernel
def drag_force(v_quad: Vec3, drag: Drag) -> Vec3:
    """D, N, world frame, of a vehicle at v_quad (m/s) in air at rest."""
    return scale(-(drag.linear + drag.quadratic * norm(v_quad)), v_quad)


@kernel
def air_free_direction(axis: Vec3, frame_share: float) -> Vec3:
    """e, the direction along which a level wind does not push a vehicle whose rotors' axis is `axis`.

    `frame_share` is the frame's share of the air's force across this axis; the rest acts on the rotors, in
    their plane (`autopilot.estimation.cable_pull`).
    """
    across, upward = 1.0 - frame_share, frame_share / max(axis[2], MIN_UPWARD)
    return (across * axis[0], across * axis[1], across * axis[2] + upward)
