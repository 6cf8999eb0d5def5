"""The known name that the user probably meant by an unknown one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

MIN_SIMILARITY = 0.6  # 0: nothing in common, 1: the same letters


def nearest(word: str, known: Iterable[str], min_similarity: float = MIN_SIMILARITY) -> str:
    """The known name that is most like `word`, regardless of case; empty if none is similar.

    `min_similarity` is the least similarity that counts, as defined by `difflib.SequenceMatcher.ratio`.
    """
    return next(iter(nearest_few(word, known, min_similarity, max_count=1)), "")


def nearest_few(
    word: str, known: Iterable[str], min_similarity: float = MIN_SIMILARITY, max_count: int = 3
) -> list[str]:
    """The known names that are most like `word`, the nearest first; see `nearest`."""
    names = {name.lower(): name for name in known}
    return [
        names[found] for found in get_close_matches(word.lower(), names, n=max_count, cutoff=min_similarity)
    ]


def did_you_mean(word: str, known: Iterable[str], min_similarity: float = MIN_SIMILARITY) -> str:
    """`did you mean NAME? `, to precede the rest of a message; empty if no name is near."""
    name = nearest(word, known, min_similarity)
    return f"did you mean {name}? " if name else ""
