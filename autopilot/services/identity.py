"""Who the vehicle says it is: one table per flavour, so that the tools in the field know its modes.

Inside, a mode is PX4's pair (main, sub); a flavour says under which number it travels. A flavour is a promise
about protocol habits (how modes are packed, what a take-off height means), not about whose code flies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from autopilot.wire.dialect import plumbline as mavlink

AUTOPILOT_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
DIALECT_COMPONENT = mavlink.MAV_COMP_ID_USER1
LOAD_COMPONENT = mavlink.MAV_COMP_ID_USER11

_CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_AUTO_FLAGS = (
    _CUSTOM
    | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
)
_MANUAL_FLAGS = _CUSTOM | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED

# PX4's main modes and the sub-modes of AUTO
MANUAL, ALTCTL, POSCTL, AUTO, ACRO, OFFBOARD, STABILIZED = 1, 2, 3, 4, 5, 6, 7
AUTO_TAKEOFF, AUTO_LOITER, AUTO_MISSION, AUTO_RTL, AUTO_LAND = 2, 3, 4, 5, 6


@dataclass(frozen=True, slots=True)
class Mode:
    """One mode: PX4's pair, its name, its number on the wire and its bits of HEARTBEAT.base_mode."""

    main: int
    sub: int
    name: str
    custom_mode: int
    base_mode: int


def _px4(main: int, sub: int, name: str) -> Mode:
    flags = _AUTO_FLAGS if main in (AUTO, OFFBOARD) else _MANUAL_FLAGS
    return Mode(main, sub, name, sub << 24 | main << 16, flags)


@dataclass(frozen=True)
class Flavour:
    """How one family of autopilots presents itself."""

    name: str
    vehicle_type: int  # MAV_TYPE
    autopilot: int  # MAV_AUTOPILOT
    modes: tuple[Mode, ...]
    takeoff_above_home: bool  # NAV_TAKEOFF in COMMAND_LONG: height above home, else above sea level
    capabilities: int
    release: tuple[int, int, int]  # whose protocol habits are claimed; clients refuse to work with old ones

    @cached_property
    def _by_pair(self) -> dict[tuple[int, int], Mode]:
        return {(mode.main, mode.sub): mode for mode in self.modes}

    @cached_property
    def _by_number(self) -> dict[int, Mode]:
        return {mode.custom_mode: mode for mode in self.modes}

    def mode(self, main: int, sub: int) -> Mode | None:
        """The mode of PX4's pair; AUTO without a sub-mode is AUTO.MISSION, as PX4 has it."""
        if (main, sub) == (AUTO, 0):
            sub = AUTO_MISSION
        return self._by_pair.get((main, sub))

    def mode_of_number(self, custom_mode: int) -> Mode | None:
        """The mode with this number on the wire."""
        return self._by_number.get(custom_mode)


PX4 = Flavour(
    name="px4",
    vehicle_type=mavlink.MAV_TYPE_QUADROTOR,
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
        _px4(ACRO, 0, "ACRO"),
        _px4(OFFBOARD, 0, "OFFBOARD"),
        _px4(STABILIZED, 0, "STABILIZED"),
    ),
    takeoff_above_home=False,
    capabilities=(
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
        | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    ),
    release=(1, 15, 0),
)

FLAVOURS = {flavour.name: flavour for flavour in (PX4,)}


@dataclass(frozen=True, slots=True)
class Identity:
    """Ids on the wire and the flavour. `load_system` 0: the load is no MAVLink system of its own."""

    system: int = 1
    flavour: Flavour = PX4
    version: tuple[int, int, int] = (0, 1, 0)  # of this program
    load_system: int = 0


def _version_word(version: tuple[int, int, int]) -> int:
    """major, minor, patch, release type DEV (0), one byte each."""
    major, minor, patch = version
    return major << 24 | minor << 16 | patch << 8


def autopilot_version_message(identity: Identity) -> mavlink.MAVLink_autopilot_version_message:
    """AUTOPILOT_VERSION: what the vehicle can do, and which releases speak."""
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
