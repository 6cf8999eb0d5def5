"""The status that a running vehicle sends, received for a moment, and its earlier status texts."""

from __future__ import annotations

import math
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients import command
from gcs.clients.vehicle_view import Text, VehicleView
from gcs.errors import NoVehicleError, RefusedError
from gcs.shell.display import notify, notify_if_slow
from gcs.shell.link import Address, monotonic_us
from gcs.shell.session import Session
from gcs.shell.truth import TruthLink

LISTEN_S = 2.5  # by then every stream has arrived; the slowest are sent once a second
RECALL_S = 1.0  # stored texts arrive within a fifth of that; a vehicle without any sends nothing
SHOWN_TEXTS = 10  # texts that are warnings or worse
# messages that `status_record` reads: when all of them have arrived, listening ends
_STATUS_MESSAGES = {
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "MISSION_CURRENT",
    "LOAD_SETPOINT",
    "LOAD_STATE",
    "CASCADE_ERRORS",
    "ROTOR_STATE",
}

_NO_MISSION = 0xFFFF  # in the field `total` of MISSION_CURRENT
_NO_VOLTAGE = 0xFFFF  # in the field `voltage_battery` of SYS_STATUS

_SEVERITIES = {
    value: str(entry.name).removeprefix("MAV_SEVERITY_").lower()
    for value, entry in mavlink.enums["MAV_SEVERITY"].items()
}


def vehicle_status(address: Address, truth_at: Address | None = None, quiet: bool = False) -> dict[str, Any]:
    """The record of the vehicle at `address`; `texts` are the last ones that are warnings or worse.

    `truth_at`: where its simulator sends the truth; None: where `sitl` does by default.
    """
    with (
        TruthLink(truth_at) as truth,
        Session(address) as session,
        notify_if_slow("listening to the vehicle", quiet),
    ):
        session.find_with_truth(truth)
        truth_messages = {"SIM_STATUS"} if truth.received else set()
        view = session.view
        request = _request_texts(session)
        session.watch(
            lambda: (
                view.latest.keys() >= _STATUS_MESSAGES
                and view.truth.keys() >= truth_messages
                and request.is_complete
            ),
            LISTEN_S,
            "listening",
        )
        if session.unanswered_reason:
            notify(
                "texts, and rate, lateness and missed ticks of the simulator are missing: "
                f"{session.unanswered_reason}"
            )
        elif truth.missing:
            notify(f"no rate, lateness and missed ticks of the simulator: {truth.missing}")
        texts = [text for text in request.texts if text.severity <= mavlink.MAV_SEVERITY_WARNING]
        return {**status_record(session.view), "texts": text_records(texts[-SHOWN_TEXTS:])}


def vehicle_texts(address: Address) -> list[dict[str, Any]]:
    """The status texts of the vehicle at `address`, the oldest first; if it does not store texts, those sent
    meanwhile. NoVehicleError if it does not answer because its key is missing."""
    with Session(address) as session:
        session.find()
        request = _request_texts(session)
        if session.unanswered_reason:
            raise NoVehicleError(f"its texts could not be requested: {session.unanswered_reason}")
        session.watch(lambda: request.is_complete, RECALL_S)
        return text_records(request.texts)


class _TextRequest:
    """A request for the texts that a vehicle has stored; `is_accepted`: it has accepted the request."""

    def __init__(self, view: VehicleView, is_accepted: bool) -> None:
        self._view = view
        self._is_accepted = is_accepted
        self._texts_before = len(view.texts) if is_accepted else 0
        self._until_us = monotonic_us() + round(RECALL_S * 1e6)

    @property
    def is_complete(self) -> bool:
        """Whether all texts have arrived that will arrive."""
        return not self._is_accepted or self._view.recalled_all or monotonic_us() >= self._until_us

    @property
    def texts(self) -> list[Text]:
        """The stored texts, and those sent since then."""
        stored = {(text.severity, text.text) for text in self._view.recalled}
        new = (text for text in self._view.texts[self._texts_before :] if text[1:] not in stored)
        return [*self._view.recalled, *new]


def _request_texts(session: Session) -> _TextRequest:
    is_accepted = not session.unanswered_reason
    if is_accepted:
        try:
            session.run(command.request_message(session.target, mavlink.MAVLINK_MSG_ID_STATUSTEXT))
        except (RefusedError, NoVehicleError):
            is_accepted = False
    return _TextRequest(session.view, is_accepted)


def text_records(texts: list[Text]) -> list[dict[str, Any]]:
    """Texts with their age in s and the name of their severity."""
    now_us = monotonic_us()
    return [
        {
            "age_s": max(0.0, (now_us - received_us) * 1e-6),
            "severity": _SEVERITIES.get(severity, str(severity)),
            "text": text,
        }
        for received_us, severity, text in texts
    ]


def _mission_items(total: int) -> int | None:
    """The number of items in the field of MISSION_CURRENT, whose 0 means that the vehicle does not count."""
    return {0: None, _NO_MISSION: 0}.get(total, total)


def _battery_v(voltage_mv: int) -> float | None:
    """The voltage in SYS_STATUS; None if it is not known."""
    return None if voltage_mv == _NO_VOLTAGE else voltage_mv * 1e-3


def status_record(view: VehicleView) -> dict[str, Any]:
    """Keys of `gcs status --json` except the texts; None for what the vehicle has not sent."""
    load = view.latest.get("LOAD_STATE")
    if load is not None and not math.isfinite(load.tension):
        load = None  # the load is not measured
    current = view.latest.get("MISSION_CURRENT")
    battery = view.latest.get("SYS_STATUS")
    world = view.truth.get("SIM_STATUS")
    return {
        "mode": view.mode,
        "state": view.state,
        "armed": view.armed,
        "ready_to_arm": view.ready_to_arm,
        "landed": view.landed,
        "phase": view.phase_name,
        "time_s": None if view.time_us is None else view.time_us * 1e-6,
        "mission": view.mission_state,
        "mission_item": None if current is None else current.seq,
        "mission_items": None if current is None else _mission_items(current.total),
        "load_east_m": None if load is None else load.y,
        "load_north_m": None if load is None else load.x,
        "load_up_m": None if load is None else -load.z,
        "cable_tension_n": None if load is None else load.tension,
        "cable_taut": None if load is None else bool(load.taut),
        "load_error_m": view.load_error_m,
        "rotor_use": view.rotor_use,
        "battery_v": None if battery is None else _battery_v(battery.voltage_battery),
        "rate_hz": None if world is None else world.rate_hz,
        "late_p99_us": None if world is None else world.late_p99_us,
        "missed_ticks": None if world is None else world.missed,
    }
