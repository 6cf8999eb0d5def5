"""Pictures drawn by two processes, of which only the first heeds signals to stop."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from gcs.report.draw import Drawing
from gcs.report.plots import Picture
from gcs.shell.stopping import StopRequest


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core: one process draws")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_who_draws_beside_us_leaves_the_terminals_signals_to_us(
    capfd: pytest.CaptureFixture[str], number: signal.Signals
) -> None:
    ours = os.getpid()

    def asked_to_stop(view: Any, target: Any) -> None:
        if os.getpid() != ours:
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
            os.write(told, b"drawn")

    heard, told = os.pipe()
    view: Any = None
    pictures = [Picture("one", "", asked_to_stop)]
    drawn: list[str] = []
    with StopRequest("stopping") as stop, Drawing(Path(), pictures) as drawing:
        drawing.start_drawing(view)
        assert os.read(heard, 5) == b"drawn"
        drawing.finish(lambda picture: drawn.append(picture.file))
        assert not stop
    assert drawn == ["one.png"]
    assert capfd.readouterr().err == ""
