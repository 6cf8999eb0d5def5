"""The pull of the cable on the vehicle, by one sample of the accelerometer and the assumed thrust.

| symbol | code name | frame | unit | |
|---|---|---|---|---|
| r | force | I | N | m_Q R (a - bias - a_t) - f R e_3: all that acts besides weight and thrust |
| T q | pull | I | N | of the cable |
| D | | I | N | drag of the frame, along the flow of the air past it |
| H | | I | N | drag of the rotors, in their plane |
| b | axis | I | | R e_3, axis of the rotors |
| k | frame_share | | | share of D in what D and H give across b |
| s | axial | | N | what they would give along b if all of it were drag of the frame |
| e | direction | I | | in which neither D nor H acts |

    r = T q + D + H,     b . H = 0,     D = D_level + D_z e_3.

The wind is level, so that only the vehicle's own climb makes D_z, which is known from D and the assumed drag.
A vehicle that leans into the wind has drag along b: in 27 m/s of air, leaning by 50 deg, that of `heavy` is
five times the weight of its load. It is known by the drag across b, which the accelerometer shows too: with
k (D_level + H) across b, and D_level level, b . D_level = k s. Hence, whatever the wind and the pull are,

    e = (1 - k) b + k e_3 / (b . e_3),     e . (D_level + H) = 0,     T = e . (r - D_z e_3) / (e . q).

k is learned where T is known: by the pendulum while the load hangs, and T = 0 while the cable lies slack. It
is the recursive fit of b . A to s, where A = r - T q - D_z e_3, and begins with one half.
"""

from __future__ import annotations

from math import sqrt

from autopilot.control.drag import MIN_UPWARD, Drag, air_free_direction
from autopilot.estimation.records import EstimatorTuning, ImuReading, LoadEstimate, VehicleEstimate
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, apply, axpy, column, dot, scale, sub
from autopilot.geometry.s2 import force_along_cable
from autopilot.geometry.so3 import rotation_from_quat

FRAME_SHARE_TIME_S = 1.0  # time constant with which k is learned
# of the load's weight: a drag along the axis that is as large teaches k half as fast as a large one
LEARNING_FORCE = 0.2
MIN_CARRYING_SHARE = 0.5  # of the vehicle's weight: below this thrust it stands, and H is not known by it
_NO_DRAG = 1e-9  # N s/m, added to a denominator to avoid 0 / 0


@kernel
def force_beyond_thrust(
    vehicle: VehicleEstimate, imu: ImuReading, thrust: float, tuning: EstimatorTuning
) -> Vec3:
    """r, N, world."""
    R = rotation_from_quat(vehicle.quat_wxyz)
    specific_force = apply(R, sub(sub(imu.accel, vehicle.accel_bias), vehicle.turning_accel))
    return axpy(-thrust, column(R, 2), scale(tuning.quad_mass, specific_force))


@kernel
def climb_drag(level_drag: float, climb: float, drag: Drag) -> float:
    """D_z, N, of a vehicle that climbs at `climb` (m/s), where the level part of its drag is `level_drag`
    (N)."""
    c1, c2 = drag.linear, drag.quadratic
    level_speed = 2.0 * level_drag / (c1 + sqrt(c1 * c1 + 4.0 * c2 * level_drag) + _NO_DRAG)
    return -(c1 + c2 * sqrt(level_speed * level_speed + climb * climb)) * climb


@kernel
def without_climb_drag(
    force: Vec3, load: LoadEstimate, vehicle: VehicleEstimate, frame_share: float, tuning: EstimatorTuning
) -> Vec3:
    """r - D_z e_3, N, of the `force` r; without the pendulum's tension, it is drag."""
    air = axpy(-load.tension, load.q_cable, force)
    level_drag = frame_share * sqrt(air[0] * air[0] + air[1] * air[1])
    return (force[0], force[1], force[2] - climb_drag(level_drag, vehicle.v_quad[2], tuning.drag))


@kernel
def measured_pull(force: Vec3, load: LoadEstimate, vehicle: VehicleEstimate, frame_share: float) -> float:
    """T, N; `force` is r - D_z e_3."""
    direction = air_free_direction(column(rotation_from_quat(vehicle.quat_wxyz), 2), frame_share)
    return force_along_cable(dot(force, direction), load.q_cable, direction)


@kernel
def learned_frame_share(
    force: Vec3,
    load: LoadEstimate,
    vehicle: VehicleEstimate,
    frame_share: float,
    tuning: EstimatorTuning,
    dt: float,
) -> float:
    """k after dt seconds in which the load hung on its cable, or the cable was slack; `force` is
    r - D_z e_3."""
    axis = column(rotation_from_quat(vehicle.quat_wxyz), 2)
    air = axpy(-load.tension, load.q_cable, force)
    along = dot(air, axis)
    axial = along - air[2] / max(axis[2], MIN_UPWARD)
    least = LEARNING_FORCE * tuning.load_mass * tuning.gravity
    gain = dt / FRAME_SHARE_TIME_S * axial / (axial * axial + least * least)
    return min(1.0, max(0.0, frame_share + gain * (along - frame_share * axial)))


@kernel
def rotor_drag_growth(thrust: float, before: float, frame_share: float, tuning: EstimatorTuning) -> float:
    """Factor by which the air's force across b grows where the thrust (N) was `before`: H is proportional to
    it, D does not change."""
    least = MIN_CARRYING_SHARE * tuning.quad_mass * tuning.gravity
    return 1.0 + (1.0 - frame_share) * (max(thrust, least) / max(before, least) - 1.0)
