"""A machine too slow for real time: the simulator counts what came too late, and arming is refused."""

from __future__ import annotations

from typing import Any

from autopilot.onboard.punctuality import Punctuality
from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from tests.doubles.craft import Craft

SECOND_US, TICKS = 1_000_000, 250


def status(second: int, missed: int) -> Any:
    return mavlink.MAVLink_sim_status_message(second * SECOND_US, 1.0, 250.0, 0, 0, 0, missed, 0, 0)


def test_a_second_in_which_many_commands_were_missed_is_complained_of() -> None:
    punctuality = Punctuality()
    complaints = []
    for second, missed in enumerate((900, 902, 905, 930, 930)):
        said = punctuality.arming_problems(status(second, missed), second * TICKS)
        complaints.append([text.split(";")[0] for text in said])
    text = "machine too slow: {} of 250 commands came too late in the last second"
    assert complaints == [[], [], [text.format(3)], [text.format(25)], []]


def test_a_simulator_that_starts_again_counts_anew() -> None:
    punctuality = Punctuality()
    punctuality.arming_problems(status(9, 50), 9 * TICKS)
    assert punctuality.arming_problems(status(0, 0), 0) == ()


def test_the_vehicle_is_not_armed_while_the_machine_is_too_slow() -> None:
    craft = Craft()
    craft.wait(1.0)
    for second, missed in enumerate((0, 40), start=1):
        told = FrameWriter(1, 26).frame(status(second, missed))
        answer = craft.onboard.receive_sensors(told + craft.simulator.sensor_datagram())
        assert craft.simulator.receive(answer)
        craft.simulator.advance()
        craft.wait(1.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert any("machine too slow: 40 of" in text for text in craft.texts)
