"""A ground link that loses datagrams, chosen by their number and thus the same ones in every run."""

from __future__ import annotations

_MASK = 2**64 - 1
LOSS_PARAMETER = "SIM_LOSS_PCT"
_NAME = LOSS_PARAMETER.encode()
_TIMESYNC_ID = b"\x6f\x00\x00"  # message id 111 in a MAVLink 2 header


def _uniform(key: int) -> float:
    """A number in 0 ... 1 from a key, by the finaliser of splitmix64."""
    z = (key + 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return (z ^ (z >> 31)) / 2**64


class PacketLoss:
    """Decides for each datagram whether it is lost. TIMESYNC, which keeps the ground in step with the clock,
    is never lost, nor are messages that set or report the loss itself, so that any loss can be undone."""

    def __init__(self, direction: int) -> None:
        self._direction = direction
        self._count = 0

    def drops(self, datagram: bytes, percent: float) -> bool:
        """Whether this datagram is lost, at a loss of `percent`."""
        if percent <= 0.0 or datagram[7:10] == _TIMESYNC_ID or _NAME in datagram:
            return False
        self._count += 1
        return 100.0 * _uniform(2 * self._count + self._direction) < percent
