"""Thrust curve, resolution and battery."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.vehicle.battery import (
    ELECTRONICS_W,
    Battery,
    drawn_current,
    open_voltage,
    source_voltage,
    terminal_voltage,
)
from sitl.plant.by_value import rotors_of
from sitl.plant.drive import (
    EXHAUSTED_SHARE,
    FULL,
    discharged,
    driven_force,
    is_driven,
    throttle_of,
    thrust_share,
)
from sitl.plant.records import Drive
from sitl.plant.rotors import TARGET, set_targets

SHARES = st.floats(0.0, 1.0)


@given(SHARES, SHARES)
def test_throttle_is_the_inverse_of_the_curve(share, curve):
    assert thrust_share(throttle_of(share, curve), curve) == pytest.approx(share, abs=1e-14)


@given(SHARES, SHARES)
def test_what_is_known_changes_nothing(share, curve):
    drive = Drive(thrust_curve=curve, known_curve=curve)
    assert driven_force(1.96 * share, 1.96, drive, 1.0) == pytest.approx(1.96 * share, abs=1e-14)


def test_a_curve_that_is_taken_for_another_gives_another_force():
    """Half of the greatest force, commanded to rotors that are assumed to be linear and are purely
    quadratic."""
    assert driven_force(1.0, 2.0, Drive(thrust_curve=1.0), 1.0) == 2.0 * 0.5**2


@given(st.floats(0.0, 2.0))
def test_resolution(force):
    """The force of a linear drive is never more than half a step away, and always on a step."""
    given_force = driven_force(force, 2.0, Drive(esc_steps=100.0), 1.0)
    assert abs(given_force - force) <= 0.5 * 2.0 / 100.0 + 1e-15
    assert given_force * 50.0 == pytest.approx(round(given_force * 50.0), abs=1e-12)


def test_force_falls_with_the_voltage_or_is_held_as_far_as_it_allows():
    falling = Drive(thrust_curve=1.0, known_curve=1.0, battery=1.0)
    assert driven_force(1.0, 2.0, falling, 0.9) == pytest.approx(0.81, abs=1e-14)
    held = falling._replace(speed_controlled=1.0)
    assert driven_force(1.0, 2.0, held, 0.9) == pytest.approx(1.0, abs=1e-14)
    assert driven_force(2.0, 2.0, held, 0.9) == pytest.approx(2.0 * 0.81, abs=1e-14)


def test_a_force_below_none_is_left_alone():
    assert driven_force(-0.3, 2.0, Drive(thrust_curve=1.0, esc_steps=10.0), 0.8) == -0.3


def test_rotors_without_limit_are_driven_by_nothing(thesis, bebop):
    drive = Drive(thrust_curve=1.0, battery=1.0, esc_steps=10.0)
    assert not is_driven(thesis._replace(drive=drive))
    assert not is_driven(bebop)
    assert not is_driven(bebop._replace(drive=Drive(thrust_curve=0.6, known_curve=0.6)))
    assert is_driven(bebop._replace(drive=drive))


def test_each_rotor_is_driven_within_its_own_limits(bebop):
    truth = bebop._replace(
        drive=Drive(thrust_curve=1.0, known_curve=1.0, battery=1.0, esc_steps=4.0), supply=0.5
    )
    rotors = rotors_of((0.0,) * 4, (0.0, 0.25 * 1.96, 1.96, 9.0))
    set_targets(rotors, truth)
    assert rotors.rows[TARGET, :4] == pytest.approx([0.0, 1.96 / 16.0, 1.96 / 4.0, 1.96 / 4.0], abs=1e-14)


def test_power_is_what_is_drawn_at_the_terminals():
    battery = Battery(4320.0, 3.0, 0.06, 15.0)
    open_v = source_voltage(1000.0, battery)
    current = drawn_current(4.0, open_v, battery)
    power = current * terminal_voltage(open_v, current, battery)
    assert power == pytest.approx(ELECTRONICS_W + 15.0 * 4.0, rel=1e-12)
    assert drawn_current(4.0, open_v, battery._replace(resistance=0.0)) == pytest.approx(
        (ELECTRONICS_W + 60.0) / (3.0 * open_voltage(1.0 - 1000.0 / 4320.0)), rel=1e-12
    )


@pytest.mark.parametrize(
    ("charge", "volts"), [(-1.0, 3.0), (0.0, 3.0), (0.2, 3.68), (0.35, 3.75), (1.0, 4.2), (2.0, 4.2)]
)
def test_voltage_of_a_cell(charge, volts):
    assert open_voltage(charge) == pytest.approx(volts, abs=1e-14)


def test_hover_empties_the_battery_in_the_time_that_its_power_says(bebop):
    """65 W of hover without the load and 3 W of electronics from 1200 mAh of 3 cells."""
    drive = Drive(battery=1.0, cells=3.0, capacity_as=1200.0 * 3.6, resistance=0.06, hover_w=65.0)
    truth = bebop._replace(drive=drive)
    rows = rotors_of((0.25 * truth.quad_mass * truth.gravity,) * 4, (0.0,) * 4).rows
    forces = rows[3]
    supply, energy, seconds = FULL, 0.0, 0
    while supply.used_as < (1.0 - EXHAUSTED_SHARE) * drive.capacity_as and seconds < 3600:
        supply = discharged(supply, forces, 4, truth, 1.0)
        energy += supply.current * supply.voltage
        assert supply.share == pytest.approx(supply.voltage / 12.6, rel=1e-12)
        seconds += 1
    assert energy / seconds == pytest.approx(68.0, rel=1e-9)
    assert 600 < seconds < 760
    half = discharged(FULL, forces, 4, truth._replace(drive=drive._replace(charge=0.5)), 1.0)
    assert half.voltage == pytest.approx(3.0 * 3.82 - 0.06 * half.current, rel=1e-12)


@pytest.mark.parametrize("resistance", [0.0, 0.06])
def test_an_empty_battery_gives_nothing(bebop, resistance):
    """It gives no more than its charge, and its voltage falls to 0 only with the last of it."""
    drive = Drive(battery=1.0, cells=3.0, capacity_as=180.0, resistance=resistance, hover_w=65.0)
    truth = bebop._replace(drive=drive)
    forces = rotors_of((0.25 * truth.quad_mass * truth.gravity,) * 4, (0.0,) * 4).rows[3]
    supplies = [FULL]
    for _ in range(60_000):
        supplies.append(discharged(supplies[-1], forces, 4, truth, 1e-3))
    end = supplies[-1]
    assert (end.current, end.voltage, end.share) == pytest.approx((0.0, 0.0, 0.0), abs=1e-2)
    assert end.used_as == pytest.approx(180.0, rel=1e-2)
    above = [supply for supply in supplies[1:] if supply.used_as < (1.0 - EXHAUSTED_SHARE) * 180.0]
    assert min(supply.voltage for supply in above) > 3.0 * 3.0 - resistance * 10.0


def test_a_short_circuit_is_not_a_number_error():
    """More power than the battery has is not drawn."""
    battery = Battery(4320.0, 3.0, 1.0, 1000.0)
    current = drawn_current(100.0, source_voltage(0.0, battery), battery)
    assert math.isfinite(current)
    assert current == pytest.approx(12.6 / 2.0, rel=1e-12)
