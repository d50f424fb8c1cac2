"""How the kernels' inner functions are compiled.

They are called from jitted code only: the wrappers that Python and C would call are left out (first
compilation 13.5 s instead of 16.3 s), and so is machine code of their own (`compiled.PartCompiler`).  Called
from Python they crash: the way in from there is `grid`, or a jitted function of one's own.
"""

import functools

from numba import njit

from slipsweep.compiled import PartCompiler

_inner = functools.partial(
    njit, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=PartCompiler
)

#: `contract` lets the compiler fuse a*b + c, `arcp` divide by g once; nothing that assumes
#: away NaN or infinity, which are results here.
scalar = _inner(fastmath={"contract", "arcp"})

#: The same for sums over quadrature nodes, whose order the compiler may then choose (SIMD).
summed = _inner(fastmath={"contract", "arcp", "reassoc", "nsz"})

#: The same for what stands in loops over cells: LLVM vectorises a loop only if everything
#: in it is inlined, which it does not do by itself with functions as long as these.
in_lanes = _inner(fastmath={"contract", "arcp"}, forceinline=True)
