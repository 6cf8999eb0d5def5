"""What is said of a parameter that there is not, wherever it is named."""

from __future__ import annotations

from collections.abc import Iterable

from missions.nearest import nearest

_LIKENESS = 0.75  # names of one group are much alike
_MOST_MEANT = 4


def unknown_parameter(name: str, names: Iterable[str]) -> str:
    """That it is none of these names; those that may be meant, or else all that begin as it does.

    Meant may be the nearest spelling, and what another autopilot calls otherwise: WPNAV_SPEED is MIS_SPEED.
    """
    known = sorted(names)
    group, _, quantity = name.partition("_")
    near = nearest(name, known, _LIKENESS)
    alike = [one for one in known if quantity and one.partition("_")[2] == quantity.upper() and one != near]
    meant = [*filter(None, [near]), *alike][:_MOST_MEANT]
    if meant:
        return f"{name}: no such parameter; did you mean {' or '.join(meant)}? docs/parameters.md lists all"
    kin = [one for one in known if one.startswith(group + "_")]
    if kin:
        return f"{name}: no such parameter; there are {', '.join(kin)}"
    groups = ", ".join(sorted({one.partition("_")[0] + "_" for one in known}))
    return f"{name}: no such parameter; names begin with one of {groups}"
