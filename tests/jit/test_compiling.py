"""Compiled kernels on disk: one process compiles, an old one is never served, and without a folder all still runs."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import platformdirs
import pytest

import slipsweep
from slipsweep.jit import compiling

PACKAGE = Path(slipsweep.__file__).parent

#: A kernel of its own, which says whether this process compiled it.
ONE = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from ofown import kernel_of_own
from slipsweep.jit import compiling
print(kernel_of_own(np.arange(6.0)), compiling.seconds > 0.0)
"""

MODULE = """
from slipsweep.jit.compiling import kernel
from slipsweep.jit.elementary import exp
@kernel
def kernel_of_own(values):
    total = 0.0
    for value in values:
        total += exp(value)
    return total
"""
TOTAL = np.exp(np.arange(6.0)).sum()

PARAMETERS = """
import slipsweep
found = slipsweep.friction_parameters(5.0, 0.38, 3.55, yield_acceleration=0.59)
print(round(float(found.limiting_acceleration), 3))
"""


def environment(tmp_path: Path, **others: str) -> dict[str, str]:
    (tmp_path / "ofown.py").write_text(MODULE)
    own = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return (
        own | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"} | others
    )


def run(code: str, env: dict[str, str], *arguments: str) -> str:
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout.strip()


def test_of_eight_processes_that_start_at_once_one_compiles_also_where_two_are_killed(
    tmp_path: Path,
) -> None:
    env = environment(tmp_path)
    command = [sys.executable, "-c", ONE, str(tmp_path)]
    running = [
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(8)
    ]
    while not (tmp_path / "cache").exists() and running[0].poll() is None:
        time.sleep(0.01)
    for one in running[:2]:
        one.kill()
    found = [one.communicate()[0].split() for one in running[2:]]
    assert all(one.returncode == 0 for one in running[2:])
    assert [float(value) for value, _ in found] == pytest.approx([TOTAL] * 6)
    assert sum(compiled == "True" for _, compiled in found) <= 1
    assert run(ONE, env, str(tmp_path)).endswith("False"), "it is kept"


def test_a_changed_equation_is_never_served_from_an_old_cache(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(PACKAGE, copy / "slipsweep")
    env = environment(tmp_path, PYTHONPATH=str(copy))
    assert run(PARAMETERS, env) == "4.431"
    equations = copy / "slipsweep" / "model" / "equations.py"
    before, formula, after = equations.read_text("utf-8").partition(
        "return (yield_acceleration + g * mu_s) /"
    )
    assert formula
    equations.write_text(before + formula.replace("+", "-") + after, "utf-8")
    assert run(PARAMETERS, env) == "-3.22"


@pytest.mark.skipif(os.name != "posix", reason="takes homes and rights away the POSIX way")
@pytest.mark.parametrize("why", ["no home", "a folder that others may write to", "no compilation"])
def test_without_a_folder_of_its_own_all_still_runs(tmp_path: Path, why: str) -> None:
    env = environment(tmp_path)
    if why == "no home":
        env.pop("HOME", None)
        env["XDG_CACHE_HOME"] = "/dev/null/no-folder"
    elif why == "no compilation":
        env["NUMBA_DISABLE_JIT"] = "1"
    else:
        folder = tmp_path / "cache" / "slipsweep"
        folder.mkdir(parents=True)
        folder.chmod(0o777)
    value, compiled = run(ONE, env, str(tmp_path)).split()
    assert float(value) == pytest.approx(TOTAL)
    assert (compiled == "True") == (why != "no compilation")
    assert not list((tmp_path / "cache").rglob("*.nbi"))


def test_old_versions_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda name: tmp_path / name)
    compiling.cache_folder.cache_clear()
    for number in range(9):
        (tmp_path / "slipsweep" / f"{number:016x}").mkdir(parents=True)
    (tmp_path / "slipsweep").chmod(0o700)
    folder = compiling.cache_folder()
    compiling.cache_folder.cache_clear()
    assert folder is not None
    assert folder.exists()
    assert len(list((tmp_path / "slipsweep").iterdir())) == 4
