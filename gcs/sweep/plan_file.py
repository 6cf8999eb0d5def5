"""plan.json of a sweep's directory: what is flown there, and with which settings, version and code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from autopilot.shell.atomic_file import write_atomically
from autopilot.vehicle.file import belief_of
from gcs.batch.reuse import Origin, file_digests, origin_of
from gcs.folders import PLAN_FILE, make_folder
from gcs.sweep.plan import SweepPlan, from_json
from gcs.sweep.plan_values import PlanError

_OPTIONS = {
    "mission": "mission",
    "laws": "--law",
    "varied": "--vary",
    "settings": "--set",
    "limit_s": "--timeout",
}
ENTRIES = ("gcs.sweep.work",)  # modules whose imports are all the code that flies a sweep


def sweep_files(plan: SweepPlan) -> dict[str, str]:
    """A hash of the content of each file of the user's own that the plan names, and of the custom classes.
    ValueError if one cannot be read."""
    files = file_digests((plan.mission, plan.vehicle, str(belief_of(plan.vehicle)), plan.sensors))
    for law in plan.laws:
        files |= {one.reference: one.digest for one in plan.own(law).load_classes()}
    return files


def sweep_origin(plan: SweepPlan) -> Origin:
    """The origin of the flights of a plan if they are flown now: settings, files, version and code."""
    return origin_of({"plan": plan.to_json(), "files": sweep_files(plan)}, ENTRIES)


def store_plan(directory: Path, plan: SweepPlan, command: str, origin: Origin) -> None:
    """Write plan.json, also in place of that of a sweep which this one extends; PlanError if the directory
    contains flights of another origin, GcsError if it cannot be written."""
    make_folder(directory)
    path = directory / PLAN_FILE
    if path.exists():
        found = _read(directory)
        differing = origin.differences(found.get("origin"))
        if not differing:
            return
        if not _extends(plan, origin, found):
            content = "this sweep as flown by another version or other code of Plumbline"
            if "settings" in differing:
                content = f"another sweep, with other {', '.join(_differing_options(origin, found))}"
            raise PlanError(
                f"{directory}: holds {content}; name another folder by --out, or add --fresh to discard its "
                "flights"
            )
    fields = {"command": command, "flights": plan.flights, "origin": origin.to_json()}
    write_atomically(path, (json.dumps(fields, indent=2) + "\n").encode())


def _extends(plan: SweepPlan, origin: Origin, found: Mapping[str, Any]) -> bool:
    """Whether all flights of the plan of a stored plan.json are flights of this plan, flown as now."""
    if origin.differences(found.get("origin")) != ("settings",):
        return False
    try:
        stored = found["origin"]["settings"]
        return bool(stored["files"] == origin.to_json()["settings"]["files"]) and plan.contains(
            from_json(stored["plan"])
        )
    except (KeyError, TypeError):
        return False


def default_folder(plan: SweepPlan) -> Path:
    """sweeps/MISSION"""
    return Path("sweeps") / Path(plan.mission).stem


def default_directory(plan: SweepPlan, origin: Origin, fresh: bool) -> Path:
    """The first of sweeps/MISSION, sweeps/MISSION-2, -3 ... that contains this sweep, or one that it extends,
    or nothing, or does not exist.

    `fresh`: also one with flights by other code, which are discarded.
    """
    first = default_folder(plan)
    ordinal = 1
    while True:
        directory = first if ordinal == 1 else first.with_name(f"{first.name}-{ordinal}")
        if _is_free(directory) or _can_continue(directory, plan, origin, fresh):
            return directory
        ordinal += 1


def _is_free(directory: Path) -> bool:
    if not directory.exists():
        return True
    try:
        return not any(directory.iterdir())
    except OSError:  # a file, or a directory that cannot be read
        return False


def _can_continue(directory: Path, plan: SweepPlan, origin: Origin, fresh: bool) -> bool:
    try:
        found = _read(directory)
    except PlanError:
        return False
    differing = origin.differences(found.get("origin"))
    return "settings" not in differing if fresh else not differing or _extends(plan, origin, found)


def _differing_options(origin: Origin, found: Mapping[str, Any]) -> list[str]:
    """The settings that differ, by their names on the command line, with the stored value if it is short."""
    try:
        stored, requested = found["origin"]["settings"], origin.to_json()["settings"]
        pairs = [(name, stored["plan"].get(name), value) for name, value in requested["plan"].items()]
        files = {**stored["files"], **requested["files"]}
        other_files = [
            f"content of {name}"
            for name in files
            if stored["files"].get(name) != requested["files"].get(name)
        ]
    except (KeyError, TypeError, AttributeError):
        return ["settings"]
    differing = [
        _OPTIONS.get(name, f"--{name}") + _stored_value(stored_value)
        for name, stored_value, requested_value in pairs
        if stored_value != requested_value
    ]
    return [*other_files, *differing]


def _stored_value(value: object) -> str:
    return f" ({value})" if isinstance(value, str | int | float) else ""


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
