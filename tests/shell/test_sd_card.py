"""The card when the process is killed: a file being written may be incomplete, all else is untouched.

A file that a client overwrites is emptied first, as requested; it is assembled on the card, where others
may read the part that is already there. What was acknowledged is there.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from autopilot.onboard.flight_log import LogChunk
from autopilot.services.file_tree import FileTree
from autopilot.services.files import FileError, Limits
from autopilot.shell.sd_card import DirectoryCard
from autopilot.shell.storage import CARD_DIRECTORY, Storage
from tests.doubles.killed import killed_at

OLD, NEW = b"0123456789", b"abcdefgh"
BEFORE = {"a": OLD, "other": b"of somebody else", "log/1.ulg": b"an old log", "log/2.ulg": b"a log"}
LARGE_MB, NO_MB = 1.0, 0.0
Files = dict[str, bytes]


class Change(NamedTuple):
    """A change, and the states of the card that may be found meanwhile, in this order."""

    make: Callable[[Storage], object]
    found: list[Files]


def but(**changes: bytes | None) -> Files:
    """The card as it was except for these files; None: the file is missing. `log_3` is that log."""
    named = {name.replace("log_", "log/") + ".ulg" * ("_" in name): data for name, data in changes.items()}
    return {name: data for name, data in (BEFORE | named).items() if data is not None}


def parts(before: bytes = b"", behind: bytes = b"") -> list[bytes]:
    """The contents of a file while `NEW` is written there, over a part of the same length."""
    return [before + NEW[:size] + behind[size:] for size in range(len(NEW) + 1)]


def upload(storage: Storage, name: bytes) -> None:
    """Upload a file as a client does, in two parts."""
    tree = FileTree(storage.card, {})
    file = tree.open_to_write(b"/fs/microsd/" + name, empty=True)
    tree.write(file, 0, NEW[:5])
    tree.write(file, 5, NEW[5:])


def store_log(number: int, most_mb: float) -> Callable[[Storage], object]:
    chunk = LogChunk(("log", f"{number}.ulg"), NEW, False)
    return lambda storage: storage.store_log(chunk, most_mb)


CHANGES = {
    "a new file": Change(lambda s: upload(s, b"b"), [BEFORE, *(but(b=data) for data in parts())]),
    "a file anew": Change(lambda s: upload(s, b"a"), [BEFORE, *(but(a=data) for data in parts())]),
    "within a file": Change(
        lambda s: s.card.write(("a",), 1, NEW), [but(a=data) for data in parts(OLD[:1], OLD[1:])]
    ),
    "a file cut": Change(lambda s: s.card.truncate(("a",), 4), [BEFORE, but(a=OLD[:4])]),
    "a file taken away": Change(lambda s: s.card.remove(("a",)), [BEFORE, but(a=None)]),
    "a file renamed": Change(lambda s: s.card.rename(("a",), ("b",)), [BEFORE, but(a=None, b=OLD)]),
    "a log continued": Change(store_log(2, LARGE_MB), [but(log_2=data) for data in parts(b"a log")]),
    "a log begun where there is room": Change(
        store_log(3, LARGE_MB), [BEFORE, *(but(log_3=data) for data in parts())]
    ),
    "a log begun in place of others": Change(
        store_log(3, NO_MB),
        [BEFORE, but(log_1=None), *(but(log_1=None, log_2=None, log_3=data) for data in (None, *parts()))],
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_process_killed_while_it_writes_to_the_card_loses_nothing_else(tmp_path: Path, what: str) -> None:
    change, met, number, killed = CHANGES[what], [], 0, True
    while killed:
        storage = Storage(tmp_path / str(number))
        card = tmp_path / str(number) / CARD_DIRECTORY
        for name, data in BEFORE.items():
            (card / name).parent.mkdir(exist_ok=True)
            (card / name).write_bytes(data)
        storage = Storage(tmp_path / str(number))
        killed = killed_at(number, lambda storage=storage: change.make(storage))
        found = {str(p.relative_to(card)): p.read_bytes() for p in card.rglob("*") if p.is_file()}
        assert found in change.found
        met.append(change.found.index(found))
        number += 1
    assert met == sorted(met), "what was written is there"
    assert change.found[met[-1]] == change.found[-1]
    assert len(set(met)) > 1


def test_logs_and_their_folders_count_among_the_files_that_the_card_may_hold(tmp_path: Path) -> None:
    card = DirectoryCard(tmp_path, Limits(files=4))
    card.append(("log", "today", "1.ulg"), b"")
    card.append(("log", "today", "1.ulg"), b"it was there already, empty")
    card.create(("a",))
    with pytest.raises(FileError):
        card.create(("b",))
    card.remove(("log", "today", "1.ulg"))
    card.create(("b",))
