"""Machine code of kernels on disk: a file for one kernel and one signature.

numba's own cache on disk will not do here.  Several processes that compile and save at the
same moment can crash each other (numba issues 4807 and 10128); a damaged file ends the
program; a file's time, which every installation changes, is taken for a change of its
content; and it looks only at the file of the outermost function, so that a changed equation
would not be noticed.
"""

import functools
import hashlib
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import llvmlite.ir
import numba
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import _nrt_python
from numba.core.serialize import dumps

from slipsweep.jit import folders
from slipsweep.jit.inner.need import need
from slipsweep.jit.interrupts import heard_later

need(NullCache, load_overload="self sig target_context", save_overload="self sig cres")
need(CompileResult, _reduce="self", library=None)
need(
    CompileResult,
    _rebuild="target_context libdata fndesc env signature objectmode lifted typeann reload_init referenced_envs",
)
need(CPUDispatcher, _cache=None)
need(CFunc, __init__="self pyfunc sig locals options pipeline_class", compile="self", address=None, _cache=None)
need(type(cpu_target), target_context=None)
need(_nrt_python, c_helpers=None)


class Disk(NullCache):
    """Where a dispatcher looks for machine code before it compiles: one file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel as numba wants it, or None."""
        _name_memory_functions()
        try:
            content = self.path.read_bytes()
            checksum, data = content[:32], content[32:]
            if hashlib.sha256(data).digest() != checksum:
                return None
            with heard_later():
                return CompileResult._rebuild(target_context, *pickle.loads(data))
        except Exception:  # not there, or of another make: whatever is wrong with it, it can be made anew
            return None

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keep a kernel that has been compiled."""
        # a full disk, or something in the kernel that holds in this process only: it runs all the same
        with suppress(Exception):
            if not cres.library.has_dynamic_globals:
                library, *others = cres._reduce()
                data = dumps((_names_only(library), *others))
                folders.write(self.path, hashlib.sha256(data).digest() + data)


@functools.cache
def _name_memory_functions() -> None:
    """Have machine code find all that it needs of numba: its memory functions, by their names.

    `rtsys.initialize`, which names them, compiles some more (17 ms), and `refresh`, which compiling calls, would bring
    whatever may be compiled, scipy's BLAS among it: 0.2 of the 0.85 s that a small run takes.
    """
    for name, address in _nrt_python.c_helpers.items():
        llvmlite.binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _names_only(library: tuple[str, str, tuple[bytes, bytes]]) -> tuple[str, str, tuple[bytes, bytes]]:
    """A library as numba keeps it, but of the code from which machine code was made nothing but the names.

    numba keeps that, too, to compile it into other functions, which nobody does with a kernel.  To parse it took 14 of
    the 500 ms of a small run, and it was two thirds of the file.
    """
    name, kind, (machine_code, bitcode) = library
    whole, names, byte = llvmlite.binding.parse_bitcode(bitcode), llvmlite.ir.Module(), llvmlite.ir.IntType(8)
    for group in (whole.functions, whole.global_variables):
        for one in group:
            if not one.is_declaration:
                llvmlite.ir.GlobalVariable(names, byte, one.name).initializer = llvmlite.ir.Constant(byte, 0)
    return name, kind, (machine_code, llvmlite.binding.parse_assembly(str(names)).as_bitcode())


def digest_of(function: Callable[..., Any], signature: Any) -> str:
    """Digest of all that the machine code of a kernel depends on, but for the sources (the folder's name)."""
    cells = function.__closure__ or ()
    parts = (
        function.__module__,
        function.__qualname__,
        dumps(tuple(cell.cell_contents for cell in cells)),  # the kernels of a factory differ in nothing else
        str(signature),
        cpu_target.target_context.codegen().magic_tuple(),  # processor
        (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__),
        (int(numba.config.OPT), bool(numba.config.BOUNDSCHECK), bool(numba.config.DEBUGINFO_DEFAULT)),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]
