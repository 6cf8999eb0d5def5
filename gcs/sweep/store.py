"""flights.parquet: a row for each flight of a sweep, written in parts so that no flight is lost.

A part is either complete or absent: it is written under another name and renamed. When the sweep ends, the
parts are merged into one table in the order of the flights. Each file has the plan by which its flights are
numbered: in a sweep that was extended, they have other numbers than in the file.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from autopilot.own.law import law_name
from autopilot.shell.atomic_file import write_atomically
from gcs.errors import InputError
from gcs.formats.arrow import array_of, path_for_arrow, text_array
from gcs.sweep.flight import FlightResult
from gcs.sweep.plan import Case, SweepPlan, from_json

if TYPE_CHECKING:
    import pyarrow

TABLE_FILE = "flights.parquet"
PARTS = "parts"
METADATA_KEY = b"plumbline"
Row = dict[str, Any]

_TEXT_COLUMNS = ("law", "outcome", "reason", "cause", "lost_phase")
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\w)")
_INTEGER_COLUMNS = ("index", "seed", "slack_events")


def columns(plan: SweepPlan) -> tuple[str, ...]:
    """The columns of the table: number, law and seed of the flight, varied values, results."""
    figures = [f.name for f in fields(FlightResult) if f.name != "texts"]
    figures.insert(figures.index("reason") + 1, "cause")
    return ("index", "law", "seed", *(v.name for v in plan.varied), *figures, "wall_s")


def schema(plan: SweepPlan) -> pyarrow.Schema:
    """Types of the columns."""
    import pyarrow as pa

    def kind(name: str) -> pa.DataType:
        if name in _TEXT_COLUMNS:
            return pa.string()
        return pa.int64() if name in _INTEGER_COLUMNS else pa.float64()

    metadata = {METADATA_KEY: json.dumps(plan.to_json()).encode()}
    return pa.schema([(name, kind(name)) for name in columns(plan)], metadata=metadata)


def cause_of(reason: str) -> str:
    """The reason of a flight without its numbers, which is the same for all flights that end alike."""
    return "; ".join(dict.fromkeys(_NUMBER.sub("#", reason).split("; ")))


def row_of(plan: SweepPlan, case: Case, result: FlightResult, wall_s: float) -> Row:
    """The row of a flight."""
    figures = {f.name: getattr(result, f.name) for f in fields(FlightResult) if f.name != "texts"}
    varied = {v.name: value for v, value in zip(plan.varied, case.varied, strict=True)}
    return {
        "index": case.index,
        "law": law_name(case.law),
        "seed": case.seed,
        **varied,
        **figures,
        "cause": cause_of(result.reason),
        "wall_s": wall_s,
    }


def table_of(rows: Sequence[Row], column_schema: pyarrow.Schema) -> pyarrow.Table:
    """Rows as a table of these columns."""
    import pyarrow as pa

    def column(field: pa.Field) -> pa.Array:
        values: list[Any] = [row.get(field.name) for row in rows]
        if field.type == pa.string():
            return text_array(values)
        kind = np.int64 if field.type == pa.int64() else np.float64
        known = np.array([0 if value is None else value for value in values], dtype=kind)
        return array_of(known, np.array([value is None for value in values]))

    return pa.Table.from_arrays([column(field) for field in column_schema], schema=column_schema)


def _distinct_flights(plan: SweepPlan) -> list[tuple[Any, ...]]:
    """What distinguishes each flight of a plan: law, varied values and seed."""
    return [(case.law, case.varied, case.seed) for case in plan.cases()]


def _damaged(path: Path) -> InputError:
    return InputError(f"{path}: damaged, or no Parquet file; delete it, or name another folder by --out")


class Store:
    """The flights of a sweep's directory."""

    def __init__(self, directory: Path, plan: SweepPlan) -> None:
        self._directory = directory
        self._plan = plan
        self._schema = schema(plan)

    @property
    def path(self) -> Path:
        """The table of all flights."""
        return self._directory / TABLE_FILE

    def parts(self) -> list[Path]:
        """The complete parts."""
        return sorted((self._directory / PARTS).glob("*.parquet"))

    def stored_indices(self) -> set[int]:
        """Numbers of the flights that are stored."""
        found: set[int] = set()
        for table in self._tables(["index"]):
            found.update(table.column("index").to_pylist())
        return found

    def add(self, rows: Sequence[Row]) -> None:
        """Store rows as a new part."""
        if not rows:
            return
        folder = self._directory / PARTS
        folder.mkdir(parents=True, exist_ok=True)
        first = min(row["index"] for row in rows)
        self._write(folder / f"{first:09d}-{len(rows)}.parquet", table_of(rows, self._schema))

    def merge(self) -> pyarrow.Table:
        """Merge all that is stored into one table, in the order of the flights; delete the parts, also
        unfinished ones of a sweep that was killed, when the table is on disk."""
        table = self.read()
        self._write(self.path, table)
        folder = self._directory / PARTS
        for path in (*self.parts(), *folder.glob("*.new")):
            path.unlink()
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return table

    def read(self) -> pyarrow.Table:
        """All that is stored; a flight that was stored twice (by a merge that was killed) counts once."""
        import pyarrow as pa

        tables = [table.cast(self._schema) for table in self._tables()]
        if not tables:
            return self._schema.empty_table()
        table = pa.concat_tables(tables)
        # `to_numpy` would import pandas too
        _, first = np.unique(table.column("index").to_pylist(), return_index=True)
        return table.take(array_of(first)).replace_schema_metadata(self._schema.metadata)

    def _tables(self, names: list[str] | None = None) -> Iterator[pyarrow.Table]:
        """What each file holds, all columns or those of these names, numbered by the present plan."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        for path in self._files():
            try:
                file = pq.ParquetFile(path_for_arrow(path))  # `read_table` would import pandas
                if METADATA_KEY not in (file.schema_arrow.metadata or {}):
                    raise InputError(f"{path}: not the flights of a sweep; name another folder by --out")
                table = file.read(columns=names)
            except OSError as error:
                if error.errno is not None:
                    raise
                raise _damaged(path) from None  # Arrow reports a damaged page so
            except pa.ArrowException:
                raise _damaged(path) from None
            yield self._numbered(table)

    def _numbered(self, table: pyarrow.Table) -> pyarrow.Table:
        """The table of a file with its flights numbered by the present plan, which has all of them."""
        stored = table.schema.metadata[METADATA_KEY]
        if stored == self._schema.metadata[METADATA_KEY]:
            return table
        number = {flight: index for index, flight in enumerate(_distinct_flights(self._plan))}
        flights = _distinct_flights(from_json(json.loads(stored)))
        flown = [flights[index] for index in table.column("index").to_pylist()]
        numbers = np.array([number[flight] for flight in flown], np.int64)
        return table.set_column(table.schema.get_field_index("index"), "index", array_of(numbers))

    def clear(self) -> None:
        """Delete all flights."""
        for path in self._files():
            path.unlink()

    def _files(self) -> Iterable[Path]:
        return [*([self.path] if self.path.exists() else []), *self.parts()]

    def _write(self, path: Path, table: pyarrow.Table) -> None:
        import pyarrow.parquet as pq

        content = io.BytesIO()
        pq.write_table(table, content, compression="zstd")
        write_atomically(path, content.getvalue())
