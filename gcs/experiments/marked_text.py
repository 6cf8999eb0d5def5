"""Parts of the documentation that programs write with `--docs`: the text between two marks on a page."""

from __future__ import annotations

from pathlib import Path

from gcs.errors import InputError


def split_at_marks(page: Path, begin: str, end: str) -> tuple[str, str, str]:
    """The text before, between and after the marks; InputError if the page cannot be read or does not hold
    both."""
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"--docs {page}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"--docs {page}: not a text file in UTF-8") from None
    head, found, rest = text.partition(begin)
    between, closed, tail = rest.partition(end)
    if not found or not closed:
        raise InputError(f"--docs {page}: must hold the lines {begin.strip()} and {end.strip()}")
    return head, between, tail


def write_between(page: Path, begin: str, end: str, text: str) -> None:
    """Put `text` between the marks; InputError as above."""
    head, _, tail = split_at_marks(page, begin, end)
    page.write_text(f"{head}{begin}{text}{end}{tail}", encoding="utf-8")
