"""A vehicle that is already running: commands to it, waiting for it, and its state, over MAVLink.

The link is that of `gcs`. A separate thread maintains it, so that the vehicle hears its ground station, and
the state stays current, while the script does other work.
"""

from __future__ import annotations

import math
import queue
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from types import TracebackType
from typing import TypeVar

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import KEY_BYTES
from gcs.clients import command
from gcs.clients.modes import ALIASES, MODES, change_mode
from gcs.clients.operation import Operation
from gcs.clients.parameter_transfer import ParameterGet, ParameterSet
from gcs.clients.vehicle_view import VehicleView
from gcs.errors import GcsError, NotInTimeError, NoVehicleError, RefusedError
from gcs.shell.link import monotonic_us, parse_address
from gcs.shell.session import Session
from gcs.workflows.parameters import exchange
from gcs.workflows.reposition import reposition
from gcs.workflows.running_flight import vehicle_home
from gcs.workflows.transfer import checked_upload
from missions import model
from missions.nearest import did_you_mean
from plumbline.arguments import (
    called_by_scripts,
    checked_flags,
    errors_for_python,
    not_negative,
    number,
    parameter_name,
    positive,
    reworded_for_python,
    shown_value,
    text,
    whole_number,
)
from plumbline.made_files import name_or_path
from plumbline.missions import Mission
from plumbline.state import State, state_of
from plumbline.vehicles import Vehicle

Value = TypeVar("Value")
Condition = Callable[[State], bool]

_LOAD_STATE_US = 50_000  # interval of the load's state, by the vehicle's clock
_MAX_STALL_S = 60.0  # how long the vehicle's clock may stand still while its heartbeats continue
_RETRY_S = 0.1
_NEAR_M = 0.1
_SLOW_M_S = 0.1
_CLOSER_M = 0.01  # by less a load that is held has not come closer to where it was sent
_HELD_AWAY_S = 30.0  # after so long without coming closer, a load that is held away from there stays away
_LEAST_REEL_M = 1e-3  # for less the winch may stay still
_STILL_S = 1.5  # three times the interval of WINCH_STATUS
_NAMED_CONDITIONS: dict[str, Condition] = {
    "ready": lambda state: state.ready_to_arm is True,
    "holding": lambda state: state.holding is True,
    "mission complete": lambda state: state.mission == "complete",
    "landed": lambda state: state.armed is False and state.landed != "in the air",
}
# messages that show what a command changed
_SHOW_STATE = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
)
_SHOWN_S = 1.0  # in which a requested message arrives
# messages that must be newer than the request to wait: one from before the last command may say that what
# this command begins is already over
_REPORTED_BY = {
    "holding": mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
    "mission complete": mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
}


@called_by_scripts
def connect(
    address: str | int = "udpin:127.0.0.1:14550",
    *,
    sysid: int | None = None,
    timeout_s: float = 10.0,
    signing_key: bytes | None = None,
) -> RunningVehicle:
    """Connect to a running vehicle: `sitl` and `autopilot` started by hand, `gcs fly --speed 1`, any other.

    `address`: `udpin:HOST:PORT`, `HOST:PORT` or `PORT`, also as a number, to wait there for the vehicle,
    `udpout:HOST:PORT` to send first, `tcp:HOST:PORT` to connect by TCP (`autopilot --tcp`). `sysid`: the
    MAVLink system id of the vehicle, if several send there; without it the first one that is heard.
    `timeout_s`: how long the vehicle may be silent, now and later, by the clock of this machine.
    `signing_key`: 32 bytes with which messages are signed (docs/mavlink.md). `NoVehicleError` if no vehicle
    is heard.
    """
    limit_s = positive("timeout_s", timeout_s)
    if signing_key is not None and not (isinstance(signing_key, bytes) and len(signing_key) == KEY_BYTES):
        raise GcsError(f"signing_key: must be {KEY_BYTES} bytes, as secrets.token_bytes({KEY_BYTES})")
    with errors_for_python():
        if isinstance(address, int):
            address = str(whole_number("address", address, 1, 65535))
        found = parse_address(text("address", address, "udpin:127.0.0.1:14550"))
        system = None if sysid is None else whole_number("sysid", sysid, 1, 255)
        where = replace(found, signing_key=signing_key, system=system)
        session = Session(where, limit_s, round(limit_s * 1e6), _warn, quiet=True)
        return RunningVehicle(session, limit_s)


def _warn(line: str) -> None:
    """Warn of what may not be meant, in the thread of the link: no line of the script is to blame."""
    warnings.warn(reworded_for_python(line), stacklevel=2)


class RunningVehicle:
    """A running vehicle, as `connect` returns it. Use it in a `with` block, or `close` it.

    A command returns when the vehicle has accepted it and `state` shows it; a refusal raises an `Error` with
    the vehicle's reason.
    `takeoff`, `goto`, `winch` and `land` also wait until the manoeuvre is finished, unless `wait=False`. Time
    limits of waiting are in seconds of the vehicle's clock, so that they mean the same at any simulation
    speed and on a busy machine. Positions are those of the load: metres east, north and up from home.
    """

    def __init__(self, session: Session, timeout_s: float) -> None:
        self._session = session
        self._timeout_s = timeout_s
        self._jobs: queue.Queue[Callable[[], None]] = queue.Queue()
        self._closing = threading.Event()
        self._not_sent: set[int] = set()  # messages of `_SHOW_STATE` that the vehicle does not have
        try:
            session.find_to_command()
        except BaseException:
            session.close()
            raise
        self._thread = threading.Thread(target=self._run_link, name="plumbline link", daemon=True)
        self._thread.start()
        try:
            self._request_load_state()
        except BaseException:
            self.close()
            raise

    # ---- what it reports

    @property
    def state(self) -> State:
        """The latest state that the vehicle has reported."""
        return state_of(self._session.view)

    @property
    def texts(self) -> list[str]:
        """The vehicle's messages to the operators since `connect`, the oldest first."""
        return [text.text for text in self._session.view.texts]

    # ---- commands

    @checked_flags
    def arm(self, *, force: bool = False, timeout_s: float = 30.0) -> None:
        """Start the rotors. Unless `force`, wait until the vehicle is ready; a vehicle that is not ready in
        time refuses, with the reason."""
        limit_s = positive("timeout_s", timeout_s)
        if not force and self.state.ready_to_arm is not True:
            with suppress(NotInTimeError, NoVehicleError):  # the refusal gives the reason
                self.wait("ready", limit_s)
        self._command(lambda session: command.arm(session.target, force))
        self._finish(lambda state: state.armed is True, "arm", limit_s)

    @checked_flags
    def disarm(self, *, force: bool = False) -> None:
        """Stop the rotors. In the air this requires `force`, and the vehicle falls."""
        self._command(lambda session: command.disarm(session.target, force))

    @checked_flags
    def takeoff(self, up_m: float | None = None, *, wait: bool = True, timeout_s: float = 180.0) -> None:
        """Lift the load to a height and hold it there; the default height is MIS_TAKEOFF_ALT.

        The vehicle must be armed.
        """
        height_m = None if up_m is None else number("up_m", up_m)
        limit_s = positive("timeout_s", timeout_s)
        self._require_armed("takeoff")

        def make(session: Session) -> Operation:
            if height_m is None:
                return command.takeoff(session.target)
            return command.takeoff(session.target, vehicle_home(session).altitude_m + height_m)

        self._command(make)
        if wait:
            self.wait("holding", limit_s)

    @checked_flags
    def goto(
        self,
        east_m: float,
        north_m: float,
        up_m: float | None = None,
        *,
        speed_m_s: float | None = None,
        wait: bool = True,
        timeout_s: float = 300.0,
    ) -> None:
        """Fly the load to a position and hold it there; without `up_m` at its present height.

        The load has arrived when its path has ended, within 0.1 m of the position, and it is slower than
        0.1 m/s. A mission that is being flown ends. After a release the position is that of the vehicle.
        `NotInTimeError`, with the distance that is left, if it has not arrived within `timeout_s`, and
        `Error` if it is held away from the position, as by a strong wind, and comes no closer for 30 s.
        """
        height_m = None if up_m is None else number("up_m", up_m)
        place = (number("east_m", east_m), number("north_m", north_m), height_m)
        checked_speed_m_s = None if speed_m_s is None else positive("speed_m_s", speed_m_s)
        limit_s = positive("timeout_s", timeout_s)
        self._require_armed("goto")
        self._command(lambda session: reposition(session, place, False, checked_speed_m_s).operation)
        if wait:
            view = self._session.view
            way = _Way(view, place)
            arrived = _newly(view, mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT, way.has_ended_there)
            self._finish(arrived, "goto", limit_s, way)

    @checked_flags
    def land(self, *, wait: bool = True, timeout_s: float = 300.0) -> None:
        """Set the load down, and the vehicle beside it.

        On a disarmed vehicle it returns immediately, and cancels a take-off or mission that waits for arming.
        """
        limit_s = positive("timeout_s", timeout_s)
        self._command(lambda session: command.land(session.target))
        if wait:
            self.wait("landed", limit_s)

    @checked_flags
    def upload(
        self,
        mission: str | PathLike[str] | model.Mission,
        *,
        vehicle: str | PathLike[str] | Vehicle = "bebop",
        force: bool = False,
        skip: bool = False,
    ) -> None:
        """Upload a mission to the vehicle: a shipped name, a file (.toml, .plan, .waypoints), or a `Mission`.

        The mission is first checked against the limits of `vehicle`, unless `force`. What the vehicle does
        not fly as in a file of another ground station causes a warning; what it cannot fly raises `Error`, or
        with `skip` is left out.
        """
        if isinstance(mission, model.Mission) and not isinstance(mission, Mission):
            mission = Mission(mission.name, mission.steps, mission.title)
        path, checked = name_or_path("mission", mission), name_or_path("vehicle", vehicle)
        notes: list[str] = []
        with errors_for_python():
            send = checked_upload(path, checked, force, skip, lambda _: None, notes.append, quiet=True)
        try:
            with errors_for_python():
                self._with_retries(lambda: send(self._session))
        finally:
            for line in dict.fromkeys(notes):
                warnings.warn(reworded_for_python(line), stacklevel=3)
        self._with_retries(self._show_state)

    def start(self) -> None:
        """Fly the mission from its first item; a disarmed vehicle begins when it is armed."""
        self._command(lambda session: command.start_mission(session.target))

    @checked_flags
    def winch(
        self,
        length_m: float,
        *,
        speed_m_s: float | None = None,
        wait: bool = True,
        timeout_s: float = 300.0,
    ) -> None:
        """Make the cable longer by a length, or shorter if it is negative, while the vehicle stays in place.

        The vehicle must hold the load in the air. The default speed is WNC_SPEED.
        """
        checked_m = number("length_m", length_m)
        checked_speed_m_s = None if speed_m_s is None else positive("speed_m_s", speed_m_s)
        limit_s = positive("timeout_s", timeout_s)
        reeled = _reeled(checked_m, self.state.cable_length_m)
        self._command(lambda session: command.winch(session.target, checked_m, checked_speed_m_s))
        if wait:
            self._finish(reeled, "winch", limit_s)

    def release(self) -> None:
        """Let the load go. In the air it falls, and the vehicle holds its position."""
        self._command(lambda session: command.release(session.target))

    def grab(self) -> None:
        """Take the load again: on the ground, with the load within 0.75 cable lengths of the vehicle."""
        self._command(lambda session: command.grab(session.target))

    def pause(self) -> None:
        """Stop the load, and hold it; `wait("holding")` returns when it has come to rest."""
        self._command(lambda session: command.pause(session.target))

    def resume(self) -> None:
        """Continue a paused mission."""
        self._command(lambda session: command.resume(session.target))

    def mode(self, name: str) -> None:
        """Change the flight mode, in plain words: hold, mission, return, land ..."""
        if text("mode", name, "hold") not in (*MODES, *ALIASES):
            hint = did_you_mean(name, (*MODES, *ALIASES))
            known = ", ".join(MODES)
            raise GcsError(f"mode {name!r}: there is none; {hint}must be one of {known}")
        self._command(lambda session: change_mode(session.target, name, session.view.latest["HEARTBEAT"]))

    def parameter(self, name: str) -> float:
        """The value of a parameter."""
        checked_name = parameter_name("parameter", name)

        def read() -> float:
            operation = ParameterGet(self._session.target, checked_name)
            exchange(self._session, operation)
            assert operation.value is not None
            return operation.value

        return self._with_retries(read)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, and check that it was stored."""
        checked_name, checked_value = parameter_name("parameter", name), number(name, value)
        self._with_retries(
            lambda: exchange(self._session, ParameterSet(self._session.target, checked_name, checked_value))
        )

    # ---- waiting

    def wait(self, until: str | float | Condition = "landed", timeout_s: float = 600.0) -> State:
        """Wait until a condition holds, and return the state in which it held.

        `until`: one of `ready`, `holding` (at rest: the stop, or the way to a place, has ended), `mission
        complete` and `landed` (disarmed), a function of the state, or a number of seconds (0 or more) of the
        vehicle's clock. `NotInTimeError` if the condition does not hold within `timeout_s` seconds of the
        vehicle's clock (for a number of seconds there is no limit), `NoVehicleError` if the vehicle falls
        silent before, and `Error` if it is disarmed before.
        """
        condition, what = self._condition(until)
        checked_s = positive("timeout_s", timeout_s)
        if isinstance(until, str):
            return self._finish(condition, what, checked_s)
        limit_s = math.inf if isinstance(until, int | float) else checked_s
        return self._in_thread(lambda: self._watch(condition, what, limit_s))

    def _finish(self, condition: Condition, what: str, limit_s: float, way: _Way | None = None) -> State:
        """Wait for the end of a manoeuvre, and return the state after it."""
        self._in_thread(lambda: self._watch(condition, what, limit_s, way))
        self._with_retries(self._show_state)
        return self.state

    def _condition(self, until: str | float | Condition) -> tuple[Condition, str]:
        if isinstance(until, str):
            if until not in _NAMED_CONDITIONS:
                raise GcsError(
                    f"wait {until!r}: must be one of {', '.join(_NAMED_CONDITIONS)}, a number or a function"
                )
            condition, reported_by = _NAMED_CONDITIONS[until], _REPORTED_BY.get(until)
            if reported_by is not None:
                condition = _newly(self._session.view, reported_by, condition)
            return condition, f"{until!r}"
        if isinstance(until, int | float):
            clock, awaited_s = _Clock(), not_negative("wait", until)
            return lambda state: clock.elapsed_s(state) >= awaited_s, f"{awaited_s:g} s"
        if not callable(until):
            known = ", ".join(_NAMED_CONDITIONS)
            raise GcsError(f"wait {shown_value(until)}: must be one of {known}, a number or a function")
        return until, "what was asked for"

    def _watch(self, condition: Condition, what: str, timeout_s: float, way: _Way | None = None) -> State:
        """Wait for a condition, in the thread of the link; with `way`, that the load flies it."""
        session, clock = self._session, _Clock()
        was_armed, texts_before = self.state.armed, len(session.view.texts)
        found: list[State] = []
        problems: list[GcsError] = []

        def is_over() -> bool:
            state = self.state
            if condition(state):
                found.append(state)
            elif session.lost:
                problems.append(NoVehicleError(f"the vehicle fell silent for {self._timeout_s:g} s"))
            elif was_armed and not state.armed:
                problems.append(GcsError("the vehicle was disarmed"))
            elif way is not None and way.has_ended_elsewhere(state):
                limits = f"must be within {_NEAR_M:g} m and slower than {_SLOW_M_S:g} m/s"
                since = f"its way has ended, and for {_HELD_AWAY_S:g} s it has come no closer"
                problems.append(GcsError(f"{way.remaining(state)} ({limits}): {since}"))
            elif clock.elapsed_s(state) > timeout_s:
                where = way.remaining(state) if way is not None else f"phase {state.phase or 'not known'}"
                text = f"not within {timeout_s:g} s of the vehicle's clock: {where}"
                problems.append(NotInTimeError(text))
            elif clock.stalled_s > _MAX_STALL_S:
                text = f"the vehicle's clock stands still for {_MAX_STALL_S:g} s; is sitl running?"
                problems.append(NoVehicleError(text))
            elif self._closing.is_set():
                problems.append(GcsError("the link was closed"))
            return bool(found or problems)

        session.watch(is_over, None)
        if found:
            return found[-1]
        reasons = session.view.problems_since(texts_before)
        raise type(problems[0])("; ".join([f"waiting for {what}: {problems[0]}", *reasons]))

    # ---- the thread of the link

    def _run_link(self) -> None:
        while not self._closing.is_set():
            try:
                self._session.watch(lambda: self._closing.is_set() or not self._jobs.empty(), None)
            except Exception:  # the next request meets the same error and reports it
                self._closing.wait(_RETRY_S)
            while not self._jobs.empty():
                self._jobs.get()()

    def _in_thread(self, work: Callable[[], Value]) -> Value:
        if self._closing.is_set():
            raise GcsError("the link was closed")
        future: Future[Value] = Future()

        def job() -> None:
            try:
                future.set_result(work())
            except BaseException as error:
                future.set_exception(error)

        self._jobs.put(job)
        while not wait([future], _RETRY_S).done:
            if not self._thread.is_alive() and not future.done():  # it was closed at this moment
                raise GcsError("the link was closed")
        return future.result()

    def _with_retries(self, work: Callable[[], Value]) -> Value:
        """An exchange, repeated while the vehicle does not answer, for as long as it may be silent."""
        until_us = monotonic_us() + round(self._timeout_s * 1e6)
        while True:
            try:
                return self._in_thread(work)
            except NoVehicleError:
                if monotonic_us() >= until_us:
                    raise

    def _command(self, make: Callable[[Session], Operation]) -> None:
        self._with_retries(lambda: self._session.run(make(self._session)))
        self._with_retries(self._show_state)

    def _show_state(self) -> None:
        """Request, in the thread of the link, what the vehicle sends only once or twice a second."""
        for message_id in _SHOW_STATE:
            if message_id not in self._not_sent:
                self._request_anew(message_id)

    def _request_anew(self, message_id: int) -> None:
        session = self._session
        is_new = _newly(session.view, message_id, lambda _: True)
        try:
            session.run(command.request_message(session.target, message_id))
        except RefusedError:
            self._not_sent.add(message_id)
        else:
            session.watch(lambda: is_new(self.state), _SHOWN_S)

    def _request_load_state(self) -> None:
        """Request frequent messages of the load's state; a vehicle that has none is accepted too."""
        number = mavlink.MAVLINK_MSG_ID_LOAD_STATE
        session = self._session
        with suppress(RefusedError, NoVehicleError):
            request = command.message_interval(session.target, number, _LOAD_STATE_US)
            self._in_thread(lambda: session.run(request))

    def _require_armed(self, what: str) -> None:
        if not self.state.armed:
            raise GcsError(f"{what}: the vehicle is not armed; arm() first")

    def close(self) -> None:
        """Close the link; the vehicle continues with what it is doing."""
        self._closing.set()
        self._thread.join()
        self._session.close()

    def __enter__(self) -> RunningVehicle:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        state = self.state
        return f"<RunningVehicle {self._session.address}: {state.mode}, {'' if state.armed else 'dis'}armed>"


class _Clock:
    """Time elapsed by the vehicle's clock, which may restart, and how long that clock has stood still."""

    def __init__(self) -> None:
        self._elapsed_s = 0.0
        self._last_s: float | None = None
        self._changed_us = monotonic_us()

    def elapsed_s(self, state: State) -> float:
        """Time elapsed up to this state."""
        now_s = state.time_s
        if now_s is not None and now_s != self._last_s:
            if self._last_s is not None:
                self._elapsed_s += max(0.0, now_s - self._last_s)
            self._last_s, self._changed_us = now_s, monotonic_us()
        return self._elapsed_s

    @property
    def stalled_s(self) -> float:
        """How long the vehicle's clock has stood still, by the clock of this machine."""
        return (monotonic_us() - self._changed_us) * 1e-6


class _Way:
    """The way of the load, or of a vehicle that released it, to a place."""

    def __init__(self, view: VehicleView, place: tuple[float, float, float | None]) -> None:
        self._view = view
        self._place = place
        self._clock = _Clock()
        self._least_m = math.inf  # least distance since the way has ended
        self._since_s = 0.0  # since when it has not become less

    def _distance_and_speed(self, state: State) -> tuple[float, float] | None:
        position, speed_m_s = self._view.motion_without_load or (state.load_m, state.load_speed_m_s)
        if position is None or speed_m_s is None:
            return None
        pairs = zip(position, self._place, strict=True)
        return math.hypot(*(actual - wanted for actual, wanted in pairs if wanted is not None)), speed_m_s

    def has_ended_there(self, state: State) -> bool:
        """Whether it is held at the place, at rest."""
        motion = self._distance_and_speed(state)
        return bool(motion and state.holding and motion[0] < _NEAR_M and motion[1] < _SLOW_M_S)

    def has_ended_elsewhere(self, state: State) -> bool:
        """Whether it is held, and has come no closer to the place for `_HELD_AWAY_S`."""
        now_s, motion = self._clock.elapsed_s(state), self._distance_and_speed(state)
        if motion is None or not state.holding:
            self._least_m, self._since_s = math.inf, now_s
        elif motion[0] < self._least_m - _CLOSER_M:
            self._least_m, self._since_s = motion[0], now_s
        return now_s - self._since_s > _HELD_AWAY_S

    def remaining(self, state: State) -> str:
        """How far it is from the place, for an error."""
        motion, phase = self._distance_and_speed(state), f"phase {state.phase or 'not known'}"
        if motion is None:
            return f"the distance from the goal is not known, {phase}"
        what = "vehicle" if self._view.motion_without_load else "load"
        return f"{what} {motion[0]:.2f} m from the goal at {motion[1]:.2f} m/s, {phase}"


def _newly(view: VehicleView, message_id: int, condition: Condition) -> Condition:
    """That the condition holds, and that the vehicle has sent this message since now."""
    before = view.latest.frame(message_id)
    return lambda state: view.latest.frame(message_id) is not before and condition(state)


def _reeled(length_m: float, before_m: float | None) -> Condition:
    """That the winch has moved, and that winch and load have then stood still for `_STILL_S`.

    The vehicle first has to stop, which can take longer than that. A short movement can lie between two
    reports: it is seen by the length (`before_m` before the command).
    """
    clock, still_since_s = _Clock(), 0.0
    has_moved = abs(length_m) <= _LEAST_REEL_M

    def condition(state: State) -> bool:
        nonlocal still_since_s, has_moved, before_m
        now_s = clock.elapsed_s(state)
        if before_m is None:
            before_m = state.cable_length_m
        if state.cable_length_m is not None and before_m is not None:
            has_moved = has_moved or abs(state.cable_length_m - before_m) >= 0.5 * abs(length_m)
        has_moved = has_moved or state.winch_moving is True
        speed = state.load_speed_m_s
        is_still = state.winch_moving is False and not (speed is not None and speed > _SLOW_M_S)
        if not (has_moved and is_still):
            still_since_s = now_s
        return now_s - still_since_s > _STILL_S

    return condition
