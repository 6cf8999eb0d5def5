"""A path planner that somebody has brought, as the rest of the autopilot knows it.

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
    """A planner, loaded."""

    what = "Planner"


def load_planner(reference: str) -> OwnPlanner:
    """The planner that a reference names, as `autopilot.own.source` reads it. OwnError if it can be none."""
    return planner_of(found_class(reference, GROUP, _suits, "planner", ()), reference)


def planner_of(kind: type, reference: str) -> OwnPlanner:
    """The planner of a class. OwnError if it is none."""
    if not _suits(kind):
        raise OwnError(f"{reference}: {kind.__name__} has no method {METHOD}(self, route)")
    return OwnPlanner(*named(kind, reference))


def _suits(kind: type) -> bool:
    return callable(getattr(kind, METHOD, None))
