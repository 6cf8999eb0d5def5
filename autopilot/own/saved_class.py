"""A class in a file of its own: no other process finds one of a notebook's cell, or of a function."""

from __future__ import annotations

import hashlib
import io
import pickle
import re
import sys
from pathlib import Path
from typing import Any

SUFFIX = ".pkl"
_TRACKER_ID = re.compile(rb"[0-9a-f]{32}")  # which cloudpickle draws for each class

_files: dict[type, Path] = {}  # of the classes that were loaded


def is_found_elsewhere(kind: type) -> bool:
    """Whether another process finds the class by its module and name."""
    return getattr(sys.modules.get(kind.__module__), "__file__", None) is not None and is_named(kind)


def is_named(kind: type) -> bool:
    """Whether its module has the class under its name."""
    found: Any = sys.modules.get(kind.__module__)
    for name in kind.__qualname__.split("."):
        found = getattr(found, name, None)
    return found is kind


def save_class(kind: type, folder: Path) -> Path:
    """Save a class with all that its methods use, except what they import from modules with a file; the same
    class as before keeps its file.

    The file is named by its content, and has the folders in which this process finds modules.
    `pickle.PicklingError` if something that the class uses cannot be saved, OSError if the folder cannot be
    written.
    """
    try:
        content = _pickled(kind)
    except Exception as error:  # of any kind, by the methods of what is pickled
        raise pickle.PicklingError(" ".join(str(error).split())) from error
    digest = hashlib.sha256(_TRACKER_ID.sub(b"", content)).hexdigest()[:12]
    path = folder.resolve() / f"{kind.__name__}-{digest}{SUFFIX}"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        folders = [str(Path(folder).resolve()) for folder in sys.path]
        path.write_bytes(pickle.dumps((folders, content)))
    return path


def _pickled(kind: type) -> bytes:
    import cloudpickle

    from autopilot.geometry.compiler import Kernel
    from autopilot.geometry.kernel import kernel

    class Pickler(cloudpickle.Pickler):  # type: ignore[misc]
        def reducer_override(self, obj: Any) -> Any:
            if not isinstance(obj, Kernel):
                return super().reducer_override(obj)
            function = obj.py_func
            module = sys.modules.get(function.__module__)
            if getattr(module, "__file__", None) and getattr(module, function.__name__, None) is obj:
                return function.__name__
            return kernel, (function,)

    with io.BytesIO() as file:
        Pickler(file).dump(kind)
        return file.getvalue()


def load_class(path: Path) -> type:
    """The class that `save_class` saved. ValueError if the file holds none; what its content raises."""
    saved = pickle.loads(path.read_bytes())
    if not isinstance(saved, tuple):
        raise ValueError("holds no class")
    folders, content = saved
    sys.path += [folder for folder in folders if folder not in sys.path]
    kind: type = pickle.loads(content)
    _files[kind] = path
    return kind


def saved_file(kind: type) -> Path | None:
    """The file from which a class was loaded; None for a class that was defined in this process."""
    return _files.get(kind)
