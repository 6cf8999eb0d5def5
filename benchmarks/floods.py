"""The cost of a flood of datagrams on the ground ports: processor time of a tick in flight, without a flood
and under each kind of flood.

    python benchmarks/floods.py [--seconds 8] [--port 14600] [--only NAME ...]

The real programs fly with the load on the cable, while one process sends as many datagrams as it can from 64
peers. The vehicle has no signing key and answers requests, because an answered flood costs most. A tick lasts
4000 us: in real time, commands are missed if it takes longer. Measured is the processor time of the
autopilot's thread, so that other programs on a busy machine have no effect.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from autopilot.services.ftp import Op, Packet, payload_of
from autopilot.shell.storage import CARD_DIRECTORY
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import encode_mission
from benchmarks.hostile import command_long, ports_of
from gcs.shell.link import parse_address
from gcs.shell.session import Session
from missions.fileformat import load_mission

PEERS = 64
ITEMS = 200  # of a mission that is uploaded again and again
SUMMARY = re.compile(r"p50 (\d+) p99 (\d+) max (\d+) us; (\d+) of (\d+) took")


LARGE, LARGE_BYTES = "large.bin", 64 * 2**20  # on the card of a vehicle, for requests of its checksum


class Flood(NamedTuple):
    """Datagrams that the peers send in turn, over TCP if `tcp`. `large`: they request the file LARGE."""

    datagrams: list[bytes]
    tcp: bool = False
    large: bool = False


def frames(messages: Iterable[Any]) -> list[bytes]:
    writer = FrameWriter(255, 190)
    return [writer.frame(message) for message in messages]


def file_requests(*requests: tuple[Op, bytes]) -> list[bytes]:
    return frames(
        m.MAVLink_file_transfer_protocol_message(
            0, 1, 1, list(payload_of(Packet(i, 0, op, len(name), 0, 0, 0, name)))
        )
        for i, (op, name) in enumerate(requests)
    )


def parameters(*values: tuple[bytes, float]) -> list[bytes]:
    return frames(m.MAVLink_param_set_message(1, 1, name, value, 9) for name, value in values)


def upload() -> list[bytes]:
    """A mission of many items, sent without waiting for the vehicle's requests."""
    square = encode_mission(load_mission("square"), Home())
    items = [square[1]] * ITEMS
    output = [m.MAVLink_mission_count_message(1, 1, ITEMS, 0)]
    output += [
        m.MAVLink_mission_item_int_message(1, 1, i, mission_type=0, **item._asdict())
        for i, item in enumerate(items)
    ]
    return frames(output)


def all_streams() -> list[bytes]:
    """Requests for all streams, more often than there are ticks."""
    ids = sorted(m.mavlink_map)
    return frames(command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, float(number), 1000.0) for number in ids)


FLOODS: dict[str, Callable[[], Flood]] = {
    "peace": lambda: Flood([]),
    "64 kB of 0xFE": lambda: Flood([b"\xfe" * 65_507]),
    "2 kB of 0xFD": lambda: Flood([b"\xfd" * 2048]),
    "heartbeats": lambda: Flood(frames([m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)])),
    "all parameters": lambda: Flood(frames([m.MAVLink_param_request_list_message(1, 1)])),
    "parameters refused": lambda: Flood(parameters((b"MIS_SPEED", -1.0), (b"NO_SUCH", 1.0))),
    "parameters accepted": lambda: Flood(parameters((b"MIS_SPEED", 1.0), (b"MIS_SPEED", 1.5))),
    "gains accepted": lambda: Flood(parameters((b"PLB_Q_POS", 90.0), (b"PLB_Q_POS", 110.0))),
    "a mission again and again": lambda: Flood(upload()),
    "files made and removed": lambda: Flood(
        file_requests((Op.MAKE_FOLDER, b"a"), (Op.LIST, b"/"), (Op.REMOVE_FOLDER, b"a"))
    ),
    "files read": lambda: Flood(file_requests((Op.CHECKSUM, b"@PARAM/param.pck"), (Op.LIST, b"/log"))),
    "checksums of 64 MiB": lambda: Flood(
        file_requests((Op.CHECKSUM, f"/fs/microsd/{LARGE}".encode())), large=True
    ),
    "setpoints": lambda: Flood(
        frames([m.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0xDF8, 0, 0, -2, *((0.0,) * 8))])
    ),
    "commands": lambda: Flood(
        frames([command_long(m.MAV_CMD_DO_SET_MODE, 1, 4, 3), command_long(m.MAV_CMD_DO_SET_MODE, 1, 4, 5)])
    ),
    "all streams at 1 kHz": lambda: Flood(all_streams()),
    "2 kB of 0xFE by TCP": lambda: Flood([b"\xfe" * 2048], tcp=True),
    "all parameters by TCP": lambda: Flood(frames([m.MAVLink_param_request_list_message(1, 1)]), tcp=True),
}


def send_flood(flood: Flood, ports: list[int], tcp: int, sent: Any) -> None:
    """Send the flood until the process is killed; `sent` counts the datagrams."""
    peers: list[socket.socket] = []
    for _ in range(PEERS):
        if flood.tcp:
            peers.append(socket.create_connection(("127.0.0.1", tcp), 5.0))
            peers[-1].setblocking(False)
        else:
            peers.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    addresses = [("127.0.0.1", port) for port in ports]
    sources = itertools.cycle(peers if flood.tcp else [(x, to) for x in peers for to in addresses])
    for peer in sources:
        for datagram in flood.datagrams:
            with suppress(OSError):
                if flood.tcp:
                    peer.send(datagram)
                    peer.recv(65536)
                else:
                    peer[0].sendto(datagram, peer[1])
                sent.value += 1


class Vehicle:
    """One simulator with one autopilot after another; each takes over the flight that it finds."""

    def __init__(self, folder: Path, base: int) -> None:
        self._folder, self._base = folder, base
        self._listen, truth, self._ground, self._api, self._tcp = (f"127.0.0.1:{base + i}" for i in range(5))
        self._log = folder / "log"
        self._count = 0
        self._sitl = self._start("sitl", "--listen", self._listen, "--truth", truth, "--sensors", "ideal")
        self._autopilot = self._start_autopilot()

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        with self._log.open("wb") as log:
            return subprocess.Popen([sys.executable, "-m", *arguments], stdout=log, stderr=log)

    def _start_autopilot(self, large: bool = False) -> subprocess.Popen[bytes]:
        self._count += 1
        storage = self._folder / str(self._count)
        if large:
            card = storage / CARD_DIRECTORY
            card.mkdir(parents=True)
            (card / LARGE).write_bytes(bytes(LARGE_BYTES))
        return self._start(
            *("autopilot", "--sim", self._listen, "--gcs", self._ground, "--api", self._api),
            *("--tcp", self._tcp, "--storage", str(storage)),
        )

    def take_off(self) -> None:
        with Session(parse_address(self._ground), find_s=60.0) as session:
            session.find()
        for datagrams in (("takeoff", "2"), ("arm",)):
            command = [sys.executable, "-m", "gcs", *datagrams, "--connect", self._ground]
            subprocess.run(command, check=True, capture_output=True)
        self._hold()

    def _hold(self) -> None:
        with Session(parse_address(self._ground), find_s=60.0) as session:
            session.find()
            assert session.watch(lambda: session.view.phase_name == "hold", 60.0), session.view.phase_name

    def _end_autopilot(self) -> str:
        """Stop the autopilot; returns what it printed."""
        self._autopilot.send_signal(signal.SIGINT)
        self._autopilot.wait()
        return self._log.read_text(encoding="utf-8")

    def run_under(self, flood: Flood, seconds: float) -> tuple[int, str]:
        """Run a new autopilot under a flood: how many datagrams were sent, and what the autopilot printed."""
        self._end_autopilot()
        self._autopilot = self._start_autopilot(flood.large)
        self._hold()
        sent = multiprocessing.Value("l", 0)
        arguments = (flood, ports_of(self._autopilot.pid), self._base + 4, sent)
        sender = multiprocessing.Process(target=send_flood, args=arguments, daemon=True)
        if flood.datagrams:
            sender.start()
        time.sleep(seconds)
        output = self._end_autopilot()
        if flood.datagrams:
            sender.kill()
        assert "Traceback" not in output, output
        return sent.value, output

    def close(self) -> None:
        for program in (self._autopilot, self._sitl):
            program.kill()
            program.wait()


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each flood")
    parser.add_argument("--port", type=int, default=14600, help="the first of five ports to use")
    parser.add_argument("--only", nargs="*", choices=FLOODS, help="these floods")
    arguments = parser.parse_args()
    print(f"{'flood':28} {'sent':>9} {'p50':>6} {'p99':>6} {'max':>7}  too long")
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        vehicle = Vehicle(Path(folder), arguments.port)
        stack.callback(vehicle.close)
        vehicle.take_off()
        for name in arguments.only or FLOODS:
            sent, output = vehicle.run_under(FLOODS[name](), arguments.seconds)
            found = SUMMARY.search(output)
            assert found is not None, output
            p50, p99, most, long, ticks = found.groups()
            print(f"{name:28} {sent:9} {p50:>6} {p99:>6} {most:>7}  {long} of {ticks}", flush=True)


if __name__ == "__main__":
    main()
