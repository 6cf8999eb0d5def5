"""Every figure: its number in the thesis, its file, and which flights it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from gcs.experiments.figures import comparison, desired, errors, inputs, tracking
from gcs.experiments.figures.canvas import Scene
from gcs.experiments.plan import CASE_NAMES, VEHICLE_SHORT, VEHICLES

Draw = Callable[[str, Scene], Any]


class Figure(NamedTuple):
    """One figure of the thesis."""

    number: str  # "4-7", "A-2"
    slug: str
    case: str
    draw: Draw
    caption: str
    flown: bool = True  # one figure for each vehicle; else a desired path, the same for all

    @property
    def heading(self) -> str:
        return f"Figure {self.number}"

    def file(self, vehicle: str) -> str:
        """The file name, fig-4-07-tracking-case-a.png; it names the vehicle if that is not the thesis's."""
        chapter, _, count = self.number.partition("-")
        number = f"{chapter.lower()}-{int(count):02d}" if chapter.isdigit() else f"{chapter.lower()}-{count}"
        ending = "" if vehicle == VEHICLES[0] or not self.flown else f"-{vehicle}"
        return f"fig-{number}-{self.slug}-{self.case}{ending}.png"


class DrawnFigure(NamedTuple):
    """A figure that has been drawn into a file."""

    figure: Figure
    vehicle: str
    file: str

    @property
    def caption(self) -> str:
        words = f"Figure {self.figure.number}. {self.figure.caption}, {CASE_NAMES[self.figure.case]}"
        return f"{words} ({VEHICLE_SHORT[self.vehicle]} vehicle)" if self.figure.flown else words


def _tracking(number: str, case: str) -> Figure:
    return Figure(number, "tracking", case, tracking.tracking, "Load position tracking, NGC")


def _errors(number: str, case: str) -> Figure:
    return Figure(number, "errors", case, errors.error_functions, "Error functions, NGC")


def _psi(number: str, case: str) -> Figure:
    return Figure(
        number,
        "psi",
        case,
        errors.configuration_errors,
        "Tracking error functions Ψ_R and Ψ_q, NGC; below with the bound α e^(-β t) as fitted",
    )


def _comparison(number: str, case: str) -> Figure:
    text = "Load position and error; solid: NGC, dash-dot: LQR"
    return Figure(number, "comparison", case, comparison.position, text)


def _angles(number: str, case: str) -> Figure:
    text = "Vehicle and load angles; solid: NGC, dash-dot: LQR"
    return Figure(number, "angles", case, comparison.angles, text)


def _inputs(number: str, case: str) -> Figure:
    return Figure(number, "inputs", case, inputs.control_inputs, "Control inputs, NGC")


_PATH = "Desired load trajectory"
FIGURES: tuple[Figure, ...] = (
    Figure("4-1", "desired", "case-a", desired.step_path, _PATH, flown=False),
    Figure("4-2", "desired", "case-b", desired.product_path, _PATH, flown=False),
    Figure("4-3", "desired-position", "case-c", desired.position_in_space, "Desired load position", False),
    Figure("4-4", "desired", "case-c", desired.velocity_and_acceleration, _PATH, flown=False),
    _tracking("4-7", "case-a"),
    _errors("4-8", "case-a"),
    _psi("4-9", "case-a"),
    _comparison("4-10", "case-a"),
    Figure(
        "4-11",
        "percentage",
        "case-a",
        comparison.percentage,
        "Load position error percentage; solid: NGC, dash-dot: LQR",
    ),
    _angles("4-12", "case-a"),
    _tracking("4-13", "case-b"),
    _errors("4-14", "case-b"),
    _psi("4-15", "case-b"),
    _comparison("4-16", "case-b"),
    _angles("4-17", "case-b"),
    Figure("4-18", "desired", "case-b-extended", desired.product_path, _PATH, flown=False),
    _comparison("4-19", "case-b-extended"),
    _angles("4-20", "case-b-extended"),
    _tracking("4-21", "case-c"),
    _errors("4-22", "case-c"),
    _psi("4-23", "case-c"),
    _comparison("4-24", "case-c"),
    _angles("4-25", "case-c"),
    Figure("A-1", "signals", "case-c", desired.signals, "Signals for trajectory generation", flown=False),
    _inputs("A-2", "case-a"),
    _inputs("A-3", "case-b"),
    _inputs("A-4", "case-b-extended"),
    _inputs("A-5", "case-c"),
)


def figures_of(case: str, vehicle: str) -> Iterator[Figure]:
    """The figures that show this case flown by this vehicle; a desired path only with the first vehicle."""
    for figure in FIGURES:
        if figure.case == case and (figure.flown or vehicle == VEHICLES[0]):
            yield figure


def draw_figures(scene: Scene, directory: Path, drawn: Callable[[DrawnFigure], None]) -> None:
    """Draw the figures of this scene into `directory`; `drawn` is called with each."""
    from gcs.report.style import save, style

    directory.mkdir(parents=True, exist_ok=True)
    with style():
        for figure in figures_of(scene.case, scene.vehicle):
            file = figure.file(scene.vehicle)
            save(figure.draw(figure.heading, scene), directory / file)
            drawn(DrawnFigure(figure, scene.vehicle, file))
