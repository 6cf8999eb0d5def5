"""The ground station behind the page: receives from vehicles, carries out requests of pages, reports news.

    datagrams of vehicles and of the world  ->  Station  ->  records for pages
                          requests of pages  ->          ->  datagrams for vehicles

A passive station (`active` False) gets its datagrams from another ground station: it sends no heartbeat,
requests nothing by itself, and sends to a vehicle only what a user requested on the page.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

from autopilot.wire.codec import Received
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing
from gcs.clients import command
from gcs.clients.connection import Connection
from gcs.clients.datagrams import messages
from gcs.clients.missions import MissionDownload
from gcs.clients.operation import Operation, Status, Target
from gcs.clients.parameter_transfer import ParameterGet
from gcs.view.actions import ActionError, operations_of
from gcs.view.controls import SHOWN_PARAMETERS, SLIDERS
from gcs.view.history import History
from gcs.view.places import fence_record, rally_record, waypoints_record
from gcs.view.vehicle import WatchedVehicle

INTERVAL_US = 20_000
FAST_MESSAGES = (
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_LOAD_STATE,
    mavlink.MAVLINK_MSG_ID_LOAD_SETPOINT,
    mavlink.MAVLINK_MSG_ID_CASCADE_ERRORS,
    mavlink.MAVLINK_MSG_ID_ROTOR_STATE,
)
MAX_REQUESTS = 32  # that wait for one vehicle; further ones are refused
_REASON_US = 300_000  # a refusal is explained by a STATUSTEXT that may arrive a little later
_RUN_REQUEST_INTERVAL_US = 2_000_000
_TEXTS = 60  # kept for pages that open later


class Outgoing(NamedTuple):
    """A datagram for a vehicle."""

    system: int
    datagram: bytes


class _Task:
    """Exchanges with one vehicle, one after the other; `request` is (page, request number), None if the
    station itself began them."""

    def __init__(self, request: tuple[Any, Any] | None, name: str, operations: list[Operation]) -> None:
        self.request = request
        self.name = name
        self.operations = deque(operations)
        self.texts_before: int | None = None
        self.refused_us: int | None = None
        self.replies: list[str] = []


class Station:
    """All vehicles from which something was received, or the one with the id `system`."""

    def __init__(
        self, active: bool = True, signing: Signing | None = None, system: int | None = None
    ) -> None:
        self.vehicles: dict[int, WatchedVehicle] = {}
        self.known_parameters: dict[str, float] = {}  # of vehicles that a passive station does not ask
        self.known_waypoints: list[list[float]] = []
        self._histories: dict[int, History] = {}
        self._new_samples: dict[str, list[list[Any]]] = {}  # samples that were not sent to pages yet
        self._active = active
        self._signing = signing
        self._system = system
        self._tasks: dict[int, deque[_Task]] = {}
        self._news: list[dict[str, Any]] = []
        self._texts: deque[dict[str, Any]] = deque(maxlen=_TEXTS)
        self._unassigned_truth = False  # truth was received of a world in which no vehicle reports to fly
        self._next_run_request_us = 0

    # ---- what comes in

    def receive(self, datagram: bytes, now_us: int) -> list[int]:
        """Process a datagram of a vehicle; return the system ids of the vehicles that sent messages in it."""
        for one in messages(datagram)[0]:
            is_shown = self._system is None or one.system == self._system
            is_new = one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and one.system not in self.vehicles
            if is_shown and is_new:
                self._add_vehicle(one, datagram, now_us)
        senders: list[int] = []
        for system, vehicle in self.vehicles.items():
            for one in vehicle.connection.receive(datagram, now_us):
                if not senders or senders[-1] != system:
                    senders.append(system)
                vehicle.receive(one, now_us)
                self._receive_for_task(vehicle, one, now_us)
                if self._active and one.id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
                    current = one.message
                    ids = current.mission_id, current.fence_id, current.rally_points_id
                    self._fetch_plans(vehicle, ids)
        return senders

    def receive_truth(self, datagram: bytes, run: int | None = None, alone: bool = True) -> None:
        """Process a datagram of a simulated world, for the vehicle that reports to fly in this run of it.

        `alone`: no other world sends its truth; then a single vehicle that reports no run is assumed to fly
        in it.
        """
        for vehicle in self.vehicles.values():
            boot = vehicle.view.latest.get("SIM_BOOT")
            unreported = boot is None and alone and len(self.vehicles) == 1
            if unreported or (boot is not None and boot.boot_id == run):
                for one in messages(datagram)[0]:
                    vehicle.truth.receive(one)
                return
        self._unassigned_truth = True

    def handle_request(self, page: Any, request: Any) -> None:
        """Begin what a page requests; its result is reported by `news`."""
        if not isinstance(request, dict):
            return
        number = request.get("request")
        sender = (page, number if isinstance(number, int) else None)
        system = request.get("vehicle")
        vehicle = self.vehicles.get(system) if isinstance(system, int) else None
        name = request.get("action")
        if vehicle is None:
            self._report_result(sender, str(name), False, "there is no such vehicle")
            return
        tasks = self._tasks[vehicle.target.system]
        if len(tasks) >= MAX_REQUESTS:
            self._report_result(sender, str(name), False, "too much was asked for at once")
            return
        try:
            operations = operations_of(vehicle, name, request.get("arguments", {}))
        except ActionError as error:
            self._report_result(sender, str(name), False, str(error))
            return
        tasks.append(_Task(sender, str(name), operations))

    # ---- what goes out

    def poll(self, now_us: int) -> Iterator[Outgoing]:
        """The datagrams to send now."""
        if self._unassigned_truth and self._active and now_us >= self._next_run_request_us:
            # one of the vehicles may have been restarted with its simulator
            self._unassigned_truth, self._next_run_request_us = False, now_us + _RUN_REQUEST_INTERVAL_US
            for system, vehicle in self.vehicles.items():
                self._tasks[system].append(_Task(None, "", [_run_request(vehicle)]))
        for system, vehicle in self.vehicles.items():
            connection = vehicle.connection
            if self._active:
                for datagram in connection.poll(now_us):
                    yield Outgoing(system, datagram)
            task = self._current_task(vehicle, now_us)
            if task is not None and task.operations:
                for message in task.operations[0].poll(now_us):
                    yield Outgoing(system, connection.frame(message))
                self._advance(vehicle, task, now_us)

    def sample(self, now_us: int) -> None:
        """Take a sample of each vehicle for which one is due."""
        origin = next((vehicle.home for vehicle in self.vehicles.values()), None)
        for system, vehicle in self.vehicles.items():
            vehicle.origin = origin  # all vehicles are shown in one picture
            time_us = vehicle.time_us
            history = self._histories[system]
            if time_us is not None and history.is_due(time_us * 1e-6):
                sample = history.add(vehicle.state(now_us))
                self._new_samples.setdefault(str(system), []).append(sample)

    def state(self, now_us: int) -> dict[str, Any]:
        """What is known now of all vehicles, and the samples that were taken since the last call."""
        self.sample(now_us)
        new_samples, self._new_samples = self._new_samples, {}
        states = [vehicle.state(now_us) for vehicle in self.vehicles.values()]
        return {"type": "state", "vehicles": states, "samples": new_samples}

    def discard_samples(self) -> None:
        """Discard samples that were not sent, while no page is open: a page that opens later receives all."""
        self._new_samples.clear()

    def news(self) -> list[dict[str, Any]]:
        """What is new since the last call; a record with "page" is for that page only."""
        news = self._news
        self._news = []
        for vehicle in self.vehicles.values():
            if vehicle.changed_parameters:
                vehicle.changed_parameters = {}
                news.append(self._vehicle_record(vehicle))
            texts = vehicle.view.texts
            for text in texts[vehicle.sent_texts :]:
                time_s = None if vehicle.time_us is None else round(vehicle.time_us * 1e-6, 2)
                record = {"type": "text", "vehicle": vehicle.target.system, "time": time_s}
                self._texts.append({**record, "severity": text.severity, "text": text.text})
                news.append(self._texts[-1])
            vehicle.sent_texts = len(texts)
        return news

    def initial_records(self) -> list[dict[str, Any]]:
        """The records that a page receives when it opens."""
        vehicles = [self._vehicle_record(vehicle) for vehicle in self.vehicles.values()]
        histories = [
            {"type": "history", "vehicle": system, "samples": history.samples}
            for system, history in self._histories.items()
        ]
        return [*vehicles, *histories, *self._texts]

    def samples(self, system: int) -> list[list[Any]]:
        """The samples taken of a vehicle so far."""
        return self._histories[system].samples

    # ---- vehicles

    def _add_vehicle(self, one: Received, datagram: bytes, now_us: int) -> None:
        connection = Connection()
        if self._signing is not None:
            connection.sign_with(self._signing)
        connection.receive(one.frame, now_us)
        if connection.target is None:
            return
        vehicle = WatchedVehicle(Target(*connection.target), connection)
        for name, value in self.known_parameters.items():
            vehicle.set_parameter(name, value)
        vehicle.waypoints = self.known_waypoints
        system = vehicle.target.system
        self.vehicles[system] = vehicle
        self._histories[system] = History()
        self._tasks[system] = deque()
        self._news.append(self._vehicle_record(vehicle))
        if self._active:
            self._tasks[system].extend(
                _Task(None, "", [operation]) for operation in _initial_requests(vehicle)
            )

    def _fetch_plans(self, vehicle: WatchedVehicle, ids: tuple[int, int, int]) -> None:
        """Download mission, fence and rally points, each only if it has changed."""
        for kind, version in zip(_PLANS, ids, strict=True):
            if vehicle.plan_ids.get(kind) != version:
                vehicle.plan_ids[kind] = version
                download = MissionDownload(vehicle.target, kind)
                self._tasks[vehicle.target.system].append(_Task(None, "", [download]))

    def _vehicle_record(self, vehicle: WatchedVehicle) -> dict[str, Any]:
        shown = {slider.name for slider in SLIDERS} | set(SHOWN_PARAMETERS)
        return {
            "type": "vehicle",
            "id": vehicle.target.system,
            "layout": vehicle.layout(),
            "parameters": {name: value for name, value in vehicle.parameters.items() if name in shown},
            "fence": vehicle.fence,
            "rally": vehicle.rally,
            "waypoints": vehicle.waypoints,
        }

    # ---- exchanges

    def _current_task(self, vehicle: WatchedVehicle, now_us: int) -> _Task | None:
        """The present task of the vehicle; requests of pages take precedence over those of the station."""
        tasks = self._tasks[vehicle.target.system]
        if not tasks:
            return None
        if tasks[0].request is None and not _has_started(tasks[0]):
            requested = next((task for task in tasks if task.request is not None), None)
            if requested is not None:
                tasks.remove(requested)
                tasks.appendleft(requested)
        task = tasks[0]
        if task.texts_before is None:
            task.texts_before = len(vehicle.view.texts)
        if task.refused_us is not None and now_us - task.refused_us >= _REASON_US:
            reasons = vehicle.view.problems_since(task.texts_before)
            self._close(vehicle, task, False, "; ".join([*task.replies, *reasons]))
            return None
        return task

    def _receive_for_task(self, vehicle: WatchedVehicle, one: Received, now_us: int) -> None:
        tasks = self._tasks[vehicle.target.system]
        if tasks and tasks[0].operations and tasks[0].texts_before is not None:
            tasks[0].operations[0].receive(one.message, now_us)
            self._advance(vehicle, tasks[0], now_us)

    def _advance(self, vehicle: WatchedVehicle, task: _Task, now_us: int) -> None:
        operation = task.operations[0]
        result = operation.result
        if result is None:
            return
        task.operations.popleft()
        task.replies.append(result.text)
        self._use_result(vehicle, operation)
        if result.status is Status.REFUSED and task.request is not None:
            task.operations.clear()
            task.refused_us = now_us
        elif not result.done:
            self._close(vehicle, task, False, result.text)
        elif not task.operations:
            self._close(vehicle, task, True, task.replies[-1])

    def _close(self, vehicle: WatchedVehicle, task: _Task, done: bool, text: str) -> None:
        self._tasks[vehicle.target.system].remove(task)
        if task.request is not None:
            self._report_result(task.request, task.name, done, text)

    def _report_result(self, sender: tuple[Any, Any], action: str, done: bool, text: str) -> None:
        page, number = sender
        record = {"type": "result", "page": page, "request": number, "action": action[:40]}
        self._news.append({**record, "ok": done, "text": text})

    def _use_result(self, vehicle: WatchedVehicle, operation: Operation) -> None:
        """Use the result of an exchange: a downloaded mission, fence or list of rally points. One that was
        not answered is asked for again."""
        if not isinstance(operation, MissionDownload) or operation.result is None:
            return
        if operation.result.status is Status.UNANSWERED:
            vehicle.plan_ids.pop(operation.kind, None)
        if not operation.result.done:
            return
        home = vehicle.origin or vehicle.home
        if operation.kind == mavlink.MAV_MISSION_TYPE_FENCE:
            vehicle.fence = fence_record(operation.items, home, vehicle.parameters)
        elif operation.kind == mavlink.MAV_MISSION_TYPE_RALLY:
            vehicle.rally = rally_record(operation.items, home)
        else:
            vehicle.waypoints = waypoints_record(operation.items, home)
        self._news.append(self._vehicle_record(vehicle))


def _has_started(task: _Task) -> bool:
    return task.texts_before is not None


def _initial_requests(vehicle: WatchedVehicle) -> list[Operation]:
    """The exchanges with which the station begins for a new vehicle."""
    target = vehicle.target
    streams = [command.message_interval(target, message, INTERVAL_US) for message in FAST_MESSAGES]
    home = command.request_message(target, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
    names = (*SHOWN_PARAMETERS, *(slider.name for slider in SLIDERS))
    parameters = [ParameterGet(target, name) for name in names]
    return [*streams, home, _run_request(vehicle), *parameters]


def _run_request(vehicle: WatchedVehicle) -> Operation:
    """The request for the run of the simulated world in which the vehicle flies."""
    return command.request_message(vehicle.target, mavlink.MAVLINK_MSG_ID_SIM_BOOT)


_PLANS = (mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY)
