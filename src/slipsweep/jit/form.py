"""How kernels are compiled: by numba's inner parts, or the plain way.

numba documents `njit`.  What this package asks for besides makes the first run half as long, waves twice as fast and
the last digits of all processes the same (`slipsweep.jit.inner`), but a new version of numba may lack it.  Then, or
where `SLIPSWEEP_PLAIN_NUMBA` is set, kernels are compiled the plain way (`slipsweep.jit.plain`): results are as right.
"""

import os
import warnings
from typing import Any

import numba

from slipsweep.jit import plain


def _chosen() -> tuple[Any, Any, Any]:
    if os.environ.get("SLIPSWEEP_PLAIN_NUMBA", "0") in ("", "0"):
        try:
            from slipsweep.jit.inner import kernels, parts
        except Exception as error:  # whatever is not as it was
            warnings.warn(
                f"numba {numba.__version__}: {error}; kernels are compiled the plain way, which takes longer",
                stacklevel=1,
            )
        else:
            return parts.part, kernels.compiled, kernels.compiled_apart
    return plain.part, plain.compiled, plain.compiled_apart


#: Decorates a function that kernels are made of, with options of `numba.njit`.
part: Any
#: Compiles a kernel, or loads it: from its function, the types of its arguments, the folder it is kept in, and what
#: to be within while it compiles.
compiled: Any
#: The same for a function that is handed to a kernel: from its signature, void.
compiled_apart: Any
part, compiled, compiled_apart = _chosen()
