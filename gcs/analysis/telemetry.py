"""Tracks (`gcs.analysis.tracks`) from received messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from itertools import chain
from math import nan
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.codec import Received
from autopilot.wire.convert.battery import BatteryReading, percent_by_used, read_battery_status
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import TextReader
from gcs.analysis.axes import Floats, enu_from_ned, flu_from_frd, quat_enu_flu_from_ned_frd
from gcs.analysis.columns import Columns
from gcs.analysis.observed import observed_setpoint
from gcs.analysis.tracks import (
    AttitudeTrack,
    BatteryTrack,
    CascadeTrack,
    FilterTrack,
    HeartbeatTrack,
    ItemTrack,
    LoadTrack,
    RotorTrack,
    SetpointTrack,
    SimulationTrack,
    SnapTrack,
    StatusText,
    Telemetry,
    VelocityTrack,
    WindTrack,
)
from gcs.analysis.vehicle_setup import SETUP_MESSAGES, VehicleSetup
from gcs.clients.connection import is_vehicle

LogRecord = tuple[int, Received]  # microseconds since 1970 and the message, as in a .tlog

AUTOPILOT_COMPONENT = 1
_SIMULATOR_SYSTEM = 1  # of the messages of sitl, whatever the system id of the vehicle
_SIMULATOR_COMPONENTS = (26, 27)  # no vehicle sends as one of them
_DEFAULT_SYSTEM = 1  # of the vehicle in a log without its heartbeat
_BATTERY_STATUS = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
_CHARGE, _CAPACITY = "SIM_BAT_CHARGE", "SIM_BAT_CAP"  # per cent, and mAh, of the battery at the beginning
_SIMULATED_BATTERY = "SIM_BATTERY"  # 0: what is reported is calculated, of a battery that never gets empty
_MICRO = 1e-6


def load_telemetry(tlog: Path) -> Telemetry:
    """The flight in a .tlog file; an incomplete record at its end is left out."""
    from autopilot.wire.tlog import read_tlog

    return telemetry_of(read_tlog(tlog))


_STAMPED = (
    mavlink.MAVLINK_MSG_ID_LOAD_STATE,
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS,
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE,
    mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_SIM_STATUS,
    mavlink.MAVLINK_MSG_ID_WIND_STATE,
    mavlink.MAVLINK_MSG_ID_CABLE_SNAP,
    mavlink.MAVLINK_MSG_ID_FILTER_STATE,
)
# without a time stamp of the vehicle; other components than the autopilot send some of them too
_UNSTAMPED = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
)


def telemetry_of(records: Iterable[LogRecord]) -> Telemetry:
    """The flight of the vehicle whose heartbeat comes first in the log, with the truth of its simulator; what
    other systems sent (ground stations, the load, other vehicles) is left out."""
    vehicle, records = _vehicle_system(records)
    frames: dict[int, list[bytes]] = {message_id: [] for message_id in (*_STAMPED, *_UNSTAMPED)}
    stamps: dict[int, list[int]] = {message_id: [] for message_id in frames}
    texts: list[tuple[int, Any]] = []
    readings: list[tuple[int, BatteryReading]] = []
    setup = VehicleSetup(vehicle)
    for unix_us, received in records:
        if received.id in SETUP_MESSAGES:
            setup.receive(received)
        if received.system != vehicle and not _is_of_simulator(received):
            continue
        if received.id not in frames:
            if received.id == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                texts.append((unix_us, received.message))
            elif received.id == _BATTERY_STATUS and received.component == AUTOPILOT_COMPONENT:
                readings.append((unix_us, read_battery_status(received.message)))
        elif received.component == AUTOPILOT_COMPONENT or received.id not in _UNSTAMPED:
            frames[received.id].append(received.frame)
            stamps[received.id].append(unix_us)
    columns = {message_id: Columns(message_id, found) for message_id, found in frames.items()}
    received_us = stamps[mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT]
    if received_us:
        # the message with the shortest delay gives the best estimate of when the vehicle's clock was zero
        sent_us = columns[mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT].raw("time_usec").tolist()
        boot_us = min(
            received_at_us - sent for received_at_us, sent in zip(received_us, sent_us, strict=True)
        )
    elif stamps[mavlink.MAVLINK_MSG_ID_SYSTEM_TIME]:
        clock = columns[mavlink.MAVLINK_MSG_ID_SYSTEM_TIME].raw("time_boot_ms").tolist()
        received_and_sent = zip(stamps[mavlink.MAVLINK_MSG_ID_SYSTEM_TIME], clock, strict=True)
        boot_us = min(received_at_us - 1000 * sent for received_at_us, sent in received_and_sent)
    else:
        boot_us = min((stamps[message_id][0] for message_id in _UNSTAMPED if stamps[message_id]), default=0)
    received_at_us = {
        message_id: (np.array(stamps[message_id], dtype=np.float64) - boot_us) * _MICRO
        for message_id in _UNSTAMPED
    }
    battery = _battery(readings, setup.parameters, boot_us)
    telemetry = _assemble(columns, received_at_us, _texts(texts, boot_us), battery, setup)
    if len(telemetry.setpoint.time_s) or not (len(telemetry.load_truth.time_s) and telemetry.mission):
        return telemetry
    # an autopilot that knows of no load; its home is where the vehicle stood, not the load
    home = _origin(columns[mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION], telemetry.load_truth) or setup.home
    setpoint = observed_setpoint(
        telemetry.load_truth, telemetry.rotors_truth, telemetry.mission_current, telemetry.mission, home
    )
    return replace(telemetry, setpoint=setpoint, home=home)


def _vehicle_system(records: Iterable[LogRecord]) -> tuple[int, Iterable[LogRecord]]:
    """The system id of the first vehicle whose heartbeat is in the log, and all records of the log."""
    rest = iter(records)
    before: list[LogRecord] = []
    for record in rest:
        before.append(record)
        received = record[1]
        is_heartbeat = received.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
        if is_heartbeat and received.component == AUTOPILOT_COMPONENT and is_vehicle(received.message):
            return received.system, chain(before, rest)
    return _DEFAULT_SYSTEM, before


def _is_of_simulator(received: Received) -> bool:
    return received.system == _SIMULATOR_SYSTEM and received.component in _SIMULATOR_COMPONENTS


def _origin(hil: Columns, load: LoadTrack) -> Home | None:
    """The origin of the world: the true vehicle position in degrees minus the same position in metres."""
    hil_us = hil.raw("time_usec")
    load_us = np.round(load.time_s / _MICRO).astype(hil_us.dtype)
    _, load_rows, hil_rows = np.intersect1d(load_us, hil_us, return_indices=True)
    if not len(load_rows):
        return None
    vehicle = load.vehicle_m[load_rows]
    degE7, mm = hil["lat lon"][hil_rows], hil["alt"][hil_rows]
    initial = Home(1e-7 * float(degE7[0, 0]), 1e-7 * float(degE7[0, 1]), 1e-3 * float(mm[0]))
    # take the first vehicle position as origin, then move it by the mean difference
    differences = [
        np.subtract(enu_from_geodetic(int(lat), int(lon), int(alt), initial), place)
        for (lat, lon), alt, place in zip(degE7, mm, vehicle, strict=True)
    ]
    east, north, up = (float(v) for v in np.mean(differences, axis=0))
    latitude, longitude, altitude = geodetic_from_enu((east, north, up), initial)
    return Home(1e-7 * latitude, 1e-7 * longitude, 1e-3 * altitude)


TrackT = TypeVar("TrackT")


def _sorted(track: TrackT, keep: NDArray[np.bool_] | None = None) -> TrackT:
    """The samples to keep, sorted by time; of several with the same time stamp, the last received."""
    columns = {field.name: getattr(track, field.name) for field in fields(track)}  # type: ignore[arg-type]
    time_s = columns["time_s"]
    index = np.arange(len(time_s)) if keep is None else np.flatnonzero(keep)
    index = index[np.argsort(time_s[index], kind="stable")]
    stamps = time_s[index]
    index = index[np.append(stamps[1:] != stamps[:-1], True)] if len(stamps) else index
    return type(track)(**{name: column[index] for name, column in columns.items()})


def _load(c: Columns, source: int) -> LoadTrack:
    track = LoadTrack(
        time_s=c["time_usec"] * _MICRO,
        position_m=enu_from_ned(c["x y z"]),
        velocity_m_s=enu_from_ned(c["vx vy vz"]),
        q_cable=enu_from_ned(c["qx qy qz"]),
        q_cable_dot=enu_from_ned(c["qx_dot qy_dot qz_dot"]),
        distance_m=c["distance"],
        tension_n=c["tension"],
        slack_events=c.integers("slack_events"),
        taut=c.integers("taut"),
    )
    return _sorted(track, c["source"] == source)


def _filtered(c: Columns) -> FilterTrack:
    times_s, velocity_m_s = c["time_usec"] * _MICRO, enu_from_ned(c["vx vy vz"])
    return _sorted(FilterTrack(times_s, enu_from_ned(c["x y z"]), velocity_m_s))


def _setpoint(c: Columns, cascade: CascadeTrack) -> SetpointTrack:
    requested, requested_m_s = c["asked_x asked_y asked_z"], c["asked_vx asked_vy asked_vz"]
    if not requested.any():  # the vehicle does not send it: missing extension fields are decoded as zeros
        requested, requested_m_s = c["x y z"], c["vx vy vz"]
    time_s = c["time_usec"] * _MICRO
    # a law that commands no direction of the cable states the estimated one
    has_no_direction = np.isin(time_s, cascade.time_s[np.isnan(cascade.psi_q)])
    return _sorted(
        SetpointTrack(
            time_s=time_s,
            position_m=enu_from_ned(c["x y z"]),
            velocity_m_s=enu_from_ned(c["vx vy vz"]),
            acceleration_m_s2=enu_from_ned(c["ax ay az"]),
            requested_m=enu_from_ned(requested),
            requested_m_s=enu_from_ned(requested_m_s),
            q_cable_c=np.where(has_no_direction[:, None], np.nan, enu_from_ned(c["qx qy qz"])),
            elapsed_s=c["elapsed"],
            duration_s=c["duration"],
            item=c.integers("seq"),
            phase=c.integers("phase"),
            control_mode=c.integers("control_mode"),
        )
    )


def _cascade(c: Columns) -> CascadeTrack:
    """The errors of the cascade; NaN where the law commands no direction of the cable, or no attitude: it
    states zeros, and no measured error is exactly that."""
    has_direction, has_attitude = _is_stated(c, "psi_q", "e_q"), _is_stated(c, "psi_r", "e_r")
    return _sorted(
        CascadeTrack(
            time_s=c["time_usec"] * _MICRO,
            e_x=enu_from_ned(c["e_x"]),
            e_v=enu_from_ned(c["e_v"]),
            e_q=np.where(has_direction[:, None], enu_from_ned(c["e_q"]), np.nan),
            e_q_dot=np.where(has_direction[:, None], enu_from_ned(c["e_q_dot"]), np.nan),
            e_R=np.where(has_attitude[:, None], flu_from_frd(c["e_r"]), np.nan),
            e_Omega=np.where(has_attitude[:, None], flu_from_frd(c["e_omega"]), np.nan),
            psi_R=np.where(has_attitude, c["psi_r"], np.nan),
            psi_q=np.where(has_direction, c["psi_q"], np.nan),
            thrust_n=c["thrust"],
            moment_n_m=flu_from_frd(c["moment"]),
            control_mode=c.integers("control_mode"),
        )
    )


def _is_stated(c: Columns, function: str, error: str) -> NDArray[np.bool_]:
    """(n,) whether an error function and its vector are not both zero."""
    return np.asarray((c[function] != 0.0) | (c[error] != 0.0).any(axis=1))


def _rotors(c: Columns, source: int) -> RotorTrack:
    of_source = c["source"] == source
    counts = c.integers("rotors")[of_source]
    count = int(counts.max()) if len(counts) and counts.max() > 0 else 4
    track = RotorTrack(
        time_s=c["time_usec"] * _MICRO,
        force_n=np.hstack([c["force"], c["more_force"]])[:, :count],
        force_min_n=c["force_min"],
        force_max_n=c["force_max"],
        saturated=c.integers("saturated") | c.integers("more_saturated") << 8,
    )
    return _sorted(track, of_source)


def _attitude(time_s: Floats, quat_ned_frd: Floats, rates_frd: Floats) -> AttitudeTrack:
    return _sorted(AttitudeTrack(time_s, quat_enu_flu_from_ned_frd(quat_ned_frd), flu_from_frd(rates_frd)))


def _simulation(c: Columns) -> SimulationTrack:
    return _sorted(
        SimulationTrack(
            time_s=c["time_usec"] * _MICRO,
            speed_factor=c["speed_factor"],
            rate_hz=c["rate_hz"],
            late_p50_us=c.integers("late_p50_us"),
            late_p99_us=c.integers("late_p99_us"),
            late_max_us=c.integers("late_max_us"),
            missed=c.integers("missed"),
            vehicle_on_ground=c.integers("vehicle_on_ground"),
            load_on_ground=c.integers("load_on_ground"),
        )
    )


def _wind(c: Columns) -> WindTrack:
    return _sorted(WindTrack(c["time_usec"] * _MICRO, enu_from_ned(c["wind"]), enu_from_ned(c["gust"])))


def _snaps(c: Columns) -> SnapTrack:
    return _sorted(SnapTrack(c["time_usec"] * _MICRO, c["speed"], c["impulse"]))


def _battery(
    readings: list[tuple[int, BatteryReading]], parameters: Mapping[str, float], boot_us: int
) -> BatteryTrack:
    if parameters.get(_SIMULATED_BATTERY):
        charge = parameters.get(_CHARGE, nan), parameters.get(_CAPACITY, nan)
        left_pct = [percent_by_used(r, *charge) for _, r in readings]
    else:
        left_pct = [100.0 * r.remaining for _, r in readings]
    rows = [(r.voltage, r.current, r.used_mah, left) for (_, r), left in zip(readings, left_pct, strict=True)]
    times_us = np.array([unix_us - boot_us for unix_us, _ in readings], dtype=np.float64)
    return _sorted(BatteryTrack(times_us * _MICRO, *np.array(rows, dtype=np.float64).reshape(-1, 4).T))


def _texts(texts: list[tuple[int, Any]], boot_us: int) -> tuple[StatusText, ...]:
    """The texts at the times at which they began, also those whose last chunks are not in the log."""
    reader = TextReader()
    joined: list[StatusText] = []
    places: dict[int, int] = {}  # of the texts that are to be continued, by their number
    for unix_us, message in texts:
        if reader.begins_text(message):
            places[message.id] = len(joined)
            joined.append(StatusText((unix_us - boot_us) * _MICRO, message.severity, ""))
        text = reader.read(message)
        place = places[message.id]
        joined[place] = joined[place]._replace(text=reader.unfinished(message.id) if text is None else text)
    return tuple(joined)


def _assemble(
    columns: dict[int, Columns],
    times: dict[int, Floats],
    texts: tuple[StatusText, ...],
    battery: BatteryTrack,
    setup: VehicleSetup,
) -> Telemetry:
    load = columns[mavlink.MAVLINK_MSG_ID_LOAD_STATE]
    rotors = columns[mavlink.MAVLINK_MSG_ID_ROTOR_STATE]
    hil = columns[mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION]
    attitude = columns[mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION]
    heartbeat = columns[mavlink.MAVLINK_MSG_ID_HEARTBEAT]
    current = mavlink.MAVLINK_MSG_ID_MISSION_CURRENT
    reached = mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
    cascade = _cascade(columns[mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS])
    return Telemetry(
        load_truth=_load(load, mavlink.PLUMBLINE_SOURCE_TRUTH),
        load_estimated=_load(load, mavlink.PLUMBLINE_SOURCE_ESTIMATED),
        load_filtered=_filtered(columns[mavlink.MAVLINK_MSG_ID_FILTER_STATE]),
        setpoint=_setpoint(columns[mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT], cascade),
        cascade=cascade,
        rotors_truth=_rotors(rotors, mavlink.PLUMBLINE_SOURCE_TRUTH),
        rotors_commanded=_rotors(rotors, mavlink.PLUMBLINE_SOURCE_ESTIMATED),
        attitude_truth=_attitude(
            hil["time_usec"] * _MICRO, hil["attitude_quaternion"], hil["rollspeed pitchspeed yawspeed"]
        ),
        velocity_truth=_sorted(
            VelocityTrack(hil["time_usec"] * _MICRO, VelocityTrack.STEP_M_S * enu_from_ned(hil["vx vy vz"]))
        ),
        attitude_estimated=_attitude(
            attitude["time_boot_ms"] * 1e-3,
            attitude["q1 q2 q3 q4"],
            attitude["rollspeed pitchspeed yawspeed"],
        ),
        heartbeat=HeartbeatTrack(
            times[mavlink.MAVLINK_MSG_ID_HEARTBEAT],
            heartbeat.integers("base_mode"),
            heartbeat.integers("custom_mode"),
            heartbeat.integers("system_status"),
        ),
        mission_current=ItemTrack(times[current], columns[current].integers("seq")),
        mission_reached=ItemTrack(times[reached], columns[reached].integers("seq")),
        simulation=_simulation(columns[mavlink.MAVLINK_MSG_ID_SIM_STATUS]),
        wind=_wind(columns[mavlink.MAVLINK_MSG_ID_WIND_STATE]),
        snaps=_snaps(columns[mavlink.MAVLINK_MSG_ID_CABLE_SNAP]),
        battery=battery if setup.parameters.get(_SIMULATED_BATTERY) else _battery([], {}, 0),
        reported_battery=battery,
        texts=texts,
        mission=setup.mission,
        parameters=setup.parameters,
        home=setup.home,
    )
