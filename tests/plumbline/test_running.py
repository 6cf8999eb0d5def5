"""plumbline.connect where there is nothing to connect to; with a vehicle: tests/processes/test_connect.py."""

from __future__ import annotations

from typing import Any

import pytest

import plumbline
from gcs.shell.link import UdpSocket, free_port

WRONG: dict[str, tuple[Any, str]] = {
    "address": (lambda: plumbline.connect("14550x"), "address '14550x'; must be PORT, HOST:PORT, udpin:"),
    "nobody": (
        lambda: plumbline.connect(f"udpin:127.0.0.1:{free_port()}", timeout_s=0.1),
        "within 0.1 s; is autopilot running and sending there?",
    ),
    "nobody to speak to": (
        lambda: plumbline.connect(f"udpout:127.0.0.1:{free_port()}", timeout_s=0.1),
        "no vehicle heard on UDP udpout:127.0.0.1:",
    ),
}


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_one_line(call: Any, says: str) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value) and "\n" not in str(told.value)


def test_a_port_that_is_taken_and_free_again_after_a_failure() -> None:
    port = free_port()
    taken = UdpSocket("127.0.0.1", port)
    with pytest.raises(plumbline.Error, match="is in use by another program"):
        plumbline.connect(str(port), timeout_s=0.1)
    taken.close()
    with pytest.raises(plumbline.Error, match="no vehicle heard"):
        plumbline.connect(str(port), timeout_s=0.1)
    UdpSocket("127.0.0.1", port).close()
