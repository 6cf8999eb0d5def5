"""ArduPilot's JSON interface (`--model JSON`): servo packets in, lines of JSON out, no socket and no clock.

The firmware sends a packet of PWM for each of its frames and waits for one line. If none arrives, it repeats
the packet, with the same count, every 1.1 s. An additional line would leave it one frame behind for ever, so
a repeated packet is answered only long after the answer to the first.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from autopilot.geometry.frames import frd_from_flu, ned_from_enu, quat_ned_frd_from_enu_flu
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from sitl.hil import HilSimulator

MOTORS = 4
PWM_OFF, PWM_FULL = 1000, 2000  # us, MOT_PWM_MIN and MOT_PWM_MAX
RATE_HZ = 800  # frame rate: with a lower one the firmware's scheduler, at 400 Hz, refuses to arm
_PACKET_KINDS = ((18458, Struct("<HHI16H")), (29569, Struct("<HHI32H")))
_PACKETS = {layout.size: (magic, layout) for magic, layout in _PACKET_KINDS}
_LOST_S = 0.5  # time after an answer from which a repeated packet means that the answer was lost
# The firmware truncates the difference of two times to whole microseconds. With this factor the rounding of
# their binary numbers, which is smaller for the first hours, never loses one; the factor adds 1 us in 100 s.
_STRETCH = 1.0 + 1e-8
_LINE = (
    '\n{"timestamp":%.17g,"imu":{"gyro":[%.9g,%.9g,%.9g],"accel_body":[%.9g,%.9g,%.9g]},'
    '"position":[%.12g,%.12g,%.12g],"quaternion":[%.9g,%.9g,%.9g,%.9g],"velocity":[%.9g,%.9g,%.9g],'
    '"no_time_sync":1}\n'
)


class ServoPacket(NamedTuple):
    """The firmware's commands to its motors in one frame."""

    rate_hz: int
    number: int  # of the frame
    pwm: tuple[int, ...]  # us; 0: no output


class Reply(NamedTuple):
    """The effect of a datagram."""

    answer: bytes = b""  # to be sent; empty: nothing
    advanced: bool = False  # the world was advanced by a tick
    notice: str = ""  # for the terminal


def read_servo_packet(datagram: bytes) -> ServoPacket | None:
    """The packet in a datagram; None if its size or its first number is another."""
    known = _PACKETS.get(len(datagram))
    if known is None:
        return None
    magic, layout = known
    found, rate_hz, number, *pwm = layout.unpack(datagram)
    return ServoPacket(rate_hz, number, tuple(pwm)) if found == magic else None


def throttles(pwm: tuple[int, ...]) -> tuple[float, ...]:
    """Throttles of the motors, 0 ... 1, from their pulses."""
    return tuple(min(max((us - PWM_OFF) / (PWM_FULL - PWM_OFF), 0.0), 1.0) for us in pwm[:MOTORS])


def line(
    now_us: int, gyro_body: Vec3, accel_body: Vec3, position: Vec3, velocity: Vec3, quat_wxyz: Quat
) -> bytes:
    """The answer to a frame: rates (rad/s) and specific force (m/s^2) in FLU, position (m) and velocity
    in ENU, attitude FLU to ENU. Without spaces, as the firmware's reader requires."""
    return (
        _LINE
        % (
            now_us * 1e-6 * _STRETCH,
            *frd_from_flu(gyro_body),
            *frd_from_flu(accel_body),
            *ned_from_enu(position),
            *quat_ned_frd_from_enu_flu(quat_wxyz),
            *ned_from_enu(velocity),
        )
    ).encode("ascii")


class Exchange:
    """The exchange with one firmware after another in one world: each new frame is a tick."""

    def __init__(self, simulator: HilSimulator) -> None:
        """ValueError if the firmware cannot fly the vehicle."""
        self._simulator = simulator
        self._frame = simulator.frame
        self._frame_number = -1  # number of the newest frame
        self._answer = b""  # to the newest frame
        self._answered_s = 0.0

    def receive(self, packet: ServoPacket, now_s: float) -> Reply:
        """Process a packet that arrived at `now_s` of any steady clock.

        A smaller number than before means that the firmware was restarted: the world restarts too.
        """
        if packet.number == self._frame_number:
            if now_s - self._answered_s < _LOST_S:
                return Reply()
            self._answered_s = now_s
            return Reply(self._answer)
        notice = ""
        if packet.number < self._frame_number:
            at_s = self._simulator.now_us / 1e6
            notice = f"the firmware restarted at t = {at_s:.3f} s, and the world restarts"
            self._simulator.restart()
        elif self._frame_number < 0 < packet.number:
            notice = f"the firmware has already flown for {packet.number} frames; the world restarts"
        self._frame_number, self._answered_s = packet.number, now_s
        self._answer = self._tick(packet.pwm)
        return Reply(self._answer, True, notice)

    def _tick(self, pwm: tuple[int, ...]) -> bytes:
        simulator, frame = self._simulator, self._frame
        motors = throttles(pwm)
        simulator.apply_command(frame.forces(motors), any(motors))
        simulator.advance()
        imu, state = simulator.imu_reading, simulator.core.state
        return line(
            simulator.now_us,
            frame.to_controller_axes(imu.gyro_body),
            frame.to_controller_axes(imu.accel_body),
            state.x_quad,
            state.v_quad,
            frame.attitude(state.quat_wxyz),
        )
