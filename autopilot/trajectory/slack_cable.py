"""How the vehicle moves while its cable is slack: from the ground to above the load, and back to the ground.

The load lies on the ground. At first the vehicle stands beside it, half a cable length away; it climbs clear
of the load, moves over it, and pulls the cable taut from there. After the load was set down, the vehicle
descends as far, moves aside, and lands.
"""

from __future__ import annotations

from autopilot.trajectory.transfer import transfer_duration

CLEARANCE = 0.6  # height over the load, in cable lengths, at which the slack vehicle moves sideways
SET_DOWN_OFFSET = 0.5  # how far beside the load the vehicle is set down, in cable lengths
SLACK_SPEED, SLACK_ACCEL = 0.6, 0.8  # m/s, m/s^2: the vehicle's transfers while the cable is slack
TOUCH_SPEED = 0.2  # m/s, of creeping to the ground


def tauten_duration_s(cable_m: float, taut_speed_m_s: float) -> float:
    """Expected time (s) from take-off until a cable of this length is taut; the last part is flown at
    `taut_speed_m_s`."""
    climb, aside = CLEARANCE * cable_m, SET_DOWN_OFFSET * cable_m
    return _slack_transfer_s(climb) + _slack_transfer_s(aside) + (cable_m - climb) / taut_speed_m_s


def set_down_duration_s(cable_m: float) -> float:
    """Expected time (s) from the load's touch-down until the vehicle touches the ground beside it."""
    clear, aside = CLEARANCE * cable_m, SET_DOWN_OFFSET * cable_m
    return _slack_transfer_s(cable_m - clear) + _slack_transfer_s(aside) + clear / TOUCH_SPEED


def _slack_transfer_s(distance_m: float) -> float:
    return transfer_duration(distance_m, SLACK_SPEED, SLACK_ACCEL)
