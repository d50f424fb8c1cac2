"""Runs of small sweeps, stored in files."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.files import running, spec
from slipsweep.files.jobs import Job, limit_job, sweep_job
from slipsweep.files.opening import read_result
from tests.support.made_up_records import write_motion

GRID = """
[axes]
theta.values = [0, 5, 10]
mu_s.values = [0.3, 0.5]
amplitude = {start = 0.1, stop = 1, num = 4, units = "g"}
"""

WAVE = GRID + "[axes.frequency]\nvalues = [0.5, 1, 2]\n"

#: A sweep file of each kind of study.
STUDIES = {
    "sweep": WAVE
    + """
[output]
variables = [
    "permanent_displacement",
    "newmark_displacement",
    "limiting_acceleration",
    "sliding_mode",
    "validity",
]
""",
    "newmark": WAVE + '[model]\nfriction = "newmark"\n',
    "step": WAVE
    + '[solver]\nmethod = "step"\nsteps_per_cycle = 64\n[excitation]\nwaveform = "triangle"\n',
    "cases": """
cases = [
    {label = "mild ± slope, wet", theta = 5, amplitude = 3},
    {label = "steep", theta = 25, amplitude = 5},
]
axes.mu_s.values = [0.3, 0.5, 0.7]
axes.frequency.values = [1, 2]
""",
    "record": GRID + '[excitation]\nrecord = "motions/m1.csv"\nunits = "g"\npolarity = "both"\n',
    "suite": GRID + '[excitation]\nrecords = ["motions/*.csv"]\nunits = "g"\n',
    "samples": WAVE
    + """
[uncertainty]
samples = 16
decay_rate = {distribution = "lognorm", s = 0.3, scale = 2.0}
""",
}


def write_studies(folder: Path) -> None:
    """Write two recorded motions, and a sweep file of every kind."""
    (folder / "motions").mkdir()
    write_motion(folder / "motions" / "m1.csv", 3, 80, 0.01)
    write_motion(folder / "motions" / "m2.csv", 4, 60, 0.02)
    for name, text in STUDIES.items():
        (folder / f"{name}.toml").write_text(text)


def job_of(folder: Path, study: str) -> Job:
    """Job of a sweep file of `folder`, or of limits of its sweep."""
    if study == "limits":
        return limit_job(spec.load(folder / "sweep.toml"), [0.01, 0.1], 8.0)
    return sweep_job(spec.load(folder / f"{study}.toml"))


def run(job: Job, path: Path | str, **options: Any) -> running.Report:
    """Solve a job and write its results."""
    return running.run(job, path, command="slipsweep run", **options)


def assert_same_result(path: Path | str, other: Path | str) -> None:
    """Assert that two files are identical but for the time and command of their runs."""
    results = [read_result(name).load().assign_attrs(history="") for name in (path, other)]
    xr.testing.assert_identical(*results)


def values_of(path: Path | str) -> dict[str, np.ndarray]:
    """Values of all results of a file, by their names."""
    return {str(name): result.values for name, result in read_result(path).data_vars.items()}
