"""What must outlive the process: the mission and the parameters that a ground station set, as files."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from filelock import FileLock, Timeout

from autopilot.onboard.flight_log import LogChunk
from autopilot.services import files
from autopilot.services.files import LOG_ENDING, LOG_FOLDER
from autopilot.services.mission_store import (
    CorruptMission,
    StoredMission,
    deserialise,
    deserialise_items,
    serialise,
)
from autopilot.shell.sd_card import DirectoryCard
from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import read_fence, read_rally
from autopilot.wire.items import MissionItemError, WireItem
from autopilot.wire.parameter_table import ParameterError, ParameterTable, parse_text
from autopilot.wire.signing import Signing

MISSION_FILE = "mission.bin"
AREA_FILES = {mavlink.MAV_MISSION_TYPE_FENCE: "fence.bin", mavlink.MAV_MISSION_TYPE_RALLY: "rally.bin"}
_READERS: dict[int, Callable[[tuple[WireItem, ...], Home], object]] = {
    mavlink.MAV_MISSION_TYPE_FENCE: read_fence,
    mavlink.MAV_MISSION_TYPE_RALLY: read_rally,
}
PARAMETER_FILE = "parameters.txt"
WORLD_FILE = "world.txt"  # parameters of the simulator
SIGNING_FILE = "signing.key"  # key in hexadecimal digits, and the time up to which it may have been used
CARD_DIRECTORY = "card"  # what clients reach by FILE_TRANSFER_PROTOCOL
LOCK_FILE = "lock"


class StorageError(OSError):
    """The storage directory cannot be used."""


class Storage:
    """A directory; every write is a whole new file put in place at once."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._parameters: dict[str, float] = {}
        self._logs: set[files.Path] = set()  # begun by this process
        self._lock = FileLock(directory / LOCK_FILE)
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self.card = DirectoryCard(directory / CARD_DIRECTORY)
        except OSError as error:
            raise StorageError(
                f"--storage {directory}: {error.strerror}; name a directory that can be made"
            ) from None

    def lock(self) -> None:
        """Keep other autopilots out until this object or the process is gone."""
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
        """The stored mission, and what is wrong with the file if it is none (empty: nothing)."""
        path = self._directory / MISSION_FILE
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None, ""
        except OSError as error:
            return None, f"{path}: {error.strerror}; starting without a mission"
        mission = deserialise(data, home)
        if isinstance(mission, CorruptMission):
            aside = path.with_suffix(".corrupt")
            try:
                path.replace(aside)
            except OSError as error:
                return None, f"{path}: {mission.reason}; {error.strerror}, starting without a mission"
            return None, f"{path}: {mission.reason}; moved to {aside.name}, starting without a mission"
        return mission, ""

    def load_areas(self, home: Home) -> tuple[dict[int, tuple[WireItem, ...]], list[str]]:
        """The stored fence and rally points by MAV_MISSION_TYPE, and a line for each that is none."""
        found: dict[int, tuple[WireItem, ...]] = {}
        troubles = []
        for kind, name in AREA_FILES.items():
            path = self._directory / name
            try:
                items = deserialise_items(path.read_bytes())
                if isinstance(items, CorruptMission):
                    troubles.append(f"{path}: {items.reason}; starting without it")
                    continue
                _READERS[kind](items, home)
                found[kind] = items
            except FileNotFoundError:
                continue
            except (OSError, MissionItemError) as error:
                troubles.append(f"{path}: {error}; starting without it")
        return found, troubles

    def keep_areas(self, kind: int, items: tuple[WireItem, ...]) -> None:
        """Store fence or rally points; none are stored as none."""
        path = self._directory / AREA_FILES[kind]
        if items:
            self._write(path, serialise(items))
        else:
            path.unlink(missing_ok=True)

    def load_parameters(self, table: ParameterTable) -> list[str]:
        """Set what is stored; returns a line for each stored value that no longer fits."""
        path = self._directory / PARAMETER_FILE
        try:
            stored = parse_text(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return []
        except (OSError, UnicodeDecodeError, ParameterError) as error:
            return [f"{path}: {error}; starting with the defaults"]
        troubles = []
        for name, value in stored.items():
            try:
                self._parameters[name] = table.set(name, value)
            except ParameterError as error:
                troubles.append(f"{path}: {error}; left out")
        return troubles

    def keep_mission(self, mission: StoredMission) -> None:
        """Store the mission; an empty one is stored as none."""
        path = self._directory / MISSION_FILE
        if mission.items:
            self._write(path, serialise(mission.items))
        else:
            path.unlink(missing_ok=True)

    def keep_parameter(self, name: str, value: float) -> None:
        """Store one more parameter."""
        self._parameters[name] = value
        lines = [f"{name} {value!r}\n" for name, value in sorted(self._parameters.items())]
        self._write(self._directory / PARAMETER_FILE, "".join(lines).encode())

    def load_world(self) -> tuple[dict[str, float], list[str]]:
        """The simulator's parameters as they were saved, and a line if the file is none."""
        path = self._directory / WORLD_FILE
        try:
            return parse_text(path.read_text(encoding="utf-8")), []
        except FileNotFoundError:
            return {}, []
        except (OSError, UnicodeDecodeError, ParameterError) as error:
            return {}, [f"{path}: {error}; left out"]

    def keep_world(self, values: Mapping[str, float]) -> None:
        """Store the simulator's parameters; none are stored as none."""
        path = self._directory / WORLD_FILE
        if values:
            self._write(path, "".join(f"{name} {value!r}\n" for name, value in values.items()).encode())
        else:
            path.unlink(missing_ok=True)

    def load_signing(self) -> Signing | None:
        """The stored key with a time later than any that was used; StorageError if it is none."""
        path = self._directory / SIGNING_FILE
        try:
            key, timestamp = path.read_text(encoding="ascii").split()
            return Signing(bytes.fromhex(key), int(timestamp), floor=int(timestamp))
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise StorageError(
                f"{path}: {error}; mend or remove it: without it unsigned commands are obeyed"
            ) from None

    def keep_signing(self, key: bytes | None, timestamp: int) -> None:
        """Store the key, for nobody else to read, or take it away."""
        path = self._directory / SIGNING_FILE
        if key is None:
            path.unlink(missing_ok=True)
        else:
            self._write(path, f"{key.hex()} {timestamp}\n".encode(), private=True)

    def keep_log(self, chunk: LogChunk, most_mb: float) -> None:
        """Store a part of a flight log; a new log takes the place of the oldest where they are too many."""
        if chunk.path not in self._logs:
            self._logs.add(chunk.path)
            self.card.make_room(LOG_FOLDER, LOG_ENDING, round(most_mb * 1e6))
        self.card.append(chunk.path, chunk.data)

    def _write(self, path: Path, data: bytes, private: bool = False) -> None:
        new = path.with_suffix(".new")
        new.unlink(missing_ok=True)  # it may be readable by others
        handle = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if private else 0o666)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
