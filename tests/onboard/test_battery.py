"""Which battery is reported to the ground: the measured one while there is one, else that of the model."""

from __future__ import annotations

import pytest

from autopilot.supervisor.state import Phase
from autopilot.wire.codec import decode
from autopilot.wire.convert.battery import CHARGE_LEVELS, ChargeLevels, read_battery_status
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions, build_onboard, build_simulator
from tests.doubles.craft import ACCEPTED, Craft


def told(seconds, ends_at=None, texts=None, **settings):
    """The last BATTERY_STATUS of each second that the ground receives; from `ends_at` on none is measured.
    The texts are added to `texts`."""
    conditions = Conditions(settings=settings)
    onboard, simulator = build_onboard(conditions, Home()), build_simulator(conditions, Home())
    onboard.add_link("ground")
    found = {}
    for _ in range(seconds * 250 + 1):
        if ends_at is not None and simulator.now_us == ends_at * 1_000_000:
            simulator.parameters.table.set("SIM_BATTERY", 0.0)
            simulator.core.retune(
                simulator.core.truth._replace(drive=simulator.core.truth.drive._replace(battery=0.0)),
                simulator.core.settings,
            )
        answer = onboard.receive_sensors(simulator.sensor_datagram())
        for _, datagram in onboard.ground_datagrams():
            for one in decode(datagram)[0]:
                if texts is not None and one.message.get_msgId() == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                    texts.append(one.message.text)
                if one.message.get_msgId() == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
                    found[simulator.now_us // 1_000_000] = read_battery_status(one.message)
        simulator.receive(answer)
        simulator.advance()
    return found


def test_the_measured_battery_is_told():
    """Half empty, while the model assumes that it is full."""
    measured, model = told(2, SIM_BATTERY=1.0, SIM_BAT_CHARGE=50.0), told(2)
    assert 11.2 < measured[1].voltage < 3 * 3.82
    assert measured[1].remaining == 0.5
    assert (model[1].remaining, model[1].voltage > 12.5) == (1.0, True)


def test_a_battery_that_falls_silent_is_that_of_the_model_again():
    found = told(5, ends_at=1, SIM_BATTERY=1.0, SIM_BAT_CHARGE=50.0)
    assert [found[second].remaining for second in (1, 2, 4)] == [0.5, 0.5, 1.0]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 50.0}, []),
        ({"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 15.0}, ["Battery low, 15 % left"]),
        ({"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 5.0}, ["Battery empty, 5 % left: land at once"]),
        ({"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 7.0}, ["Battery nearly empty, 7 % left: land"]),
        ({"BAT_CAPACITY": 10.0, "BAT_HOVER_W": 1e5}, []),
    ],
)
def test_a_low_battery_is_told_once_if_it_is_measured(settings, said):
    texts = []
    told(3, texts=texts, **settings)
    assert [text for text in texts if "attery" in text] == said


# ---- a battery that is too empty to fly

ARM, FORCE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 21196.0
SENSOR = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


def with_charge(percent, **settings):
    """A craft whose measured battery has this charge, ready to fly otherwise."""
    craft = Craft(SIM_BATTERY=1.0, SIM_BAT_CHARGE=percent, **settings)
    craft.wait(1.5)
    return craft


@pytest.mark.parametrize("percent", [0.0, 5.0, 7.0])
def test_a_vehicle_whose_battery_is_empty_is_not_armed_but_by_force(percent):
    craft = with_charge(percent)
    moment = craft.onboard.log_sample().snapshot
    assert moment.sensors_present & SENSOR
    assert not moment.sensors_healthy & SENSOR
    assert not moment.sensors_healthy & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert craft.command(ARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert craft.texts[-1] == f"Arming denied: battery nearly empty, {percent:.0f} % left"
    assert craft.command(ARM, 1.0, FORCE) == ACCEPTED


def test_one_that_is_low_is_armed():
    craft = with_charge(8.0)
    assert craft.onboard.log_sample().snapshot.sensors_healthy & SENSOR
    assert craft.command(ARM, 1.0) == ACCEPTED


def test_a_battery_of_the_model_that_is_empty_prevents_nothing():
    """It is full when the program starts; nothing measures what is left of it."""
    craft = Craft(BAT_CAPACITY=10.0, BAT_HOVER_W=1e5)
    craft.wait(1.5)
    assert craft.command(ARM, 1.0) == ACCEPTED


def test_one_that_is_not_measured_any_more_is_not_known_to_be_empty():
    craft = with_charge(3.0)
    drive = craft.world.truth.drive._replace(battery=0.0)
    craft.world.retune(craft.world.truth._replace(drive=drive), craft.world.settings)
    assert craft.command(ARM, 1.0) == mavlink.MAV_RESULT_DENIED
    craft.wait(2.5)
    assert craft.command(ARM, 1.0) == ACCEPTED


def test_levels_and_action_are_parameters():
    """The flight of 100 mAh ends on the ground before its battery does."""
    levels = {"BAT_LOW_THR": 0.8, "BAT_CRIT_THR": 0.7, "BAT_EMERGEN_THR": 0.6}
    craft = with_charge(65.0)
    moment = craft.onboard.log_sample().snapshot
    assert moment.sensors_healthy & SENSOR and moment.charge_levels == CHARGE_LEVELS
    craft = with_charge(100.0, SIM_BAT_CAP=100.0, COM_LOW_BAT_ACT=2.0, **levels)
    assert craft.onboard.log_sample().snapshot.charge_levels == ChargeLevels(0.8, 0.7, 0.6)
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, float("nan"), 0, 0, 1.5) == ACCEPTED
    assert craft.command(ARM, 1.0) == ACCEPTED
    craft.run(lambda craft: craft.flight.phase == Phase.DISARMED)
    told = [text for text in craft.texts if "attery" in text]
    assert told == [
        "Battery low, 80 % left",
        "Failsafe: battery nearly empty, 70 % left, landing",
        "Battery empty, 60 % left: land at once",
    ]
    # it used a third of the charge on the way, and is not armed again
    assert craft.command(ARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert "battery nearly empty" in craft.texts[-1]


def test_a_flight_that_its_battery_ends_names_it():
    craft = with_charge(100.0, SIM_BAT_CAP=30.0)
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, float("nan"), 0, 0, 1.5) == ACCEPTED
    assert craft.command(ARM, 1.0) == ACCEPTED
    craft.heard.clear()
    craft.run(lambda craft: craft.flight.phase == Phase.DISARMED or craft.flight.is_failsafe)
    told = "".join(craft.texts)
    assert "rotors 1, 2, 3, 4 lost, the others cannot fly it (battery nearly empty)" in told
