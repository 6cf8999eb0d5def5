"""One tick of the world as one compiled function: plant, sensors, and all delays between them.

Between two ticks the plant is integrated from event to event: a command that takes effect, a sensor that
measures. Both are exact to the microsecond, whatever the tick rate. Everything that is kept from tick to tick
is in `WorldRows`, flat arrays that `world_tick` reads and writes: the simulator's process calls it once a
tick (`sitl.sim_core`), a sweep in a loop.

Every sample of a sensor is taken and advances the sensor's drift, even if its reading is then lost. Losses
therefore change neither the noise nor the drift of the readings that arrive.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.jitable import jitable
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add
from autopilot.geometry.packed import Row, pack, packed, unpack, with_field
from autopilot.vehicle.layout import MAX_ROTORS, PLUS, Layout
from sitl.plant.chain.records import ChainRows, with_gripping_reach
from sitl.plant.chain.step import advance_chain
from sitl.plant.drive import FULL, Supply, discharged
from sitl.plant.gripper import can_grip, with_cable_released, without_cable
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import COMMAND, FAILED_SHARE, FORCE, SHARE, RotorRows, rotor_table, rotors_at_rest
from sitl.plant.step import advance, initial_state
from sitl.plant.winch import truth_after, with_commanded_rate
from sitl.plant.wind import gust
from sitl.sensors import barometer, cable_sensor, gnss, imu, load_tracker, magnetometer, pose_tracker
from sitl.sensors.elementary import logarithm
from sitl.sensors.motor_field import motor_field
from sitl.sensors.noise import Drift, Noise, gaussian, uniform
from sitl.sensors.overrides import with_overrides
from sitl.sensors.profile import Delivery, Profile, Sampled, Stamped
from sitl.sensors.room import Room
from sitl.sensors.vibration import VibrationConfig, draw_phases, rotor_vibration
from sitl.settings import SECOND_US, Settings

# rows of the arrays, one per sensor
IMU, MOCAP, LOAD, CABLE, GNSS, BARO, MAG = range(7)
SENSORS = 7
# noise streams: fixed, so that fitting one sensor leaves the others as they were
STREAMS = (1, 2, 3, 4, 5, 6, 7)
GUSTS = 8
# columns of `clock`
FITTED, COUNT, NOMINAL, DUE, OUTAGE_END, HEAD, LENGTH, LATENCY, LEAD = range(9)
# columns of `delivery`
RATE, LOSS, OUTAGE_CHANCE, OUTAGE_S, JITTER, JITTER_MAX, STAMP_OFFSET, FAILS_AT, FAILS_UNTIL = range(9)
# the last five: us
# columns of `queue`: when the reading leaves the sensor (us), its time stamp (us), then the reading
DEPARTURE_US, STAMP_US, READING = 0, 1, 2
_COLUMNS = 15
_FATE_BLOCK, _OUTAGE_BLOCK, _JITTER_BLOCK = 15, 14, 13  # noise blocks of a sample that no sensor draws
_PHASES = 6  # in the row of the inertial unit's errors: where the angles of the rotors begin
_SPARE = 4  # entries of a queue beyond those that can be on their way
_NEVER = 2**62

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class WorldModel(NamedTuple):
    """The values that only parameters change."""

    truth: Truth
    imu: imu.ImuConfig
    mocap: pose_tracker.PoseConfig
    load: load_tracker.LoadConfig
    cable: cable_sensor.CableConfig
    gnss: gnss.GnssConfig
    baro: barometer.BarometerConfig
    mag: magnetometer.MagnetometerConfig
    vibration: VibrationConfig
    motor_field: float  # gauss, at hover
    tick_us: int
    actuator_delay_us: int
    noise_scale: float
    wind: Vec3  # mean, ENU, m/s
    gust_std: float  # m/s
    gust_tau_s: float
    pulse: Vec3  # ENU, m/s
    pulse_at_us: int  # negative: never
    pulse_for_us: int
    rotors_fail_at_us: int


class World(NamedTuple):
    """The world at a tick."""

    plant: PlantState
    tick: int
    now_us: int
    gust: Vec3
    wind: Vec3  # of the last tick, ENU, m/s
    cable_length: float  # m, as set by the winch, held or not
    reel_rate: float  # m/s
    reel_accel: float  # m/s^2
    released: bool  # the gripper has let the cable go
    supply: Supply
    snap_speed: float  # m/s, at which the cable came taut in the last tick; 0: it did not


class WorldRows(NamedTuple):
    """The memory of the world, written in place."""

    world: Row  # World
    model: Row  # WorldModel
    seed: Ints  # (1,)
    clock: Ints  # (sensors, 9)
    delivery: Floats  # (sensors, 9)
    errors: Floats  # (sensors, 20) biases, drifts, angles of the rotors
    queue: Floats  # (sensors, capacity, 15) readings on their way
    commands: Floats  # (capacity, 1 + rotors) takes effect at (us), forces (N)
    command_ring: Ints  # (2,) head, length
    rotors: Floats  # as `RotorRows.rows`
    rotor_table: Floats  # as `RotorRows.table`


@kernel
def rotors_of(rows: WorldRows) -> RotorRows:
    """The rotors."""
    return RotorRows(rows.rotor_table, rows.rotors)


@kernel
def nominal_us(rate_hz: float, tick_us: int, lead_us: int, n: int) -> int:
    """Time (us) of measurement n, n / rate - lead, before it is limited to at least 0; rate 0: one a tick."""
    if rate_hz > 0.0:
        return int(np.rint(n * 1000000 / rate_hz)) - lead_us
    return n * tick_us - lead_us


@kernel
def _sample(
    sensor: int,
    plant: PlantState,
    rotors: RotorRows,
    error: Floats,
    row: Floats,
    model: WorldModel,
    noise: Noise,
) -> None:
    """Measure: the reading goes into `row`, the sensor's drift into `error`."""
    if sensor == IMU:
        inertial, biases = imu.sample(plant, unpack(imu.ImuState, error, 0), model.imu, noise)
        if model.vibration.accel > 0.0 or model.vibration.gyro > 0.0:
            accel_vibration, rate_vibration = rotor_vibration(
                rotors, model.truth, error[_PHASES:], model.vibration, noise
            )
            inertial = imu.ImuReading(
                add(inertial.accel_body, accel_vibration), add(inertial.gyro_body, rate_vibration)
            )
        pack(imu.clip_reading(inertial, model.imu), row, READING)
        pack(biases, error, 0)
    elif sensor == MOCAP:
        pose, pose_error = pose_tracker.sample(
            plant, unpack(pose_tracker.PoseState, error, 0), model.mocap, noise
        )
        pack(pose, row, READING)
        pack(pose_error, error, 0)
    elif sensor == LOAD:
        load, load_error = load_tracker.sample(
            plant, unpack(load_tracker.LoadTrackerState, error, 0), model.load, noise
        )
        pack(load, row, READING)
        pack(load_error, error, 0)
    elif sensor == CABLE:
        cable, mounting = cable_sensor.sample(
            plant, unpack(cable_sensor.CableState, error, 0), model.cable, noise
        )
        pack(cable, row, READING)
        pack(mounting, error, 0)
    elif sensor == GNSS:
        fix, gnss_errors = gnss.sample(plant, unpack(gnss.GnssState, error, 0), model.gnss, noise)
        pack(fix, row, READING)
        pack(gnss_errors, error, 0)
    elif sensor == BARO:
        height, drift = barometer.sample(plant, unpack(barometer.BarometerState, error, 0), model.baro, noise)
        pack(height, row, READING)
        pack(drift, error, 0)
    else:
        field, hard_iron = magnetometer.sample(
            plant, unpack(magnetometer.MagnetometerState, error, 0), model.mag, noise
        )
        if model.motor_field > 0.0:
            motor_gauss = motor_field(rotors, model.truth, model.motor_field * noise.scale)
            field = magnetometer.MagnetometerReading(add(field.field_body, motor_gauss))
        pack(field, row, READING)
        pack(hard_iron, error, 0)


@kernel
def _is_delivered(clock: Ints, delivery: Floats, noise: Noise) -> bool:
    """Draw the fate of a reading: lost singly, or in an outage of exponentially distributed length. All
    readings of a failed sensor are lost."""
    works = clock[DUE] < delivery[FAILS_AT] or clock[DUE] >= delivery[FAILS_UNTIL]
    if delivery[LOSS] == 0.0 and delivery[OUTAGE_CHANCE] == 0.0:
        return bool(works)
    lost, outage_draw = uniform(noise, _FATE_BLOCK)
    if clock[DUE] >= clock[OUTAGE_END] and outage_draw <= delivery[OUTAGE_CHANCE]:
        length_s = -logarithm(uniform(noise, _OUTAGE_BLOCK)[0]) * delivery[OUTAGE_S]
        clock[OUTAGE_END] = clock[DUE] + max(int(np.rint(length_s * 1000000)), 1)
    return bool(works and clock[DUE] >= clock[OUTAGE_END] and lost > delivery[LOSS])


@kernel
def _insert_by_departure(queue: Floats, head: int, last: int) -> None:
    """Sort the reading at place `last` behind the head into the queue by the time at which it leaves: before
    the readings that it overtakes."""
    capacity = queue.shape[0]
    while last > 0:
        preceding, current = queue[(head + last - 1) % capacity], queue[(head + last) % capacity]
        if preceding[DEPARTURE_US] <= current[DEPARTURE_US]:
            return
        for column in range(queue.shape[1]):
            swapped = current[column]
            current[column] = preceding[column]
            preceding[column] = swapped
        last -= 1


@kernel
def measure(plant: PlantState, now_us: int, model: WorldModel, rows: WorldRows) -> None:
    """Take every measurement that is due."""
    capacity = rows.queue.shape[1]
    for sensor in range(SENSORS):
        clock, delivery = rows.clock[sensor], rows.delivery[sensor]
        while clock[DUE] <= now_us:
            noise = Noise(rows.seed[0], STREAMS[sensor], clock[COUNT], model.noise_scale)
            row = rows.queue[sensor, (clock[HEAD] + clock[LENGTH]) % capacity]
            _sample(sensor, plant, rotors_of(rows), rows.errors[sensor], row, model, noise)
            if _is_delivered(clock, delivery, noise):
                row[DEPARTURE_US] = clock[NOMINAL] + clock[LATENCY]
                row[STAMP_US] = clock[DUE]
                if delivery[STAMP_OFFSET] != 0.0:
                    row[STAMP_US] = max(clock[DUE] + delivery[STAMP_OFFSET], 0.0)
                if delivery[JITTER] > 0.0:
                    late_us = -logarithm(uniform(noise, _JITTER_BLOCK)[0]) * delivery[JITTER]
                    row[DEPARTURE_US] = row[DEPARTURE_US] + np.rint(min(late_us, delivery[JITTER_MAX]))
                    _insert_by_departure(rows.queue[sensor], clock[HEAD], clock[LENGTH])
                clock[LENGTH] += 1
            clock[COUNT] += 1
            clock[NOMINAL] = nominal_us(delivery[RATE], model.tick_us, clock[LEAD], clock[COUNT])
            clock[DUE] = max(clock[NOMINAL], 0)


@kernel
def pop_arrived(sensor: int, now_us: int, rows: WorldRows) -> int:
    """Row of the sensor's next reading that has left by now, which is taken out of the queue; or -1."""
    clock = rows.clock[sensor]
    head = clock[HEAD]
    if clock[LENGTH] == 0 or rows.queue[sensor, head, DEPARTURE_US] > now_us:
        return -1
    clock[HEAD] = (head + 1) % rows.queue.shape[1]
    clock[LENGTH] -= 1
    return int(head)


@jitable
def pulse_at(starts_us: int, for_us: int, pulse: Vec3, now_us: int) -> Vec3:
    """The gust pulse that blows from this tick to the next; it begins and ends at the first tick that is not
    before its time. A negative `starts_us`: never."""
    if starts_us >= 0 and starts_us <= now_us < starts_us + for_us:
        return pulse
    return ZERO


@kernel
def current_truth(model: WorldModel, world: World) -> Truth:
    """The truth of this instant: with the cable as set by the winch, or without one."""
    with_supply = with_field(model.truth, "supply", world.supply.share)
    if world.released:
        return without_cable(with_supply)
    with_cable = with_field(with_supply, "cable_length", world.cable_length)
    return with_field(with_field(with_cable, "reel_rate", world.reel_rate), "reel_accel", world.reel_accel)


@kernel
def _with_winch(world: World, truth: Truth) -> World:
    """The world with its winch in the state of this truth."""
    reeled = with_field(world, "cable_length", truth.cable_length)
    return with_field(with_field(reeled, "reel_rate", truth.reel_rate), "reel_accel", truth.reel_accel)


@kernel
def _truth_with_cable(model: WorldModel, world: World) -> Truth:
    """The truth with the cable as set by the winch, held or not."""
    return current_truth(model, with_field(world, "released", False))


@kernel
def _after_gripper(world: World, model: WorldModel, gripper_open: bool) -> World:
    """The world after the gripper has moved. A gripper that opens lets go immediately; one that closes takes
    hold as soon as the load lies within reach."""
    if gripper_open == world.released:
        return world
    if gripper_open:
        return with_field(with_field(world, "plant", with_cable_released(world.plant)), "released", True)
    if can_grip(world.plant, with_gripping_reach(_truth_with_cable(model, world))):
        return with_field(world, "released", False)
    return world


@kernel
def _set_rotor_shares(rotors: RotorRows, failing: bool) -> None:
    """Set the share of its command that each rotor gives: the share in its table if `failing`, else all."""
    for i in range(rotors.table.shape[0]):
        rotors.rows[SHARE, i] = rotors.table[i, FAILED_SHARE] if failing else 1.0


@kernel
def world_tick(
    rows: WorldRows, forces: Floats, gripper_open: bool, reel_rate: float, chain: ChainRows | None = None
) -> None:
    """Move the world to the next tick; `forces` (N), one for each rotor, are the answer to the present one.

    They take effect after the actuator delay; before the first ones the rotors stand still. The winch reaches
    `reel_rate` (m/s, positive: out) by the next tick; without a cable it stands still. `chain` is the memory
    of a cable of links; without it the cable is massless and taut or slack.
    """
    model, world = unpack(WorldModel, rows.model, 0), unpack(World, rows.world, 0)
    world = _after_gripper(world, model, gripper_open)
    tick_s = model.tick_us / 1000000
    commanded_rate = 0.0 if world.released else reel_rate
    world = _with_winch(world, with_commanded_rate(_truth_with_cable(model, world), commanded_rate, tick_s))
    now_us = world.now_us
    end_us = now_us + model.tick_us
    commands, ring = rows.commands, rows.command_ring
    capacity = commands.shape[0]
    newest_command = commands[(ring[0] + ring[1]) % capacity]
    newest_command[0] = now_us + model.actuator_delay_us
    rotors = rotors_of(rows)
    count = rotors.table.shape[0]
    for i in range(count):
        newest_command[1 + i] = forces[i]
    ring[1] += 1
    _set_rotor_shares(rotors, now_us >= model.rotors_fail_at_us)
    pulse = pulse_at(model.pulse_at_us, model.pulse_for_us, model.pulse, now_us)
    wind, gust_now = add(model.wind, pulse), world.gust
    if model.gust_std != 0.0:
        normals = gaussian(Noise(rows.seed[0], GUSTS, world.tick, 1.0), 0)
        gust_now = gust(gust_now, model.gust_std, model.gust_tau_s, tick_s, normals)
        wind = add(wind, gust_now)
    if model.truth.drive.battery > 0.0:
        drawn = discharged(world.supply, rotors.rows[FORCE], count, model.truth, tick_s)
        world = with_field(world, "supply", drawn)
    plant, snap_speed = world.plant, 0.0
    while now_us < end_us:
        while ring[1] > 0 and commands[ring[0], 0] <= now_us:
            oldest_command = commands[ring[0]]
            for i in range(count):
                rotors.rows[COMMAND, i] = oldest_command[1 + i]
            ring[0] = (ring[0] + 1) % capacity
            ring[1] -= 1
        stop_us = end_us
        if ring[1] > 0 and commands[ring[0], 0] < stop_us:
            stop_us = int(commands[ring[0], 0])
        for sensor in range(SENSORS):
            stop_us = min(stop_us, rows.clock[sensor, DUE])
        h = (stop_us - now_us) / 1000000
        truth = current_truth(model, world)
        if chain is None:
            plant = advance(plant, truth, rotors, wind, h)
        else:
            plant = advance_chain(plant, truth, rotors, wind, h, chain)
        world = _with_winch(world, truth_after(_truth_with_cable(model, world), h))
        snap_speed = max(snap_speed, plant.snap_speed)
        now_us = stop_us
        measure(plant, now_us, model, rows)
    after = World(
        plant,
        world.tick + 1,
        end_us,
        gust_now,
        wind,
        world.cable_length,
        world.reel_rate,
        world.reel_accel,
        world.released,
        world.supply,
        snap_speed,
    )
    pack(after, rows.world, 0)


# ---- before the flight, and when parameters change

_NO_DRIFT = Drift(0.0, 1.0, 0.0)
_NO_DISTORTION = Room(0.0, 1.0)
_NOT_FITTED = (
    pose_tracker.PoseConfig(0.0, 0.0, 0.0, 0.0, _NO_DRIFT, _NO_DRIFT, _NO_DISTORTION),
    load_tracker.LoadConfig(0.0, 0.0, _NO_DRIFT, _NO_DRIFT, _NO_DISTORTION),
    cable_sensor.CableConfig(0.0, _NO_DRIFT, 0.0, 0.0),
    gnss.GnssConfig(ZERO, ZERO, ZERO, _NO_DRIFT, ZERO, _NO_DRIFT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    barometer.BarometerConfig(0.0, _NO_DRIFT),
    magnetometer.MagnetometerConfig(ZERO, 0.0, _NO_DRIFT),
)
_SENSOR_MODULES = (imu, pose_tracker, load_tracker, cable_sensor, gnss, barometer, magnetometer)
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
    profile = with_overrides(profile, settings.overrides)
    tick_s = settings.tick_us / SECOND_US
    inertial = profile.imu.config(tick_s, truth.gravity)
    values: list[Any] = [truth, imu.with_errors(inertial, truth.imu_position, settings.imu_axes)]
    for table, blank in zip(fitted_sensors(profile)[1:], _NOT_FITTED, strict=True):
        config = blank if table is None else table.config(tick_s)  # type: ignore[attr-defined]
        if isinstance(config, gnss.GnssConfig):
            config = config._replace(antenna=truth.antenna_position)
        values.append(config)
    values += [
        profile.imu.vibration(tick_s),
        0.0 if profile.magnetometer is None else profile.magnetometer.motor_field_gauss,
        settings.tick_us,
        settings.actuator_delay_us,
        settings.noise_scale,
        settings.wind,
        settings.gust_std,
        settings.gust_tau_s,
        settings.pulse,
        pulse_at_us,
        settings.pulse_for_us,
        settings.rotors_fail_at_us,
    ]
    return WorldModel(*values)


def delivery_table(profile: Profile, settings: Settings) -> Floats:
    """(sensors, 9) rate of each sensor, the losses of its readings, their additional delay, the error of
    their time stamps, and when the sensor fails and works again.

    The inertial unit is wired to the autopilot, so the losses of `settings` on the way do not affect it.
    """
    table_rows = np.zeros((SENSORS, 9))
    table_rows[:, [FAILS_AT, FAILS_UNTIL]] = np.inf
    for sensor, table in enumerate(fitted_sensors(with_overrides(profile, settings.overrides))):
        if table is None:
            continue
        row = table_rows[sensor]
        rate_hz, _, lead_us = _timing(table, settings)
        link_loss = 0.0 if sensor == IMU else settings.sensor_loss
        if settings.failed_sensors[sensor]:
            row[FAILS_AT], row[FAILS_UNTIL] = settings.sensors_fail_at_us, settings.sensors_work_at_us
        row[RATE], row[LOSS] = rate_hz, min(table.loss + link_loss, 1.0)
        period_us = nominal_us(rate_hz, settings.tick_us, lead_us, 1) + lead_us
        row[OUTAGE_CHANCE] = table.outages_per_min / 60.0 * period_us / SECOND_US
        row[OUTAGE_S] = table.outage_s
        if isinstance(table, Stamped):
            row[JITTER] = round(table.jitter_ms * 1000.0) if table.max_extra_delay_ms > 0.0 else 0.0
            row[JITTER_MAX] = round(table.max_extra_delay_ms * 1000.0)
            row[STAMP_OFFSET] = round(table.time_offset_ms * 1000.0) + settings.stamp_offset_us
    return table_rows


def command_capacity(settings: Settings) -> int:
    """Room for the commands that can be on their way."""
    return settings.actuator_delay_us // settings.tick_us + _SPARE


def new_world(
    truth: Truth, profile: Profile, settings: Settings, seed: int, layout: Layout = PLUS
) -> WorldRows:
    """The world before its first tick, its first readings taken."""
    model = model_of(truth, profile, settings, settings.pulse_at_us)
    configs = model[1 : 1 + SENSORS]
    clock = np.zeros((SENSORS, 9), dtype=np.int64)
    delivery = delivery_table(profile, settings)
    errors = np.zeros((SENSORS, _PHASES + MAX_ROTORS))
    capacity = _SPARE
    for sensor, (table, config) in enumerate(zip(fitted_sensors(profile), configs, strict=True)):
        clock[sensor, DUE] = _NEVER
        if table is None:
            continue
        rate_hz, latency_us, lead_us = _timing(table, settings)
        first_us, second_us = (nominal_us(rate_hz, settings.tick_us, lead_us, n) for n in (0, 1))
        initial_errors = _SENSOR_MODULES[sensor].start(
            config, Noise(seed, STREAMS[sensor], 0, settings.noise_scale)
        )
        pack(initial_errors, errors[sensor], 0)
        clock[sensor, FITTED] = 1
        clock[sensor, NOMINAL] = first_us
        clock[sensor, DUE] = max(first_us, 0)
        clock[sensor, LATENCY] = latency_us
        clock[sensor, LEAD] = lead_us
        latest_us = latency_us + int(delivery[sensor, JITTER_MAX])
        waiting = (latest_us + settings.tick_us) // max(second_us - first_us, 1)
        capacity = max(capacity, waiting + _SPARE)
    draw_phases(errors[IMU, _PHASES:], len(layout), Noise(seed, STREAMS[IMU], 0, settings.noise_scale))
    initial_world = World(
        plant=initial_state(truth),
        tick=0,
        now_us=0,
        gust=gaussian(Noise(seed, GUSTS, 0, settings.gust_std), 1),
        wind=settings.wind,
        cable_length=truth.cable_length,
        reel_rate=truth.reel_rate,
        reel_accel=truth.reel_accel,
        released=False,
        supply=FULL,
        snap_speed=0.0,
    )
    rows = WorldRows(
        packed(initial_world),
        packed(model),
        np.array([seed], dtype=np.int64),
        clock,
        delivery,
        errors,
        np.zeros((SENSORS, capacity, _COLUMNS)),
        np.zeros((command_capacity(settings), 1 + len(layout))),
        np.zeros(2, dtype=np.int64),
        rotors_at_rest(),
        rotor_table(layout, settings.rotor_shares(len(layout))),
    )
    measure(initial_world.plant, 0, model, rows)
    return rows


def _timing(table: Delivery, settings: Settings) -> tuple[float, int, int]:
    """(rate in Hz or 0 for one reading per tick, latency us, lead us) of a sensor.

    The link transmits no time of measurement for the inertial unit: it is read one latency before its tick.
    """
    latency_us = round(table.latency_ms * 1000.0) + settings.sensor_latency_us
    if isinstance(table, Sampled):
        return table.rate_hz, latency_us, 0
    return 0.0, latency_us, latency_us
