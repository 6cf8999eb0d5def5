"""Whether a vehicle whose rotors have stopped in the air falls, or rests on the ground.

It rests once the inertial unit has measured its weight and no rotation for a while, and the estimated speed
is small. In free fall there is no weight to measure; after a long fall the drag equals it, but the vehicle is
fast. An impact may exceed the range of the accelerometer: the estimated speed is then wrong until the
readings of the position have corrected it. Where the speed is not known, the inertial unit decides alone.
"""

from __future__ import annotations

from math import isnan

from autopilot.estimation.records import ImuReading
from autopilot.geometry.linear import norm
from autopilot.supervisor.state import Fall

REST_US = 500_000
MAX_WEIGHT_ERROR = 0.2  # of the gravity, by which the specific force may differ
MAX_RATE_RAD_S = 0.3
MAX_SPEED_M_S = 0.5
MAX_SILENCE_US = 500_000  # of the inertial unit


class FallWatch:
    """Follows a vehicle from the stop of its rotors until it rests."""

    def __init__(self, now_us: int) -> None:
        self._moved_us = now_us  # when the vehicle was last found to move
        self._measured_us = now_us  # when the inertial unit last measured

    def advance(self, sample: ImuReading | None, speed_m_s: float, gravity_m_s2: float, now_us: int) -> Fall:
        """What is known at the next tick, from its inertial sample (None: there is none) and the estimated
        speed (NaN: not known)."""
        if sample is None:
            if now_us - self._measured_us <= MAX_SILENCE_US:
                return Fall.FALLING
            self._moved_us = now_us
            return Fall.UNKNOWN
        self._measured_us = now_us
        weight_error = abs(norm(sample.accel) - gravity_m_s2)
        still = weight_error <= MAX_WEIGHT_ERROR * gravity_m_s2 and norm(sample.gyro) <= MAX_RATE_RAD_S
        if not still or not (isnan(speed_m_s) or speed_m_s <= MAX_SPEED_M_S):
            self._moved_us = now_us
        return Fall.NONE if now_us - self._moved_us >= REST_US else Fall.FALLING
