"""The demand of a trajectory on vehicle and cable, sampled finely along it through the flat map."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import inf, nextafter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm
from autopilot.trajectory.flatness import flat_outputs
from autopilot.trajectory.load_path import PathTables, evaluate_load_path, path_joints, path_tables
from autopilot.trajectory.reeling import straight_way
from autopilot.trajectory.signals import Jet
from autopilot.trajectory.swing import swing_direction
from autopilot.trajectory.transfer import Pace
from missions.model import AttitudeRun, LoadPath, Signals

Samples = NDArray[np.float64]

_SAMPLES_PER_PERIOD = 200
_MAX_SAMPLES, _MIN_SAMPLES_PER_PERIOD = 1_000_000, 20
_MAX_SPACING_S = 0.01
_TRANSFER_SAMPLES = 201
# columns of a sample row
SPEED, ACCEL, FALL, TENSION, THRUST, ROTOR_LOW, ROTOR_HIGH, TILT, HEIGHT = range(9)
_COLUMNS = 9


# How much each rotor's force grows with thrust, with roll and pitch moment divided by the arm, and with yaw
# moment divided by the torque ratio; for a rotor that differs from the others: its effort, which is the force
# divided by its strength
Efforts = tuple[tuple[float, float, float, float], ...]
PLUS_EFFORTS: Efforts = (
    (0.25, 0.0, 0.5, -0.25),
    (0.25, -0.5, 0.0, 0.25),
    (0.25, 0.0, -0.5, -0.25),
    (0.25, 0.5, 0.0, 0.25),
)


class Body(NamedTuple):
    """The properties of the vehicle that the survey needs: kg, m, kg m^2, m/s^2; `torque_ratio` in m, (2-13).

    Drag of the vehicle in N s/m and N s^2/m^2.
    """

    quad_mass: float
    load_mass: float
    cable_length: float
    inertia: Vec3
    gravity: float
    arm: float
    torque_ratio: float
    drag_linear: float = 0.0
    drag_quadratic: float = 0.0
    efforts: Efforts = PLUS_EFFORTS

    @property
    def hover_force(self) -> float:
        """The force of the rotor that gives least in hover, N."""
        weight = (self.quad_mass + self.load_mass) * self.gravity
        return weight * min(share for share, *_ in self.efforts)


class KernelBody(NamedTuple):
    """A `Body` without its rotors, for kernels: their machine code is the same for any number of rotors."""

    quad_mass: float
    load_mass: float
    cable_length: float
    inertia: Vec3
    gravity: float
    arm: float
    torque_ratio: float
    drag_linear: float
    drag_quadratic: float


def to_kernel_body(body: Body) -> tuple[KernelBody, Samples]:
    """The body in the form for kernels, and the efforts of its rotors (rotors, 4)."""
    return KernelBody(*body[:-1]), np.array(body.efforts)


class Extreme(NamedTuple):
    """A value and the time (s from the beginning of the step) at which it occurs."""

    value: float
    time_s: float


@dataclass(frozen=True, slots=True)
class Peaks:
    """The extremes along a trajectory: m/s, m/s^2, N, rad, m above home. `fall` is downward acceleration."""

    speed: Extreme
    accel: Extreme
    fall: Extreme
    tension_low: Extreme
    thrust: Extreme
    rotor_low: Extreme
    rotor_high: Extreme
    tilt: Extreme
    height_low: Extreme


@kernel
def rotor_effort(efforts: Samples, i: int, thrust: float, moment: Vec3, body: KernelBody) -> float:
    """The demand on rotor i: (2-13) solved for it."""
    roll, pitch, yaw = moment[0] / body.arm, moment[1] / body.arm, moment[2] / body.torque_ratio
    effort: float = (
        thrust * efforts[i, 0] + roll * efforts[i, 1] + pitch * efforts[i, 2] + yaw * efforts[i, 3]
    )
    return effort


@kernel
def _rotor_range(thrust: float, moment: Vec3, efforts: Samples, body: KernelBody) -> tuple[float, float]:
    """The least and the greatest demand on a rotor."""
    lowest = highest = rotor_effort(efforts, 0, thrust, moment, body)
    for i in range(1, efforts.shape[0]):
        demanded = rotor_effort(efforts, i, thrust, moment, body)
        lowest, highest = min(lowest, demanded), max(highest, demanded)
    return lowest, highest


@kernel
def _fill_sample(row: Samples, jet: Jet, body: KernelBody, efforts: Samples) -> None:
    """One sample: the columns named above, for a heading of 0; TILT as the cosine of the angle."""
    flat = flat_outputs(
        jet,
        0.0,
        body.quad_mass,
        body.load_mass,
        body.cable_length,
        body.inertia,
        body.gravity,
        body.drag_linear,
        body.drag_quadratic,
    )
    low, high = _rotor_range(flat.thrust, flat.moment, efforts, body)
    row[0] = norm(jet[1])
    row[1] = norm(jet[2])
    row[2] = -jet[2][2]
    row[3] = flat.tension
    row[4] = flat.thrust
    row[5] = low
    row[6] = high
    row[7] = flat.R[2][2]
    row[8] = jet[0][2]


@kernel
def _fill_load_path(
    tables: PathTables, times: Samples, body: KernelBody, efforts: Samples, rows: Samples
) -> None:
    for i in range(times.shape[0]):
        _fill_sample(rows[i], evaluate_load_path(tables, times[i]), body, efforts)


@kernel
def _fill_straight_way(
    p0: Vec3,
    p1: Vec3,
    duration: float,
    ramp: float,
    times: Samples,
    body: KernelBody,
    efforts: Samples,
    rows: Samples,
) -> None:
    for i in range(times.shape[0]):
        _fill_sample(rows[i], straight_way(p0, p1, duration, ramp, times[i]), body, efforts)


@kernel
def _fill_jets(jets: Samples, body: KernelBody, efforts: Samples, rows: Samples) -> None:
    for i in range(jets.shape[1]):
        _fill_sample(
            rows[i],
            (
                (jets[0, i, 0], jets[0, i, 1], jets[0, i, 2]),
                (jets[1, i, 0], jets[1, i, 1], jets[1, i, 2]),
                (jets[2, i, 0], jets[2, i, 1], jets[2, i, 2]),
                (jets[3, i, 0], jets[3, i, 1], jets[3, i, 2]),
                (jets[4, i, 0], jets[4, i, 1], jets[4, i, 2]),
                (jets[5, i, 0], jets[5, i, 1], jets[5, i, 2]),
                (jets[6, i, 0], jets[6, i, 1], jets[6, i, 2]),
            ),
            body,
            efforts,
        )


def _peaks(times: Samples, rows: Samples) -> Peaks:
    def extreme(column: int, is_max: bool) -> Extreme:
        values = rows[:, column]
        index = int(np.argmax(values) if is_max else np.argmin(values))
        return Extreme(float(values[index]), float(times[index]))

    cos_tilt = extreme(TILT, False)
    return Peaks(
        speed=extreme(SPEED, True),
        accel=extreme(ACCEL, True),
        fall=extreme(FALL, True),
        tension_low=extreme(TENSION, False),
        thrust=extreme(THRUST, True),
        rotor_low=extreme(ROTOR_LOW, False),
        rotor_high=extreme(ROTOR_HIGH, True),
        tilt=Extreme(float(np.arccos(np.clip(cos_tilt.value, -1.0, 1.0))), cos_tilt.time_s),
        height_low=extreme(HEIGHT, False),
    )


def sample_times(step: LoadPath) -> Samples:
    """Sample times: 200 to the shortest period or edge, at most 10 ms apart, and both sides of each joint. Of
    signals that last for hours fewer, but 20 to the shortest period."""
    shortest_s = min(_periods(step), default=step.duration_s)
    spacing = min(_MAX_SPACING_S, shortest_s / _SAMPLES_PER_PERIOD)
    spacing = max(spacing, min(step.duration_s / _MAX_SAMPLES, shortest_s / _MIN_SAMPLES_PER_PERIOD))
    regular = np.linspace(0.0, step.duration_s, int(step.duration_s / spacing) + 2)[:-1]
    edges = [t for t in path_joints(step) if 0.0 < t < step.duration_s]
    sides = [nextafter(t, -inf) for t in (*edges, step.duration_s)] + edges
    return np.union1d(regular, np.array(sides))


def _periods(step: LoadPath) -> list[float]:
    """Times (s) in which the path may swing: periods and edges of signals, two intervals of a trajectory."""
    if not isinstance(step, Signals):
        return [2.0 * (after.t_s - before.t_s) for before, after in pairwise(step.points)]
    periods = [sine.period_s for term in step.terms for sine in term.factors]
    return periods + [edge for term in step.terms for edge in (term.rise_s, term.fall_s) if edge > 0.0]


def survey_load_path(step: LoadPath, anchor: Vec3, body: Body) -> Peaks:
    """Extremes along a path that begins at `anchor`; the jumps at joints are not included."""
    times = sample_times(step)
    rows = np.empty((times.size, _COLUMNS))
    _fill_load_path(path_tables(step), times, *to_kernel_body(body), rows)
    rows[:, HEIGHT] += anchor[2]
    return _peaks(times, rows)


def survey_transfer(p0: Vec3, p1: Vec3, pace: Pace, body: Body) -> Peaks:
    """Extremes along a rest-to-rest transfer."""
    duration, ramp = pace
    times = np.linspace(0.0, duration, _TRANSFER_SAMPLES)
    if ramp > 0.0:  # nothing changes between the ramps
        rising = np.linspace(0.0, ramp, _TRANSFER_SAMPLES)
        times = np.concatenate([rising, duration - rising[::-1]])
    rows = np.empty((times.size, _COLUMNS))
    _fill_straight_way(p0, p1, duration, ramp, times, *to_kernel_body(body), rows)
    return _peaks(times, rows)


def survey_path(times: Samples, jets: Samples, height: float, body: Body) -> Peaks:
    """Extremes along a path given by samples (7, n, 3), raised by `height` m."""
    rows = np.empty((times.size, _COLUMNS))
    _fill_jets(jets, *to_kernel_body(body), rows)
    rows[:, HEIGHT] += height
    return _peaks(times, rows)


def survey_attitude(run: AttitudeRun, height: float, body: Body) -> Peaks:
    """Extremes of an attitude run at constant height, estimated on the safe side.

    A run of the vehicle: thrust along u carries the whole weight. A run of the load: the cable along -u
    carries the load and the vehicle moves with its upper end, F = (m_Q + m_L) g u / u_z + m_Q L u''. In both
    cases the vehicle turns with F, and the rotor with the greatest effort for its angular acceleration is
    assumed to take part in all of it.
    """
    # the ends are left out: u'' jumps there, as at the joints of signals
    times = np.linspace(0.0, run.duration_s, _TRANSFER_SAMPLES)[1:-1]
    directions = [
        swing_direction(run.tilt_north_rad, run.tilt_east_rad, run.duration_s, float(t)) for t in times
    ]
    u = np.array([direction for direction, _, _ in directions])
    u_ddot = np.array([second for _, _, second in directions])
    force = (body.quad_mass + body.load_mass) * body.gravity * u / u[:, 2:]
    if run.controlled == "load":
        force = force + body.quad_mass * body.cable_length * u_ddot
    thrust = np.linalg.norm(force, axis=1)
    spacing = times[1] - times[0]
    tilt_axis = np.array([run.tilt_east_rad, run.tilt_north_rad])
    tilt_axis = tilt_axis / max(float(np.linalg.norm(tilt_axis)), 1e-12)
    angle = np.arctan2(force[:, :2] @ tilt_axis, force[:, 2])
    angular_accel = np.abs(np.gradient(np.gradient(angle, spacing), spacing))
    efforts = np.array(body.efforts)
    max_effort = np.abs(efforts[:, 1:3]).max()
    differential = max_effort * max(body.inertia[0], body.inertia[1]) * angular_accel / body.arm
    load_accel = body.gravity * np.linalg.norm(u[:, :2], axis=1) / u[:, 2]
    rows = np.zeros((times.size, _COLUMNS))
    rows[:, SPEED] = np.cumsum(load_accel) * spacing
    rows[:, ACCEL] = load_accel
    rows[:, TENSION] = body.load_mass * body.gravity / u[:, 2]
    rows[:, THRUST] = thrust
    rows[:, ROTOR_LOW] = efforts[:, 0].min() * thrust - differential
    rows[:, ROTOR_HIGH] = efforts[:, 0].max() * thrust + differential
    rows[:, TILT] = np.minimum(u[:, 2], force[:, 2] / thrust)
    rows[:, HEIGHT] = height
    return _peaks(times, rows)
