"""Punctuality from recorded times: no clock is read."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.wire.dialect import plumbline as mavlink
from sitl.pacing import Pacing, percentile
from sitl.shell import loops

SECOND = 1_000_000_000


@pytest.mark.parametrize(
    ("values", "share", "expected"),
    [([], 0.5, 0), ([7], 0.0, 7), ([7], 1.0, 7), (list(range(1, 101)), 0.99, 99), ([1, 2, 3], 0.5, 2)],
)
def test_percentile(values: list[int], share: float, expected: int) -> None:
    assert percentile(Counter(values), share) == expected


def test_figures_of_the_last_second() -> None:
    pacing = Pacing(speed=2.0)
    assert pacing.figures == (2.0, 0.0, 0, 0, 0)
    for tick in range(500):
        due = tick * SECOND // 250
        pacing.record(due, due + 5000 + (90_000 if tick == 100 else 0))
    assert pacing.figures.rate_hz == pytest.approx(250.0, rel=0.01)  # a window ends up to one tick late
    assert (pacing.figures.late_p50_us, pacing.figures.late_p99_us, pacing.figures.late_max_us) == (5, 5, 95)
    for tick in range(500, 800):
        pacing.record(tick * SECOND // 250, tick * SECOND // 250)
    assert pacing.figures.late_max_us == 0


def test_summary() -> None:
    pacing = Pacing(speed=1.0)
    assert pacing.summary(0) == "no ticks"
    for tick in range(101):
        pacing.record(tick * SECOND // 250, tick * SECOND // 250 + 3000)
    assert pacing.summary(4) == ("250.00 ticks/s, late p50 3 p99 3 max 3 us, 4 of 101 commands missed")


def test_ticks_that_begin_a_whole_tick_late_are_stalls_of_the_machine() -> None:
    pacing = Pacing(speed=1.0)
    for tick in range(100):
        late = {10: 3_999_999, 20: 4_000_000, 30: 50_000_000}.get(tick, 0)
        pacing.record(tick * SECOND // 250, tick * SECOND // 250 + late)
    assert pacing.summary(3).endswith(
        "3 of 100 commands missed; the machine stalled 2 times for a tick or longer"
    )


def test_a_tick_before_its_time_is_not_late() -> None:
    pacing = Pacing(speed=1.0)
    pacing.record(1000, 0)
    pacing.record(2000, 1500)
    assert "late p50 0 p99 0 max 0 us" in pacing.summary(0)


def test_waiting_for_somebody_else_is_not_counted() -> None:
    pacing = Pacing(speed=1.0)
    for tick in range(100):
        pacing.record(tick * SECOND // 250, tick * SECOND // 250)
    pacing.pause(20 * SECOND)
    for tick in range(100, 500):
        due = tick * SECOND // 250 + 20 * SECOND
        pacing.record(due, due)
    assert pacing.figures.rate_hz == pytest.approx(250.0, rel=0.01)
    assert pacing.summary(0) == "250.00 ticks/s, late p50 0 p99 0 max 0 us, 0 of 500 commands missed"


class Paced:
    """A simulator that keeps to a clock, on a machine whose time is set here."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
        self.now_ns = 100 * SECOND
        self.stopped_s = 0.0  # time by which the next sleep lasts longer
        self.said: list[str] = []
        self.told: list[tuple[str, int]] = []  # texts to the operators, with their severity
        time = SimpleNamespace(sleep=self._sleep, perf_counter_ns=self._perf_counter_ns)
        monkeypatch.setattr(loops, "time", time)
        parameters = SimpleNamespace(send_text=lambda text, severity: self.told.append((text, severity)))
        simulator: Any = SimpleNamespace(tick_us=4000, pacing=None, parameters=parameters)
        self.pacing = Pacing(speed)
        self._clock = loops.Clock(self.pacing, simulator, self.said.append)

    def _sleep(self, seconds: float) -> None:
        self.now_ns += round((seconds + self.stopped_s) * SECOND)
        self.stopped_s = 0.0

    def _perf_counter_ns(self) -> int:
        self.now_ns += 1000
        return self.now_ns

    def run(self, ticks: int, work_ms: float = 0.0) -> None:
        """Run this number of ticks, each with this amount of work."""
        for _ in range(ticks):
            self.now_ns += round(work_ms * 1e6)
            self._clock.wait()


def test_a_clock_that_was_stopped_is_not_a_busy_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    paced = Paced(monkeypatch, 1.0)
    paced.run(500)
    paced.stopped_s = 30.0
    paced.run(1500)
    assert paced.said == ["stood still for 30.0 s (SIGSTOP, Ctrl-Z, a debugger, or the machine did)"]
    assert paced.told == []
    assert paced.pacing.figures.rate_hz == pytest.approx(250.0, rel=0.01)
    assert "stalled" not in paced.pacing.summary(0)


class Ended(Exception):
    """The simulator was told to stop."""


class SilentPilot:
    """The link to an autopilot that answers at once, except for one silence; time passes only here and in
    sleeps."""

    peer = ("127.0.0.1", 1)

    def __init__(self, monkeypatch: pytest.MonkeyPatch, silent_at: int, silent_s: float, ticks: int) -> None:
        self.now_ns = 100 * SECOND
        self.said: list[str] = []
        self._silent_at, self._silence_ns, self._ticks = silent_at, round(silent_s * SECOND), ticks
        self._until_ns, self._timeout_ns = 0, 0
        time = SimpleNamespace(
            sleep=self._sleep, perf_counter_ns=self._perf_counter_ns, monotonic=lambda: self.now_ns / SECOND
        )
        monkeypatch.setattr(loops, "time", time)
        parameters = SimpleNamespace(send_text=lambda text, severity: self.said.append(text))
        self.simulator: Any = SimpleNamespace(
            tick_us=4000, pacing=None, parameters=parameters, ticks=0, answered=False, now_us=0
        )
        self.simulator.sensor_datagram = lambda: b""
        self.simulator.advance = self._advance

    def _sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * SECOND) + 1000

    def _perf_counter_ns(self) -> int:
        self.now_ns += 1000
        return self.now_ns

    def _advance(self) -> None:
        self.simulator.answered = False
        self.simulator.ticks += 1
        if self.simulator.ticks == self._silent_at:
            self._until_ns = self.now_ns + self._silence_ns

    def check(self) -> None:
        """The request to stop."""
        self.now_ns += 1000
        if self.simulator.ticks == self._ticks:
            raise Ended

    def timeout(self, seconds: float) -> None:
        self._timeout_ns = round(seconds * SECOND)

    def gather_truth(self, simulator: object) -> None:
        """The truth has no receiver."""

    def send(self, datagram: bytes) -> None:
        """It is answered by `receive`."""

    def receive(self) -> tuple[bytes, Any] | None:
        if self.now_ns + self._timeout_ns < self._until_ns:
            self.now_ns += self._timeout_ns
            return None
        self.now_ns = max(self.now_ns, self._until_ns)
        return b"", self.peer

    def process(self, datagram: bytes, sender: object, simulator: object) -> bool:
        self.simulator.answered = True
        return False


@pytest.mark.parametrize("silent_s", [1.4, 60.0])
def test_a_wait_for_the_autopilot_is_told_and_is_no_busy_machine(
    monkeypatch: pytest.MonkeyPatch, silent_s: float
) -> None:
    link: Any = SilentPilot(monkeypatch, 300, silent_s, 1000)
    pacing = Pacing(1.0)
    with pytest.raises(Ended):
        loops.run_lockstep(link, link.simulator, link, link.said.append, pacing)
    told = [text for text in link.said if "autopilot at" not in text]
    assert told == [f"waited {silent_s:.1f} s for the autopilot"]
    assert pacing.figures.rate_hz == pytest.approx(250.0, rel=0.01)


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_a_machine_that_is_too_slow_for_the_clock_is_told(
    monkeypatch: pytest.MonkeyPatch, speed: float
) -> None:
    paced = Paced(monkeypatch, speed)
    paced.run(round(1500 * speed), work_ms=3.0 / speed)
    assert (paced.said, paced.told) == ([], []), "in time"
    began_ns = paced.now_ns
    paced.run(round(1500 * speed), work_ms=8.0 / speed)
    assert paced.now_ns - began_ns == pytest.approx(12 * SECOND, rel=0.01), "slower, and not behind"
    text = f"Machine busy: clock at {0.5 * speed:.2f} x, not {speed:g} x"
    assert paced.told == [(text, mavlink.MAV_SEVERITY_NOTICE)] * 2, "again after ten seconds"
    assert paced.said == [text.lower()] * 2
