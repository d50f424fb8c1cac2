"""Functions that only kernels call are linked into them, and not made ready to run by themselves.

numba optimises each function that it compiles, with all that it calls, and emits its machine code:
of a function five calls below a kernel six times over.  Here that is done once, with the kernel.
"""

from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering, NopythonRewrites


class LinkedLibrary(JITCodeLibrary):
    """The code of a function as numba writes it, with that of the functions that it calls."""

    def _optimize_final_module(self) -> None:
        """Leave that to the kernel."""

    def _finalize_final_module(self) -> None:
        """End the library without machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class LinkedLowering(NativeLowering):
    """Turns a function into code that goes into such a library."""

    _name = "linked_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower a function, and let others find it."""
        state.library = LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state.cr
        # stands for the function, which Python cannot call
        entry = _dynfunc.make_function(
            lowered.fndesc.lookup_module(),
            state.func_id.func_name,
            "",
            0,
            lowered.env,
            (state.library,),
        )
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state.cr = lowered._replace(cfunc=entry)
        return True


class Linked(CompilerBase):
    """The compiler of functions that only kernels call."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's passes, the lowering above among them.

        Without its rewrites of expressions of whole arrays, of which kernels have none.
        """
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (LinkedLowering if step is NativeLowering else step, text)
            for step, text in passes.passes
            if step is not NopythonRewrites
        ]
        passes.finalize()
        return [passes]
