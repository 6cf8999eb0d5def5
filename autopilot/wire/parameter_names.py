"""The error text for a parameter that does not exist, wherever it is named."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from missions.nearest import nearest

_MIN_SIMILARITY = 0.75  # names of one group are much alike
_MAX_SUGGESTIONS = 4


def unknown_parameter_text(name: str, names: Iterable[str]) -> str:
    """The text that `name` does not exist, with the names that may be meant, or else all of its group.

    If several names continue it (SIM_WIND), these are all of them, as none is nearer than the others. Else
    they are names that contain all words of this one (SIM_DELAY: SIM_ACT_DELAY_MS), the nearest spelling, and
    names that differ only in the group, as those of other autopilots may: WPNAV_SPEED is MIS_SPEED.
    """
    known = sorted(names)
    longer_names = [one for one in known if "_" in name and one.startswith(f"{name}_")]
    if len(longer_names) > 1:
        return _suggestion_text(name, longer_names)
    group, _, quantity = name.partition("_")
    words = set(name.upper().split("_"))
    with_words = [one for one in known if len(words) > 1 and words < set(one.split("_"))]
    near = nearest(name, known, _MIN_SIMILARITY)
    same_quantity = [
        one for one in known if quantity and one.partition("_")[2] == quantity.upper() and one != near
    ]
    meant = list(dict.fromkeys([*with_words, *filter(None, [near]), *same_quantity]))[:_MAX_SUGGESTIONS]
    if meant:
        return _suggestion_text(name, meant)
    same_group = [one for one in known if one.startswith(group + "_")]
    if same_group:
        return f"{name}: no such parameter; there are {', '.join(same_group)}"
    groups = ", ".join(sorted({one.partition("_")[0] + "_" for one in known}))
    return f"{name}: no such parameter; names begin with one of {groups}"


def _suggestion_text(name: str, meant: Sequence[str]) -> str:
    choices = " or ".join(filter(None, [", ".join(meant[:-1]), meant[-1]]))
    return f"{name}: no such parameter; did you mean {choices}? docs/parameters.md lists all"
