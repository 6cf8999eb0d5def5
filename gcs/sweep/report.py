"""report.html of a sweep: what was flown, maps and curves, and the limits of each parameter."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

from autopilot.own.own_code import parameters_for
from autopilot.shell.atomic_file import write_atomically
from autopilot.vehicle.file import load_belief
from autopilot.wire.parameter_table import Parameter, ParameterTable
from gcs.analysis.axes import Floats
from gcs.analysis.definitions import METRICS, UNKNOWN
from gcs.folders import PAGE_FILE, REPEATS_FOLDER
from gcs.sweep.margin import linear_range
from gcs.sweep.plan import SweepPlan
from gcs.sweep.plan_file import load_command
from gcs.sweep.plan_values import seeds_text
from gcs.sweep.plots import draw_curve, draw_map, pooled_text
from gcs.sweep.results import (
    STEP_FIGURES,
    Cells,
    Flights,
    cells,
    completion_range,
    flights_by_law,
    interval_text,
)
from gcs.sweep.standouts import Standout, base_command, repeat_command, stored_standouts
from gcs.sweep.store import Store
from gcs.web.page import render
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import load_truth

_TEMPLATE = "sweep.html"
_MAX_PAIRS = 10
_SCRIPTS = ("sweep.js",)
_STYLES = ("page.css", "sweep.css")


def write_report(directory: Path, plan: SweepPlan) -> Path:
    """Write pictures and page from the stored flights; return the page's path."""
    laws = [flights for flights in flights_by_law(Store(directory, plan).read(), plan) if flights.outcome]
    tables = _tables(plan)
    units = {v.name: _parameter(tables, v.name).unit for v in plan.varied}
    names = [v.name for v in plan.varied if len(set(v.values)) > 1]
    curves, maps = [], []
    for name in names if laws else []:
        picture = directory / f"curve-{name.lower()}.png"
        draw_curve(picture, laws, plan, name, units)
        curves.append(_picture(picture, f"{name}{pooled_text(plan, (name,))}"))
    for pair in list(combinations(names, 2))[:_MAX_PAIRS]:
        for flights in laws:
            picture = directory / f"map-{flights.law}-{pair[0].lower()}-{pair[1].lower()}.png"
            draw_map(picture, flights, plan, pair, units)
            maps.append(_map(flights, plan, pair, units))
    if len(names) == 1:
        maps = [_map(flights, plan, (names[0],), units) for flights in laws]
    command, version = load_command(directory)
    page = directory / PAGE_FILE
    text = render(
        "gcs.sweep",
        _TEMPLATE,
        _SCRIPTS,
        _STYLES,
        {"maps": maps},
        title=plan.mission,
        plan=plan,
        seeds=seeds if ":" in (seeds := seeds_text(plan.seeds)) or "," in seeds else "",
        command=command,
        version=version,
        flown=sum(len(flights.outcome) for flights in laws),
        laws=[_law(flights) for flights in laws],
        step_names=_step_names() if any(flights.are_steps for flights in laws) else (),
        standouts=[_standout_row(plan, one, directory) for one in stored_standouts(directory, plan)],
        reaches=margins(plan, laws, tables),
        curves=curves,
        maps=maps,
    )
    write_atomically(page, text.encode())
    return page


def _standout_row(plan: SweepPlan, flight: Standout, directory: Path) -> dict[str, Any]:
    """A row of the page; `page` is the path of the report, None unless the flight was flown again."""
    page = f"{REPEATS_FOLDER}/{flight.name}/report.html"
    return {
        "flight": flight,
        "command": repeat_command(plan, flight, directory),
        "page": page if (directory / page).is_file() else None,
    }


def _map(flights: Flights, plan: SweepPlan, names: tuple[str, ...], units: dict[str, str]) -> dict[str, Any]:
    """A map for `sweep.js`: cells in the order of the first parameter, then the second."""
    found = cells(flights, plan, names)
    rows = found.shown.ravel().tolist()
    values = plan.known_to(flights.reference, plan.with_followers(flights.values))
    return {
        "base": base_command(plan, flights.reference),
        "law": flights.law,
        "reference": flights.reference,
        "names": names,
        "units": [units[name] for name in names],
        "axes": [axis.tolist() for axis in found.axes],
        "flown": found.flown.ravel().tolist(),
        "completed": _json_numbers(100.0 * found.success.ravel()),
        "interval": [
            interval_text(round(share * flown), round(flown)) if flown else ""
            for share, flown in zip(found.success.ravel(), found.flown.ravel(), strict=True)
        ],
        "median": _json_numbers(1e3 * found.error_median_m.ravel()),
        "worst": _json_numbers(1e3 * found.error_worst_m.ravel()),
        "steps": _step_maps(found) if flights.are_steps else [],
        "varied": list(values),
        "shown": [_flight_record(flights, values, row) if row >= 0 else None for row in rows],
    }


def _step_maps(found: Cells) -> list[dict[str, Any]]:
    """The medians of the step response, in the order of a map's cells."""
    maps = []
    for name, values in found.step_medians.items():
        metric = METRICS[name]
        maps.append(
            {"name": metric.label.lower(), "unit": metric.unit, "values": _json_numbers(values.ravel())}
        )
    return maps


def _flight_record(flights: Flights, varied: Mapping[str, Floats], row: int) -> dict[str, Any]:
    return {
        "index": int(flights.index[row]),
        "seed": int(flights.seed[row]),
        "outcome": flights.outcome[row],
        "values": [repr(float(values[row])) for values in varied.values()],
    }


def _json_numbers(values: Floats) -> list[float | None]:
    return [float(f"{value:.5g}") if math.isfinite(value) else None for value in values]


def margins(plan: SweepPlan, laws: list[Flights], tables: tuple[ParameterTable, ...]) -> list[dict[str, str]]:
    """For each law and varied parameter: the ranges in which flights complete, and that of linear theory."""
    rows = []
    for flights in laws:
        planned = plan.flights // len(plan.laws)
        if_none = "nowhere" if len(flights.outcome) == planned else "not known yet"
        for varied in plan.varied:
            parameter = _parameter(tables, varied.name)
            nominal, unit = parameter.default, parameter.unit
            values = flights.values[varied.name]
            found = completion_range(flights, plan, varied.name, nominal)
            low, high = min(*varied.values, nominal), max(*varied.values, nominal)
            limits = (max(parameter.low, low), min(parameter.high, high))
            rows.append(
                {
                    "law": flights.law,
                    "name": varied.name,
                    "unit": unit,
                    "nominal": f"{nominal:.4g}",
                    "every": _range(found.all_from, found.all_to, if_none),
                    "some": _range(found.some_from, found.some_to, if_none),
                    "flown": _range(float(values.min()), float(values.max())),
                    "linear": linear_range(plan, flights.reference, varied.name, nominal, limits),
                }
            )
    return rows


def _range(low: float, high: float, if_none: str = "") -> str:
    if math.isnan(low):
        return if_none
    return f"{low:.4g}" if low == high else f"{low:.4g} … {high:.4g}"


def _law(flights: Flights) -> dict[str, Any]:
    outcomes = Counter(flights.outcome)
    phases = Counter(phase for phase in flights.lost_phase if phase)
    worst = max((e for e in flights.error_m[flights.completed] if math.isfinite(e)), default=math.nan)
    return {
        "name": flights.law,
        "flights": len(flights.outcome),
        "share": f"{100.0 * outcomes['completed'] / len(flights.outcome):.1f}",
        "interval": interval_text(outcomes["completed"], len(flights.outcome)),
        "ends": ", ".join(f"{name} {n}" for name, n in outcomes.most_common()),
        "phases": ", ".join(f"{name} {n}" for name, n in phases.most_common()) or UNKNOWN,
        "worst": f"{1e3 * worst:.1f}" if math.isfinite(worst) else UNKNOWN,
        "steps": _step_medians(flights),
    }


def _step_names() -> list[str]:
    """The headings of the medians of the step response."""
    metrics = [METRICS[name] for name in STEP_FIGURES]
    return [f"{metric.label.lower()}, median ({metric.unit})" for metric in metrics]


def _step_medians(flights: Flights) -> list[str]:
    values = [(METRICS[name], flights.median(name)) for name in STEP_FIGURES]
    return [f"{v:.{metric.decimals}f}" if math.isfinite(v) else UNKNOWN for metric, v in values]


def _tables(plan: SweepPlan) -> tuple[ParameterTable, ...]:
    """Parameter tables of the simulator, and of the autopilot with each law."""
    belief = load_belief(plan.vehicle)
    kinds = dict.fromkeys((plan.own(law), plan.foreign_to(law)) for law in plan.laws)
    tables = (parameters_for(belief, own, ignored=foreign) for own, foreign in kinds)
    return (sim_parameters(load_truth(plan.vehicle)), *tables)


def _parameter(tables: tuple[ParameterTable, ...], name: str) -> Parameter:
    return next(table for table in tables if name in table).describe(name)


def _picture(path: Path, caption: str) -> dict[str, str]:
    return {"data": base64.b64encode(path.read_bytes()).decode(), "caption": caption}
