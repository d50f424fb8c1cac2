"""Recorded motions in sweep files: what a run writes, that it repeats itself, chunks, and what is
refused.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, read_record, sweep
from slipsweep.files import running, spec
from slipsweep.files.jobs import sweep_job
from slipsweep.model.variables import DEFAULT_RECORD_RESULTS

SWEEPS = Path(__file__).parents[2] / "sweeps"

SWEEP = """
[excitation]
record = "motion.csv"
units = "g"
polarity = "both"
[axes]
theta.values = [0, 5, 25]
mu_s.values = [0.3, 0.4]
scale = { start = 0.5, stop = 3, num = 4 }
time_scale.values = [1, 2]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sweep file and the record it names, five seconds of the sample."""
    lines = (SWEEPS / "data" / "synthetic.csv").read_text().splitlines(keepends=True)
    (tmp_path / "motion.csv").write_text("time,acceleration\n" + "".join(lines[204:704]))
    (tmp_path / "a.toml").write_text(SWEEP)
    return tmp_path


def run(sweep: Path, path: Path, **options: Any) -> running.Report:
    return running.run(sweep_job(spec.load(sweep)), path, command="slipsweep run a.toml", **options)


def assert_same_data(one: Path, other: Path) -> None:
    """All variables are the same, as stored."""
    first, second = (xr.load_dataset(path, decode_cf=False) for path in (one, other))
    assert list(first.variables) == list(second.variables)
    xr.testing.assert_equal(first, second)
    names = {*first.attrs} - {"history"}
    assert {name: first.attrs[name] for name in names} == {
        name: second.attrs[name] for name in names
    }


def test_a_sweep_file_gives_what_python_gives(folder: Path) -> None:
    run(folder / "a.toml", folder / "a.nc")
    record = read_record(folder / "motion.csv", units="g")
    expected = sweep(
        [0, 5, 25],
        [0.3, 0.4],
        scale=np.linspace(0.5, 3, 4),
        time_scale=[1, 2],
        polarity="both",
        excitation=record,
    )
    assert 0 < float(expected.permanent_displacement.max()) < 100
    assert (expected.number_of_slips == -1).any()
    with xr.open_dataset(folder / "a.nc", mask_and_scale=False) as result:
        assert list(result.permanent_displacement.dims) == [
            "theta",
            "mu_s",
            "scale",
            "time_scale",
            "polarity",
        ]
        for name in DEFAULT_RECORD_RESULTS:
            np.testing.assert_array_equal(result[name], expected[name], err_msg=name)
            assert result[name].attrs.get("ancillary_variables") == (
                None if name == "validity" else "validity"
            )
        np.testing.assert_array_equal(result.record_acceleration, record.acceleration)
        np.testing.assert_array_equal(result.record_time, record.times)
        assert (
            result.attrs["record_sha256"]
            == hashlib.sha256((folder / "motion.csv").read_bytes()).hexdigest()
        )
        kept = {
            name: result.attrs[name]
            for name in ("record", "record_format", "record_units", "baseline")
        }
        assert kept == {
            "record": "motion.csv",
            "record_format": "csv",
            "record_units": "g",
            "baseline": "none",
        }


def test_a_result_repeats_itself_without_the_record(folder: Path) -> None:
    """What was taken off and converted before is not taken off or converted again."""
    (folder / "a.toml").write_text(SWEEP.replace('"both"', '"both"\nbaseline = "linear"'))
    run(folder / "a.toml", folder / "a.nc")
    (folder / "motion.csv").unlink()
    run(folder / "a.nc", folder / "b.nc")
    assert_same_data(folder / "a.nc", folder / "b.nc")
    with pytest.raises(
        InputError, match=r"a\.toml: excitation\.record: .*motion\.csv: cannot be read"
    ):
        spec.load(folder / "a.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"motion.csv"', '"no.csv"', "no.csv: cannot be read"),
        ('"both"', "0", "polarity = 0: must be 1, -1, a list of these, or 'both'"),
        ('record = "motion.csv"\n', "", "excitation.units: only beside excitation.record"),
        ("time_scale.values", "amplitude.values", "amplitude, scale: must not both be given"),
        ("time_scale.values", "frequency.values", "frequency: not allowed with a Record"),
        (
            "[axes]",
            '[output]\nvariables = ["sliding_mode"]\n[axes]',
            "variables = 'sliding_mode': must be",
        ),
    ],
)
def test_sweep_files_that_are_refused(folder: Path, old: str, new: str, message: str) -> None:
    assert old in SWEEP
    (folder / "a.toml").write_text(SWEEP.replace(old, new))
    with pytest.raises(InputError, match=r"a\.toml: ") as error:
        spec.load(folder / "a.toml").plan()
    assert message in str(error.value)
    assert "\n" not in str(error.value)
