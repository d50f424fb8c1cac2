"""Compiled kernels on disk: a single process compiles, and no old kernel is served."""

import errno
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import platformdirs
import pytest

import slipsweep
from slipsweep.jit import compiling
from tests.support.no_locks import refusing_locks

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


#: Calls each kernel of the package, and prints which were compiled.
ALL = """
from slipsweep import Newmark, Record, Step, friction_parameters, simulate, sweep
from slipsweep.jit import compiling
names = []
compiling.announce = names.append
record = Record.sampled([0.0, 5.0, -5.0, 0.0], 0.1)
block = {"theta": 5.0, "mu_s": 0.4, "amplitude": 5.0, "frequency": 1.0}
shaken = {"theta": 5.0, "mu_s": 0.4, "excitation": record}
weakening = Newmark(strength="weakening")
rate = Newmark(strength="rate")
friction_parameters(5.0, 0.4, 5.0)
sweep(**block)
sweep(**shaken)
sweep(**shaken, model="newmark")
sweep(**block, excitation="triangle", model="newmark")
simulate(**block, model="newmark")
sweep(**block, solver="step")
sweep(**block, solver="step", model="newmark")
sweep(**block, solver="step", model=weakening, residual_mu=0.3, weakening_distance=0.1)
sweep(**block, solver="step", model=rate, fast_mu=0.3, rate_constant=10.0)
print(*names)
"""


def environment(tmp_path: Path, **others: str) -> dict[str, str]:
    (tmp_path / "ofown.py").write_text(MODULE)
    variables = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return (
        variables
        | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        | others
    )


#: Damages each file of a kernel in turn; prints what the kernel returns, and if it was compiled.
DAMAGED = """
import json
import sys
import warnings
from pathlib import Path
import numpy as np
sys.path.insert(0, sys.argv[1])
from ofown import kernel_of_own
from slipsweep.jit import compiling
function = kernel_of_own.__wrapped__
warnings.simplefilter("error")
def returned():
    before = compiling.seconds
    value = compiling.kernel(function)(np.arange(6.0))
    return value, compiling.seconds > before
def damages(content):
    half = len(content) // 2
    for length in (0, 1, half, len(content) - 1):
        yield content[:length]
    yield bytes(len(content))
    yield content[:half] + bytes(len(content) - half)
    yield b"\\x80\\x05garbage" * 100
    yield None
print(json.dumps(["whole", *returned(), *returned()]))
files = [*compiling.cache_folder().rglob("*.nb[ic]"), *compiling.cache_folder().glob("*.sha256")]
for path in files:
    for damage in damages(path.read_bytes()):
        path.unlink() if damage is None else path.write_bytes(damage)
        print(json.dumps([path.suffix, *returned(), *returned()]))
"""


def process(
    code: str,
    env: dict[str, str],
    *arguments: str,
    preexec_fn: Callable[[], None] | None = None,
) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(
        command, env=env, capture_output=True, text=True, check=False, preexec_fn=preexec_fn
    )
    assert done.returncode == 0, done.stderr
    return done


def limited() -> None:
    import resource  # which Windows does not have

    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, 1_000))


def run(code: str, env: dict[str, str], *arguments: str) -> str:
    done = process(code, env, *arguments)
    assert not done.stderr
    return done.stdout.strip()


def test_of_five_processes_that_start_at_once_one_compiles_also_where_two_are_killed(
    tmp_path: Path,
) -> None:
    env = environment(tmp_path)
    command = [sys.executable, "-c", ONE, str(tmp_path)]
    running = [
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(5)
    ]
    while not (tmp_path / "cache").exists() and running[0].poll() is None:
        time.sleep(0.01)
    for process in running[:2]:
        process.kill()
    outputs = [process.communicate()[0].split() for process in running[2:]]
    assert all(process.returncode == 0 for process in running[2:])
    assert [float(value) for value, _ in outputs] == pytest.approx([TOTAL] * 3)
    assert sum(compiled == "True" for _, compiled in outputs) <= 1
    assert run(ONE, env, str(tmp_path)).endswith("False"), "it is kept"


def test_a_later_process_compiles_no_kernel() -> None:
    sources = "".join(path.read_text("utf-8") for path in PACKAGE.rglob("*.py"))
    kernels = set(re.findall(r"^@kernel\ndef (\w+)", sources, re.MULTILINE))
    env = dict(os.environ)
    run(ALL, env)
    assert run(ALL, env) == ""
    kept = {
        path.name.split("-")[0].split(".")[-1] for path in compiling.cache_folder().rglob("*.nbc")
    }
    assert kernels <= kept


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


def test_a_kernel_whose_files_a_power_cut_left_empty_or_short_is_compiled_anew(
    tmp_path: Path,
) -> None:
    lines = run(DAMAGED, environment(tmp_path), str(tmp_path)).splitlines()
    rows = [json.loads(line) for line in lines]
    assert [row[0] for row in rows] == ["whole", *[".nbc"] * 8, *[".nbi"] * 8, *[".sha256"] * 8]
    for kind, value, compiled, again, compiled_again in rows:
        assert value == again == pytest.approx(TOTAL), kind
        assert compiled, kind
        assert not compiled_again, kind


@pytest.mark.parametrize("error", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_kernels_are_kept_where_the_file_system_has_no_locks(tmp_path: Path, error: int) -> None:
    env = environment(tmp_path)
    runs = [process(ONE, env, str(tmp_path), preexec_fn=refusing_locks(error)) for _ in range(2)]
    assert [run.stdout.split()[1] for run in runs] == ["True", "False"]
    assert [run.stderr for run in runs] == ["", ""]


@pytest.mark.skipif(os.name != "posix", reason="takes homes and rights away the POSIX way")
@pytest.mark.parametrize(
    ("why", "reason"),
    [
        ("no home", ": /dev/null"),
        ("a folder that others may write to", "/slipsweep: other users may write to it"),
        ("a full disk", "anew: File too large; NUMBA_CACHE_DIR sets another folder"),
        ("no compilation", ""),
    ],
)
def test_without_a_folder_of_its_own_all_still_runs_and_the_reason_is_said(
    tmp_path: Path, why: str, reason: str
) -> None:
    env = environment(tmp_path)
    if why == "no home":
        env.pop("HOME", None)
        env["XDG_CACHE_HOME"] = "/dev/null/no-folder"
    elif why == "no compilation":
        env["NUMBA_DISABLE_JIT"] = "1"
    elif why == "a folder that others may write to":
        folder = tmp_path / "cache" / "slipsweep"
        folder.mkdir(parents=True)
        folder.chmod(0o777)
    preexec_fn = limited if why == "a full disk" else None
    done = process(ONE, env, str(tmp_path), preexec_fn=preexec_fn)
    value, compiled = done.stdout.split()
    assert float(value) == pytest.approx(TOTAL)
    assert (compiled == "True") == (why != "no compilation")
    assert not list((tmp_path / "cache").rglob("*.nbi"))
    warning = "RunWarning: compiled kernels cannot be kept, and each process compiles them anew: "
    assert (warning in done.stderr) == bool(reason)
    assert reason in done.stderr


def test_old_versions_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda: tmp_path)
    compiling.cache_folder.cache_clear()
    for number in range(9):
        (tmp_path / "slipsweep" / f"{number:016x}").mkdir(parents=True)
    (tmp_path / "slipsweep").chmod(0o700)
    folder = compiling.cache_folder()
    compiling.cache_folder.cache_clear()
    assert folder.exists()
    assert len(list((tmp_path / "slipsweep").iterdir())) == 4
