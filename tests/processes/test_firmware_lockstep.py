"""How far the firmwares are deterministic: flown by a pilot in lockstep, then fed with the recording.

PLUMBLINE_ARDUCOPTER=./arducopter PLUMBLINE_PX4=build/px4_sitl_default/bin/px4 pytest THIS FILE
"""

from __future__ import annotations

import os
import socket
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.resources import files
from pathlib import Path

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.interfaces import ardupilot, px4

PATIENCE_S = 20.0
FORCED = 21196.0  # of COMPONENT_ARM_DISARM: without checks
READY_S, ARM_S, CLIMB_S, END_S = 8.0, 14.0, 16.0, 20.0  # of the firmware's time
# share of full throttle: PX4's threads run when the machine schedules them
PX4_WITHIN = 0.1
PX4_INSTANCE = 9  # added to the ports of instance 0

pytestmark = pytest.mark.processes


def program(variable: str) -> Path:
    if variable not in os.environ:
        pytest.skip(f"{variable} names no program to fly with")
    return Path(os.environ[variable]).resolve()


def shipped(kind: str) -> list[str]:
    text = (files("sitl.interfaces") / f"{kind}.parm").read_text(encoding="ascii")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


@contextmanager
def running(command: Sequence[str], folder: Path, **environment: str) -> Iterator[None]:
    with (folder / "said.txt").open("wb") as said:
        process = subprocess.Popen(
            command, cwd=folder, stdout=said, stderr=said, env={**os.environ, **environment}
        )
        try:
            yield
        finally:
            process.kill()
            process.wait()


class Pilot:
    """Arms, climbs and leans a little, always before the same ticks."""

    def __init__(self, rate_hz: int) -> None:
        self.rate_hz = rate_hz
        self.writer = FrameWriter(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)

    def sticks(self, tick: int) -> tuple[int, int, int, int]:
        """Roll, pitch, throttle, yaw, us."""
        at_s = tick / self.rate_hz
        lean = CLIMB_S + 1.0 < at_s < CLIMB_S + 2.0
        return 1540 if lean else 1500, 1460 if lean else 1500, 1700 if at_s > CLIMB_S else 1000, 1500

    def override(self, tick: int) -> list[bytes]:
        """The controls as messages of a ground station."""
        said = []
        if tick >= READY_S * self.rate_hz and tick % self.rate_hz == 0:
            said.append(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        if tick == ARM_S * self.rate_hz:
            arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, FORCED, 0.0, 0.0, 0.0, 0.0, 0.0
            said.append(mavlink.MAVLink_command_long_message(1, 1, *arm))
        if tick >= READY_S * self.rate_hz and tick % 80 == 0:
            channels = *self.sticks(tick), 0, 0, 0, 0
            said.append(mavlink.MAVLink_rc_channels_override_message(1, 1, *channels))
        return [self.writer.frame(message) for message in said]

    def radio(self, tick: int) -> bytes:
        """The controls as those of a radio whose seventh channel arms."""
        if tick % 10:
            return b""
        armed = 2000 if tick > ARM_S * self.rate_hz else 1000
        channels = *self.sticks(tick), 1500, 1500, armed, 1500, *(0,) * 10
        at_ms = tick * 1000 // self.rate_hz
        return self.writer.frame(mavlink.MAVLink_rc_channels_message(at_ms, 8, *channels, 100))


def fly_ardupilot(folder: Path, answers: Sequence[bytes] = ()) -> tuple[list[bytes], list[bytes]]:
    """The packets of a flight and the answers to them: `answers` if given, else those of our simulator."""
    folder.mkdir()
    parameters = [
        *shipped("ardupilot"),
        "ARMING_CHECK 0",
        "INITIAL_MODE 0",
        *(f"FLTMODE{i} 0" for i in range(1, 7)),
    ]
    (folder / "own.parm").write_text("\n".join(parameters) + "\n", encoding="ascii")
    world = HilSimulator.build("iris", "rtk", 1, {"SIM_RATE_HZ": ardupilot.RATE_HZ})
    exchange, pilot = ardupilot.Exchange(world), Pilot(ardupilot.RATE_HZ)
    packets: list[bytes] = []
    told: list[bytes] = []
    with (
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as physics,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as ground,
    ):
        for one in (physics, ground):
            one.bind(("127.0.0.1", 0))
        physics.settimeout(PATIENCE_S)
        ground.setblocking(False)
        port, at = physics.getsockname()[1], "{}:{}".format(*ground.getsockname())
        command = [
            *(str(program("PLUMBLINE_ARDUCOPTER")), "--model", "JSON:127.0.0.1", "--sim-port-out", str(port)),
            *("--defaults", "own.parm", "--wipe", "--home", "47.397742,8.545594,0,0"),
            *("--serial0", f"udpclient:{at}", "--serial1", "none", "--serial2", "none"),
        ]
        with running(command, folder):
            vehicle = None
            while len(packets) < END_S * ardupilot.RATE_HZ:
                packet, sender = physics.recvfrom(65535)
                servos = ardupilot.read_servo_packet(packet)
                assert servos and servos.number == len(packets)
                # a clock by which no answer ever counts as lost
                answer = answers[servos.number] if answers else exchange.receive(servos, 0.0).answer
                with suppress(BlockingIOError):
                    while True:
                        vehicle = ground.recvfrom(65535)[1]
                for frame in pilot.override(servos.number):
                    assert vehicle, "it has not spoken to the ground"
                    ground.sendto(frame, vehicle)
                packets.append(packet)
                told.append(answer)
                physics.sendto(answer, sender)
    return packets, told


def test_arducopter_says_the_same_bytes_to_one_seed_and_to_what_was_recorded(tmp_path: Path) -> None:
    first, told = fly_ardupilot(tmp_path / "first")
    again, told_again = fly_ardupilot(tmp_path / "again")
    replayed, _ = fly_ardupilot(tmp_path / "replayed", told)
    flown = ardupilot.read_servo_packet(first[-1])
    assert flown and min(flown.pwm[:4]) > 1500 and len(set(first)) == len(first)
    assert again == first and told_again == told
    assert replayed == first


def fly_px4(folder: Path, sensors: Sequence[bytes] = ()) -> tuple[dict[int, tuple[float, ...]], list[bytes]]:
    """The throttles by their time (us), and what was sent at each tick: `sensors` if given."""
    binary = program("PLUMBLINE_PX4")
    folder.mkdir()
    radio = ["COM_RC_IN_MODE 0", "RC_CHAN_CNT 8", "RC_MAP_ARM_SW 7", "RC3_TRIM 1000", "RC7_TRIM 1000"]
    radio += [f"RC_MAP_{name} {i}" for i, name in enumerate(("ROLL", "PITCH", "THROTTLE", "YAW"), 1)]
    lines = [line.split()[:2] for line in (*shipped("px4"), *radio, "COM_ARM_WO_GPS 1")]
    text = "".join(f"param set-default {name} {value}\n" for name, value in lines)
    (folder / "px4-rc.params").write_text(text, encoding="ascii")
    world = HilSimulator.build("iris", "rtk", 1, {"SIM_RATE_HZ": px4.RATE_HZ})
    exchange, pilot = px4.Exchange(world), Pilot(px4.RATE_HZ)
    stream, throttles, sent = px4.Stream(), {}, []
    with closing(socket.socket()) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind(("127.0.0.1", 4560 + PX4_INSTANCE))
        server.listen(1)
        server.settimeout(PATIENCE_S)
        etc = binary.parent.parent / "etc"
        command = [
            *(str(binary), "-i", str(PX4_INSTANCE), "-d", str(etc)),
            *("-s", "etc/init.d-posix/rcS", "-w", str(folder)),
        ]
        path = f"{folder}:{os.environ.get('PATH', '')}"
        with (
            running(command, folder, PATH=path, PX4_SIM_MODEL="none_iris"),
            closing(server.accept()[0]) as link,
        ):
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for tick in range(round(END_S * px4.RATE_HZ)):
                sent.append(sensors[tick] if sensors else exchange.sensors())
                link.sendall(pilot.radio(tick) + sent[-1])
                answered = False
                while not answered:
                    # until its first answer it starts by the wall clock, and is not waited for
                    link.settimeout(PATIENCE_S if exchange.in_lockstep else 1.0 / px4.RATE_HZ)
                    try:
                        piece = link.recv(65536)
                    except TimeoutError:
                        assert not exchange.in_lockstep, f"no answer to tick {tick}"
                        break
                    assert piece, "it has closed the connection"
                    for frame in stream.feed(piece):
                        message = decode(frame)[0][0].message
                        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
                            throttles[message.time_usec] = tuple(message.controls[:4])
                    answered = exchange.receive(piece)
                world.advance()
    return throttles, sent


def test_px4_answers_each_tick_and_differs_by_little(tmp_path: Path) -> None:
    """It is not deterministic: its threads read shared data when the machine schedules them."""
    first, sent = fly_px4(tmp_path / "first")
    again, _ = fly_px4(tmp_path / "again", sent)
    both = sorted(set(first) & set(again))
    assert min(first[both[-1]]) > 0.4
    # all ticks except those of its start
    assert len(both) > (END_S - 2.0) * px4.RATE_HZ
    apart = max(abs(a - b) for at in both for a, b in zip(first[at], again[at], strict=True))
    assert apart < PX4_WITHIN
