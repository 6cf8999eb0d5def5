"""Messages of strangers change no bit of a flight; benchmarks/hostile.py sends them by the million."""

from __future__ import annotations

import random

import pytest

from benchmarks import hostile

COUNT, EACH = 20_000, 8  # datagrams, and how many a tick: ten seconds of flight


@pytest.mark.parametrize(
    ("key", "strangers"),
    [(hostile.KEY, hostile.datagrams_without_its_key), (None, hostile.datagrams_for_unsigned_vehicle)],
    ids=["with a signing key", "without"],
)
def test_a_flight_under_fire_is_the_flight_in_peace(key, strangers, capsys):
    hostile.fly_under_attack("flight", key, strangers(random.Random(1)), COUNT, EACH)
    assert f"{COUNT} datagrams" in capsys.readouterr().out
