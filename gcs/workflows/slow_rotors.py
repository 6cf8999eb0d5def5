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


def _bandwidths(table: AutopilotParameters) -> tuple[float, float]:
    """Bandwidths (rad/s) of the attitude and of the position for a vehicle with these parameters."""
    from autopilot.control.believed import believed_design, believed_vehicle  # loads the laws

    vehicle = believed_vehicle(table)
    return believed_design(table, vehicle).omega_R, sqrt(table["QP_KX"] / vehicle.quad_mass)


def _lag_text(table: AutopilotParameters, attitude: float, least: float) -> str:
    return (
        f"rotor_tau_s = {1e-3 * table['VEH_ROTOR_TAU']:g}: rotors this slow let the vehicle control its "
        f"attitude at {attitude:.1f} rad/s, and {least:.1f} rad/s are needed to hold its position"
    )


def slow_rotor_violations(table: AutopilotParameters) -> list[Violation]:
    """The violation of a vehicle whose rotors are too slow to hold it in place; empty if they are not."""
    if 1e-3 * table["VEH_ROTOR_TAU"] <= _FAST_LAG_S:
        return []
    attitude, position = _bandwidths(table)
    least = MIN_RATIO * position
    if attitude >= least:
        return []
    text = f"{_lag_text(table, attitude, least)}: it cannot hover; use faster rotors"
    return [Violation(0, "bandwidth", attitude, least, 0.0, text)]


def slow_rotor_warnings(table: AutopilotParameters) -> list[str]:
    """A line if the rotors are so slow that the load sways by tenths of a metre, or worse."""
    if 1e-3 * table["VEH_ROTOR_TAU"] <= _FAST_LAG_S:
        return []
    attitude, position = _bandwidths(table)
    least = STEADY_RATIO * position
    if attitude >= least:
        return []
    return [f"{_lag_text(table, attitude, least)} steadily: the load sways, or is lost; use faster rotors"]
