"""The world in its rows: no state is kept beside them; winch and gripper act as their rows say."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.geometry.packed import unpack
from sitl.plant.winch import MAX_ACCEL
from sitl.world import World, WorldRows, world_tick

G = 9.81
FORCES = (2.0, 2.0, 2.0, 2.0)
TICK_S = 0.004
# free fall is a polynomial of degree two, which the integrator computes exactly except for roundings of 50 m
ROUNDING = 1e-11
ROUGH = {
    "SIM_ACT_DELAY_MS": 13.0,
    "SIM_SENS_LAT_MS": 7.0,
    "SIM_DROP_PCT": 10.0,
    "SIM_GUST_STD": 1.0,
    "SIM_NOISE_SCALE": 2.0,
}


def world_of(rows: WorldRows) -> World:
    return unpack(World, rows.world, 0)


def tick(rows: WorldRows, forces: tuple[float, ...], gripper_open: bool, reel_rate: float) -> None:
    """Call it as the simulator does, so that it need not be compiled again for other types."""
    world_tick(rows, np.array(forces), gripper_open, reel_rate, None)


def shaken(rows: WorldRows, ticks: range) -> None:
    """Fly with forces that change at every tick; the winch pays out, later the gripper opens."""
    for k in ticks:
        forces = (1.5 + 0.2 * np.sin(0.3 * k), 1.5 + 0.2 * np.sin(0.5 * k), 1.5, 1.5 + 0.2 * np.cos(0.7 * k))
        tick(rows, forces, k >= 250, 0.2 if k >= 50 else 0.0)


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_all_that_is_carried_lies_in_the_rows(core, sensors: str) -> None:
    rows = core(sensors, vehicle="bebop", **ROUGH).rows
    shaken(rows, range(100))
    before = WorldRows(*(np.copy(array) for array in rows))
    copy = WorldRows(*(np.copy(array) for array in rows))
    shaken(rows, range(100, 300))
    # what the first flight left behind anywhere else would show in the second
    shaken(copy, range(100, 300))
    for name, found, expected in zip(WorldRows._fields, copy, rows, strict=True):
        assert np.array_equal(found, expected, equal_nan=True), name
    changed = {
        name
        for name in WorldRows._fields
        if not np.array_equal(getattr(before, name), getattr(rows, name), equal_nan=True)
    }
    assert changed == set(WorldRows._fields) - {"model", "seed", "delivery", "rotor_table"}


def test_a_load_hangs_on_the_cable_as_the_winch_has_it_and_falls_free_of_the_gripper(core_in_the_air) -> None:
    rows = core_in_the_air().rows
    ticks = 0
    while world_of(rows).plant.taut == 0.0:
        tick(rows, FORCES, False, 0.0)
        ticks += 1
        assert ticks < 100, "the cable never came taut"
    reeled = 100
    for _ in range(reeled):
        tick(rows, FORCES, False, 0.2)
    world = world_of(rows)
    # while the drum accelerates, its time counts half
    length = 0.7 + 0.2 * (reeled * TICK_S - 0.5 * 0.2 / MAX_ACCEL)
    assert world.cable_length == pytest.approx(length, abs=1e-13)
    assert world.reel_rate == pytest.approx(0.2, abs=1e-15)
    plant = world.plant
    assert plant.taut == 1.0
    assert np.linalg.norm(np.subtract(plant.x_load, plant.x_quad)) == pytest.approx(length, abs=1e-9)

    fallen = 40
    for _ in range(fallen):
        tick(rows, FORCES, True, 0.2)
    after, t = world_of(rows), fallen * TICK_S
    assert after.released
    assert after.plant.tension == 0.0
    # nothing hangs on the cable: the drum stops, as fast as it accelerated
    assert after.cable_length == pytest.approx(length + 0.5 * 0.2**2 / MAX_ACCEL, abs=1e-13)
    assert after.reel_rate == 0.0
    expected = np.add(plant.x_load, np.multiply(plant.v_load, t)) - (0.0, 0.0, 0.5 * G * t * t)
    assert after.plant.x_load == pytest.approx(expected, abs=ROUNDING)
    tick(rows, FORCES, False, 0.0)
    assert world_of(rows).released, "taken hold of from afar"
