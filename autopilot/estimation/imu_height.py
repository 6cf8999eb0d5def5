"""How far above its assumed place the inertial unit sits, learned in flight.

| symbol | code name | frame | unit | |
|---|---|---|---|---|
| h | height | B | m | of the unit above its assumed place |
| r | force | I | N | `cable_pull`: all that acts on the vehicle besides weight and thrust |
| T q | | I | N | pull of the cable |
| W, J, M | | B | | body rate, inertia, moment of rotors and cable |
| f | lateral | B | m/s^2 | R^T (r - T q) / m_Q, of which only the part across the rotors' axis is used |
| e | turning | B | 1/s^2 | what the unit measures of the rotation across this axis for each metre of h |

The thrust has no part across the rotors' axis, so that

    f = p + h e + noise,    e = (W'_y + W_x W_z, -W'_x + W_y W_z),    W' = J^-1 (M - W x J W),

where the acceleration p by wind and drag changes slowly. h is the least-squares fit of f to e, after the mean
over `MEAN_TIME_S` has been taken away from both, and that of the rest once more. W' is computed from the
moment of the rotors, and so contains neither the gyroscope's noise nor the vibration of the frame, which both
sensors measure.

An unknown height below the centre of mass is dangerous where the law learns the push of the wind from the
accelerometer: a vehicle that begins to tilt seems to be pushed the other way, and tilts further. A height
that is assumed wrongly has the same effect. So of h only the part is assumed of which the fit is certain:
`KNOWN_SIGMAS` deviations less, with the deviation of a fit whose residuals last for `CORRELATION_S`. In
gusts, to which the law reacts by a rotation, the fit is 4 to 8 mm too low; less than `LEAST_HEIGHT` counts as
none.
"""

from __future__ import annotations

from math import sqrt

from autopilot.estimation.cable_pull import MIN_CARRYING_SHARE
from autopilot.estimation.records import EstimatorTuning, ImuHeight, LoadEstimate, VehicleEstimate
from autopilot.estimation.tautness import MIN_FLOWN_HEIGHT
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import E3, Vec3, axpy, column, dot
from autopilot.geometry.rigid_body import angular_accel, arm_accel
from autopilot.geometry.so3 import rotation_from_quat

MEAN_TIME_S, MEMORY_S = 0.15, 20.0  # s, time constants of the means and of the sums
KNOWN_SIGMAS, CORRELATION_S = 5.0, 0.02
LEAST_HEIGHT, GREATEST_HEIGHT = 0.01, 0.3  # m
Pair = tuple[float, float]
_LEAST = 1e-9  # in place of a divisor that is still zero


@kernel
def _mean_and_rest(mean: Pair, value: Pair, share: float) -> tuple[Pair, Pair]:
    """The fading mean after another value, and what the value differs from it by."""
    mean = (mean[0] + share * (value[0] - mean[0]), mean[1] + share * (value[1] - mean[1]))
    return mean, (value[0] - mean[0], value[1] - mean[1])


@kernel
def learned_imu_height(
    known: ImuHeight,
    force: Vec3,
    pull: float,
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    thrust: float,
    moment: Vec3,
    tuning: EstimatorTuning,
    dt: float,
) -> ImuHeight:
    """h after another sample. `force` (N, world) and `pull` (N) are by this sample, with the height known so
    far, `thrust` (N) is that of the rotors, `moment` (N m, body) that of rotors and cable. Nothing is learned
    nor forgotten on the ground, whose force is not known, while the rotors do not carry the vehicle, and
    without a load (its cable is infinitely long)."""
    W = vehicle.omega_body
    turning = arm_accel(W, angular_accel(W, moment, tuning.inertia), E3)
    without_cable = axpy(-pull if load.taut > 0.0 else 0.0, load.q_cable, force)
    R = rotation_from_quat(vehicle.quat_wxyz)
    lateral = (
        dot(column(R, 0), without_cable) / tuning.quad_mass + known.height * turning[0],
        dot(column(R, 1), without_cable) / tuning.quad_mass + known.height * turning[1],
    )
    # the means begin with the first values in the air
    above_load = vehicle.x_quad[2] - load.x_load[2]
    carried = MIN_CARRYING_SHARE * tuning.quad_mass * tuning.gravity
    share = if_above(above_load, MIN_FLOWN_HEIGHT * tuning.cable_length, dt / (MEAN_TIME_S + dt), 1.0)
    share = if_above(thrust, carried, share, 1.0)
    mean_lateral, f = _mean_and_rest(known.mean_lateral, lateral, share)
    rest_lateral, f = _mean_and_rest(known.rest_lateral, f, share)
    mean_turning, e = _mean_and_rest(known.mean_turning, (turning[0], turning[1]), share)
    rest_turning, e = _mean_and_rest(known.rest_turning, e, share)
    product, size = f[0] * e[0] + f[1] * e[1], e[0] * e[0] + e[1] * e[1]
    kept = if_above(1.0, share, 1.0 - dt / MEMORY_S, 1.0)
    correlation, square = kept * known.correlation + product, kept * known.square + size
    residual = product - known.correlation / max(known.square, _LEAST) * size
    spread = kept * known.spread + residual * residual
    divisor = max(square, _LEAST)
    fitted = correlation / divisor
    margin = KNOWN_SIGMAS * sqrt(spread * CORRELATION_S / max(dt, _LEAST)) / divisor
    certain = max(0.0, fitted - margin) + min(0.0, fitted + margin)
    height = if_above(abs(certain), LEAST_HEIGHT, min(GREATEST_HEIGHT, max(-GREATEST_HEIGHT, certain)), 0.0)
    means = mean_lateral, rest_lateral, mean_turning, rest_turning
    return ImuHeight(height, correlation, square, spread, *means)
