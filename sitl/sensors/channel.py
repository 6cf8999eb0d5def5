"""When a sensor measures, when its readings leave, and which of them are lost. Integer microseconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import log
from typing import Any, Generic, NamedTuple, TypeVar

from sitl.plant.records import PlantState
from sitl.sensors.noise import Noise, uniform
from sitl.sensors.profile import Delivery

ReadingT = TypeVar("ReadingT")

# noise blocks of loss and of outage; the sensors use the blocks below
_FATE = 15
_OUTAGE = 14
_SECOND_US = 1_000_000


class Measurement(NamedTuple, Generic[ReadingT]):
    """A reading and the instant it shows."""

    time_us: int
    reading: ReadingT


class Timing(NamedTuple):
    """Instants of measurement n: n / rate - lead, not before 0. `rate_hz` = 0: one per tick.

    A reading leaves `latency_us` after its nominal instant. With lead = latency it leaves at a tick exactly.
    """

    rate_hz: float
    tick_us: int
    latency_us: int
    lead_us: int

    def nominal_us(self, n: int) -> int:
        """The instant before it is cut at 0."""
        if self.rate_hz > 0.0:
            return round(n * _SECOND_US / self.rate_hz) - self.lead_us
        return n * self.tick_us - self.lead_us


class Fate(NamedTuple):
    """By what chance a reading does not come: singly, or in outages of exponentially distributed length."""

    loss: float
    outages_per_s: float
    outage_s: float

    @classmethod
    def of(cls, delivery: Delivery) -> Fate:
        """The fate of a sensor's readings by its own fault."""
        return cls(delivery.loss, delivery.outages_per_min / 60.0, delivery.outage_s)


class Channel(Generic[ReadingT]):
    """One sensor: its kernel, its state, its noise stream and the readings that are on their way.

    Every sample is taken and moves the sensor's state, even if its reading is then lost: so losses change
    neither the noise nor the drift of the readings that come through.
    """

    def __init__(
        self,
        sample: Callable[..., tuple[ReadingT, Any]],
        start: Callable[..., Any],
        config: Any,
        timing: Timing,
        fate: Fate,
        noise: Noise,
        extra_loss: float = 0.0,
    ) -> None:
        self._sample = sample
        self._config = config
        self._timing = timing
        self._fate = fate
        self.retune(noise, extra_loss)
        self._state = start(config, noise)
        self._nominal_us = timing.nominal_us(0)
        period_us = timing.nominal_us(1) - self._nominal_us
        self._outage_chance = fate.outages_per_s * period_us / _SECOND_US
        self._outage_end_us = 0
        self._count = 0
        self._on_the_way: deque[tuple[int, Measurement[ReadingT]]] = deque()
        self.due_us = max(self._nominal_us, 0)  # instant of the next measurement

    def retune(self, noise: Noise, extra_loss: float) -> None:
        """From the next measurement on: this noise, and a loss on the way added to the sensor's own."""
        self._noise = noise
        self._loss = min(self._fate.loss + extra_loss, 1.0)

    def measure(self, truth_state: PlantState) -> None:
        """Take the measurement that is due, of the state at `due_us`."""
        key = self._noise
        noise = Noise(key.seed, key.stream, self._count, key.scale)
        reading, self._state = self._sample(truth_state, self._state, self._config, noise)
        if self._delivers(noise):
            leaves_us = self._nominal_us + self._timing.latency_us
            self._on_the_way.append((leaves_us, Measurement(self.due_us, reading)))
        self._count += 1
        self._nominal_us = self._timing.nominal_us(self._count)
        self.due_us = max(self._nominal_us, 0)

    def collect(self, now_us: int) -> tuple[Measurement[ReadingT], ...]:
        """The readings that have left by now, oldest first; each is given once."""
        queue = self._on_the_way
        if not queue or queue[0][0] > now_us:
            return ()
        left = [queue.popleft()[1]]
        while queue and queue[0][0] <= now_us:
            left.append(queue.popleft()[1])
        return tuple(left)

    def _delivers(self, noise: Noise) -> bool:
        """Draw the fate of this reading."""
        if self._loss == 0.0 and self._outage_chance == 0.0:
            return True
        lost, begins = uniform(noise, _FATE)
        if self.due_us >= self._outage_end_us and begins <= self._outage_chance:
            length_s = -log(uniform(noise, _OUTAGE)[0]) * self._fate.outage_s
            self._outage_end_us = self.due_us + max(round(length_s * _SECOND_US), 1)
        return self.due_us >= self._outage_end_us and lost > self._loss
