"""Every plan, every way: in parts, in chunks, in folders, by workers, killed and gone on with, to the same bits."""

import functools
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np
import pytest
import xarray as xr

from slipsweep import Pair, Record, Step, Suite
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import chunk_lengths, grid_chunks, places
from slipsweep.runs import solving, store
from slipsweep.runs.jobs import Job, limit_job, sweep_job
from slipsweep.runs.stored import stored_table
from tests.support.commands import command as run
from tests.support.processes import TIMEOUT, workers

AXES = """
[axes.amplitude]
values = [1, 2, 4, 7, 11]
[axes.frequency]
values = [0.5, 1, 3]
"""

#: A short recorded motion, over blocks that are zipped; its sign and its time are dimensions.
RECORD = """
[excitation]
record = "short.csv"
polarity = "both"
[axes.time_scale]
values = [0.5, 1, 3]
"""
SHORT = Record.sampled(4.0 * np.sin(np.arange(40) ** 1.2 / 2.0), 0.05, "short.csv")
STRONG = "[axes.amplitude]\nvalues = [1, 2, 4, 7, 11]\n"

#: Rows after the frequency: what a chunk of some of them gives lies in many places of the file.
CASES = "".join(
    f'[[cases]]\nlabel = "no. {i}"\ntheta = {3 * i}\nmu_s = {0.3 + 0.075 * i:.3f}\nstructure_frequency = 2\n'
    for i in (0, 2, 4)
)

DRAWN = """
[uncertainty]
samples = 32
correlation = [["amplitude", "yield_acceleration", 0.4]]
[uncertainty.amplitude]
kind = "factor"
distribution = "lognorm"
s = 0.3
[uncertainty.yield_acceleration]
kind = "factor"
distribution = "lognorm"
s = 0.1
"""

#: Two inputs are one, as they are correlated; few enough samples that some rows have no variance.
SENSITIVE = DRAWN.replace("samples = 32", "samples = 16\nsensitivity = true")
SENSITIVE += '[uncertainty.mu_s]\nkind = "factor"\ndistribution = "lognorm"\ns = 0.05\n'

#: The frequency decides on the amplitude, and on the samples with it.
BY_DISPLACEMENT = AXES.replace("[1, 2, 4", "[0.1, 1, 4") + CASES + DRAWN
BY_DISPLACEMENT = BY_DISPLACEMENT.replace("amplitude", "displacement_amplitude")

#: No dimension but those that samples serve all of, and a parameter that is drawn alone.
SINGLE = f"[axes.mu_s]\nvalues = [0.4]\n{AXES}{DRAWN}[uncertainty.theta]\ndistribution = 'uniform'\n"

VARIABLES = '[output]\nvariables = ["permanent_displacement", "sliding_mode", "validity", "limiting_acceleration"]\n'

BLOCKS = CASES.replace("structure_frequency = 2\n", "")

POOLED = 'over = ["motion", "polarity"]\n'

#: Of each block there is a case for each motion and strength.
FEW_BLOCKS = BLOCKS.partition('[[cases]]\nlabel = "no. 4"')[0]


#: Motions of different lengths, and pairs of components.
SUITE = Suite((SHORT, Record.sampled(SHORT.acceleration[:25] * 1.5, 0.03, "other.csv")))
PAIRS = Suite((Pair(SHORT, Record.sampled(SHORT.acceleration[::-1], 0.05)), Pair(SHORT, SHORT)), ("a", "b"))
AZIMUTHS = "[axes.azimuth]\nvalues = [0, 20, 90]\n"
STRENGTHS = "[axes.pgv]\nvalues = [0.1, 0.4, 1.1]\n"


def recorded(text: str, record: Record | Suite = SHORT) -> spec.SweepSpec:
    """A sweep of the recorded motion, or of a suite."""
    key = "records" if isinstance(record, Suite) else "record"
    return spec.parse(RECORD.replace("record", key) + text, "a.toml", recorded=record)


PLANS: dict[str, Callable[[], Job]] = {
    "sweep": lambda: sweep_job(spec.parse(AXES + CASES + VARIABLES, "a.toml")),
    "samples": lambda: sweep_job(spec.parse((AXES + CASES + DRAWN).replace("structure_frequency = 2\n", ""), "a.toml")),
    "samples by displacement": lambda: sweep_job(
        spec.parse(BY_DISPLACEMENT.replace("structure_frequency = 2\n", ""), "a.toml")
    ),
    "single samples": lambda: sweep_job(spec.parse(SINGLE, "a.toml")),
    "sensitivity": lambda: sweep_job(spec.parse(AXES + BLOCKS + SENSITIVE, "a.toml")),
    "sensitivity by displacement": lambda: sweep_job(
        spec.parse(
            (AXES.replace("[1, 2, 4", "[0.1, 1, 4") + BLOCKS + SENSITIVE).replace(
                "amplitude", "displacement_amplitude"
            ),
            "a.toml",
        )
    ),
    "sensitivity of a record": lambda: sweep_job(recorded(STRONG + BLOCKS + SENSITIVE)),
    "limits": lambda: limit_job(spec.parse(AXES + CASES, "a.toml"), [0.001, 0.01, 0.1, 1.0]),
    "one limit": lambda: limit_job(spec.parse(AXES + CASES, "a.toml"), 0.02, 8.0),
    "record": lambda: sweep_job(recorded(STRONG + BLOCKS)),
    "samples of a record": lambda: sweep_job(recorded(STRONG + BLOCKS + DRAWN)),
    "limits of a record": lambda: limit_job(recorded(BLOCKS), [0.001, 0.1]),
    "suite": lambda: sweep_job(recorded(STRENGTHS + FEW_BLOCKS, SUITE)),
    "pairs": lambda: sweep_job(recorded(STRONG.replace("1, 2, 4, 7", "1, 4") + AZIMUTHS + FEW_BLOCKS, PAIRS)),
    "samples of a suite": lambda: sweep_job(
        recorded(STRENGTHS + FEW_BLOCKS + DRAWN.replace("amplitude", "pgv"), SUITE)
    ),
    "pooled samples of a suite": lambda: sweep_job(
        recorded(
            STRENGTHS + FEW_BLOCKS + DRAWN.replace("amplitude", "pgv").replace("samples", POOLED + "samples"), SUITE
        )
    ),
    "sensitivity of a suite": lambda: sweep_job(
        recorded(STRENGTHS + FEW_BLOCKS + SENSITIVE.replace("amplitude", "pgv"), SUITE)
    ),
    "limits of a suite": lambda: limit_job(recorded(FEW_BLOCKS, SUITE), [0.001, 0.1]),
}


def assert_part(plan: AnyPlan, chunk: dict[str, slice], found: Any, whole: Any) -> None:
    """A table of a chunk is the chunk of the table, bit for bit."""
    assert list(found.data_vars) == list(whole.data_vars) == list(plan.names)
    for name, one in whole.variables.items():
        part = found[name]
        expected = one.values[tuple(places(chunk, one.sizes).values())]
        assert (part.dims, part.values.dtype, part.values.shape) == (one.dims, one.values.dtype, expected.shape)
        assert part.values.tobytes() == np.ascontiguousarray(expected).tobytes(), (name, chunk)


@functools.cache
def solved(name: str) -> Any:
    """All results of a plan."""
    return PLANS[name]().plan.solve()


def cut_from(whole: Any) -> solving.Solved:
    """What gives chunks out of all results: single cells, which another test solves by themselves."""

    def part(chunk: dict[str, slice], one: Any) -> Any:
        return xr.Variable(one.dims, one.values[tuple(places(chunk, one.sizes).values())].copy(), one.attrs)

    def cut(plan: AnyPlan, missing: Any, progress: Any = None) -> Any:
        for number, chunk in missing.items():
            coords, results = (
                {name: part(chunk, one) for name, one in variables.items()}
                for variables in (whole.coords, whole.data_vars)
            )
            yield number, xr.Dataset(results, coords, whole.attrs)

    return cut


class Written(NamedTuple):
    """Where a run has written, alone in a folder, and what it reports; nothing may be changed there."""

    path: Path
    report: store.Report


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Written]:
    """Run a plan to its end, in one chunk or several; the tests share what it writes."""

    @functools.cache
    def run_to_its_end(name: str, cells: int | None = None, split: bool = False) -> Written:
        path = tmp_path_factory.mktemp("written") / "a.nc"
        solve = cut_from(solved(name)) if cells == 1 else solving.solve_here
        return Written(path, store.run(PLANS[name](), path, command="x", chunk_cells=cells, split=split, solved=solve))

    return run_to_its_end


@pytest.mark.parametrize("name", PLANS)
def test_parts_give_the_bits_of_the_whole(name: str) -> None:
    plan = PLANS[name]().plan
    whole = solved(name)
    empty = plan.template()
    assert [(one.dims, one.values.shape, one.values.dtype, one.attrs) for one in empty.data_vars.values()] == [
        (one.dims, one.values.shape, one.values.dtype, one.attrs) for one in whole.data_vars.values()
    ]
    assert empty.attrs == whole.attrs
    for most in (1, 4, 6, 20):
        for chunk in grid_chunks(plan.sizes, most, plan.together):
            part = plan.part(chunk)
            assert part.sizes == {dim: cut.stop - cut.start for dim, cut in chunk.items()}
            # as it is, and as a worker gets it
            assert_part(plan, chunk, part.solve(), whole)
        assert_part(plan, chunk, pickle.loads(pickle.dumps(part)).solve(), whole)


@pytest.mark.parametrize("name", PLANS)
def test_chunks_keep_together_what_is_solved_once(name: str) -> None:
    plan = PLANS[name]().plan
    assert {*plan.together} <= {*plan.sizes}
    lengths = chunk_lengths(plan.sizes, 12, plan.together)
    assert [lengths[dim] for dim in plan.together] == [plan.sizes[dim] for dim in plan.together]
    # progress counts all that there is to solve, once, whatever the chunks
    counted: list[int] = []
    for chunk in grid_chunks(plan.sizes, 12, plan.together):
        plan.part(chunk).solve(counted.append)
    assert sum(counted) == plan.cells


def stored(path: Path) -> dict[str, tuple[tuple[str, ...], bytes]]:
    """All variables of a file, as stored."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {name: (one.dimensions, np.asarray(one[...]).tobytes()) for name, one in file.variables.items()}


@pytest.mark.parametrize("cells", [1, 6, 20])
@pytest.mark.parametrize("name", PLANS)
def test_chunks_and_folders_give_what_one_piece_gives(written: Callable[..., Written], name: str, cells: int) -> None:
    plan = PLANS[name]().plan
    one = written(name)
    # of single cells one file alone: files of a folder are no others than those of 6 cells
    for found in (written(name, cells, split=split) for split in ((False,) if cells == 1 else (False, True))):
        # what several chunks have, as they lack a dimension, is counted once
        assert found.report.tally == one.report.tally
        assert_part(plan, {}, stored_table(plan, found.path, cells, plan.names), solved(name))
    assert stored(written(name, cells).path) == stored(one.path)


def stopped(job: Job, path: Path, after: int, **options: Any) -> None:
    """Interrupt a run after some chunks."""

    def solved(*arguments: Any) -> Any:
        for number, found in enumerate(solving.solve_here(*arguments)):
            if number == after:
                raise KeyboardInterrupt
            yield found

    with pytest.raises(KeyboardInterrupt) as caught:
        store.run(job, path, command="x", solved=solved, **options)
    assert caught.value.__notes__[0].startswith(f"{after} of ")


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("name", PLANS)
def test_an_interrupted_run_goes_on_to_the_same_bits(
    tmp_path: Path, written: Callable[..., Written], name: str, split: bool
) -> None:
    job = PLANS[name]()
    stopped(job, tmp_path / "a", 1, chunk_cells=6, split=split)
    numbers: list[int] = []

    def counted(*arguments: Any) -> Any:
        for found in solving.solve_here(*arguments):
            numbers.append(found[0])
            yield found

    store.run(job, tmp_path / "a", command="x", resume=True, split=split, solved=counted)
    assert numbers[0] == 1
    whole = written(name, 6, split=split).path
    for path in sorted(whole.iterdir()) if split else [whole]:
        assert stored(tmp_path / "a" / path.name if split else tmp_path / "a") == stored(path)


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("name", PLANS)
def test_what_is_complete_stays_as_it_is(written: Callable[..., Written], name: str, split: bool) -> None:
    job, (path, first) = PLANS[name](), written(name, 6, split=split)
    files = sorted(path.iterdir()) if split else [path]
    before = [(file.read_bytes(), file.stat().st_mtime_ns) for file in files]
    again = store.run(job, path, command="y", resume=True, split=split, solved=unsolved)
    assert (again.found, again.tally, first.found) == (True, first.tally, False)
    assert [(file.read_bytes(), file.stat().st_mtime_ns) for file in files] == before
    assert [entry.name for entry in path.parent.iterdir()] == ["a.nc"]
    table = stored_table(job.plan, path, again.chunk_cells, job.plan.names)
    assert_part(job.plan, {}, table, solved(name))


def unsolved(*arguments: Any) -> Any:
    """Solve nothing."""
    pytest.fail("has begun")


def test_what_is_complete_but_of_another_sweep_is_refused(tmp_path: Path) -> None:
    """By what differs; and so is what is not complete, or nothing of ours."""
    sweep = spec.parse(AXES + CASES, "a.toml")
    store.run(sweep_job(sweep), tmp_path / "a.nc", command="x")
    store.run(limit_job(sweep, 0.05), tmp_path / "l.nc", command="x")
    store.run(sweep_job(sweep), tmp_path / "split", command="x", chunk_cells=6, split=True)
    (tmp_path / "split" / "chunk-000001.nc").unlink()
    (tmp_path / "text.nc").write_text("text")
    (tmp_path / "cut.nc").write_bytes((tmp_path / "a.nc").read_bytes()[:-4000])
    other = spec.parse(AXES.replace("[0.5, 1, 3]", "[0.5, 1, 4]") + CASES, "a.toml")
    before = {path: path.read_bytes() for path in tmp_path.glob("*.nc")}
    for job, name, message in (
        (sweep_job(other), "a.nc", r"the sweep file differs: line 5 was 'values = \[0\.5, 1, 3\]'"),
        (sweep_job(sweep.with_solver(Step())), "a.nc", r"solver was Cycle\(\), is Step"),
        (limit_job(sweep, 0.05), "a.nc", "--displacement was none, is 0.05|solver was"),
        (limit_job(sweep, 0.06), "l.nc", r"--displacement was 0\.05, is 0\.06"),
        (limit_job(other, 0.05), "l.nc", r"\(the sweep file differs\)"),
        (sweep_job(sweep), "text.nc", "not a netCDF file"),
        (sweep_job(sweep), "cut.nc", "not a netCDF file, or a damaged one"),
    ):
        with pytest.raises(InputError, match=f"{name}: exists already, and is not the complete result.*{message}"):
            store.run(job, tmp_path / name, command="x", resume=True, solved=unsolved)
    with pytest.raises(InputError, match="it has 9 files of 10"):
        store.run(sweep_job(sweep), tmp_path / "split", command="x", resume=True, split=True, solved=unsolved)
    assert {path: path.read_bytes() for path in tmp_path.glob("*.nc")} == before
    # without --resume nothing is looked at
    with pytest.raises(InputError, match="exists already; give --overwrite"):
        store.run(sweep_job(sweep), tmp_path / "a.nc", command="x")


def test_commands_say_that_all_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(AXES + CASES)
    for arguments in (("run", "a.toml", "-o", "a.nc"), ("limit", "a.toml", "-d", "1cm", "-o", "l.nc")):
        assert main([*arguments, "--resume"]) == 0
        assert "complete already" not in capsys.readouterr().out
        assert main([*arguments, "--resume"]) == 0
        output = capsys.readouterr()
        assert f"{arguments[-1]}: complete already, by the same sweep; nothing was computed" in output.out
        assert output.err == ""
        assert main(list(arguments)) == 2
        assert "exists already; give --overwrite" in capsys.readouterr().err


def test_limits_go_on_with_the_same_question_only(tmp_path: Path) -> None:
    sweep = spec.parse(AXES + CASES, "a.toml")
    stopped(limit_job(sweep, 0.05), tmp_path / "a.nc", 1, chunk_cells=6)
    for other, message in (
        (limit_job(sweep, 0.06), r"--displacement was 0\.05, is 0\.06"),
        (limit_job(sweep, 0.05, 20.0), r"--maximum-amplitude was none, is 20"),
        (sweep_job(sweep), "--displacement was 0.05, is none"),
    ):
        with pytest.raises(InputError, match=message):
            store.run(other, tmp_path / "a.nc", command="x", resume=True)
    # the solver that a sweep names is none of the limits'
    store.run(limit_job(sweep.with_solver(Step()), 0.05), tmp_path / "a.nc", command="x", resume=True)


def test_chunks_of_what_takes_long_are_small() -> None:
    """No more than seconds of work are lost with a chunk, however much memory there is."""
    text = "[axes.theta]\nstart = 0\nstop = 9\nnum = 1000\n[axes.mu_s]\nvalues = [0.4]\n" + AXES + DRAWN
    plan = sweep_job(spec.parse(text.replace("samples = 32", "samples = 65536"), "a.toml")).plan
    # 65536 samples serve three frequencies
    assert solving.default_cells(plan) == 4_000_000 * 3 // 65536
    assert solving.cells_within(10**11, plan) == 4_000_000 * 3 // 65536
    # draws and a million samples are there whatever the chunks
    with pytest.raises(InputError, match=r"--memory = 400 MB: must be 4\d\d MB at least"):
        solving.cells_within(400 * 10**6, plan)
    limits = limit_job(spec.parse("[axes.theta]\nvalues = [1]\n[axes.mu_s]\nvalues = [0.4]\n" + AXES, "a"), 0.05).plan
    assert 4_000 < solving.default_cells(limits) < 40_000


# ------------------------------------------------------------------------------ command line

#: As large as it has to be to be killed in the middle.
LARGE = """
[axes.theta]
start = 0
stop = 20
num = 30
[axes.mu_s]
start = 0.3
stop = 0.9
num = 20
[axes.amplitude]
start = 0.5
stop = 14
num = 10
[axes.frequency]
values = [0.5, 1, 2]
"""

MOTIONS = f"""
[excitation]
records = "{(Path(__file__).parents[2] / "sweeps" / "data" / "suite").as_posix()}"
polarity = "both"
[axes.theta]
values = [0, 4, 8, 12, 16, 20]
[axes.mu_s]
start = 0.3
stop = 0.9
num = 10
[axes.pgv]
start = 0.1
stop = 2.0
num = 8
"""

COMMANDS = {
    "suite": (MOTIONS, ("run", "a.toml"), 30_000),
    "samples": (LARGE + DRAWN, ("run", "a.toml"), 4_000),
    "limits": (LARGE, ("limit", "a.toml", "-d", "1cm", "-d", "10cm"), 20_000),
}

#: A command with chunks of so many cells of the cycle solver, and time between them to be killed in.
SMALL = """
import sys, time
from slipsweep.grid import chunks
from slipsweep.runs.parts import Folder
chunks.CHUNK_CELLS = int(sys.argv[1])
add = Folder.add
def add_slowly(*arguments):
    add(*arguments)
    time.sleep(0.05)
Folder.add = add_slowly
from slipsweep.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture(scope="module")
def others() -> Iterator[str]:
    """A worker that all commands share; tests/runs/test_cluster.py has several at a time."""
    with workers(1) as address:
        yield address


@pytest.mark.skipif(os.name != "posix", reason="kills the POSIX way")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_goes_on_to_the_same_bits(tmp_path: Path, others: str, name: str) -> None:
    text, arguments, cells = COMMANDS[name]
    (tmp_path / "a.toml").write_text(text)
    expected = run(tmp_path, *arguments, "-o", "whole.nc")
    assert (expected.returncode, expected.stderr) == (0, "")
    journal = tmp_path / "a.nc.parts" / "journal"
    small = [sys.executable, "-c", SMALL, str(cells), *arguments, "-o", "a.nc"]
    with subprocess.Popen(small, cwd=tmp_path, stdout=subprocess.DEVNULL) as process:
        end = time.monotonic() + TIMEOUT
        while process.poll() is None and not (journal.exists() and journal.read_text().count("\n") > 2):
            assert time.monotonic() < end, "nothing happens"
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    refused = run(tmp_path, *arguments, "-o", "a.nc")
    assert (refused.returncode, "go on with --resume" in refused.stderr) == (2, True)
    # what is left is done by others
    done = run(tmp_path, *arguments, "-o", "a.nc", "--resume", "--scheduler", others)
    assert (done.returncode, done.stderr) == (0, "")
    assert stored(tmp_path / "a.nc") == stored(tmp_path / "whole.nc")
    assert not journal.parent.exists()
    # also of the counts, which are of all cells
    assert tallies(done.stdout) == tallies(expected.stdout)


def tallies(output: str) -> list[str]:
    """Lines of a summary but for those that tell times, names and sizes."""
    return [line for line in output.splitlines() if not line.endswith("/s") and ".nc" not in line]


@pytest.mark.parametrize("name", COMMANDS)
def test_memory_and_split_serve_every_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    text, arguments, cells = COMMANDS[name]
    Path("a.toml").write_text(text)
    monkeypatch.setattr("slipsweep.grid.chunks.CHUNK_CELLS", cells * 5)
    assert main([*arguments, "-q", "-o", "a.nc", "--memory", "1GB"]) == 0
    assert main([*arguments, "-q", "-o", "b", "--split"]) == 0
    assert len(list(Path("b").iterdir())) > 5
    with xr.open_dataset("a.nc") as whole:
        for path in Path("b").iterdir():
            with xr.open_dataset(path) as part:
                places = {dim: part[dim] for dim in part.dims}
                xr.testing.assert_identical(part.drop_attrs(), whole.sel(places).drop_attrs())


def test_chunks_of_limits_need_an_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(LARGE)
    for options, message in (
        (("--resume",), "--resume: needs -o OUT.nc"),
        (("--memory", "1GB", "-o", "a.png"), "--memory: needs -o OUT.nc"),
        (("--workers", "2"), "--workers: needs -o OUT.nc"),
        (("-o", "a.nc", "-o", "b.nc"), "b.nc: a second result, beside a.nc"),
        (("-o", "a.nc", "--resume", "--overwrite"), "--resume, --overwrite: --resume continues"),
    ):
        assert main(["limit", "a.toml", "-d", "1cm", *options]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.toml"]


# ----------------------------------------------------------------------- beyond double precision

HUGE = "[axes.theta]\nvalues = [0]\n[axes.mu_s]\nvalues = [0.4]\n"
STRONGER = '[model]\nfriction = "newmark"\n[axes.amplitude]\nvalues = [1, 2, 1e250]\n'
LONGER = "[axes.frequency]\nvalues = [1e-90, 1]\n"
FACTOR = "[uncertainty]\nsamples = 4\n[uncertainty.amplitude]\nkind = 'factor'\ndistribution = 'uniform'\nloc = 1\n"

LONG = Record(SHORT.times * 1e80, SHORT.acceleration, "long.csv")

#: Of which only the last cells have results that are no double, and what is then refused.
BEYOND: dict[str, tuple[Callable[[], Job], str]] = {
    "sweep": (
        lambda: sweep_job(spec.parse(HUGE + STRONGER + LONGER, "a.toml")),
        r"amplitude = 1e\+250, frequency = 1e-90: permanent_displacement is then no finite number",
    ),
    "record": (
        lambda: sweep_job(recorded(HUGE + STRONGER.replace("1e250", "1e200"), LONG)),
        "permanent_displacement is then no finite number",
    ),
    "samples": (
        lambda: sweep_job(spec.parse(HUGE + STRONGER + LONGER + FACTOR, "a.toml")),
        "no finite number",
    ),
    "limits": (
        lambda: limit_job(
            spec.parse(HUGE + STRONGER + LONGER + "[axes.yield_acceleration]\nvalues = [1, 1e200]\n", "a.toml"),
            1e-5, 1e250,
        ),
        "no finite number",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BEYOND)
def test_numbers_that_are_together_too_much_are_refused_before_anything_is_begun(tmp_path: Path, name: str) -> None:
    make, message = BEYOND[name]
    with pytest.raises(InputError, match=f"a.toml: .*{message}"):
        store.run(make(), tmp_path / "a.nc", command="x", chunk_cells=1, solved=unsolved)
    assert not list(tmp_path.iterdir())


def test_extreme_numbers_that_are_served_are_written(tmp_path: Path) -> None:
    text = HUGE + STRONGER.replace("1e250", "1e150") + LONGER.replace("1e-90", "1e-60")
    job = sweep_job(spec.parse(text, "a.toml"))
    assert not job.plan.is_ordinary
    store.run(job, tmp_path / "a.nc", command="x")
    assert_part(job.plan, {}, stored_table(job.plan, tmp_path / "a.nc", 1000, job.plan.names), job.plan.solve())
    for ordinary in PLANS.values():
        assert ordinary().plan.is_ordinary
