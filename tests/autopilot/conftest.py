"""A vehicle and pendulum of the tests' own; a supervisor and an autopilot with worlds to fly in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from autopilot.control.laws.interface import build_law
from autopilot.estimation.filter import Readings, estimate, estimator_tuning
from autopilot.estimation.records import (
    TRACKED_SIZE,
    EstimatorState,
    EstimatorTuning,
    ImuReading,
    LoadReading,
    PoseReading,
    blank_state,
    new_history,
)
from autopilot.geometry.linear import ZERO, Vec3, add, norm, sub
from autopilot.geometry.so3 import Quat
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, Hold
from autopilot.onboard.onboard import Onboard
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import Verdict
from autopilot.services.requests import Arm, Takeoff
from autopilot.supervisor.advance import advance
from autopilot.supervisor.flight import Flight, MissionPlan, Phase, Settings, View, settings_from
from autopilot.supervisor.requests import ACCEPTED as ACCEPTANCE
from autopilot.supervisor.requests import decide, with_plan
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.mission_items import encode_steps, located_steps
from gcs.closed_loop import Conditions, build_onboard, build_simulator
from missions.model import Step
from sitl.hil import HilSimulator
from sitl.plant.records import PlantState
from sitl.vehicles.truth import load_truth

Array = NDArray[Any]
TICK_S = 0.004
GRAVITY, CABLE_LENGTH = 9.81, 0.7
ACCEPTED = ACCEPTANCE.result


def bebop_tuning() -> EstimatorTuning:
    """The estimator as delivered, for the vehicle of Table 4-1."""
    return estimator_tuning(autopilot_parameters(load_vehicle("bebop")))


class Motion:
    """A vehicle on a given path and a pendulum hung from it, as functions of time; no code is shared with
    plant or estimator.

    The pivot moves along sums of sines, the attitude by sines of its Euler angles; the pendulum is the
    integral of  L q'' = -(I - q q^T)(x_Q'' + g e3) - L |q'|^2 q  by SciPy to eleven digits. With `accel`
    the vehicle goes along x at that constant acceleration instead, level, the pendulum at rest in its frame.
    """

    def __init__(self, end_s: float, accel: float | None = None) -> None:
        self.accel = accel
        # amplitude (m), rate (rad/s), phase for each axis
        self._sines = (
            ((0.6, 1.3, 0.2), (0.05, 5.1, 1.0)),
            ((0.5, 0.9, 1.1), (0.04, 6.3, 0.0)),
            ((0.3, 1.7, 0.0), (0.02, 4.4, 2.0)),
        )
        if accel is None:
            start = np.array([0.1, -0.05, 0.0, 0.1, 0.2, 0.0])
            q = np.array([start[0], start[1], -np.sqrt(1.0 - start[0] ** 2 - start[1] ** 2)])
            q_dot = np.array([start[3], start[4], 0.0])
            q_dot -= q * (q @ q_dot)
            self._swing = solve_ivp(
                self._pendulum,
                (-0.5, end_s + 0.1),
                np.concatenate([q, q_dot]),
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
                dense_output=True,
            ).sol

    def x_quad(self, t: Array | float, order: int = 0) -> Array:
        """Position (order 0) of the vehicle or its derivative, ENU; (..., 3)."""
        t = np.asarray(t, dtype=float)
        if self.accel is not None:
            zero = np.zeros_like(t)
            along = (0.5 * self.accel * t**2, self.accel * t, self.accel + zero)[order]
            return np.stack([along, zero, zero + (2.0 if order == 0 else 0.0)], axis=-1)
        return np.stack(
            [
                sum(a * w**order * np.sin(w * t + p + order * np.pi / 2) for a, w, p in axis)
                + (2.0 if (i, order) == (2, 0) else 0.0)
                for i, axis in enumerate(self._sines)
            ],
            axis=-1,
        )

    def attitude(self, t: Array | float) -> Rotation:
        """Body to world."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        still = 0.0 if self.accel is not None else 1.0
        angles = [0.4 * np.sin(0.7 * t), 0.2 * np.sin(1.9 * t + 0.3), 0.25 * np.sin(2.3 * t)]
        return Rotation.from_euler("ZYX", still * np.stack(angles, axis=-1))

    def omega_body(self, t: Array) -> Array:
        """Body rate, by a central difference of the attitude."""
        h = 1e-5
        turn = self.attitude(t - h).inv() * self.attitude(t + h)
        return np.asarray(turn.as_rotvec() / (2.0 * h))

    def specific_force(self, t: Array) -> Array:
        """What an accelerometer in the centre of mass feels, body."""
        return np.asarray(self.attitude(t).inv().apply(self.x_quad(t, 2) + np.array([0.0, 0.0, GRAVITY])))

    def _pendulum(self, t: float, y: Array) -> Array:
        q, q_dot = y[:3], y[3:]
        push = self.x_quad(t, 2) + np.array([0.0, 0.0, GRAVITY])
        return np.concatenate([q_dot, -(push - q * (q @ push)) / CABLE_LENGTH - q * (q_dot @ q_dot)])

    def cable(self, t: Array | float) -> tuple[Array, Array]:
        """q and q', vehicle to load; (..., 3) each."""
        t = np.asarray(t, dtype=float)
        if self.accel is not None:
            q = np.array([-self.accel, 0.0, -GRAVITY]) / np.hypot(self.accel, GRAVITY)
            return np.broadcast_to(q, (*t.shape, 3)), np.zeros((*t.shape, 3))
        y = self._swing(t)
        return np.moveaxis(y[:3], 0, -1), np.moveaxis(y[3:], 0, -1)

    def x_load(self, t: Array | float) -> Array:
        return np.asarray(self.x_quad(t) + CABLE_LENGTH * self.cable(t)[0])

    def v_load(self, t: Array | float) -> Array:
        return np.asarray(self.x_quad(t, 1) + CABLE_LENGTH * self.cable(t)[1])


def three(a: Array) -> Vec3:
    return (float(a[0]), float(a[1]), float(a[2]))


def four(a: Array) -> Quat:
    return (float(a[0]), float(a[1]), float(a[2]), float(a[3]))


@dataclass(frozen=True)
class Noise:
    """Standard deviations of white noise, constant biases, latency of both trackers; the profile `lab`."""

    gyro: float = 0.005
    accel: float = 0.05
    position: float = 0.001
    angle: float = 0.0007
    gyro_bias: Sequence[float] = (0.002, -0.002, 0.002)
    accel_bias: Sequence[float] = (0.03, -0.03, 0.03)
    latency_s: float = 0.004
    rate_hz: float = 200.0


@dataclass
class Trace:
    """Estimates tick by tick, beside the truth."""

    t: Array
    states: list[EstimatorState] = field(default_factory=list)
    covariances: list[Array] = field(default_factory=list)  # of the error state

    def of(self, what: Callable[[EstimatorState], Any]) -> Array:
        return np.array([what(state) for state in self.states])


def track(
    motion: Motion,
    end_s: float,
    noise: Noise,
    seed: int,
    tuning: EstimatorTuning | None = None,
    tampered: Callable[[float, np.ndarray, str], Array | None] = lambda t, x, who: x,
) -> Trace:
    """The estimator fed with readings of `motion`; `tampered` may change a reading of "vehicle" or "load"."""
    rng = np.random.default_rng(seed)
    tuning = tuning or bebop_tuning()
    ticks = round(end_s / TICK_S)
    t = TICK_S * np.arange(ticks)
    gyro = motion.omega_body(t) + noise.gyro_bias + rng.normal(0.0, 1.0, (ticks, 3)) * noise.gyro
    accel = motion.specific_force(t) + noise.accel_bias + rng.normal(0.0, 1.0, (ticks, 3)) * noise.accel
    at = np.arange(0.0, end_s, 1.0 / noise.rate_hz)
    x_quad = motion.x_quad(at) + rng.normal(0.0, 1.0, (at.size, 3)) * noise.position
    x_load = motion.x_load(at) + rng.normal(0.0, 1.0, (at.size, 3)) * noise.position
    turned = motion.attitude(at) * Rotation.from_rotvec(rng.normal(0.0, 1.0, (at.size, 3)) * noise.angle)
    quat = turned.as_quat(scalar_first=True)

    state, history = blank_state(), new_history()
    trace = Trace(t)
    position_std, angle_std = max(noise.position, 2e-5), max(noise.angle, 2e-5)
    due = 0
    for k in range(ticks):
        poses, loads = [], []
        while due < at.size and at[due] + noise.latency_s <= t[k] + 1e-9:
            age = float(t[k] - at[due])
            seen = tampered(float(at[due]), x_quad[due], "vehicle")
            if seen is not None:
                q = four(quat[due])
                place = three(seen)
                poses.append(PoseReading(age, place, q, (0.0, 0.0, 0.0), position_std, angle_std, -1.0))
            seen = tampered(float(at[due]), x_load[due], "load")
            if seen is not None:
                place = three(seen)
                loads.append(LoadReading(age, place, (0.0, 0.0, 0.0), position_std, -1.0))
            due += 1
        imu = ImuReading(three(gyro[k]), three(accel[k]))
        state = estimate(
            state, history, Readings(imu, tuple(poses), tuple(loads)), tuning, TICK_S if k else 0.0
        )
        trace.states.append(state)
        trace.covariances.append(history.covariance[:TRACKED_SIZE, :TRACKED_SIZE].copy())
    return trace


@pytest.fixture(scope="session")
def motion() -> Motion:
    return Motion(20.0)


# ---- the supervisor in a world that does as it is told

TABLE = autopilot_parameters(load_vehicle("bebop"))
SETTINGS = settings_from(TABLE, build_law(TABLE).ramp_lag_s)
STEP_US = 20_000
LOAD_RADIUS, GEAR = 0.02, 0.06


def view(now_us: int = 0, **changes: Any) -> View:
    """A vehicle that stands beside its load, all well."""
    seen = View(now_us, (0.1, 0.0, GEAR), ZERO, (0.0, 0.0, LOAD_RADIUS), ZERO, False, 0.0, ())
    return seen._replace(**changes)


def hanging(now_us: int = 0, x: Vec3 = (0.0, 0.0, 2.0), v: Vec3 = ZERO, **changes: Any) -> View:
    """A load that hangs still under its vehicle, or moves along with it."""
    over = (x[0], x[1], x[2] + SETTINGS.cable_length_m)
    return View(now_us, over, v, x, v, True, 0.0, ())._replace(**changes)


class Sky:
    """Load and vehicle are where the present leg wants them; the ground and the cable are as they are."""

    def __init__(self, *steps: Step, settings: Settings = SETTINGS) -> None:
        items = encode_steps(steps, Home()) if steps else ()
        located = located_steps(items, Home())
        plan = MissionPlan(tuple(s.step for s in located), tuple(s.last for s in located), len(items))
        self.flight = with_plan(Flight(), plan)
        self.settings = settings
        self.now_us = 0
        self.view = view()
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.phases: list[Phase] = []
        self.setpoints: list[tuple[float, int, Any]] = []  # time, control mode, jet

    def ask(self, request: Any) -> Verdict:
        self.flight, verdict = decide(self.flight, request, self.view, self.settings)
        return verdict

    def tick(self) -> None:
        self.now_us += STEP_US
        self.view = self._obey()
        self.flight, report = advance(self.flight, self.view, self.settings)
        self.texts += [text for _, text in report.texts]
        self.reached += report.reached
        if not self.phases or self.phases[-1] != self.flight.phase:
            self.phases.append(self.flight.phase)
        if self.flight.legs:
            leg = self.flight.legs[0]
            jet = leg.jet((self.now_us - self.flight.leg_start_us) * 1e-6)
            self.setpoints.append((self.now_us * 1e-6, leg.control_mode, jet))

    def run(self, until: Callable[[Sky], bool], limit_s: float = 300.0) -> None:
        end = self.now_us + round(limit_s * 1e6)
        while not until(self):
            assert self.now_us < end, (self.flight.phase, self.flight.step, self.texts)
            self.tick()

    def wait(self, seconds: float) -> None:
        end = self.now_us + round(seconds * 1e6)
        self.run(lambda sky: sky.now_us >= end)

    def airborne(self) -> Sky:
        """Taken off by command to 2 m, holding."""
        assert self.ask(Arm(True, False)).result == ACCEPTED
        assert self.ask(Takeoff(2.0)).result == ACCEPTED
        self.run(lambda sky: sky.flight.phase == Phase.HOLD)
        self.wait(2.0)
        return self

    def _obey(self) -> View:
        last, flight = self.view, self.flight
        if not flight.legs:
            return last._replace(now_us=self.now_us, v_quad=ZERO, v_load=ZERO)
        leg = flight.legs[0]
        jet = leg.jet((self.now_us - flight.leg_start_us) * 1e-6)
        if leg.control_mode == LOAD_POSITION:
            x, v = jet[0], jet[1]
            if x[2] < LOAD_RADIUS:
                x, v = (x[0], x[1], LOAD_RADIUS), ZERO
            # the cable leans as the load's acceleration wants it to
            a, L = jet[2], self.settings.cable_length_m
            pull = (a[0], a[1], a[2] + self.settings.gravity_m_s2)
            n = norm(pull)
            over = (x[0] + L * pull[0] / n, x[1] + L * pull[1] / n, x[2] + L * pull[2] / n)
            return View(self.now_us, over, v, x, v, True, 0.0, ())
        if leg.control_mode == QUAD_POSITION:
            x, v = jet[0], jet[1]
            if x[2] < GEAR:
                x, v = (x[0], x[1], GEAR), ZERO
            taut = norm(sub(x, last.x_load)) >= self.settings.cable_length_m
            return View(self.now_us, x, v, last.x_load, ZERO, taut, 0.0, ())
        # an attitude is asked for: the pair drifts north at the speed it has
        drift = (0.0, 0.3 * STEP_US * 1e-6, 0.0)
        return last._replace(
            now_us=self.now_us,
            x_quad=add(last.x_quad, drift),
            x_load=add(last.x_load, drift),
            v_load=(0.0, 0.3, 0.0),
            v_quad=(0.0, 0.3, 0.0),
        )


# ---- an autopilot in a simulated world

GCS = "gcs"
TRUTH = load_truth("bebop")
LOAD_WEIGHT_N = TRUTH.load_mass * TRUTH.gravity


class Craft:
    """Onboard and simulator joined tick by tick, without a ground station but for the commands given here.

    `truth` reads the simulator's state; nothing of it reaches the autopilot but by sensors.
    """

    def __init__(self, *steps: Step, sensors: str = "lab", seed: int = 1, **settings_: float) -> None:
        conditions = Conditions(sensors=sensors, seed=seed, settings=settings_)
        items = encode_steps(steps, Home()) if steps else ()
        mission = StoredMission(items, located_steps(items, Home()))
        self.onboard: Onboard = build_onboard(conditions, Home(), mission)
        self.simulator: HilSimulator = build_simulator(conditions, Home())
        self.onboard.add_link(GCS)
        self._writer = FrameWriter(255, 190)
        self.heard: list[Any] = []
        self.answers: list[bytes] = []
        self.worst_error = 0.0  # of the load, from where it is to be held, m

    @property
    def truth(self) -> PlantState:
        return self.simulator._core.state

    @property
    def flight(self) -> Flight:
        return self.onboard._state.flight

    @property
    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    def results(self, command: int) -> list[int]:
        """Results of the COMMAND_ACKs to a command."""
        return [m.result for m in self.heard if m.get_type() == "COMMAND_ACK" and m.command == command]

    def send(self, message: Any) -> None:
        self.onboard.receive_ground(self._writer.frame(message), GCS)

    def command(self, command: int, *p: float) -> int:
        """Send a COMMAND_LONG; its result."""
        params = (*p, *([0.0] * (7 - len(p))))
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *params))
        self.tick()
        return self.results(command)[-1]

    def tick(self) -> None:
        answer = self.onboard.receive_sensors(self.simulator.sensor_datagram())
        for _, datagram in self.onboard.ground_datagrams():
            self.heard += [r.message for r in decode(datagram)[0] if r.message.get_msgId() in _HEARD]
        assert answer is not None
        self.answers.append(answer)
        if self.flight.legs and isinstance(self.flight.legs[0], Hold):
            error = norm(sub(self.truth.x_load, self.flight.legs[0].position))
            self.worst_error = max(self.worst_error, error)
        self.simulator.receive(answer)
        self.simulator.advance()

    def run(self, until: Callable[[Craft], bool], limit_s: float = 60.0) -> None:
        end = self.onboard.now_us + round(limit_s * 1e6)
        while not until(self):
            assert self.onboard.now_us < end, (self.flight.phase, self.texts)
            self.tick()

    def wait(self, seconds: float) -> None:
        end = self.onboard.now_us + round(seconds * 1e6)
        self.run(lambda craft: craft.onboard.now_us >= end, seconds + 1.0)

    def begin(self) -> None:
        """Settle, choose the mission, arm."""
        self.wait(1.0)
        assert self.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED


_HEARD = {
    mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
}


def least_tension(craft: Craft, until: Callable[[Craft], bool]) -> float:
    """Fly on; the least tension on the way, as a share of the load's weight."""
    least = 9.9
    while not until(craft):
        craft.tick()
        assert craft.flight.phase != Phase.FAILSAFE, craft.texts
        least = min(least, craft.truth.tension / LOAD_WEIGHT_N)
    return least


def at_phase(phase: Phase) -> Callable[[Craft], bool]:
    return lambda craft: craft.flight.phase == phase
