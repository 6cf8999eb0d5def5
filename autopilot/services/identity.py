"""The identity that the vehicle reports: one table per flavour, so that common tools know its modes.

Internally a mode is PX4's pair (main, sub); a flavour defines its number on the wire. If several numbers of a
flavour mean one pair, the requested number is reported, else the first. A flavour determines protocol
conventions (how modes are packed, what a take-off height means), not whose code flies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import CHUNK

AUTOPILOT_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
DIALECT_COMPONENT = mavlink.MAV_COMP_ID_USER1
LOAD_COMPONENT = mavlink.MAV_COMP_ID_USER11
WINCH_COMPONENT = mavlink.MAV_COMP_ID_WINCH

_CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_AUTO_FLAGS = (
    _CUSTOM
    | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
)
_MANUAL_FLAGS = _CUSTOM | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED

ARDUPILOT_GUIDED = 4  # ArduPilot's mode for take-off, "go there" and setpoints

# PX4's main modes and the sub-modes of AUTO
MANUAL, ALTCTL, POSCTL, AUTO, ACRO, OFFBOARD, STABILIZED = 1, 2, 3, 4, 5, 6, 7
AUTO_TAKEOFF, AUTO_LOITER, AUTO_MISSION, AUTO_RTL, AUTO_LAND = 2, 3, 4, 5, 6
AUTO_FOLLOW = 8
FOLLOW_MODE = AUTO, AUTO_FOLLOW

_AUTOMATIC = 4  # MAV_MODE_PROPERTY_AUTO_MODE

# Modes that the supervisor flies; the other named modes are refused
SUPPORTED_MODES = (
    (AUTO, AUTO_TAKEOFF),
    (AUTO, AUTO_LOITER),
    (AUTO, AUTO_MISSION),
    (AUTO, AUTO_RTL),
    (AUTO, AUTO_LAND),
    FOLLOW_MODE,
    (OFFBOARD, 0),
    (POSCTL, 0),
)
# modes that are suggested when a mode is refused, the most useful first
_SUGGESTED_MODES = (
    (AUTO, AUTO_LOITER),
    (AUTO, AUTO_MISSION),
    (AUTO, AUTO_RTL),
    (AUTO, AUTO_LAND),
    (POSCTL, 0),
    (OFFBOARD, 0),
)
# PX4's names of these modes for the users of ground stations
_DISPLAY_NAMES = {
    (AUTO, AUTO_TAKEOFF): "Takeoff",
    (AUTO, AUTO_LOITER): "Hold",
    (AUTO, AUTO_MISSION): "Mission",
    (AUTO, AUTO_RTL): "Return",
    (AUTO, AUTO_LAND): "Land",
    FOLLOW_MODE: "Follow Target",
    (OFFBOARD, 0): "Offboard",
    (POSCTL, 0): "Position",
}
# MAV_STANDARD_MODE of a pair
_STANDARD_MODES = {
    (AUTO, AUTO_TAKEOFF): mavlink.MAV_STANDARD_MODE_TAKEOFF,
    (AUTO, AUTO_MISSION): mavlink.MAV_STANDARD_MODE_MISSION,
    (AUTO, AUTO_RTL): mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY,
    (AUTO, AUTO_LAND): mavlink.MAV_STANDARD_MODE_LAND,
    (ALTCTL, 0): mavlink.MAV_STANDARD_MODE_ALTITUDE_HOLD,
    (POSCTL, 0): mavlink.MAV_STANDARD_MODE_POSITION_HOLD,
}


@dataclass(frozen=True, slots=True)
class Mode:
    """One mode: PX4's pair, its name, its number on the wire and its bits of HEARTBEAT.base_mode."""

    main: int
    sub: int
    name: str
    custom_mode: int
    base_mode: int

    @property
    def pair(self) -> tuple[int, int]:
        """PX4's pair."""
        return self.main, self.sub

    @property
    def standard(self) -> int:
        """MAV_STANDARD_MODE; NON_STANDARD for most."""
        return _STANDARD_MODES.get(self.pair, mavlink.MAV_STANDARD_MODE_NON_STANDARD)


def _px4(main: int, sub: int, name: str) -> Mode:
    flags = _AUTO_FLAGS if main in (AUTO, OFFBOARD) else _MANUAL_FLAGS
    return Mode(main, sub, name, sub << 24 | main << 16, flags)


def _ardupilot(custom_mode: int, name: str, main: int, sub: int = 0) -> Mode:
    return Mode(main, sub, name, custom_mode, _AUTO_FLAGS if main in (AUTO, OFFBOARD) else _MANUAL_FLAGS)


@dataclass(frozen=True)
class Flavour:
    """How one family of autopilots presents itself on the wire."""

    name: str
    autopilot: int  # MAV_AUTOPILOT
    modes: tuple[Mode, ...]
    takeoff_above_home: bool  # height of NAV_TAKEOFF in COMMAND_LONG: above home, else above sea level
    capabilities: int
    release: tuple[int, int, int]  # whose protocol is followed; clients refuse to work with old releases

    @cached_property
    def _by_pair(self) -> dict[tuple[int, int], Mode]:
        return {mode.pair: mode for mode in reversed(self.modes)}

    @cached_property
    def _by_number(self) -> dict[int, Mode]:
        return {mode.custom_mode: mode for mode in reversed(self.modes)}

    @property
    def home_is_item(self) -> bool:
        """Whether item 0 of every mission is home, so that a mission always has an item, as in ArduPilot."""
        return self.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA

    @property
    def uses_reposition_yaw(self) -> bool:
        """Whether the yaw of DO_REPOSITION is flown, as in PX4."""
        return self.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA

    @property
    def modes_are_packed(self) -> bool:
        """Whether the numbers of the modes are PX4's packed pairs."""
        return all(mode.custom_mode == mode.sub << 24 | mode.main << 16 for mode in self.modes)

    @cached_property
    def available_modes(self) -> tuple[Mode, ...]:
        """The modes that can be entered, each number once."""
        return tuple(
            mode
            for mode in self.modes
            if mode.pair in SUPPORTED_MODES and self._by_number[mode.custom_mode] is mode
        )

    def mode_refusal(self, what: str) -> str:
        """Why a mode is refused (`what`), and as many names of other modes as fit into one STATUSTEXT."""
        text = f"{what}; use"
        for pair in _SUGGESTED_MODES:
            longer = f"{text} {self._by_pair[pair].name}" if pair in self._by_pair else text
            text = longer if len(longer) <= CHUNK else text
        return text

    def mode(self, main: int, sub: int, requested_number: int | None = None) -> Mode | None:
        """The mode of PX4's pair, with the number `requested_number` if that means the pair.

        AUTO without a sub-mode is AUTO.MISSION, as in PX4.
        """
        if (main, sub) == (AUTO, 0):
            sub = AUTO_MISSION
        for mode in self.modes:
            if mode.custom_mode == requested_number and mode.pair == (main, sub):
                return mode
        return self._by_pair.get((main, sub))

    def mode_of_number(self, custom_mode: int) -> Mode | None:
        """The mode with this number on the wire."""
        return self._by_number.get(custom_mode)

    def mode_of_standard(self, standard: int) -> Mode | None:
        """The mode with this MAV_STANDARD_MODE that can be flown."""
        return next((mode for mode in self.available_modes if mode.standard == standard != 0), None)


_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
_ENCODE_BYTEWISE = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
_ENCODE_CAST = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST

PX4 = Flavour(
    name="px4",
    autopilot=mavlink.MAV_AUTOPILOT_PX4,
    modes=(
        _px4(MANUAL, 0, "MANUAL"),
        _px4(ALTCTL, 0, "ALTCTL"),
        _px4(POSCTL, 0, "POSCTL"),
        _px4(AUTO, AUTO_TAKEOFF, "TAKEOFF"),
        _px4(AUTO, AUTO_LOITER, "LOITER"),
        _px4(AUTO, AUTO_MISSION, "MISSION"),
        _px4(AUTO, AUTO_RTL, "RTL"),
        _px4(AUTO, AUTO_LAND, "LAND"),
        _px4(AUTO, AUTO_FOLLOW, "FOLLOWME"),
        _px4(ACRO, 0, "ACRO"),
        _px4(OFFBOARD, 0, "OFFBOARD"),
        _px4(STABILIZED, 0, "STABILIZED"),
    ),
    takeoff_above_home=False,
    capabilities=_CAPABILITIES | _ENCODE_BYTEWISE,
    release=(1, 15, 0),
)

ARDUPILOT = Flavour(
    name="ardupilot",
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    modes=(
        # GUIDED comprises take-off, "go there" and holding; in a request it means holding
        _ardupilot(ARDUPILOT_GUIDED, "GUIDED", AUTO, AUTO_LOITER),
        _ardupilot(5, "LOITER", AUTO, AUTO_LOITER),
        _ardupilot(17, "BRAKE", AUTO, AUTO_LOITER),
        _ardupilot(3, "AUTO", AUTO, AUTO_MISSION),
        _ardupilot(6, "RTL", AUTO, AUTO_RTL),
        _ardupilot(9, "LAND", AUTO, AUTO_LAND),
        _ardupilot(ARDUPILOT_GUIDED, "GUIDED", AUTO, AUTO_TAKEOFF),
        _ardupilot(ARDUPILOT_GUIDED, "GUIDED", OFFBOARD),
        _ardupilot(0, "STABILIZE", STABILIZED),
        _ardupilot(0, "STABILIZE", MANUAL),
        _ardupilot(1, "ACRO", ACRO),
        _ardupilot(2, "ALT_HOLD", ALTCTL),
        _ardupilot(16, "POSHOLD", POSCTL),
        _ardupilot(23, "FOLLOW", AUTO, AUTO_FOLLOW),
    ),
    takeoff_above_home=True,
    capabilities=_CAPABILITIES | _ENCODE_CAST,
    release=(4, 5, 0),
)

GENERIC = replace(
    PX4,
    name="generic",
    autopilot=mavlink.MAV_AUTOPILOT_GENERIC,
    takeoff_above_home=True,
    capabilities=_CAPABILITIES | _ENCODE_CAST,
)

FLAVOURS = {flavour.name: flavour for flavour in (PX4, ARDUPILOT, GENERIC)}


@dataclass(frozen=True, slots=True)
class ParameterEncoding:
    """How parameters are transferred: all as REAL32, or whole numbers as INT32, by bits or by value."""

    integers: bool
    bytewise: bool


ALL_REAL = ParameterEncoding(False, False)


@dataclass(frozen=True, slots=True)
class Identity:
    """Ids on the wire and the flavour. `load_system` 0: the load is not a separate MAVLink system."""

    system: int = 1
    flavour: Flavour = PX4
    version: tuple[int, int, int] = (0, 1, 0)  # of this program
    load_system: int = 0
    integer_parameters: bool = False  # whole-numbered parameters are transferred as INT32
    rotors: int = 4  # number of rotors

    @property
    def parameter_encoding(self) -> ParameterEncoding:
        """By bits or by value, as the capabilities state."""
        return ParameterEncoding(self.integer_parameters, bool(self.flavour.capabilities & _ENCODE_BYTEWISE))


def identity_of(table: AutopilotParameters) -> Identity:
    """The identity that the parameters request; a load with the vehicle's own id is not a separate system."""
    system, load = int(table["MAV_SYS_ID"]), int(table["MAV_LOAD_SYS_ID"])
    flavour = tuple(FLAVOURS.values())[int(table["MAV_IDENTITY"])]
    integers = table["MAV_PARAM_INT"] > 0.0
    separate_load = 0 if load == system else load
    return Identity(
        system, flavour, load_system=separate_load, integer_parameters=integers, rotors=len(table.layout)
    )


def available_modes_messages(identity: Identity) -> tuple[mavlink.MAVLink_available_modes_message, ...]:
    """AVAILABLE_MODES for each mode that can be flown, with the name that PX4 or ArduPilot sends."""
    modes = identity.flavour.available_modes
    names = _DISPLAY_NAMES if identity.flavour.modes_are_packed else {}
    return tuple(
        mavlink.MAVLink_available_modes_message(
            number_modes=len(modes),
            mode_index=i,
            standard_mode=mode.standard,
            custom_mode=mode.custom_mode,
            properties=_AUTOMATIC if mode.main == AUTO else 0,
            mode_name=names.get(mode.pair, mode.name).encode(),
        )
        for i, mode in enumerate(modes, 1)
    )


def protocol_version_message() -> mavlink.MAVLink_protocol_version_message:
    """PROTOCOL_VERSION: MAVLink 2 is sent, MAVLink 1 is understood."""
    nothing = (0,) * 8
    return mavlink.MAVLink_protocol_version_message(200, 100, 200, nothing, nothing)


def _version_word(version: tuple[int, int, int]) -> int:
    """major, minor, patch, release type DEV (0), one byte each."""
    major, minor, patch = version
    return major << 24 | minor << 16 | patch << 8


def autopilot_version_message(identity: Identity) -> mavlink.MAVLink_autopilot_version_message:
    """AUTOPILOT_VERSION: the capabilities of the vehicle, and the versions."""
    nothing = (0,) * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities=identity.flavour.capabilities,
        flight_sw_version=_version_word(identity.flavour.release),
        middleware_sw_version=_version_word(identity.version),
        os_sw_version=0,
        board_version=0,
        flight_custom_version=nothing,
        middleware_custom_version=nothing,
        os_custom_version=nothing,
        vendor_id=0,
        product_id=0,
        uid=identity.system,
    )
