"""How every kernel is compiled, and where its machine code is kept.

numba keys its disk cache by the file of the *outermost* function alone: after a change in a callee, or of a
constant from another module, it would go on serving the old machine code. Kernels are therefore kept in a
directory named by a hash over their own source file and all files of this project that it imports, directly
or not, so that a stale entry cannot be met and a change recompiles only what it can reach. Where the checkout
lies does not enter the hash: a second clone of the same source finds the machine code of the first.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import llvmlite.binding
import numba
from numba import _dynfunc, types
from numba.core import caching
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from platformdirs import user_cache_path

_ROOT = Path(__file__).resolve().parents[2]
_IMPORT = re.compile(
    rb"^\s*from\s+((?:autopilot|sitl|missions|gcs)[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)", re.MULTILINE
)
_NAME = re.compile(rb"\w+")
_CHOSEN_BY_USER = "NUMBA_CACHE_DIR" in os.environ

P = ParamSpec("P")
T = TypeVar("T")


@cache
def _source(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _packages(path: Path, root: Path) -> tuple[Path, ...]:
    """The files that make `path`, or what it lies in, packages of the project at `root`."""
    inside = [parent for parent in (path, *path.parents) if parent.is_relative_to(root)]
    return tuple(file for file in (parent / "__init__.py" for parent in inside) if file.is_file())


@cache
def _imported(path: Path, root: Path) -> frozenset[Path]:
    """Files below `root` that the file imports itself."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(_source(path)):
        base = root.joinpath(*module.decode().split("."))
        found.update(_packages(base, root))
        if base.is_dir():
            parts = (base / name.decode() for name in _NAME.findall(names))
            found.update(p for q in parts for p in (q.with_suffix(".py"), q / "__init__.py") if p.is_file())
        elif base.with_suffix(".py").is_file():
            found.add(base.with_suffix(".py"))
    if b"iter_modules(__path__)" in _source(path):  # a package that finds its modules by itself
        found.update(path.parent.glob("*.py"))
    return frozenset(found)


@cache
def sources_hash(path: Path, root: Path = _ROOT) -> str:
    """Hash of a source file and of all files of the project at `root` that it imports, directly or not."""
    seen, ahead = {path}, [path]
    while ahead:
        fresh = _imported(ahead.pop(), root) - seen
        seen |= fresh
        ahead += fresh
    digest = hashlib.sha256()
    for name, file in sorted((os.path.relpath(file, root), file) for file in seen):
        digest.update(name.encode() + b"\0" + _source(file) + b"\0")
    return digest.hexdigest()[:16]


def _folder(path: Path) -> Path:
    return user_cache_path("plumbline") / "kernels" / sources_hash(path)


class _ContentLocator:
    """Tells numba where the machine code of a function is kept: by the content of its sources alone.

    numba's own locators put the directory of the source file into the name: every clone would compile anew.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._path = Path(file)
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Any, file: str) -> _ContentLocator | None:
        """A locator of a function of this project; None for any other, and where nothing can be written."""
        if _CHOSEN_BY_USER or not Path(file).is_file() or not Path(file).resolve().is_relative_to(_ROOT):
            return None
        locator = cls(function, file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

    def ensure_cache_path(self) -> None:
        """Make the directory."""
        self.get_cache_path().mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> Path:
        """Directory of the machine code."""
        return _folder(self._path) / self._path.stem

    def get_source_stamp(self) -> str:
        """What must be unchanged for the machine code to be valid."""
        return sources_hash(self._path)

    def get_disambiguator(self) -> str:
        """Tells functions of one name in one file apart."""
        return str(self._line)


caching.CacheImpl._locator_classes.insert(0, _ContentLocator)


def is_compiled(path: Path) -> bool:
    """True if machine code of kernels in this source file is kept from an earlier run, as far as is known."""
    return _CHOSEN_BY_USER or _folder(path).is_dir()


class _Unlinked(JITCodeLibrary):  # type: ignore[misc]
    """What a kernel becomes inside of others: intermediate code, of which no machine code is made."""

    def finalize(self) -> None:
        """Nothing is linked in, or optimised: both is done once, where it ends up."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None of its functions has an address."""
        return 0

    def needed(self, seen: dict[Any, None]) -> None:
        """Gather all libraries that this one calls, directly or not, and itself."""
        if self in seen:
            return
        seen[self] = None
        for library in self._linking_libraries:
            if isinstance(library, _Unlinked):
                library.needed(seen)
            else:
                seen[library] = None


class _Linked(JITCodeLibrary):  # type: ignore[misc]
    """What Python calls, with all that it calls in turn."""

    def finalize(self) -> None:
        """Link everything in, optimise, and make machine code."""
        seen: dict[Any, None] = {}
        for library in self._linking_libraries:
            if isinstance(library, _Unlinked):
                library.needed(seen)
            else:
                seen[library] = None
        self._linking_libraries = list(seen)
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.linkonce_odr:
                function.linkage = "internal"
        options = llvmlite.binding.create_pipeline_tuning_options(speed_level=int(os.environ.get("SL","3")))
        options.inlining_threshold = int(os.environ.get("INL", "225"))
        options.loop_vectorization = os.environ.get("LV","1")=="1"
        options.slp_vectorization = os.environ.get("SLP","0")=="1"
        builder = llvmlite.binding.create_pass_builder(self._codegen._tm, options)
        passes = builder.getModulePassManager()
        passes.run(self._final_module, builder)
        if os.environ.get("TWICE"): passes.run(self._final_module, builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class _OuterLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of what Python calls."""

    _name = "outer_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower, with a library that links once."""
        state.library = _Linked(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of what kernels call, which ends before machine code."""

    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower, and make the result known to those who call it."""
        context = state.targetctx
        state.library = _Unlinked(context.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        key = _dynfunc.make_function(
            described.lookup_module(), described.qualname, "", 0, lowered.env, (state.library,)
        )
        context.insert_user_function(key, described, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's own pipeline with another end."""

    lowering: Any

    def define_pipelines(self) -> list[Any]:
        """The passes in order."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [
            (self.lowering if one is NativeLowering else one, text) for one, text in manager.passes
        ]
        manager.finalize()
        return [manager]


class _OuterCompiler(_Compiler):
    """The compiler of kernels that Python calls."""

    lowering = _OuterLowering


class _InnerCompiler(_Compiler):
    """The compiler of kernels that others call."""

    lowering = _InnerLowering


class _Inner(CPUDispatcher):  # type: ignore[misc]
    """A kernel as others call it: for numbers of any value, of whose literals nothing is made of its own."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """numba's own, with literal numbers taken for what they are."""
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], plain)


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function with two faces: one that Python calls, and one that kernels call.

    numba would make machine code, and wrappers for Python, of every function on the way to the one that is
    called, though all of them are inlined: two thirds of the time that compiling takes.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function, targetoptions=dict(_OPTIONS), pipeline_class=_OuterCompiler)
        inner = dict(_OPTIONS, no_cpython_wrapper=True, no_cfunc_wrapper=True)
        self.inner = _Inner(function, targetoptions=inner, pipeline_class=_InnerCompiler)
        self.enable_caching()

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self.inner)


_OPTIONS = {"nopython": True, "error_model": "numpy", "_nrt": False}
INSIDE = {"error_model": "numpy", "_nrt": False, "pipeline_class": _InnerCompiler}  # for what only kernels call

INLINED = dict(INSIDE, forceinline=True)  # the same, where less than a call is left of it


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile `function` to machine code with strict IEEE arithmetic and a disk cache.

    Fast-math stays off, so that CPython and machine code agree to the bit. Division by zero gives inf or nan
    as IEEE 754 says, in place of an exception.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled: Callable[P, T] = update_wrapper(_Kernel(function), function)
    return compiled
