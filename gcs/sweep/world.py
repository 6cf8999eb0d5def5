"""The simulated world of `sitl.sim_core` as kernels: plant, sensors and the delays between them.

The same integration from event to event as in `SimCore`, with the queues in arrays, so that many ticks run in
machine code. A test holds the two against each other, bit for bit.
"""

from __future__ import annotations

from math import log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add
from sitl.plant.records import PlantState, Rotors, Truth
from sitl.plant.step import advance, initial_state
from sitl.plant.wind import gust
from sitl.sensors import barometer, cable_sensor, gnss, imu, load_tracker, magnetometer, pose_tracker
from sitl.sensors.channel import Fate, Timing
from sitl.sensors.noise import Drift, Noise, gaussian, uniform
from sitl.sensors.profile import Delivery, Profile, Sampled
from sitl.sim_core import CHANNEL_STREAMS, Settings, Streams

# rows of the buffers: the order of `sitl.sim_core.Readings`
IMU, MOCAP, LOAD, CABLE, GNSS, BARO, MAG = range(7)
SENSORS = 7
# columns of `clock`
FITTED, COUNT, NOMINAL, DUE, OUTAGE_END, HEAD, LENGTH, LATENCY, LEAD = range(9)
# columns of `fate`
RATE, LOSS, OUTAGE_CHANCE, OUTAGE_S = range(4)
# columns of `queue`: leaves at (us), shows (us), then the reading
LEAVES, SHOWS, READING = 0, 1, 2
_COLUMNS = 15
_FATE_BLOCK, _OUTAGE_BLOCK = 15, 14  # noise blocks, as in `sitl.sensors.channel`
_GUSTS = Streams().gusts
_SPARE = 4  # entries of a queue beyond those that can be on their way
_NEVER = 2**62

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class WorldModel(NamedTuple):
    """What is constant over a flight."""

    truth: Truth
    imu: imu.ImuConfig
    mocap: pose_tracker.PoseConfig
    load: load_tracker.LoadConfig
    cable: cable_sensor.CableConfig
    gnss: gnss.GnssConfig
    baro: barometer.BarometerConfig
    mag: magnetometer.MagnetometerConfig
    tick_us: int
    actuator_delay_us: int
    seed: int
    noise_scale: float
    wind: Vec3  # mean, ENU, m/s
    gust_std: float  # m/s
    gust_tau_s: float
    pulse: Vec3  # ENU, m/s
    pulse_at_us: int  # negative: never
    pulse_for_us: int


class World(NamedTuple):
    """The world at a tick."""

    plant: PlantState
    tick: int
    now_us: int
    command: Rotors  # in force, N
    gust: Vec3


class Buffers(NamedTuple):
    """What is too large for a record: written in place."""

    clock: Ints  # (sensors, 9)
    fate: Floats  # (sensors, 4)
    errors: Floats  # (sensors, 6) biases and drifts
    queue: Floats  # (sensors, capacity, 15) readings on their way
    commands: Floats  # (capacity, 5) takes effect at (us), forces (N)
    command_ring: Ints  # (2,) head, length


@kernel
def nominal_us(rate_hz: float, tick_us: int, lead_us: int, n: int) -> int:
    """Instant of measurement n before it is cut at 0; as `Timing.nominal_us`."""
    if rate_hz > 0.0:
        return int(np.rint(n * 1000000 / rate_hz)) - lead_us
    return n * tick_us - lead_us


@kernel
def _put3(row: Floats, first: int, v: Vec3) -> None:
    row[first] = v[0]
    row[first + 1] = v[1]
    row[first + 2] = v[2]


@kernel
def _get3(row: Floats, first: int) -> Vec3:
    return (row[first], row[first + 1], row[first + 2])


@kernel
def _sample(
    sensor: int, plant: PlantState, error: Floats, row: Floats, model: WorldModel, noise: Noise
) -> None:
    """Measure: the reading goes into `row`, the sensor's drift into `error`."""
    if sensor == IMU:
        inertial, biases = imu.sample(plant, imu.ImuState(_get3(error, 0), _get3(error, 3)), model.imu, noise)
        _put3(row, READING, inertial.accel_body)
        _put3(row, READING + 3, inertial.gyro_body)
        _put3(error, 0, biases.accel_bias)
        _put3(error, 3, biases.gyro_bias)
    elif sensor == MOCAP:
        pose, offset = pose_tracker.sample(plant, pose_tracker.PoseState(_get3(error, 0)), model.mocap, noise)
        _put3(row, READING, pose.position)
        for i in range(4):
            row[READING + 3 + i] = pose.quat_wxyz[i]
        _put3(row, READING + 7, pose.velocity)
        _put3(row, READING + 10, pose.omega_body)
        _put3(error, 0, offset.offset)
    elif sensor == LOAD:
        load, shift = load_tracker.sample(
            plant, load_tracker.LoadTrackerState(_get3(error, 0)), model.load, noise
        )
        _put3(row, READING, load.position)
        _put3(row, READING + 3, load.velocity)
        _put3(error, 0, shift.offset)
    elif sensor == CABLE:
        cable, mounting = cable_sensor.sample(
            plant, cable_sensor.CableState(_get3(error, 0)), model.cable, noise
        )
        _put3(row, READING, cable.direction_body)
        row[READING + 3] = cable.seen
        _put3(error, 0, mounting.mounting)
    elif sensor == GNSS:
        fix, slow = gnss.sample(plant, gnss.GnssState(_get3(error, 0)), model.gnss, noise)
        _put3(row, READING, fix.position)
        _put3(row, READING + 3, fix.velocity)
        _put3(error, 0, slow.error)
    elif sensor == BARO:
        height, drift = barometer.sample(plant, barometer.BarometerState(_get3(error, 0)), model.baro, noise)
        row[READING] = height.height
        _put3(error, 0, drift.error)
    else:
        field, iron = magnetometer.sample(
            plant, magnetometer.MagnetometerState(_get3(error, 0)), model.mag, noise
        )
        _put3(row, READING, field.field_body)
        _put3(error, 0, iron.offset)


@kernel
def _delivers(clock: Ints, fate: Floats, noise: Noise) -> bool:
    """Draw the fate of a reading; as `Channel._delivers`."""
    if fate[LOSS] == 0.0 and fate[OUTAGE_CHANCE] == 0.0:
        return True
    lost, begins = uniform(noise, _FATE_BLOCK)
    if clock[DUE] >= clock[OUTAGE_END] and begins <= fate[OUTAGE_CHANCE]:
        length_s = -log(uniform(noise, _OUTAGE_BLOCK)[0]) * fate[OUTAGE_S]
        clock[OUTAGE_END] = clock[DUE] + max(int(np.rint(length_s * 1000000)), 1)
    return bool(clock[DUE] >= clock[OUTAGE_END] and lost > fate[LOSS])


@kernel
def measure(plant: PlantState, now_us: int, model: WorldModel, buffers: Buffers) -> None:
    """Take every measurement that is due."""
    capacity = buffers.queue.shape[1]
    for sensor in range(SENSORS):
        clock, fate = buffers.clock[sensor], buffers.fate[sensor]
        while clock[DUE] <= now_us:
            noise = Noise(model.seed, CHANNEL_STREAMS[sensor], clock[COUNT], model.noise_scale)
            row = buffers.queue[sensor, (clock[HEAD] + clock[LENGTH]) % capacity]
            _sample(sensor, plant, buffers.errors[sensor], row, model, noise)
            if _delivers(clock, fate, noise):
                row[LEAVES] = clock[NOMINAL] + clock[LATENCY]
                row[SHOWS] = clock[DUE]
                clock[LENGTH] += 1
            clock[COUNT] += 1
            clock[NOMINAL] = nominal_us(fate[RATE], model.tick_us, clock[LEAD], clock[COUNT])
            clock[DUE] = max(clock[NOMINAL], 0)


@kernel
def arrived(sensor: int, now_us: int, buffers: Buffers) -> int:
    """Row of the queue with the sensor's next reading that has left by now, taken out of it; or -1."""
    clock = buffers.clock[sensor]
    head = clock[HEAD]
    if clock[LENGTH] == 0 or buffers.queue[sensor, head, LEAVES] > now_us:
        return -1
    clock[HEAD] = (head + 1) % buffers.queue.shape[1]
    clock[LENGTH] -= 1
    return int(head)


@kernel
def tick(world: World, forces: Rotors, model: WorldModel, buffers: Buffers) -> World:
    """The world at the next tick; `forces` (N) answer the present one. As `SimCore.tick`."""
    now_us = world.now_us
    end_us = now_us + model.tick_us
    commands, ring = buffers.commands, buffers.command_ring
    room = commands.shape[0]
    last = commands[(ring[0] + ring[1]) % room]
    last[0] = now_us + model.actuator_delay_us
    for i in range(4):
        last[1 + i] = forces[i]
    ring[1] += 1
    wind, gusting = model.wind, world.gust
    if model.pulse_at_us >= 0 and model.pulse_at_us <= now_us < model.pulse_at_us + model.pulse_for_us:
        wind = add(wind, model.pulse)
    else:
        wind = add(wind, ZERO)
    if model.gust_std != 0.0:
        normals = gaussian(Noise(model.seed, _GUSTS, world.tick, 1.0), 0)
        gusting = gust(gusting, model.gust_std, model.gust_tau_s, model.tick_us / 1000000, normals)
        wind = add(wind, gusting)
    plant, command = world.plant, world.command
    while now_us < end_us:
        while ring[1] > 0 and commands[ring[0], 0] <= now_us:
            first = commands[ring[0]]
            command = (first[1], first[2], first[3], first[4])
            ring[0] = (ring[0] + 1) % room
            ring[1] -= 1
        stop_us = end_us
        if ring[1] > 0 and commands[ring[0], 0] < stop_us:
            stop_us = int(commands[ring[0], 0])
        for sensor in range(SENSORS):
            stop_us = min(stop_us, buffers.clock[sensor, DUE])
        plant = advance(plant, model.truth, command, wind, (stop_us - now_us) / 1000000)
        now_us = stop_us
        measure(plant, now_us, model, buffers)
    return World(plant, world.tick + 1, end_us, command, gusting)


# ---- before the flight

_NO_DRIFT = Drift(0.0, 1.0, 0.0)
_NOT_FITTED = (
    pose_tracker.PoseConfig(0.0, 0.0, 0.0, 0.0, _NO_DRIFT),
    load_tracker.LoadConfig(0.0, 0.0, _NO_DRIFT),
    cable_sensor.CableConfig(0.0, _NO_DRIFT, 0.0, 0.0),
    gnss.GnssConfig(ZERO, ZERO, ZERO, _NO_DRIFT),
    barometer.BarometerConfig(0.0, _NO_DRIFT),
    magnetometer.MagnetometerConfig(ZERO, 0.0, _NO_DRIFT),
)
_KINDS = (imu, pose_tracker, load_tracker, cable_sensor, gnss, barometer, magnetometer)


def new_world(
    truth: Truth, profile: Profile, settings: Settings, seed: int
) -> tuple[World, WorldModel, Buffers]:
    """The world before its first tick, its first readings taken."""
    tick_s = settings.tick_us / 1e6
    fitted: list[Delivery | None] = [
        profile.imu,
        profile.mocap,
        profile.load_tracker,
        profile.cable_sensor,
        profile.gnss,
        profile.barometer,
        profile.magnetometer,
    ]
    configs = [
        profile.imu.config(tick_s, truth.gravity),
        *(
            blank if table is None else table.config(tick_s)  # type: ignore[attr-defined]
            for table, blank in zip(fitted[1:], _NOT_FITTED, strict=True)
        ),
    ]
    parts: list[Any] = [
        truth,
        *configs,
        settings.tick_us,
        settings.actuator_delay_us,
        seed,
        settings.noise_scale,
        settings.wind,
        settings.gust_std,
        settings.gust_tau_s,
        settings.pulse,
        settings.pulse_at_us,
        settings.pulse_for_us,
    ]
    model = WorldModel(*parts)
    clock = np.zeros((SENSORS, 9), dtype=np.int64)
    fate = np.zeros((SENSORS, 4))
    errors = np.zeros((SENSORS, 6))
    capacity = _SPARE
    for sensor, (table, config) in enumerate(zip(fitted, configs, strict=True)):
        clock[sensor, DUE] = _NEVER
        if table is None:
            continue
        timing = _timing(table, settings)
        chance = Fate.of(table)
        noise = Noise(seed, CHANNEL_STREAMS[sensor], 0, settings.noise_scale)
        begun = _KINDS[sensor].start(config, noise)
        errors[sensor, : 3 * len(begun)] = np.ravel(begun)
        extra = 0.0 if sensor == IMU else settings.sensor_loss
        period_us = timing.nominal_us(1) - timing.nominal_us(0)
        fate[sensor] = (
            timing.rate_hz,
            min(chance.loss + extra, 1.0),
            chance.outages_per_s * period_us / 1_000_000,
            chance.outage_s,
        )
        clock[sensor, FITTED] = 1
        clock[sensor, NOMINAL] = timing.nominal_us(0)
        clock[sensor, DUE] = max(timing.nominal_us(0), 0)
        clock[sensor, LATENCY] = timing.latency_us
        clock[sensor, LEAD] = timing.lead_us
        waiting = (timing.latency_us + settings.tick_us) // max(period_us, 1)
        capacity = max(capacity, waiting + _SPARE)
    room = settings.actuator_delay_us // settings.tick_us + _SPARE
    buffers = Buffers(
        clock,
        fate,
        errors,
        np.zeros((SENSORS, capacity, _COLUMNS)),
        np.zeros((room, 5)),
        np.zeros(2, dtype=np.int64),
    )
    gusting = gaussian(Noise(seed, _GUSTS, 0, settings.gust_std), 1)
    world = World(initial_state(truth), 0, 0, (0.0, 0.0, 0.0, 0.0), gusting)
    measure(world.plant, 0, model, buffers)
    return world, model, buffers


def _timing(table: Delivery, settings: Settings) -> Timing:
    """As `SimCore` fits its channels: the inertial unit is read one latency before its tick."""
    latency_us = round(table.latency_ms * 1000.0) + settings.sensor_latency_us
    if isinstance(table, Sampled):
        return Timing(table.rate_hz, settings.tick_us, latency_us, 0)
    return Timing(0.0, settings.tick_us, latency_us, latency_us)
