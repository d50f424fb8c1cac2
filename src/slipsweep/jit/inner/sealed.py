"""Kernels in which no function can be replaced by one of the same name.

numba gives a kernel a copy of every function it calls, optimised for it (loops in SIMD, say), as a
weak symbol.  Where the process already has such a function, from compiling it by itself or from
another kernel, the linker would take that one instead.  It may differ in its roundings: last digits
would depend on whether a kernel was just compiled or loaded, and on what was loaded before.
"""

from collections.abc import Callable
from typing import Any

import llvmlite.binding
from numba import njit
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen, JitEngine
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target

from slipsweep.jit.inner.asked_once import asked_once
from slipsweep.jit.inner.need import need
from slipsweep.jit.inner.parts import WideLibrary
from slipsweep.jit.interrupts import heard_later

need(
    JITCodeLibrary,
    _optimize_final_module="self",
    enable_object_caching="self",
    _final_module=None,
)
need(JITCPUCodegen, _engine=None)
need(JitEngine, finalize_object="self")
need(Compiler, __init__="self typingctx targetctx library args return_type flags locals", compile_extra="self func")


class _Library(WideLibrary):
    """Machine code of a kernel with functions of its own.

    LLVM knows all their callers once they are internal: it drops arguments that nobody reads (a wave and a table of
    steps are a hundred words) and inlines what has one caller.  Seen: steps take 0.5 (32 a cycle) to 0.75 of the time,
    triangles 0.8, squares 0.65, the law under records 0.87; the sine's kernel some 0.4 s more to compile, of 12.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.linkonce_odr:
                function.linkage = "internal"
                # the linker still knows its name, and would give it, without those arguments, to others for theirs
                function.name += ".sealed"
        super()._optimize_final_module()


class _Compiler(Compiler):
    """numba's compiler, writing into such a library."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *arguments: Any) -> None:
        library = _Library(targetctx.codegen(), "kernel")
        library.enable_object_caching()
        super().__init__(typingctx, targetctx, library, *arguments)

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        with asked_once():
            return super().compile_extra(func)


def _hear_signals_later() -> None:
    """Have Ctrl-C and SIGTERM wait while this process's one engine makes machine code, whatever for.

    Beside a kernel numba makes a score of small functions for it, each with machine code of its own.
    """
    engine = cpu_target.target_context.codegen()._engine
    if "finalize_object" in vars(engine):
        return
    make = engine.finalize_object

    def finalize_object() -> None:
        with heard_later():
            make()

    engine.finalize_object = finalize_object


def sealed(function: Callable[..., Any]) -> Any:
    """A function as a kernel, to be compiled; runs without the GIL."""
    _hear_signals_later()
    return njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, pipeline_class=_Compiler)(function)


def sealed_apart(function: Callable[..., Any], signature: Any) -> Any:
    """A function that is handed to a kernel, to be compiled."""
    _hear_signals_later()
    types = (signature.args, signature.return_type)
    return CFunc(function, types, {}, {"error_model": "numpy"}, pipeline_class=_Compiler)
