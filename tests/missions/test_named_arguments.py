"""An argument that a step does not have."""

from collections.abc import Callable
from dataclasses import replace
from inspect import signature

import pytest

from missions.model import KINDS, Sine, Takeoff, Waypoint


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (
            lambda: Sine(1.5, phase_deg=90.0),  # type: ignore[call-arg]
            "Sine() has no argument 'phase_deg'; did you mean phase_rad? "
            "it takes period_s, phase_rad, start_s",
        ),
        (
            lambda: Waypoint(1.0, 2.0, 3.0, hold=1.0),  # type: ignore[call-arg]
            "Waypoint() has no argument 'hold'; did you mean hold_s? "
            "it takes east_m, north_m, altitude_m, hold_s",
        ),
        (lambda: Takeoff(height=1.0), "Takeoff() has no argument 'height'; it takes altitude_m"),  # type: ignore[call-arg]
    ],
)
def test_the_arguments_that_a_step_has_are_named(make: Callable[[], object], told: str) -> None:
    with pytest.raises(TypeError) as error:
        make()
    assert str(error.value) == told


def test_steps_are_made_and_described_as_before() -> None:
    assert Sine(period_s=1.5) == Sine(1.5, 0.0) == replace(Sine(1.5, 2.0), phase_rad=0.0)
    assert list(signature(Waypoint).parameters) == ["east_m", "north_m", "altitude_m", "hold_s"]
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'altitude_m'"):
        Takeoff()  # type: ignore[call-arg]
    assert Takeoff in KINDS
