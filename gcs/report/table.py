"""The record as a table for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gcs.analysis.definitions import known_groups
from gcs.analysis.record import Record

if TYPE_CHECKING:
    from rich.table import Table

_OUTCOME_STYLES = {"completed": "bold green", "diverged": "bold red", "lost": "bold red"}


def record_table(record: Record) -> Table:
    """What is known of a flight, with a section for each group."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column()
    table.add_column(justify="right")
    for group, known in known_groups(record):
        for i, metric in enumerate(known):
            # values are data, not markup: a mission path may contain brackets
            value = Text(metric.formatted(record))
            if metric.name == "outcome":
                value.stylize(_OUTCOME_STYLES.get(str(record[metric.name]), "bold yellow"))
            head = (group.title, group.window_of(record))[i] if i < 2 else ""
            table.add_row(head, metric.label, value, end_section=i == len(known) - 1)
    return table
