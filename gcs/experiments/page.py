"""index.html: tables and figures on one page, for readers of the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from gcs.analysis.record import Record
from gcs.experiments.figures.catalogue import FIGURES, DrawnFigure
from gcs.experiments.plan import CASE_NAMES, CASES, VEHICLE_NAMES, VEHICLES, Experiment
from gcs.experiments.table import tables
from missions.fileformat import load_mission

PAGE_FILE = "index.html"

_TEMPLATE = "thesis.html"


def render_page(
    records: Sequence[Record], drawn: Sequence[DrawnFigure], folder: str, version: str, code: str
) -> str:
    """The page; it links pictures in `folder`, and reports at the locations given in the records."""
    from jinja2 import Environment

    source = files("gcs.experiments").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    return (
        Environment(autoescape=True)
        .from_string(source)
        .render(
            vehicles=[VEHICLE_NAMES[vehicle] for vehicle in VEHICLES],
            tables=tables(records),
            cases=[_case(case, records, drawn, folder) for case in CASES],
            version=version,
            code=code,
        )
    )


def _case(
    case: str, records: Sequence[Record], drawn: Sequence[DrawnFigure], folder: str
) -> dict[str, object]:
    mission = load_mission(case)
    # the idealised vehicle on the left, the true one on the right
    rows = []
    for figure in FIGURES:
        row = [
            {"href": f"{folder}/{d.file}", "caption": d.caption}
            for vehicle in VEHICLES
            for d in drawn
            if d.figure == figure and d.vehicle == vehicle and figure.case == case
        ]
        if row:
            rows.append(row)
    return {
        "id": case,
        "name": CASE_NAMES[case],
        "description": mission.description,
        "assumptions": mission.assumptions,
        "figures": rows,
        "flights": [
            {
                "href": f"{r['report_dir']}/report.html",
                "name": Experiment(case, r["law"], r["vehicle"]).title,
            }
            for r in records
            if r["case"] == case
        ],
    }
