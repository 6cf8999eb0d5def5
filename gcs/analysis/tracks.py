"""A flight as named columns, per message type and source, on one clock and in one set of axes.

Times are seconds of the vehicle's clock since boot (`time_usec` / 1e6). World axes are ENU relative to home,
body axes FLU, units SI. Each track is sorted by time, one sample per time stamp. A track that was never
received has length zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items.records import WireItem
from gcs.analysis.axes import Floats

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class LoadTrack:
    """LOAD_STATE of one source; n samples."""

    time_s: Floats  # (n,)
    position_m: Floats  # (n, 3) ENU
    velocity_m_s: Floats  # (n, 3) ENU
    q_cable: Floats  # (n, 3) unit vector from vehicle to load, ENU
    q_cable_dot: Floats  # (n, 3) 1/s, ENU
    distance_m: Floats  # (n,) from vehicle to load
    tension_n: Floats  # (n,)
    slack_events: Ints  # (n,) since start, wraps at 65536
    taut: Ints  # (n,) 1 while taut

    @property
    def vehicle_m(self) -> Floats:
        """(n, 3) ENU, position of the vehicle."""
        return self.position_m - self.distance_m[:, None] * self.q_cable

    @property
    def attachment_m_s(self) -> Floats:
        """(n, 3) ENU, velocity of the upper end of the cable. The distance is differentiated over three
        samples: while it is constant this is exact; within 8 ms of an impact it is wrong by up to its size.
        """
        if len(self.time_s) < 2:
            return np.full_like(self.velocity_m_s, np.nan)
        reeled = np.gradient(self.distance_m, self.time_s)[:, None]
        turned = self.distance_m[:, None] * self.q_cable_dot
        return np.asarray(self.velocity_m_s - turned - reeled * self.q_cable)


@dataclass(frozen=True)
class FilterTrack:
    """FILTER_STATE: the built-in filter, which runs beside a custom estimator; n samples."""

    time_s: Floats  # (n,)
    position_m: Floats  # (n, 3) ENU, of the load
    velocity_m_s: Floats  # (n, 3) ENU, of the load


@dataclass(frozen=True)
class SetpointTrack:
    """LOAD_SETPOINT."""

    time_s: Floats  # (n,)
    position_m: Floats  # (n, 3) ENU, desired
    velocity_m_s: Floats  # (n, 3) ENU, desired
    acceleration_m_s2: Floats  # (n, 3) ENU, desired
    requested_m: Floats  # (n, 3) ENU, requested by the mission; desired is the nearest that can be flown
    requested_m_s: Floats  # (n, 3) ENU
    q_cable_c: Floats  # (n, 3) commanded cable direction, ENU
    elapsed_s: Floats  # (n,) since the leg began: an item or a phase has one or several
    duration_s: Floats  # (n,) of the leg, NaN if open
    item: Ints  # (n,) mission item
    phase: Ints  # (n,) PLUMBLINE_PHASE
    control_mode: Ints  # (n,) PLUMBLINE_CONTROL_MODE

    @property
    def is_reported(self) -> bool:
        """Whether the autopilot reported it; that of others is observed (`gcs.analysis.observed`)."""
        return bool(np.isfinite(self.elapsed_s).any())


@dataclass(frozen=True)
class CascadeTrack:
    """CASCADE_ERRORS."""

    time_s: Floats  # (n,)
    e_x: Floats  # (n, 3) m, ENU
    e_v: Floats  # (n, 3) m/s, ENU
    e_q: Floats  # (n, 3) ENU
    e_q_dot: Floats  # (n, 3) 1/s, ENU
    e_R: Floats  # (n, 3) FLU
    e_Omega: Floats  # (n, 3) rad/s, FLU
    psi_R: Floats  # (n,) 0 ... 2
    psi_q: Floats  # (n,) 0 ... 2
    thrust_n: Floats  # (n,) requested from the mixer
    moment_n_m: Floats  # (n, 3) requested from the mixer, FLU
    control_mode: Ints  # (n,)


@dataclass(frozen=True)
class RotorTrack:
    """ROTOR_STATE of one source: commanded forces (autopilot) or true forces (simulator)."""

    time_s: Floats  # (n,)
    force_n: Floats  # (n, rotors)
    force_min_n: Floats  # (n,)
    force_max_n: Floats  # (n,) infinite if unlimited
    saturated: Ints  # (n,) bit i: the command of rotor i was cut at a limit


def rotor_names(rotors: RotorTrack) -> tuple[str, ...]:
    """Names of the rotors: 1, 2, ..."""
    return tuple(str(i + 1) for i in range(rotors.force_n.shape[1]))


@dataclass(frozen=True)
class AttitudeTrack:
    """HIL_STATE_QUATERNION (truth) or ATTITUDE_QUATERNION (estimate)."""

    time_s: Floats  # (n,)
    quat_wxyz: Floats  # (n, 4) FLU -> ENU
    omega_body: Floats  # (n, 3) rad/s, FLU


@dataclass(frozen=True)
class VelocityTrack:
    """HIL_STATE_QUATERNION: the true velocity of the vehicle, in whole cm/s."""

    STEP_M_S = 0.01

    time_s: Floats  # (n,)
    velocity_m_s: Floats  # (n, 3) ENU


@dataclass(frozen=True)
class HeartbeatTrack:
    """HEARTBEAT of the autopilot; time stamps of the capture, not of the vehicle."""

    time_s: Floats  # (n,)
    base_mode: Ints
    custom_mode: Ints
    system_status: Ints


@dataclass(frozen=True)
class ItemTrack:
    """MISSION_CURRENT or MISSION_ITEM_REACHED; time stamps of the capture."""

    time_s: Floats  # (n,)
    item: Ints  # (n,)


@dataclass(frozen=True)
class SimulationTrack:
    """SIM_STATUS."""

    time_s: Floats  # (n,)
    speed_factor: Floats  # (n,) 0 in lockstep
    rate_hz: Floats  # (n,) 0 in lockstep
    late_p50_us: Ints
    late_p99_us: Ints
    late_max_us: Ints
    missed: Ints
    vehicle_on_ground: Ints
    load_on_ground: Ints


@dataclass(frozen=True)
class WindTrack:
    """WIND_STATE."""

    time_s: Floats  # (n,) from this time on the values hold
    wind_m_s: Floats  # (n, 3) ENU, mean
    gust_m_s: Floats  # (n, 3) ENU, the gust pulse in force


@dataclass(frozen=True)
class SnapTrack:
    """CABLE_SNAP."""

    time_s: Floats  # (n,)
    speed_m_s: Floats  # (n,) closing speed
    impulse_n_s: Floats  # (n,)


@dataclass(frozen=True)
class BatteryTrack:
    """BATTERY_STATUS, NaN for what is unknown; time stamps of the capture."""

    GAP_S = 2.5  # a value holds for this long: one message of each second may be missing

    time_s: Floats  # (n,)
    voltage_v: Floats  # (n,)
    current_a: Floats  # (n,)
    used_mah: Floats  # (n,) since the beginning
    left_pct: Floats  # (n,) of the charge of the full battery


class StatusText(NamedTuple):
    """One whole STATUSTEXT, its chunks joined; time stamp of the capture."""

    time_s: float
    severity: int  # MAV_SEVERITY, 0 emergency ... 7 debug
    text: str


@dataclass(frozen=True)
class Telemetry:
    """All data of one flight that the analysis uses."""

    load_truth: LoadTrack
    load_estimated: LoadTrack
    load_filtered: FilterTrack
    setpoint: SetpointTrack
    cascade: CascadeTrack
    rotors_truth: RotorTrack
    rotors_commanded: RotorTrack
    attitude_truth: AttitudeTrack
    velocity_truth: VelocityTrack
    attitude_estimated: AttitudeTrack
    heartbeat: HeartbeatTrack
    mission_current: ItemTrack
    mission_reached: ItemTrack
    simulation: SimulationTrack
    wind: WindTrack
    snaps: SnapTrack
    battery: BatteryTrack  # empty unless the log says that a battery is simulated
    reported_battery: BatteryTrack  # also what the vehicle calculates without one
    texts: tuple[StatusText, ...]
    mission: tuple[WireItem, ...]  # the last transferred mission, if all of it is in the log
    parameters: dict[str, float]  # the last values that the vehicle reported
    home: Home  # the origin of the world

    @property
    def span_s(self) -> tuple[float, float] | None:
        """First and last time of the vehicle's clock in the log, None if nothing stamped was received."""
        stamps = [
            track.time_s
            for track in (
                self.load_truth,
                self.load_estimated,
                self.setpoint,
                self.cascade,
                self.rotors_commanded,
            )
            if len(track.time_s)
        ]
        if not stamps:
            return None
        return float(min(t[0] for t in stamps)), float(max(t[-1] for t in stamps))
