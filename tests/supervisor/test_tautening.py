"""Wind that is too strong for a vehicle that pulls its cable taut: it lands instead of dragging its load."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from autopilot.geometry.linear import ZERO, Vec3, add, norm, scale, sub
from autopilot.services.requests import Arm
from autopilot.services.requests import Takeoff as TakeoffRequest
from autopilot.supervisor.advance import advance
from autopilot.supervisor.state import Flight, Phase, View, setpoint
from autopilot.supervisor.watches.failsafe import OUT_OF_CONTROL_US
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_EMERGENCY, MAV_SEVERITY_ERROR
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky, entered, view

LIMIT_M = SETTINGS.failsafe.load_error_limit_m
OUTWARD = (1.0, 0.0, 0.0)  # m/s
DRIFTS_AWAY = "Failsafe: drifts away while tautening the cable, "
CAUSES = ", landing; wind too strong, rotors too slow, or the vehicle differs from its file"


def tautening(legs: int) -> Flight:
    """A flight that has so many legs before it until its cable is taut."""
    flight = entered(Flight(), Phase.TAUTEN, view(), SETTINGS)
    return replace(flight, legs=flight.legs[-legs:])


def carried_off(flight: Flight, v_quad: Vec3, now_us: int = STEP_US, **changes: Any) -> View:
    """The vehicle is a little farther than FS_LOAD_ERR east of where it should be, and the load behind it."""
    jet = setpoint(flight, now_us)
    assert jet is not None
    x = add(jet[0], (LIMIT_M + 0.1, 0.0, 0.0))
    seen = view(now_us, x_quad=x, v_quad=add(jet[1], v_quad), x_load=(LIMIT_M + 0.1, 0.0, 0.02))
    return seen._replace(**changes)


def taking_off() -> Sky:
    sky = Sky()
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    return sky


@pytest.mark.parametrize("legs", [3, 2, 1])
def test_a_vehicle_that_is_carried_off_lands(legs: int) -> None:
    flight = tautening(legs)
    after, report = advance(flight, carried_off(flight, OUTWARD), SETTINGS)
    assert (after.phase, after.is_failsafe, after.mission.active) == (Phase.SET_DOWN, True, False)
    text = f"{DRIFTS_AWAY}vehicle 5.1 m off its path (FS_LOAD_ERR 5){CAUSES}"
    assert report.texts == ((MAV_SEVERITY_ERROR, text),)


@pytest.mark.parametrize(
    ("v_east", "changes"),
    [(-1.0, {}), (0.2, {}), (1.0, {"x_load": (LIMIT_M - 0.1, 0.0, 0.02)})],
    ids=["it comes back", "it hardly moves", "its load may hold it"],
)
def test_one_that_may_come_back_is_waited_for(v_east: float, changes: dict[str, Any]) -> None:
    flight = tautening(3)
    after, report = advance(flight, carried_off(flight, scale(v_east, OUTWARD), **changes), SETTINGS)
    assert (after, report.texts) == (flight, ())


def test_no_load_on_a_long_cable_is_relied_on_to_hold_it() -> None:
    flight, settings = tautening(3), replace(SETTINGS, cable_length_m=LIMIT_M + 1.0)
    after, _ = advance(flight, carried_off(flight, OUTWARD, x_load=(0.0, 0.0, 0.02)), settings)
    assert after.phase == Phase.SET_DOWN


def test_one_that_is_out_of_control_is_given_up() -> None:
    flight = tautening(3)
    for now_us in range(STEP_US, OUT_OF_CONTROL_US + STEP_US, STEP_US):
        seen = carried_off(flight, OUTWARD, now_us, tilt_rad=math.radians(76.0))
        flight, report = advance(flight, seen, SETTINGS)
        assert (flight.phase, report.texts) == (Phase.TAUTEN, ())
    now_us = STEP_US + OUT_OF_CONTROL_US
    seen = carried_off(flight, OUTWARD, now_us, tilt_rad=math.radians(76.0))
    after, report = advance(flight, seen, SETTINGS)
    assert after.phase == Phase.FAILSAFE
    text = "Flight given up: vehicle 5.1 m off its path (FS_LOAD_ERR 5), out of control"
    assert report.texts == ((MAV_SEVERITY_EMERGENCY, text),)


@pytest.mark.parametrize(("drag_m_s", "lands"), [(0.5, True), (0.2, True), (0.02, False)])
def test_one_that_follows_the_load_which_it_drags_along_lands(drag_m_s: float, lands: bool) -> None:
    """It is always near its setpoint, as this is moved over the load again and again. The load's velocity is
    not known where nothing tracks it."""
    sky = taking_off()
    ideal = sky.obey

    def dragged() -> View:
        v = scale(drag_m_s, OUTWARD)
        x = add((0.0, 0.0, 0.02), scale(sky.now_us * 1e-6, v))
        seen = ideal()
        return seen._replace(x_load=x, v_quad=add(seen.v_quad, v), taut=False, pull_n=0.0)

    sky.obey = dragged  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase not in (Phase.ARMED, Phase.TAUTEN))
    assert sky.flight.phase == Phase.SET_DOWN
    assert sky.texts[-1].startswith(f"{DRIFTS_AWAY}load dragged by ") == lands
    if lands:
        assert sky.texts[-1].endswith(f" m (FS_LOAD_ERR 5){CAUSES}")
        assert LIMIT_M < norm(sky.view.x_load) < 2.0 * LIMIT_M


@pytest.mark.parametrize("tilt_deg", [10.0, 41.0])
def test_wind_is_named_where_the_vehicle_leans_against_it(tilt_deg: float) -> None:
    sky = taking_off()
    ideal = sky.obey
    sky.obey = lambda: ideal()._replace(taut=False, tilt_rad=math.radians(tilt_deg))  # type: ignore[method-assign]
    sky.run(lambda s: s.flight.phase == Phase.SET_DOWN)
    causes = "check VEH_CABLE_LEN, VEH_LOAD_MASS and VEH_QUAD_MASS"
    if tilt_deg > 20.0:
        causes = f"too much wind (0.0 m off its path, tilted by 41 deg)? Else {causes}"
    assert sky.texts[-1] == f"Cable never taut, landing; {causes}"


def test_no_wind_is_blamed_where_a_level_vehicle_does_not_rise() -> None:
    sky = taking_off()
    ideal = sky.obey

    def held_down() -> View:
        seen = ideal()
        height = min(seen.x_quad[2], 0.8 * SETTINGS.cable_length_m)
        return seen._replace(x_quad=(*seen.x_quad[:2], height), taut=False, pull_n=0.0)

    sky.obey = held_down  # type: ignore[method-assign]
    lead_m = 4.0
    sky.settings = replace(SETTINGS, motion=replace(SETTINGS.motion, weight_lead_m=lead_m))
    sky.run(lambda s: s.flight.phase == Phase.SET_DOWN)
    assert sky.texts[-1] == "Cable never taut, landing; check VEH_CABLE_LEN, VEH_LOAD_MASS and VEH_QUAD_MASS"


@pytest.mark.parametrize(("beside", "moves_aside"), [(0.4, True), (0.8, False)])
def test_a_vehicle_beside_its_load_descends_where_it_is(beside: float, moves_aside: bool) -> None:
    """Wind that keeps it there would not let it move to the other side; `beside` in cable lengths."""
    length = SETTINGS.cable_length_m
    seen = view(x_quad=(beside * length, 0.0, 0.5 * length), v_quad=ZERO)
    flight = entered(Flight(), Phase.SET_DOWN, seen, SETTINGS)
    way = sub(flight.legs[-1].jet(0.0)[0], seen.x_quad)
    assert (norm((way[0], way[1], 0.0)) > 0.1 * length) == moves_aside
