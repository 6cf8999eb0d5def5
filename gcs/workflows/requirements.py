"""Requirements on a run (`--require`), and whether it met them: as text, and as JUnit XML for CI."""

from __future__ import annotations

import math
import operator
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.errors import GcsError, InputError
from gcs.shell.display import notify
from missions.nearest import nearest_few

COMPLETED = "completed"
ALL_FLOWN = "all flights flown"  # the test case of a sweep, in which some flights may be lost
_COUNTS = (
    "completed",
    "completed_fraction",
    "completed_low_95",
    "failed",
)  # figures of a sweep that depend on lost flights
_NO_FIGURE = "this run has no such figure, for example because nothing happened that it measures"
Value = float | str
_SIGNS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_FORM = re.compile(r"\s*(\w+)\s*(<=|>=|==|!=|<|>)\s*(\S.*?)\s*")


@dataclass(frozen=True)
class Requirement:
    """A figure of the record, and what it must be."""

    text: str  # as it was typed
    key: str
    sign: str
    value: Value


@dataclass(frozen=True)
class Verdict:
    """A requirement, the value that was found, and whether it is met."""

    requirement: Requirement
    found: Any  # None: not known
    is_met: bool

    @property
    def line(self) -> str:
        """The verdict as text."""
        found = "not known" if self.found is None else f"{self.found}"
        why = f"; {_NO_FIGURE}" if self.found is None else ""
        return f"required {self.requirement.text}; found {found}{why}"


def parse_requirements(texts: Iterable[str], keys: Sequence[str], listed: str) -> list[Requirement]:
    """Parse requirements on the figures `keys`; `listed` names the place that lists these. InputError states
    what is wrong with one."""
    return [_parse(text, keys, listed) for text in texts]


def _parse(text: str, keys: Sequence[str], listed: str) -> Requirement:
    form = _FORM.fullmatch(text)
    if form is None:
        raise InputError(f'--require {text!r}: must be KEY SIGN VALUE, e.g. "load_error_max_m < 0.01"')
    key, sign, word = form.groups()
    if key not in keys:
        similar = " or ".join(nearest_few(key, keys))
        known = (
            f"did you mean {similar}? all are listed by {listed}"
            if similar
            else f"there are {', '.join(keys)}"
        )
        raise InputError(f"--require {text!r}: no figure {key}; {known}")
    value = _value(word)
    if isinstance(value, str) and sign not in ("==", "!="):
        raise InputError(f"--require {text!r}: {word} is not a number; a word is compared with == or !=")
    if isinstance(value, float) and math.isnan(value):
        raise InputError(f"--require {text!r}: nothing compares to {word}")
    return Requirement(text.strip(), key, sign, value)


def _value(word: str) -> Value:
    try:
        return float(word)
    except ValueError:
        return word.strip("\"'")


def check_requirements(requirements: Iterable[Requirement], record: Mapping[str, Any]) -> list[Verdict]:
    """The verdict on each requirement; an unknown figure meets none."""
    found = []
    for requirement in requirements:
        value = record.get(requirement.key)
        number = isinstance(value, int | float)
        same_type = number == isinstance(requirement.value, float)
        is_met = value is not None and same_type and _SIGNS[requirement.sign](value, requirement.value)
        found.append(Verdict(requirement, value, is_met))
    return found


def uncovered_failures(requirements: Sequence[Requirement], flights: int, completed: int) -> str:
    """A line that no requirement on the sweep considers its failed flights, and what to add; empty if all
    flights completed, if one does, or if nothing is required."""
    if not requirements or completed == flights or any(one.key in _COUNTS for one in requirements):
        return ""
    return (
        f"--require judges the {completed} completed of {flights} flights; "
        f'add --require "completed == {flights}" if all must be'
    )


@contextmanager
def junit_on_error(run: str, junit: Path | None, case: str = COMPLETED) -> Iterator[None]:
    """If the run raises GcsError, write the test report with this error in the test case `case`, and raise
    it again."""
    try:
        yield
    except GcsError as error:
        if junit is not None:
            suite = _suite(run, errors=1)
            ET.SubElement(_case(suite, run, case), "error", message=str(error))
            _write(junit, suite)
        raise


def report_verdicts(
    run: str,
    junit: Path | None,
    outcome: str,
    wall_s: float,
    verdicts: Sequence[Verdict],
    reason: str = "",
    case: str = COMPLETED,
) -> bool:
    """Print each requirement that was not met to stderr, and write the test report: the test case `case`,
    which fails with the `reason` if the run was not completed, and one for each requirement. True if all
    requirements were met."""
    unmet = [verdict for verdict in verdicts if not verdict.is_met]
    for verdict in unmet:
        notify(verdict.line)
    if junit is not None:
        cases = [(case, outcome == COMPLETED, ": ".join(filter(None, (f"outcome {outcome}", reason))))]
        cases += [(verdict.requirement.text, verdict.is_met, verdict.line) for verdict in verdicts]
        suite = _suite(run, len(cases), sum(not is_met for _, is_met, _ in cases), wall_s=wall_s)
        for name, is_met, line in cases:
            element = _case(suite, run, name)
            if not is_met:
                ET.SubElement(element, "failure", message=line)
        _write(junit, suite)
    return not unmet


def _suite(run: str, tests: int = 1, failures: int = 0, errors: int = 0, wall_s: float = 0.0) -> ET.Element:
    counts = {"tests": str(tests), "failures": str(failures), "errors": str(errors)}
    return ET.Element("testsuite", {"name": run, **counts, "time": f"{wall_s:.3f}"})


def _case(suite: ET.Element, run: str, name: str) -> ET.Element:
    return ET.SubElement(suite, "testcase", classname=run, name=name, time="0")


def _write(path: Path, suite: ET.Element) -> None:
    for element in suite.iter():  # XML cannot represent most control characters
        for key, value in element.attrib.items():
            element.set(key, "".join(c if c.isprintable() else " " for c in value))
    suites = ET.Element("testsuites")
    suites.append(suite)
    ET.indent(suites)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        ET.ElementTree(suites).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise GcsError(f"--junit {path}: {error.strerror}") from None
