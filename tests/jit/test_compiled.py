"""Machine code on disk: written once, shared by processes, and never in the way."""

import ast
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock
import llvmlite.binding
import numba
import numba.core.event as events
import numba.core.registry
import numpy as np
import pytest

from slipsweep.jit import cache as compiled
from slipsweep.jit import compiling, elsewhere, folders
from slipsweep.jit.decorators import scalar
from slipsweep.jit.elementary import exp, log
from slipsweep.jit.handed import call
from slipsweep.jit.sources import PACKAGE

#: A small kernel, so that compiling it takes a second; says what it gives and whether it was compiled here.
PROGRAM = """
import sys, warnings
warnings.simplefilter("error")
import numba.core.event as events
from slipsweep.jit.cache import Kernel
import numpy as np

def twice(values):
    total = 0.0
    for i in range(values.size):
        total += np.sin(values[i]) ** 2
    return total

with events.install_recorder("numba:compile") as recorder:
    result = Kernel(twice)(np.arange(100.0))
print(result.hex(), any(event.is_start for _, event in recorder.buffer))
"""

#: Cells of all regimes, with warnings for errors: none may reach a user.  Says every bit of the results.
SWEEP = """
import hashlib, warnings
warnings.simplefilter("error")
import numpy as np
import slipsweep
found = slipsweep.sweep(np.linspace(0, 15, 12), np.linspace(0.2, 0.9, 10), np.linspace(0.5, 13, 9), [1.0, 2.0])
print(*(hashlib.sha256(found[name].values).hexdigest() for name in found.data_vars))
"""


def start(program: str, cache: Path, **environment: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: "subprocess.Popen[str]") -> str:
    """What a process printed; it must have succeeded without a word on stderr."""
    output, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    return output


def files(cache: Path) -> list[Path]:
    """Kernels in a cache."""
    return sorted(path for path in cache.glob("*/*") if path.suffix != ".lock")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of its own for this process."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    folders.base.cache_clear()
    yield tmp_path / "cache"
    folders.base.cache_clear()


def double(value: float) -> float:
    return 2.0 * value


# -------------------------------------------------------------------------- many processes


def test_four_processes_compile_once(tmp_path: Path) -> None:
    outputs = [finish(process) for process in [start(PROGRAM, tmp_path / "cache") for _ in range(4)]]
    results, compiling = zip(*(output.split() for output in outputs), strict=True)
    assert len(set(results)) == 1
    assert sorted(compiling) == ["False"] * 3 + ["True"]
    assert len(files(tmp_path / "cache")) == 1
    assert finish(start(PROGRAM, tmp_path / "cache")).split() == [results[0], "False"]


def test_sweeps_at_once_on_an_empty_cache(tmp_path: Path) -> None:
    """The one that compiles computes the bits of those that load."""
    outputs = {finish(process) for process in [start(SWEEP, tmp_path / "cache") for _ in range(2)]}
    assert len(outputs) == 1
    kernels = files(tmp_path / "cache")
    assert len(kernels) == 2
    written = [path.stat().st_mtime_ns for path in kernels]
    assert {finish(start(SWEEP, tmp_path / "cache"))} == outputs
    assert [path.stat().st_mtime_ns for path in files(tmp_path / "cache")] == written


def test_a_process_that_dies_while_it_compiles_holds_up_nobody(tmp_path: Path) -> None:
    first = start(SWEEP, tmp_path / "cache")
    end = time.monotonic() + 60
    while not list((tmp_path / "cache").glob("*/*.lock")):
        assert time.monotonic() < end
        time.sleep(0.01)
    first.kill()
    first.communicate()
    assert finish(start(PROGRAM, tmp_path / "cache"))


# ------------------------------------------------------- functions that kernels are handed


def half_of(value: int) -> int:
    return value // 2


def third_of(value: int) -> int:
    return value // 3


def added_up(values: np.ndarray, part: int) -> int:
    total = 0
    for i in range(values.size):
        total += call(part, values[i])
    return total


def of_values(values: np.ndarray) -> tuple[int]:
    return (int(values[0]),)


@pytest.fixture
def compiled_here(cache: Path) -> Iterator[Callable[[], set[str]]]:
    """Gives the functions that this process has compiled so far."""
    with events.install_recorder("numba:compile") as recorder:
        yield lambda: {event.data["dispatcher"].__name__ for _, event in recorder.buffer if event.is_start}


@pytest.mark.parametrize("cores", [1, 2])
def test_a_kernel_is_compiled_elsewhere_beside_what_it_is_handed(
    cores: int, cache: Path, compiled_here: Callable[[], set[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(elsewhere, "cores", lambda: cores)
    kernel = compiled.Kernel(added_up)
    assert compiled.Handed(kernel, half_of, of_values)(np.array([7, 4, 2])) == 6
    assert ("added_up" in compiled_here()) == (cores == 1)
    assert [path.name.partition("-")[0] for path in files(cache)] == ["added_up", "half_of"]
    assert compiled.Handed(kernel, third_of, of_values)(np.array([7, 4, 2])) == 3
    assert [path.name.partition("-")[0] for path in files(cache)] == ["added_up", "half_of", "third_of"]


def test_what_else_the_kernel_is_expected_to_be_handed_is_compiled_with_it(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(elsewhere, "cores", lambda: 2)
    kernel = compiled.Kernel(added_up)
    halves, thirds = (compiled.Handed(kernel, one, of_values) for one in (half_of, third_of))
    for one in (halves, thirds):
        one.expect()
    assert halves(np.array([7, 4, 2])) == 6
    assert [path.name.partition("-")[0] for path in files(cache)] == ["added_up", "half_of", "third_of"]
    assert thirds(np.array([7, 4, 2])) == 3


@pytest.mark.skipif(os.name != "posix", reason="a script for a program")
def test_where_the_other_process_fails_the_kernel_is_compiled_here(
    cache: Path, compiled_here: Callable[[], set[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    other = tmp_path / "python"
    other.write_text("#!/bin/sh\nexit 1\n")
    other.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(other))
    monkeypatch.setattr(elsewhere, "cores", lambda: 2)
    assert compiled.Handed(compiled.Kernel(added_up), half_of, of_values)(np.array([7, 4, 2])) == 6
    assert "added_up" in compiled_here()


# ----------------------------------------------------------------- caches that are no good


def compilations(value: float) -> tuple[float, bool]:
    """What a new kernel gives, and whether numba had to compile it."""
    with events.install_recorder("numba:compile") as recorder:
        result = compiled.Kernel(double)(value)
    return result, any(event.is_start for _, event in recorder.buffer)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("damage", ["empty", "cut", "altered", "other", "unreadable", "folder"])
def test_a_damaged_file_is_compiled_anew(cache: Path, damage: str) -> None:
    assert compilations(2.0) == (4.0, True)
    assert compilations(2.0) == (4.0, False)
    (path,) = files(cache)
    content = path.read_bytes()
    if damage == "empty":
        path.write_bytes(b"")
    elif damage == "cut":
        path.write_bytes(content[:-100])
    elif damage == "altered":
        middle = len(content) // 2
        path.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    elif damage == "other":
        path.write_bytes(b"something else altogether" * 10)
    elif damage == "unreadable":
        path.chmod(0)
        if os.access(path, os.R_OK):
            pytest.skip("nothing is unreadable to this user")
    else:
        path.unlink()
        path.mkdir()
    assert compilations(2.0) == (4.0, True)
    if damage != "folder":
        assert compilations(2.0) == (4.0, False)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_of_what_a_kernel_was_made_of_only_names_are_kept(cache: Path) -> None:
    """numba would parse all of it when it loads the kernel, and looks up names in it only."""
    compilations(2.0)
    (path,) = files(cache)
    (_, kind, (machine_code, bitcode)), *_ = pickle.loads(path.read_bytes()[32:])
    kept = llvmlite.binding.parse_bitcode(bitcode)
    assert (kind, [*kept.functions]) == ("object", [])
    names = [one.name for one in kept.global_variables]
    assert any(name.startswith("_ZN08NumbaEnv") for name in names)
    assert any(name.startswith("_ZN7cpython") and name.encode() in machine_code for name in names)


def test_no_folder_to_write_in(tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.write_text("a file where the folder should be")
    assert compiled.cache_folder() is None
    assert compiled.Kernel(double)(2.0) == 4.0
    assert finish(start(PROGRAM, cache)).split()[1] == "True"


def test_a_full_disk(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled.cache_folder()

    def full(**options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(folders.tempfile, "NamedTemporaryFile", full)
    assert compiled.Kernel(double)(2.0) == 4.0
    assert files(cache) == []


@pytest.mark.parametrize(
    "error", [OSError(37, "No locks available"), NotImplementedError("no flock"), filelock.Timeout("lock")], ids=repr
)
def test_no_lock_to_be_had(cache: Path, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def refuse(self: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(filelock.FileLock, "acquire", refuse)
    assert compiled.Kernel(double)(2.0) == 4.0
    assert len(files(cache)) == 1


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes the POSIX way")
def test_a_temporary_folder_that_others_can_write_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folders.tempfile, "gettempdir", lambda: str(tmp_path))
    folder = folders._temporary_folder()
    assert folder == tmp_path / f"slipsweep-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    assert not folders._temporary_folder().is_dir()


def test_kernels_of_the_latest_versions_are_kept(cache: Path) -> None:
    others = [cache / f"slipsweep-{number:016x}" for number in range(6)]
    for age, folder in enumerate(others):
        folder.mkdir(parents=True)
        os.utime(folder, (1e9 - age, 1e9 - age))
    (cache / "slipsweep-mine").mkdir()
    assert compiled.Kernel(double)(2.0) == 4.0
    assert set(cache.glob("slipsweep-*")) == {compiled.cache_folder(), *others[:3], cache / "slipsweep-mine"}


# ------------------------------------------------------------------------------ in a process


def test_kernels_of_a_factory_are_told_apart(cache: Path) -> None:
    def times(factor: int) -> compiled.Kernel:
        def multiply(value: float) -> float:
            return factor * value

        return compiled.Kernel(multiply)

    for _ in range(2):
        assert [times(factor)(2.0) for factor in (2, 3)] == [4.0, 6.0]
    assert len(files(cache)) == 2


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_numba_is_left_as_it_was(cache: Path) -> None:
    """Also by a kernel that cannot be compiled."""
    from numba.core.cpu import CPUContext
    from numba.core.types.functions import Function
    from numba.core.typing.context import Context

    def methods() -> list[object]:
        return [
            Function.get_call_type,
            Context.load_additional_registries,
            CPUContext.load_additional_registries,
        ]

    before = methods()

    def sum_of_unlike(value: float) -> float:
        return value * 2.0 + "2"  # type: ignore[operator]

    assert compiled.Kernel(double)(2.0) == 4.0
    with pytest.raises(numba.TypingError):
        compiled.Kernel(sum_of_unlike)(2.0)
    assert methods() == before


@scalar
def unlike(x: float, unread: float, y: float) -> float:
    """Too long to be inlined, and one argument is not read: a kernel's copy of it takes two."""
    x = exp(x) + exp(0.1 * x) + exp(0.01 * x) + log(2.0 + x * x) + exp(-x) + log(3.0 + x)
    x = log(1.0 + x) + exp(0.2 * y) + log(4.0 + x) + exp(-0.3 * y)
    return log(1.0 + x) + exp(-0.2 * x) + log(4.0 + y) + exp(-0.3 * x)


def with_others(x: float, y: float) -> float:
    return unlike(x, 7.0, y) + unlike(y, 8.0, x) + unlike(x + y, 9.0, x)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_nobody_else_is_given_the_functions_of_a_kernel(cache: Path) -> None:
    """A function that numba compiles later has a copy of the same part, with all arguments."""
    found = compiled.Kernel(with_others)(0.5, 0.25)
    assert numba.njit(with_others)(0.5, 0.25) == pytest.approx(found, rel=1e-14)


def test_other_types_are_refused(cache: Path) -> None:
    kernel = compiled.Kernel(double)
    assert kernel(2.0) == 4.0
    with pytest.raises(TypeError):
        kernel(np.zeros(3))


def test_first_use_by_several_threads(cache: Path) -> None:
    compilations: list[Any] = []
    ready = compiled.Kernel._ready
    kernel = compiled.Kernel(double)

    def counting(args: tuple[Any, ...]) -> Any:
        compilations.append(args)
        return ready(kernel, args)

    kernel._ready = counting  # type: ignore[method-assign]
    results: list[float] = []
    threads = [threading.Thread(target=lambda: results.append(kernel(2.0))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [4.0] * 8
    assert len(compilations) == 1


def test_without_jit(tmp_path: Path) -> None:
    program = "from slipsweep.jit.cache import Kernel; print(Kernel(lambda x: x + 'b')('a'))"
    assert finish(start(program, tmp_path, NUMBA_DISABLE_JIT="1")) == "ab\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("by_another", [False, True])
def test_a_signal_while_llvm_calls_back_is_heard_after_it(
    cache: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals, by_another: bool
) -> None:
    """Raised in the callback itself, which LLVM makes for machine code made or loaded, it would be lost.

    The first machine code is the kernel's, or that of a function for which numba makes its own.
    """
    calls: list[str] = []

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    compiled.Kernel(lambda x: x + 1.0)(2.0)  # what numba itself makes at its first use is done
    other = numba.njit(lambda x: 2.0 * x)

    def doubled(x: float) -> float:
        return float(other(x))

    engine = numba.core.registry.cpu_target.target_context.codegen()._engine._ee

    def signalled(name: str) -> Any:
        called_back = getattr(engine, name)

        def call(*data: Any) -> Any:
            calls.append(name)
            if len(calls) == 1:
                signal.raise_signal(number)
            return called_back(*data)

        return call

    for name in ("_object_cache_notify", "_object_cache_getbuffer"):
        monkeypatch.setattr(engine, name, signalled(name))
    before = signal.signal(number, stopped)
    try:
        for known in (False, True):
            calls.clear()
            kernel = compiled.Kernel(doubled if by_another else double)
            with pytest.raises(KeyboardInterrupt):
                kernel(2.0)
            assert calls
            assert signal.getsignal(number) is stopped
            assert kernel(2.0) == 4.0, f"compiled before: {known}"
    finally:
        signal.signal(number, before)


def test_which_kernel_of_how_many_is_known_when_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_known", "_possible", "_begun"):
        monkeypatch.setattr(compiling, name, set())
    said: list[str | None] = []
    compiling.expect("lanes")
    compiling.expect("remaining", perhaps=True)
    with compiling.watched(said.append):
        for kernel in ("lanes", "remaining"):
            with compiling.compiling(kernel):
                pass
    assert said == ["1 of at most 2", None, "2 of 2", None]


def test_only_what_makes_arrays_names_what_makes_them() -> None:
    """A function with `empty` or `zeros` in it counts references: a field of that name made one twice as slow."""
    for path in sorted((PACKAGE / "kernels").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and node.attr in ("empty", "zeros"):
                assert isinstance(node.value, ast.Name), f"{path}, line {node.lineno}"
                assert node.value.id == "np", f"{path}, line {node.lineno}"
