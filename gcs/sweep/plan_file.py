"""plan.json of a sweep's directory: what is flown into it, and from which settings, version and code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gcs.batch.reuse import Origin, file_digests, origin_of
from gcs.folders import PLAN_FILE, make_folder
from gcs.sweep.plan import PlanError, SweepPlan, from_json

ENTRIES = ("gcs.sweep.work",)  # of the code that flies a sweep


def sweep_origin(plan: SweepPlan) -> Origin:
    """What the flights of a plan follow from when they are flown now."""
    files = file_digests((plan.mission, plan.vehicle, plan.sensors))
    for law in plan.laws:
        files |= {one.reference: one.digest for one in plan.own(law).loaded()}
    return origin_of({"plan": plan.to_json(), "files": files}, ENTRIES)


def store_plan(directory: Path, plan: SweepPlan, command: str, origin: Origin) -> None:
    """Write plan.json; PlanError if the directory holds flights of another origin, GcsError if nothing can be
    written into it."""
    make_folder(directory, f"--out {directory}")
    path = directory / PLAN_FILE
    if path.exists():
        found = _read(directory)
        differing = origin.differences(found.get("origin"))
        if differing:
            kind = "another sweep" if "settings" in differing else "a sweep flown by other code"
            raise PlanError(
                f"--out {directory}: holds {kind} ({', '.join(differing)} differ); name another, or add"
                " --fresh to discard its flights"
            )
        return
    fields = {"command": command, "flights": plan.flights, "origin": origin.to_json()}
    path.write_text(json.dumps(fields, indent=2) + "\n", encoding="utf-8")


def load_plan(directory: Path) -> SweepPlan:
    """The plan of a sweep's directory."""
    try:
        return from_json(_read(directory)["origin"]["settings"]["plan"])
    except (KeyError, TypeError):
        raise _unreadable(directory) from None


def load_command(directory: Path) -> tuple[str, str]:
    """The command that made the sweep, and the version of Plumbline that flew it."""
    found = _read(directory)
    try:
        return str(found["command"]), str(found["origin"]["version"])
    except (KeyError, TypeError):
        raise _unreadable(directory) from None


def _read(directory: Path) -> dict[str, Any]:
    try:
        found = json.loads((directory / PLAN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise _unreadable(directory) from None
    if not isinstance(found, dict):
        raise _unreadable(directory)
    return found


def _unreadable(directory: Path) -> PlanError:
    return PlanError(
        f"{directory / PLAN_FILE}: cannot be read, so {directory} holds no sweep; choose another --out, or"
        " add --fresh to begin again"
    )
