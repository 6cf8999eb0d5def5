"""Synthetic flights, made of the dialect's own messages: arrays in, records of a .tlog out."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from autopilot.wire.codec import FrameWriter, Received, message_at
from autopilot.wire.convert.battery import BatteryReading, battery_status_message
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.telemetry import telemetry_of
from gcs.analysis.tracks import Telemetry

# keys of the record that `gcs fly --json` prints: programs rely on them
STABLE_KEYS = {
    "mission",
    "law",
    "sensors",
    "seed",
    "outcome",
    "flight_s",
    "wall_s",
    "real_time_factor",
    "load_error_max_m",
    "load_error_rms_m",
    "rise_time_90_s",
    "overshoot_pct",
    "settling_time_5pct_s",
    "psi_R_max",
    "psi_q_max",
    "saturated_fraction",
    "slack_events",
    "report_dir",
}

BOOT_US = 1_767_225_600_000_000
TICK_S = 0.008
CABLE_M = 0.7
LOAD_KG = 0.075
QUAD_KG = 0.42
GRAVITY = 9.81
ROTOR_MAX_N = 1.96
INERTIA = np.array((2.2e-3, 2.2e-3, 4.3e-3))
ARM_M = 0.126

PHASES = (  # name, duration in s; that of MISSION is inserted
    (mavlink.PLUMBLINE_PHASE_ARMED, 0.5),
    (mavlink.PLUMBLINE_PHASE_TAUTEN, 1.5),
    (mavlink.PLUMBLINE_PHASE_LIFT, 3.0),
    (mavlink.PLUMBLINE_PHASE_HOLD, 1.0),
    (mavlink.PLUMBLINE_PHASE_MISSION, None),
    (mavlink.PLUMBLINE_PHASE_HOLD, 1.0),
    (mavlink.PLUMBLINE_PHASE_LOWER, 2.0),
    (mavlink.PLUMBLINE_PHASE_SET_DOWN, 1.0),
    (mavlink.PLUMBLINE_PHASE_DISARMED, 0.2),
)
BEFORE_S = sum(duration for _, duration in PHASES[:4])
_TYPES = {
    kind: getattr(mavlink, f"MAVLink_{kind}_message")
    for kind in (
        *("hil_state_quaternion", "load_state", "rotor_state", "sim_status", "load_setpoint"),
        *("cascade_errors", "attitude_quaternion", "heartbeat", "mission_current", "statustext"),
    )
}


def _ned(v: np.ndarray) -> np.ndarray:
    return np.stack((v[..., 1], v[..., 0], -v[..., 2]), axis=-1)


@dataclass
class Flight:
    """Columns (n, ...) in ENU; to make a fault, write into them before requesting the records."""

    time_s: np.ndarray
    phase: np.ndarray
    desired: np.ndarray
    desired_v: np.ndarray
    desired_a: np.ndarray
    actual: np.ndarray
    actual_v: np.ndarray
    estimated: np.ndarray
    q_cable: np.ndarray
    distance: np.ndarray
    tension: np.ndarray
    slack_events: np.ndarray
    taut: np.ndarray
    force: np.ndarray
    command: np.ndarray
    saturated: np.ndarray
    quat: np.ndarray  # FLU -> ENU
    psi_r: np.ndarray
    psi_q: np.ndarray
    control_mode: np.ndarray
    texts: list[tuple[float, int, str]] = field(default_factory=list)
    winds: list[tuple[float, tuple]] = field(default_factory=list)  # time of the beginning, gust pulse, ENU
    snaps: list[tuple[float, float, float]] = field(default_factory=list)  # time, speed, impulse
    batteries: list[tuple[float, BatteryReading]] = field(default_factory=list)  # as the vehicle reports it
    drop: Callable[[int, str], bool] = lambda i, kind: False
    system: int = 1  # of the vehicle; its simulator is always 1

    @property
    def mission(self) -> np.ndarray:
        return self.phase == mavlink.PLUMBLINE_PHASE_MISSION

    def records(self) -> Iterator[tuple[int, bytes]]:
        truth, common, dialect = FrameWriter(1, 26), FrameWriter(self.system, 1), FrameWriter(self.system, 25)
        ground, load = FrameWriter(255, 190), FrameWriter(2, 35)
        texts = sorted(self.texts)
        for t, gust in self.winds:
            message = mavlink.MAVLink_wind_state_message(round(t * 1e6), [0.0] * 3, _ned(np.array(gust)))
            yield BOOT_US + round(t * 1e6), truth.frame(message)
        for t, speed, impulse in self.snaps:
            message = mavlink.MAVLink_cable_snap_message(round(t * 1e6), speed, impulse)
            yield BOOT_US + round(t * 1e6), truth.frame(message)
        for t, reading in self.batteries:
            yield BOOT_US + round(t * 1e6), common.frame(battery_status_message(reading))
        half = float(np.sqrt(0.5))
        # numbers of Python, of whole columns at once: a row of an array takes longer than its frame
        quats = self.quat.tolist()
        actual, actual_v, estimated, q_cable, desired, desired_v, desired_a, errors = (
            _ned(column).tolist()
            for column in (
                *(self.actual, self.actual_v, self.estimated, self.q_cable),
                *(self.desired, self.desired_v, self.desired_a, self.actual - self.desired),
            )
        )
        distances, tensions, slack_events = self.distance.tolist(), self.tension.tolist(), self.slack_events
        forces, commands, thrusts = (
            self.force.tolist(),
            self.command.tolist(),
            self.command.sum(axis=1).tolist(),
        )
        psi_r, psi_q = self.psi_r.tolist(), self.psi_q.tolist()
        nil = [0.0] * 3
        for i, t in enumerate(self.time_s.tolist()):
            us = round(t * 1e6)
            w, x, y, z = quats[i]
            quat = (half * (w + z), half * (x + y), half * (x - y), half * (w - z))
            frames: list[bytes] = []

            def say(writer: FrameWriter, kind: str, *values, i=i, frames=frames):
                if not self.drop(i, kind):
                    frames.append(writer.frame(_TYPES[kind](*values)))

            pull = distances[i], tensions[i], int(slack_events[i]), int(self.taut[i])
            motion = (*actual_v[i], *q_cable[i], 0.0, 0.0, 0.0, *pull)
            mode = int(self.control_mode[i])
            say(truth, "hil_state_quaternion", us, quat, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
            say(truth, "load_state", us, *actual[i], *motion, 0)
            say(truth, "rotor_state", us, forces[i], 0.0, ROTOR_MAX_N, 0, 0)
            if i % 25 == 0:
                say(truth, "sim_status", us, 0.0, 0.0, 0, 0, 0, 0, 0, 0)
            say(dialect, "load_state", us, *estimated[i], *motion, 2)
            place = (*desired[i], *desired_v[i], *desired_a[i])
            rest = (0.0, 0.0, 1.0, 0.0, float("nan"), 2, int(self.phase[i]), mode)
            say(dialect, "load_setpoint", us, *place, *rest)
            outer = (errors[i], nil, nil, nil, nil, nil)
            say(dialect, "cascade_errors", us, *outer, psi_r[i], psi_q[i], thrusts[i], nil, mode)
            say(dialect, "rotor_state", us, commands[i], 0.0, ROTOR_MAX_N, int(self.saturated[i]), 2)
            if i % 5 == 0:
                say(common, "attitude_quaternion", us // 1000, *quat, 0.0, 0.0, 0.0)
            if i % 125 == 0:
                say(common, "heartbeat", 2, 12, 128, 0, 4, 3)
                say(ground, "heartbeat", 6, 8, 0, 0, 4, 3)
                say(load, "attitude_quaternion", us // 1000, 1.0, 0.0, 0.0, 0.0, 9.0, 9.0, 9.0)
                say(common, "mission_current", 2)
            while texts and texts[0][0] <= t:
                _, severity, text = texts.pop(0)
                data = text.encode()
                for seq, first in enumerate(range(0, len(data), 50)):
                    chunk_id = len(texts) + 1 if len(data) > 50 else 0
                    say(common, "statustext", severity, data[first : first + 50], chunk_id, seq)
            for frame in frames:
                yield BOOT_US + us, frame

    def tlog(self) -> bytes:
        return b"".join(struct.pack(">Q", us) + frame for us, frame in self.records())

    def write(self, path: Path) -> Path:
        path.write_bytes(self.tlog())
        return path

    def telemetry(self) -> Telemetry:
        return telemetry_of((us, _message(frame)) for us, frame in self.records())


def _message(frame: bytes) -> Received:
    message, _ = message_at(frame, 0)
    assert message is not None
    return message


Path3 = Callable[[np.ndarray], np.ndarray]  # times (n,) since the mission began -> (n, 3) ENU from the anchor


def flight(duration_s: float, path: Path3, error: Path3 | None = None, altitude_m: float = 1.5) -> Flight:
    """A whole flight around a path, without motion other than that of the path and the error."""
    n = round((BEFORE_S + duration_s + sum(d for _, d in PHASES[5:])) / TICK_S) + 1
    time_s = np.arange(n) * TICK_S
    phase = np.zeros(n, dtype=int)
    begin = 0.0
    starts = {}
    for name, length in PHASES:
        phase[time_s >= begin - 1e-9] = name
        starts.setdefault(name, begin)
        begin += duration_s if length is None else length
    lift, lower = starts[mavlink.PLUMBLINE_PHASE_LIFT], starts[mavlink.PLUMBLINE_PHASE_LOWER]

    def smooth(s: np.ndarray) -> np.ndarray:
        s = np.clip(s, 0.0, 1.0)
        return 0.5 * (1.0 - np.cos(np.pi * s))

    def desired(t: np.ndarray) -> np.ndarray:
        p = path(np.clip(t - BEFORE_S, 0.0, duration_s)).copy()
        p[:, 2] += altitude_m * (smooth((t - lift) / 3.0) - smooth((t - lower) / 2.0))
        return p

    def actual(t: np.ndarray) -> np.ndarray:
        return desired(t) + (error(t - BEFORE_S) if error else 0.0)

    def rates(f: Path3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        h = 1e-4
        low, middle, high = f(time_s - h), f(time_s), f(time_s + h)
        return middle, (high - low) / (2.0 * h), (high - 2.0 * middle + low) / (h * h)

    d, dv, da = rates(desired)
    a, av, _ = rates(actual)
    held = np.isin(phase, (3, 4, 5, 6, 7))
    return Flight(
        time_s=time_s,
        phase=phase,
        desired=d,
        desired_v=dv,
        desired_a=da,
        actual=a,
        actual_v=av,
        estimated=a.copy(),
        q_cable=np.tile((0.0, 0.0, -1.0), (n, 1)),
        distance=np.full(n, CABLE_M),
        tension=np.where(held, LOAD_KG * GRAVITY, 0.0),
        slack_events=np.zeros(n, dtype=int),
        taut=held.astype(int),
        force=np.full((n, 4), 1.2),
        command=np.full((n, 4), 1.2),
        saturated=np.zeros(n, dtype=int),
        quat=np.tile((1.0, 0.0, 0.0, 0.0), (n, 1)),
        psi_r=np.zeros(n),
        psi_q=np.zeros(n),
        control_mode=np.where(phase == mavlink.PLUMBLINE_PHASE_DISARMED, 0, 3),
    )


def still(t: np.ndarray) -> np.ndarray:
    """A path that stays at its start."""
    return np.zeros((len(t), 3))


def half_sine_step(height_m: float, rise_s: float) -> Path3:
    """A step along y from rest to rest."""

    def path(t: np.ndarray) -> np.ndarray:
        p = np.zeros((len(t), 3))
        p[:, 1] = 0.5 * height_m * (1.0 - np.cos(np.pi * np.clip(t / rise_s, 0.0, 1.0)))
        return p

    return path


def case_b(seed: int = 1, duration_s: float = 50.0) -> Flight:
    """A sine of 1 m and 3 s along y that grows and shrinks, with cable, attitude and rotors to match."""
    edge = 0.45 * duration_s

    def path(t: np.ndarray) -> np.ndarray:
        rise = 0.5 * (1.0 - np.cos(np.pi * np.clip(t / edge, 0.0, 1.0)))
        fall = 0.5 * (1.0 - np.cos(np.pi * np.clip((duration_s - t) / edge, 0.0, 1.0)))
        p = np.zeros((len(t), 3))
        p[:, 1] = rise * fall * np.sin(2.0 * np.pi * t / 3.0)
        return p

    rng = np.random.default_rng(seed)
    waves = [(rng.uniform(0.3, 3.0), rng.uniform(0.0, 6.28), rng.normal(0.0, 1.5e-3, 3)) for _ in range(8)]

    def error(t: np.ndarray) -> np.ndarray:
        lag = path(np.clip(t - 0.006, 0.0, duration_s)) - path(np.clip(t, 0.0, duration_s))
        lag[:, 2] = -40.0 * lag[:, 1] ** 2
        return lag + sum(a * np.sin(w * t[:, None] + p) for w, p, a in waves)

    made = flight(duration_s, path, error)
    _fly_it(made, rng)
    made.texts += [
        (0.4, 6, "Armed"),
        (0.5, 6, "Take-off: load to 1.5 m"),
        (BEFORE_S, 6, "Mission item 2: load signals, 50.0 s, amplitude 1.00 m along y, period 3.00 s"),
        (BEFORE_S + 0.5 * duration_s, 4, "Rotor 2 at its limit <b>&amp;"),
        (BEFORE_S + duration_s, 6, "Mission complete"),
        (BEFORE_S + duration_s + 4.0, 6, "Disarmed"),
    ]
    return made


def delivery() -> Flight:
    """A load that is released in the middle of the mission; it lies there while the vehicle flies on."""
    made = flight(10.0, still)
    alone = np.flatnonzero(made.mission & (made.time_s > made.time_s[made.mission][0] + 4.0))[0]
    vehicle = made.actual - made.distance[:, None] * made.q_cable
    made.actual[alone:] = made.actual[alone] * (1.0, 1.0, 0.0)
    made.actual_v[alone:] = 0.0
    vehicle[alone:, 0] += np.linspace(0.0, 4.0, len(vehicle) - alone)
    between = made.actual - vehicle
    made.distance = np.linalg.norm(between, axis=1)
    made.q_cable = between / made.distance[:, None]
    made.tension[alone:] = 0.0
    made.taut[alone:] = 0
    made.control_mode[alone:] = mavlink.PLUMBLINE_CONTROL_QUAD_POSITION
    made.texts.append((float(made.time_s[alone]), 6, "Load released"))
    return made


def landing_after_a_failure(error_m: float, still_s: float = 4.0) -> Flight:
    """A rotor is lost in mid-mission, `still_s` after its beginning: the load is lowered at once, sags by
    `error_m` on the way, and lies there while its setpoint goes on into the ground."""
    made = flight(still_s, still)
    failed = int(np.flatnonzero(made.mission)[-1]) + 1
    made.phase[failed:][made.phase[failed:] != mavlink.PLUMBLINE_PHASE_DISARMED] = (
        mavlink.PLUMBLINE_PHASE_LOWER
    )
    made.actual[failed + 20 : failed + 30, 2] -= error_m
    made.desired[np.flatnonzero(made.phase == mavlink.PLUMBLINE_PHASE_LOWER)[-20:], 2] -= 0.09
    made.texts.append((float(made.time_s[failed]), 3, "Failsafe: rotor 3 lost, landing"))
    return made


def _fly_it(made: Flight, rng: np.random.Generator) -> None:
    """Cable, attitude, tension and rotor forces from the acceleration of the path, by differences."""
    n = len(made.time_s)
    g = np.array((0.0, 0.0, GRAVITY))
    pull = LOAD_KG * (made.desired_a + g)
    held = made.taut == 1
    made.tension[held] = np.linalg.norm(pull, axis=1)[held]
    made.q_cable = -pull / np.linalg.norm(pull, axis=1)[:, None]
    accel = np.gradient(np.gradient(made.desired - CABLE_M * made.q_cable, TICK_S, axis=0), TICK_S, axis=0)
    thrust = QUAD_KG * (accel + g) + made.tension[:, None] * -made.q_cable
    roll = -np.arctan2(thrust[:, 1], thrust[:, 2]) + rng.normal(0.0, 2e-3, n)
    pitch = np.arctan2(thrust[:, 0], thrust[:, 2]) + rng.normal(0.0, 2e-3, n)
    made.quat = np.stack((np.cos(roll / 2), np.sin(roll / 2), np.sin(pitch / 2), np.zeros(n)), axis=1)
    made.quat /= np.linalg.norm(made.quat, axis=1)[:, None]
    smooth_roll = -np.arctan2(thrust[:, 1], thrust[:, 2])
    moment = INERTIA[0] * np.gradient(np.gradient(smooth_roll, TICK_S), TICK_S)
    total = np.linalg.norm(thrust, axis=1)
    command = np.stack([total / 4] * 4, axis=1) + rng.normal(0.0, 0.09, (n, 4))
    command[:, 1] -= np.clip(moment, -0.1, 0.1) / (2 * ARM_M)
    command[:, 3] += np.clip(moment, -0.1, 0.1) / (2 * ARM_M)
    flying = np.isin(made.phase, (2, 3, 4, 5, 6, 7, 8))
    command[~flying] = 0.0
    asked = command.copy()
    made.command = np.clip(command, 0.0, ROTOR_MAX_N)
    made.saturated = ((asked != made.command) * (1, 2, 4, 8)).sum(axis=1)
    lagged = made.command.copy()
    for i in range(1, n):
        lagged[i] = lagged[i - 1] + (made.command[i] - lagged[i - 1]) * (1.0 - np.exp(-TICK_S / 0.02))
    made.force = lagged
    made.psi_q = 2e-4 * made.desired_a[:, 1] ** 2 + np.abs(rng.normal(0.0, 2e-4, n))
    made.psi_r = 8e-4 * made.desired_a[:, 1] ** 2 + np.abs(rng.normal(0.0, 4e-4, n))
    made.estimated = made.actual + rng.normal(0.0, 4e-4, (n, 3))


def without_a_lift(phase: int, still_s: float = 2.0) -> Flight:
    """A flight that is in this phase all the time, in which no law tracks the load."""
    made = flight(still_s, still)
    made.phase[:] = phase
    made.psi_r[:], made.psi_q[:] = 0.01, np.nan
    made.control_mode[:] = mavlink.PLUMBLINE_CONTROL_QUAD_POSITION
    return made
