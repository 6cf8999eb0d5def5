"""The true state of a simulated vehicle, at the times to which the autopilot's messages apply."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from typing import Any

from autopilot.wire.codec import Received
from autopilot.wire.convert.axes import ned_from_enu
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.release import RELEASE_MARGIN_M
from gcs.view.tether import Tether

PositionNED = tuple[float, float, float]  # NED, m

_MAX_POSITIONS = 80  # positions of the load: half a second of the fastest truth


class Truth:
    """The newest message of each kind, and the recent positions of the load."""

    def __init__(self) -> None:
        self.newest: dict[int, Received] = {}
        self.tether = Tether(RELEASE_MARGIN_M)
        self._times_us: deque[int] = deque(maxlen=_MAX_POSITIONS)
        self._positions: deque[PositionNED] = deque(maxlen=_MAX_POSITIONS)

    def receive(self, one: Received) -> None:
        """Process one message of the simulated world."""
        self.newest[one.id] = one
        if one.id != mavlink.MAVLINK_MSG_ID_LOAD_STATE:
            return
        message = one.message
        if self._times_us and message.time_usec <= self._times_us[-1]:  # the simulator was restarted
            self._times_us.clear()
            self._positions.clear()
            self.tether = Tether(RELEASE_MARGIN_M)
        self.tether.update(message)
        self._times_us.append(message.time_usec)
        self._positions.append((message.x, message.y, message.z))

    def message(self, message_id: int) -> Any:
        """The newest message of that id, or None."""
        received = self.newest.get(message_id)
        return None if received is None else received.message

    def load_at(self, time_us: int) -> PositionNED | None:
        """Position of the load at that time, interpolated between two messages; None if it is not known."""
        if not self._times_us or not self._times_us[0] <= time_us <= self._times_us[-1]:
            return None
        after = bisect_left(self._times_us, time_us)
        if self._times_us[after] == time_us:
            return self._positions[after]
        first, last = self._times_us[after - 1], self._times_us[after]
        share = (time_us - first) / (last - first)
        x, y, z = (
            a + share * (b - a)
            for a, b in zip(self._positions[after - 1], self._positions[after], strict=True)
        )
        return x, y, z

    @property
    def wind(self) -> PositionNED | None:
        """Mean wind plus gust, m/s, NED."""
        message = self.message(mavlink.MAVLINK_MSG_ID_WIND_STATE)
        if message is None:
            return None
        north, east, down = (w + g for w, g in zip(message.wind, message.gust, strict=True))
        return north, east, down

    def pose(self, home: Home) -> tuple[PositionNED, tuple[float, ...]] | None:
        """Position and attitude quaternion (w, x, y, z) of the vehicle; the position is rounded to 11 mm."""
        message = self.message(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION)
        if message is None:
            return None
        position = ned_from_enu(enu_from_geodetic(message.lat, message.lon, message.alt, home))
        return position, tuple(message.attitude_quaternion)
