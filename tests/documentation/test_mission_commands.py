"""docs/mission-items.md: its table of mission commands is the one by which the autopilot reads items.

To write the table anew: python tests/documentation/test_mission_commands.py > part, and put it in the page.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import get_args

import pytest

from autopilot.wire.command_names import command_name
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import COMMANDS, Command, Handling, handling_of
from missions.model import Sine, Step, Term, Trajectory, TrajectoryPoint

PAGE = Path(__file__).parents[2] / "docs" / "mission-items.md"
HEAD = "| command | parameters | |\n|---|---|---|\n"
WORDS = {Handling.FLOWN: "", Handling.KEPT: "kept: ", Handling.REFUSED: "refused: "}
OTHERS = (
    f"| all others up to {mavlink.MAV_CMD_NAV_LAST} | | refused: the user expects to be flown there |\n"
    f"| all others above {mavlink.MAV_CMD_NAV_LAST} that MAVLink defines "
    "(camera, gimbal ...) | | kept: nothing is flown, a text names them |\n"
    "| what is no command of MAVLink | | refused |\n"
)


def rows() -> str:
    """The table; adjacent commands with the same cells share a row."""
    lines = [
        f"| {', '.join(f'{command_name(row.number)} {row.number}' for row in same)} | {cells}\n"
        for cells, same in groupby(COMMANDS, cells_of)
    ]
    return HEAD + "".join(lines) + OTHERS


def cells_of(row: Command) -> str:
    return f"{'; '.join(field.describe() for field in row.fields)} | {WORDS[row.handling]}{row.text} |"


def test_the_page_has_the_table_of_the_program() -> None:
    assert rows() in PAGE.read_text(encoding="utf-8"), f"run: python {Path(__file__).name}"


def test_every_command_has_one_row_and_every_record_is_written_by_one() -> None:
    numbers = [row.number for row in COMMANDS]
    assert len(set(numbers)) == len(numbers)
    records = [row.record_type for row in COMMANDS if row.is_default]
    assert set(records) == {*get_args(Step), Term, Sine, TrajectoryPoint} - {Trajectory}
    assert len(records) == len(set(records))


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (mavlink.MAV_CMD_NAV_WAYPOINT, Handling.FLOWN),
        (mavlink.MAV_CMD_DO_JUMP, Handling.FLOWN),
        (mavlink.MAV_CMD_DO_JUMP_TAG, Handling.FLOWN),
        (mavlink.MAV_CMD_JUMP_TAG, Handling.FLOWN),
        (mavlink.MAV_CMD_NAV_ROI, Handling.FLOWN),
        (mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, Handling.REFUSED),
        (mavlink.MAV_CMD_NAV_LAST, Handling.REFUSED),
        (mavlink.MAV_CMD_NAV_LAST + 1, Handling.REFUSED),
        (31998, Handling.REFUSED),
        (mavlink.MAV_CMD_DO_PARACHUTE, Handling.REFUSED),
        (mavlink.MAV_CMD_DO_FENCE_ENABLE, Handling.FLOWN),
        (mavlink.MAV_CMD_DO_GUIDED_LIMITS, Handling.REFUSED),
        (mavlink.MAV_CMD_WAYPOINT_USER_5, Handling.REFUSED),
        (mavlink.MAV_CMD_DO_LAND_START, Handling.KEPT),
        (mavlink.MAV_CMD_IMAGE_START_CAPTURE, Handling.KEPT),
    ],
)
def test_what_becomes_of_a_command(command: int, expected: Handling) -> None:
    assert handling_of(command) is expected


if __name__ == "__main__":
    print(rows(), end="")
