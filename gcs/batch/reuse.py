"""The rule by which a stored flight is reused: same settings, same version, same code.

`gcs sweep` and `gcs experiments` share it. The settings are everything that the user chose, with the content
of the named files; the version is that of Plumbline; the code is a fingerprint of all files that determine
what happens in a flight (`gcs.batch.closure`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from gcs.batch.closure import fingerprint


@dataclass(frozen=True)
class Origin:
    """All that determines the result of a flight: flights of equal origin have equal results."""

    settings: Mapping[str, Any]  # plain JSON values
    version: str
    code: str

    def to_json(self) -> dict[str, Any]:
        """Plain values, as they are after a round trip through JSON."""
        return json.loads(json.dumps(asdict(self)))  # type: ignore[no-any-return]

    def differences(self, stored: object) -> tuple[str, ...]:
        """Which of `settings`, `version` and `code` differ from those stored; empty if the flight is reused.

        `stored` was read from a file; if it does not have the form of `to_json`, all three differ.
        """
        current = self.to_json()
        recorded = stored if isinstance(stored, Mapping) else {}
        return tuple(name for name in current if name not in recorded or recorded[name] != current[name])


def origin_of(settings: Mapping[str, Any], entries: Iterable[str]) -> Origin:
    """The origin of flights that the modules `entries` fly now under `settings`."""
    return Origin(settings, version("plumbline"), code_fingerprint(tuple(entries)))


@cache
def code_fingerprint(entries: tuple[str, ...]) -> str:
    """The fingerprint of these modules and all that they import; the files are read once per run."""
    return fingerprint(entries)


def file_digests(names: Iterable[str]) -> dict[str, str]:
    """A hash of the content for each name that is the path of a file. Names of shipped files need none: these
    files are part of the code."""
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        for name in names
        if (path := Path(name)).is_file()
    }
