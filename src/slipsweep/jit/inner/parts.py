"""Functions that are compiled for the kernels that call them, and for nobody else.

A kernel has a copy of every function it calls, optimised for it.  What numba makes of a function
besides, so that it can be called by itself, is much of what the first run ever takes: a `_Part`
is compiled for its callers only.  Called from Python it is compiled once more, as any jitted function is.
What that saves is said at each step, in seconds of processor for the first `slipsweep run sweeps/paper.toml`
(of some 14; measured one after the other on a machine at work, ±0.3).
"""

import functools
from collections.abc import Callable
from typing import Any

from llvmlite.ir.values import FunctionAttributes
from numba import njit, types
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher

from slipsweep.jit.inner.need import need

need(
    JITCodeLibrary,
    add_ir_module="self ir_module",
    _finalize_final_module="self",
    _optimize_final_module="self",
    _finalize_dynamic_globals="self",
    _verify_declare_only_symbols="self",
    get_pointer_to_function="self name",
    codegen=None,
    _codegen=None,
    _final_module=None,
    _finalized=None,
)
need(JITCPUCodegen, _module_pass_manager="self kwargs", set_env="self env_name env")
need(Compiler, __init__="self typingctx targetctx library args return_type flags locals", define_pipelines="self")
need(DefaultPassBuilder, define_nopython_pipeline="state name")
need(PassManager, finalize="self", passes=None)
need(
    CPUDispatcher,
    __init__="self py_func locals targetoptions pipeline_class",
    compile="self sig",
    add_overload="self cres",
    get_call_template="self args kws",
    _numba_type_=None,
    overloads=None,
    _compiler=None,
)
need(CPUDispatcher.targetdescr.options, _nrt=None, no_cpython_wrapper=None, no_cfunc_wrapper=None)
need(types, unliteral="lit_type")
if not issubclass(FunctionAttributes, set):
    raise ImportError("attributes of llvmlite's functions are no set")

#: Passes of numba's compiler that find nothing to do here, and cost the most of those (0.6 s; eight others 0.1): no
#: closures, overloads to inline, array expressions or arguments that are None.  One that is gone is no loss.
_IDLE_PASSES = [
    getattr(module, name, None)
    for module, name in (
        (untyped_passes, "InlineClosureLikes"),
        (untyped_passes, "DeadBranchPrune"),
        (typed_passes, "InlineOverloads"),
        (typed_passes, "NopythonRewrites"),
    )
]


class WideLibrary(JITCodeLibrary):
    """Code that fills registers of 512 bits, where there are any.

    LLVM by itself fills half of them on Intel's processors, for the first that had them lowered their clock.  Seen: a
    cell of the design chart takes 0.85 of the time, with all results 0.8, and its kernel a sixth less to compile; a
    cosine's, with few such loops among other work, up to 1.15.
    """

    def add_ir_module(self, ir_module: Any) -> None:
        """As numba's."""
        for function in ir_module.functions:
            # not by their own `add`, which takes no attribute that has a value
            set.add(function.attributes, '"prefer-vector-width"="512"')
        super().add_ir_module(ir_module)


class _Library(WideLibrary):
    """Intermediate code of a part: no machine code, and of the optimisations numba's cheap passes only.

    The kernel has the rest; without any passes the kernels come out slower.  Machine code for the
    functions of `equations` and `elementary` alone took 0.7 s.
    """

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    @property
    def codegen(self) -> Any:
        return _Nowhere


class _Nowhere:
    """Where the environment of a function that has no machine code is put."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        pass


class _Compiler(Compiler):
    """numba's compiler, for functions that only jitted ones call."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *arguments: Any) -> None:
        super().__init__(typingctx, targetctx, _Library(targetctx.codegen(), "part"), *arguments)

    def define_pipelines(self) -> list[Any]:
        """The passes of numba's own pipeline but for the idle ones."""
        pipeline = PassManager("part")
        every = DefaultPassBuilder.define_nopython_pipeline(self.state).passes
        pipeline.passes.extend(one for one in every if one[0] not in _IDLE_PASSES)
        pipeline.finalize()
        return [pipeline]


class _Part(CPUDispatcher):
    """A jitted function that is compiled for the kernels that call it, and once more for Python."""

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict[str, Any] | None = None,  # numba's name, which unpickling hands over
        targetoptions: dict[str, Any] | None = None,
    ) -> None:
        inner = {
            "nopython": True,
            "boundscheck": None,
            # an array belongs to whoever makes it: to count references to it in what it is handed on to took
            # 1.0 s, and half the time of every walk over a wave (triangle, 1550 instead of 830 ns a cell).
            # numba refuses a function that makes an array in another way than these two
            "_nrt": not {"empty", "zeros"}.isdisjoint(py_func.__code__.co_names),
            "no_cpython_wrapper": True,
            "no_cfunc_wrapper": True,
        }
        super().__init__(py_func, locals or {}, (targetoptions or {}) | inner, pipeline_class=_Compiler)

    def compile(self, sig: Any) -> Any:
        """As numba's, but for the timers, of which each waits on those of all functions it is called by (0.2 s)."""
        args = tuple(sig)
        if args not in self.overloads:
            self.add_overload(self._compiler.compile(args, None))
        return self.overloads[args].entry_point

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """As numba's, but compiled once for all integers, not once for each constant that is handed in (0.8 s)."""
        if "literally" not in self.py_func.__code__.co_names:
            args = [types.unliteral(value) for value in args]
            kws = {name: types.unliteral(value) for name, value in kws.items()}
        return super().get_call_template(args, kws)


class _Named:
    """A part by its name, made when it is first compiled: a run that finds its kernels on disk makes none (20 ms)."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self._options = function, options

    def __reduce__(self) -> str:
        """It goes to other processes by its name, as functions do."""
        return self.py_func.__qualname__

    @functools.cached_property
    def _part(self) -> _Part:
        return _Part(self.py_func, targetoptions=self._options)

    @property
    def _numba_type_(self) -> Any:
        """The type by which numba knows it."""
        return self._part._numba_type_

    @functools.cached_property
    def _for_python(self) -> Callable[..., Any]:
        options = {name: self._options[name] for name in ("error_model", "fastmath")}
        jitted: Callable[..., Any] = njit(**options)(self.py_func)
        return jitted

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call from Python, for which it is compiled once more."""
        return self._for_python(*args, **kwargs)


def part(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """A function that kernels are made of, with options of `numba.njit`."""
    return _Named(function, {"error_model": "numpy", **options})
