"""The proofs hold, and they are proofs: flipping any single sign of the laws makes one of them fail.

The flips are made in the source text, one at a time and all of them: every term of every sum and difference,
every factor in front of a vector, every order of a cross product. A term added to a law later is therefore
flipped too.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from autopilot.control.records import Vehicle
from tests.control.flips import surviving
from tests.control.proofs import PROOFS


@pytest.mark.parametrize("proof", PROOFS, ids=lambda proof: proof.__name__)
def test_proof(proof: Any, laws: SimpleNamespace, model: SimpleNamespace, bebop: Vehicle) -> None:
    proof(laws, model, bebop)


def test_each_flip_fails_a_proof(law_sources: dict[str, str], model: SimpleNamespace, bebop: Vehicle) -> None:
    survivors, count = surviving(law_sources, PROOFS, (), model, bebop)
    assert not survivors, "\n".join(survivors)
    assert count > 100, f"only {count} flips were found"
