"""A stand-in for Betaflight's simulator target: reads its packets and mixes its motors as in its sources,
with simple laws in place of its own."""

from __future__ import annotations

import struct
from math import asin, atan2, degrees

# motors 1 to 4 (rear right, front right, rear left, front left) under demands of roll, pitch and yaw
MIX = ((-1, 1, -1), (-1, -1, 1), (1, 1, 1), (1, -1, -1))
SENT = (1, 2, 3, 0)  # the motor of each number of the packet
FULL_ANGLE_DEG, FULL_RATE_DEG_S = 60.0, 670.0
CENTRE_RATE_DEG_S = 70.0
PER_DEGREE_S = 8e-4  # of throttle, per deg/s of rate error
PER_DEGREE = 5.0  # deg/s, per degree of angle error
IDLE = 0.055


def rates_of(stick: float) -> float:
    """The rate, in deg/s, that a stick commands in ACRO, with the default rates of the firmware."""
    return stick * CENTRE_RATE_DEG_S + stick * abs(stick) * (FULL_RATE_DEG_S - CENTRE_RATE_DEG_S)


def flies(state: bytes, channels: bytes) -> bytes:
    """The servo_packet in answer to these fdm_packet and rc_packet."""
    numbers = struct.unpack("<18d", state)
    (p, q, r), (w, x, y, z) = numbers[1:4], numbers[7:11]
    roll, pitch, throttle, _, arm, angle = (us / 500.0 - 3.0 for us in struct.unpack("<d16H", channels)[1:7])
    if arm < 0.4:
        return struct.pack("<4f", *(0.0,) * 4)
    rates = (degrees(p), -degrees(q), -degrees(r))  # of its gyroscope: roll right, pitch forward, yaw left
    if angle > 0.4:
        leans = (
            degrees(atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))),
            -degrees(asin(2.0 * (w * y - z * x))),
        )
        asked = [
            PER_DEGREE * (FULL_ANGLE_DEG * rates_of(stick) / FULL_RATE_DEG_S - lean)
            for stick, lean in zip((roll, pitch), leans, strict=True)
        ]
    else:
        asked = [rates_of(roll), rates_of(pitch)]
    demands = [PER_DEGREE_S * (wanted - rate) for wanted, rate in zip((*asked, 0.0), rates, strict=True)]
    lift = 0.5 * (throttle + 1.0)
    motors = [lift + sum(s * d for s, d in zip(row, demands, strict=True)) for row in MIX]
    held = [min(max(motor, IDLE), 1.0) for motor in motors]
    return struct.pack("<4f", *(held[i] for i in SENT))
