"""`--set` of both programs: names of either are taken, those of neither are refused with the nearest one."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from autopilot.shell.command import main as autopilot
from autopilot.shell.setting_names import check_names
from sitl.shell.command import main as sitl

UNKNOWN = {
    "MPC_XY_VEL_MAXX": "did you mean MPC_XY_VEL_MAX?",
    "MPC_FOO": "there are MPC_MAN_Y_MAX, ",
    "SIM_WIND": "did you mean SIM_WIND_E, SIM_WIND_N or SIM_WIND_U?",
    "SIM_WINDE": "did you mean SIM_WIND_E?",
    "SIM_FOO": "there are SIM_ACC_ALIGN_X, ",
    "WPNAV_SPEED": "did you mean WNC_SPEED or MIS_SPEED?",
    "FOO": "names begin with one of BAT_, COM_, ",
}


@pytest.mark.parametrize("program", [sitl, autopilot], ids=["sitl", "autopilot"])
@pytest.mark.parametrize("name", UNKNOWN)
def test_a_name_of_neither_program_ends_in_wrong_usage(program: click.Command, name: str) -> None:
    result = CliRunner().invoke(program, ["--set", f"{name}=1"])
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.startswith(f"{program.name}: --set {name}: no such parameter; {UNKNOWN[name]}")
    assert result.stderr.count("\n") == 1


def test_names_of_either_program_and_what_somebody_brings_are_taken() -> None:
    settings = [("SIM_WIND_E", 3.0), ("MIS_SPEED", 1.0), ("NGC_KX", 1.0), ("SIM_LOSS_PCT", 1.0)]
    check_names(settings)
    check_names([*settings, ("MINE_K", 1.0)], ["MINE_K"])
    with pytest.raises(click.UsageError, match="MINE_K"):
        check_names([("MINE_K", 1.0)])
