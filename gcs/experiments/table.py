"""The results as tables of one type, written as Markdown, as HTML or for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gcs.analysis.definitions import METRICS
from gcs.analysis.record import Record
from gcs.experiments.plan import CASE_NAMES, CASES, LAW_NAMES, VEHICLE_SHORT, VEHICLES
from gcs.experiments.results import ERROR_FUNCTIONS

if TYPE_CHECKING:
    from rich.table import Table as RichTable

NO_VALUE = "–"
_STEP = (("rise_time_90_s", 2), ("overshoot_pct", 1), ("settling_time_5pct_s", 2))
_LABELS = {
    "rise_time_90_s": "rise to 90 % (s)",
    "overshoot_pct": "overshoot (%)",
    "settling_time_5pct_s": "5 % settling (s)",
    "load_error_max_m": "maximum error (m)",
}
SYMBOLS = {
    "e_x": "e_x",
    "e_v": "e_v",
    "e_q": "e_q",
    "e_q_dot": "e_q̇",
    "e_R": "e_R",
    "e_Omega": "e_Ω",
    "psi_R": "Ψ_R",
    "psi_q": "Ψ_q",
}
_NAME_COLUMNS = ("case", "vehicle", "law")
_TEXT_COLUMNS = (*_NAME_COLUMNS, "outcome", "number")  # columns that hold no numbers


@dataclass(frozen=True)
class Table:
    """A table: a title, a note for the reader, and cells of text."""

    title: str
    note: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """The table as Markdown; the first columns contain names, the others numbers."""
        names = sum(cell in _TEXT_COLUMNS for cell in self.header)
        rule = ["---"] * names + ["---:"] * (len(self.header) - names)
        lines = [f"| {' | '.join(cells)} |" for cells in (self.header, rule, *self.rows)]
        return f"### {self.title}\n\n{self.note}\n\n" + "\n".join(lines) + "\n"

    def rich(self) -> RichTable:
        """The table for the terminal."""
        from rich.box import SIMPLE_HEAD
        from rich.table import Table as Rich
        from rich.text import Text

        table = Rich(box=SIMPLE_HEAD, title=self.title, title_justify="left", pad_edge=False)
        for cell in self.header:
            named = cell in _TEXT_COLUMNS
            table.add_column(cell, justify="left" if named else "right", no_wrap=True)
        for row in self.rows:
            table.add_row(*(Text(cell) for cell in row))
        return table


def tables(records: Sequence[Record]) -> tuple[Table, ...]:
    """All tables of the experiments, from the records of results.json."""
    return (
        step_table(records),
        error_table(records),
        decay_table(records),
        saturation_table(records),
        comparison_table(records),
    )


def step_table(records: Sequence[Record]) -> Table:
    """Case A: rise, overshoot, settling."""
    rows = tuple(
        (*_flight_names(r), *(_with_printed(r, name, decimals) for name, decimals in _STEP))
        for r in records
        if r["case"] == "case-a"
    )
    return Table(
        "Step response, Case A",
        "In brackets what the thesis prints, and our value minus that.",
        (*_NAME_COLUMNS, *(_LABELS[name] for name, _ in _STEP)),
        rows,
    )


def error_table(records: Sequence[Record]) -> Table:
    """Load position error of every flight."""
    keys = [f"load_error_{what}_{axis}_m" for what in ("max", "rms") for axis in "xyz"]
    rows = tuple(
        (
            *_flight_names(r),
            r["outcome"],
            _with_printed(r, "load_error_max_m", 3),
            *(_number(r[key], 3) for key in keys),
        )
        for r in records
    )
    return Table(
        "Load position error",
        "Metres, over the mission; of a flight that was lost, up to that moment. In brackets what the thesis"
        " prints, and our value minus that.",
        (
            *_NAME_COLUMNS,
            "outcome",
            "maximum",
            *(f"{what} {axis}" for what in ("max", "RMS") for axis in "xyz"),
        ),
        rows,
    )


def decay_table(records: Sequence[Record]) -> Table:
    """Error functions: whether they go to zero after the last motion of the reference, and how fast."""
    rows = tuple(
        (
            *_flight_names(r),
            _number(r["psi_R_max"], 4),
            _number(r["psi_q_max"], 4),
            *(_decay_text(r["error_functions"][name]) for name in ERROR_FUNCTIONS),
        )
        for r in records
    )
    return Table(
        "Error functions",
        "Greatest Ψ_R and Ψ_q; then, for each error function, whether it goes to zero (→ 0: at the end less"
        " than 2 % of its greatest) and the rate β in 1/s of the bound α e^(-β t) fitted from the last motion"
        f" of the reference on; {NO_VALUE}: nothing to fit above what telemetry resolves.",
        (*_NAME_COLUMNS, "max Ψ_R", "max Ψ_q", *(SYMBOLS[name] for name in ERROR_FUNCTIONS)),
        rows,
    )


def saturation_table(records: Sequence[Record]) -> Table:
    """Saturation and forces of the rotors, tilt, swing and slack events."""
    rows = tuple(
        (
            *_flight_names(r),
            _number(r["saturated_fraction"], 1, 100.0),
            _number(r["rotor_force_min_n"], 2),
            _number(r["rotor_force_max_n"], 2),
            _number(r["tilt_max_deg"], 1),
            _number(r["swing_max_deg"], 1),
            _number(r["slack_events"], 0),
        )
        for r in records
    )
    return Table(
        "Rotors, vehicle and cable",
        "Share of rotor commands that a limit cut; least and greatest force of a rotor; greatest tilt of the"
        " vehicle and swing of the cable; times the cable went slack.",
        (*_NAME_COLUMNS, "saturated (%)", "force min (N)", "max (N)", "tilt (°)", "swing (°)", "slack"),
        rows,
    )


def comparison_table(records: Sequence[Record]) -> Table:
    """NGC against LQR in every number that the thesis compares."""
    found = {(r["case"], r["vehicle"], r["law"]): r for r in records}
    rows = []
    for case in CASES:
        keys = _STEP if case == "case-a" else (("load_error_max_m", 3),)
        for vehicle in VEHICLES:
            ngc, lqr = found.get((case, vehicle, "thesis")), found.get((case, vehicle, "lqr"))
            if ngc is None or lqr is None:
                continue
            for key, decimals in keys:
                names = (CASE_NAMES[case], VEHICLE_SHORT[vehicle], _LABELS[key])
                both = (_final_text(ngc, key, decimals), _final_text(lqr, key, decimals))
                rows.append((*names, *both, better(ngc, lqr, key)))
    return Table(
        "NGC against LQR",
        "Every number by which the thesis compares them; less is better.",
        ("case", "vehicle", "number", "NGC", "LQR", "better"),
        tuple(rows),
    )


def better(ngc: Record, lqr: Record, key: str) -> str:
    """The law with the better number; a flight that was not completed is worse than any number."""
    sign = -1.0 if METRICS[key].better == "more" else 1.0

    def cost(record: Record) -> float:
        value = record[key]
        return float("inf") if value is None or record["outcome"] != "completed" else sign * float(value)

    if cost(ngc) == cost(lqr):
        return NO_VALUE
    return LAW_NAMES["thesis"] if cost(ngc) < cost(lqr) else LAW_NAMES["lqr"]


def markdown(records: Sequence[Record]) -> str:
    """All tables as Markdown, the content of table.md."""
    return "\n".join(table.markdown() for table in tables(records))


def _flight_names(record: Record) -> tuple[str, str, str]:
    return CASE_NAMES[record["case"]], VEHICLE_SHORT[record["vehicle"]], LAW_NAMES[record["law"]]


def _number(value: Any, decimals: int, scale: float = 1.0) -> str:
    return NO_VALUE if value is None else f"{value * scale:.{decimals}f}"


def _final_text(record: Record, key: str, decimals: int) -> str:
    lost = record["outcome"] != "completed"
    return str(record["outcome"]) if lost else _number(record[key], decimals)


def _with_printed(record: Record, key: str, decimals: int) -> str:
    """The value, and in brackets the printed one and the difference."""
    if record[key] is None and record["outcome"] != "completed":
        return str(record["outcome"])
    text = _number(record[key], decimals)
    if key not in record["printed"]:
        return text
    difference = record["difference"][key]
    deviation = NO_VALUE if difference is None else f"{difference:+.{decimals}f}"
    return f"{text} ({record['printed'][key]:g}; {deviation})"


def _decay_text(decay: Record) -> str:
    if decay["decays"] is None:
        return NO_VALUE
    return f"{'→ 0' if decay['decays'] else 'no'}, {_number(decay['rate_1_s'], 2)}"
