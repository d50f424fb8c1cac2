"""How the functions that kernels are made of are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def part(*fastmath: str, **options: Any) -> Callable[[_Function], _Function]:
    """Return `numba.njit` with the options that all have.

    None of them assumes away NaN and infinity, which are results here.

    `forceinline` is always said: numba would take it from the function that is compiled just then,
    and with it hand it on to all that this calls.
    """
    common = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", *fastmath},
        "forceinline": False,
    }
    decorate: Callable[[_Function], _Function] = numba.njit(**(common | options))
    return decorate


#: Options of functions that only kernels call, which takes a quarter of the time to compile them:
#: Python cannot call them.  They allocate nothing, and count no references to arrays: those are
#: arguments of a kernel, which outlive it.
_INTERNAL = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}

#: A function that only kernels call.  `contract` lets the compiler fuse a*b + c, `arcp` divide by g
#: once.  Not `reassoc`: sums whose order the compiler chooses have other last bits in the process
#: that compiles than in those that load the kernel.
scalar = part("arcp", **_INTERNAL)

#: The same for what stands in loops over cells: LLVM vectorises a loop only if everything in it is
#: inlined, which it does not do by itself with functions as long as these.
inlined = part("arcp", forceinline=True, **_INTERNAL)

#: The same for a function with one caller and many callees.  numba links, optimises and emits all
#: that is below a function with each function above it.
single = part("arcp", inline="always", **_INTERNAL)

#: The same for elementary functions, which have no division to share.
elementary = part("nsz", forceinline=True)

#: Options of functions of Python that kernels compile.
_PLAIN = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "arcp"},
    **_INTERNAL,
}

#: An equation: a function of Python, which kernels compile like `inlined`.  So it may be passed to
#: them as a value, too.
equation: Callable[[_Function], _Function] = numba.extending.register_jitable(
    forceinline=True, **_PLAIN
)
registered = equation

#: The same for a long function, which is not inlined.  A kernel that has a compiled function, like
#: `scalar`, for a value is not kept on disk: numba would have to keep its address.
as_value: Callable[[_Function], _Function] = numba.extending.register_jitable(
    forceinline=False, **_PLAIN
)
