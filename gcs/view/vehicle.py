"""One vehicle as the page shows it: everything that is known now, in one record of plain numbers."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from autopilot.wire.codec import Received
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.convert.rotor_forces import rotor_forces
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_encoding import decode_parameter_value
from autopilot.wire.parameter_table import decimal_from_float32
from gcs.clients.connection import Connection
from gcs.clients.operation import Target
from gcs.clients.vehicle_view import VehicleView
from gcs.view.availability import unavailable_actions
from gcs.view.link_quality import LinkQuality
from gcs.view.tether import Tether
from gcs.view.truth import PositionNED, Truth

_MAX_CABLE_RATIO = 1.25  # of the cable's length: a load that is farther away is no longer attached
_RELEASE_MARGIN_M = 0.2  # the same for an estimate, beyond the cable; the estimator may not notice a release
_MAX_ESTIMATES = 8  # estimates that are kept until the truth of their time arrives
_NOT_CARRIED = {mavlink.PLUMBLINE_PHASE_DISARMED, mavlink.PLUMBLINE_PHASE_ARMED}


class WatchedVehicle:
    """What one vehicle has reported, and its link."""

    def __init__(self, target: Target, connection: Connection) -> None:
        self.target = target
        self.connection = connection
        self.origin: Home | None = None  # of the picture
        self._home: Home | None = None
        self._tether = Tether(_RELEASE_MARGIN_M)  # as the vehicle estimates it
        self.view = VehicleView()
        self.truth = Truth()
        self.link = LinkQuality()
        self.parameters: dict[str, float] = {}
        self.changed_parameters: dict[str, float] = {}  # that were not sent to the page yet
        self.fence: dict[str, Any] | None = None
        self.rally: list[list[float]] = []
        self.waypoints: list[list[float]] = []
        self._estimated_positions: deque[tuple[int, PositionNED]] = deque(
            maxlen=_MAX_ESTIMATES
        )  # load positions as estimated
        self.plan_ids: dict[int, int] = {}  # by MAV_MISSION_TYPE: the version asked for, unless unanswered
        self.sent_texts = 0  # number of view.texts that were sent to the page

    def receive(self, one: Received, now_us: int) -> None:
        """Process one message of the vehicle."""
        if one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and one.component != self.target.component:
            return
        self.link.on_message(one, now_us)
        if one.id == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN or (
            one.id == mavlink.MAVLINK_MSG_ID_HOME_POSITION and self._home is None
        ):
            place = one.message
            self._home = Home(place.latitude * 1e-7, place.longitude * 1e-7, place.altitude * 1e-3)
        self.view.update(one, now_us)
        if one.id == mavlink.MAVLINK_MSG_ID_LOAD_STATE:
            load = one.message
            self._tether.update(load)
            self._estimated_positions.append((load.time_usec, (load.x, load.y, load.z)))
        if one.id == mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
            message = one.message
            value = decode_parameter_value(message.param_value, message.param_type)
            self.set_parameter(message.param_id, decimal_from_float32(value))
        time_us = self.time_us
        if time_us is not None:
            self.link.on_clock(time_us, now_us)

    def set_parameter(self, name: str, value: float) -> None:
        """Note the value of a parameter."""
        if math.isfinite(value):
            self.parameters[name] = self.changed_parameters[name] = value

    @property
    def time_us(self) -> int | None:
        """The vehicle's clock."""
        return self.view.time_us

    @property
    def home(self) -> Home:
        """The origin of the vehicle's positions; a home that is set later does not move them."""
        return self._home or Home()

    @property
    def offset(self) -> PositionNED:
        """Position of `home` in the picture, whose origin is `origin`, NED."""
        if self.origin is None or self.home == self.origin:
            return 0.0, 0.0, 0.0
        home_deg_e7 = round(self.home.latitude_deg * 1e7), round(self.home.longitude_deg * 1e7)
        return ned_from_enu(enu_from_geodetic(*home_deg_e7, round(self.home.altitude_m * 1e3), self.origin))

    def layout(self) -> dict[str, float]:
        """Sizes of the vehicle that the picture needs, in m."""
        return {
            "arm": self.parameters.get("VEH_ARM_LEN", 0.126),
            "cable": self.parameters.get("VEH_CABLE_LEN", 0.7),
        }

    def state(self, now_us: int) -> dict[str, Any]:
        """Everything that is known at this moment; None for unknown values. Positions NED, m; angles deg."""
        view = self.view
        offset = self.offset
        load, taut = self._load(offset)
        position, attitude = self._pose()
        rotors, force_max = self._rotors()
        return {
            "id": self.target.system,
            "time": None if self.time_us is None else round(self.time_us * 1e-6, 4),
            "armed": view.armed,
            "ready": view.ready_to_arm,
            "mode": view.mode,
            "phase": view.phase_name,
            "mission": view.mission_state,
            "item": self._latest("MISSION_CURRENT", "seq"),
            "items": self._latest("MISSION_CURRENT", "total"),
            "position": _translated(position, offset),
            "attitude": _rounded_values(attitude, 5),
            "velocity": self._velocity(),
            "load": load,
            "taut": taut,
            "cable": round(self.cable, 3),
            "asked": self._desired(offset),
            "error": _rounded(view.load_error_m),
            "tension": self._tension(),
            "swing": self._swing(),
            "rotors": rotors,
            "force_max": force_max,
            "estimator_error": self._estimator_error(),
            "wind": _rounded_values(self._wind()),
            "unavailable": unavailable_actions(view),
            "link": self.link.record(now_us),
        }

    def _latest(self, message: str, field: str) -> Any:
        found = self.view.latest.get(message)
        return None if found is None else getattr(found, field)

    def _load_message(self) -> Any:
        """LOAD_STATE: the true one if it is known, else the estimate."""
        true = self.truth.message(mavlink.MAVLINK_MSG_ID_LOAD_STATE)
        return true if true is not None else self.view.latest.get("LOAD_STATE")

    def _load(self, offset: PositionNED) -> tuple[dict[str, Any] | None, bool | None]:
        message = self._load_message()
        if message is None or not math.isfinite(message.x):
            return None, None
        taut = bool(message.taut)
        far = message.distance > _MAX_CABLE_RATIO * self.cable
        attached = taut or (self._known_tether.attached and not far)
        return {
            "position": _translated((message.x, message.y, message.z), offset),
            "attached": attached,
        }, taut

    @property
    def cable(self) -> float:
        """Length of the cable when it was last taut (a winch may change it); at first, that of `layout`."""
        return self._known_tether.length_m or self.layout()["cable"]

    @property
    def _known_tether(self) -> Tether:
        """The true one if the truth is known, else the estimated one."""
        true = self.truth.message(mavlink.MAVLINK_MSG_ID_LOAD_STATE)
        return self._tether if true is None else self.truth.tether

    def _pose(self) -> tuple[Sequence[float] | None, Sequence[float] | None]:
        true = self.truth.pose(self.home)
        load = self.truth.message(mavlink.MAVLINK_MSG_ID_LOAD_STATE)
        if true is not None:
            position = true[0]
            if load is not None and load.taut and math.isfinite(load.qx):
                # the cable is straight: its upper end is known to the millimetre
                ends = zip((load.x, load.y, load.z), (load.qx, load.qy, load.qz), strict=True)
                north, east, down = (at - load.distance * along for at, along in ends)
                position = north, east, down
            return position, true[1]
        place = self.view.latest.get("LOCAL_POSITION_NED")
        attitude = self.view.latest.get("ATTITUDE_QUATERNION")
        return (
            None if place is None else (place.x, place.y, place.z),
            None if attitude is None else (attitude.q1, attitude.q2, attitude.q3, attitude.q4),
        )

    def _velocity(self) -> float | None:
        message = self._load_message()
        return None if message is None else _rounded(math.hypot(message.vx, message.vy, message.vz), 3)

    def _desired(self, offset: PositionNED) -> list[float] | None:
        message = self.view.latest.get("LOAD_SETPOINT")
        if message is None or message.phase in _NOT_CARRIED:
            return None
        return _translated((message.x, message.y, message.z), offset)

    def _tension(self) -> float | None:
        message = self._load_message()
        return None if message is None else _rounded(message.tension, 3)

    def _swing(self) -> float | None:
        """Angle between cable and vertical in deg; None if the cable is not taut."""
        message = self._load_message()
        if message is None or not message.taut or not math.isfinite(message.qz):
            return None
        return _rounded(math.degrees(math.acos(max(-1.0, min(1.0, message.qz)))), 2)

    def _rotors(self) -> tuple[list[float] | None, float | None]:
        """Force of each rotor as a share of the maximum force, and that force; without limits, as a share of
        the thrust, and None."""
        message = self.view.latest.get("ROTOR_STATE")
        if message is None:
            return None, None
        limited = math.isfinite(message.force_max) and message.force_max > 0.0
        forces = [force if math.isfinite(force) else 0.0 for force in rotor_forces(message)]
        full = message.force_max if limited else max(sum(forces), 1e-6)
        shares = [round(force / full, 3) for force in forces]
        return shares, (_rounded(message.force_max, 3) if limited else None)

    def _estimator_error(self) -> float | None:
        """Distance between an estimated position of the load and the true one at the same time."""
        for time_us, estimated in reversed(self._estimated_positions):  # the newest may be ahead of the truth
            true = self.truth.load_at(time_us)
            if true is not None:
                return _rounded(math.dist(true, estimated))
        return None

    def _wind(self) -> Sequence[float] | None:
        true = self.truth.wind
        if true is not None:
            return true
        estimated = self.view.latest.get("WIND_COV")
        return (
            None
            if estimated is None or not self.view.armed
            else (estimated.wind_x, estimated.wind_y, estimated.wind_z)
        )


def _translated(place: Sequence[float] | None, offset: PositionNED) -> list[float] | None:
    return None if place is None else _rounded_values([a + b for a, b in zip(place, offset, strict=True)])


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return round(value, digits) if value is not None and math.isfinite(value) else None


def _rounded_values(values: Sequence[float] | None, digits: int = 4) -> list[float] | None:
    if values is None or not all(map(math.isfinite, values)):
        return None
    return [round(float(value), digits) for value in values]
