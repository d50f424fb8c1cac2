"""Interrupted runs keep chunks, with which the same run may go on to the same result."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import slipsweep
from slipsweep.errors import InputError, RunError
from slipsweep.files import running, spec
from slipsweep.files.jobs import limit_job, sweep_job
from slipsweep.files.opening import read_result
from slipsweep.grid.plans import Plan
from tests.support.made_up_records import write_motion
from tests.support.stored_runs import WAVE, assert_same_result, job_of, run


def full_after(chunks: int) -> Callable[[int], None]:
    """Progress of a run at which the disk is full after some chunks."""
    left = chunks

    def progress(cells: int) -> None:
        nonlocal left
        left -= 1
        if left == 0:
            raise OSError(28, "No space left on device")

    return progress


@pytest.fixture
def solves(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Cells of each chunk that is solved from here on."""
    cells: list[int] = []
    solve = Plan.solve

    def counting(plan: Plan, *arguments: object) -> object:
        cells.append(plan.cells)
        return solve(plan, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Plan, "solve", counting)
    return cells


@pytest.fixture(params=["a[1].nc", "a[1].zarr"])
def interrupted(
    request: pytest.FixtureRequest, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """Output of a run of 24 chunks, of which three are kept."""
    monkeypatch.setattr(running, "CHUNK_CELLS", 6)
    path = folder / str(request.param)
    with pytest.raises(RunError, match="No space") as failure:
        run(job_of(folder, "sweep"), path, progress=full_after(3))
    kept = f"3 of 24 chunks are kept in {path}.part: --resume goes on"
    assert failure.value.__notes__ == [kept]
    return path


def test_an_interrupted_run_leaves_no_output(interrupted: Path) -> None:
    assert not interrupted.exists()


def test_a_run_over_chunks_of_another_is_refused(folder: Path, interrupted: Path) -> None:
    message = "part: has chunks of an interrupted run; give --resume to go on with them, or --ov"
    with pytest.raises(InputError, match=message):
        run(job_of(folder, "sweep"), interrupted)


def test_a_run_of_another_sweep_does_not_go_on(folder: Path, interrupted: Path) -> None:
    with pytest.raises(InputError, match="has chunks of another sweep file; go on with that one"):
        run(job_of(folder, "newmark"), interrupted, resume=True)


def test_another_version_does_not_go_on(
    folder: Path, interrupted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipsweep.files.jobs.__version__", "9.9")
    with pytest.raises(InputError, match="another version of slipsweep"):
        run(job_of(folder, "sweep"), interrupted, resume=True)


def test_chunks_whose_identity_cannot_be_read_stay(folder: Path, interrupted: Path) -> None:
    identity = Path(f"{interrupted}.part") / "identity.json"
    moved = identity.rename(folder / "moved.json")
    identity.mkdir()
    with pytest.raises(RunError, match="writing failed: Is a directory"):
        run(job_of(folder, "sweep"), interrupted, resume=True)
    identity.rmdir()
    moved.rename(identity)
    run(job_of(folder, "sweep"), interrupted, resume=True)
    assert interrupted.exists()


def test_chunks_without_an_identity_are_refused(folder: Path, interrupted: Path) -> None:
    (Path(f"{interrupted}.part") / "identity.json").unlink()
    with pytest.raises(InputError, match="has chunks that nothing identifies"):
        run(job_of(folder, "sweep"), interrupted, resume=True)


def test_a_resumed_run_solves_the_missing_chunks_and_writes_the_same_result(
    folder: Path, interrupted: Path, solves: list[int]
) -> None:
    report = run(job_of(folder, "sweep"), interrupted, resume=True)
    assert not report.was_complete
    assert len(solves) == 21
    run(job_of(folder, "sweep"), folder / "b.nc")
    assert_same_result(interrupted, folder / "b.nc")


def test_a_resumed_run_keeps_the_size_of_its_chunks(
    folder: Path, interrupted: Path, solves: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "CHUNK_CELLS", 2)  # as with workers
    run(job_of(folder, "sweep"), interrupted, resume=True)
    assert len(solves) == 21


@pytest.fixture(params=["a[1].nc", "a[1].zarr"])
def complete(request: pytest.FixtureRequest, folder: Path) -> Path:
    """Output of a run that is complete."""
    path = folder / str(request.param)
    run(job_of(folder, "sweep"), path)
    return path


def test_a_complete_run_is_found_and_not_solved_again(
    folder: Path, complete: Path, solves: list[int]
) -> None:
    assert run(job_of(folder, "sweep"), complete, resume=True).was_complete
    assert solves == []


def test_a_complete_run_of_another_sweep_is_not_taken_for_this(
    folder: Path, complete: Path
) -> None:
    with pytest.raises(InputError, match="is of another sweep or version; give --overwrite"):
        run(job_of(folder, "newmark"), complete, resume=True)


def test_a_complete_run_is_not_replaced_unasked(folder: Path, complete: Path) -> None:
    with pytest.raises(InputError, match="exists already; give --overwrite"):
        run(job_of(folder, "sweep"), complete)


def test_overwrite_replaces_a_complete_run(folder: Path, complete: Path) -> None:
    run(job_of(folder, "newmark"), complete, overwrite=True)
    assert read_result(complete).attrs["model"] == "newmark"


def test_overwrite_replaces_an_interrupted_run(folder: Path, interrupted: Path) -> None:
    run(job_of(folder, "newmark"), interrupted, overwrite=True)
    assert read_result(interrupted).attrs["model"] == "newmark"
    assert not list(folder.glob("*.part"))


#: Memory of a cell in a chunk: two copies of the default results, and 8 bytes.
CELL_BYTES = 2 * (8 + 8 + 1 + 2) + 8


@pytest.fixture
def interrupted_at_2400_cells(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Output of a run of three chunks, which fill the memory asked for; two are kept."""
    monkeypatch.setattr(running, "BASE_MEMORY", 0)
    monkeypatch.setattr(running, "CHUNK_CELLS", 100)  # without a limit; else cells fill the memory
    (folder / "sweep.toml").write_text(WAVE.replace("num = 4", "num = 400"))
    with pytest.raises(RunError, match="No space"):
        run(
            job_of(folder, "sweep"),
            folder / "a.nc",
            memory=2400 * CELL_BYTES,
            progress=full_after(2),
        )
    return folder / "a.nc"


def test_a_run_does_not_go_on_with_less_memory_than_its_chunks_take(
    folder: Path, interrupted_at_2400_cells: Path
) -> None:
    message = "larger chunks than fit into the memory asked for; give more --memory"
    with pytest.raises(InputError, match=message):
        run(
            job_of(folder, "sweep"),
            interrupted_at_2400_cells,
            resume=True,
            memory=1000 * CELL_BYTES,
        )


def test_a_run_goes_on_with_more_memory_in_chunks_of_the_same_size(
    folder: Path, interrupted_at_2400_cells: Path, solves: list[int]
) -> None:
    path = interrupted_at_2400_cells
    report = run(job_of(folder, "sweep"), path, resume=True, memory=7200 * CELL_BYTES)
    assert not report.was_complete
    assert solves == [2400]
    run(job_of(folder, "sweep"), folder / "b.nc", memory=7200 * CELL_BYTES)
    assert_same_result(path, folder / "b.nc")


def test_a_suite_of_other_motions_is_another_run(folder: Path) -> None:
    run(job_of(folder, "suite"), folder / "a.nc")
    (folder / "motions" / "m2.csv").rename(folder / "motions" / "m3.csv")
    with pytest.raises(InputError, match="another sweep or version"):
        run(job_of(folder, "suite"), folder / "a.nc", resume=True)


def test_a_suite_of_other_accelerations_is_another_run(folder: Path) -> None:
    run(job_of(folder, "suite"), folder / "a.nc")
    write_motion(folder / "motions" / "m2.csv", 5, 60, 0.02)
    with pytest.raises(InputError, match="another sweep or version"):
        run(job_of(folder, "suite"), folder / "a.nc", resume=True)


def test_other_steps_are_another_run(folder: Path) -> None:
    step = spec.load(folder / "step.toml")
    run(sweep_job(step), folder / "a.nc")
    finer = replace(step, solver=slipsweep.Step(steps_per_cycle=128))
    with pytest.raises(InputError, match="another sweep or version"):
        run(sweep_job(finer), folder / "a.nc", resume=True)


def test_other_bounds_of_limits_are_another_run(folder: Path) -> None:
    sweep = spec.load(folder / "sweep.toml")
    run(limit_job(sweep, [0.01], 8.0), folder / "a.nc")
    with pytest.raises(InputError, match="another sweep or version"):
        run(limit_job(sweep, [0.01], 9.0), folder / "a.nc", resume=True)
