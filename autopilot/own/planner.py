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

from autopilot.own.loaded_class import LoadedClass, checked_fields
from autopilot.own.source import OwnError, find_class

GROUP = "plumbline.planners"  # of entry points
METHOD = "plan"


@dataclass(frozen=True)
class OwnPlanner(LoadedClass):
    """A loaded planner."""

    role = "Planner"


def load_planner(reference: str) -> OwnPlanner:
    """The planner that a reference, as in `autopilot.own.source`, names. OwnError if it is none."""
    return planner_from_class(find_class(reference, GROUP, _is_planner, "planner", ()), reference)


def planner_from_class(kind: type, reference: str) -> OwnPlanner:
    """The planner of a class. OwnError if the class is none."""
    if not _is_planner(kind):
        raise OwnError(f"{reference}: {kind.__name__} has no method {METHOD}(self, route)")
    return OwnPlanner(*checked_fields(kind, reference))


def _is_planner(kind: type) -> bool:
    return callable(getattr(kind, METHOD, None))
