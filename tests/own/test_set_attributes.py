"""Attributes that were set after their class was defined."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count
from typing import ClassVar, NamedTuple

import pytest

from autopilot.own.set_attributes import attributes_set_since
from plumbline.laws import Parameter

_numbers = count()
BASE = 2.0


class Parent:
    width: float = 1.0


class Gains(NamedTuple):
    k_p: float = 3.0
    k_d: float = 2.0


class Mine(Parent):
    gain = 2.0 * BASE
    double: ClassVar[float] = 2.0 * gain
    low, high = 0.0, 1.0
    serial = next(_numbers)
    parameters = {"MY_KP": Parameter(3.0, 0.0, 9.0)}  # noqa: RUF012
    thing = object()

    def run(self) -> float:
        inside = self.gain
        return 2.0 * inside


@dataclass
class Kept:
    gain: float = 3.0


@pytest.mark.parametrize("kind", [Mine, Gains, Kept, Parent])
def test_a_class_as_it_is_written_has_none(kind: type) -> None:
    assert attributes_set_since(kind) == []


@pytest.mark.parametrize(
    ("owner", "name", "value", "found"),
    [
        (Mine, "gain", 5.0, ["Mine.gain"]),
        (Mine, "double", 5.0, ["Mine.double"]),
        (Mine, "added", 5.0, ["Mine.added"]),
        (Mine, "parameters", {"MY_KP": Parameter(4.0, 0.0, 9.0)}, ["Mine.parameters"]),
        (Parent, "width", 5.0, ["Parent.width"]),
        (Mine, "gain", 4.0, []),  # as it is written
        (Mine, "serial", 7, []),  # of which the source says nothing
        (Mine, "low", 7.0, []),
    ],
)
def test_one_that_was_set_is_found(
    owner: type, name: str, value: object, found: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner, name, value, raising=False)
    assert attributes_set_since(Mine) == found
