"""Which battery is reported to the ground: the measured one while there is one, else that of the model."""

from __future__ import annotations

import pytest

from autopilot.wire.codec import decode
from autopilot.wire.convert.battery import read_battery_status
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions, build_onboard, build_simulator


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
        ({"SIM_BATTERY": 1.0, "SIM_BAT_CHARGE": 5.0}, ["Battery nearly empty, 5 % left: land"]),
        ({"BAT_CAPACITY": 10.0, "BAT_HOVER_W": 1e5}, []),
    ],
)
def test_a_low_battery_is_told_once_if_it_is_measured(settings, said):
    texts = []
    told(3, texts=texts, **settings)
    assert [text for text in texts if "attery" in text] == said
