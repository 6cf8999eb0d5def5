"""A custom path planner as the rest of the autopilot sees it.

    class MyPlanner:
        parameters = {"MY_SLOW": Parameter(1.0, 1.0, 10.0, "", "Times as long")}

        def __init__(self, parameters): ...       # all parameters of the autopilot by name
        def plan(self, route): ...                # the path

`route` is `autopilot.trajectory.route.Route`; the path is made by `polynomials` or `samples` of
`autopilot.trajectory.route`.
"""

from __future__ import annotations

from dataclasses import dataclass

from autopilot.own.brought import Brought, named
from autopilot.own.source import OwnError, found_class

GROUP = "plumbline.planners"  # of entry points
METHOD = "plan"


@dataclass(frozen=True)
class OwnPlanner(Brought):
    """A loaded planner."""

    what = "Planner"


def load_planner(reference: str) -> OwnPlanner:
    """The planner that a reference, as in `autopilot.own.source`, names. OwnError if it is none."""
    return planner_of(found_class(reference, GROUP, _suits, "planner", ()), reference)


def planner_of(kind: type, reference: str) -> OwnPlanner:
    """The planner of a class. OwnError if the class is none."""
    if not _suits(kind):
        raise OwnError(f"{reference}: {kind.__name__} has no method {METHOD}(self, route)")
    return OwnPlanner(*named(kind, reference))


def _suits(kind: type) -> bool:
    return callable(getattr(kind, METHOD, None))
