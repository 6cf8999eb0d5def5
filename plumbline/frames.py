"""Tables in the form of the requested library: pandas, polars or Arrow."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from gcs.errors import GcsError, from_clone


def check_kind(kind: str) -> None:
    """`Error` if there is no such kind of table, or if its library is missing; called before any flight."""
    if kind not in ("pandas", "polars", "arrow"):
        raise GcsError(f"kind={kind!r}: there is none; must be pandas, polars or arrow")
    if kind != "arrow" and find_spec(kind) is None:
        package = from_clone(kind) if kind == "pandas" else kind
        raise GcsError(f"{kind} is not installed; pip install {package}, or ask for kind='arrow'")


def as_frame(table: Any, kind: str) -> Any:
    """An Arrow table as a pandas or polars DataFrame, or unchanged; `Error` if that library is missing."""
    check_kind(kind)
    if kind == "pandas":
        return table.to_pandas()
    if kind == "polars":
        import polars

        return polars.from_arrow(table)
    return table
