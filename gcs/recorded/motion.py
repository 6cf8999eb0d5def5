"""The data of a recording that the kernels of the load need, row by row."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gcs.recorded.column_map import ColumnMap
from gcs.recorded.load_model import LoadModel
from gcs.recorded.recording import Recording
from gcs.recorded.row_times import RowTimes, infer_times, known_times
from gcs.recorded.smoothing import Floats, SmoothedMotion, smooth

_AXIS_NOISE = 3e-3  # of the body's vertical axis
_AXIS_DENSITY = 50.0
SLOW_DENSITY = 20.0  # the course to which the attitude is compared
SLOW_NOISE_M = 1.5e-3
_SLOW_AXIS_NOISE = 1e-2
_SLOW_AXIS_DENSITY = 890.0  # smoothed as strongly as the course


class Motion(NamedTuple):
    """A vehicle's motion as arrays of rows, and the measured load."""

    time_s: Floats  # (n,)
    attachment: SmoothedMotion  # of the cable at the vehicle
    thrust: Floats  # (n, 3) direction of the thrust
    slow: SmoothedMotion  # of the vehicle, smoothed as strongly as the attitude that is compared with it
    tilt: Floats  # (n, 2) of the thrust's axis, x / z and y / z
    load: Floats  # (n, 3) position of the load; nan where it was not measured
    times: RowTimes  # and what they were inferred from


def motion_of(recording: Recording, columns: ColumnMap) -> Motion:
    """The motion of a recorded vehicle; the times of rows without times are inferred."""
    tracking, attachment = columns.tracking, columns.attachment
    position = recording.position
    if recording.time_s is not None:
        times = known_times(recording.time_s, position, tracking.noise_m, tracking.jerk_density)
    else:
        rate_hz = columns.rate_hz or 0.0
        times = infer_times(position, rate_hz, jitter_s=columns.jitter_s, noise_m=tracking.grid_noise_m)
    time, weight = times.time_s, times.weight
    smoothed = smooth(time, position, tracking.noise_m**2 / weight, tracking.jerk_density)
    attitude = Rotation.from_quat(recording.quaternion_xyzw)
    up = attitude.apply(np.array([0.0, 0.0, 1.0]))
    tilt = attachment.thrust_tilt
    thrust = attitude.apply(np.array([-tilt[0], -tilt[1], 1.0]))
    axis = smooth(time, up, _AXIS_NOISE**2 / weight, _AXIS_DENSITY)
    return Motion(
        time,
        SmoothedMotion(*(a - attachment.below_m * b for a, b in zip(smoothed, axis, strict=True))),
        smooth(time, thrust, _AXIS_NOISE**2 / weight, _AXIS_DENSITY).position,
        smooth(time, position, SLOW_NOISE_M**2 / weight, SLOW_DENSITY),
        smooth(
            time, thrust[:, :2] / thrust[:, 2:], _SLOW_AXIS_NOISE**2 / weight, _SLOW_AXIS_DENSITY
        ).position,
        recording.load,
        times,
    )


def distances(motion: Motion) -> Floats:
    """(n,) from attachment to load."""
    distance: Floats = np.linalg.norm(motion.load - motion.attachment.position, axis=1)
    return distance


def drive_rows(motion: Motion, model: LoadModel) -> Floats:
    """(n, 8): acceleration, velocity, position of the attachment relative to the wash that comes down now."""
    earlier_s = motion.time_s - model.wash_delay_s
    position = motion.attachment.position[:, :2]
    below = position - model.length_m * motion.thrust[:, :2]
    wash_centre = np.stack([np.interp(earlier_s, motion.time_s, below[:, i]) for i in range(2)], axis=1)
    return np.hstack([motion.attachment.acceleration, motion.attachment.velocity, position - wash_centre])


def slow_rows(motion: Motion) -> Floats:
    """(n, 8): the drive with which the attitude is compared."""
    zeros = np.zeros((len(motion.time_s), 2))
    return np.hstack([motion.slow.acceleration, motion.slow.velocity, zeros])


def measurement_rows(motion: Motion) -> Floats:
    """(n, 6): load relative to attachment, direction of the thrust, weight of the row, 1 where broken."""
    relative = motion.load[:, :2] - motion.attachment.position[:, :2]
    return np.hstack([relative, motion.tilt, motion.times.weight[:, None], motion.times.broken[:, None]])
