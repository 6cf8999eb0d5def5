"""The seeds and the values of varied parameters of a sweep, and how they are written.

It loads nothing of the flight software.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

from autopilot.shell.options import MAX_SEED
from gcs.errors import EXIT_USAGE, GcsError

MAX_FLIGHTS = 10_000_000
MAX_VALUES = 10_000  # of a varied parameter
_FORMS = "NAME=LOW:HIGH:COUNT or NAME=A,B,C"
_MAX_SEED_DIGITS = len(str(MAX_SEED))


class PlanError(GcsError):
    """A sweep that cannot be flown as specified."""

    exit_code = EXIT_USAGE


@dataclass(frozen=True)
class VariedParameter:
    """A parameter and its values: on a grid, each of `values`; if drawn and `continuous`, any number between
    the least and the greatest of them. The parameters in `followers` have the same value in each flight."""

    name: str
    values: tuple[float, ...]
    continuous: bool
    followers: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters that have the value."""
        return (self.name, *self.followers)


def varied_values(varied: Sequence[VariedParameter]) -> list[tuple[str, float]]:
    """Each value that a parameter has in some flight, with its name."""
    return [(name, value) for one in varied for name in one.names for value in one.values]


def parse_varied(text: str, sampled: bool) -> VariedParameter:
    """NAME=A,B,C, or NAME=LOW:HIGH:COUNT, or, if values are `sampled`, NAME=LOW:HIGH.

    NAME=NAME=... varies several parameters together: all of them have the same value.
    """
    *texts, values = text.split("=")
    name, *others = [one.strip().upper() for one in texts] or [""]
    followers = tuple(others)
    if not all([name, *others]) or not values.strip():
        raise PlanError(f"--vary {text}: must be {_FORMS}, e.g. SIM_ACT_DELAY_MS=0:60:7")
    if ":" not in values:
        listed = tuple(_parse_number(text, one) for one in values.split(","))
        duplicate = next((one for i, one in enumerate(listed) if one in listed[:i]), None)
        if duplicate is not None:
            raise PlanError(f"--vary {text}: {duplicate:g} is there twice; --seeds flies it more than once")
        return VariedParameter(name, listed, False, followers)
    parts = values.split(":")
    if len(parts) not in (2, 3):
        raise PlanError(f"--vary {text}: must be NAME=LOW:HIGH:COUNT, or NAME=LOW:HIGH with --sample")
    low, high = _parse_number(text, parts[0]), _parse_number(text, parts[1])
    if not low < high:
        raise PlanError(f"--vary {text}: the first end must be below the second")
    if len(parts) == 2:
        if not sampled:
            raise PlanError(f"--vary {text}: a range without a count is for --sample; append a count, as :7")
        return VariedParameter(name, (low, high), True, followers)
    if sampled:
        without_count = f"{'='.join([name, *others])}={parts[0].strip()}:{parts[1].strip()}"
        raise PlanError(
            f"--vary {text}: --sample draws from the whole range, without a count; give {without_count}"
        )
    count = _parse_number(text, parts[2])
    if count != int(count) or not 2 <= count <= MAX_VALUES:
        raise PlanError(f"--vary {text}: the count must be a whole number, 2 ... {MAX_VALUES}")
    n = int(count)
    # rounded to twelve digits: 0.1 and not 0.30000000000000004
    even = tuple(float(f"{low + i * (high - low) / (n - 1):.12g}") for i in range(n))
    return VariedParameter(name, even, True, followers)


def parse_seeds(text: str) -> tuple[int, ...]:
    """N: the seeds 1 ... N; else a list of seeds and of ranges FIRST:LAST of them, in ascending order."""
    parts = text.split(",")
    if len(parts) == 1 and ":" not in text:
        parts = [f"1:{text}"]
        if _seed(text, text) == 0:
            raise PlanError("--seeds 0: flies nothing; --seeds 0:0 flies the seed 0")
    ranges = []
    for part in parts:
        first, colon, last = part.partition(":")
        low = _seed(text, first)
        high = _seed(text, last) if colon else low
        if low > high:
            raise PlanError(f"--seeds {text}: the first end must not be above the second")
        ranges.append(range(low, high + 1))
    ranges.sort(key=lambda one: one.start)
    for one, after in pairwise(ranges):
        if after.start < one.stop:
            raise PlanError(f"--seeds {text}: {after.start} is there twice; each seed is flown once")
    if sum(one.stop - one.start for one in ranges) > MAX_FLIGHTS:
        raise PlanError(f"--seeds {text}: too many, {MAX_FLIGHTS} flights at most")
    return tuple(chain.from_iterable(ranges))


def _seed(text: str, number: str) -> int:
    number = number.strip()
    if not (number.isascii() and number.isdecimal() and len(number) <= _MAX_SEED_DIGITS):
        raise PlanError(
            f"--seeds {text}: {number or 'nothing'!r} is no seed; must be a number N for the seeds 1 ... N, "
            "a range or a list, as 11:20 or 3,7,20:29"
        )
    if int(number) > MAX_SEED:
        raise PlanError(f"--seeds {text}: a seed is {MAX_SEED} at most")
    return int(number)


def seeds_text(seeds: Sequence[int]) -> str:
    """The seeds as `parse_seeds` reads them, shortly."""
    if tuple(seeds) == tuple(range(1, len(seeds) + 1)):
        return str(len(seeds))
    runs: list[list[int]] = []
    for seed in seeds:
        if runs and seed == runs[-1][-1] + 1:
            runs[-1][1:] = [seed]
        else:
            runs.append([seed])
    if len(runs) == 1:  # a number alone would be that of the seeds
        return f"{runs[0][0]}:{runs[0][-1]}"
    return ",".join(":".join(map(str, run)) for run in runs)


def _parse_number(text: str, number: str) -> float:
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlanError(
            f"--vary {text}: {number.strip() or 'nothing'!r} is no finite number; must be {_FORMS}"
        )
    return value
