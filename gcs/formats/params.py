"""Parameter files: QGroundControl's .params, and the `NAME value` lines of MAVProxy and Mission Planner."""

from __future__ import annotations

from collections.abc import Mapping

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.operation import Target

QGC_ENDING = ".params"
_QGC_HEADER = """# Onboard parameters for Vehicle {system}
#
# Stack: PX4 Pro
# Vehicle: Multi-Rotor
#
# Vehicle-Id Component-Id Name Value Type
"""


def parameter_lines(values: Mapping[str, float]) -> str:
    """`NAME value` lines."""
    return "".join(f"{name:<16} {value:.9g}\n" for name, value in values.items())


def qgc_parameters(values: Mapping[str, float], target: Target) -> str:
    """QGroundControl's columns; every parameter is a REAL32."""
    rows = (
        f"{target.system}\t{target.component}\t{name}\t{value:.9g}\t{mavlink.MAV_PARAM_TYPE_REAL32}\n"
        for name, value in values.items()
    )
    return _QGC_HEADER.format(system=target.system) + "".join(rows)
