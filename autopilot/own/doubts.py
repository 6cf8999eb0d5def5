"""What is probably a mistake in a custom class: the class can be flown nevertheless, with a warning."""

from __future__ import annotations

from autopilot.own import estimator, law, planner
from autopilot.own.brought import Brought
from autopilot.own.chosen import Own
from missions.nearest import nearest

_CALLED = {
    "Law": (*law.MODES, "start", "build"),
    "Estimator": (estimator.METHOD, "start", "build"),
    "Planner": (planner.METHOD, "build"),
}
_LIKENESS = 0.85


def own_doubts(own: Own) -> list[str]:
    """A line for each public method that is never called and whose name is close to that of a missing method:
    such as `quad_postion`, whose mode the built-in law would fly.

    OwnError if a class cannot be loaded.
    """
    return [line for one in own.loaded() for line in _misspelt(one)]


def _misspelt(brought: Brought) -> list[str]:
    kind, called = brought.kind, _CALLED[brought.what]
    missing = [name for name in called if not hasattr(kind, name)]
    told = f"--{brought.what.lower()} {brought.reference}: {kind.__name__}"
    return [
        f"{told}.{name} is never called; did you mean {near}?"
        for name in sorted(dir(kind))
        if not name.startswith("_") and name not in called and callable(getattr(kind, name))
        if (near := nearest(name, missing, _LIKENESS))
    ]
