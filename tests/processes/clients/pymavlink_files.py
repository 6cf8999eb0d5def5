"""Files of a vehicle through pymavlink: `python pymavlink_files.py PORT DIRECTORY`; JSON on stdout."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from pymavlink import mavutil
from pymavlink.mavftp import MAVFTP

LONG_S = 60.0


def main(port: str, directory: Path) -> None:
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255, source_component=230)
    link.wait_heartbeat(timeout=LONG_S)
    ftp = MAVFTP(link, link.target_system, link.target_component)
    # commands without a transfer end after a silence, which need not be long here
    ftp.ftp_settings.read_retry_time, ftp.ftp_settings.idle_detection_time = 0.4, 0.5

    def done(*words: str) -> int:
        result = ftp.cmd_ftp([*words])
        if words[0] in ("get", "put"):
            result = ftp.process_ftp_reply(words[0], timeout=LONG_S)
        return int(result.error_code)

    told: dict[str, Any] = {}
    up, down = directory / "up.bin", directory / "down.bin"
    up.write_bytes(os.urandom(20_011))
    told["codes"] = [
        done("mkdir", "/fs/microsd/d"),
        done("put", str(up), "/fs/microsd/d/up.bin"),
        done("get", "/fs/microsd/d/up.bin", str(down)),
        done("rename", "/fs/microsd/d/up.bin", "/fs/microsd/d/x"),
        done("rm", "/fs/microsd/d/x"),
        done("rmdir", "/fs/microsd/d"),
        done("rm", "/etc/extras/parameters.json"),
        done("mkdir", "/fs/microsd/../outside"),
    ]
    told["equal"] = down.read_bytes() == up.read_bytes()
    pack = ftp.read("@PARAM/param.pck?withdefaults=1", 100_000)
    told["parameters"] = {name.decode(): value for name, value, _ in MAVFTP.ftp_param_decode(pack).params}
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
