"""Tables as the libraries of those who ask for them have them."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from gcs.errors import GcsError, from_clone


def check_kind(kind: str) -> None:
    """`Error` unless there is such a kind of table, and the library for it: told before anything is flown."""
    if kind not in ("pandas", "polars", "arrow"):
        raise GcsError(f"kind={kind!r}: there is none; must be pandas, polars or arrow")
    if kind != "arrow" and find_spec(kind) is None:
        package = from_clone(kind) if kind == "pandas" else kind
        raise GcsError(f"{kind} is not installed; pip install {package}, or ask for kind='arrow'")


def as_frame(table: Any, kind: str) -> Any:
    """An Arrow table as a DataFrame of pandas or polars, or as it is; `Error` where that is not installed."""
    check_kind(kind)
    if kind == "pandas":
        return table.to_pandas()
    if kind == "polars":
        import polars

        return polars.from_arrow(table)
    return table
