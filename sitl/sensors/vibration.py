"""Vibration of the airframe at the inertial unit, caused by rotors out of balance.

| symbol | code | frame, unit | |
|---|---|---|---|
| F_i | rows[FORCE, i] | N | thrust of rotor i; F_h at hover |
| f_i | | Hz | its speed, as in ESC_STATUS: f ~ sqrt(F) |
| phi_i | phases | | its angle: phi_i' = 2 pi f_i |
| s_i | | +-1 | its sense of rotation, positive: counter-clockwise seen from above |
| A, B | accel, gyro | m/s^2, rad/s | RMS of all n rotors together at hover, each axis, before the low-pass |
| g(f) | | | low-pass of the inertial unit, 1 / sqrt(1 + (f / f_c)^4) (Butterworth of second order) |

A mass that is off the axis pulls outwards with m e (2 pi f)^2, so the amplitude grows with the square of the
speed, that is, with the thrust:

    a = sqrt(2/n) A sum_i F_i/F_h (g(f_i) cos phi_i, g(f_i) s_i sin phi_i, g(2 f_i) cos 2 phi_i)

The force lies in the plane of the rotor. Along its axis the two blades pass the arm twice per turn. The
torque of the force about the centre of mass, integrated over time, turns the body with an amplitude that
grows with the speed:

    w = sqrt(2/n) B sum_i sqrt(F_i/F_h) g(f_i) (s_i cos phi_i, sin phi_i, z_i)
    z_i = -(x_i s_i cos phi_i + y_i sin phi_i) / r_i

In addition to these lines there is a broadband part (bearings, turbulence): white, a given share of A and B,
which grows with the mean thrust. The unit is sampled once per tick, so lines above half of the tick rate
alias. The phase shift of the low-pass is neglected, because the initial angles are random. The low-pass acts
on the vibration only; its delay is part of the sensor's latency.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import int_per_lane
from autopilot.geometry.linear import Vec3, scale
from autopilot.wire.convert.simulator import rotor_speed_rpm
from sitl.plant.records import Truth
from sitl.plant.rotors import FORCE, PITCH, ROLL, STRENGTH, YAW, Array, RotorRows
from sitl.sensors.elementary import cosine_sine
from sitl.sensors.noise import Noise, gaussian, words

_MASK = 0xFFFFFFFF
_WORDS = 4294967296.0  # in a turn
_BLOCKS = 6, 7  # of the sample's noise
_PHASES = 20  # of the first sample's noise, one block per rotor


class VibrationConfig(NamedTuple):
    """RMS at hover on each axis, the white part as a share of it, the cut-off (0: no low-pass)."""

    accel: float  # m/s^2
    gyro: float  # rad/s
    broadband: float
    cutoff_hz: float
    period_s: float  # from sample to sample


@kernel
def hover_force(truth: Truth, count: int) -> float:
    """Force of each of `count` rotors that carry vehicle and load, N."""
    return (truth.quad_mass + truth.load_mass) * truth.gravity / count


def draw_phases(phases: Array, count: int, noise: Noise) -> None:
    """Draw the initial angle of each rotor."""
    for i in range(count):
        phases[i] = words(noise, _PHASES + i)[0]


@kernel
def _gain(hz: float, cutoff_hz: float) -> float:
    if cutoff_hz == 0.0:
        return 1.0
    square = (hz / cutoff_hz) * (hz / cutoff_hz)
    return 1.0 / sqrt(1.0 + square * square)


@kernel
def rotor_vibration(
    rotors: RotorRows, truth: Truth, phases: Array, config: VibrationConfig, noise: Noise
) -> tuple[Vec3, Vec3]:
    """What the rotors add to specific force (m/s^2) and body rate (rad/s), body FLU.

    `phases` has the angle of each rotor in 2^-32 turns, and is advanced by one period.
    """
    table = rotors.table
    count = table.shape[0]
    hover = hover_force(truth, count)
    mean = ax = ay = az = wx = wy = wz = 0.0
    for i in range(count):
        force = rotors.rows[FORCE, i]
        hz = rotor_speed_rpm(force, table[i, STRENGTH] * truth.rotor_max) / 60.0
        word = int_per_lane(phases[i] + hz * config.period_s * _WORDS) & _MASK
        phases[i] = word * 1.0
        cosine, sine = cosine_sine(word)
        if table[i, YAW] > 0.0:  # this rotor turns clockwise: its drag turns the body the other way
            sine = -sine
        share = abs(force) / hover
        single, double = _gain(abs(hz), config.cutoff_hz), _gain(2.0 * abs(hz), config.cutoff_hz)
        mean += share / count
        ax += share * single * cosine
        ay += share * single * sine
        az += share * double * (cosine * cosine - sine * sine)
        rate = sqrt(share) * single
        x, y = -table[i, PITCH], table[i, ROLL]
        radius = sqrt(x * x + y * y)
        spin = -1.0 if table[i, YAW] > 0.0 else 1.0
        wx += rate * spin * cosine
        wy += rate * spin * sine
        if radius > 0.0:
            wz -= rate * spin * (x * cosine + y * sine) / radius
    lines = noise.scale * sqrt(2.0 / count)
    accel, gyro = scale(lines * config.accel, (ax, ay, az)), scale(lines * config.gyro, (wx, wy, wz))
    if config.broadband > 0.0:
        n, m = gaussian(noise, _BLOCKS[0]), gaussian(noise, _BLOCKS[1])
        white, turning = config.broadband * config.accel * mean, config.broadband * config.gyro * mean
        accel = (accel[0] + white * n[0], accel[1] + white * n[1], accel[2] + white * n[2])
        gyro = (gyro[0] + turning * m[0], gyro[1] + turning * m[1], gyro[2] + turning * m[2])
    return accel, gyro
