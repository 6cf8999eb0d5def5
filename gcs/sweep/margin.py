"""Linear limits."""

from __future__ import annotations

from gcs.sweep.plan import Plan


def linear_margin(plan: Plan, law: str, name: str) -> float | None:
    return None
