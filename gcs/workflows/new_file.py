"""A new file for the user, from a template that flies as it is.

The kinds are the files in `gcs/templates`: `vehicle.toml` is the template of a vehicle. A template is itself
a valid file of its kind with the name `my_name` (and `MyName` for a class), which is replaced. A comment line
in it that begins with `Fly it:` contains the command that flies it. The name of the file stands only in
commands.
"""

from __future__ import annotations

import re
import shlex
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.machinery import PathFinder
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from sysconfig import get_path

from autopilot.geometry.machine_code import ROOT
from gcs.errors import InputError, write_error

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
_FLY_IT = re.compile(r"^\W*Fly it:\s+(\S.*)$", re.MULTILINE)


@dataclass(frozen=True)
class NewFile:
    """What was written, and the command that flies it."""

    path: Path
    fly: str


def _is_taken(module: str) -> bool:
    """Whether scripts beside the file would import it instead of another module: of Python, of an installed
    library, or of Plumbline."""
    if module in sys.stdlib_module_names:
        return True
    return PathFinder.find_spec(module, [*map(get_path, ("purelib", "platlib")), str(ROOT)]) is not None


def kinds() -> tuple[str, ...]:
    """The kinds of files for which there are templates, sorted."""
    return tuple(sorted(_suffixes()))


def new_file(kind: str, name: str) -> NewFile:
    """Write the template of `kind` as `name`, which may be a path and may include the ending.

    InputError if the name is not allowed or is taken, or if the file cannot be written there; GcsError if the
    disk is full.
    """
    suffix = _suffixes()[kind]
    given = Path(name)
    word = given.name.removesuffix(suffix)
    if not _NAME.fullmatch(word):
        raise InputError(
            f"{name!r} cannot be the name of the new {kind}: "
            "at most 64 of A-Z, a-z, 0-9, - and _, beginning with a letter"
        )
    # the name of a module must be an identifier
    stem = word.replace("-", "_") if suffix == ".py" else word
    if suffix == ".py" and _is_taken(stem):
        raise InputError(f"{name!r}: {stem} is a module of Python or of a library; choose another name")
    path = given.with_name(stem + suffix)
    text = _template(kind + suffix).replace(f"my_name{suffix}", shlex.quote(str(path)))
    text = text.replace("my_name", stem).replace("MyName", _class_name(stem))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(error, path, "file", option="") from None
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{path} exists already and is left as it is; choose another name") from None
    except OSError as error:
        with suppress(OSError):
            path.unlink()  # of a full disk: else it would be in the way when there is space again
        raise write_error(error, path, "file", option="") from None
    return NewFile(path, _command(text, kind))


def _suffixes() -> dict[str, str]:
    names = [Path(entry.name) for entry in _folder().iterdir() if not entry.name.startswith("_")]
    return {name.stem: name.suffix for name in names if name.suffix in (".toml", ".py")}


def _template(name: str) -> str:
    return _folder().joinpath(name).read_text(encoding="utf-8")


def _folder() -> Traversable:
    return files("gcs").joinpath("templates")


def _class_name(stem: str) -> str:
    return "".join(word[:1].upper() + word[1:] for word in re.split("[-_]", stem))


def _command(text: str, kind: str) -> str:
    found = _FLY_IT.search(text)
    if found is None:
        raise ValueError(f"the template of {kind} has no line that begins with `Fly it:`")
    return found.group(1)
