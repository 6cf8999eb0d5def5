"""How the vehicle moves while its cable is slack: from the ground to above the load, and back to the ground.

The load lies on the ground. At first the vehicle stands beside it, half a cable length away; it climbs clear
of the load, moves over it, and pulls the cable taut from there. After the load was set down, the vehicle
descends as far, moves aside, and lands. With a long cable it flies most of the way that would otherwise be
crept.
"""

from __future__ import annotations

from autopilot.trajectory.transfer import PEAK_SPEED, Pace, transfer_duration

CLEARANCE = 0.6  # height over the load, in cable lengths, at which the slack vehicle moves sideways
SET_DOWN_OFFSET = 0.5  # how far beside the load the vehicle is set down, in cable lengths
SLACK_SPEED, SLACK_ACCEL = 0.6, 0.8  # m/s, m/s^2: the vehicle's transfers while the cable is slack
TOUCH_SPEED = 0.2  # m/s, of creeping to the ground
# m, m/s: a longer way is flown at this constant speed between two ramps. A transfer from rest to rest would
# begin so gently that the vehicle stays at the ground for a minute, where its gear touches again and again
# until it turns over.
LONG_WAY, LONG_WAY_SPEED = 4.0, 1.0
_LONG_WAY_RAMP_S = PEAK_SPEED * LONG_WAY_SPEED / SLACK_ACCEL  # of either ramp
# Heights over the load, in cable lengths, at which creeping begins: until the cable is taut, and until the
# vehicle stands. They are used where the way to there is long.
CREEP_UP_SHARE, CREEP_DOWN_SHARE = 0.85, 0.2


def creep_up_share(cable_m: float) -> float:
    """Height over the load, in lengths of this cable, from which the vehicle creeps until the cable is
    taut."""
    return CREEP_UP_SHARE if (CREEP_UP_SHARE - CLEARANCE) * cable_m > LONG_WAY else CLEARANCE


def creep_down_share(cable_m: float) -> float:
    """The same from which it creeps to the ground."""
    return CREEP_DOWN_SHARE if (CLEARANCE - CREEP_DOWN_SHARE) * cable_m > LONG_WAY else CLEARANCE


def tauten_duration_s(cable_m: float, taut_speed_m_s: float) -> float:
    """Expected time (s) from take-off until a cable of this length is taut; the last part is flown at
    `taut_speed_m_s`."""
    climb, aside = CLEARANCE * cable_m, SET_DOWN_OFFSET * cable_m
    near = creep_up_share(cable_m) * cable_m
    flown_s = sum(slack_pace(way).duration_s for way in (climb, aside, near - climb))
    return flown_s + (cable_m - near) / taut_speed_m_s


def set_down_duration_s(cable_m: float) -> float:
    """Expected time (s) from the load's touch-down until the vehicle touches the ground beside it."""
    clear, aside = CLEARANCE * cable_m, SET_DOWN_OFFSET * cable_m
    low = creep_down_share(cable_m) * cable_m
    flown_s = sum(slack_pace(way).duration_s for way in (cable_m - clear, aside, clear - low))
    return flown_s + low / TOUCH_SPEED


def slack_pace(distance_m: float) -> Pace:
    """The pace at which a vehicle whose cable is slack flies so far, from rest to rest."""
    if distance_m > LONG_WAY:
        return Pace(distance_m / LONG_WAY_SPEED + _LONG_WAY_RAMP_S, _LONG_WAY_RAMP_S)
    return Pace(transfer_duration(distance_m, SLACK_SPEED, SLACK_ACCEL))
