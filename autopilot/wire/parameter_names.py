"""The error text for a parameter that does not exist, wherever it is named."""

from __future__ import annotations

from collections.abc import Iterable

from missions.nearest import nearest

_MIN_SIMILARITY = 0.75  # names of one group are much alike
_MAX_SUGGESTIONS = 4


def unknown_parameter_text(name: str, names: Iterable[str]) -> str:
    """The text that `name` does not exist, with the names that may be meant, or else all of its group.

    These are the nearest spelling, and names that differ only in the group, as those of other autopilots may:
    WPNAV_SPEED is MIS_SPEED.
    """
    known = sorted(names)
    group, _, quantity = name.partition("_")
    near = nearest(name, known, _MIN_SIMILARITY)
    same_quantity = [
        one for one in known if quantity and one.partition("_")[2] == quantity.upper() and one != near
    ]
    meant = [*filter(None, [near]), *same_quantity][:_MAX_SUGGESTIONS]
    if meant:
        return f"{name}: no such parameter; did you mean {' or '.join(meant)}? docs/parameters.md lists all"
    same_group = [one for one in known if one.startswith(group + "_")]
    if same_group:
        return f"{name}: no such parameter; there are {', '.join(same_group)}"
    groups = ", ".join(sorted({one.partition("_")[0] + "_" for one in known}))
    return f"{name}: no such parameter; names begin with one of {groups}"
