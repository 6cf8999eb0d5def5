"""HEARTBEAT: the presence of the vehicle, its mode, and whether its rotors may turn."""

from __future__ import annotations

from autopilot.services.identity import Identity
from autopilot.services.snapshot import Snapshot
from autopilot.wire.dialect import plumbline as mavlink

HEARTBEAT_US = 1_000_000
MULTIROTORS = {  # MAV_TYPE by the number of rotors
    4: mavlink.MAV_TYPE_QUADROTOR,
    6: mavlink.MAV_TYPE_HEXAROTOR,
    8: mavlink.MAV_TYPE_OCTOROTOR,
    10: mavlink.MAV_TYPE_DECAROTOR,
    12: mavlink.MAV_TYPE_DODECAROTOR,
}
_PROTOCOL_VERSION = 3  # HEARTBEAT.mavlink_version, the same since MAVLink 1


def heartbeat_message(snapshot: Snapshot, identity: Identity) -> mavlink.MAVLink_heartbeat_message:
    """The vehicle's HEARTBEAT; a mode that is not in the flavour's table is reported as custom mode 0."""
    flavour = identity.flavour
    mode = flavour.mode(snapshot.main_mode, snapshot.sub_mode, snapshot.requested_mode)
    base_mode = mode.base_mode if mode else mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if snapshot.armed:
        base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return mavlink.MAVLink_heartbeat_message(
        type=MULTIROTORS.get(identity.rotors, mavlink.MAV_TYPE_GENERIC_MULTIROTOR),
        autopilot=flavour.autopilot,
        base_mode=base_mode,
        custom_mode=mode.custom_mode if mode else 0,
        system_status=snapshot.system_status,
        mavlink_version=_PROTOCOL_VERSION,
    )


def load_heartbeat_message(snapshot: Snapshot) -> mavlink.MAVLink_heartbeat_message:
    """HEARTBEAT of the load as a separate system: no autopilot, nothing to command."""
    return _heartbeat_of(mavlink.MAV_TYPE_AIRSHIP, snapshot)


def winch_heartbeat_message(snapshot: Snapshot) -> mavlink.MAVLink_heartbeat_message:
    """HEARTBEAT of the winch as a component of the vehicle."""
    return _heartbeat_of(mavlink.MAV_TYPE_WINCH, snapshot)


def _heartbeat_of(kind: int, snapshot: Snapshot) -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(
        type=kind,
        autopilot=mavlink.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=snapshot.system_status,
        mavlink_version=_PROTOCOL_VERSION,
    )
