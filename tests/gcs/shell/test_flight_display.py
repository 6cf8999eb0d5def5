"""The progress of a flight as it is told."""

from __future__ import annotations

import pytest

from gcs.clients.flight import Progress, Stage
from gcs.shell.display import FlightDisplay


def test_the_load_error_is_told_to_be_an_estimate(capsys: pytest.CaptureFixture[str]) -> None:
    flying = Progress(Stage.ARM, "mission", 1, 7, 0.5, 0.026, 0.67, 14.8, "")
    with FlightDisplay("case-b", quiet=False) as display:
        display.update(flying)
    assert capsys.readouterr().err.split("  ")[-2:] == ["load error (est.) 26 mm", "rotors 67 %\n"]
