"""Sockets and processes: loopback only, every wait bounded, nothing left behind."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import pytest
from rich.console import Console

from autopilot.shell.options import ARGUMENTS_ON_STDIN
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter
from gcs.clients.capture import Capture
from gcs.clients.flight import FlightClient, Progress, Stage
from gcs.errors import GcsError, NoVehicleError
from gcs.shell import display as display_module
from gcs.shell import processes as processes_module
from gcs.shell.display import FlightDisplay, StepDisplay, notify, write_to_stdout
from gcs.shell.link import (
    LOOPBACK,
    Address,
    AddressError,
    UdpSocket,
    free_port,
    open_address,
    parse_address,
    wait,
)
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.workflows import flight_loops as loops_module
from gcs.workflows.flight_loops import STALL_LIMIT_S, ClockMonitor, run_lockstep, run_wall_clock

WAIT_S = 10.0  # for what takes milliseconds on an idle machine
TICK_US = 20_000
GOODBYE = b"the test is over"
# a program of the standard library that runs as long as the statement it is given
LASTING = ["-n", "1", "-r", "1", "import signal; signal.pause()"]
DEAF = [*LASTING[:-1], "import signal; signal.signal(15, signal.SIG_IGN); print(flush=True); signal.pause()"]


def written(write: Callable[[str], None]) -> Callable[[str], None]:
    return lambda text: write_to_stdout(lambda: write(text))


@pytest.mark.parametrize(
    ("stream", "write"),
    [("stdout", written(print)), ("stdout", written(Console().print)), ("stderr", notify)],
    ids=["print", "rich", "say"],
)
def test_a_reader_who_has_read_enough_stops_nothing(
    stream: str, write: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with `| head` and `2>&1 | head`."""
    reads, writes = os.pipe()
    os.close(reads)
    out = os.fdopen(writes, "w")
    monkeypatch.setattr(sys, stream, out)
    write("first")
    assert getattr(sys, stream) is not out
    write("second")
    with suppress(BrokenPipeError):
        out.close()


# ---- addresses and sockets


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("14540", Address("127.0.0.1", 14540)),
        ("0.0.0.0:14550", Address("0.0.0.0", 14550)),
        ("udpin:localhost:5", Address("localhost", 5)),
        ("udpout:10.0.0.2:18570", Address("10.0.0.2", 18570, listen=False)),
        ("udpin://127.0.0.1:14540", Address("127.0.0.1", 14540)),
        ("udpin://:14540", Address("0.0.0.0", 14540)),
        ("udp:127.0.0.1:14540", Address("127.0.0.1", 14540)),
        ("udpout://10.0.0.2:18570", Address("10.0.0.2", 18570, listen=False)),
        ("tcp:10.0.0.2:5760", Address("10.0.0.2", 5760, listen=False, tcp=True)),
        ("tcpout://10.0.0.2:5760", Address("10.0.0.2", 5760, listen=False, tcp=True)),
    ],
)
def test_addresses(text, address):
    assert parse_address(text) == address


@pytest.mark.parametrize("text", ["", "x", "1:2:x", "0", "65536", "127.0.0.1:", ":14550", "tcp:1:2:3", "-1"])
def test_bad_addresses_name_what_is_allowed(text):
    with pytest.raises(AddressError, match="must be PORT, HOST:PORT") as error:
        parse_address(text)
    assert "\n" not in str(error.value)


def test_a_busy_port_is_named_with_the_way_out():
    with UdpContext() as taken:
        with pytest.raises(GcsError) as error:
            UdpSocket(port=_where(taken)[1])
        assert taken.address in str(error.value)
    assert "--connect 14540" in str(error.value)


def test_a_vehicle_is_spoken_to_by_tcp():
    whole = FrameWriter(1, 1).frame(mavlink.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0))
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        ours = open_address(parse_address(f"tcp:127.0.0.1:{server.getsockname()[1]}"))
        theirs, _ = server.accept()
        ours.send(b"hello")
        assert theirs.recv(5) == b"hello"
        theirs.sendall(whole + whole[:7])
        wait([ours], WAIT_S)
        assert ours.drain() == [whole], "a frame is given when it is whole"
        theirs.sendall(whole[7:])
        wait([ours], WAIT_S)
        assert ours.drain() == [whole]
        theirs.close()
        wait([ours], WAIT_S)
        assert ours.drain() == [] and not ours.has_datagram, "an ended connection is silent"
        ours.send(b"gone?")
        ours.close()


def test_answers_go_to_whoever_spoke():
    with UdpContext() as ours:
        theirs = open_address(parse_address(f"udpout:{ours.address}"))
        ours.send(b"to nobody yet")
        assert not ours.has_datagram
        theirs.send(b"hello")
        wait([ours], WAIT_S)
        assert ours.has_datagram
        assert ours.drain() == [b"hello"]
        ours.send(b"hello yourself")
        wait([theirs], WAIT_S)
        assert theirs.drain() == [b"hello yourself"]
        theirs.close()
        for _ in range(3):  # the kernel reports the closed port; that must not stop us
            ours.send(b"gone?")
            ours.drain()


class UdpContext(UdpSocket):
    """A socket that is closed at the end of its block."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


# ---- the loops


class LockstepVehicle(threading.Thread):
    """The scripted vehicle behind a socket: a turn every 20 ms of its time, no wall clock.

    In every `repeat`-th turn the question is sent twice, as after a silence. In every third turn the truth
    is a tick ahead of the question.
    """

    def __init__(self, scripted, ground: UdpSocket, truth: UdpSocket, repeat: int, turns: int) -> None:
        super().__init__(daemon=True)
        self.scripted = scripted
        self.repeat = repeat
        self.turns = turns
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(WAIT_S)
        self.ground = _where(ground)
        self.truth = _where(truth)
        self.writer = FrameWriter(1, 1)
        self.world = FrameWriter(1, 26)
        self.silent_until_us = 0  # as the ground station has promised

    def run(self) -> None:
        try:
            for turn in range(1, self.turns + 1):
                self._turn(turn)
        except OSError:  # the ground station has ended
            return
        finally:
            self.socket.close()

    def _turn(self, turn: int) -> None:
        now_us = turn * TICK_US
        # truth every 8 ms; in every third turn the world is already a tick ahead of the question
        first = -(-(now_us - TICK_US + 1) // 8_000) * 8_000
        ahead = 8_000 if turn % 3 == 0 else 0
        sent_before = 8_000 if turn % 3 == 1 and turn > 1 else 0
        for time_us in range(first + sent_before, now_us + ahead + 1, 8_000):
            status = mavlink.MAVLink_sim_status_message(time_us, 0.0, 0.0, 0, 0, 0, 0, 1, 1)
            self.socket.sendto(self.world.frame(status), self.truth)
        for datagram in self.scripted.tick(now_us):
            self.socket.sendto(datagram, self.ground)
        questions = 2 if self.repeat and turn % self.repeat == 0 else 1
        for _ in range(questions):
            self.socket.sendto(
                self.writer.frame(mavlink.MAVLink_timesync_message(0, now_us * 1000)), self.ground
            )
        answers = 0 if now_us >= self.silent_until_us else questions
        while answers < questions:
            datagram = self.socket.recv(65535)
            if datagram == GOODBYE:
                raise ConnectionAbortedError
            (one,) = decode(datagram)[0]
            if one.id != mavlink.MAVLINK_MSG_ID_TIMESYNC:
                self.scripted.receive(datagram)
            elif one.message.ts1 == now_us * 1000:  # else it answers an earlier, repeated question
                answers += 1
                self.silent_until_us = one.message.tc1 // 1000


def _where(udp: UdpSocket) -> tuple[str, int]:
    host, port = udp.address.split(":")
    return host, int(port)


def short_flight(vehicle, t):
    for end, phase, item in (
        (1.0, mavlink.PLUMBLINE_PHASE_LIFT, 0),
        (2.0, mavlink.PLUMBLINE_PHASE_MISSION, 1),
        (3.0, mavlink.PLUMBLINE_PHASE_LOWER, len(vehicle.mission) - 1),
    ):
        if t < end:
            vehicle.phase, vehicle.item = phase, item
            return
    if vehicle.armed:
        vehicle.arm(False)


def fly_lockstep(new_world, items, path: Path, repeat: int, turns: int = 1_000) -> FlightClient:
    scripted = new_world().vehicle
    scripted.script = short_flight
    client = FlightClient(items[:2] + items[-1:], 10.0)
    with UdpContext() as ground, UdpContext() as truth, StopRequest("") as stop, path.open("wb") as file:
        vehicle = LockstepVehicle(scripted, ground, truth, repeat, turns)
        vehicle.start()
        display = FlightDisplay("test", quiet=True)
        ended = lambda: "" if vehicle.is_alive() else "autopilot was killed by SIGKILL"  # noqa: E731
        run_lockstep(client, Capture(TlogWriter(file)), ground, truth, ended, display, stop, lambda: None)
        ground.send(GOODBYE)
    vehicle.join(WAIT_S)
    return client


@pytest.mark.parametrize(
    ("own_code", "work"),
    [((), ""), (("slow.py:Slow",), "an answer of slow.py:Slow, or ")],
)
def test_an_autopilot_that_works_is_waited_for(
    new_world, items, tmp_path, monkeypatch, capsys, own_code, work
):
    for limit in ("SILENCE_LIMIT_S", "BUSY_CHECK_S"):
        monkeypatch.setattr(loops_module, limit, 0.05)
    looked = []
    scripted = new_world().vehicle
    scripted.script = short_flight
    client = FlightClient(items[:2] + items[-1:], 10.0)
    path = tmp_path / "x.tlog"
    with UdpContext() as ground, UdpContext() as truth, StopRequest("") as stop, path.open("wb") as file:
        LockstepVehicle(scripted, ground, truth, 0, turns=100).start()
        run_lockstep(
            client,
            Capture(TlogWriter(file)),
            ground,
            truth,
            lambda: "it has ended" if len(looked) >= 3 else "",
            FlightDisplay("test", quiet=True),
            stop,
            lambda: None,
            is_busy=lambda: not looked.append(None),
            own_code=own_code,
        )
        ground.send(GOODBYE)
    assert client.outcome is not None and client.outcome.reason == "it has ended"
    waiting = "waiting for the autopilot, which is computing (for example"
    assert capsys.readouterr().err.count(f"{waiting} {work}shaping a difficult path)") == 1


def test_an_autopilot_that_compiles_before_it_starts_is_waited_for(items, tmp_path, monkeypatch, capsys):
    for limit in ("START_LIMIT_S", "START_CHECK_S"):
        monkeypatch.setattr(loops_module, limit, 0.05)
    looked = []
    client = FlightClient(items[:2] + items[-1:], 10.0)
    path, display = tmp_path / "x.tlog", FlightDisplay("test", quiet=True)

    def fly(is_busy, end_reason):
        with UdpContext() as ground, UdpContext() as truth, StopRequest("") as stop, path.open("wb") as file:
            link = (ground, truth, end_reason, display, stop, lambda: None)
            run_lockstep(client, Capture(TlogWriter(file)), *link, is_busy=is_busy)

    with pytest.raises(NoVehicleError, match="it has ended"):
        fly(lambda: not looked.append(None), lambda: "it has ended" if len(looked) >= 3 else "")
    told = "waiting for the autopilot, which is computing (for example compiling before it starts)"
    assert capsys.readouterr().err.count(told) == 1
    with pytest.raises(NoVehicleError, match="the autopilot has sent nothing for 0 s"):
        fly(lambda: False, lambda: "")


def test_an_idle_autopilot_may_wait_for_what_the_user_has_written(new_world, items, tmp_path, monkeypatch):
    monkeypatch.setattr(loops_module, "SILENCE_LIMIT_S", 0.05)
    scripted = new_world().vehicle
    scripted.script = short_flight
    client = FlightClient(items[:2] + items[-1:], 10.0)
    path, display = tmp_path / "x.tlog", FlightDisplay("test", quiet=True)
    with UdpContext() as ground, UdpContext() as truth, StopRequest("") as stop, path.open("wb") as file:
        LockstepVehicle(scripted, ground, truth, 0, turns=100).start()
        link = (ground, truth, lambda: "", display, stop, lambda: None)
        run_lockstep(client, Capture(TlogWriter(file)), *link, own_code=("slow.py:Slow",))
        ground.send(GOODBYE)
    assert client.outcome is not None
    assert client.outcome.reason == "the autopilot has sent nothing for 0 s, perhaps waiting for slow.py:Slow"


def test_lockstep_writes_the_same_bytes_whatever_is_repeated(new_world, items, tmp_path):
    logs = []
    for repeat in (0, 5):
        path = tmp_path / f"{repeat}.tlog"
        client = fly_lockstep(new_world, items, path, repeat)
        assert client.outcome is not None
        assert client.outcome.name == "completed"
        logs.append(path.read_bytes())
    assert logs[0] == logs[1]
    assert len(logs[0]) > 10_000


def test_items_are_counted_as_mavlink_counts_them(capsys):
    """From 0; the number after the slash is that of the last item."""
    progress = Progress(Stage.FLY, "mission", 3, 7, 0.5, None, None, 12.0, "")
    with FlightDisplay("test", quiet=False) as display:
        display.update(progress)
    assert capsys.readouterr().err == "gcs:   12.0 s  mission  item 3/6\n"


def test_a_long_step_says_where_no_bar_can_be_that_it_works(monkeypatch, capsys):
    now_s = [100.0]
    monkeypatch.setattr(display_module.time, "monotonic", lambda: now_s[0])
    with StepDisplay("fitting", long=True) as display:
        for done, at_s in enumerate((100.2, 101.0, 105.0, 112.0), 1):
            now_s[0] = at_s
            display.update(done, 4)
    assert capsys.readouterr().err == "gcs: fitting: 2 of 4\ngcs: fitting: 4 of 4\n"
    with StepDisplay("fitting") as short:
        short.update(1, 4)
    assert capsys.readouterr().err == ""


def test_an_autopilot_that_dies_in_flight_is_an_outcome(new_world, items, tmp_path):
    client = fly_lockstep(new_world, items, tmp_path / "x.tlog", 0, turns=100)
    assert client.outcome is not None
    assert client.outcome.name == "lost"
    assert client.outcome.reason == "autopilot was killed by SIGKILL"


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_process_that_ends_before_the_flight_is_an_error(items, tmp_path, lockstep):
    client = FlightClient(items, 10.0)
    display = FlightDisplay("test", quiet=True)
    with UdpContext() as ground, UdpContext() as truth, StopRequest("") as stop:
        capture = Capture(TlogWriter((tmp_path / "x.tlog").open("wb")))
        arguments = (client, capture, ground, truth, lambda: "sitl ended with exit code 1: no", display, stop)
        with pytest.raises(NoVehicleError, match="sitl ended with exit code 1: no"):
            if lockstep:
                run_lockstep(*arguments, lambda: None)
            else:
                run_wall_clock(*arguments, lambda: None)


@pytest.mark.parametrize("lockstep", [True, False])
def test_ctrl_c_stops_the_flight_once_and_in_order(items, tmp_path, lockstep, capsys):
    client = FlightClient(items, 10.0)
    display = FlightDisplay("test", quiet=True)
    with UdpContext() as ground, UdpContext() as truth, StopRequest("stopping") as stop:
        signal.raise_signal(signal.SIGINT)
        capture = Capture(TlogWriter((tmp_path / "x.tlog").open("wb")))
        arguments = (client, capture, ground, truth, lambda: "", display, stop)
        if lockstep:
            run_lockstep(*arguments, lambda: None)
        else:
            run_wall_clock(*arguments, lambda: None)
        assert client.outcome is not None
        assert client.outcome.name == "interrupted"
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert capsys.readouterr().err == "gcs: stopping\n"


def test_a_clock_that_stands_while_the_vehicle_speaks_is_told_but_not_one_that_we_did_not_look_at():
    clock = ClockMonitor(now_s=0.0)
    assert clock.stall_reason(None, 1000.0) == "", "it is not known before the vehicle tells"
    told = [clock.stall_reason(12_500_000, 1000.0 + second) for second in range(int(STALL_LIMIT_S) + 1)]
    assert told[:-1] == [""] * int(STALL_LIMIT_S)
    assert told[-1].startswith(
        "the vehicle's clock has stood at 12.500 s for 60 s: the autopilot speaks, but"
    )
    assert clock.stall_reason(12_508_000, 1061.0) == ""
    assert clock.stall_reason(12_508_000, 5000.0) == "", "we were held up ourselves"


# ---- processes


def test_a_child_is_stopped_and_reaped(tmp_path):
    with Processes() as processes:
        child = processes.start("timeit", LASTING, tmp_path / "log")
        assert processes.end_reason() == ""
        assert os.getpgid(child.pid) == child.pid, "Ctrl-C of the terminal must not reach it"
    assert child.exit_code == -signal.SIGTERM


def test_a_loaded_program_starts_with_the_arguments_that_follow_and_writes_to_its_log(tmp_path):
    log = tmp_path / "log"
    log.write_text("of an earlier flight")
    with Processes() as processes:
        processes.load("sitl")
        assert processes.end_reason() == "", "it is none of the flight's yet"
        child = processes.start("sitl", ["--vehicle", "no such", "--listen", str(free_port())], log)
        assert child.wait(WAIT_S)
        assert processes.end_reason().startswith("sitl ended with exit code 2: unknown vehicle 'no such'")
    written = log.read_text()  # after a line that the simulator is compiled, if it is
    assert "sitl: unknown vehicle 'no such'" in written and "of an earlier flight" not in written


def test_a_loaded_program_that_has_ended_is_started_anew(tmp_path):
    with Processes() as processes:
        waiting = processes.load("no_such_module")
        assert waiting.wait(WAIT_S)
        child = processes.start("no_such_module", [], tmp_path / "log")
        assert child is not waiting and child.wait(WAIT_S)
        assert processes.end_reason().endswith("No module named no_such_module")


def test_a_loaded_program_that_would_not_find_its_machine_code_is_started_anew(tmp_path, monkeypatch):
    log = tmp_path / "log"
    with Processes() as processes:
        waiting = processes.load("sitl")
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
        child = processes.start("sitl", ["--vehicle", "no such"], log)
        assert child is not waiting and not waiting.running and child.wait(WAIT_S)
    assert "sitl: unknown vehicle 'no such'" in log.read_text()


def test_a_loaded_program_that_is_never_started_is_stopped():
    with Processes() as processes:
        waiting = processes.load("sitl")
    assert waiting.exit_code == -signal.SIGTERM
    command = [sys.executable, "-m", "sitl", ARGUMENTS_ON_STDIN]
    ended = subprocess.run(command, check=True, stdin=subprocess.DEVNULL, capture_output=True, timeout=WAIT_S)
    assert (ended.stdout, ended.stderr) == (b"", b""), "nobody is there any more to start it"


def test_a_deaf_child_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(processes_module, "STOP_S", 0.3)
    log = tmp_path / "log"
    with Processes() as processes:
        child = processes.start("timeit", DEAF, log)
        poll_until(lambda: log.stat().st_size > 0, child)
    assert child.exit_code == -signal.SIGKILL


def test_an_early_end_is_one_line_with_the_last_words(tmp_path):
    with Processes() as processes:
        child = processes.start("timeit", ["--no-such-option"], tmp_path / "log")
        assert child.wait(WAIT_S)
        line = processes.end_reason()
    assert line.startswith("timeit ended with exit code 2: ")
    assert "\n" not in line


def test_a_child_that_is_stopped_for_long_is_named_and_one_that_goes_on_is_not(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes_module, "STOPPED_LIMIT_S", 0.2)
    monkeypatch.setattr(processes_module, "CHECK_INTERVAL_S", 0.02)
    with Processes() as processes:
        child = processes.start("timeit", LASTING, tmp_path / "log")
        assert processes.end_reason() == processes.stopped_children() == ""
        os.kill(child.pid, signal.SIGSTOP)
        said = []
        poll_until(lambda: said.append(processes.stopped_children()) or said[-1], child)
        assert said[-1] == f"timeit (process {child.pid}) stopped by a signal"
        poll_until(lambda: said.append(processes.end_reason()) or said[-1], child)
        assert said[-1].startswith(f"timeit (process {child.pid}) has been stopped by a signal for ")
        waiting = f"gcs: timeit (process {child.pid}) is stopped by a signal: waiting for it\n"
        assert capsys.readouterr().err == waiting, "at once, and once"
        os.kill(child.pid, signal.SIGCONT)
        poll_until(lambda: not processes.stopped_children(), child)


def test_a_child_that_computes_works_and_one_that_waits_does_not(tmp_path, monkeypatch):
    monkeypatch.setattr(processes_module, "CHECK_INTERVAL_S", 0.1)
    with Processes() as processes:
        child = processes.start("timeit", ["-n", "1", "-r", "1", "while True: pass"], tmp_path / "log")
        poll_until(processes.are_busy, child)
    with Processes() as processes:
        child = processes.start("timeit", DEAF, tmp_path / "log")
        poll_until(child.log.read_bytes, child)  # it has begun to wait
        poll_until(lambda: not processes.are_busy(), child)


def test_the_prefix_of_the_program_is_said_once(tmp_path):
    with Processes() as processes:
        child = processes.start("timeit", LASTING, tmp_path / "log")
        child.log.write_text("warning\ntimeit: cannot listen on 127.0.0.1:1\n\n")
        child.exit_code = 1
        assert child.exit_report() == "timeit ended with exit code 1: cannot listen on 127.0.0.1:1"
        child.exit_code = -9
        assert child.exit_report().startswith("timeit was killed by SIGKILL: ")
        child.log.write_text("")
        child.exit_code = 0
        assert child.exit_report() == "timeit ended with exit code 0, as after SIGTERM"


@pytest.mark.parametrize("cores", [1, 2])
def test_children_share_a_core_and_we_get_ours_back(tmp_path, cores):
    before = os.sched_getaffinity(0)
    if len(before) < cores:
        pytest.skip("there is one core")
    few = set(sorted(before)[:cores])
    os.sched_setaffinity(0, few)
    try:
        with Processes() as processes:
            children = [processes.start("timeit", LASTING, tmp_path / name) for name in ("one", "other")]
            processes.share_one_core()
            theirs, others = (os.sched_getaffinity(child.pid) for child in children)
            assert theirs == others
            assert len(theirs) == 1
            assert os.sched_getaffinity(0) == (few - theirs or few)
        assert os.sched_getaffinity(0) == few
    finally:
        os.sched_setaffinity(0, before)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="PR_SET_PDEATHSIG is Linux's")
def test_nothing_outlives_a_killed_gcs(tmp_path):
    program = (
        "import sys; from pathlib import Path; from gcs.shell.processes import Processes\n"
        f"child = Processes().start('timeit', {LASTING!r}, Path(sys.argv[1]))\n"
        "print(child.pid, flush=True); sys.stdin.read()"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "log")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert parent.stdout is not None and parent.stdin is not None
    pid = int(parent.stdout.readline())
    watch = os.pidfd_open(pid)
    parent.kill()
    parent.wait(WAIT_S)
    assert select.select([watch], [], [], WAIT_S)[0], "the child still runs"
    os.close(watch)
    parent.stdout.close()
    parent.stdin.close()


def poll_until(condition, child) -> None:
    """Wait, for a bounded time, until a condition holds; the child must not end meanwhile."""
    for _ in range(int(WAIT_S / 0.05)):
        if condition():
            return
        assert not child.wait(0.05)
    pytest.fail("never came")


def test_free_ports_are_free_for_udp_and_tcp_and_no_other_socket_is_given_them_meanwhile():
    port = free_port(2)
    UdpSocket(port=port).close()
    told = f"all ports of {LOOPBACK} from {port} to {port + 1} are in use"
    with (
        socket.create_server((LOOPBACK, port)),
        closing(UdpSocket(port=port + 1)),
        pytest.raises(GcsError, match=told),
    ):
        free_port(among=range(port, port + 2))
    assert port < 32_768
