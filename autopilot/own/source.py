"""A custom class: found by its file, by its module, or by an entry point.

my_law.py:MyLaw       the class of a file; `:MyLaw` may be left out if the file has only one such class
package.module:MyLaw  the class of a module
my-law                an entry point, of the group that the caller names
"""

from __future__ import annotations

import hashlib
import re
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from autopilot.own.interruption import is_interruption
from missions.nearest import did_you_mean
from missions.toml_files import of_another_kind

_OURS = Path(__file__).resolve().parents[1]
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LONGEST = 120  # most characters of an error that are reported
_LONGEST_COMPILER = 240  # the same for errors of the compiler, which name types before the reason


class OwnError(ValueError):
    """A custom class cannot be used; the text says where and why."""


def found_class(
    reference: str, group: str, suits: Callable[[type], bool], what: str, shipped: Sequence[str]
) -> type:
    """The class that a reference names. `suits` says whether a class can be meant, `what` is the kind in
    words, and `shipped` are the names of the shipped ones.

    OwnError if there is no such file, module, class or entry point, or if its module cannot be loaded.
    """
    place, _, name = reference.rpartition(":") if ":" in reference else (reference, "", "")
    if place.endswith(".py"):
        module, told = _of_file(place), place
    elif ":" in reference:
        module, told = _of_name(place), place
    else:
        return _of_entry_point(reference, group, what, shipped)
    if not name:
        every = [one for one in vars(module).values() if isinstance(one, type)]
        there = [one for one in every if one.__module__ == module.__name__]
        # a single class that does not suit is returned too: the caller says what it lacks
        own = [one for one in there if suits(one)] or (there if len(there) == 1 else [])
        if len(own) == 1:
            return own[0]
        named = f"has {', '.join(one.__name__ for one in own)}; name one" if own else f"has no {what}"
        raise OwnError(f"{told}: {named}, as {told}:{own[0].__name__ if own else 'MyLaw'}")
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [one.__name__ for one in vars(module).values() if isinstance(one, type) and suits(one)]
        known = f"; there is {', '.join(classes)}" if classes else ""
        raise OwnError(f"{told}: has no class {name}{known}")
    return found


def _of_file(place: str) -> ModuleType:
    path = Path(place).expanduser()
    if not path.is_file():
        raise OwnError(f"{place}: no such file")
    return _loaded(path.resolve(), place)


def _loaded(path: Path, told: str) -> ModuleType:
    # named by its content, so that a changed file is another module. It must be in `sys.modules` under its
    # name, by which records resolve their annotations
    name = f"{path.stem}_{hashlib.sha256(str(path).encode() + path.read_bytes()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise OwnError(f"{told}: is no Python file")
    module = module_from_spec(spec)
    sys.modules[name] = module
    folder = str(path.parent)
    sys.path.insert(0, folder)  # files beside it can be imported
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        raise OwnError(f"{told}: {blamed(error, path)}") from error
    finally:
        if folder in sys.path:
            sys.path.remove(folder)
    return module


def _of_name(place: str) -> ModuleType:
    if not _MODULE.fullmatch(place):
        raise OwnError(f"{place}: is no Python file (.py), and no name of a module")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # as for a program that is run from here
    try:
        return import_module(place)
    except BaseException as error:
        raise OwnError(f"{place}: {blamed(error, None)}") from error


def _of_entry_point(name: str, group: str, what: str, shipped: Sequence[str]) -> type:
    there = {point.name: point for point in entry_points(group=group)}
    if name not in there:
        known = "".join(f"{one}, " for one in (*shipped, *sorted(there)))
        known += "or " if known else ""
        beside = f"{name}.py"
        hint = f"did you mean {beside}? " if Path(beside).is_file() else of_another_kind(name, what)
        hint = hint or did_you_mean(name, (*shipped, *there))
        raise OwnError(f"{name!r}: no {what} of that name; {hint}must be {known}a file as my_law.py:MyLaw")
    try:
        found = there[name].load()
    except BaseException as error:
        raise OwnError(f"{name}: {blamed(error, None)}") from error
    if not isinstance(found, type):
        raise OwnError(f"{name}: {there[name].value} is no class")
    return found


def file_of(kind: type) -> Path | None:
    """The file in which a class is written; None if there is none."""
    module = sys.modules.get(kind.__module__)
    place = getattr(module, "__file__", None)
    return Path(place) if place else None


def digest_of(kind: type) -> str:
    """A hash of the file in which a class is written, and of all loaded modules in its folder and below."""
    path = file_of(kind)
    digest = hashlib.sha256()
    for file in sorted(_beside(path)) if path is not None else ():
        digest.update(file.relative_to(path.parent).as_posix().encode() + b"\0" + file.read_bytes())  # type: ignore[union-attr]
    return digest.hexdigest()[:16]


def _beside(path: Path) -> set[Path]:
    places = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    files = {Path(place) for place in places if isinstance(place, str) and place.endswith(".py")}
    return {path, *(file for file in files if file.is_file() and file.is_relative_to(path.parent))}


def blamed(error: BaseException, path: Path | None, entered: str = "") -> str:
    """One line about an error of user code written in the file `path`. It ends with file and line: the last
    place in the folder of that file, or else `entered`, the place that was to be entered, or else the last
    place of all.

    An exception that only interrupted the code, such as Ctrl-C, is raised again.
    """
    if is_interruption(error):
        raise error
    if type(error).__module__.startswith("numba"):
        return _told_of_compiler(str(error), path)
    said = " ".join(str(error).split())
    text = f"{type(error).__name__}: {_cut(said, _LONGEST)}" if said else type(error).__name__
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}:{error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    near = [one for one in frames if path is not None and _is_beside(path, one.filename)]
    if entered and not near:  # for example if an argument is missing
        return f"{text} ({entered})"
    last = near or [one for one in frames if not _of_importing(one.filename)]
    return f"{text} ({Path(last[-1].filename).name}:{last[-1].lineno})" if last else text


def _is_beside(path: Path, filename: str) -> bool:
    """Whether a file lies beside or below another, and belongs neither to Plumbline nor to a library."""
    file = Path(filename)
    theirs = not file.is_relative_to(_OURS) and "site-packages" not in file.parts
    return file == path or (theirs and file.is_relative_to(path.parent))


def _of_importing(filename: str) -> bool:
    return filename.startswith("<") or "importlib" in Path(filename).parts or filename == __file__


def _told_of_compiler(said: str, path: Path | None) -> str:
    """What the compiler cannot compile and why, and the place in the file `path`."""
    said = _COLOURS.sub("", said)  # numba's errors have colours if colorama is installed
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    why = next((line for line in lines if not line.startswith(("Failed in", ">>>", "File "))), "no reason")
    call = next((line.removeprefix(">>> ") for line in lines if line.startswith(">>> ")), "")
    if call and why.endswith("for signature:"):
        why = f"no implementation of {call}"
    why = re.sub(r"(of type \w+)\(.*", r"\1", why)  # without the types of all fields
    causes = re.findall(r"specific error:\s+(?:\w+: )?(?!Poison)(.*)", said)
    because = "" if not causes or causes[-1] in why else f": {causes[-1]}"
    return f"cannot be compiled: {_cut(f'{why}{because}', _LONGEST_COMPILER)}{_place_in(said, path)}"


def _place_in(said: str, path: Path | None) -> str:
    """The line in the file `path` where the compiler was, or else that of the method that it compiled."""
    if path is None:
        return ""
    found = re.search(rf'File "[^"]*{re.escape(path.name)}", line (\d+)', said)
    if found:
        return f" ({path.name}:{found.group(1)})"
    method = re.search(r"<function (?:\w+\.)*(\w+) at ", said)
    if method is not None and path.is_file():
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            if re.match(rf"\s*def {method.group(1)}\(", line):
                return f" ({path.name}:{number})"
    return f" ({path.name})"


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
