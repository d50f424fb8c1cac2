"""Every measurement still runs, and writes what it says, on a few cells."""

import gc
import runpy
import sys
from pathlib import Path

import matplotlib
import pytest

import slipsweep

ROOT = Path(__file__).resolve().parent.parent

WRITES = {
    "report": ["report.md"],
    "speed_vs_error": ["speed_vs_error.csv", "engines.md", "speed_vs_error.png"],
    "records": ["records.md"],
    "large_sweeps": ["large_sweeps.md"],
    "faults": ["faults.md"],
    "calibration": ["calibration.md"],
    "model_trends": ["experiments.md", "sensitivity.md", "model_trends.md"],
    "agreement": ["agreement.md"],
    "limits": ["limits.md"],
    "compiling": ["compiling.md"],
}

#: Half a minute of processes, clusters and compilation.
SLOW = ("large_sweeps", "faults")


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
    for file in WRITES[name]:
        assert (tmp_path / file).stat().st_size > 0, file


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
        found = slipsweep.sweep(
            5.0,
            0.38,
            3.55,
            1.8,
            yield_acceleration=0.59,
            decay_rate=2.70,
            delta_mu=0.09,
            excitation=wave,
        )
        moved = 1000 * found.permanent_displacement.item()
        quoted = f"{moved:.0f} mm and {found.peak_relative_velocity.item():.3f} m/s"
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
