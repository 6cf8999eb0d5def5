"""Why a plot of a flight has no data, in words."""

from __future__ import annotations

import numpy as np

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.samples import AIRBORNE, Samples
from gcs.analysis.tracks import Telemetry

NOT_IN_LOG = "not in the log"
_NOT_TAKEN_OFF = "the vehicle did not take off"
_NO_POSITION = "no position of the load was asked for"
_NOT_LIFTING = (  # the load is on the ground, at the beginning or at the end of a flight
    mavlink.PLUMBLINE_PHASE_TAUTEN,
    mavlink.PLUMBLINE_PHASE_SET_DOWN,
    mavlink.PLUMBLINE_PHASE_FAILSAFE,
)


def no_error_reason(telemetry: Telemetry, samples: Samples) -> str:
    """Why no error of the load is known, in a flight or in a part of it that has none."""
    flown = telemetry.setpoint.phase[np.isin(telemetry.setpoint.phase, AIRBORNE)]
    if not len(samples.time_s) or not len(telemetry.setpoint.time_s):
        return NOT_IN_LOG
    if not len(flown):
        return _NOT_TAKEN_OFF
    return "the load was not lifted: " + _NO_POSITION if np.isin(flown, _NOT_LIFTING).all() else _NO_POSITION


def no_attitude_error_reason(telemetry: Telemetry, what: str) -> str:
    """Why an error function of the cascade has no values: that of `what`, the vehicle or the load."""
    if not len(telemetry.cascade.time_s):
        return NOT_IN_LOG
    if not np.isin(telemetry.setpoint.phase, AIRBORNE).any():
        return _NOT_TAKEN_OFF
    return f"no attitude of the {what} was asked for"
