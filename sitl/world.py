"""One tick of the world as one compiled function: plant, sensors, and all delays between them.

Between two ticks the plant is integrated from event to event: a command that takes effect, a sensor that
measures. Both are exact to the microsecond, whatever the tick rate. All that is carried from tick to tick
lies in `WorldRows`, flat arrays that `world_tick` reads and writes: the simulator's process calls it once a
tick (`sitl.sim_core`), a sweep in a loop.

Every sample of a sensor is taken and moves the sensor's drift, even if its reading is then lost: so losses
change neither the noise nor the drift of the readings that come through.
"""

from __future__ import annotations

from math import log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add
from autopilot.geometry.packed import Row, pack, packed, unpack, with_field
from sitl.plant.gripper import dropped, takes_hold, without_cable
from sitl.plant.records import PlantState, Rotors, Truth
from sitl.plant.step import advance, initial_state
from sitl.plant.winch import later, reeling
from sitl.plant.wind import gust
from sitl.sensors import barometer, cable_sensor, gnss, imu, load_tracker, magnetometer, pose_tracker
from sitl.sensors.noise import Drift, Noise, gaussian, uniform
from sitl.sensors.profile import Delivery, Profile, Sampled
from sitl.settings import SECOND_US, Settings

# rows of the arrays, one a sensor
IMU, MOCAP, LOAD, CABLE, GNSS, BARO, MAG = range(7)
SENSORS = 7
# noise streams: fixed, so that fitting one sensor leaves the others as they were
STREAMS = (1, 2, 3, 4, 5, 6, 7)
GUSTS = 8
# columns of `clock`
FITTED, COUNT, NOMINAL, DUE, OUTAGE_END, HEAD, LENGTH, LATENCY, LEAD = range(9)
# columns of `fate`
RATE, LOSS, OUTAGE_CHANCE, OUTAGE_S = range(4)
# columns of `queue`: leaves at (us), shows (us), then the reading
LEAVES, SHOWS, READING = 0, 1, 2
_COLUMNS = 15
_FATE_BLOCK, _OUTAGE_BLOCK = 15, 14  # noise blocks; the sensors use those below
_SPARE = 4  # entries of a queue beyond those that can be on their way
_NEVER = 2**62

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class WorldModel(NamedTuple):
    """What only parameters change."""

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
    wind: Vec3  # of the last tick, ENU, m/s
    cable_length: float  # m, as the winch has it, held or not
    reel_rate: float  # m/s
    reel_accel: float  # m/s^2
    released: bool  # the gripper has let the cable go
    snap_speed: float  # m/s, at which the cable came taut in the last tick; 0: it did not


class WorldRows(NamedTuple):
    """The memory of the world, written in place."""

    world: Row  # World
    model: Row  # WorldModel
    seed: Ints  # (1,)
    clock: Ints  # (sensors, 9)
    fate: Floats  # (sensors, 4)
    errors: Floats  # (sensors, 6) biases and drifts
    queue: Floats  # (sensors, capacity, 15) readings on their way
    commands: Floats  # (capacity, 5) takes effect at (us), forces (N)
    command_ring: Ints  # (2,) head, length


@kernel
def nominal_us(rate_hz: float, tick_us: int, lead_us: int, n: int) -> int:
    """Instant of measurement n, n / rate - lead, before it is cut at 0; rate 0: one a tick."""
    if rate_hz > 0.0:
        return int(np.rint(n * 1000000 / rate_hz)) - lead_us
    return n * tick_us - lead_us


@kernel
def _sample(
    sensor: int, plant: PlantState, error: Floats, row: Floats, model: WorldModel, noise: Noise
) -> None:
    """Measure: the reading goes into `row`, the sensor's drift into `error`."""
    if sensor == IMU:
        inertial, biases = imu.sample(plant, unpack(imu.ImuState, error, 0), model.imu, noise)
        pack(inertial, row, READING)
        pack(biases, error, 0)
    elif sensor == MOCAP:
        pose, offset = pose_tracker.sample(
            plant, unpack(pose_tracker.PoseState, error, 0), model.mocap, noise
        )
        pack(pose, row, READING)
        pack(offset, error, 0)
    elif sensor == LOAD:
        load, shift = load_tracker.sample(
            plant, unpack(load_tracker.LoadTrackerState, error, 0), model.load, noise
        )
        pack(load, row, READING)
        pack(shift, error, 0)
    elif sensor == CABLE:
        cable, mounting = cable_sensor.sample(
            plant, unpack(cable_sensor.CableState, error, 0), model.cable, noise
        )
        pack(cable, row, READING)
        pack(mounting, error, 0)
    elif sensor == GNSS:
        fix, slow = gnss.sample(plant, unpack(gnss.GnssState, error, 0), model.gnss, noise)
        pack(fix, row, READING)
        pack(slow, error, 0)
    elif sensor == BARO:
        height, drift = barometer.sample(plant, unpack(barometer.BarometerState, error, 0), model.baro, noise)
        pack(height, row, READING)
        pack(drift, error, 0)
    else:
        field, iron = magnetometer.sample(
            plant, unpack(magnetometer.MagnetometerState, error, 0), model.mag, noise
        )
        pack(field, row, READING)
        pack(iron, error, 0)


@kernel
def _delivers(clock: Ints, fate: Floats, noise: Noise) -> bool:
    """Draw the fate of a reading: lost singly, or in an outage of exponentially distributed length."""
    if fate[LOSS] == 0.0 and fate[OUTAGE_CHANCE] == 0.0:
        return True
    lost, begins = uniform(noise, _FATE_BLOCK)
    if clock[DUE] >= clock[OUTAGE_END] and begins <= fate[OUTAGE_CHANCE]:
        length_s = -log(uniform(noise, _OUTAGE_BLOCK)[0]) * fate[OUTAGE_S]
        clock[OUTAGE_END] = clock[DUE] + max(int(np.rint(length_s * 1000000)), 1)
    return bool(clock[DUE] >= clock[OUTAGE_END] and lost > fate[LOSS])


@kernel
def measure(plant: PlantState, now_us: int, model: WorldModel, rows: WorldRows) -> None:
    """Take every measurement that is due."""
    capacity = rows.queue.shape[1]
    for sensor in range(SENSORS):
        clock, fate = rows.clock[sensor], rows.fate[sensor]
        while clock[DUE] <= now_us:
            noise = Noise(rows.seed[0], STREAMS[sensor], clock[COUNT], model.noise_scale)
            row = rows.queue[sensor, (clock[HEAD] + clock[LENGTH]) % capacity]
            _sample(sensor, plant, rows.errors[sensor], row, model, noise)
            if _delivers(clock, fate, noise):
                row[LEAVES] = clock[NOMINAL] + clock[LATENCY]
                row[SHOWS] = clock[DUE]
                clock[LENGTH] += 1
            clock[COUNT] += 1
            clock[NOMINAL] = nominal_us(fate[RATE], model.tick_us, clock[LEAD], clock[COUNT])
            clock[DUE] = max(clock[NOMINAL], 0)


@kernel
def arrived(sensor: int, now_us: int, rows: WorldRows) -> int:
    """Row of the queue with the sensor's next reading that has left by now, taken out of it; or -1."""
    clock = rows.clock[sensor]
    head = clock[HEAD]
    if clock[LENGTH] == 0 or rows.queue[sensor, head, LEAVES] > now_us:
        return -1
    clock[HEAD] = (head + 1) % rows.queue.shape[1]
    clock[LENGTH] -= 1
    return int(head)


@kernel
def pulse_at(model: WorldModel, now_us: int) -> Vec3:
    """The gust pulse that blows from this tick to the next; it begins and ends at the first tick that is not
    before its time."""
    if model.pulse_at_us >= 0 and model.pulse_at_us <= now_us < model.pulse_at_us + model.pulse_for_us:
        return model.pulse
    return ZERO


@kernel
def held_truth(model: WorldModel, world: World) -> Truth:
    """The truth of this instant: with the cable as the winch has it, or without one."""
    if world.released:
        return without_cable(model.truth)
    tied = with_field(model.truth, "cable_length", world.cable_length)
    return with_field(with_field(tied, "reel_rate", world.reel_rate), "reel_accel", world.reel_accel)


@kernel
def _with_winch(world: World, truth: Truth) -> World:
    """The world with its winch as this truth has it."""
    reeled = with_field(world, "cable_length", truth.cable_length)
    return with_field(with_field(reeled, "reel_rate", truth.reel_rate), "reel_accel", truth.reel_accel)


@kernel
def _as_wound(model: WorldModel, world: World) -> Truth:
    """The truth with the cable as the winch has it, held or not."""
    return held_truth(model, with_field(world, "released", False))


@kernel
def _gripped(world: World, model: WorldModel, gripper_open: bool) -> World:
    """The world after the gripper has moved. One that opens lets go at once; one that closes takes hold as
    soon
    as the load lies within reach."""
    if gripper_open == world.released:
        return world
    if gripper_open:
        return with_field(with_field(world, "plant", dropped(world.plant)), "released", True)
    if takes_hold(world.plant, _as_wound(model, world)):
        return with_field(world, "released", False)
    return world


@kernel
def world_tick(rows: WorldRows, forces: Rotors, gripper_open: bool, reel_rate: float) -> None:
    """The world at the next tick; `forces` (N) answer the present one.

    They take effect after the actuator delay; before the first ones the rotors stand still. The winch reaches
    `reel_rate` (m/s, positive: out) by the next tick; one without a cable stands.
    """
    model, world = unpack(WorldModel, rows.model, 0), unpack(World, rows.world, 0)
    world = _gripped(world, model, gripper_open)
    tick_s = model.tick_us / 1000000
    wanted = 0.0 if world.released else reel_rate
    world = _with_winch(world, reeling(_as_wound(model, world), wanted, tick_s))
    now_us = world.now_us
    end_us = now_us + model.tick_us
    commands, ring = rows.commands, rows.command_ring
    room = commands.shape[0]
    last = commands[(ring[0] + ring[1]) % room]
    last[0] = now_us + model.actuator_delay_us
    for i in range(4):
        last[1 + i] = forces[i]
    ring[1] += 1
    wind, gusting = add(model.wind, pulse_at(model, now_us)), world.gust
    if model.gust_std != 0.0:
        normals = gaussian(Noise(rows.seed[0], GUSTS, world.tick, 1.0), 0)
        gusting = gust(gusting, model.gust_std, model.gust_tau_s, tick_s, normals)
        wind = add(wind, gusting)
    plant, command, snap_speed = world.plant, world.command, 0.0
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
            stop_us = min(stop_us, rows.clock[sensor, DUE])
        h = (stop_us - now_us) / 1000000
        plant = advance(plant, held_truth(model, world), command, wind, h)
        world = _with_winch(world, later(_as_wound(model, world), h))
        snap_speed = max(snap_speed, plant.snap_speed)
        now_us = stop_us
        measure(plant, now_us, model, rows)
    after = World(
        plant,
        world.tick + 1,
        end_us,
        command,
        gusting,
        wind,
        world.cable_length,
        world.reel_rate,
        world.reel_accel,
        world.released,
        snap_speed,
    )
    pack(after, rows.world, 0)


# ---- before the flight, and when parameters change

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
READINGS = (
    imu.ImuReading,
    pose_tracker.PoseReading,
    load_tracker.LoadReading,
    cable_sensor.CableReading,
    gnss.GnssReading,
    barometer.BarometerReading,
    magnetometer.MagnetometerReading,
)


def fitted_sensors(profile: Profile) -> tuple[Delivery | None, ...]:
    """The profile's tables in the order of the rows; None: not fitted."""
    return (
        profile.imu,
        profile.mocap,
        profile.load_tracker,
        profile.cable_sensor,
        profile.gnss,
        profile.barometer,
        profile.magnetometer,
    )


def model_of(truth: Truth, profile: Profile, settings: Settings, pulse_at_us: int) -> WorldModel:
    """The model of a world under these settings."""
    tick_s = settings.tick_us / SECOND_US
    parts: list[Any] = [truth, profile.imu.config(tick_s, truth.gravity)]
    for table, blank in zip(fitted_sensors(profile)[1:], _NOT_FITTED, strict=True):
        parts.append(blank if table is None else table.config(tick_s))  # type: ignore[attr-defined]
    parts += [
        settings.tick_us,
        settings.actuator_delay_us,
        settings.noise_scale,
        settings.wind,
        settings.gust_std,
        settings.gust_tau_s,
        settings.pulse,
        pulse_at_us,
        settings.pulse_for_us,
    ]
    return WorldModel(*parts)


def losses(profile: Profile, settings: Settings) -> list[float]:
    """Share of each sensor's readings that is lost singly, all of a failed one; the inertial unit is wired to
    the autopilot and is spared what is lost on the way."""
    found = []
    for sensor, table in enumerate(fitted_sensors(profile)):
        extra = 0.0 if sensor == IMU else settings.sensor_loss
        if settings.failed_sensors[sensor]:
            extra = 1.0
        found.append(0.0 if table is None else min(table.loss + extra, 1.0))
    return found


def command_room(settings: Settings) -> int:
    """Commands that can be on their way."""
    return settings.actuator_delay_us // settings.tick_us + _SPARE


def new_world(truth: Truth, profile: Profile, settings: Settings, seed: int) -> WorldRows:
    """The world before its first tick, its first readings taken."""
    model = model_of(truth, profile, settings, settings.pulse_at_us)
    configs = model[1 : 1 + SENSORS]
    clock = np.zeros((SENSORS, 9), dtype=np.int64)
    fate = np.zeros((SENSORS, 4))
    errors = np.zeros((SENSORS, 6))
    capacity = _SPARE
    lost = losses(profile, settings)
    for sensor, (table, config) in enumerate(zip(fitted_sensors(profile), configs, strict=True)):
        clock[sensor, DUE] = _NEVER
        if table is None:
            continue
        rate_hz, latency_us, lead_us = _timing(table, settings)
        first_us, second_us = (nominal_us(rate_hz, settings.tick_us, lead_us, n) for n in (0, 1))
        begun = _KINDS[sensor].start(config, Noise(seed, STREAMS[sensor], 0, settings.noise_scale))
        pack(begun, errors[sensor], 0)
        period_us = second_us - first_us
        chance = table.outages_per_min / 60.0 * period_us / SECOND_US
        fate[sensor] = (rate_hz, lost[sensor], chance, table.outage_s)
        clock[sensor, FITTED] = 1
        clock[sensor, NOMINAL] = first_us
        clock[sensor, DUE] = max(first_us, 0)
        clock[sensor, LATENCY] = latency_us
        clock[sensor, LEAD] = lead_us
        waiting = (latency_us + settings.tick_us) // max(period_us, 1)
        capacity = max(capacity, waiting + _SPARE)
    begun_world = World(
        plant=initial_state(truth),
        tick=0,
        now_us=0,
        command=(0.0, 0.0, 0.0, 0.0),
        gust=gaussian(Noise(seed, GUSTS, 0, settings.gust_std), 1),
        wind=settings.wind,
        cable_length=truth.cable_length,
        reel_rate=truth.reel_rate,
        reel_accel=truth.reel_accel,
        released=False,
        snap_speed=0.0,
    )
    rows = WorldRows(
        packed(begun_world),
        packed(model),
        np.array([seed], dtype=np.int64),
        clock,
        fate,
        errors,
        np.zeros((SENSORS, capacity, _COLUMNS)),
        np.zeros((command_room(settings), 5)),
        np.zeros(2, dtype=np.int64),
    )
    measure(begun_world.plant, 0, model, rows)
    return rows


def _timing(table: Delivery, settings: Settings) -> tuple[float, int, int]:
    """(rate in Hz or 0 for one a tick, latency us, lead us) of a sensor.

    The link carries no time of measurement for the inertial unit: it is read one latency before its tick.
    """
    latency_us = round(table.latency_ms * 1000.0) + settings.sensor_latency_us
    if isinstance(table, Sampled):
        return table.rate_hz, latency_us, 0
    return 0.0, latency_us, latency_us
