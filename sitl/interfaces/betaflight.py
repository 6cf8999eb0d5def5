"""Betaflight's simulator interface (target SITL): motors in, the vehicle's state out, no socket and no clock.

The firmware runs on the wall clock and does not wait: it answers each state that it receives with the motors
of its next loop, on UDP 9002; it receives states on 9003 and the channels of a remote control on 9004.
"""

from __future__ import annotations

from struct import Struct

from autopilot.geometry.frames import frd_from_flu, quat_ned_frd_from_enu_flu
from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import Quat
from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from sitl.hil import HilSimulator
from sitl.messages import pressure_pa

RATE_HZ = 1000
_MOTORS = Struct("<4f")  # servo_packet: in the order of `sitl.interfaces.frame`, not in the firmware's own
_STATE = Struct("<18d")  # fdm_packet; firmwares before 4.4 leave the last number, the pressure, unread
# The firmware runs its clock at the rate at which this time passes from packet to packet, so that any
# unevenness of their arrival makes it run fast and slow. With a constant time it keeps the wall clock.
_TIME_S = 0.0


def read_motors(datagram: bytes) -> tuple[float, ...] | None:
    """Throttles of motors 1 to 4 in a datagram, 0 ... 1 if they are valid; None for another size."""
    return _MOTORS.unpack(datagram) if len(datagram) == _MOTORS.size else None


def state_packet(
    gyro_body: Vec3, accel_body: Vec3, quat_wxyz: Quat, velocity: Vec3, position: Vec3, home: Home
) -> bytes:
    """The packet for the firmware, from rates (rad/s) and specific force (m/s^2) in FLU, attitude FLU to ENU,
    velocity (m/s) and position (m) in ENU.

    On the wire rates are FRD, the force has the other sign, the attitude is FRD to NED, the position a
    longitude, latitude and altitude, and the pressure that of the standard atmosphere.
    """
    ax, ay, az = accel_body
    latitude, longitude, altitude_mm = geodetic_from_enu(position, home)
    return _STATE.pack(
        _TIME_S,
        *frd_from_flu(gyro_body),
        *(-ax, -ay, -az),
        *quat_ned_frd_from_enu_flu(quat_wxyz),
        *velocity,
        *(longitude * 1e-7, latitude * 1e-7, altitude_mm * 1e-3),
        pressure_pa(altitude_mm * 1e-3),
    )


class Exchange:
    """The exchange with one firmware after another in one world."""

    def __init__(self, simulator: HilSimulator) -> None:
        """ValueError if the firmware cannot fly the vehicle."""
        self._simulator = simulator
        self._frame = simulator.frame

    def state(self) -> bytes:
        """The packet that is sent at this tick."""
        simulator, frame = self._simulator, self._frame
        imu, state = simulator.imu_reading, simulator.core.state
        return state_packet(
            frame.to_controller_axes(imu.gyro_body),
            frame.to_controller_axes(imu.accel_body),
            frame.attitude(state.quat_wxyz),
            state.v_quad,
            state.x_quad,
            simulator.home,
        )

    def receive(self, motors: tuple[float, ...]) -> None:
        """Take throttles as the answer to the present tick; the firmware is armed while any motor turns."""
        self._simulator.apply_command(self._frame.forces(motors), any(motors))
