"""A custom estimator as the rest of the autopilot sees it.

    class MyEstimator:
        parameters = {"MY_TAU": Parameter(0.1, 0.01, 1.0, "s", "Time constant")}

        def __init__(self, parameters): ...       # all parameters of the autopilot by name
        def start(self, now): ...                 # memory at the first tick; without it None
        def estimate(self, memory, now): ...      # (memory, estimate)

`now` is `autopilot.estimation.estimator_exchange.Sensed`; the estimate is made by `estimated` or
`no_estimate` of `autopilot.own.estimates`. An estimator whose class is a NamedTuple of numbers, and whose
methods are compiled by `kernel`, is called as machine code.
"""

from __future__ import annotations

from dataclasses import dataclass

from autopilot.own.loaded_class import LoadedClass, checked_fields
from autopilot.own.source import OwnError, find_class

GROUP = "plumbline.estimators"  # of entry points
METHOD = "estimate"


@dataclass(frozen=True)
class OwnEstimator(LoadedClass):
    """A loaded estimator."""

    role = "Estimator"


def load_estimator(reference: str) -> OwnEstimator:
    """The estimator that a reference, as in `autopilot.own.source`, names. OwnError if it is none."""
    return estimator_from_class(find_class(reference, GROUP, _is_estimator, "estimator", ()), reference)


def estimator_from_class(kind: type, reference: str) -> OwnEstimator:
    """The estimator of a class. OwnError if the class is none."""
    if not _is_estimator(kind):
        raise OwnError(f"{reference}: {kind.__name__} has no method {METHOD}(self, memory, now)")
    return OwnEstimator(*checked_fields(kind, reference))


def _is_estimator(kind: type) -> bool:
    return callable(getattr(kind, METHOD, None))
