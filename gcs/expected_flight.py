"""How long a flight should take, and how long it may take, with the autopilot's parameters."""

from __future__ import annotations

from autopilot.trajectory.timeline import TimelineEntry, VerticalSpeeds, expected_timeline
from autopilot.wire.parameter_table import ParameterTable
from missions.model import Mission

TIME_FACTOR = 1.5  # a flight may take this many times the expected time,
TIME_MARGIN_S = 60.0  # plus this margin


def expected_flight_s(mission: Mission, table: ParameterTable) -> float:
    """Expected seconds from arming to the end of the mission, by the autopilot's parameters."""
    return sum(entry.duration_s for entry in expected_entries(mission, table))


def expected_entries(mission: Mission, table: ParameterTable) -> tuple[TimelineEntry, ...]:
    """The steps with their expected durations, by the autopilot's parameters."""
    tauten_m_s = min(table["MIS_TAUT_SPEED"], table["MIS_SNAP_SPEED"])
    return expected_timeline(
        mission,
        table["MIS_SPEED"],
        table["MIS_ACCEL"],
        table["VEH_CABLE_LEN"],
        VerticalSpeeds(tauten_m_s, table["MIS_LIFT_SPEED"], table["MPC_Z_V_AUTO_DN"]),
    )


def limit_text(limit_s: float) -> str:
    """A time limit as displayed: a short one with its decimals."""
    return f"{limit_s:.0f} s" if limit_s >= 10.0 else f"{limit_s:g} s"


def time_limit_s(expected_s: float, limit_s: float | None = None) -> float:
    """The longest time (s) that a flight may take: `limit_s` if it is given."""
    return expected_s * TIME_FACTOR + TIME_MARGIN_S if limit_s is None else limit_s
