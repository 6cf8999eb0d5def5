"""The world as a function of its commands: plant, sensors and all delays between them, on a clock of ticks.

Between two ticks the plant is integrated from event to event: a command that takes effect, a sensor that
measures. Both are exact to the microsecond, whatever the tick rate.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from autopilot.geometry.linear import ZERO, Vec3, add
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from sitl.plant.gripper import dropped, takes_hold, without_cable
from sitl.plant.records import PlantState, Rotors, Truth
from sitl.plant.step import advance, initial_state
from sitl.plant.winch import later, reeling
from sitl.plant.wind import gust
from sitl.sensors import (
    barometer,
    cable_sensor,
    gnss,
    imu,
    load_tracker,
    magnetometer,
    pose_tracker,
)
from sitl.sensors.barometer import BarometerReading
from sitl.sensors.cable_sensor import CableReading
from sitl.sensors.channel import Channel, Fate, Measurement, Timing
from sitl.sensors.gnss import GnssReading
from sitl.sensors.imu import ImuReading
from sitl.sensors.load_tracker import LoadReading
from sitl.sensors.magnetometer import MagnetometerReading
from sitl.sensors.noise import Noise, gaussian
from sitl.sensors.pose_tracker import PoseReading
from sitl.sensors.profile import Delivery, Profile, Sampled

SECOND_US = 1_000_000
STOPPED: Rotors = (0.0, 0.0, 0.0, 0.0)


class Streams(NamedTuple):
    """Noise stream of each sensor: fixed, so that fitting one sensor leaves the others as they were."""

    imu: int = 1
    mocap: int = 2
    load_tracker: int = 3
    cable_sensor: int = 4
    gnss: int = 5
    barometer: int = 6
    magnetometer: int = 7
    gusts: int = 8


CHANNEL_STREAMS = Streams()[:7]  # in the order of `Readings`


class Settings(NamedTuple):
    """What the SIM_* parameters mean to the core."""

    tick_us: int
    actuator_delay_us: int
    noise_scale: float
    sensor_latency_us: int  # added to that of each sensor
    sensor_loss: float  # 0 ... 1, added to that of each sensor but the IMU
    wind: Vec3  # mean, ENU, m/s
    gust_std: float  # m/s, each axis
    gust_tau_s: float
    pulse: Vec3  # ENU, m/s, added to the wind for a while
    pulse_at_us: int  # when it begins; negative: never
    pulse_for_us: int


class Readings(NamedTuple):
    """What leaves the sensors at one tick; a sensor that has nothing new gives an empty tuple."""

    imu: tuple[Measurement[ImuReading], ...]
    mocap: tuple[Measurement[PoseReading], ...]
    load_tracker: tuple[Measurement[LoadReading], ...]
    cable_sensor: tuple[Measurement[CableReading], ...]
    gnss: tuple[Measurement[GnssReading], ...]
    barometer: tuple[Measurement[BarometerReading], ...]
    magnetometer: tuple[Measurement[MagnetometerReading], ...]


def settings_of(table: ParameterTable) -> Settings:
    """The settings of a table of SIM_* parameters, or ParameterError."""
    rate = table["SIM_RATE_HZ"]
    tick_us = round(SECOND_US / rate)
    if tick_us * rate != SECOND_US:
        divisors = (hz for hz in range(100, 1001) if SECOND_US % hz == 0)
        allowed = ", ".join(str(hz) for hz in divisors)
        raise ParameterError(
            f"SIM_RATE_HZ = {rate:g} Hz; a tick must be a whole number of microseconds, and "
            f"{SECOND_US} us / {rate:g} is not: take one of {allowed}"
        )
    return Settings(
        tick_us=tick_us,
        actuator_delay_us=round(table["SIM_ACT_DELAY_MS"] * 1000.0),
        noise_scale=table["SIM_NOISE_SCALE"],
        sensor_latency_us=round(table["SIM_SENS_LAT_MS"] * 1000.0),
        sensor_loss=table["SIM_DROP_PCT"] / 100.0,
        wind=(table["SIM_WIND_E"], table["SIM_WIND_N"], table["SIM_WIND_U"]),
        gust_std=table["SIM_GUST_STD"],
        gust_tau_s=table["SIM_GUST_TAU_S"],
        pulse=(table["SIM_GUST_E"], table["SIM_GUST_N"], table["SIM_GUST_U"]),
        pulse_at_us=round(table["SIM_GUST_AT_S"] * SECOND_US),
        pulse_for_us=round(table["SIM_GUST_FOR_S"] * SECOND_US),
    )


class SimCore:
    """The true vehicle at time `now_us`. Same arguments and commands: same readings, to the bit."""

    def __init__(self, truth: Truth, profile: Profile, settings: Settings, seed: int) -> None:
        self.truth = truth
        self.settings = settings
        self.state: PlantState = initial_state(truth)
        self.tick_count = 0
        self.now_us = 0
        self.command = STOPPED  # in force, N
        self.wind = settings.wind  # ENU, m/s
        self.released = False  # the gripper has let the cable go
        self._tied = truth  # the truth with the cable as the winch has it
        self.snap_speed = 0.0  # m/s, at which the cable came taut in the last tick; 0: it did not
        self._pulse_at_us = settings.pulse_at_us
        self._commands: deque[tuple[int, Rotors]] = deque()  # (takes effect at, forces)
        self._seed = seed
        self._gust = gaussian(Noise(seed, Streams().gusts, 0, settings.gust_std), 1)
        self._channels = self._fit(profile)
        self._fitted = tuple(channel for channel in self._channels if channel is not None)
        self._measure(0)
        self.readings = self._collect()

    def retune(self, truth: Truth, settings: Settings) -> None:
        """Go on under another truth and other settings; tick, latency and cable length stay as they were.

        A gust pulse whose time is moved to a tick that has begun does not blow.
        """
        if settings.pulse_at_us != self.settings.pulse_at_us:
            self._pulse_at_us = settings.pulse_at_us if settings.pulse_at_us > self.now_us else -1
        later_us = settings.actuator_delay_us - self.settings.actuator_delay_us
        self._commands = deque((effect_us + later_us, command) for effect_us, command in self._commands)
        self.truth = truth
        reeled = self._tied
        self._tied = truth._replace(cable_length=reeled.cable_length, reel_rate=reeled.reel_rate)
        self.settings = settings
        for stream, channel in zip(CHANNEL_STREAMS, self._channels, strict=True):
            if channel is not None:
                channel.retune(self._noise(stream), self._extra_loss(stream))

    def tick(self, command: Rotors, gripper_open: bool = False, reel_rate: float = 0.0) -> Readings:
        """Integrate to the next tick; `command` (N) is the one that answers the present tick.

        It takes effect after the actuator delay; before the first one the rotors stand still. A gripper that
        opens lets go at once; one that closes takes hold as soon as the load lies within reach. The winch
        reaches `reel_rate` (m/s, positive: out) by the next tick; one without a cable stands.
        """
        if gripper_open != self.released:
            self._move_gripper(gripper_open)
        tick_s = self.settings.tick_us / SECOND_US
        self._tied = reeling(self._tied, 0.0 if self.released else reel_rate, tick_s)
        now_us = self.now_us
        end_us = now_us + self.settings.tick_us
        commands = self._commands
        commands.append((now_us + self.settings.actuator_delay_us, command))
        wind = self.wind = self._next_wind()
        snap_speed = 0.0
        while now_us < end_us:
            while commands and commands[0][0] <= now_us:
                self.command = commands.popleft()[1]
            stop_us = end_us
            if commands and commands[0][0] < stop_us:
                stop_us = commands[0][0]
            for channel in self._fitted:
                stop_us = min(stop_us, channel.due_us)
            h = (stop_us - now_us) / SECOND_US
            truth = without_cable(self.truth) if self.released else self._tied
            self.state = advance(self.state, truth, self.command, wind, h)
            self._tied = later(self._tied, h)
            snap_speed = max(snap_speed, self.state.snap_speed)
            now_us = stop_us
            self._measure(now_us)
        self.snap_speed = snap_speed
        self.now_us = end_us
        self.tick_count += 1
        self.readings = self._collect()
        return self.readings

    def _move_gripper(self, gripper_open: bool) -> None:
        if gripper_open:
            self.state = dropped(self.state)
        elif not takes_hold(self.state, self._tied):
            return
        self.released = gripper_open

    @property
    def cable_length(self) -> float:
        """Length of the cable in m, held or not."""
        return self._tied.cable_length

    @property
    def pulse(self) -> Vec3:
        """The gust pulse that blows from this tick to the next; it begins and ends at the first tick that is
        not before its time."""
        begin_us, settings = self._pulse_at_us, self.settings
        blows = begin_us >= 0 and begin_us <= self.now_us < begin_us + settings.pulse_for_us
        return settings.pulse if blows else ZERO

    def _next_wind(self) -> Vec3:
        """Wind of this tick: the mean, the pulse and a random gust."""
        settings = self.settings
        steady = add(settings.wind, self.pulse)
        if settings.gust_std == 0.0:
            return steady
        normals = gaussian(Noise(self._seed, Streams().gusts, self.tick_count, 1.0), 0)
        tick_s = settings.tick_us / SECOND_US
        self._gust = gust(self._gust, settings.gust_std, settings.gust_tau_s, tick_s, normals)
        return add(steady, self._gust)

    def _measure(self, now_us: int) -> None:
        for channel in self._fitted:
            while channel.due_us <= now_us:
                channel.measure(self.state)

    def _collect(self) -> Readings:
        return Readings(
            *(() if channel is None else channel.collect(self.now_us) for channel in self._channels)
        )

    def _fit(self, profile: Profile) -> tuple[Channel[Any] | None, ...]:
        """The channels in the order of `Readings`."""
        tick_s = self.settings.tick_us / SECOND_US
        streams = Streams()

        def fitted(sensor: Any, table: Any, stream: int) -> Channel[Any] | None:
            if table is None:
                return None
            return self._channel(sensor, table.config(tick_s), table, stream)

        inertial = profile.imu.config(tick_s, self.truth.gravity)
        return (
            self._channel(imu, inertial, profile.imu, streams.imu),
            fitted(pose_tracker, profile.mocap, streams.mocap),
            fitted(load_tracker, profile.load_tracker, streams.load_tracker),
            fitted(cable_sensor, profile.cable_sensor, streams.cable_sensor),
            fitted(gnss, profile.gnss, streams.gnss),
            fitted(barometer, profile.barometer, streams.barometer),
            fitted(magnetometer, profile.magnetometer, streams.magnetometer),
        )

    def _noise(self, stream: int) -> Noise:
        return Noise(self._seed, stream, 0, self.settings.noise_scale)

    def _extra_loss(self, stream: int) -> float:
        """Loss added to a sensor's own; the inertial unit is wired to the autopilot and is spared."""
        return 0.0 if stream == Streams().imu else self.settings.sensor_loss

    def _channel(self, sensor: Any, config: Any, delivery: Delivery, stream: int) -> Channel[Any]:
        settings = self.settings
        latency_us = round(delivery.latency_ms * 1000.0) + settings.sensor_latency_us
        if isinstance(delivery, Sampled):
            timing = Timing(delivery.rate_hz, settings.tick_us, latency_us, lead_us=0)
        else:
            # the link carries no time of measurement for the IMU: it is read one latency before its tick
            timing = Timing(0.0, settings.tick_us, latency_us, lead_us=latency_us)
        return Channel(
            sensor.sample,
            sensor.start,
            config,
            timing,
            Fate.of(delivery),
            self._noise(stream),
            self._extra_loss(stream),
        )
