"""Millions of hostile datagrams: nothing that a stranger sends may change a bit of a flight, or of the
stored data.

    python benchmarks/hostile.py --in-process 10000000
    python benchmarks/hostile.py --sockets 1000000

In process, a mission is flown twice in step, once undisturbed and once under attack, and the two worlds are
compared bit by bit at every tick. First the vehicle has a signing key, and receives what is not signed with
it (commands, uploads, parameters, replayed frames of the true ground station). Then it has no key, and
receives what is no message, is not for it, or must be refused. Both receive requests for files that leave
their root, or make no sense. Over sockets, the real programs fly and are attacked on all their ports; the
autopilot is killed and started again at the end. A failure is an assertion.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.services.files import MemoryCard
from autopilot.services.ftp import Op, Packet, payload_of
from autopilot.services.identity import identity_of
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import TimesyncAnswered
from autopilot.supervisor.state import Phase
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import encode_mission
from autopilot.wire.signing import Signing, timestamp_of
from benchmarks.processor_time import processor_s
from gcs.closed_loop import Conditions, build_simulator
from missions.fileformat import load_mission

HOME = Home()
KEY, OTHER_KEY = bytes(range(1, 33)), bytes(range(2, 34))
SENSORS, ANSWERS = "sensors", "answers"  # the two ends of the simulator link
LINKS = ("gcs", "api", "stranger", "noise", "gcs", "api", "stranger", "noise", SENSORS, ANSWERS)
MISSION = "delivery"  # waypoints, a release, and a flight home
TIMEOUT_S = 120.0  # time limit: programs start on a busy machine, and may have to compile
TICKS = 80_000  # over which the datagrams are spread
RATE = 20_000  # datagrams per second over sockets


def command_long(command: int, *params: float) -> Any:
    """A command of the true ground station."""
    return m.MAVLink_command_long_message(1, 1, command, 0, *params, *((0.0,) * (7 - len(params))))


ARM = command_long(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
COMMANDS = (  # commands by tick: the mission; and a flight by commands, with the load on the cable to the end
    {250: command_long(m.MAV_CMD_MISSION_START), 260: ARM},
    {
        250: command_long(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0),
        260: ARM,
        6000: command_long(m.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    },
)
MakeDatagram = Callable[[random.Random], bytes]


# ---- what strangers send


def any_bytes(rng: random.Random) -> bytes:
    """Random bytes, or one byte repeated, in half the cases a magic one."""
    if rng.random() < 0.5:
        return rng.randbytes(rng.randrange(60))
    return bytes((rng.choice((0xFE, 0xFD, 0, 0xFF)),)) * rng.randrange(1, 300)


def _random_message(rng: random.Random, kind: Any, system: int) -> Any:
    """A message with random numbers, addressed to this system if it has an addressee."""
    values = list(kind.unpacker.unpack(rng.randbytes(kind.unpacker.size)))
    fields: dict[str, Any] = {}
    for name, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
        text = kind.fieldtypes[kind.fieldnames.index(name)] == "char"
        several = length > 0 and not text
        fields[name] = [values.pop(0) for _ in range(length)] if several else values.pop(0)
    for name in {"target_system", "target"} & fields.keys():
        fields[name] = system
    if "target_component" in fields:
        fields["target_component"] = 1
    return kind(**fields)


def random_frames(rng: random.Random, count: int, system: int) -> list[bytes]:
    """Complete frames of messages of every kind of the dialect, with random numbers."""
    writer, kinds = FrameWriter(255, 190), list(m.mavlink_map.values())
    return [writer.frame(_random_message(rng, rng.choice(kinds), system)) for _ in range(count)]


def harmful_frames(rng: random.Random, count: int, key: bytes | None = None) -> list[bytes]:
    """Complete frames of commands, parameters and uploads that would do harm, signed if there is a key."""
    writer = FrameWriter(255, 190)
    sign = None if key is None else Signing(key, 10**13).signer(1)
    return [writer.frame(message, sign) for _ in range(count // 8) for message in _harmful_messages(rng)]


def _harmful_messages(rng: random.Random) -> Iterator[Any]:
    """Messages that would do harm."""
    yield m.MAVLink_command_long_message(
        1, 1, rng.choice((400, 176, 20, 21, 22, 185, 246, 245, 179, 300, 211, 420, 42600)), 0,
        *(rng.choice((0.0, 1.0, 2.0, 21196.0, float("nan"), float("inf"), -1e9)) for _ in range(7)),
    )  # fmt: skip
    name = rng.choice((b"SIM_LOSS_PCT", b"MIS_SPEED", b"CTL_LAW", b"VEH_LOAD_MASS", b"MAV_SYS_ID"))
    yield m.MAVLink_param_set_message(1, 1, name, rng.choice((0.0, 1.0, 100.0)), 9)
    yield m.MAVLink_mission_clear_all_message(1, 1, rng.choice((0, 1, 2, 255)))
    yield m.MAVLink_mission_count_message(1, 1, rng.randrange(4), rng.choice((0, 1, 2)))
    yield m.MAVLink_set_mode_message(1, rng.randrange(256), rng.getrandbits(32))
    yield m.MAVLink_setup_signing_message(1, 1, list(rng.randbytes(32)), rng.getrandbits(48))
    yield m.MAVLink_manual_control_message(1, 1000, -1000, 1000, -1000, 0xFFFF)
    yield m.MAVLink_mission_set_current_message(1, 1, rng.randrange(9))


def requests_to_refuse(rng: random.Random) -> Iterator[Any]:
    """Requests that a vehicle without a key receives and must refuse."""
    odd = rng.choice((float("nan"), float("inf"), -float("inf"), 1e30))
    yield m.MAVLink_param_set_message(1, 1, rng.choice((b"MIS_SPEED", b"NO_SUCH", b"\xff\xfe", b"")), odd, 9)
    yield m.MAVLink_command_long_message(1, 1, rng.choice((31999, 65535)), 0, *((odd,) * 7))
    yield m.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 0, 1, odd, odd, odd, odd, 1, 1, odd, 0)
    yield m.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0xDC7, odd, odd, odd, *((0.0,) * 8))
    yield m.MAVLink_set_attitude_target_message(0, 1, 1, 0, [odd] * 4, odd, odd, odd, odd)
    yield m.MAVLink_log_request_data_message(1, 1, rng.randrange(9), rng.getrandbits(32), rng.getrandbits(32))


def file_request(rng: random.Random) -> Any:
    """A FILE_TRANSFER_PROTOCOL request of any operation, mostly for paths that are missing or forbidden."""
    name = rng.choice(
        (b"../../etc/passwd", b"/..", b"a/" * 100, b"\0", b"\xff" * 200, b"@MISSION/mission.json", b"", b"/",
         b"log", b"x" * 239, b"a", b"a/b", b"a\0b", b"@SYS/../a", b"@PARAM/param.pck", rng.randbytes(20))
    )  # fmt: skip
    packet = Packet(
        rng.getrandbits(16), rng.randrange(4), rng.choice((*Op, rng.randrange(256))), len(name), 0, 0,
        rng.choice((0, 1, 2**31, 2**32 - 1)), name,
    )  # fmt: skip
    payload = payload_of(packet)
    if rng.random() < 0.2:  # a size that does not match the data
        payload = payload[:4] + bytes((rng.randrange(256),)) + payload[5:]
    return m.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload))


def broken_frame(rng: random.Random, frames: list[bytes]) -> bytes:
    """A frame with a flipped bit, or truncated, or followed by a piece of another; it no longer decodes."""
    while True:
        frame = bytearray(rng.choice(frames))
        if rng.random() < 0.3:
            return bytes(frame[: rng.randrange(1, len(frame))])
        if rng.random() < 0.2:
            frame += rng.choice(frames)[: rng.randrange(1, 20)]
        frame[rng.randrange(1, len(frame))] ^= 1 << rng.randrange(8)
        result = bytes(frame)
        if not decode(result)[0]:  # one of 65,536 changed headers fits the checksum
            return result


def choice_of(frames: list[bytes]) -> MakeDatagram:
    """A maker that chooses one of these frames."""
    return lambda rng: rng.choice(frames)


def datagrams_without_its_key(rng: random.Random) -> dict[str, MakeDatagram]:
    """Makers of datagrams that are not signed with its key."""
    forged = harmful_frames(rng, 8000)
    whole = [*random_frames(rng, 20_000, 1), *forged]
    writer = FrameWriter(255, 190)
    return {
        "bytes": any_bytes,
        "unsigned messages": choice_of(whole),
        "forged commands": choice_of(forged),
        "signed with another key": choice_of(harmful_frames(rng, 8000, OTHER_KEY)),
        "broken": lambda rng: broken_frame(rng, whole),
        "requests for files": lambda rng: writer.frame(file_request(rng)),
    }


def datagrams_for_unsigned_vehicle(rng: random.Random) -> dict[str, MakeDatagram]:
    """Makers of datagrams that are no message, not for it, or to be refused; and of requests for files."""
    whole = [*random_frames(rng, 20_000, 1), *harmful_frames(rng, 8000)]
    writer = FrameWriter(255, 190)
    return {
        "bytes": any_bytes,
        "broken": lambda rng: broken_frame(rng, whole),
        "for another vehicle": choice_of(random_frames(rng, 20_000, 9)),
        "to be refused": choice_of([writer.frame(x) for _ in range(2000) for x in requests_to_refuse(rng)]),
        "requests for files": lambda rng: writer.frame(file_request(rng)),
    }


# ---- in process


class SimulatedVehicle:
    """An autopilot in its world."""

    def __init__(self, key: bytes | None) -> None:
        table = autopilot_parameters(load_vehicle("bebop"))
        table.freeze()
        mission = StoredMission(tuple(encode_mission(load_mission(MISSION), HOME)))
        self.card = MemoryCard()
        signing = None if key is None else Signing(key)
        self.onboard = Onboard(table, identity_of(table), Options(HOME, 0), mission, self.card, signing)
        self.simulator = build_simulator(Conditions(), HOME)
        self.onboard.add_link("gcs")
        self.onboard.add_link("api")
        self.writer = FrameWriter(255, 190)
        self.sign = None if key is None else Signing(key, 10**12).signer(0)
        self.sent_frames: list[bytes] = []
        self.texts: list[str] = []

    def send(self, message: Any) -> None:
        """Send a message of the true ground station."""
        frame = self.writer.frame(message, self.sign)
        self.sent_frames.append(frame)
        self.onboard.receive_ground(frame, "gcs")

    def tick(self) -> None:
        answer = self.onboard.receive_sensors(self.simulator.sensor_datagram())
        assert answer is not None
        for _, datagram in self.onboard.ground_datagrams():
            if b"Internal error" in datagram:
                raise AssertionError(datagram)
        self.simulator.receive(answer)
        self.simulator.advance()

    def receive_from_stranger(self, datagram: bytes, link: str) -> Any:
        """Deliver a stranger's datagram; returns what it causes, which must be nothing."""
        if link == SENSORS:
            return self.onboard.receive_sensors(datagram)
        if link == ANSWERS:
            return self.simulator.receive(datagram) or self.simulator.has_heartbeat(datagram)
        events = self.onboard.receive_ground(datagram, link)
        return [event for event in events if not isinstance(event, TimesyncAnswered)]

    @property
    def stored_data(self) -> Any:
        """The data that outlasts the flight."""
        endpoint = self.onboard.endpoint
        return repr((endpoint.mission, endpoint.areas, self.onboard.parameters.values()))


def fly_under_attack(
    name: str, key: bytes | None, hostile: dict[str, MakeDatagram], count: int, per_tick: int
) -> None:
    """Fly undisturbed and under attack, with `per_tick` datagrams per tick, until `count` have been sent."""
    rng = random.Random(count)
    kinds, phases = Counter[str](), Counter[str]()
    spent_s, flights = 0.0, 0
    while kinds.total() < count:
        undisturbed, attacked = SimulatedVehicle(key), SimulatedVehicle(key)
        makers = list(hostile.items())
        if key is not None:
            makers.append(
                (
                    "replayed",
                    lambda rng, sent_frames=attacked.sent_frames: (
                        rng.choice(sent_frames) if sent_frames else b""
                    ),
                )
            )
        flown = False
        commands = COMMANDS[flights % len(COMMANDS)]
        flights += 1
        while kinds.total() < count and not (flown and undisturbed.onboard.phase == Phase.DISARMED):
            for vehicle in (undisturbed, attacked):
                if vehicle.onboard.tick in commands:
                    vehicle.send(commands[vehicle.onboard.tick])
            for _ in range(per_tick):
                kind, make = rng.choice(makers)
                datagram, link = make(rng), rng.choice(LINKS)
                start_s = time.perf_counter()
                effect = attacked.receive_from_stranger(datagram, link)
                spent_s += time.perf_counter() - start_s
                assert not effect, (kind, link, datagram.hex(), effect)
                kinds[kind] += 1
            phases[attacked.onboard.phase.name.lower()] += per_tick
            undisturbed.tick()
            attacked.tick()
            worlds = [vehicle.simulator.core.rows.world for vehicle in (undisturbed, attacked)]
            assert np.array_equal(*worlds, equal_nan=True), (
                f"the flights part at tick {attacked.onboard.tick}: "
                f"{undisturbed.onboard.phase}, {attacked.onboard.phase}"
            )
            flown = flown or undisturbed.onboard.phase in (Phase.HOLD, Phase.MISSION)
        assert attacked.stored_data == undisturbed.stored_data
    print(f"{name}: {kinds.total()} datagrams, {1e6 * spent_s / kinds.total():.1f} us each; nothing changed")
    for counts in (kinds, phases):
        print("  " + ", ".join(f"{word} {n}" for word, n in counts.most_common()))


# ---- over sockets


def ports_of(pid: int) -> list[int]:
    """The UDP ports that a process has open."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):
            inodes.update(re.findall(r"socket:\[(\d+)\]", str(link.readlink())))
    rows = [line.split() for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]]
    return [int(row[1].split(":")[1], 16) for row in rows if row[9] in inodes]


def attack_ports(ports: list[int], tcp: int, count: int, seed: int, done: Any) -> None:
    """Send `count` datagrams to these ports of this machine, a tenth of them by TCP; `done` counts them."""
    rng = random.Random(seed)
    makers = list(datagrams_without_its_key(rng).values())
    sensors = [
        FrameWriter(1, 200).frame(message)
        for kind in (m.MAVLink_hil_sensor_message, m.MAVLink_hil_actuator_controls_message)
        for message in (_random_message(rng, kind, 1) for _ in range(500))
    ]
    makers.append(choice_of(sensors))
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(8)]
    stream: socket.socket | None = None
    start_s = time.monotonic()
    for sent in range(count):
        datagram = rng.choice(makers)(rng)
        if rng.random() < 0.1:  # by TCP
            try:
                if stream is None:
                    stream = socket.create_connection(("127.0.0.1", tcp), 1.0)
                    stream.settimeout(1.0)
                stream.sendall(datagram)
                if rng.random() < 0.001:
                    stream.close()
                    stream = None
            except OSError:
                stream = None
        else:
            with suppress(OSError):
                rng.choice(sockets).sendto(datagram, ("127.0.0.1", rng.choice(ports)))
        done.value = sent + 1
        ahead_s = sent / RATE - (time.monotonic() - start_s)
        if ahead_s > 0.01:
            time.sleep(ahead_s)


class ApiClient:
    """The true API client: knows the key, starts the flights, and records what the vehicle reports."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(TIMEOUT_S)
        self._writer, self._signing = (
            FrameWriter(255, 191),
            Signing(KEY, timestamp_of(time.time_ns() // 1000)),
        )
        self._vehicle: Any = None
        self.boot_ms, self.armed, self.flights = 0, False, 0
        self.texts: list[str] = []

    def send(self, message: Any) -> None:
        self._signing.advance(timestamp_of(time.time_ns() // 1000))
        self._socket.sendto(self._writer.frame(message, self._signing.signer(2)), self._vehicle)

    def receive(self) -> None:
        """Receive one datagram of the vehicle, which is silent for long only while it starts."""
        datagram, self._vehicle = self._socket.recvfrom(65535)
        for received in decode(datagram)[0]:
            message = received.message
            if message.get_type() == "HEARTBEAT" and message.get_srcComponent() in (0, 1):
                self.armed = bool(message.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
            elif message.get_type() == "ATTITUDE":
                self.boot_ms = message.time_boot_ms
            elif message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)

    def discard_received(self) -> None:
        """Discard what was received from a vehicle that has ended."""
        self._socket.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                self._socket.recv(65535)
        self._socket.settimeout(TIMEOUT_S)

    def fly(self, until: Callable[[], bool]) -> None:
        """Fly missions, one after another, until `until()` is true and the last mission has ended."""
        commanded_ms = -10_000
        flying = False
        while not (until() and not flying):
            self.receive()
            flying = flying or self.armed
            if flying and not self.armed:
                flying = False
                self.flights += 1
            if not flying and not until() and self.boot_ms - commanded_ms > 3000:
                commanded_ms = self.boot_ms
                for message in COMMANDS[0].values():
                    self.send(message)


def stored_state(gcs: Callable[..., str], folder: Path) -> tuple[str, str]:
    """Parameters and mission, as a ground station reads them from the vehicle."""
    values = folder / "values.params"
    values.unlink(missing_ok=True)
    gcs("param", "save", str(values))
    return values.read_text(encoding="utf-8"), gcs("download", "--json")


def over_sockets(count: int, base: int) -> None:
    """Attack the real programs on all their ports."""
    simulator_address, truth, ground, api, tcp = (f"127.0.0.1:{base + i}" for i in range(5))
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        key_file = folder / "key"
        key_file.touch(mode=0o600)
        key_file.write_text(KEY.hex(), encoding="ascii")

        def start(*arguments: str) -> subprocess.Popen[bytes]:
            log = stack.enter_context((folder / f"{arguments[0]}.log").open("ab"))
            program = subprocess.Popen([sys.executable, "-m", *arguments], stdout=log, stderr=log)
            stack.callback(program.wait)
            stack.callback(program.kill)
            return program

        def gcs(*arguments: str) -> str:
            command = [sys.executable, "-m", "gcs", "--signing-key", str(key_file), *arguments]
            return subprocess.run(
                [*command, "--connect", str(base + 2)], check=True, capture_output=True, text=True
            ).stdout

        def start_autopilot() -> subprocess.Popen[bytes]:
            return start(
                *("autopilot", "--sim", simulator_address, "--gcs", ground, "--api", api, "--tcp", tcp),
                *("--storage", str(folder / "storage"), "--signing-key", str(key_file)),
            )

        sitl = start("sitl", "--listen", simulator_address, "--truth", truth, "--speed", "4")
        client = ApiClient(base + 3)
        autopilot = start_autopilot()
        client.receive()
        gcs("upload", MISSION)
        gcs("param", "set", "MIS_SPEED", "1.25")
        before = stored_state(gcs, folder)

        def cost_s(until: Callable[[], bool]) -> float:
            """Processor seconds of the autopilot per tick of 4 ms."""
            before_s, before_ms = processor_s(autopilot.pid), client.boot_ms
            client.fly(until)
            return (processor_s(autopilot.pid) - before_s) / max(client.boot_ms - before_ms, 1) * 4.0

        undisturbed_s = cost_s(lambda: client.flights >= 1)
        done = multiprocessing.Value("l", 0)
        ports = [*ports_of(sitl.pid), *ports_of(autopilot.pid)]
        attack = multiprocessing.Process(
            target=attack_ports, args=(ports, base + 4, count, 1, done), daemon=True
        )
        start_s = time.monotonic()
        attack.start()
        attacked_s = cost_s(lambda: done.value >= count)
        wall_s = time.monotonic() - start_s
        attack.join()
        assert sitl.poll() is None and autopilot.poll() is None, "a program ended"
        after = stored_state(gcs, folder)
        autopilot.kill()
        autopilot.wait()
        client.discard_received()
        autopilot = start_autopilot()
        client.receive()
        restarted = stored_state(gcs, folder)
        logs = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.log"))
    assert before == after == restarted, "parameters or mission are others"
    unexpected = [
        text for text in client.texts if re.search("Internal|failsafe|denied|lost", text, re.IGNORECASE)
    ]
    assert not unexpected, client.texts
    assert "Traceback" not in logs, logs
    print(f"over sockets: {count} datagrams to {len(ports)} ports and by TCP in {wall_s:.0f} s;")
    print(f"  {client.flights} flights of {MISSION} ended as they should; a restart finds everything")
    print(
        f"  autopilot {1e6 * undisturbed_s:.0f} us of processor time a tick in peace, "
        f"{1e6 * attacked_s:.0f} under fire"
    )


def main() -> None:
    """Send as many datagrams as the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--in-process", type=int, default=0, metavar="N", help="so many datagrams in process")
    parser.add_argument("--sockets", type=int, default=0, metavar="N", help="so many over sockets")
    parser.add_argument("--port", type=int, default=14600, help="the first of five ports to use")
    arguments = parser.parse_args()
    if arguments.in_process:
        half = arguments.in_process // 2
        per_tick = max(1, half // TICKS)
        fly_under_attack(
            "with a signing key", KEY, datagrams_without_its_key(random.Random(1)), half, per_tick
        )
        fly_under_attack(
            "without one", None, datagrams_for_unsigned_vehicle(random.Random(2)), half, per_tick
        )
    if arguments.sockets:
        over_sockets(arguments.sockets, arguments.port)


if __name__ == "__main__":
    main()
