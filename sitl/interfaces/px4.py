"""PX4's simulator interface: MAVLink over TCP, on which the simulator is the server; no socket and no clock.

At each tick the firmware receives HIL_STATE_QUATERNION (the truth, which it logs), HIL_GPS when there is a
fix, and HIL_SENSOR, whose time sets its clock. It answers with HIL_ACTUATOR_CONTROLS once everything that is
scheduled by its clock is done. Until its first answer the world runs on; from then on it waits for each
answer.
"""

from __future__ import annotations

from collections.abc import Iterator

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.simulator import ACCEL, GYRO, MAG, SIMULATOR_COMPONENT
from autopilot.wire.dialect import plumbline as mavlink
from sitl.hil import HilSimulator
from sitl.interfaces.frame import Frame
from sitl.messages import VEHICLE_SYSTEM

RATE_HZ = 250
MOTORS = 4
_HEAD, _TAIL = 10, 2  # bytes of a MAVLink 2 frame around its payload
_FRAME_START = 0xFD
_TRUTH_US = 20_000
_MAX_BUFFERED = 65_536  # most bytes that are kept of a stream without a whole frame
_SENSOR, _GPS, _STATE = (
    mavlink.MAVLINK_MSG_ID_HIL_SENSOR,
    mavlink.MAVLINK_MSG_ID_HIL_GPS,
    mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
)
_CONTROLS = mavlink.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS


def frames(datagram: bytes) -> Iterator[tuple[int, bytes]]:
    """(message id, frame) of each of our own frames in a datagram."""
    at = 0
    while at + _HEAD <= len(datagram) and datagram[at] == _FRAME_START:
        end = at + _HEAD + datagram[at + 1] + _TAIL
        yield int.from_bytes(datagram[at + 7 : at + 10], "little"), datagram[at:end]
        at = end


class Stream:
    """Extracts the frames of a stream of bytes that may be cut anywhere."""

    def __init__(self) -> None:
        self._unparsed = b""

    def feed(self, chunk: bytes) -> list[bytes]:
        """The frames that are complete now; bytes that belong to no frame are skipped."""
        data = (self._unparsed + chunk)[-_MAX_BUFFERED:]
        found = []
        while True:
            begin = data.find(_FRAME_START)
            data = data[begin:] if begin >= 0 else b""
            size = _HEAD + data[1] + _TAIL if len(data) > 1 else _HEAD
            if len(data) < size:
                break
            frame = data[:size]
            if decode(frame)[0]:
                found.append(frame)
                data = data[size:]
            else:
                data = data[1:]
        self._unparsed = data
        return found


class Exchange:
    """The exchange with one firmware in one world."""

    def __init__(self, simulator: HilSimulator) -> None:
        """ValueError if the firmware cannot fly with the vehicle or its sensors."""
        if not simulator.has_navigation_sensors:
            raise ValueError(
                "PX4 flies by GNSS, barometer and magnetometer; take a sensor profile that has them: "
                "--sensors rtk or gps"
            )
        self._simulator = simulator
        self._frame: Frame = simulator.frame
        self._writer = FrameWriter(VEHICLE_SYSTEM, SIMULATOR_COMPONENT)
        self._stream = Stream()
        self.in_lockstep = False  # whether the firmware has answered once

    def sensors(self) -> bytes:
        """The frames that are sent at this tick."""
        simulator = self._simulator
        sensors = [pair for pair in frames(simulator.sensor_datagram()) if pair[0] in (_SENSOR, _GPS)]
        sent = [frame for kind, frame in sensors if kind == _GPS]
        truth = simulator.truth_datagram()
        if truth is not None and simulator.now_us % _TRUTH_US == 0:
            sent += [frame for kind, frame in frames(truth) if kind == _STATE]
        sent += [self._in_controller_axes(frame) for kind, frame in sensors if kind == _SENSOR]
        return b"".join(sent)

    def receive(self, chunk: bytes) -> bool:
        """Process bytes of the firmware; True if they answer the present tick."""
        for frame in self._stream.feed(chunk):
            message = decode(frame)[0][0].message
            if message.get_msgId() != _CONTROLS:
                continue
            if self.in_lockstep and message.time_usec < self._simulator.now_us:
                continue  # an answer from before it was in step
            self.in_lockstep = True
            self._simulator.apply_command(
                self._frame.forces(tuple(message.controls[:MOTORS])), _armed(message.mode)
            )
            return True
        return False

    def _in_controller_axes(self, frame: bytes) -> bytes:
        """HIL_SENSOR in the axes of the flight controller."""
        if self._frame.mounting_yaw == 0.0:
            return frame
        m = decode(frame)[0][0].message
        for fields, names in ((ACCEL, "acc"), (GYRO, "gyro"), (MAG, "mag")):
            if m.fields_updated & fields:
                x, y, z = (getattr(m, axis + names) for axis in "xyz")
                # FRD here, FLU there
                turned = self._frame.to_controller_axes((x, -y, -z))
                for axis, value in zip("xyz", (turned[0], -turned[1], -turned[2]), strict=True):
                    setattr(m, axis + names, value)
        return self._writer.frame(m)


def _armed(mode: int) -> bool:
    return bool(mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
