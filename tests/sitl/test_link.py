"""The simulator's socket towards autopilots."""

from __future__ import annotations

from gcs.shell.link import LOOPBACK, free_port
from sitl.shell.link import Link


def test_a_flood_of_autopilots_that_are_turned_away_is_not_a_flood_of_lines() -> None:
    said: list[str] = []
    link = Link((LOOPBACK, free_port()), (LOOPBACK, free_port()), said.append)
    served = (LOOPBACK, 1)
    assert link.serves(served)
    link.heard()
    said.clear()
    for port in range(2, 100):
        link.heard()
        assert not link.serves((LOOPBACK, port))
    link.close()
    assert len(said) == 8
    assert said[0].endswith("is not served: that at 127.0.0.1:1 answers")
    assert said[-1].endswith("; others are not named")
