"""What the ground station knows of the vehicle: the newest message of each kind, and its meaning."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from autopilot.wire.codec import FieldReader, Received
from autopilot.wire.convert.rotor_forces import rotor_forces
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import TextReader
from gcs.clients.modes import mode_name

BOOT_CLOCK = "SYSTEM_TIME"

# the beginning of an earlier text that the vehicle sends again on request: number, total, and age
_RECALLED = re.compile(r"\[(\d+)/(\d+), (-?\d+\.\d) s ago\] (.*)", re.DOTALL)
_STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT
_IDS = {kind.msgname: message_id for message_id, kind in mavlink.mavlink_map.items()}
_CLOCKS = [
    (kind.id, FieldReader(kind, "time_usec"))
    for kind in (mavlink.MAVLink_load_setpoint_message, mavlink.MAVLink_cascade_errors_message)
]
_SOURCES = {
    message_id: FieldReader(kind, "source")
    for message_id, kind in mavlink.mavlink_map.items()
    if "source" in kind.fieldnames
}

# a leg that holds a position; what levels or calms the vehicle controls an attitude
_POSITION_MODES = (mavlink.PLUMBLINE_CONTROL_LOAD_POSITION, mavlink.PLUMBLINE_CONTROL_QUAD_POSITION)
_PHASES = {
    value: str(entry.name).removeprefix("PLUMBLINE_PHASE_").replace("_", " ").lower()
    for value, entry in mavlink.enums["PLUMBLINE_PHASE"].items()
    if "ENUM_END" not in entry.name
}
_STATES = {
    value: str(entry.name).removeprefix("MAV_STATE_").lower()
    for value, entry in mavlink.enums["MAV_STATE"].items()
    if "ENUM_END" not in entry.name
}
_LANDED = {
    mavlink.MAV_LANDED_STATE_ON_GROUND: "on the ground",
    mavlink.MAV_LANDED_STATE_IN_AIR: "in the air",
    mavlink.MAV_LANDED_STATE_TAKEOFF: "taking off",
    mavlink.MAV_LANDED_STATE_LANDING: "landing",
}
_MISSION_STATES = {
    mavlink.MISSION_STATE_NO_MISSION: "none",
    mavlink.MISSION_STATE_NOT_STARTED: "not started",
    mavlink.MISSION_STATE_ACTIVE: "active",
    mavlink.MISSION_STATE_PAUSED: "paused",
    mavlink.MISSION_STATE_COMPLETE: "complete",
}


class Text(NamedTuple):
    """A STATUSTEXT, and its time on the ground station's clock."""

    now_us: int
    severity: int
    text: str


class LatestMessages(Mapping[str, Any]):
    """The newest message of each name; a message is decoded only when it is read."""

    def __init__(self) -> None:
        self._received: dict[int, Received] = {}

    def put(self, received: Received) -> None:
        """Store a message in place of the previous one of its kind."""
        self._received[received.id] = received

    def frame(self, message_id: int) -> bytes | None:
        """The frame of the newest message as it was received, None if there is none."""
        received = self._received.get(message_id)
        return None if received is None else received.frame

    def __getitem__(self, name: str) -> Any:
        return self._received[_IDS[name]].message

    def __iter__(self) -> Iterator[str]:
        return (mavlink.mavlink_map[message_id].msgname for message_id in self._received)

    def __len__(self) -> int:
        return len(self._received)


class VehicleView:
    """The state of the vehicle, updated by `update`; a property is None until the vehicle has sent it."""

    def __init__(self) -> None:
        self.latest = LatestMessages()  # of the vehicle
        self.truth = LatestMessages()  # of the simulated world
        self.texts: list[Text] = []
        self.recalled: list[Text] = []  # earlier texts that the vehicle sent again on request
        self.recalled_all = False  # the last of these has come
        self._text_reader = TextReader()

    def update(self, received: Received, now_us: int) -> None:
        """Process one message of the vehicle."""
        if received.id == _STATUSTEXT:
            self._text(received.message, now_us)
            return
        source = _SOURCES.get(received.id)
        if source is not None and source.read(received.frame) == mavlink.PLUMBLINE_SOURCE_TRUTH:
            self.truth.put(received)
        else:
            self.latest.put(received)

    def _text(self, message: Any, now_us: int) -> None:
        text = self._text_reader.read(message)
        if text is not None:
            self._add_text(now_us, message.severity, text)

    def _add_text(self, now_us: int, severity: int, text: str) -> None:
        match = _RECALLED.fullmatch(text)
        if match is None:
            self.texts.append(Text(now_us, severity, text))
            return
        number, total, age_s, original = match.groups()
        self.recalled.append(Text(now_us - round(float(age_s) * 1e6), severity, original))
        self.recalled_all = number == total

    def problems_since(self, count: int, severity: int = mavlink.MAV_SEVERITY_WARNING) -> list[str]:
        """Texts at least as severe as `severity` that came after the first `count` texts, without repeats."""
        found = [text.text for text in self.texts[count:] if text.severity <= severity]
        return list(dict.fromkeys(found))

    @property
    def armed(self) -> bool | None:
        heartbeat = self.latest.get("HEARTBEAT")
        return None if heartbeat is None else bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def mode(self) -> str | None:
        heartbeat = self.latest.get("HEARTBEAT")
        return None if heartbeat is None else mode_name(heartbeat)

    @property
    def state(self) -> str | None:
        """MAV_STATE: standby, active, critical (a failsafe, or the simulator is silent), ..."""
        heartbeat = self.latest.get("HEARTBEAT")
        return None if heartbeat is None else _STATES.get(heartbeat.system_status, "not known")

    @property
    def ready_to_arm(self) -> bool | None:
        status = self.latest.get("SYS_STATUS")
        bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        if status is None or not status.onboard_control_sensors_present & bit:
            return None
        return bool(status.onboard_control_sensors_health & bit)

    @property
    def landed(self) -> str | None:
        state = self.latest.get("EXTENDED_SYS_STATE")
        return None if state is None else _LANDED.get(state.landed_state, "not known")

    @property
    def on_ground(self) -> bool | None:
        state = self.latest.get("EXTENDED_SYS_STATE")
        return None if state is None else bool(state.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)

    @property
    def phase(self) -> int | None:
        setpoint = self.latest.get("LOAD_SETPOINT")
        return None if setpoint is None else int(setpoint.phase)

    @property
    def phase_name(self) -> str | None:
        phase = self.phase
        return None if phase is None else _PHASES.get(phase, f"phase {phase}")

    @property
    def holding(self) -> bool | None:
        """Whether load, or vehicle after a release, is held at rest: in phase hold, with no path left to fly,
        be it of a stop or to a place."""
        setpoint = self.latest.get("LOAD_SETPOINT")
        if setpoint is None:
            return None
        is_position = setpoint.control_mode in _POSITION_MODES
        return (
            is_position and setpoint.phase == mavlink.PLUMBLINE_PHASE_HOLD and math.isnan(setpoint.duration)
        )

    @property
    def mission_state(self) -> str | None:
        current = self.latest.get("MISSION_CURRENT")
        return None if current is None else _MISSION_STATES.get(current.mission_state, "not known")

    @property
    def time_us(self) -> int | None:
        """The vehicle's clock since boot, from its most frequent messages if there are any."""
        frames = [(clock, self.latest.frame(message_id)) for message_id, clock in _CLOCKS]
        times = [clock.read(frame) for clock, frame in frames if frame is not None]
        if times:
            return int(max(times))
        clock = self.latest.get(BOOT_CLOCK)
        return None if clock is None else int(clock.time_boot_ms) * 1000

    @property
    def load_error_m(self) -> float | None:
        """|e_x| as the autopilot computes it, while it tracks the position of the load."""
        errors = self.latest.get("CASCADE_ERRORS")
        if errors is None or errors.control_mode != mavlink.PLUMBLINE_CONTROL_LOAD_POSITION:
            return None
        error = math.sqrt(sum(component * component for component in errors.e_x))
        return error if math.isfinite(error) else None

    @property
    def motion_without_load(self) -> tuple[tuple[float, float, float], float] | None:
        """Position (east, north, up) and speed of the vehicle while its own position is controlled, as after
        a release: position commands then refer to the vehicle."""
        setpoint, motion = self.latest.get("LOAD_SETPOINT"), self.latest.get("LOCAL_POSITION_NED")
        if setpoint is None or setpoint.control_mode != mavlink.PLUMBLINE_CONTROL_QUAD_POSITION:
            return None
        if motion is None:
            return None
        return (motion.y, motion.x, -motion.z), math.hypot(motion.vx, motion.vy, motion.vz)

    @property
    def load_released(self) -> bool | None:
        winch = self.latest.get("WINCH_STATUS")
        return None if winch is None else bool(winch.status & mavlink.MAV_WINCH_STATUS_ABANDON_LINE)

    @property
    def rotor_use(self) -> float | None:
        """The greatest rotor force over its limit; None for a vehicle without limits."""
        rotors = self.latest.get("ROTOR_STATE")
        if rotors is None or not math.isfinite(rotors.force_max) or rotors.force_max <= 0.0:
            return None
        return float(max(rotor_forces(rotors)) / rotors.force_max)
