"""docs/paths.md and docs/thesis.md state how the shipped missions are shaped, as the autopilot shapes them.

To put the table into the page: python tests/documentation/test_paths.py
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from autopilot.trajectory.prepare import shaped_path
from autopilot.trajectory.rotor_demand import demand, rotor_commands
from autopilot.trajectory.shaping import ShapedSignals, path_jets
from gcs.experiments.marked_text import write_between
from gcs.workflows.vehicle_limits import load_limits
from missions.fileformat import load_mission
from missions.model import Signals

DOCS = Path(__file__).parents[2] / "docs"
BEGIN, END = "<!-- shaped: python tests/documentation/test_paths.py -->\n", "<!-- end of shaped -->"
SPACING_S = 1e-3
LIMITS = load_limits("bebop").shaping


def signals_of(mission: str) -> Signals:
    (step,) = [step for step in load_mission(mission).steps if isinstance(step, Signals)]
    return step


def without_early_rise(step: Signals) -> Signals:
    return replace(step, terms=tuple(replace(term, rise_90_by_s=None) for term in step.terms))


@cache
def shaped(step: Signals) -> ShapedSignals:
    result = shaped_path(step, LIMITS)
    assert result.problem == ""
    return result.path


def row(name: str, requested: str, step: Signals) -> str:
    """A row of the table."""
    path = shaped(step)
    if not len(path.pieces):
        return f"| {name} | {requested} | 0, flown as requested | |"
    times = np.arange(-path.lead_s, path.duration_s + path.tail_s, SPACING_S)
    commands = rotor_commands(demand(path_jets(path, times), LIMITS.body), SPACING_S, LIMITS.bounds.rotor_tau)
    distance = f"{1e3 * path.distance_m:.1f} mm"
    return f"| {name} | {requested} | {distance} | {commands.min():.2f} ... {commands.max():.2f} |"


def table() -> str:
    case_a = signals_of("case-a")
    (early,) = [term for term in case_a.terms if term.rise_90_by_s is not None]
    step = f"half-sine of {early.rise_s:g} s"
    rows = [
        row("`case-a`", f"{step}, nine tenths within {early.rise_90_by_s:g} s", case_a),
        row("`case-a` without `rise_90_by_s`", step, without_early_rise(case_a)),
        row("`case-b`", "", signals_of("case-b")),
        row("`case-b-extended`", "", signals_of("case-b-extended")),
        row("`case-c`", "", signals_of("case-c")),
    ]
    head = "| mission | requested | greatest distance | commands to rotors N |\n|---|---|---|---|\n"
    return f"\n{head}{chr(10).join(rows)}\n\n"


def test_the_table_of_paths_is_what_the_autopilot_makes() -> None:
    text = (DOCS / "paths.md").read_text(encoding="utf-8")
    assert f"{BEGIN}{table()}{END}" in text, f"run: python {Path(__file__).name}"


def test_the_page_of_the_thesis_says_how_far_case_a_is_led() -> None:
    distance = f"{1e3 * shaped(signals_of('case-a')).distance_m:.1f} mm"
    text = " ".join((DOCS / "thesis.md").read_text(encoding="utf-8").split())
    assert f"a vehicle that shapes its paths leads it by at most {distance}." in text


if __name__ == "__main__":
    write_between(DOCS / "paths.md", BEGIN, END, table())
