"""Data that must outlive the process, as files: mission, fence, parameters, signing key, logs and more."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from filelock import FileLock, Timeout

from autopilot.onboard.flight_log import LogChunk
from autopilot.services import files
from autopilot.services.files import LOG_FOLDER, LOG_SUFFIX
from autopilot.services.mission_store import (
    CorruptMission,
    StoredMission,
    deserialise,
    deserialise_items,
    serialise,
)
from autopilot.shell.atomic_file import DamagedError, keep_copy, remove, seal, unseal, write_atomically
from autopilot.shell.sd_card import DirectoryCard
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import AREA_READERS
from autopilot.wire.items import MissionItemError, WireItem
from autopilot.wire.parameter_table import ParameterError, ParameterTable, parse_text
from autopilot.wire.signing import Signing

MISSION_FILE = "mission.bin"
AREA_FILES = {mavlink.MAV_MISSION_TYPE_FENCE: "fence.bin", mavlink.MAV_MISSION_TYPE_RALLY: "rally.bin"}
PARAMETER_FILE = "parameters.txt"
SIMULATOR_PARAMETER_FILE = "world.txt"  # parameters of the simulator
SIGNING_FILE = "signing.key"  # key in hexadecimal digits, and the time up to which it may have been used
CARD_DIRECTORY = "card"  # files that clients access by FILE_TRANSFER_PROTOCOL
LOCK_FILE = "lock"
# stored data without which a vehicle is not armed: the fence and the parameters
_REQUIRED_TO_ARM: dict[int | str, str] = {
    mavlink.MAV_MISSION_TYPE_FENCE: "the stored fence is damaged; upload it again, or clear it",
    PARAMETER_FILE: "the stored parameters are damaged; set and save them again",
}


class StorageError(OSError):
    """The storage directory cannot be used."""


class Storage:
    """A directory; every write is a whole new file that replaces the old one atomically.

    A damaged file is never lost: it is copied before another file takes its place.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._parameters: dict[str, float] = {}
        self._logs: set[files.Path] = set()  # logs begun by this process
        self._lost: set[int | str] = set()  # whose files cannot be read: they stay until replaced
        self._lock = FileLock(directory / LOCK_FILE)
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self.card = DirectoryCard(directory / CARD_DIRECTORY)
        except OSError as error:
            raise StorageError(
                f"--storage {directory}: {error.strerror}; name a directory that can be made"
            ) from None

    def lock(self) -> None:
        """Keep other autopilots out as long as this object and the process exist."""
        try:
            self._lock.acquire(blocking=False)
        except Timeout:
            raise StorageError(
                f"--storage {self._directory}: another autopilot keeps its mission and parameters there; "
                "name another directory"
            ) from None
        except OSError as error:
            raise StorageError(f"--storage {self._directory}: {error.strerror}") from None

    def load_mission(self, home: Home) -> tuple[StoredMission | None, str]:
        """The stored mission, and what is wrong with the file if it cannot be used (empty: nothing)."""
        path = self._directory / MISSION_FILE
        try:
            mission = deserialise(path.read_bytes(), home)
        except FileNotFoundError:
            return None, ""
        except OSError as error:
            return None, f"{path}: {error.strerror}; starting without a mission"
        if isinstance(mission, CorruptMission):
            return None, f"{path}: {mission.reason}; {self._move_aside(path)}, starting without a mission"
        return mission, ""

    def _move_aside(self, path: Path) -> str:
        """Move a damaged file to another name, and return a text about it."""
        try:
            copy = keep_copy(path)
            remove(path)
        except OSError as error:
            return _error_text(error)
        return f"moved to {copy.name}"

    def _replace(self, key: int | str, name: str, data: bytes | None) -> None:
        """Replace a file's contents, or remove it (None), after a copy of a file that cannot be read."""
        path = self._directory / name
        if key in self._lost:
            keep_copy(path)
        if data is None:
            remove(path)
        else:
            write_atomically(path, data)
        self._lost.discard(key)

    def load_areas(self, home: Home) -> tuple[dict[int, tuple[WireItem, ...]], list[str]]:
        """The stored fence and rally points by MAV_MISSION_TYPE, and a line for each unusable file."""
        found: dict[int, tuple[WireItem, ...]] = {}
        problems = []
        for kind, name in AREA_FILES.items():
            path = self._directory / name
            try:
                items = deserialise_items(path.read_bytes())
                if isinstance(items, CorruptMission):
                    raise DamagedError(items.reason)
                AREA_READERS[kind](items, home)
                found[kind] = items
            except FileNotFoundError:
                continue
            except (OSError, DamagedError, MissionItemError) as error:
                self._lost.add(kind)
                problems.append(f"{path}: {_error_text(error)}; starting without it")
        return found, problems

    @property
    def lost(self) -> tuple[str, ...]:
        """The reasons not to arm: stored data that cannot be read, without which the vehicle must not fly."""
        return tuple(text for key, text in _REQUIRED_TO_ARM.items() if key in self._lost)

    def store_areas(self, kind: int, items: tuple[WireItem, ...]) -> None:
        """Store fence or rally points; without items the file is removed."""
        self._replace(kind, AREA_FILES[kind], serialise(items) if items else None)

    def load_parameters(self, table: ParameterTable) -> list[str]:
        """Set the stored parameters; returns a line for each stored value that is no longer valid."""
        stored, problems = self._load_text(PARAMETER_FILE, "starting with the defaults")
        for name, value in stored.items():
            try:
                self._parameters[name] = table.set(name, value)
            except ParameterError as error:
                problems.append(f"{self._directory / PARAMETER_FILE}: {error}; left out")
        return problems

    def _load_text(self, name: str, consequence: str) -> tuple[dict[str, float], list[str]]:
        """Names and numbers in a file; if it is unusable, a line with the error and its consequence."""
        path = self._directory / name
        try:
            return parse_text(unseal(path.read_bytes())), []
        except FileNotFoundError:
            return {}, []
        except (OSError, DamagedError, UnicodeDecodeError, ParameterError) as error:
            self._lost.add(name)
            return {}, [f"{path}: {_error_text(error)}; {consequence}"]

    def store_mission(self, mission: StoredMission) -> None:
        """Store the mission; for an empty mission the file is removed."""
        self._replace(MISSION_FILE, MISSION_FILE, serialise(mission.items) if mission.items else None)

    def store_parameter(self, name: str, value: float) -> None:
        """Store one more parameter."""
        self._parameters[name] = value
        self.store_parameters()

    def store_parameters(self) -> None:
        """Store all parameters that were set; values of a file that could not be read are given up."""
        self._replace(PARAMETER_FILE, PARAMETER_FILE, seal(_lines(sorted(self._parameters.items()))))

    def load_simulator_parameters(self) -> tuple[dict[str, float], list[str]]:
        """The saved parameters of the simulator, and a line if the file is unusable."""
        return self._load_text(SIMULATOR_PARAMETER_FILE, "left out")

    def store_simulator_parameters(self, values: Mapping[str, float]) -> None:
        """Store the simulator's parameters; without values the file is removed."""
        self._replace(
            SIMULATOR_PARAMETER_FILE,
            SIMULATOR_PARAMETER_FILE,
            seal(_lines(values.items())) if values else None,
        )

    def load_signing(self) -> Signing | None:
        """The stored key with a time later than any that was used; StorageError if the file is unusable."""
        path = self._directory / SIGNING_FILE
        try:
            key, timestamp = unseal(path.read_bytes()).split()
            return Signing(bytes.fromhex(key), int(timestamp), floor=int(timestamp))
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise StorageError(
                f"{path}: {error}; mend or remove it: without it unsigned commands are obeyed"
            ) from None

    def store_signing(self, key: bytes | None, timestamp: int) -> None:
        """Store the key, readable by this user only, or remove it (None)."""
        path = self._directory / SIGNING_FILE
        if key is None:
            remove(path)
        else:
            write_atomically(path, seal(f"{key.hex()} {timestamp}\n"), private=True)

    def store_log(self, chunk: LogChunk, max_mb: float) -> None:
        """Store a part of a flight log; for a new log the oldest ones beyond `max_mb` are removed."""
        if chunk.path not in self._logs:
            self._logs.add(chunk.path)
            self.card.remove_oldest(LOG_FOLDER, LOG_SUFFIX, round(max_mb * 1e6))
        self.card.append(chunk.path, chunk.data)


def _lines(values: Iterable[tuple[str, float]]) -> str:
    return "".join(f"{name} {value!r}\n" for name, value in values)


def _error_text(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
