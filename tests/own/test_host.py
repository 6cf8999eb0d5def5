"""A law is called with the present state, and its answers are checked; its errors are reported."""

from __future__ import annotations

import inspect
import re
import signal
import threading
from collections.abc import Callable
from math import inf, nan
from typing import Any, NamedTuple

import numba
import pytest

from autopilot.control.law_exchange import Asked, Now
from autopilot.geometry.linear import IDENTITY
from autopilot.own.calls import USER_CALL
from autopilot.own.compiled import is_compiled, kernel
from autopilot.own.estimator import estimator_from_class
from autopilot.own.law import law_from_class
from autopilot.own.law_commands import attitude, force, rates, wrench
from autopilot.own.planner import planner_from_class
from autopilot.own.source import OwnError
from autopilot.own.trial import TICKS, try_estimator, try_law, try_planner
from autopilot.shell.watched_calls import watched_calls
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from plumbline.learning.law import PolicyLaw

VALUES = autopilot_parameters(load_vehicle("bebop")).values()
UPWARD = force((0.0, 0.0, 4.9))


def law_that(answers: Callable[[Any, Now], Any]) -> type:
    class Own:
        def load_position(self, memory: Any, now: Now) -> Any:
            return answers(memory, now)

    return Own


def tried(kind: type) -> None:
    try_law(law_from_class(kind, "mine.py:Own"), VALUES)


def test_a_law_remembers_from_its_start_on() -> None:
    seen: list[tuple[Any, bool, float]] = []

    class Counts:
        def __init__(self, parameters: Any) -> None:
            self.first = parameters["CTL_RATE_HZ"]

        def start(self, now: Now) -> float:
            return self.first

        def load_position(self, memory: float, now: Now) -> tuple[float, Asked]:
            seen.append((memory, now.begins, now.time_s))
            return memory + 1.0, UPWARD

    tried(Counts)
    period = 1.0 / VALUES["CTL_RATE_HZ"]
    assert seen == [(VALUES["CTL_RATE_HZ"] + n, n == 0, n * period) for n in range(TICKS)]


WRONG: dict[str, tuple[Callable[[Any, Now], Any], str]] = {
    "raises": (lambda memory, now: 1 / 0, r"ZeroDivisionError: division by zero \(test_host\.py:\d+\)"),
    "nothing": (lambda memory, now: None, r"load_position returned None, which must be \(memory, force"),
    "no pair": (lambda memory, now: UPWARD, r"load_position returned Asked\(kind="),
    "no wrench": (
        lambda memory, now: (memory, (1.0, 2.0)),
        r"asks for \(1\.0, 2\.0\), which must be made by",
    ),
    "thrust": (lambda memory, now: (memory, wrench(nan, (0.0, 0.0, 0.0))), "asks for a thrust of nan N"),
    "moment": (lambda memory, now: (memory, wrench(1.0, (0.0, inf, 0.0))), r"asks for \(0\.0, inf, 0\.0\)"),
    "huge thrust": (
        lambda memory, now: (memory, wrench(1e160, (0.0, 0.0, 0.0))),
        r"asks for a thrust of 1e\+160 N; must be numbers up to 1e9 \(test_host\.py:\d+\)",
    ),
    "huge thrust of an attitude": (
        lambda memory, now: (memory, attitude(IDENTITY, -1e160)),
        r"asks for a thrust of -1e\+160 N; must be numbers up to 1e9",
    ),
    "huge moment": (
        lambda memory, now: (memory, wrench(1.0, (0.0, 1e160, 0.0))),
        r"asks for \(0\.0, 1e\+160, 0\.0\); must be numbers up to 1e9",
    ),
    "huge force": (
        lambda memory, now: (memory, force((1e160, 0.0, 0.0))),
        r"asks for \(1e\+160, 0\.0, 0\.0\); must be numbers up to 1e9",
    ),
    "huge rate": (
        lambda memory, now: (memory, rates(1.0, (0.0, 0.0, -1e160))),
        r"asks for \(0\.0, 0\.0, -1e\+160\); must be numbers up to 1e9",
    ),
    "huge attitude": (
        lambda memory, now: (memory, attitude(((1e160, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 1.0)),
        "commands an attitude that is no rotation",
    ),
    "shape": (
        lambda memory, now: (memory, wrench(1.0, (1.0, 2.0))),
        r"ValueError: the moment has 2 numbers; must be 3 \(test_host\.py:\d+\)",
    ),
    "text": (lambda memory, now: (memory, force("abc")), "the force is 'abc'; must be 3 numbers"),  # type: ignore[arg-type]
    "texts": (
        lambda memory, now: (memory, force((0.0, 0.0, "up"))),  # type: ignore[arg-type]
        r"the force is \(0\.0, 0\.0, 'up'\); must be 3 numbers",
    ),
    "matrix": (
        lambda memory, now: (memory, attitude(((1.0, 0.0, 0.0),), 1.0)),
        "the attitude has 1 rows; must be 3 rows of 3 numbers",
    ),
    "row": (
        lambda memory, now: (memory, attitude(((1.0, 0.0, 0.0), (0.0,), (0.0,)), 1.0)),
        "a row of the attitude has 1 numbers; must be 3",
    ),
    "sheared": (
        lambda memory, now: (memory, attitude(((1.0, 0.0, 0.1), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 1.0)),
        "commands an attitude that is no rotation: its rows must be unit vectors, orthogonal",
    ),
    "mirrored": (
        lambda memory, now: (memory, attitude(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)), 1.0)),
        "commands an attitude that is no rotation",
    ),
    "kind": (lambda memory, now: (memory, UPWARD._replace(kind=7)), "asks for a kind 7 that there is not"),
    "turned": (
        lambda memory, now: (memory, attitude(((nan, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3), 1.0)),
        "commands an attitude that is not a number",
    ),
    "complex": (
        lambda memory, now: (memory, force((0.0, 0.0, 5.0 + 1.0j))),  # type: ignore[arg-type]
        r"the force is \(0\.0, 0\.0, \(5\+1j\)\); must be 3 real numbers",
    ),
    "swapped": (
        lambda memory, now: (memory, rates((0.0, 0.0, 0.0), 5.0)),  # type: ignore[arg-type]
        r"the thrust is \(0\.0, 0\.0, 0\.0\); must be a number",
    ),
    "rate": (lambda memory, now: (memory, rates(1.0, 3.0)), r"the rate is 3\.0; must be 3 numbers"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_a_law_does_wrong_is_told(wrong: str) -> None:
    answers, told = WRONG[wrong]
    with pytest.raises(OwnError, match=rf"^mine\.py:Own: Law Own failed: .*{told}"):
        tried(law_that(answers))


def test_a_method_with_an_argument_too_few_is_named_with_its_place() -> None:
    class Own:
        def load_position(self, now: Now) -> Any:
            raise AssertionError

    told = r"TypeError: .*load_position\(\) takes 2 positional argume.* \(test_host\.py:\d+\)$"
    with pytest.raises(OwnError, match=told):
        tried(Own)


class Unmakable:
    def __init__(self, one: Any, two: Any) -> None:
        raise AssertionError

    load_position = estimate = plan = __init__


class ReadsNothing(PolicyLaw):
    file = "no such.npz"


def test_so_is_one_of_an_estimator_or_a_planner_or_of_what_makes_them() -> None:
    class Own:
        def estimate(self, now: Any) -> Any:
            raise AssertionError

        def plan(self) -> Any:
            raise AssertionError

    here = r"\(test_host\.py:\d+\)$"
    for kind in (Own, Unmakable):
        with pytest.raises(OwnError, match=rf"Estimator \w+ failed: TypeError: .* argument.* {here}"):
            try_estimator(estimator_from_class(kind, "mine.py:Own"), VALUES)
        with pytest.raises(OwnError, match=rf"Planner \w+ failed: TypeError: .* argument.* {here}"):
            try_planner(planner_from_class(kind, "mine.py:Own"), VALUES)
    with pytest.raises(OwnError, match=rf"TypeError: .* argument.* {here}"):
        tried(Unmakable)


def test_what_fails_in_what_it_is_made_of_is_told_with_the_line_of_the_class() -> None:
    line = inspect.getsourcelines(ReadsNothing)[1]
    with pytest.raises(OwnError, match=rf"no such\.npz: No such file.* \(test_host\.py:{line}\)$"):
        tried(ReadsNothing)


def test_a_law_that_cannot_be_made_is_told() -> None:
    class Unmade:
        def __init__(self, parameters: Any) -> None:
            self.gain = parameters["CTL_RATE_HTZ"]

        def load_position(self, memory: Any, now: Now) -> Any:
            return memory, UPWARD

    told = "'CTL_RATE_HTZ: there is no such parameter; did you mean CTL_RATE_HZ?'"
    with pytest.raises(
        OwnError, match=rf"Law Unmade failed: KeyError: {re.escape(told)} \(test_host\.py:\d+\)"
    ):
        tried(Unmade)


def test_who_interrupts_is_not_the_laws_fault() -> None:
    def interrupted(memory: Any, now: Now) -> Any:
        signal.raise_signal(signal.SIGINT)
        return memory, UPWARD

    # a program that a shell has started in the background ignores SIGINT
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            tried(law_that(interrupted))
    finally:
        signal.signal(signal.SIGINT, before)


def test_nor_what_a_handler_of_signals_raises() -> None:
    def interrupted(memory: Any, now: Now) -> Any:
        signal.raise_signal(signal.SIGUSR1)
        return memory, UPWARD

    def ends(*_: object) -> None:
        raise SystemExit(3)

    before = signal.signal(signal.SIGUSR1, ends)
    try:
        with pytest.raises(SystemExit):
            tried(law_that(interrupted))
    finally:
        signal.signal(signal.SIGUSR1, before)


@pytest.mark.parametrize("kind", [SystemExit, KeyboardInterrupt, GeneratorExit])
def test_a_law_that_would_end_the_program_is_told(kind: type[BaseException]) -> None:
    def ends(memory: Any, now: Now) -> Any:
        raise kind("enough")

    class Unmade:
        def __init__(self, parameters: Any) -> None:
            raise kind("enough")

        def load_position(self, memory: Any, now: Now) -> Any:
            return memory, UPWARD

    for law in (law_that(ends), Unmade):
        with pytest.raises(OwnError, match=rf"failed: {kind.__name__}: enough \(test_host\.py:\d+\)$"):
            tried(law)


def test_a_call_that_does_not_come_back_is_broken_off() -> None:
    def hangs(memory: Any, now: Now) -> Any:
        while now.begins:
            pass
        return memory, UPWARD

    with (
        pytest.raises(OwnError, match=r"TooSlow: no answer within 0\.05 s: .* \(test_host\.py:\d+\)$"),
        watched_calls(max_call_s=0.05),
    ):
        tried(law_that(hangs))


def test_one_that_sleeps_is_woken() -> None:
    alarm = threading.Event()
    guard = threading.Timer(60.0, alarm.set)  # so that one that is not woken does not sleep for ever

    def sleeps(memory: Any, now: Now) -> Any:
        alarm.wait()
        return memory, UPWARD

    guard.start()
    with (
        pytest.raises(OwnError, match=r"TooSlow: no answer within 0\.05 s: .* \(test_host\.py:\d+\)$"),
        watched_calls(max_call_s=0.05),
    ):
        tried(law_that(sleeps))
    guard.cancel()
    assert not alarm.is_set(), "it slept until the guard woke it"


def test_in_real_time_a_law_must_keep_up(monkeypatch: pytest.MonkeyPatch) -> None:
    period = 1.0 / VALUES["CTL_RATE_HZ"]
    clock = iter(0.5 * n * 1.01 * period for n in range(10**6))
    monkeypatch.setattr(USER_CALL, "clock", lambda: next(clock))
    quick = law_from_class(law_that(lambda memory, now: (memory, UPWARD)), "mine.py:Own")
    try_law(quick, VALUES)
    monkeypatch.setattr(USER_CALL, "clock", lambda: next(clock) * 3.0)
    with pytest.raises(OwnError, match=r"load_position takes \d\.\d ms, and there are 4\.0 ms: too slow"):
        try_law(quick, VALUES, ticks=26)


def test_a_machine_that_stalls_is_not_the_fault_of_the_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of the first calls lasts for 100 periods, all others for a hundredth of one."""
    period, readings, now_s = 1.0 / VALUES["CTL_RATE_HZ"], 0, 0.0

    def clock() -> float:
        nonlocal readings, now_s
        readings += 1
        now_s += period * (100.0 if USER_CALL.in_progress is False and stalls() else 0.01)
        return now_s

    def stalls() -> bool:
        return 20 <= readings < 23

    monkeypatch.setattr(USER_CALL, "clock", clock)
    law = law_from_class(law_that(lambda memory, now: (memory, UPWARD)), "mine.py:Own")
    try_law(law, VALUES, ticks=300)
    assert now_s > 100.0 * period


# ---- compiled


class Memory(NamedTuple):
    ticks: float


class Gain(NamedTuple):
    gain: float


class Compiled(Gain):
    @classmethod
    def build(cls, parameters: Any) -> Compiled:
        return cls(parameters["CTL_RATE_HZ"])

    @kernel
    def start(self, now: Now) -> Memory:
        return Memory(self.gain)

    @kernel
    def load_position(self, memory: Memory, now: Now) -> tuple[Memory, Asked]:
        return Memory(memory.ticks + 1.0), force((memory.ticks, 1.0 if now.begins else 0.0, now.time_s))

    @kernel
    def quad_attitude(self, memory: Memory, now: Now) -> tuple[Memory, Asked]:
        return memory, wrench(nan, (0.0, 0.0, 0.0))


class Steady(Compiled):
    quad_attitude = None  # type: ignore[assignment]


needs_compiler = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@needs_compiler
def test_a_compiled_law_is_called_without_python() -> None:
    assert is_compiled(law_from_class(Steady, "mine.py:Steady"), ("load_position",))
    assert not is_compiled(law_from_class(law_that(lambda memory, now: (memory, UPWARD)), "mine.py:Own"), ())
    before = USER_CALL.count
    tried(Steady)
    assert before == USER_CALL.count


def test_a_compiled_law_answers_as_python_would() -> None:
    answers = []
    law = law_from_class(Steady, "mine.py:Steady")
    try_law(law, VALUES, on_command=answers.append)
    rate = VALUES["CTL_RATE_HZ"]
    wanted = [(rate + n, 1.0 if n == 0 else 0.0, n / rate) for n in range(TICKS)]
    assert [asked.vector for asked in answers] == wanted


def test_a_compiled_law_that_asks_for_nothing_is_told() -> None:
    with pytest.raises(
        OwnError,
        match=r"Law Compiled failed: asks for a thrust of nan N; must be numbers up to 1e9 \(test_host\.py",
    ):
        tried(Compiled)


class Doubled(Steady):
    @kernel
    def load_position(self, memory: Memory, now: Now) -> tuple[Memory, Asked]:
        return memory, attitude(((2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 2.0)), 1.0)


def test_a_compiled_law_cannot_command_an_attitude_that_is_no_rotation() -> None:
    with pytest.raises(OwnError, match=r"commands an attitude that is no rotation: .*\(test_host\.py"):
        tried(Doubled)


def law_compiled_from(method: Any) -> type:
    class Uncompiled(Gain):
        @classmethod
        def build(cls, parameters: Any) -> Uncompiled:
            return cls(1.0)

        load_position = method

    return Uncompiled


@needs_compiler
def test_what_cannot_be_compiled_is_told_with_its_line() -> None:
    @kernel
    def load_position(self: Any, memory: Any, now: Now) -> Any:
        return memory, now.no_such_field  # type: ignore[attr-defined]

    told = r"cannot be compiled: Unknown attribute 'no_such_field' of type Now \(test_host\.py:\d+\)$"
    with pytest.raises(OwnError, match=rf"Law Uncompiled failed: {told}"):
        tried(law_compiled_from(load_position))


@needs_compiler
def test_and_with_the_reason_that_follows_what_it_was_of() -> None:
    @kernel
    def load_position(self: Any, memory: Any, now: Now) -> Any:
        return memory, len(now.time_s)  # type: ignore[arg-type]

    told = r"cannot be compiled: no implementation of len\(float64\) \(test_host\.py:\d+\)$"
    with pytest.raises(OwnError, match=told):
        tried(law_compiled_from(load_position))
