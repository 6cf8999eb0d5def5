# ruff: noqa: E501 paragraphs of the pages stand here as they stand there
"""README and docs/control.md state the figures of docs/figures.json, which `make figures` flies anew.

To put them into the pages: python tests/documentation/test_figures.py
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from gcs.experiments.marked_text import write_between
from gcs.workflows.check_mission import path_reports
from gcs.workflows.vehicle_limits import load_limits
from missions.fileformat import load_mission

ROOT = Path(__file__).parents[2]
RECORD: dict[str, Any] = json.loads((ROOT / "docs" / "figures.json").read_text(encoding="utf-8"))
SWEEP: dict[str, float] = RECORD["sweep"]
ERROR = "load_error_max_m"


def mm(*rows: str) -> str:
    """The worst load error of these rows in whole millimetres, rounded up so that "within" is true."""
    return str(math.ceil(1e3 * max(RECORD["rows"][row][ERROR] for row in rows) - 1e-9))


def real(*rows: str) -> str:
    """The same in the realistic world, and how many flights were lost there."""
    found = [RECORD["rows"][f"{row}, real"] for row in rows]
    home = [row[ERROR] for row in found if ERROR in row]
    lost = round(sum(row.get("lost", 0) for row in found))
    text = f"{math.ceil(1e3 * max(home) - 1e-9)} mm" if home else ""
    return text + (f"{'; ' if home else ''}{lost} of {len(rows) * RECORD['seeds']} lost" if lost else "")


def step_of(row: str) -> str:
    """The step response of a row, as in README."""
    found = RECORD["rows"][row]
    if "settling_time_5pct_s" not in found:
        return f"{round(found.get('lost', RECORD['seeds']))} of {RECORD['seeds']} lost"
    return (
        f"rise {figure(row, 'rise_time_90_s', 2)} s, overshoot {figure(row, 'overshoot_pct', 1)} %, "
        f"settled in {figure(row, 'settling_time_5pct_s', 2)} s"
    )


def figure(row: str, name: str, digits: int) -> str:
    return f"{RECORD['rows'][row][name]:.{digits}f}"


def readme() -> str:
    """What README says about the flights."""
    lead_s = path_reports(load_mission("case-a"), load_limits("bebop"))[-1].lead_s
    return f"""In each of {SWEEP["completed"]:,} flights the load stayed within {math.ceil(1e3 * SWEEP["error_100"])} mm of its path at up to 2 m/s, with the noise of motion capture,
motor lag and rotors that saturate (`gcs fly case-b --sensors lab`). The control law `plumbline` computes the derivatives of
its commands from model and mission, predicts the state over the known delay, and estimates the mass of the load and the
wind. Its gains are computed from the vehicle for a delay margin, and its paths are shaped to the limits of the rotors
before flight. The control law of the thesis, from which the project started, has an error of {mm("B lab, law thesis")} mm in the same flight.

| flight, worst of {RECORD["seeds"]} seeds (`make figures`) | clean world | realistic world |
|---|---|---|
| Case B, perfect sensors | {mm("B ideal")} mm | |
| Case B, motion capture, 12 ms delay and 30 ms motor lag | {mm("B lab 12/30 ms")} mm | {real("B lab 12/30 ms")} |
| Case B, 72 ms delay | {mm("B lab 72 ms")} mm | {real("B lab 72 ms")} |
| Case B, 72 ms delay assumed to be 62 ms; 82 ms | {mm("B lab 72, told 62")} mm; {mm("B lab 72, told 82")} mm | |
| Case C (a figure eight that travels 20 m), 12 ms and 30 ms | {mm("C lab 12/30 ms")} mm | {real("C lab 12/30 ms")} |
| Case C, load half or one and a half times as heavy as assumed | {mm("C lab load -50 %", "C lab load +50 %")} mm | {real("C lab load -50 %", "C lab load +50 %")} |
| Cases B and C outdoors: GNSS-RTK, magnetometer, barometer, camera | {mm("B rtk", "C rtk")} mm | {real("B rtk", "C rtk")} |
| Cases B and C outdoors with `heavy-real`, in a wind of 5 m/s with gusts of 1 m/s | | {real("B field heavy", "C field heavy")} |
| hovering in a gust of 5 m/s for 2 s | {mm("gust lab")} mm | {real("gust lab")} |
| Case A, a step of 0.25 m under true rotor limits | {step_of("A lab")} | {step_of("A lab, real")} |

The realistic world (`--vehicle bebop-real --sensors lab-real`, outdoors `field`, 12 ms delay) adds rotor drag and flapping,
ground effect, downwash, a cable attached off the centre of mass, a sagging battery, vibration, and late and missing
readings. The autopilot is not told about any of them. `heavy-real` is delivered with 35 % of the range of its rotors reserved
for control at either limit (`MIS_ROTOR_MARG`, 15 % for the others), and so flies Case C a little slower than the mission asks
for. [docs/realism.md](docs/realism.md) describes each effect.

The error is the distance between the true position of the load and the path that the mission asks for, from the end of the
lift to the start of the landing. {SWEEP["completed"]:,} of {SWEEP["flights"]:,} flights of Case B with motion capture, each with its own seed, were
completed (`gcs sweep case-b --seeds {SWEEP["flights"]}`): the median of their maximum errors is {1e3 * SWEEP["error_50"]:.1f} mm, the largest is {1e3 * SWEEP["error_100"]:.1f} mm.
[docs/robustness.md](docs/robustness.md) maps how much noise and delay the loop tolerates before a flight is lost.

For Case A the thesis prints a rise time of 0.61 s, 15 % overshoot and 1.26 s settling time, without rotor limits and with a
controller that does not know of the step in advance. Here the mission is known in advance, and the vehicle starts to tilt
{lead_s:.1f} s before the step.
"""


def control() -> str:
    """The table of docs/control.md."""
    told = f"{mm('B lab 72, told 62')} and {mm('B lab 72, told 82')} mm"
    heavy = f"{mm('C lab load -50 %')} and {mm('C lab load +50 %')} mm"
    step = (
        f"{mm('A lab')} mm; rise {figure('A lab', 'rise_time_90_s', 3)} s, "
        f"overshoot {figure('A lab', 'overshoot_pct', 1)} %, settled in "
        f"{figure('A lab', 'settling_time_5pct_s', 3)} s, "
        f"{math.ceil(1e3 * RECORD['rows']['A lab']['before_step_max_m'])} mm before the step begins"
    )
    return f"""| flight | set | worst load error of {RECORD["seeds"]} seeds |
|---|---|---|
| Case B | `ideal` sensors | {mm("B ideal")} mm |
| Case B | none | {mm("B lab")} mm |
| Case B | `SIM_ACT_DELAY_MS` 12, `SIM_ROTOR_TAU_MS` 30 | {mm("B lab 12/30 ms")} mm |
| Case B | `SIM_ACT_DELAY_MS` 72 | {mm("B lab 72 ms")} mm |
| Case B | 72 ms, `VEH_ACT_DELAY` 62 or 82 | {told} |
| Case B | `rtk` sensors | {mm("B rtk")} mm |
| Case C | `SIM_ACT_DELAY_MS` 12, `SIM_ROTOR_TAU_MS` 30 | {mm("C lab 12/30 ms")} mm |
| Case C | `SIM_LOAD_MASS` 0.05 or 0.15 | {heavy} |
| Case C | `rtk` sensors | {mm("C rtk")} mm |
| Case B | `SIM_WIND_E` 4 or 8 | {mm("B lab, wind 4")} and {mm("B lab, wind 8")} mm |
| hover | a gust of 5 m/s for 2 s | {mm("gust lab")} mm |
| Case A | none | {step} |
"""


def robustness() -> str:
    """What docs/robustness.md says about the vehicle as shipped."""
    median, most, nearly, worst = (
        f"{1e3 * SWEEP[f'error_{share}']:.1f} mm" for share in ("50", "99", "99.9", "100")
    )
    return f"""<!-- not run: minutes: {SWEEP["flights"]} flights -->
```sh
gcs sweep case-b --seeds {SWEEP["flights"]}
```

Case B, lab sensors, only the noise varied: {SWEEP["completed"]:,} of {SWEEP["flights"]:,} flights completed. The maximum load error of a
flight has a median of {median}; its 99th percentile is {most}, its 99.9th percentile {nearly}, and the largest {worst}.
"""


PAGES = {"README.md": readme, "docs/control.md": control, "docs/robustness.md": robustness}
BEGIN, END = "<!-- figures: make figures -->\n", "<!-- end of figures -->"


@pytest.mark.parametrize("page", PAGES)
def test_the_page_states_the_figures_that_were_flown(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert f"{BEGIN}{PAGES[page]()}{END}" in text, f"run: python {Path(__file__).name}"


if __name__ == "__main__":
    for name, made in PAGES.items():
        write_between(ROOT / name, BEGIN, END, made())
