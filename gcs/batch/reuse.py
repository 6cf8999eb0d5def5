"""The rule by which a stored flight is reused: same settings, same version, same code.

`gcs sweep` and `gcs experiments` share it. Settings are everything that the user chose, with the content of
the files that were named; the version is that of Plumbline; the code is a fingerprint of all files that
decide what happens in a flight (`gcs.batch.closure`).
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
    """What the result of a flight follows from: flights of equal origin have equal results."""

    settings: Mapping[str, Any]  # plain JSON values
    version: str
    code: str

    def to_json(self) -> dict[str, Any]:
        """Plain values, as JSON gives them back."""
        return json.loads(json.dumps(asdict(self)))  # type: ignore[no-any-return]

    def differences(self, stored: object) -> tuple[str, ...]:
        """Which of `settings`, `version` and `code` differ from those stored; empty if the flight is reused.

        `stored` is what was read from a file; one that is not of the form of `to_json` differs in all three.
        """
        mine = self.to_json()
        theirs = stored if isinstance(stored, Mapping) else {}
        return tuple(name for name in mine if name not in theirs or theirs[name] != mine[name])


def origin_of(settings: Mapping[str, Any], entries: Iterable[str]) -> Origin:
    """The origin of flights that are flown now, by the modules `entries`, under `settings`."""
    return Origin(settings, version("plumbline"), code_of(tuple(entries)))


@cache
def code_of(entries: tuple[str, ...]) -> str:
    """The fingerprint of the sources that these modules reach, read once in a run."""
    return fingerprint(entries)


def file_digests(names: Iterable[str]) -> dict[str, str]:
    """A hash of the content of each name that is the path of a file. Shipped files are part of the code."""
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        for name in names
        if (path := Path(name)).is_file()
    }
