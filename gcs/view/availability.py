"""Which actions of the page the vehicle would refuse in its present state, as its telemetry tells, and why.

What the vehicle has not reported rules nothing out: the vehicle itself decides, and says why it refuses.
"""

from __future__ import annotations

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.vehicle_view import VehicleView

_DISARMED, _ARMED = mavlink.PLUMBLINE_PHASE_DISARMED, mavlink.PLUMBLINE_PHASE_ARMED
_TAUTEN, _LIFT = mavlink.PLUMBLINE_PHASE_TAUTEN, mavlink.PLUMBLINE_PHASE_LIFT
_HOLD, _MISSION = mavlink.PLUMBLINE_PHASE_HOLD, mavlink.PLUMBLINE_PHASE_MISSION
_TERMINATED = {mavlink.PLUMBLINE_PHASE_FAILSAFE: "the flight was terminated, the rotors stand"}
# what the flight does in these phases until it is done, except to land
_NOT_TO_RETURN = {mavlink.PLUMBLINE_PHASE_SET_DOWN: "the vehicle lands", **_TERMINATED}
_NOT_TO_HOLD = {_TAUTEN: "the cable is tautened: land, or wait until the load is lifted", **_NOT_TO_RETURN}
_FLOWN = "the mission is being flown"
_NOT_TO_START = {_LIFT: "the load is being lifted", _MISSION: _FLOWN, **_NOT_TO_HOLD}
_IDLE_MODES = ("hold", "guided", "loiter")  # on the ground: arming begins nothing
_MISSION_MODES = ("mission", "auto")


def unavailable_actions(view: VehicleView) -> dict[str, str]:
    """The actions that the vehicle would refuse now, or that would change nothing, each with the reason."""
    armed, on_ground, mission = _is_armed(view), _is_on_ground(view), _mission_reason(view)
    phase = _DISARMED if view.phase is None else view.phase
    grounded = "on the ground" if on_ground else ""
    not_armable = _TERMINATED.get(phase) or ("not ready to arm" if view.ready_to_arm is False else "")
    takes_off = "the take-off has begun already" if phase in (_TAUTEN, _LIFT) else "in the air"
    idle = on_ground and (view.phase is None or view.mode in _IDLE_MODES)
    held = "held already" if view.holding else ""
    reasons = {
        "arm": "armed already" if armed else not_armable,
        "disarm": "not armed" if armed is False else "in the air: land first" if on_ground is False else "",
        "takeoff": (takes_off if on_ground is False else "") if armed else not_armable,
        "start": mission or (_NOT_TO_START.get(phase, "") if armed else not_armable),
        "resume": mission or ("" if armed else grounded) or _NOT_TO_START.get(phase, ""),
        "hold": "on the ground: nothing is under way" if idle else held or _NOT_TO_HOLD.get(phase, ""),
        "land": ("" if armed else grounded) or _TERMINATED.get(phase, ""),
        "return": grounded or _NOT_TO_RETURN.get(phase, ""),
        "goto": grounded or _NOT_TO_HOLD.get(phase, ""),
        "release": "the load is released already" if view.load_released else "",
    }
    return {action: reason for action, reason in reasons.items() if reason}


def _is_armed(view: VehicleView) -> bool | None:
    """Whether the rotors are armed: by the phase if there is one, which is sent more often than HEARTBEAT."""
    return view.armed if view.phase is None else view.phase != _DISARMED and view.phase not in _TERMINATED


def _is_on_ground(view: VehicleView) -> bool | None:
    return view.on_ground if view.phase is None else view.phase in (_DISARMED, _ARMED)


def _mission_reason(view: VehicleView) -> str:
    """Why no mission can be begun or continued, whatever the vehicle does."""
    if view.mission_state == "none":
        return "the vehicle has no mission"
    flies = view.mode in _MISSION_MODES and view.phase != _HOLD and _is_on_ground(view) is False
    return _FLOWN if view.mission_state == "active" and flies else ""
