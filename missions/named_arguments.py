"""Steps made in Python: for an argument that a step does not have, those that it has are named."""

from __future__ import annotations

from dataclasses import fields
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T")


def names_its_arguments(step: type[T]) -> type[T]:
    """A dataclass whose TypeError for an unknown argument suggests the nearest name and lists all names."""
    construct = step.__init__
    known = [one.name for one in fields(step)]  # type: ignore[arg-type]

    @wraps(construct)
    def checked(self: T, *values: Any, **named: Any) -> None:
        for name in named:
            if name not in known:
                from missions.nearest import did_you_mean

                raise TypeError(
                    f"{step.__name__}() has no argument {name!r}; {did_you_mean(name, known)}"
                    f"it takes {', '.join(known)}"
                )
        construct(self, *values, **named)

    step.__init__ = checked  # type: ignore[assignment, method-assign]
    return step
