"""Rotors whose force follows its command too slowly for the loops that hold a vehicle in place.

The greater their lag, the lower the bandwidth of the attitude (`autopilot.control.design`). While the cable
is slack, the position has a bandwidth of its own (QP_KX), and the attitude must be faster: with damping
ratios of 0.9, the position's loop is unstable if its attitude follows at less than twice its bandwidth.
Flights show where vehicles are lost, because this model leaves out rotors at their limits, whose lag is not
compensated. Delays that the autopilot knows lower the bandwidth far less: the law predicts over them.
"""

from __future__ import annotations

from math import sqrt

from autopilot.trajectory.feasibility import Violation
from autopilot.vehicle.parameters import AutopilotParameters

# Bandwidth of the attitude, as a ratio to that of the position. Four vehicles flew `hover` with lags of up to
# 1 s: below the first their loads strayed by 0.2 m and more, below the second nearly all were lost.
STEADY_RATIO, MIN_RATIO = 2.3, 1.7
_FAST_LAG_S = 0.1  # rotors that are faster allow several times these ratios: they need not be computed


def _too_slow(table: AutopilotParameters, least_ratio: float) -> tuple[float, float, str] | None:
    """The attitude's bandwidth and the one that it must have (rad/s) for this ratio to that of the position,
    and a text about both; None if it has it."""
    lag_s = 1e-3 * table["VEH_ROTOR_TAU"]
    if lag_s <= _FAST_LAG_S:
        return None
    from autopilot.control.believed import believed_design, believed_vehicle  # loads the laws

    vehicle = believed_vehicle(table)
    attitude = believed_design(table, vehicle).omega_R
    least = least_ratio * sqrt(table["QP_KX"] / vehicle.quad_mass)
    if attitude >= least:
        return None
    text = (
        f"rotor_tau_s = {lag_s:g}: rotors this slow let the vehicle control its "
        f"attitude at {attitude:.1f} rad/s, and {least:.1f} rad/s are needed to hold its position"
    )
    return attitude, least, text


def slow_rotor_violations(table: AutopilotParameters) -> list[Violation]:
    """The violation of a vehicle whose rotors are too slow to hold it in place; empty if they are not."""
    found = _too_slow(table, MIN_RATIO)
    if found is None:
        return []
    attitude, least, text = found
    return [Violation(0, "bandwidth", attitude, least, 0.0, f"{text}: it cannot hover; use faster rotors")]


def slow_rotor_warnings(table: AutopilotParameters) -> list[str]:
    """A line if the rotors are so slow that the load sways by tenths of a metre, or worse."""
    found = _too_slow(table, STEADY_RATIO)
    return [] if found is None else [f"{found[2]} steadily: the load sways, or is lost; use faster rotors"]
