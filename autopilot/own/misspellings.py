"""What is probably a mistake in a custom class: the class can be flown nevertheless, with a warning."""

from __future__ import annotations

from autopilot.own import estimator, law, planner
from autopilot.own.loaded_class import LoadedClass
from autopilot.own.own_code import OwnCode
from missions.nearest import nearest

_CALLED_METHODS = {
    "Law": (*law.MODES, "start", "build"),
    "Estimator": (estimator.METHOD, "start", "build"),
    "Planner": (planner.METHOD, "build"),
}
_MIN_SIMILARITY = 0.85


def misspelling_warnings(own: OwnCode) -> list[str]:
    """A line for each public method that is never called and whose name is close to that of a missing method:
    such as `quad_postion`, whose mode the built-in law would fly.

    OwnError if a class cannot be loaded.
    """
    return [line for one in own.load_classes() for line in _misspelt_methods(one)]


def _misspelt_methods(loaded_class: LoadedClass) -> list[str]:
    kind, called = loaded_class.kind, _CALLED_METHODS[loaded_class.role]
    missing = [name for name in called if not hasattr(kind, name)]
    label = f"--{loaded_class.role.lower()} {loaded_class.reference}: {kind.__name__}"
    return [
        f"{label}.{name} is never called; did you mean {suggestion}?"
        for name in sorted(dir(kind))
        if not name.startswith("_") and name not in called and callable(getattr(kind, name))
        if (suggestion := nearest(name, missing, _MIN_SIMILARITY))
    ]
