"""Every measurement still runs, and writes what it says, on a few cells."""

import gc
import re
import runpy
import sys
from pathlib import Path

import matplotlib
import matplotlib.image
import pytest

import slipsweep

ROOT = Path(__file__).resolve().parent.parent

WRITES = {
    "report": ["report.md"],
    "speed_vs_error": ["speed_vs_error.csv", "engines.md", "speed_vs_error.png"],
    "records": ["records.md"],
    "record_times": ["record_times.md"],
    "large_sweeps": ["large_sweeps.md"],
    "faults": ["faults.md"],
    "calibration": ["calibration.md"],
    "model_trends": ["experiments.md", "sensitivity.md", "model_trends.md"],
    "limits": ["limits.md"],
    "compiling": ["compiling.md"],
    "both_ways": ["both_ways.md"],
    "strength": ["strength.md"],
    "linearisation": ["linearisation.md", "linearisation.png"],
}

#: Half a minute of processes, clusters and compilation.
SLOW = ("large_sweeps", "faults", "linearisation")


@pytest.mark.filterwarnings("ignore")  # of the packages compared with
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in WRITES]
)
def test_runs_and_writes(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "records":
        pytest.importorskip("pynewmarkdisp")  # of the extra `bench`
    monkeypatch.chdir(ROOT)
    # before each time that is taken, which means nothing here: 0.2 s for all that tests have made
    monkeypatch.setattr(gc, "collect", lambda: 0)
    monkeypatch.setattr(sys, "argv", [name, "--tiny", "--folder", str(tmp_path)])
    with matplotlib.rc_context():  # some of the packages compared with set a font
        runpy.run_module(f"benchmarks.{name}", run_name="__main__")
    matplotlib.use("agg")  # and choose a window to draw in
    for file in WRITES[name]:
        written = tmp_path / file
        kept = ROOT / "benchmarks" / "results" / file
        if written.suffix == ".png":
            assert matplotlib.image.imread(written)[..., :3].std() > 0.05
        elif written.suffix == ".csv":
            rows = written.read_text(encoding="utf-8").splitlines()
            assert rows[0] == kept.read_text(encoding="utf-8").splitlines()[0]
            assert len(rows) > 1
        else:
            headings = [heading for heading, *_ in tables(kept)]
            assert headings[0] == tables(written)[0][0]
            for heading, *cells in tables(written):
                assert heading in headings
                assert cells, f"{file}: {heading}"
                assert all(len(row) == len(heading) for row in cells), f"{file}: {heading}"


def tables(path: Path) -> list[list[list[str]]]:
    """The tables of a Markdown file: heading and rows of each, and their cells."""
    blocks = re.findall(r"(?:^\|.*\n)+", path.read_text(encoding="utf-8"), re.MULTILINE)
    lines_of_tables = []
    for block in blocks:
        heading, _, *rows = block.splitlines()
        lines_of_tables.append(
            [[cell.strip() for cell in row.split("|")[1:-1]] for row in (heading, *rows)]
        )
    return lines_of_tables


def test_solvers_agree_on_a_few_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["agreement", "--tiny", "--folder", str(tmp_path)])
    runpy.run_module("benchmarks.agreement", run_name="__main__")
    written = tables(tmp_path / "agreement.md")
    kept = tables(ROOT / "benchmarks" / "results" / "agreement.md")
    assert [heading for heading, *_ in written] == [heading for heading, *_ in kept]
    for heading, *rows in written:
        assert rows
        for row in rows:
            counts = dict(zip(heading, row, strict=True))
            assert counts["cells"] == counts["agreed"], row


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["Cell", "Chart", "Walk", "RecordedMotion", "StepByStep", "FirstUse"]
)
def test_tasks_whose_times_are_kept_run(name: str) -> None:
    """Those of asv_bench, which asv itself would report as failed."""
    task = runpy.run_path(str(ROOT / "asv_bench" / "benchmarks" / "speed.py"))[name]()
    parameters = getattr(task, "params", [])[:1]
    if hasattr(task, "setup"):
        task.setup(*parameters)
    (timed,) = [method for method in dir(task) if method.startswith(("time_", "track_"))]
    getattr(task, timed)(*parameters)


def test_other_waves_of_the_papers_peaks() -> None:
    """The tutorial quotes what a sweep gives of the stick-slip experiment."""
    harmonics = slipsweep.Harmonics((1.0, 0.3), (1, 3), (0.0, 180.0), cycles=5)
    waves = [harmonics, slipsweep.Triangle(5), slipsweep.Sine(5), slipsweep.Square(5)]
    text = (
        (ROOT / "docs" / "tutorial.md")
        .read_text(encoding="utf-8")
        .split("## Other waves of the same peaks")[1]
    )
    for wave in waves:
        result = slipsweep.sweep(
            5.0,
            0.38,
            3.55,
            1.8,
            yield_acceleration=0.59,
            decay_rate=2.70,
            delta_mu=0.09,
            excitation=wave,
        )
        moved = 1000 * result.permanent_displacement.item()
        quoted = f"{moved:.0f} mm and {result.peak_relative_velocity.item():.3f} m/s"
        assert quoted in " ".join(text.split()), wave


def test_the_sample_is_the_references() -> None:
    """A few cells of benchmarks/data/sample.csv, solved again."""
    from benchmarks import sample
    from tests.support.reference import solve

    for groups in sample.read().values():
        group = groups[-1]
        inputs = {
            name: float(values[0])
            for name, values in group.inputs.items()
            if values[0] == values[0]
        }
        answer = solve(**inputs, model=group.model, cycles=1)  # type: ignore[arg-type]
        assert float(answer.permanent_displacement) == group.reference[0]
