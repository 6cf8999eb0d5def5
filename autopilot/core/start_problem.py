"""Which sensor keeps the estimate from starting where a satellite receiver is to start it."""

from __future__ import annotations

from math import inf

from autopilot.estimation.measurements.gnss import MAX_MAGNETIC_AGE_S
from autopilot.estimation.records import NO_SENSOR, SIZE, EstimatorState

NO_FIX = "no position from the receiver"
NO_FIELD = "no reading of the magnetometer"


def start_problem(state: EstimatorState) -> str:
    """Why neither position nor load are known yet, in words; empty if the estimate has started, or no reading
    of the sensors that accompany a receiver has come."""
    if state.vehicle.source != NO_SENSOR:
        return ""
    magnetic_age_s = state.sensor_errors.magnetic_age
    has_fix = state.size == SIZE  # a fix has extended the error state by the errors of the receiver
    if has_fix and not magnetic_age_s <= MAX_MAGNETIC_AGE_S:
        return NO_FIELD
    return NO_FIX if magnetic_age_s < inf else ""
