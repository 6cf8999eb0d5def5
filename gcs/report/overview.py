"""Many flights in a terminal too narrow for a column for each: a row for each, with the main figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from gcs.report.compare import Run, cell, differences, figures, given_conditions, given_settings, heading

if TYPE_CHECKING:
    from rich.table import Table

# titles of narrow columns by the names of metrics, the most important first
_MAIN = {
    "outcome": "outcome",
    "load_error_rms_m": "error RMS",
    "load_error_max_m": "error max",
}
_MORE = {
    "swing_max_deg": "swing max",
    "tilt_max_deg": "tilt max",
    "saturated_fraction": "saturated",
    "mission_s": "mission",
    "estimator_error_max_m": "estimate max",
}
_MAX_VALUE_CHARS = 14  # characters of a value; a difference with a longer one has no column
_MIN_NAME_CHARS, _MAX_NAME_CHARS = 12, 36  # characters of a flight's name in a line, least and most
_MAX_TITLE_CHARS = 10  # characters in a line of the title of a difference, if it can be broken
_COLUMN_GAP = 3


class _Column(NamedTuple):
    """Title, and a value for each flight; `best` are the indices of the best ones."""

    title: str
    values: tuple[str, ...]
    best: tuple[int, ...] = ()
    follows: bool = False  # a difference that follows from what was given

    @property
    def width(self) -> int:
        cells = (f"* {value}" if i in self.best else value for i, value in enumerate(self.values))
        return max(map(len, (*self.title.splitlines(), *cells))) + _COLUMN_GAP


def overview(runs: Sequence[Run], width: int) -> tuple[Table, list[str]]:
    """The table, with as many columns as fit into `width` characters, and the differences that do not fit."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    name_chars = min(_MAX_NAME_CHARS, max(_MIN_NAME_CHARS, *(len(run.name) for run in runs)))
    free = width - name_chars - _COLUMN_GAP
    columns, omitted = [], [one.name for one in differences(runs)]
    settings = given_settings(runs)
    lacks_setting = False  # then no parameter that follows from the settings is shown in its place
    for column in _columns(runs):
        name = column.title.replace("\n", "")
        if column.width > free or (column.follows and lacks_setting):
            lacks_setting = lacks_setting or name in settings
            continue
        free -= column.width
        columns.append(column)
        if name in omitted:
            omitted.remove(name)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("flight", overflow="fold", min_width=_MIN_NAME_CHARS)
    for column in columns:
        table.add_column(Text(column.title), justify="right", no_wrap=True)
    for i, run in enumerate(runs):
        flight = Text(heading(run.name, name_chars + free))
        table.add_row(flight, *(cell(one.values[i], i in one.best) for one in columns))
    return table, omitted


def _columns(runs: Sequence[Run]) -> Iterator[_Column]:
    """The main figures, then differences with short values, then further figures."""
    known = {figure.metric.name: figure for _, rows in figures(runs) for figure in rows}

    def chosen(names: Mapping[str, str]) -> list[_Column]:
        found = ((title, known[name]) for name, title in names.items() if name in known)
        return [_Column(title, figure.values, figure.best) for title, figure in found]

    yield from chosen(_MAIN)
    given = given_conditions(runs)
    for one in differences(runs):
        if max(map(len, one.values)) <= _MAX_VALUE_CHARS:
            title = heading(one.name, _MAX_TITLE_CHARS)
            yield _Column(title, one.values, follows=one.name not in given)
    yield from chosen(_MORE)
