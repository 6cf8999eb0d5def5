"""plumbline.connect where there is nothing to connect to; with a vehicle: tests/processes/test_connect.py."""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import plumbline
from autopilot.wire.codec import FrameWriter
from autopilot.wire.convert.telemetry import attitude_values, local_position_ned_values
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import roll_pitch_yaw
from gcs.clients.datagrams import messages
from gcs.clients.missions import MissionUpload
from gcs.clients.operation import Result, Status, Target
from gcs.clients.vehicle_view import VehicleView
from gcs.errors import RefusedError
from gcs.shell import display
from gcs.shell.link import UdpSocket, free_port
from gcs.workflows.reposition import reposition
from plumbline import RunningVehicle
from plumbline.running import Condition, _newly, _reeled
from plumbline.state import State, state_of

WRONG: dict[str, tuple[Any, str]] = {
    "address": (lambda: plumbline.connect("14550x"), "address '14550x'; must be PORT, HOST:PORT, udpin:"),
    "port": (lambda: plumbline.connect(0), "address = 0; must be "),
    "flag": (lambda: plumbline.connect(True), "address = True; must be "),
    "tcp": (
        lambda: plumbline.connect(f"tcp:127.0.0.1:{free_port()}"),
        "cannot be connected to: Connection refused; does the vehicle listen there (autopilot --tcp ",
    ),
    "nobody": (
        lambda: plumbline.connect(f"udpin:127.0.0.1:{free_port()}", timeout_s=0.1),
        "within 0.1 s; is autopilot running, with its simulator, and sending there? "
        "(another address: connect(14540))",
    ),
    "nobody to speak to": (
        lambda: plumbline.connect(f"udpout:127.0.0.1:{free_port()}", timeout_s=0.1),
        "no vehicle heard on UDP udpout:127.0.0.1:",
    ),
}


UNMET = RunningVehicle.__new__(
    RunningVehicle
)  # not connected to a vehicle: errors are reported before any request
ARGUMENTS: dict[str, tuple[Any, str]] = {
    "goto": (lambda: UNMET.goto("a", 0, 1), "east_m = 'a'; must be a finite number"),  # type: ignore[arg-type]
    "goto nowhere": (lambda: UNMET.goto(float("nan"), 0, 1), "east_m = nan; must be a finite number"),
    "goto height": (lambda: UNMET.goto(0, 0, [1]), "up_m = [1]; must be a finite number"),  # type: ignore[arg-type]
    "goto speed": (lambda: UNMET.goto(0, 0, speed_m_s=0), "speed_m_s = 0; must be greater than 0"),
    "winch": (lambda: UNMET.winch("out"), "length_m = 'out'; must be a finite number"),  # type: ignore[arg-type]
    "winch speed": (lambda: UNMET.winch(0.1, speed_m_s=-1.0), "speed_m_s = -1.0; must be greater than 0"),
    "takeoff": (lambda: UNMET.takeoff("high"), "up_m = 'high'; must be a finite number"),  # type: ignore[arg-type]
    "arm": (lambda: UNMET.arm(timeout_s=None), "timeout_s = None; must be a finite number"),  # type: ignore[arg-type]
    "land": (lambda: UNMET.land(timeout_s=-1), "timeout_s = -1; must be greater than 0"),
    "mode": (lambda: UNMET.mode("holt"), "mode 'holt': there is none; did you mean hold? must be one of"),
    "mode number": (lambda: UNMET.mode(3), "mode = 3; must be a text, as 'hold'"),  # type: ignore[arg-type]
    "parameter": (lambda: UNMET.parameter(3), "parameter: 3 is no name of a parameter"),  # type: ignore[arg-type]
    "value": (lambda: UNMET.set_parameter("MIS_SPEED", "x"), "MIS_SPEED = 'x'; must be a finite number"),  # type: ignore[arg-type]
    "upload": (lambda: UNMET.upload(3), "mission = 3; must be a name, the path of a file, or a"),  # type: ignore[arg-type]
    "upload vehicle": (lambda: UNMET.upload("hover", vehicle=3), "vehicle = 3; must be a name"),  # type: ignore[arg-type]
    "wait": (lambda: UNMET.wait(None), "wait None: must be one of ready, holding,"),  # type: ignore[arg-type]
    "wait for ever": (lambda: UNMET.wait(float("inf")), "wait = inf; must be a finite number"),
    "wait for nan": (lambda: UNMET.wait(float("nan")), "wait = nan; must be a finite number"),
    "wait for the past": (lambda: UNMET.wait(-1), "wait = -1; must be 0 or more"),
    "wait limit of a time": (lambda: UNMET.wait(3.0, -1.0), "timeout_s = -1.0; must be greater than 0"),
    "wait limit": (lambda: UNMET.wait("ready", "long"), "timeout_s = 'long'; must be a finite number"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize(("call", "says"), ARGUMENTS.values(), ids=ARGUMENTS)
def test_an_argument_is_looked_at_before_the_vehicle_is_asked(call: Any, says: str) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_one_line(call: Any, says: str) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value) and "\n" not in str(told.value)


def test_a_winch_is_awaited_while_the_vehicle_still_has_to_stop() -> None:
    """From 3 s on, when the vehicle has stopped, the winch moves for 2 s."""
    known = dict.fromkeys(one.name for one in fields(State))

    def state(time_s: float, moves: bool = True) -> State:
        length_m = 0.7 + 0.3 * min(max(time_s - 3.0, 0.0), 2.0) / 2.0
        moving = moves and 3.0 < time_s < 5.0
        return State(
            **{
                **known,
                "time_s": time_s,
                "load_speed_m_s": 0.05,
                "winch_moving": moving,
                "cable_length_m": length_m,
            }
        )

    def first(reeled: Condition, moves: bool = True) -> float:
        times = (0.1 * i for i in range(1000))
        return next(time_s for time_s in times if reeled(state(time_s, moves)))

    assert 5.0 < first(_reeled(0.3, 0.7)) < 7.0
    assert 5.0 < first(_reeled(0.3, None), False) < 7.0, "seen by the length alone"
    assert first(_reeled(0.0, 0.7)) < 2.0, "nothing to move"


def test_a_port_that_is_taken_and_free_again_after_a_failure() -> None:
    port = free_port()
    taken = UdpSocket("127.0.0.1", port)
    with pytest.raises(plumbline.Error, match=r"is in use by another program.* e\.g\. connect\(14540\)"):
        plumbline.connect(port, timeout_s=0.1)
    taken.close()
    with pytest.raises(plumbline.Error, match="no vehicle heard"):
        plumbline.connect(str(port), timeout_s=0.1)
    UdpSocket("127.0.0.1", port).close()


class QuietSession:
    """A session that hears nothing, and fails `failures` times at listening."""

    def __init__(self, failures: int = 0) -> None:
        self.failures = failures
        self.target = Target(1, 1)
        self.view = VehicleView()

    def find_to_command(self) -> None:
        """The vehicle is there."""

    def watch(self, done: Callable[[], bool], seconds: float | None) -> bool:
        if self.failures > 0:
            self.failures -= 1
            raise ValueError("a message that cannot be read")
        idle = threading.Event()
        while not done():
            idle.wait(0.001)
            self.pass_time()
        return True

    def pass_time(self) -> None:
        """Nothing is heard."""

    def run(self, operation: Any) -> Any:
        """Every command is accepted, and none of the messages that are requested is known."""
        if operation.name.startswith("request of "):
            raise RefusedError(operation.name)

    def close(self) -> None:
        """Nothing is open."""


def test_a_request_at_the_moment_of_closing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = RunningVehicle(QuietSession(), 1.0)  # type: ignore[arg-type]
    put = queue.Queue.put

    def close_first(jobs: queue.Queue[Any], job: Callable[[], None]) -> None:
        vehicle.close()
        put(jobs, job)

    monkeypatch.setattr(queue.Queue, "put", close_first)
    with pytest.raises(plumbline.Error, match="the link was closed"):
        vehicle.pause()


def test_a_link_that_fails_while_it_listens_serves_the_next_request() -> None:
    session = QuietSession(failures=3)
    with RunningVehicle(session, 1.0) as vehicle:  # type: ignore[arg-type]
        for _ in range(4):
            vehicle.pause()
    assert session.failures == 0


class ReportingSession(QuietSession):
    """A session with a vehicle that has reported these messages, and reports those of `at(time_s)` while its
    clock runs."""

    lost = False

    def __init__(self, *reported: Any, at: Callable[[float], Any]) -> None:
        super().__init__()
        self._time_us = 0
        self._at = at
        self._frames = FrameWriter(1, 1)  # numbers the messages: they differ
        for message in reported:
            self._hear(message)

    def _hear(self, message: Any) -> None:
        for received in messages(self._frames.frame(message))[0]:
            self.view.update(received, 0)

    def pass_time(self) -> None:
        """A tenth of a second of the vehicle's clock."""
        self._time_us += 100_000
        self._hear(self._at(self._time_us * 1e-6))
        errors = mavlink.MAVLink_cascade_errors_message(self._time_us, ZERO3, *[ZERO3] * 5, 0, 0, 0, ZERO3, 3)
        self._hear(errors)

    def request(self, message_id: int) -> Any:
        """A message that was reported."""
        return self.view.latest[mavlink.mavlink_map[message_id].msgname]


ZERO3, REST, LEVEL = (0.0,) * 3, (0.0,) * 9, (1.0, 0.0, 0.0, 0.0)
ARMED = mavlink.MAVLink_heartbeat_message(
    2, mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_MODE_FLAG_SAFETY_ARMED, 0, 4, 3
)
DISARMED = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 3, 3)
LOAD_POSITION = mavlink.PLUMBLINE_CONTROL_LOAD_POSITION


def in_hold(time_s: float, duration_s: float, control_mode: int = LOAD_POSITION) -> Any:
    """LOAD_SETPOINT in phase hold, of a leg of this duration."""
    time_us, phase = round(time_s * 1e6), mavlink.PLUMBLINE_PHASE_HOLD
    return mavlink.MAVLink_load_setpoint_message(
        time_us, *REST, *ZERO3, 0.0, duration_s, 0, phase, control_mode
    )


def in_mission(state: int) -> Any:
    """MISSION_CURRENT with this MISSION_STATE."""
    return mavlink.MAVLink_mission_current_message(0, 3, state)


COMPLETE, ACTIVE = in_mission(mavlink.MISSION_STATE_COMPLETE), in_mission(mavlink.MISSION_STATE_ACTIVE)


@pytest.mark.parametrize(
    ("until", "under_way", "over"),
    [("holding", in_hold(0.0, 2.0), in_hold(0.0, nan)), ("mission complete", ACTIVE, COMPLETE)],
    ids=["holding", "mission complete"],
)
def test_a_wait_ends_with_what_the_last_command_began(until: str, under_way: Any, over: Any) -> None:
    """What was reported before is over too."""
    session = ReportingSession(ARMED, over, at=lambda time_s: under_way if time_s < 5.0 else over)
    with RunningVehicle(session, 1.0) as vehicle:  # type: ignore[arg-type]
        assert (vehicle.wait(until).time_s or 0.0) >= 5.0


class LostSession(ReportingSession):
    """A session whose vehicle has fallen silent."""

    lost = True


def test_why_a_wait_has_no_end_is_told_by_the_class_of_the_error() -> None:
    def wait(session: ReportingSession) -> BaseException:
        with (
            RunningVehicle(session, 1.0) as vehicle,  # type: ignore[arg-type]
            pytest.raises(plumbline.Error) as told,
        ):
            vehicle.wait("mission complete", timeout_s=20.0)
        return told.value

    assert type(wait(ReportingSession(ARMED, at=lambda _: ACTIVE))) is plumbline.NotInTimeError
    assert type(wait(LostSession(ARMED, at=lambda _: ACTIVE))) is plumbline.NoVehicleError
    disarmed = wait(ReportingSession(ARMED, at=lambda time_s: ACTIVE if time_s < 5.0 else DISARMED))
    assert not isinstance(disarmed, plumbline.NotInTimeError | plumbline.NoVehicleError)


class SlowlyReportingSession(ReportingSession):
    """A session with a vehicle that does at once what it is told, and reports its phase only if asked."""

    def __init__(self) -> None:
        super().__init__(ARMED, in_phase(mavlink.PLUMBLINE_PHASE_MISSION), at=self._report)
        self.phase = mavlink.PLUMBLINE_PHASE_MISSION

    def _report(self, time_s: float) -> Any:
        return DISARMED if self.phase == mavlink.PLUMBLINE_PHASE_DISARMED else ARMED

    def run(self, operation: Any) -> Any:
        changes = {"pause": mavlink.PLUMBLINE_PHASE_HOLD, "land": mavlink.PLUMBLINE_PHASE_DISARMED}
        self.phase = changes.get(operation.name, self.phase)
        if operation.name == "request of LOAD_SETPOINT":
            self._hear(in_phase(self.phase))
        elif operation.name == "request of HEARTBEAT":
            self._hear(self._report(0.0))
        elif operation.name.startswith("request of "):
            raise RefusedError(operation.name)


def in_phase(phase: int) -> Any:
    """LOAD_SETPOINT in this phase."""
    return mavlink.MAVLink_load_setpoint_message(0, *REST, *ZERO3, 0.0, nan, 0, phase, LOAD_POSITION)


def test_what_a_command_changed_is_seen_when_it_returns() -> None:
    with RunningVehicle(SlowlyReportingSession(), 1.0) as vehicle:  # type: ignore[arg-type]
        assert vehicle.state.phase == "mission"
        vehicle.pause()
        assert vehicle.state.phase == "hold"
        vehicle.land()
        assert (vehicle.state.armed, vehicle.state.phase) == (False, "disarmed")


def test_what_ended_is_seen_when_a_wait_returns() -> None:
    session = SlowlyReportingSession()
    with RunningVehicle(session, 1.0) as vehicle:  # type: ignore[arg-type]
        session.phase = mavlink.PLUMBLINE_PHASE_DISARMED  # by itself
        assert vehicle.wait("landed").phase == "disarmed"


def test_a_message_from_before_tells_nothing_new() -> None:
    session = ReportingSession(COMPLETE, at=lambda _: COMPLETE)
    is_new = _newly(session.view, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, lambda _: True)
    assert not is_new(state_of(session.view))
    session.pass_time()
    assert is_new(state_of(session.view))


def test_motion_attitude_and_battery_are_those_of_the_tables_of_a_flight() -> None:
    view = VehicleView()
    empty = state_of(view)
    readers = ("load_velocity_m_s", "vehicle_m", "vehicle_velocity_m_s", "vehicle_angles_rad")
    readers += ("vehicle_rate_rad_s", "battery_v", "battery_a", "battery_left_pct")
    assert [getattr(empty, name) for name in readers] == len(readers) * [None]

    angles = (0.3, -0.2, 2.5)  # roll, pitch, yaw
    half = [(math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in angles]
    (cr, sr), (cp, sp), (cy, sy) = half
    quat = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    battery = {"voltage_battery": 12_340, "current_battery": 650, "battery_remaining": 81}
    unused = dict.fromkeys(("drop_rate_comm", "errors_comm", *(f"errors_count{i}" for i in range(1, 5))), 0)
    sensors = dict.fromkeys((f"onboard_control_sensors_{one}" for one in ("present", "enabled", "health")), 0)
    estimated = mavlink.PLUMBLINE_SOURCE_ESTIMATED
    pull = (0.7, 0.9, 0, 1, estimated)  # distance, tension, slack events, taut, source
    sent = (
        mavlink.MAVLink_local_position_ned_message(
            *local_position_ned_values(0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
        ),
        mavlink.MAVLink_attitude_message(*attitude_values(0, quat, (0.4, 0.5, 0.6))),
        mavlink.MAVLink_sys_status_message(**sensors, load=0, **battery, **unused),
        mavlink.MAVLink_load_state_message(0, 1.0, 2.0, -3.0, 0.2, 0.1, -0.3, 0, 0, 1, 0, 0, 0, *pull),
    )
    for message in sent:
        (received,) = messages(FrameWriter(1, 1).frame(message))[0]
        view.update(received, 0)
    state = state_of(view)
    assert state.load_velocity_m_s == pytest.approx((0.1, 0.2, 0.3))
    assert state.vehicle_m == pytest.approx((1.0, 2.0, 3.0))
    assert state.vehicle_velocity_m_s == pytest.approx((0.1, 0.2, 0.3))
    assert state.vehicle_angles_rad == pytest.approx(angles)
    assert state.vehicle_angles_rad == pytest.approx(roll_pitch_yaw(np.array(quat)).tolist())
    assert state.vehicle_rate_rad_s == pytest.approx((0.4, 0.5, 0.6))
    assert (state.battery_v, state.battery_a, state.battery_left_pct) == pytest.approx((12.34, 6.5, 81.0))

    unknown = {"voltage_battery": 0xFFFF, "current_battery": -1, "battery_remaining": -1}
    (received,) = messages(
        FrameWriter(1, 1).frame(mavlink.MAVLink_sys_status_message(**sensors, load=0, **unknown, **unused))
    )[0]
    view.update(received, 0)
    state = state_of(view)
    assert (state.battery_v, state.battery_a, state.battery_left_pct) == (None, None, None)


def test_a_vehicle_that_is_only_kept_level_does_not_hold() -> None:
    level = mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE
    session = ReportingSession(ARMED, at=lambda time_s: in_hold(time_s, nan, level))
    with (
        RunningVehicle(session, 1.0) as vehicle,  # type: ignore[arg-type]
        pytest.raises(plumbline.NotInTimeError, match="not within 2 s of the vehicle's clock"),
    ):
        vehicle.wait("holding", timeout_s=2.0)


@pytest.mark.parametrize(
    ("control_mode", "here"),
    [
        (LOAD_POSITION, (0.0, 0.0, 0.02)),
        (mavlink.PLUMBLINE_CONTROL_QUAD_POSITION, (1.0, 0.5, 3.0)),
    ],
    ids=["with its load", "after a release"],
)
def test_what_position_commands_refer_to_is_awaited(
    control_mode: int, here: tuple[float, float, float]
) -> None:
    """The load rests at home, and the vehicle flies at (1, 0.5, 3)."""
    estimated = mavlink.PLUMBLINE_SOURCE_ESTIMATED
    session = ReportingSession(
        ARMED,
        mavlink.MAVLink_gps_global_origin_message(473977420, 85455940, 0),
        mavlink.MAVLink_home_position_message(473977420, 85455940, 0, 0, 0, 0, LEVEL, 0, 0, 0),
        mavlink.MAVLink_load_state_message(0, 0.0, 0.0, -0.02, *REST, 0.7, 0.0, 0, 0, estimated),
        mavlink.MAVLink_local_position_ned_message(0, 0.5, 1.0, -3.0, *ZERO3),
        in_hold(0.0, nan, control_mode),
        at=lambda time_s: in_hold(time_s, nan, control_mode),
    )
    with RunningVehicle(session, 1.0) as vehicle:  # type: ignore[arg-type]
        vehicle.goto(*here, timeout_s=2.0)
        what = "load" if control_mode == LOAD_POSITION else "vehicle"
        left = f"not within 2 s of the vehicle's clock: {what} 1.00 m from the goal at 0.00 m/s, phase hold"
        with pytest.raises(plumbline.NotInTimeError, match=f"waiting for goto: {left}"):
            vehicle.goto(here[0], here[1], here[2] + 1.0, timeout_s=2.0)
    for height_m in (here[2], None):  # without a height it keeps the one that it has
        move = reposition(session, (here[0], here[1] + 2.0, height_m), False, None)  # type: ignore[arg-type]
        assert move.distance_m == pytest.approx(2.0)


def load_at(east_m: float) -> Any:
    """LOAD_STATE at rest, 1 m above home."""
    estimated = mavlink.PLUMBLINE_SOURCE_ESTIMATED
    return mavlink.MAVLink_load_state_message(0, 0.0, east_m, -1.0, *REST, 0.7, 0.0, 0, 0, estimated)


def at_home_in_hold(at: Callable[[float], Any]) -> ReportingSession:
    """An armed vehicle that holds its load, and whose reports are those of `at`."""
    return ReportingSession(
        ARMED,
        mavlink.MAVLink_gps_global_origin_message(473977420, 85455940, 0),
        mavlink.MAVLink_home_position_message(473977420, 85455940, 0, 0, 0, 0, LEVEL, 0, 0, 0),
        load_at(0.0),
        in_hold(0.0, nan),
        at=at,
    )


class TakingSession(ReportingSession):
    """A vehicle at rest at home that takes every mission."""

    def __init__(self) -> None:
        super().__init__(
            DISARMED,
            mavlink.MAVLink_gps_global_origin_message(473977420, 85455940, 0),
            mavlink.MAVLink_home_position_message(473977420, 85455940, 0, 0, 0, 0, LEVEL, 0, 0, 0),
            at=lambda time_s: in_hold(time_s, nan),
        )

    def run(self, operation: Any, label: str = "") -> Any:
        return (
            Result(Status.DONE, "taken") if isinstance(operation, MissionUpload) else super().run(operation)
        )


class ImmediateTimer:
    """A timer whose time is over at once."""

    def __init__(self, _: float, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self.daemon = False
        self.start = partial(function, *arguments)

    def cancel(self) -> None:
        """It is too late."""


WAYPOINTS = """QGC WPL 110
0 1 0 16 0 0 0 0 47.397742 8.545594 0 1
1 0 3 22 0 0 0 0 47.397742 8.545594 1 1
2 0 3 203 0 0 0 0 0 0 0 1
3 0 3 21 0 0 0 0 47.397742 8.545594 0 1
"""


@pytest.mark.parametrize("force", [False, True])
def test_an_upload_prints_nothing_and_warns_of_what_is_not_as_in_the_file(
    force: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(display, "Timer", ImmediateTimer)
    file = tmp_path / "other.waypoints"
    file.write_text(WAYPOINTS.replace(" ", "\t").replace("QGC\tWPL\t", "QGC WPL "), encoding="utf-8")
    with RunningVehicle(TakingSession(), 1.0) as vehicle:  # type: ignore[arg-type]
        vehicle.upload("hover", force=force)
        with pytest.warns(UserWarning, match=r"other\.waypoints: ") as told:
            vehicle.upload(file, force=force)
        file.write_text(file.read_text().replace("47.397742", "47.5", 1), encoding="utf-8")
        not_flown = pytest.raises(plumbline.Error, match=r"1 thing is not flown; skip=True uploads the rest$")
        with pytest.warns(UserWarning) as left_out, not_flown:
            vehicle.upload(file, force=force)
        assert any(
            "the home row, but the vehicle's home is elsewhere" in str(one.message) for one in left_out
        )
        with pytest.warns(UserWarning, match="the home row"):
            vehicle.upload(file, force=force, skip=True)
    assert {one.filename for one in told} == {__file__}
    assert capfd.readouterr() == ("", "")


def test_a_load_that_is_held_away_from_its_goal_ends_goto() -> None:
    """It flies for 5 s, and creeps closer until 45 s."""

    def report(time_s: float) -> Any:
        if round(time_s * 10) % 2:
            return in_hold(time_s, 5.0 if time_s < 5.0 else nan)
        return load_at(0.6 if time_s > 45.0 else 0.15 + 0.01 * time_s)

    session = at_home_in_hold(report)
    with RunningVehicle(session, 1.0) as vehicle:  # type: ignore[arg-type]
        with pytest.raises(plumbline.Error) as told:
            vehicle.goto(1.0, 0.0, 1.0)
        assert vehicle.state.time_s == pytest.approx(45.0 + 30.0, abs=2.0)
    left = "waiting for goto: load 0.40 m from the goal at 0.00 m/s, phase hold (must be within 0.1 m"
    assert left in str(told.value) and "for 30 s it has come no closer" in str(told.value)
