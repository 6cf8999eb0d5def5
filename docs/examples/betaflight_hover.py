"""Flies Betaflight's simulator target with a load, as a pilot with a remote control would: arms, lifts the
load, hovers in ANGLE mode, rolls at a constant rate (ACRO), sets the load down and lands beside it.

`sitl` and the firmware must already be running; docs/autopilots.md says how to start them. `--setup`
configures the switches of the firmware, once; the firmware then ends and must be started again. The pilot
sees the truth that `sitl` sends, and answers each of its messages with stick positions.
"""

from __future__ import annotations

import argparse
import socket
import struct
import sys
import time
from collections.abc import Generator
from math import acos, atan, copysign, cos, degrees, dist, hypot, sin, sqrt
from typing import NamedTuple

from autopilot.wire.codec import decode
from autopilot.wire.convert.flight import LoadState, read_load_state
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.convert.rotor_forces import rotor_forces
from autopilot.wire.convert.simulator import HilStateQuaternion, read_hil_state_quaternion
from autopilot.wire.convert.telemetry import euler_ned_frd
from sitl.shell.autopilots import parameter_file

ARM, ANGLE = 4, 5  # channels of the switches, as sitl/interfaces/betaflight.parm has them
ANGLE_LIMIT_DEG = 60.0  # that a full stick commands in ANGLE mode: the firmware's angle_limit
CENTRE_RATE, FULL_RATE = 70.0, 670.0  # degrees/s, of its rates (ACTUAL); both modes use their curve
ACCEL_MOST = 2.5  # m/s^2, that the pilot commands
SPEED_MOST = 0.5  # m/s, up and down
ROLL_RATE, ROLL_S = 100.0, 0.5  # degrees/s; s, of the roll from one side to the other
ARMING_S, LOST_S = 20.0, 5.0  # time limits: for arming the firmware, and without any truth

Place = tuple[float, float, float]  # m: east, north, up


class Seen(NamedTuple):
    """What the pilot sees."""

    vehicle: HilStateQuaternion
    load: LoadState
    turning: bool  # whether any rotor turns

    @property
    def time_s(self) -> float:
        return self.vehicle.time_us * 1e-6

    @property
    def up(self) -> float:
        return self.vehicle.position[2]


class Sticks(NamedTuple):
    """The pilot's inputs: roll right and pitch forward -1 ... 1, throttle 0 ... 1, two switches."""

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    armed: bool = True
    angle: bool = True

    def packet(self, time_s: float) -> bytes:
        """The firmware's rc_packet: a time and 16 channels in us, of which AETR come first."""
        channels = [1500] * 16
        channels[:2] = round(1500 + 500 * self.roll), round(1500 + 500 * self.pitch)
        channels[2] = round(1000 + 1000 * self.throttle)
        channels[ARM], channels[ANGLE] = 1000 + 1000 * self.armed, 1000 + 1000 * self.angle
        return struct.pack("<d16H", time_s, *channels)


Part = Generator[Sticks, Seen, Seen]  # of a flight: receives what is seen, yields sticks


class Pilot:
    """One flight; `told` lists what was observed in it."""

    def __init__(self, hover_s: float = 30.0) -> None:
        self._hover_s = hover_s
        self._throttle = 0.5  # estimate of the throttle that holds the height
        self._before_s = 0.0
        self.told: list[str] = []

    def fly(self) -> Part:
        """The whole flight. RuntimeError if the firmware does not arm."""
        seen = yield Sticks(armed=False)
        ground, (east, north, _) = seen.up, seen.load.x_load
        seen = yield from self._arm(seen)
        seen = yield from self._go((east, north, ground + 0.6), seen, 8.0)
        while not seen.load.taut or seen.load.x_load[2] < ground + 0.5:
            seen = yield self._held((east, north, seen.up + 0.3), seen)
        place = (east, north, seen.load.distance + 1.0)
        seen = yield from self._go(place, seen, 15.0)
        seen = yield from self._hover(place, seen)
        seen = yield from self._roll(seen)
        seen = yield from self._go(place, seen, 15.0)
        while seen.load.taut:
            seen = yield self._held((east, north, seen.up - 0.3), seen)
        self.told.append("set the load down")
        aside = (east - 0.7 * seen.load.distance, north)
        seen = yield from self._go((*aside, ground + 0.5), seen, 8.0)
        while seen.up > ground + 0.02:
            seen = yield self._held((*aside, seen.up - 0.3), seen)
        while seen.turning:
            seen = yield Sticks(armed=False)
        self.told.append("landed and disarmed")
        return seen

    def _arm(self, seen: Seen) -> Part:
        """The firmware refuses for its first five seconds, and reacts only when the switch is turned on, so
        it is turned on again and again."""
        begun_s = seen.time_s
        while not seen.turning:
            passed_s = seen.time_s - begun_s
            if passed_s > ARMING_S:
                raise RuntimeError("the firmware does not arm: was it given its switches (--setup)?")
            seen = yield Sticks(armed=int(passed_s) % 2 == 1)
        self._before_s = seen.time_s
        self.told.append(f"armed after {seen.time_s - begun_s:.1f} s")
        return seen

    def _go(self, place: Place, seen: Seen, most_s: float) -> Part:
        """Fly to a place until the vehicle is there and slow, for `most_s` seconds at most."""
        begun_s = seen.time_s
        while seen.time_s - begun_s < most_s:
            if dist(seen.vehicle.position, place) < 0.05 and hypot(*seen.vehicle.velocity) < 0.05:
                break
            seen = yield self._held(place, seen)
        return seen

    def _hover(self, place: Place, seen: Seen) -> Part:
        begun_s = seen.time_s
        errors, tilts, pulls = [], [], []
        while seen.time_s - begun_s < self._hover_s:
            seen = yield self._held(place, seen)
            errors.append(dist(seen.vehicle.position, place))
            tilts.append(degrees(acos(max(min(-seen.load.q_cable[2], 1.0), -1.0))))
            pulls.append(seen.load.tension)
        self.told.append(
            f"hovered {self._hover_s:g} s in ANGLE mode: vehicle within {1e3 * max(errors):.0f} mm, "
            f"cable swing {max(tilts):.1f} degrees at most, tension {min(pulls):.2f} to {max(pulls):.2f} N"
        )
        return seen

    def _roll(self, seen: Seen) -> Part:
        """Roll to the right, to the left, and back, and note the rate from right to left."""
        begun_s, rates = seen.time_s, []
        while (passed_s := seen.time_s - begun_s) < 2.0 * ROLL_S:
            left = 0.5 * ROLL_S <= passed_s < 1.5 * ROLL_S
            stick = stick_for(ROLL_RATE / FULL_RATE)
            seen = yield Sticks(-stick if left else stick, 0.0, self._throttle, angle=False)
            if 0.9 * ROLL_S <= passed_s < 1.5 * ROLL_S:
                rates.append(degrees(seen.vehicle.omega_body[0]))
        self.told.append(
            f"rolled left in ACRO: asked {ROLL_RATE:.0f} degrees/s, was {-sum(rates) / len(rates):.0f} "
            f"({-max(rates):.0f} to {-min(rates):.0f})"
        )
        return seen

    def _held(self, place: Place, seen: Seen) -> Sticks:
        """Sticks that fly to a place and damp the swing: a tilt, and the throttle for the height."""
        (x, y, z), (vx, vy, vz) = seen.vehicle.position, seen.vehicle.velocity
        passed_s, self._before_s = min(seen.time_s - self._before_s, 0.1), seen.time_s
        late = _within(place[2] - z, SPEED_MOST) - vz
        self._throttle = min(max(self._throttle + 0.15 * late * passed_s, 0.2), 0.9)
        calm = 0.5 if seen.load.taut else 0.0
        swing_x, swing_y = seen.load.v_load[0] - vx, seen.load.v_load[1] - vy
        east = _within(0.4 * (place[0] - x) - 1.0 * vx + calm * swing_x, ACCEL_MOST)
        north = _within(0.4 * (place[1] - y) - 1.0 * vy + calm * swing_y, ACCEL_MOST)
        heading = euler_ned_frd(seen.vehicle.quat_wxyz)[2]
        forward = north * cos(heading) + east * sin(heading)
        right = east * cos(heading) - north * sin(heading)
        roll, pitch = (stick_for(degrees(atan(a / 9.81)) / ANGLE_LIMIT_DEG) for a in (right, forward))
        return Sticks(roll, pitch, min(max(self._throttle + 0.15 * late, 0.0), 1.0))


def stick_for(share: float) -> float:
    """The stick position that commands a share of the greatest rate or angle."""
    square = FULL_RATE - CENTRE_RATE
    stick = (sqrt(CENTRE_RATE**2 + 4.0 * square * FULL_RATE * abs(share)) - CENTRE_RATE) / (2.0 * square)
    return copysign(stick, share)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


def seen_in(datagram: bytes, home: Home, before: Seen | None) -> Seen | None:
    """What a datagram of the truth shows; None if it lacks the vehicle or the load."""
    vehicle = load = None
    turning = before is not None and before.turning
    for one in decode(datagram)[0]:
        match one.message.get_type():
            case "HIL_STATE_QUATERNION":
                vehicle = read_hil_state_quaternion(one.message, home)
            case "LOAD_STATE":
                load = read_load_state(one.message)
            case "ROTOR_STATE":
                turning = any(force > 0.02 for force in rotor_forces(one.message))
    return Seen(vehicle, load, turning) if vehicle and load else None


def set_up(cli: tuple[str, int]) -> None:
    """Configure the firmware's switches by its command line, and save, which ends the firmware."""
    lines = parameter_file("betaflight").read_text(encoding="utf-8").splitlines()
    with _connected(cli) as line:
        for text in ("#", *(f"{text}\n" for text in lines if not text.startswith("#")), "save\n"):
            line.sendall(text.encode())
            answer = b""
            while not answer.endswith(b"# ") and (piece := line.recv(4096)):
                answer += piece
            print(answer.decode(errors="replace").strip("# \r\n"))


def _connected(cli: tuple[str, int]) -> socket.socket:
    """A connection to the firmware, which may have been started a moment ago."""
    begun_s = time.monotonic()
    while True:
        try:
            return socket.create_connection(cli, timeout=LOST_S)
        except ConnectionRefusedError:
            if time.monotonic() - begun_s > LOST_S:
                sys.exit(f"nobody listens on TCP {cli[0]}:{cli[1]}: does the firmware run?")
            time.sleep(0.1)


def fly(truth: tuple[str, int], firmware: tuple[str, int], hover_s: float) -> int:
    pilot = Pilot(hover_s)
    flight, seen, told = pilot.fly(), None, 0
    next(flight)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(truth)
        link.settimeout(LOST_S)
        try:
            while True:
                seen = seen_in(link.recv(65_535), Home(), seen) or seen
                if seen:
                    link.sendto(flight.send(seen).packet(seen.time_s), firmware)
                for text in pilot.told[told:]:
                    print(text, flush=True)
                told = len(pilot.told)
        except StopIteration:
            print(pilot.told[-1])
        except TimeoutError:
            sys.exit(f"no truth for {LOST_S:g} s: does sitl run, and does it serve the firmware?")
        except RuntimeError as error:
            sys.exit(str(error))
    return 0


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--setup", action="store_true", help="give the firmware its switches, once")
    asked.add_argument("--hover", type=float, default=30.0, metavar="S", help="seconds of hover (30)")
    options = asked.parse_args()
    if options.setup:
        set_up(("127.0.0.1", 5761))
    else:
        fly(("127.0.0.1", 14560), ("127.0.0.1", 9004), options.hover)
