"""What a running vehicle says of itself, listened to for a moment."""

from __future__ import annotations

from typing import Any

from gcs.clients.vehicle_view import VehicleView
from gcs.shell.link import Address
from gcs.shell.session import Session

LISTEN_S = 2.5  # every stream has come by then, the slowest are sent once a second


def vehicle_status(address: Address) -> dict[str, Any]:
    """The record of the vehicle at `address`."""
    with Session(address) as session:
        session.listen_to_truth()
        session.find()
        session.watch(lambda: False, LISTEN_S, "listening")
        return status_record(session.view)


def status_record(view: VehicleView) -> dict[str, Any]:
    """Keys of `gcs status --json`; None for what the vehicle has not sent."""
    load = view.latest.get("LOAD_STATE")
    current = view.latest.get("MISSION_CURRENT")
    battery = view.latest.get("SYS_STATUS")
    world = view.truth.get("SIM_STATUS")
    return {
        "mode": view.mode,
        "armed": view.armed,
        "ready_to_arm": view.ready_to_arm,
        "landed": view.landed,
        "phase": view.phase_name,
        "time_s": None if view.time_us is None else view.time_us * 1e-6,
        "mission": view.mission_state,
        "mission_item": None if current is None else current.seq,
        "mission_items": None if current is None else current.total,
        "load_east_m": None if load is None else load.y,
        "load_north_m": None if load is None else load.x,
        "load_up_m": None if load is None else -load.z,
        "cable_tension_n": None if load is None else load.tension,
        "cable_taut": None if load is None else bool(load.taut),
        "load_error_m": view.load_error_m,
        "rotor_use": view.rotor_use,
        "battery_v": None if battery is None else battery.voltage_battery * 1e-3,
        "rate_hz": None if world is None else world.rate_hz,
        "late_p99_us": None if world is None else world.late_p99_us,
        "missed_ticks": None if world is None else world.missed,
        "texts": [text.text for text in view.texts],
    }
