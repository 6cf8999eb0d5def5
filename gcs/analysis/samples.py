"""The flight on one time base: every quantity that a report compares, at the stamps of the true load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.align import as_of, hermite, linear
from gcs.analysis.axes import Floats
from gcs.analysis.release import attached, cable_length
from gcs.analysis.tracks import Ints, Telemetry, VelocityTrack

UNKNOWN = -1
_EMERGENCY = mavlink.MAV_SEVERITY_EMERGENCY

HOLD = mavlink.PLUMBLINE_PHASE_HOLD
MISSION = mavlink.PLUMBLINE_PHASE_MISSION
# the load hangs on the cable and is neither lifted nor lowered
CARRIED = (HOLD, MISSION, mavlink.PLUMBLINE_PHASE_RETURN, mavlink.PLUMBLINE_PHASE_GUIDED)
AIRBORNE = (
    mavlink.PLUMBLINE_PHASE_TAUTEN,
    mavlink.PLUMBLINE_PHASE_LIFT,
    *CARRIED,
    mavlink.PLUMBLINE_PHASE_LOWER,
    mavlink.PLUMBLINE_PHASE_SET_DOWN,
    mavlink.PLUMBLINE_PHASE_FAILSAFE,
)
ATTITUDE_MODES = (
    mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE,
    mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE,
)
PHASE_NAMES = {
    value: entry.name.removeprefix("PLUMBLINE_PHASE_").lower()
    for value, entry in mavlink.enums["PLUMBLINE_PHASE"].items()
    if not entry.name.endswith("ENUM_END")
}


@dataclass(frozen=True)
class Samples:
    """n samples at the stamps of the true load; ENU, SI; NaN (or UNKNOWN) where nothing was received.

    Desired and requested values are also NaN while the cascade tracks no position of the load.
    """

    time_s: Floats  # (n,)
    phase: Ints  # (n,)
    item: Ints  # (n,)
    control_mode: Ints  # (n,)
    in_mission: NDArray[np.bool_]  # (n,) the mission window, see `in_window`
    attached: NDArray[np.bool_]  # (n,) the load is on the cable, see `gcs.analysis.release`
    actual_m: Floats  # (n, 3) true load position
    actual_m_s: Floats  # (n, 3) true load velocity
    desired_m: Floats  # (n, 3)
    desired_m_s: Floats  # (n, 3)
    requested_m: Floats  # (n, 3) requested by the mission; desired is the nearest that can be flown
    requested_m_s: Floats  # (n, 3)
    estimated_m: Floats  # (n, 3) load position as estimated by the autopilot
    filtered_m: Floats  # (n, 3) the same from the built-in filter, in flights with a custom estimator
    vehicle_m: Floats  # (n, 3) true vehicle position: load - distance * q_cable
    vehicle_m_s: Floats  # (n, 3) true vehicle velocity
    quat_wxyz: Floats  # (n, 4) true attitude, FLU -> ENU

    @property
    def end_s(self) -> float:
        """The time of the last sample; -1 if there is none."""
        return float(self.time_s[-1]) if len(self.time_s) else -1.0

    @property
    def error_m(self) -> Floats:
        """(n, 3) true minus requested load position, e_x of (3-40)."""
        return self.actual_m - self.requested_m

    @property
    def error_m_s(self) -> Floats:
        """(n, 3) true minus requested load velocity."""
        return self.actual_m_s - self.requested_m_s

    @property
    def position_tracked(self) -> NDArray[np.bool_]:
        """(n,) `carried`, and the cascade does not track an attitude."""
        return self.carried & ~np.isin(self.control_mode, ATTITUDE_MODES)

    @property
    def carried(self) -> NDArray[np.bool_]:
        """(n,) in the mission window and the load on the cable: the samples for figures of the load."""
        return self.in_mission & self.attached


def phase_at(telemetry: Telemetry, at_s: Floats) -> Ints:
    """(n,) the phase of the setpoint in force at each time; UNKNOWN where there is none."""
    return _integers_as_of(telemetry, telemetry.setpoint.phase, at_s)


def given_up_s(telemetry: Telemetry) -> float:
    """Time (s) at which the vehicle reported, in the air, that the flight cannot continue; infinite if it did
    not. Its phase may stay the same while it falls."""
    texts = np.array([text.time_s for text in telemetry.texts if text.severity == _EMERGENCY])
    return float(texts[np.isin(phase_at(telemetry, texts), AIRBORNE)].min(initial=np.inf))


def in_window(telemetry: Telemetry, at_s: Floats) -> NDArray[np.bool_]:
    """(n,) the mission window: the setpoint in force has phase MISSION, and the flight is not given up.

    In a flight without that phase (the load was only lifted and held), the window is phase HOLD.
    """
    has_mission = bool((telemetry.setpoint.phase == MISSION).any())
    in_phase = phase_at(telemetry, at_s) == (MISSION if has_mission else HOLD)
    return np.asarray(in_phase & (at_s <= given_up_s(telemetry)))


def _integers_as_of(telemetry: Telemetry, values: Ints, at_s: Floats) -> Ints:
    found = as_of(telemetry.setpoint.time_s, values.astype(np.float64), at_s)
    return np.where(np.isnan(found), UNKNOWN, found).astype(np.int64)


def _vehicle_velocity(telemetry: Telemetry) -> Floats:
    """(n, 3) true velocity of the vehicle at the stamps of the true load: that of the upper end of the cable,
    which is not rounded, where it agrees with the rounded velocity of the vehicle; elsewhere the latter."""
    truth, rounded = telemetry.load_truth, telemetry.velocity_truth
    coarse, fine = linear(rounded.time_s, rounded.velocity_m_s, truth.time_s), truth.attachment_m_s
    return np.where(np.abs(fine - coarse) <= 0.5 * VelocityTrack.STEP_M_S, fine, coarse)


def samples_of(telemetry: Telemetry) -> Samples:
    """The samples of a flight. Setpoint and estimate are sent on the same ticks as the truth; only gaps are
    interpolated."""
    truth, setpoint, estimate = telemetry.load_truth, telemetry.setpoint, telemetry.load_estimated
    filtered = telemetry.load_filtered
    time_s = truth.time_s
    # while no law follows a position of the load, the estimate is sent in its place to complete the message
    control_mode = _integers_as_of(telemetry, setpoint.control_mode, time_s)
    tracked = (control_mode == mavlink.PLUMBLINE_CONTROL_LOAD_POSITION)[:, None]
    # the acceleration is sent too: the desired velocity is therefore also a cubic between stamps
    return Samples(
        time_s=time_s,
        phase=phase_at(telemetry, time_s),
        item=_integers_as_of(telemetry, setpoint.item, time_s),
        control_mode=control_mode,
        in_mission=in_window(telemetry, time_s),
        attached=attached(truth, cable_length(telemetry.parameters)),
        actual_m=truth.position_m,
        actual_m_s=truth.velocity_m_s,
        desired_m=np.where(
            tracked, hermite(setpoint.time_s, setpoint.position_m, setpoint.velocity_m_s, time_s), np.nan
        ),
        desired_m_s=np.where(
            tracked,
            hermite(setpoint.time_s, setpoint.velocity_m_s, setpoint.acceleration_m_s2, time_s),
            np.nan,
        ),
        requested_m=np.where(
            tracked, hermite(setpoint.time_s, setpoint.requested_m, setpoint.requested_m_s, time_s), np.nan
        ),
        requested_m_s=np.where(tracked, linear(setpoint.time_s, setpoint.requested_m_s, time_s), np.nan),
        estimated_m=hermite(estimate.time_s, estimate.position_m, estimate.velocity_m_s, time_s),
        filtered_m=hermite(filtered.time_s, filtered.position_m, filtered.velocity_m_s, time_s),
        vehicle_m=truth.vehicle_m,
        vehicle_m_s=_vehicle_velocity(telemetry),
        quat_wxyz=linear(telemetry.attitude_truth.time_s, telemetry.attitude_truth.quat_wxyz, time_s),
    )
