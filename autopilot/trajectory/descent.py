"""Descents to land: quickly far above the ground, and slowly over the last metres."""

from __future__ import annotations

from autopilot.trajectory.transfer import Pace, lift_pace

SLOW_WAY_M = 3.0  # of the end of a descent, which is flown slowly


def quick_way_m(
    way_m: float, quick_m_s: float, slow_m_s: float, accel_m_s2: float, min_move_s: float
) -> float:
    """How far a descent by `way_m` leads down quickly, before a rest; 0 if it is as quick with the peak speed
    `slow_m_s` all the way. `accel_m_s2` and `min_move_s` as for `autopilot.trajectory.transfer.lift_pace`."""
    quick, slow, whole = _paces(way_m, quick_m_s, slow_m_s, accel_m_s2, min_move_s)
    return way_m - SLOW_WAY_M if quick.duration_s + slow.duration_s < whole.duration_s else 0.0


def descent_pace(
    way_m: float, quick_m_s: float, slow_m_s: float, accel_m_s2: float, min_move_s: float
) -> Pace:
    """The pace of a descent by `way_m` as a whole."""
    quick, slow, whole = _paces(way_m, quick_m_s, slow_m_s, accel_m_s2, min_move_s)
    both = Pace(quick.duration_s + slow.duration_s, quick.ramp_s)
    return both if both.duration_s < whole.duration_s else whole


def _paces(
    way_m: float, quick_m_s: float, slow_m_s: float, accel_m_s2: float, min_move_s: float
) -> tuple[Pace, Pace, Pace]:
    """Of the two parts of a descent, and of the whole way flown slowly."""
    quick_way = max(way_m - SLOW_WAY_M, 0.0)
    return (
        lift_pace(quick_way, quick_m_s, accel_m_s2, min_move_s),
        lift_pace(way_m - quick_way, slow_m_s, accel_m_s2, min_move_s),
        lift_pace(way_m, slow_m_s, accel_m_s2, min_move_s),
    )
