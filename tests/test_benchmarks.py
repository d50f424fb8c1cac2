"""Every measurement still runs, and writes what it says, on a few cells."""

import gc
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

WRITES = {
    "report": ["report.md"],
    "roofline": ["roofline.md"],
    "large_sweeps": ["large_sweeps.md"],
    "records": ["records.md"],
    "paper_waveforms": ["paper_waveforms.md", "paper_waveforms.png"],
    "faults": ["faults.md"],
    "agreement": ["agreement.md"],
    "limits": ["limits.md"],
    "model_trends": ["experiments.md", "sensitivity.md", "model_trends.md"],
    "waveforms": ["waveforms.md"],
    "variables": ["variables.md"],
    "uncertainty": ["uncertainty.md"],
    "calibration": ["calibration.md"],
    "commits": ["commits.csv", "commits.png"],
    "steps": ["steps.md"],
    "model_choices": ["model_choices.md", "model_choices.png"],
    "speed_vs_error": [f"speed_vs_error.{kind}" for kind in ("csv", "nc", "md", "png")],
}

#: Half a minute of processes, clusters and compilation.
SLOW = ("large_sweeps", "faults", "commits", "steps")


@pytest.fixture(autouse=True)
def _from_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.mark.filterwarnings("ignore")  # of the packages compared with
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in WRITES],
)
def test_runs_and_writes(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "records":
        pytest.importorskip("pynewmarkdisp")  # of the extra `bench`
    # the outside solvers that compile take most of a minute
    monkeypatch.setitem(sys.modules, "diffrax", None)
    monkeypatch.setitem(sys.modules, "CyRK", None)
    # before each time that is taken, which means nothing here: 0.2 s for all that tests have made
    monkeypatch.setattr(gc, "collect", lambda: 0)
    monkeypatch.setattr(sys, "argv", [name, "--tiny", "--folder", str(tmp_path)])
    runpy.run_module(f"benchmarks.{name}", run_name="__main__")
    for file in WRITES[name]:
        assert (tmp_path / file).stat().st_size > 0, file


def test_other_waves_of_the_papers_peaks() -> None:
    """The table in benchmarks/results is what the program gives, and the tutorial quotes it."""
    from benchmarks import machine, paper_waveforms

    found = paper_waveforms.rows()
    written = (ROOT / "benchmarks" / "results" / "paper_waveforms.md").read_text(encoding="utf-8")
    assert machine.table(paper_waveforms.HEADER, found) in written
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8").split("## Other waves of the same peaks")[1]
    values = {name: cells for name, *cells in found}
    for name in ("sine − 0.3 of the third harmonic", "triangle", "sine", "square"):
        assert f"{values[name][0]} mm and {values[name][1]} m/s" in " ".join(text.split()), name
    assert f"({values['sine, ramps of 1 cycle'][2]} mm with ramps of one cycle)" in text


def test_the_sample_is_the_references() -> None:
    """A few cells of benchmarks/data/sample.csv, solved again."""
    from benchmarks import sample
    from tests.support.reference import solve

    for groups in sample.read().values():
        group = groups[-1]
        inputs = {name: float(values[0]) for name, values in group.inputs.items() if values[0] == values[0]}
        answer = solve(**inputs, model=group.model, cycles=1)  # type: ignore[arg-type]
        assert float(answer.permanent_displacement) == group.reference[0]
