"""The copy of the simulator's parameters in the autopilot's table."""

from __future__ import annotations

from autopilot.onboard.simulator_parameters import SimulatorParameters
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as mavlink


def reported(value: float) -> mavlink.MAVLink_param_value_message:
    message = mavlink.MAVLink_param_value_message(b"SIM_WIND_E", value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
    message.param_id = "SIM_WIND_E"
    return message


def sent(parameters: SimulatorParameters, now_us: int) -> list[float]:
    return [m.param_value for m in parameters.messages(now_us) if m.get_type() == "PARAM_SET"]


def test_a_value_that_follows_another_before_its_answer_is_set_too() -> None:
    table = autopilot_parameters(load_belief("bebop"))
    parameters = SimulatorParameters(table)
    parameters.receive(reported(0.0))
    parameters.request("SIM_WIND_E", 1.0)
    assert sent(parameters, 0) == [1.0]
    parameters.request("SIM_WIND_E", 3.0)
    parameters.receive(reported(1.0))  # answers the first
    assert parameters.unanswered == {"SIM_WIND_E": 3.0}
    assert sent(parameters, 4000) == [3.0]
    parameters.receive(reported(3.0))
    assert (parameters.unanswered, table["SIM_WIND_E"]) == ({}, 3.0)
