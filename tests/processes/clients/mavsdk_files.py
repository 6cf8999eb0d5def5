"""Files and logs of a vehicle through MAVSDK: `python mavsdk_files.py PORT DIRECTORY`; JSON on stdout."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.component_metadata import ComponentMetadata, MetadataType
from mavsdk.plugins.ftp import Ftp, FtpResult
from mavsdk.plugins.log_files import LogFiles, LogFilesResult

LONG_S = 60.0


def finished(begin: Callable[[Callable[..., None]], None], next_one: Any) -> str:
    """Wait for the end of an operation that reports its progress; return its result."""
    over, results = threading.Event(), []

    def hear(result: Any, *_: Any) -> None:
        if result != next_one:
            results.append(result.name)
            over.set()

    begin(hear)
    return results[0] if over.wait(LONG_S) else "NO END"


def main(port: str, directory: Path) -> None:
    told: dict[str, Any] = {}
    back = directory / "back"
    back.mkdir()
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = mavsdk.first_autopilot(LONG_S)
        ftp = Ftp(system)

        def names(path: str) -> list[str]:
            return [entry.name for entry in ftp.list_directory(path).entries]

        told["root"] = names("/")
        big = directory / "big.bin"
        big.write_bytes(os.urandom(60_000))
        told["up"] = finished(lambda hear: ftp.upload_async(str(big), "/fs/microsd", hear), FtpResult.NEXT)
        told["identical"] = ftp.are_files_identical(str(big), "/fs/microsd/big.bin")
        for burst in (True, False):
            result = finished(
                lambda hear, burst=burst: ftp.download_async("/fs/microsd/big.bin", str(back), burst, hear),
                FtpResult.NEXT,
            )
            told[f"down {burst}"] = [result, (back / "big.bin").read_bytes() == big.read_bytes()]
        ftp.create_directory("/fs/microsd/folder")
        ftp.rename("/fs/microsd/big.bin", "/fs/microsd/folder/other.bin")
        told["moved"] = names("/fs/microsd/folder")
        ftp.remove_file("/fs/microsd/folder/other.bin")
        ftp.remove_directory("/fs/microsd/folder")
        told["left"] = names("/fs/microsd")

        metadata = ComponentMetadata(system)
        available = threading.Event()
        metadata.subscribe_metadata_available(lambda *_: available.set())
        metadata.request_autopilot_component()
        available.wait(LONG_S)
        texts = metadata.get_metadata(1, MetadataType.PARAMETER).json_metadata
        told["metadata"] = {p["name"]: p.get("shortDesc") for p in json.loads(texts)["parameters"]}

        logs = LogFiles(system)
        entries = logs.get_entries()
        told["logs"] = [entry.size_bytes for entry in entries]
        told["log"] = finished(
            lambda hear: logs.download_log_file_async(entries[0], str(directory / "log.ulg"), hear),
            LogFilesResult.NEXT,
        )
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
