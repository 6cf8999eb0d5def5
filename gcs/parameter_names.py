"""What is said of a parameter that there is not, wherever it is named."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def unknown_parameter(name: str, names: Iterable[str]) -> str:
    """That it is none of these names; the nearest one, and all that begin as it does."""
    known = sorted(names)
    near = get_close_matches(name, known, n=1, cutoff=0.75)
    hint = f"did you mean {near[0]}? " if near else ""
    prefix = name.partition("_")[0] + "_"
    kin = [one for one in known if one.startswith(prefix)]
    if kin:
        return f"{name}: no such parameter; {hint}there are {', '.join(kin)}"
    groups = ", ".join(sorted({one.partition("_")[0] + "_" for one in known}))
    return f"{name}: no such parameter; {hint}names begin with one of {groups}"
