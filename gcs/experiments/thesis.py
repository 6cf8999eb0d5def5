"""`gcs experiments thesis`: reads the flights, and writes results, tables, figures and the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from gcs.analysis.record import Record
from gcs.experiments.figures.canvas import Scene
from gcs.experiments.figures.catalogue import DrawnFigure, draw_figures, figures_of
from gcs.experiments.flight import read_flight
from gcs.experiments.marked_text import write_between
from gcs.experiments.page import PAGE_FILE, render_page
from gcs.experiments.plan import CASES, LAWS, VEHICLES, Experiment, in_reading_order
from gcs.experiments.results import experiment_record, write_results
from gcs.experiments.table import markdown
from gcs.folders import RESULTS_FILE, check_no_other_results, make_folder

FLIGHTS = "flights"
FIGURES = "figures"
TABLE_FILE = "table.md"

# figures drawn, figures in total, the file drawn last
Progress = Callable[[int, int, str], None]


class Report(NamedTuple):
    """The content of the output directory."""

    records: tuple[Record, ...]
    drawn: tuple[DrawnFigure, ...]


def write_report(out: Path, code: str, progress: Progress) -> Report:
    """Read all flights in `out`/flights and write everything else in `out`."""
    scenes = [(case, vehicle) for case in CASES for vehicle in VEHICLES]
    total = sum(1 for case, vehicle in scenes for _ in figures_of(case, vehicle))
    records: list[Record] = []
    drawn: list[DrawnFigure] = []

    def on_drawn(figure: DrawnFigure) -> None:
        drawn.append(figure)
        progress(len(drawn), total, figure.file)

    progress(0, total, "")
    for case, vehicle in scenes:
        flights = {}
        for law in LAWS:
            experiment = Experiment(case, law, vehicle)
            flights[law] = read_flight(out / FLIGHTS / experiment.name, experiment)
            records.append(experiment_record(flights[law], f"{FLIGHTS}/{experiment.name}"))
        draw_figures(Scene(case, vehicle, *(flights[law] for law in LAWS)), out / FIGURES, on_drawn)
    ordered = tuple(sorted(records, key=_order))
    write_results(out / RESULTS_FILE, ordered)
    (out / TABLE_FILE).write_text(markdown(ordered), encoding="utf-8")
    page = render_page(ordered, drawn, FIGURES, version("plumbline"), code)
    (out / PAGE_FILE).write_text(page, encoding="utf-8")
    return Report(ordered, tuple(drawn))


def _order(record: Record) -> tuple[int, int, int]:
    return in_reading_order(Experiment(record["case"], record["law"], record["vehicle"]))


def make_output_directory(out: Path) -> None:
    """Create `out`; a GcsError says in one line why that is impossible."""
    check_no_other_results(out, RESULTS_FILE, (PAGE_FILE, TABLE_FILE))
    make_folder(out / FLIGHTS, out)


BEGIN, END = "<!-- results: begin -->\n", "<!-- results: end -->"
KEY_FIGURES = (
    "fig-4-07-tracking-case-a.png",
    "fig-4-09-psi-case-a.png",
    "fig-4-10-comparison-case-a.png",
    "fig-4-11-percentage-case-a.png",
    "fig-4-12-angles-case-a.png",
    "fig-4-16-comparison-case-b.png",
    "fig-4-19-comparison-case-b-extended.png",
    "fig-4-24-comparison-case-c.png",
    "fig-4-25-angles-case-c.png",
    "fig-4-24-comparison-case-c-bebop.png",
)
_COLOURS = 192  # of a line drawing: halves the file without a visible difference


def write_docs(page: Path, out: Path, records: Sequence[Record]) -> None:
    """Put the tables between the markers of `page`, and the key figures into images/thesis beside it."""
    from PIL import Image

    write_between(page, BEGIN, END, f"\n{markdown(records)}\n")
    images = page.parent / "images" / "thesis"
    images.mkdir(parents=True, exist_ok=True)
    for file in KEY_FIGURES:
        with Image.open(out / FIGURES / file) as picture:
            small = picture.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
            small.save(images / file, optimize=True)
