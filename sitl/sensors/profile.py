"""Sensor profiles: which sensors are fitted and how good they are. The units are in the key names.

Every deviation is one sigma per axis. A `bias` is drawn once at switch-on; a `walk` is the growth of that
bias over a second (its deviation rises with the square root of time). If a table is absent, that sensor is
not fitted; required are only the IMU and one source of the vehicle's position, motion capture or GNSS.
"""

from __future__ import annotations

from math import cos, exp, hypot, inf, nan, radians, sin, sqrt
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from sitl.sensors.barometer import BarometerConfig
from sitl.sensors.cable_sensor import CableConfig
from sitl.sensors.gnss import GnssConfig
from sitl.sensors.imu import ImuConfig
from sitl.sensors.load_tracker import LoadConfig
from sitl.sensors.magnetometer import MagnetometerConfig
from sitl.sensors.noise import Drift
from sitl.sensors.pose_tracker import PoseConfig
from sitl.sensors.room import Room
from sitl.sensors.vibration import VibrationConfig

_MAX_RATE_HZ = 20_000.0
_MAX_JITTER_FACTOR = 5.0  # times its mean: without the limit, one reading in 150 would be later

# a sensor states at least these deviations, so that no receiver divides by the zero of a perfect one
_MIN_POSITION_STD = 1e-4  # m
_MIN_VELOCITY_STD = 1e-3  # m/s
_MIN_ANGLE_STD = 1e-4  # rad


def _rate(value: object) -> float:
    """A rate in Hz; 0.0 stands for the word "tick"."""
    if value == "tick":
        return 0.0
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("rate", 'must be a number > 0, or "tick" (a reading at every tick)')
    if not 0.0 < value <= _MAX_RATE_HZ:
        raise PydanticCustomError("rate", f"must be > 0 and at most {_MAX_RATE_HZ:g}")
    return float(value)


Rate = Annotated[float, PlainValidator(_rate)]
Deviation = Annotated[float, Field(ge=0.0, le=1e6)]
Positive = Annotated[float, Field(gt=0.0, le=1e9)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Delivery(_Table):
    """Latency and loss of readings. Outages begin at random; their lengths are exponentially distributed."""

    latency_ms: Annotated[float, Field(ge=0.0, le=10_000.0)] = 0.0
    loss: Share = 0.0
    outages_per_min: Annotated[float, Field(ge=0.0, le=6000.0)] = 0.0
    outage_s: Positive = 1.0


class Sampled(Delivery):
    """A sensor with its own rate."""

    rate_hz: Rate

    def period_s(self, tick_s: float) -> float:
        """Time from reading to reading."""
        return 1.0 / self.rate_hz if self.rate_hz > 0.0 else tick_s


class Stamped(Sampled):
    """A sensor whose readings carry the time of measurement, and arrive over a network or a serial line.

    In addition to the latency, each reading is late by a random, exponentially distributed time: one may
    overtake another. The clock of the sensor has a constant offset.
    """

    jitter_ms: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    jitter_max_ms: Annotated[float, Field(ge=0.0, le=10_000.0)] | None = None
    time_offset_ms: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0

    @property
    def max_extra_delay_ms(self) -> float:
        """The longest delay of a reading beyond the latency."""
        if self.jitter_ms == 0.0:
            return 0.0
        return _MAX_JITTER_FACTOR * self.jitter_ms if self.jitter_max_ms is None else self.jitter_max_ms


def _walk(bias: float, walk: float, period_s: float) -> Drift:
    return Drift(initial=bias, decay=1.0, drive=walk * sqrt(period_s))


def _correlated(std: float, correlation_s: float, period_s: float) -> Drift:
    """An error with this deviation and correlation time (first-order Gauss-Markov)."""
    decay = exp(-period_s / correlation_s) if correlation_s > 0.0 else 0.0
    return Drift(initial=std, decay=decay, drive=std * sqrt(1.0 - decay * decay))


class Imu(Delivery):
    """Accelerometer and gyroscope, one reading at every tick; vibration is that of the airframe at hover."""

    accel_noise_m_s2: Deviation
    accel_bias_m_s2: Deviation = 0.0
    accel_walk_m_s2: Deviation = 0.0
    accel_range_m_s2: Positive | None = None
    gyro_noise_rad_s: Deviation
    gyro_bias_rad_s: Deviation = 0.0
    gyro_walk_rad_s: Deviation = 0.0
    gyro_range_rad_s: Positive | None = None
    vibration_m_s2: Deviation = 0.0
    vibration_rad_s: Deviation = 0.0
    vibration_broadband: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    lowpass_hz: Positive | None = None

    def config(self, tick_s: float, gravity: float) -> ImuConfig:
        """For the kernel; gravity of the world in m/s^2."""
        return ImuConfig(
            accel_noise=self.accel_noise_m_s2,
            accel_drift=_walk(self.accel_bias_m_s2, self.accel_walk_m_s2, tick_s),
            accel_range=inf if self.accel_range_m_s2 is None else self.accel_range_m_s2,
            gyro_noise=self.gyro_noise_rad_s,
            gyro_drift=_walk(self.gyro_bias_rad_s, self.gyro_walk_rad_s, tick_s),
            gyro_range=inf if self.gyro_range_rad_s is None else self.gyro_range_rad_s,
            gravity=gravity,
        )

    def vibration(self, tick_s: float) -> VibrationConfig:
        """For the kernel."""
        return VibrationConfig(
            self.vibration_m_s2,
            self.vibration_rad_s,
            self.vibration_broadband,
            self.lowpass_hz or 0.0,
            tick_s,
        )


class Tracker(Stamped):
    """Errors of a position measured by motion capture.

    The correlated error has the given deviation and correlation time; the calibration error is a distortion
    of the room with waves of the given length.
    """

    position_noise_m: Deviation
    position_bias_m: Deviation = 0.0
    position_walk_m: Deviation = 0.0
    position_correlated_m: Deviation = 0.0
    correlation_s: Positive = 1.0
    calibration_error_m: Deviation = 0.0
    calibration_length_m: Positive = 2.0

    def wander(self, tick_s: float) -> Drift:
        """The correlated error."""
        return _correlated(self.position_correlated_m, self.correlation_s, self.period_s(tick_s))

    def room(self) -> Room:
        """The calibration error."""
        length = self.calibration_length_m
        return Room(self.calibration_error_m if length > 0.0 else 0.0, length)


class Mocap(Tracker):
    """Motion capture of the vehicle. A velocity noise that is not given means: velocity is not measured."""

    attitude_noise_rad: Deviation
    velocity_noise_m_s: Deviation | None = None
    rate_noise_rad_s: Deviation | None = None

    def config(self, tick_s: float) -> PoseConfig:
        """For the kernel."""
        return PoseConfig(
            position_noise=self.position_noise_m,
            attitude_noise=self.attitude_noise_rad,
            velocity_noise=nan if self.velocity_noise_m_s is None else self.velocity_noise_m_s,
            rate_noise=nan if self.rate_noise_rad_s is None else self.rate_noise_rad_s,
            position_drift=_walk(self.position_bias_m, self.position_walk_m, self.period_s(tick_s)),
            wander=self.wander(tick_s),
            room=self.room(),
        )


class LoadTracker(Tracker):
    """Motion capture of the load."""

    velocity_noise_m_s: Deviation | None = None

    def config(self, tick_s: float) -> LoadConfig:
        """For the kernel."""
        return LoadConfig(
            position_noise=self.position_noise_m,
            velocity_noise=nan if self.velocity_noise_m_s is None else self.velocity_noise_m_s,
            position_drift=_walk(self.position_bias_m, self.position_walk_m, self.period_s(tick_s)),
            wander=self.wander(tick_s),
            room=self.room(),
        )


class CableSensor(Stamped):
    """A camera that sees the load within a cone about the body's down axis, or encoders on a taut cable."""

    kind: Literal["camera", "encoder"]
    direction_noise_rad: Deviation
    mounting_bias_rad: Deviation = 0.0
    mounting_walk_rad: Deviation = 0.0
    half_angle_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 180.0

    def config(self, tick_s: float) -> CableConfig:
        """For the kernel."""
        return CableConfig(
            direction_noise=self.direction_noise_rad,
            mounting_drift=_walk(self.mounting_bias_rad, self.mounting_walk_rad, self.period_s(tick_s)),
            cone_cosine=cos(radians(self.half_angle_deg)),
            taut_only=1.0 if self.kind == "encoder" else 0.0,
        )


class Gnss(Stamped):
    """Satellite navigation. The correlated errors have the given deviation and forget themselves in time.

    Multipath is one that the receiver does not count among its own deviations. A fix that floats says so.
    """

    fix: Literal["3d", "rtk"]
    horizontal_noise_m: Deviation
    vertical_noise_m: Deviation
    horizontal_correlated_m: Deviation = 0.0
    vertical_correlated_m: Deviation = 0.0
    correlation_s: Positive = 60.0
    horizontal_velocity_noise_m_s: Deviation
    vertical_velocity_noise_m_s: Deviation
    satellites: Annotated[int, Field(ge=4, le=60)] = 12
    horizontal_multipath_m: Deviation = 0.0
    vertical_multipath_m: Deviation = 0.0
    multipath_s: Positive = 20.0
    float_per_min: Annotated[float, Field(ge=0.0, le=6000.0)] = 0.0
    float_s: Positive = 5.0
    float_error_m: Positive = 0.2
    lost_per_min: Annotated[float, Field(ge=0.0, le=6000.0)] = 0.0
    lost_s: Positive = 2.0

    @model_validator(mode="after")
    def _only_rtk_floats(self) -> Gnss:
        if self.fix != "rtk" and self.float_per_min > 0.0:
            raise ValueError('has float_per_min without fix = "rtk": only a fix with carrier phase floats')
        return self

    def config(self, tick_s: float) -> GnssConfig:
        """For the kernel."""
        period_s = self.period_s(tick_s)
        multipath = self.horizontal_multipath_m + self.vertical_multipath_m > 0.0
        floats = self.fix == "rtk"
        horizontal, vertical = self.horizontal_noise_m, self.vertical_noise_m
        speed, climb = self.horizontal_velocity_noise_m_s, self.vertical_velocity_noise_m_s
        return GnssConfig(
            position_noise=(horizontal, horizontal, vertical),
            position_error=(
                self.horizontal_correlated_m,
                self.horizontal_correlated_m,
                self.vertical_correlated_m,
            ),
            velocity_noise=(speed, speed, climb),
            correlation=_correlated(1.0, self.correlation_s, period_s),
            multipath_error=(
                self.horizontal_multipath_m,
                self.horizontal_multipath_m,
                self.vertical_multipath_m,
            ),
            multipath=_correlated(1.0 if multipath else 0.0, self.multipath_s, period_s),
            float_error=self.float_error_m if floats else 0.0,
            float_chance=self.float_per_min / 60.0 * period_s if floats else 0.0,
            float_s=self.float_s,
            lost_chance=self.lost_per_min / 60.0 * period_s,
            lost_s=self.lost_s,
            period_s=period_s,
        )


class Barometer(Sampled):
    """Static pressure, as height; the drift forgets itself over the correlation time."""

    height_noise_m: Deviation
    height_drift_m: Deviation = 0.0
    correlation_s: Positive = 300.0

    def config(self, tick_s: float) -> BarometerConfig:
        """For the kernel."""
        drift = _correlated(self.height_drift_m, self.correlation_s, self.period_s(tick_s))
        return BarometerConfig(self.height_noise_m, drift)


class Magnetometer(Sampled):
    """The earth's field at home and the error of its measurement; the motors' field is that at hover."""

    strength_gauss: Positive
    inclination_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    declination_deg: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0
    noise_gauss: Deviation
    hard_iron_gauss: Deviation = 0.0
    hard_iron_walk_gauss: Deviation = 0.0
    motor_field_gauss: Deviation = 0.0

    def config(self, tick_s: float) -> MagnetometerConfig:
        """For the kernel: inclination is counted down from the horizon, declination east from north."""
        dip, turn = radians(self.inclination_deg), radians(self.declination_deg)
        level = self.strength_gauss * cos(dip)
        return MagnetometerConfig(
            field=(level * sin(turn), level * cos(turn), -self.strength_gauss * sin(dip)),
            field_noise=self.noise_gauss,
            hard_iron=_walk(self.hard_iron_gauss, self.hard_iron_walk_gauss, self.period_s(tick_s)),
        )


class Profile(_Table):
    """All sensors of a vehicle, and the properties of the place in which it flies."""

    description: str
    imu: Imu
    mocap: Mocap | None = None
    load_tracker: LoadTracker | None = None
    cable_sensor: CableSensor | None = None
    gnss: Gnss | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None

    @model_validator(mode="after")
    def _has_position_source(self) -> Profile:
        if self.mocap is None and self.gnss is None:
            raise ValueError("has neither mocap nor gnss; one of them must tell where the vehicle is")
        return self

    @property
    def timed(self) -> dict[str, Stamped]:
        """Its sensors whose readings carry the time of measurement, by name."""
        return {name: table for name, table in self if isinstance(table, Stamped)}


class ReportedStd(NamedTuple):
    """The deviations that readings state, per axis; nan where a sensor is not fitted."""

    mocap_position: float
    mocap_attitude: float
    mocap_velocity: float
    load_position: float
    load_velocity: float
    direction: float
    gnss_horizontal: float
    gnss_vertical: float
    gnss_float: float  # of a floating fix, horizontal and vertical


def reported_std(profile: Profile, scale: float) -> ReportedStd:
    """The deviations that the sensors of a profile state when all noise is multiplied by `scale`."""
    mocap, load, cable, gnss = profile.mocap, profile.load_tracker, profile.cable_sensor, profile.gnss

    def std(min_std: float, *parts: float | None) -> float:
        return max(min_std, scale * hypot(*(part or 0.0 for part in parts)))

    return ReportedStd(
        mocap_position=std(_MIN_POSITION_STD, mocap.position_noise_m, mocap.position_bias_m)
        if mocap
        else nan,
        mocap_attitude=std(_MIN_ANGLE_STD, mocap.attitude_noise_rad) if mocap else nan,
        mocap_velocity=std(_MIN_VELOCITY_STD, mocap.velocity_noise_m_s) if mocap else nan,
        load_position=std(_MIN_POSITION_STD, load.position_noise_m, load.position_bias_m) if load else nan,
        load_velocity=std(_MIN_VELOCITY_STD, load.velocity_noise_m_s) if load else nan,
        direction=std(_MIN_ANGLE_STD, cable.direction_noise_rad, cable.mounting_bias_rad) if cable else nan,
        gnss_horizontal=std(_MIN_POSITION_STD, gnss.horizontal_noise_m, gnss.horizontal_correlated_m)
        if gnss
        else nan,
        gnss_vertical=std(_MIN_POSITION_STD, gnss.vertical_noise_m, gnss.vertical_correlated_m)
        if gnss
        else nan,
        gnss_float=std(_MIN_POSITION_STD, gnss.float_error_m) if gnss else nan,
    )
