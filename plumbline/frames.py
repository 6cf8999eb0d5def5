"""Tables as the libraries of those who ask for them have them."""

from __future__ import annotations

from typing import Any

from gcs.errors import GcsError


def as_frame(table: Any, kind: str) -> Any:
    """An Arrow table as a DataFrame of pandas or polars, or as it is; `Error` where that is not installed."""
    check_kind(kind)
    try:
        if kind == "pandas":
            return table.to_pandas()
        if kind == "polars":
            import polars

            return polars.from_arrow(table)
    except ImportError:
        raise GcsError(f"{kind} is not installed; pip install {kind}, or ask for kind='arrow'") from None
    return table


def check_kind(kind: str) -> None:
    """`Error` unless there is such a kind of table."""
    if kind not in ("pandas", "polars", "arrow"):
        raise GcsError(f"kind={kind!r}: there is none; must be pandas, polars or arrow")
