"""Kernels compiled by numba's inner parts, or the plain way where one is missing."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from slipsweep.jit.inner.need import need

#: Takes each name that is relied on away from numba in turn, in a process of its own; says what came of it.
#: Names of classes are hidden from us only: numba itself, which uses most of them, would have renamed them.
TAKEN_AWAY = """
import ast, inspect, os, sys, types, warnings
from pathlib import Path
import numba
import numpy as np
import slipsweep.jit.inner
from slipsweep.jit.inner import kernels, parts
from slipsweep.jit.inner.need import NEEDED

def numba_alone():
    @numba.njit
    def inner(x):
        return x + 1.0
    @numba.njit
    def outer(values):
        return inner(values[0])
    return outer(np.array([1.0])) == 2.0

def imported():
    for path in Path(slipsweep.jit.inner.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("numba."):
                for alias in node.names:
                    yield sys.modules[node.module], alias.name

def without(owner, name):
    def renamed(one):
        make = vars(one).get("__init__")
        if not inspect.isfunction(make):
            return one
        code = make.__code__.replace(co_names=tuple("gone" if n == name else n for n in make.__code__.co_names))
        return type("Other", (), {"__init__": types.FunctionType(code, {}, closure=make.__closure__)})
    class Hiding(type(owner)):
        def __getattribute__(cls, asked):
            if asked == name:
                raise AttributeError(asked)
            if asked == "__mro__" and not hasattr(owner, name):  # one that a constructor sets
                return tuple(map(renamed, inspect.getmro(owner)))
            return super().__getattribute__(asked)
    return Hiding(owner.__name__, (owner,), {})

def take_away(owner, name):
    for module, alias in imported():
        if getattr(module, alias) is owner and inspect.isclass(owner):
            setattr(module, alias, without(owner, name))
            return
    for one in inspect.getmro(owner) if inspect.isclass(owner) else [owner]:
        if name in vars(one):
            delattr(one, name)

def ours():
    for name in [name for name in sys.modules if name.partition(".")[0] == "slipsweep"]:
        del sys.modules[name]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        from slipsweep.jit.cache import Kernel
        from slipsweep.jit.decorators import in_lanes, scalar
        @scalar
        def once(x):
            return x + 1.0
        @in_lanes
        def twice(x):
            return once(once(x))
        def kernel(values):
            return twice(values[0]) + once(values[1])
        found = Kernel(kernel)(np.array([1.0, 2.0]))
    return found == 6.0, [str(one.message) for one in caught]

assert numba_alone()  # what it imports when first used is imported
for owner, name in dict.fromkeys([*NEEDED, *imported()]):
    if inspect.ismodule(getattr(owner, name, None)):
        continue
    if child := os.fork():
        os.waitpid(child, 0)
        continue
    take_away(owner, name)
    try:
        outcome = ours()
    except Exception as error:
        outcome = type(error).__name__, ""
        try:
            alone = numba_alone()
        except Exception:  # nobody can do without what numba itself cannot do without
            alone = False
        if not alone:
            outcome = "numba needs it", ""
    print(f"{owner.__name__}.{name}", *outcome, sep="|", flush=True)
    os._exit(0)
"""


def run(program: str, cache: Path, **environment: str) -> str:
    """What a program prints."""
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), **environment},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=600,
    ).stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="takes names away in forks of one process")
def test_any_private_name_may_go(tmp_path: Path) -> None:
    """One warning, and kernels compiled the plain way that are right."""
    outcomes = [line.split("|") for line in run(TAKEN_AWAY, tmp_path, SLIPSWEEP_PLAIN_NUMBA="").splitlines()]
    tried = [outcome for outcome in outcomes if outcome[1] != "numba needs it"]
    assert len(tried) > 30
    for taken, right, messages in tried:
        name = taken.rpartition(".")[2]
        assert right == "True", taken
        assert messages[2:].startswith(f"numba {numba.__version__}: "), taken
        assert messages.count("compiled the plain way") == 1, taken
        assert name in messages, taken


class Owner:
    shared = 1

    def __init__(self) -> None:
        self.own = 2

    def method(self, first: int, second: int = 0) -> int:
        return first + second + self.own


def test_what_is_there_is_found() -> None:
    need(Owner, shared=None, own=None, method="self first second")


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"other": None}, "Owner has no other"),
        ({"other": "self"}, "Owner has no other"),
        ({"own": "self"}, "Owner has no own"),
        ({"method": "self first"}, r"Owner.method takes \(self first second\), not \(self first\)"),
    ],
)
def test_what_is_not_there_is_said(wanted: dict[str, str | None], message: str) -> None:
    with pytest.raises(ImportError, match=message):
        need(Owner, **wanted)


#: A small kernel; says what it gives, how it was compiled and how often.
KERNEL = """
import warnings
warnings.simplefilter("error")
import numba.core.event as events
import numpy as np
from slipsweep.jit import form
from slipsweep.jit.cache import Kernel
from slipsweep.jit.elementary import exp

def kernel(values):
    return exp(values[0])

with events.install_recorder("numba:compile") as recorder:
    found = Kernel(kernel)(np.array([1.0]))
print(found, form.part.__module__, len(recorder.buffer))
"""


def test_the_plain_way_when_asked_for(tmp_path: Path) -> None:
    """Without a word; compiled once, and what is kept of one way is not taken for the other's."""
    path = tmp_path / "program.py"  # of a file: else numba would not keep it
    path.write_text(KERNEL)

    def outcome(plain: str) -> list[str]:
        return run(f"import runpy; runpy.run_path({str(path)!r})", tmp_path, SLIPSWEEP_PLAIN_NUMBA=plain).split()

    for plain, module in ("0", "slipsweep.jit.inner.parts"), ("1", "slipsweep.jit.plain"):
        first, second = outcome(plain), outcome(plain)
        assert first[1] == second[1] == module
        assert first[2] != "0" == second[2]
        assert float(first[0]) == float(second[0]) == pytest.approx(math.e, rel=1e-15)
