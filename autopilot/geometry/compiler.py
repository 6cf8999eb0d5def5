"""numba's compiler in two variants: for kernels that Python calls, and for the functions that kernels call.

By default numba makes machine code and wrappers for Python for every function below the one that is called,
and counts references to every array that is passed on. Here a function inside a kernel is compiled only to
intermediate code; the outermost kernel links all of it once, as internal functions, so that LLVM inlines most
of them and optimises the whole. That compiles in less than half the time and runs twice as fast. References
are not counted: a kernel creates no arrays, and its caller holds those that it passes.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import cached_property
from typing import Any

import llvmlite.binding as llvm
from numba import _dynfunc, types
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic as _intrinsic

from autopilot.geometry import resolution  # noqa: F401 - what numba finds is found once from now on


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """numba's code library, whose intermediate code is parsed only when it is linked into other code: loading
    a kernel from the cache takes half the time."""

    _bitcode: bytes | None = None  # of a library loaded from the cache
    _parsed: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != "object":
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        machine_code, library._bitcode = data
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library

    @property
    def _shared_module(self) -> Any:
        if self._parsed is None and self._bitcode is not None:
            self._parsed = llvm.parse_bitcode(self._bitcode)
        return self._parsed

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._parsed = module

    def get_pointer_to_function(self, name: str) -> int:
        """The address of one of its functions; 0 if it has no function of that name."""
        if self._bitcode is None:
            return int(super().get_pointer_to_function(name))
        return int(self._codegen._engine.get_function_address(name))


JITCPUCodegen._library_class = _Library


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A function inside a kernel: intermediate code, from which no separate machine code is made."""

    def finalize(self) -> None:
        """Neither link nor optimise: both are done once, in the outermost kernel."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0: none of its functions has an address."""
        return 0

    def own_module(self) -> Any:
        """Its own functions, without the functions that they call."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """Its functions with all functions that they call, for code that numba compiles in its usual way."""
        whole = self.own_module().clone()
        for library in _required_libraries(self._linking_libraries):
            _link_in(whole, library)
        return whole


class _OuterLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A kernel that Python calls, with all functions that it calls in turn."""

    def finalize(self) -> None:
        """Link everything in, optimise, and make machine code."""
        for library in _required_libraries(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            _link_in(self._final_module, library)
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                # LLVM then knows all of its callers and can remove it after inlining
                function.linkage = llvm.Linkage.internal
        for variable in self._final_module.global_variables:
            if not variable.is_declaration and variable.linkage == llvm.Linkage.linkonce_odr:
                variable.linkage = llvm.Linkage.internal
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        builder = llvm.create_pass_builder(self._codegen._tm, options)
        builder.getModulePassManager().run(self._final_module, builder)


def _required_libraries(libraries: list[Any]) -> list[Any]:
    """These libraries and those that they need, each once and before the libraries that it needs: when LLVM
    links a library, it leaves out the functions that no code linked so far calls."""
    found: dict[Any, None] = {}

    def visit(library: Any) -> None:
        if library in found:
            return
        if isinstance(library, _InnerLibrary):
            for needed in library._linking_libraries:
                visit(needed)
        found[library] = None

    for library in libraries:
        visit(library)
    return list(reversed(found))


def _link_in(module: Any, library: Any) -> None:
    is_inner = isinstance(library, _InnerLibrary)
    module.link_in(library.own_module() if is_inner else library._get_module_for_linking(), preserve=True)


@register_pass(mutates_CFG=True, analysis_only=False)
class _OuterLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of a kernel that Python calls."""

    _name = "outer_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower into a library that is linked once."""
        state.library = _OuterLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of a function inside a kernel; it stops before machine code."""

    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower, and register the result for the functions that call it."""
        context = state.targetctx
        state.library = _InnerLibrary(context.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        descriptor = lowered.fndesc
        # a function without an address, because numba looks functions up by an object of this kind
        key = _dynfunc.make_function(
            descriptor.lookup_module(), descriptor.qualname, "", 0, lowered.env, (state.library,)
        )
        context.insert_user_function(key, descriptor, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's own passes with another lowering."""

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
    lowering = _OuterLowering


class _InnerCompiler(_Compiler):
    lowering = _InnerLowering


_OPTIONS = {"nopython": True, "error_model": "numpy", "_nrt": False}
# `INNER_OPTIONS` is for functions that only kernels call, `INLINE_OPTIONS` for those that are always inlined
_NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
INNER_OPTIONS: Any = {"error_model": "numpy", "_nrt": False, "pipeline_class": _InnerCompiler, **_NO_WRAPPERS}
INLINE_OPTIONS: Any = {**INNER_OPTIONS, "forceinline": True}


def intrinsic(function: Callable[..., Any]) -> Any:
    """numba's `intrinsic`, untyped for type checkers: kernels call the result without the first argument,
    which the compiler supplies."""
    return _intrinsic(function)


class _Inner(CPUDispatcher):  # type: ignore[misc]
    """A kernel as other kernels call it."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """As numba's own, but without a separate version for each literal number that is passed."""
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], plain)


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function with two interfaces: one for Python, whose machine code is cached, and one for
    other kernels. Python never calls most kernels: their cache is then not looked up."""

    def __init__(self, function: Any, cache_of: Callable[[Any], Any], nogil: bool = False) -> None:
        self._disk_cache: Any = None
        self._cache_of = cache_of
        options = dict(_OPTIONS, nogil=nogil)
        super().__init__(function, targetoptions=options, pipeline_class=_OuterCompiler)

    @cached_property
    def _inner(self) -> _Inner:
        """The interface for other kernels, made only when something is compiled: a few hundred are slow."""
        inner = dict(_OPTIONS, **_NO_WRAPPERS)
        return _Inner(self.py_func, targetoptions=inner, pipeline_class=_InnerCompiler)

    def compile(self, sig: Any) -> Any:
        """As numba's own, but without garbage collection meanwhile, which takes a tenth of the time."""
        gc_was_enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if gc_was_enabled:
                gc.enable()

    @property
    def _cache(self) -> Any:
        if self._disk_cache is None:
            self._disk_cache = self._cache_of(self.py_func)
        return self._disk_cache

    @_cache.setter
    def _cache(self, blank: Any) -> None:
        """Ignore the cache that keeps nothing, which numba's constructor sets."""

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self._inner)
