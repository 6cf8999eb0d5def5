"""A custom class: found by its file, by its module, or by an entry point.

my_law.py:MyLaw       the class of a file; `:MyLaw` may be left out if the file has only one such class
package.module:MyLaw  the class of a module
my-law                an entry point, of the group that the caller names
my_law.pkl            a class that was saved by `autopilot.own.saved_class`
"""

from __future__ import annotations

import hashlib
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from autopilot.own.interruption import is_interruption
from autopilot.own.saved_class import SUFFIX, load_class, saved_file
from missions.nearest import did_you_mean
from missions.toml_files import other_kind_hint

_PACKAGE = Path(__file__).resolve().parents[1]
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_MAX_ERROR_CHARS = 120  # most characters of an error that are reported
_MAX_COMPILER_CHARS = 240  # the same for errors of the compiler, which name types before the reason
_loading: list[Path] = []  # files of custom classes that are being loaded; the last one's code runs now
_loaded: dict[str, _Loaded] = {}  # by the name of the module
_local_classes: dict[str, type] = {}  # of this process, by their references


class OwnError(ValueError):
    """A custom class cannot be used; the text says where and why."""


def find_class(
    reference: str, group: str, is_suitable: Callable[[type], bool], role: str, shipped: Sequence[str]
) -> type:
    """The class that a reference names. `is_suitable` says whether a class can be meant, `role` is the kind
    in words, and `shipped` are the names of the shipped ones.

    OwnError if there is no such file, module, class or entry point, or if its module cannot be loaded.
    """
    if reference in _local_classes:
        return _local_classes[reference]
    location, _, name = reference.rpartition(":") if ":" in reference else (reference, "", "")
    if reference.endswith(SUFFIX):
        return _saved_class(reference)
    if location.endswith(".py"):
        module, label = _module_from_file(location), location
    elif ":" in reference:
        module, label = _import_module(location), location
    else:
        return _class_from_entry_point(reference, group, role, shipped)
    if not name:
        classes_in_module = [one for one in vars(module).values() if isinstance(one, type)]
        defined_here = [one for one in classes_in_module if one.__module__ == module.__name__]
        # a single class that does not suit is returned too: the caller says what it lacks
        suitable = [one for one in defined_here if is_suitable(one)] or (
            defined_here if len(defined_here) == 1 else []
        )
        if len(suitable) == 1:
            return suitable[0]
        problem = (
            f"has {', '.join(one.__name__ for one in suitable)}; name one" if suitable else f"has no {role}"
        )
        example = suitable[0].__name__ if suitable else _example_names(role)[1]
        raise OwnError(f"{label}: {problem}, as {label}:{example}")
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [
            one.__name__ for one in vars(module).values() if isinstance(one, type) and is_suitable(one)
        ]
        known = f"; there is {', '.join(classes)}" if classes else ""
        raise OwnError(f"{label}: has no class {name}{known}")
    return found


def local_reference(kind: type) -> str:
    """A reference by which this process finds a class that no module has under its name."""
    reference = f"{kind.__module__}:{kind.__qualname__}"
    _local_classes[reference] = kind
    return reference


def _saved_class(location: str) -> type:
    path = Path(location).expanduser()
    if not path.is_file():
        raise OwnError(f"{location}: no such file")
    try:
        return load_class(path)
    except BaseException as error:
        raise OwnError(f"{location}: {error_text(error, None, path.name)}") from error


def _example_names(role: str) -> tuple[str, str]:
    """Names of a file and of a class in it, for messages about a kind of class."""
    word = role.rpartition(" ")[2]
    return f"my_{word}.py", f"My{word.capitalize()}"


def _module_from_file(location: str) -> ModuleType:
    path = Path(location).expanduser()
    if not path.is_file():
        raise OwnError(f"{location}: no such file")
    running = sys.modules.get("__main__")
    if running is not None and _is_same_file(getattr(running, "__file__", None), path):
        return running  # a script that passes a class of its own is not run again
    return _load_module(path.resolve(), location)


def _is_same_file(first: str | None, second: Path) -> bool:
    return first is not None and Path(first).is_file() and second.samefile(first)


class _Loaded(NamedTuple):
    """The module of a custom class's file, and the modules beside it that it imports, with their files."""

    module: ModuleType
    beside: dict[str, Path]
    digest: str  # of these files when they were loaded


def _load_module(path: Path, label: str) -> ModuleType:
    # named by its content, so that a changed file is another module
    name = f"{path.stem}_{_digest_of([path], str(path))}"
    if (loaded := _loaded.pop(name, None)) is not None:
        if _digest_of(loaded.beside.values()) == loaded.digest:
            _loaded[name] = loaded
            return loaded.module
        for outdated in (name, *loaded.beside):
            sys.modules.pop(outdated, None)
    of_others = {one for loaded in _loaded.values() for one in loaded.beside}
    before = set(sys.modules) - of_others
    module = _run_module(path, name, label)
    beside = {
        one: file
        for one in set(sys.modules) - before - {name}
        if (file := _file_of(one)) is not None and _is_beside(path, str(file))
    }
    _loaded[name] = _Loaded(module, beside, _digest_of(beside.values()))
    return module


def _run_module(path: Path, name: str, label: str) -> ModuleType:
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise OwnError(f"{label}: is no Python file")
    module = module_from_spec(spec)
    sys.modules[name] = module  # under its name, by which records resolve their annotations
    folder = str(path.parent)
    sys.path.insert(0, folder)  # files beside it can be imported
    _loading.append(path)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        raise OwnError(f"{label}: {error_text(error, path)}") from error
    finally:
        _loading.pop()
        if folder in sys.path:
            sys.path.remove(folder)
    return module


def _digest_of(files: Iterable[Path], text: str = "") -> str:
    digest = hashlib.sha256(text.encode())
    for file in sorted(files):
        digest.update(file.read_bytes() if file.is_file() else b"")
    return digest.hexdigest()[:12]


def _file_of(module: str) -> Path | None:
    location = getattr(sys.modules.get(module), "__file__", None)
    return Path(location) if location else None


def file_being_loaded() -> Path | None:
    """The file of a custom class whose code runs now because it is being loaded; None if there is none."""
    return _loading[-1] if _loading else None


def _import_module(location: str) -> ModuleType:
    if not _MODULE.fullmatch(location):
        raise OwnError(f"{location}: is no Python file (.py), and no name of a module")
    working_folder = str(Path.cwd())
    if working_folder not in sys.path:
        sys.path.append(working_folder)  # as for a program that is run from here
    try:
        return import_module(location)
    except BaseException as error:
        raise OwnError(f"{location}: {error_text(error, None)}") from error


def _class_from_entry_point(name: str, group: str, role: str, shipped: Sequence[str]) -> type:
    points = {point.name: point for point in entry_points(group=group)}
    if name not in points:
        known = "".join(f"{one}, " for one in (*shipped, *sorted(points)))
        known += "or " if known else ""
        file_name = f"{name}.py"
        hint = f"did you mean {file_name}? " if Path(file_name).is_file() else other_kind_hint(name, role)
        hint = hint or did_you_mean(name, (*shipped, *points))
        example = ":".join(_example_names(role))
        raise OwnError(f"{name!r}: no {role} of that name; {hint}must be {known}a file as {example}")
    try:
        found = points[name].load()
    except BaseException as error:
        raise OwnError(f"{name}: {error_text(error, None)}") from error
    if not isinstance(found, type):
        raise OwnError(f"{name}: {points[name].value} is no class")
    return found


def source_file(kind: type) -> Path | None:
    """The file in which a class is written or saved; None if there is none."""
    if (path := saved_file(kind)) is not None:
        return path
    return _file_of(kind.__module__)


def source_digest(kind: type) -> str:
    """A hash of the file in which a class is written, of all loaded modules in its folder and below, and of
    the file with its data that it names by an attribute `file`, such as a trained policy."""
    path = source_file(kind)
    digest = hashlib.sha256()
    for file in sorted(_loaded_files_beside(path)) if path is not None else ():
        digest.update(file.relative_to(path.parent).as_posix().encode() + b"\0" + file.read_bytes())  # type: ignore[union-attr]
    data = getattr(kind, "file", None)
    if isinstance(data, str | Path) and Path(data).is_file():
        digest.update(Path(data).read_bytes())
    return digest.hexdigest()[:16]


def _loaded_files_beside(path: Path) -> set[Path]:
    folder, depth = path.parent.parts, len(path.parent.parts)
    places = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    files = {Path(location) for location in places if isinstance(location, str) and location.endswith(".py")}
    # of some thousand modules few lie here: only these are looked up on the disk
    beside = (file for file in files if file.parts[:depth] == folder and file.anchor == path.anchor)
    return {path, *(file for file in beside if file.is_file())}


def error_text(error: BaseException, path: Path | None, entry: str = "") -> str:
    """One line about an error of user code written in the file `path`. It ends with file and line: the last
    place in the folder of that file, or else `entry`, the place that was to be entered, or else the last
    place of all.

    An exception that only interrupted the code, such as Ctrl-C, is raised again.
    """
    if is_interruption(error):
        raise error
    if type(error).__module__.startswith("numba"):
        return _compiler_error_text(str(error), path)
    message = " ".join(str(error).split())
    text = (
        f"{type(error).__name__}: {_shortened(message, _MAX_ERROR_CHARS)}"
        if message
        else type(error).__name__
    )
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}:{error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    own_frames = [one for one in frames if path is not None and _is_beside(path, one.filename)]
    if entry and not own_frames:  # for example if an argument is missing
        return f"{text} ({entry})"
    last = own_frames or [one for one in frames if not _is_import_frame(one.filename)]
    return f"{text} ({Path(last[-1].filename).name}:{last[-1].lineno})" if last else text


def _is_beside(path: Path, filename: str) -> bool:
    """Whether a file lies beside or below another, and belongs neither to Plumbline nor to a library."""
    file = Path(filename)
    is_user_code = not file.is_relative_to(_PACKAGE) and "site-packages" not in file.parts
    return file == path or (is_user_code and file.is_relative_to(path.parent))


def _is_import_frame(filename: str) -> bool:
    return filename.startswith("<") or "importlib" in Path(filename).parts or filename == __file__


def _compiler_error_text(message: str, path: Path | None) -> str:
    """What the compiler cannot compile and why, and the place in the file `path`."""
    message = _COLOURS.sub("", message)  # numba's errors have colours if colorama is installed
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    reason = next((line for line in lines if not line.startswith(("Failed in", ">>>", "File "))), "no reason")
    call = next((line.removeprefix(">>> ") for line in lines if line.startswith(">>> ")), "")
    if call and reason.endswith("for signature:"):
        reason = f"no implementation of {call}"
    reason = re.sub(r"(of type \w+)\(.*", r"\1", reason)  # without the types of all fields
    causes = re.findall(r"specific error:\s+(?:\w+: )?(?!Poison)(.*)", message)
    cause = "" if not causes or causes[-1] in reason else f": {causes[-1]}"
    return (
        f"cannot be compiled: {_shortened(f'{reason}{cause}', _MAX_COMPILER_CHARS)}"
        f"{_location_in(message, path)}"
    )


def _location_in(message: str, path: Path | None) -> str:
    """The line in the file `path` where the compiler was, or else that of the method that it compiled."""
    if path is None:
        return ""
    found = re.search(rf'File "[^"]*{re.escape(path.name)}", line (\d+)', message)
    if found:
        return f" ({path.name}:{found.group(1)})"
    method = re.search(r"<function (?:\w+\.)*(\w+) at ", message)
    if method is not None and path.is_file():
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            if re.match(rf"\s*def {method.group(1)}\(", line):
                return f" ({path.name}:{number})"
    return f" ({path.name})"


def _shortened(text: str, max_chars: int) -> str:
    return text if len(text) <= max_chars else text[: max_chars - 3] + "..."
