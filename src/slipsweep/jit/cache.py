"""Kernels: jitted functions that are compiled once, kept on disk and shared by processes.

* A kernel that is compiled is kept in a folder, whose name is a digest of all sources that kernels are made of
  (`slipsweep.jit.sources`).  Folders of the four latest versions are kept, older ones removed when a kernel is
  compiled.
* The first process to need a kernel compiles it under a lock, the others wait and load.
  Where there is no lock to be had (some network folders) each compiles for itself.
* Where no folder can be written, kernels are compiled in memory.
* What solves the cells of a tile may be compiled apart from the kernel that brings them (`Handed`): the two at the
  same time in two processes, where there are two processors.

`slipsweep.jit.form` says how they are compiled.  `NUMBA_CACHE_DIR` moves the folder, as it does for numba;
`NUMBA_DISABLE_JIT` is honoured.
"""

import contextlib
import functools
import os
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numba

from slipsweep.jit import compiling, elsewhere, folders, form, plain, sources
from slipsweep.jit.frames import with_room
from slipsweep.jit.garbage import no_collections

#: Versions whose kernels are kept.
_KEPT_FOLDERS = 4

#: Held over the first use of any kernel in this process.
_first_use = threading.RLock()
if hasattr(os, "register_at_fork"):
    # no fork in the middle of a first use: the child would inherit locks that no thread of it can release.
    # LLVM's own lock, taken also when another thread's compilation is cleared away, is out of reach here:
    # a process that forks beside threads that compile can still hang, as with numba itself
    os.register_at_fork(
        before=_first_use.acquire, after_in_parent=_first_use.release, after_in_child=_first_use.release
    )


def cache_folder() -> Path | None:
    """Folder of the compiled kernels, or None where no folder can be written."""
    base = folders.base()
    if base is None:
        return None
    folder = base / f"slipsweep-{sources.keys().machine_code}"
    with contextlib.suppress(OSError):
        folder.mkdir(exist_ok=True)
        return folder
    return None


class ToMake(NamedTuple):
    """A function and the types of its arguments, and in which way of `slipsweep.jit.form` it is compiled."""

    how: Callable[..., Any]
    function: Callable[..., Any]
    signature: Any


class Kernel:
    """A jitted function that is compiled, or loaded from disk, when first called.

    Parameters
    ----------
    function : callable
        Python function to compile; runs without the GIL.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._dispatcher: Callable[..., Any] | None = None
        self._expected = False
        #: What it is expected to be handed.
        self.handed: list[Handed] = []

    def __call__(self, *args: Any) -> Any:
        """Run on `args`; their types must be those of the first call."""
        if self._dispatcher is None:
            with _first_use:
                if self._dispatcher is None:
                    self._dispatcher = self._ready(args)
        return self._dispatcher(*args)

    def expect(self, perhaps: bool = False) -> None:
        """Say that the kernel will be called, or `perhaps`: if it is not kept, it counts among those to be compiled."""
        if self._dispatcher is None and not self._expected and not numba.config.DISABLE_JIT:
            self._expected = True  # a small sweep takes no longer than to look for it on disk
            if not _is_kept(self._function):
                compiling.expect(self, perhaps)

    def _ready(self, args: tuple[Any, ...]) -> Callable[..., Any]:
        if numba.config.DISABLE_JIT:
            return self._function
        folder = cache_folder()
        jitted = make(self._what(args), folder, compiling.compiling(self))
        # a call with other types is a bug here, and would compile unseen
        jitted.disable_compile()
        if folder is not None:
            folders.keep_latest(_KEPT_FOLDERS, f"slipsweep-{'[0-9a-f]' * 16}", folder)
        return jitted

    def _what(self, args: tuple[Any, ...]) -> ToMake:
        return ToMake(form.compiled, self._function, _types(args))

    @contextlib.contextmanager
    def compiled_elsewhere(self, args: tuple[Any, ...], others: Sequence[ToMake] = ()) -> Iterator[None]:
        """Have another process compile it for such arguments, and others, while the block runs, unless it is kept."""
        folder = cache_folder()
        if self._dispatcher is not None or folder is None or _is_kept(self._function):
            yield
            return
        with elsewhere.begun(make_all, [self._what(args), *others], folder) as wait:
            yield
            with compiling.compiling(self):
                wait()


class Handed:
    """A kernel that is handed the address of a function, which `slipsweep.jit.handed` calls.

    Neither waits for the other: where there are two processors, another process compiles the kernel meanwhile, and the
    other functions that it is expected to be handed, for several share a kernel.

    Parameters
    ----------
    kernel : Kernel
        What the function is handed to, as its last argument.
    function : callable
        Python function to compile; returns an integer.  Its name, under which machine code from another process is
        found, is that of no other.
    arguments : callable
        Gives, of the kernel's arguments, some of the types of the function's.
    """

    def __init__(self, kernel: Kernel, function: Callable[..., int], arguments: Callable[..., tuple[Any, ...]]) -> None:
        self._kernel, self._function, self._arguments = kernel, function, arguments
        self._compiled: Any = None

    def __call__(self, *args: Any) -> Any:
        """As `Kernel`."""
        if self._compiled is None:
            with _first_use:
                if self._compiled is None:
                    self._compiled = self._ready(args)
        return self._kernel(*args, self._compiled.address)

    def expect(self, perhaps: bool = False) -> None:
        """As `Kernel.expect`."""
        if self._compiled is None and self not in self._kernel.handed:
            self._kernel.handed.append(self)
            self._kernel.expect(perhaps)
            if not _is_kept(self._function):
                compiling.expect(self, perhaps)

    def _ready(self, args: tuple[Any, ...]) -> Any:
        others = [one._what(args) for one in self._kernel.handed if one is not self and one._compiled is None]
        with self._kernel.compiled_elsewhere((*args, 0), others):
            return make(self._what(args), cache_folder(), compiling.compiling(self))

    def _what(self, args: tuple[Any, ...]) -> ToMake:
        signature = numba.types.int64(*_types(self._arguments(*args)))
        return ToMake(form.compiled_apart, self._function, signature)


def _types(args: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(numba.typeof(arg) for arg in args)


def _is_kept(function: Callable[..., Any]) -> bool:
    folder = cache_folder()
    return folder is not None and folders.has(folder, function)


def make(what: ToMake, folder: Path | None, compiling: contextlib.AbstractContextManager[None] | None = None) -> Any:
    """Compile a function for some types, or load it."""
    with warnings.catch_warnings(), no_collections():
        # numba's advice is for us, not for those who run a sweep
        warnings.simplefilter("ignore", numba.NumbaWarning)
        try:
            within = compiling or contextlib.nullcontext()
            return with_room(lambda: what.how(what.function, what.signature, folder, within))
        except Exception as error:
            if form.compiled is not plain.compiled:
                error.add_note("SLIPSWEEP_PLAIN_NUMBA=1 in the environment compiles by what numba documents alone")
            raise


def make_all(what: list[ToMake], folder: Path) -> None:
    """Compile functions, to be kept in a folder."""
    for one in what:
        make(one, folder)
