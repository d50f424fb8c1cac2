"""Suites in sweep files: what a run writes, chunks, kills, workers, that it repeats itself, and
what is refused.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, Suite, read_suite, sweep
from slipsweep.files import running, spec
from slipsweep.files.jobs import limit_job
from slipsweep.files.motions import read_embedded
from slipsweep.files.opening import read_result
from slipsweep.model.variables import DEFAULT_RECORD_RESULTS, MOTION_COORDINATES
from tests.studies.test_record_sweeps import assert_same_data, run
from tests.support.commands import command
from tests.support.made_up_records import write_motion

SWEEP = """
[excitation]
records = ["motions/*.csv"]
units = "g"
baseline = "mean"
polarity = "both"
[axes]
theta.values = [0, 5, 25]
mu_s.values = [0.1, 0.3]
amplitude = { values = [0.3, 0.6], units = "g" }
time_scale.values = [1, 2]
"""

SAMPLES = """
[excitation]
records = "motions"
units = "g"
[axes]
theta.values = [0, 5]
arias_intensity.values = [1, 4]
time_scale.values = [1, 2]
[uncertainty]
samples = 32
mu_s = { distribution = "uniform", loc = 0.1, scale = 0.2 }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sweep file and three motions of different lengths and intervals; the folder's name looks
    like a pattern.
    """
    folder = tmp_path / "site [a]*"
    (folder / "motions").mkdir(parents=True)
    for seed, (count, interval) in enumerate([(150, 0.01), (80, 0.02), (200, 0.005)]):
        write_motion(folder / "motions" / f"m{seed}.csv", seed, count, interval)
    (folder / "a.toml").write_text(SWEEP)
    return folder


def test_a_sweep_file_gives_what_python_gives(folder: Path) -> None:
    run(folder / "a.toml", folder / "a.nc")
    suite = read_suite(folder / "motions", units="g", baseline="mean")
    given: dict[str, Any] = {
        "amplitude": np.array([0.3, 0.6]) * 9.81,
        "time_scale": [1, 2],
        "polarity": "both",
    }
    expected = sweep([0, 5, 25], [0.1, 0.3], excitation=suite, **given)
    assert 0 < float(expected.permanent_displacement.max()) < 100
    with xr.open_dataset(folder / "a.nc", mask_and_scale=False) as result:
        assert result.permanent_displacement.dims == expected.permanent_displacement.dims
        assert result.motion.values.tolist() == ["m0", "m1", "m2"]
        for name in (*DEFAULT_RECORD_RESULTS, "motion_factor", *MOTION_COORDINATES):
            np.testing.assert_array_equal(result[name], expected[name], err_msg=name)
        np.testing.assert_array_equal(
            result.permanent_displacement.sel(motion="m1"),
            expected.permanent_displacement.sel(motion="m1"),
        )
    with read_result(folder / "a.nc") as file:
        kept = read_embedded(file, folder / "a.nc")
    assert isinstance(kept, Suite)
    assert kept.labels == suite.labels
    for one, other in zip(kept.components, suite.components, strict=True):
        assert one.attrs == other.attrs
        np.testing.assert_array_equal(one.times, other.times)
        np.testing.assert_array_equal(one.acceleration, other.acceleration)


@pytest.mark.parametrize("text", [SWEEP, SAMPLES, "pairs"])
def test_a_result_repeats_itself_without_the_motions(folder: Path, text: str) -> None:
    if text == "pairs":
        write_motion(folder / "motions" / "m3.csv", 4, 140, 0.01)
        pairs = '[["motions/m0.csv", "motions/m3.csv"], ["motions/m1.csv", "motions/m1.csv"]]'
        text = SWEEP.replace('["motions/*.csv"]', pairs)
        text += "azimuth.values = [0, 30, 90]\n"
    (folder / "a.toml").write_text(text)
    run(folder / "a.toml", folder / "a.nc")
    for path in (folder / "motions").iterdir():
        path.unlink()
    run(folder / "a.nc", folder / "b.nc")
    assert_same_data(folder / "a.nc", folder / "b.nc")
    assert spec.load(folder / "b.nc").recorded == spec.load(folder / "a.nc").recorded


def test_limits_of_a_suite(folder: Path) -> None:
    text = SWEEP.replace("[0.1, 0.3]", "[0.1]").replace("[0, 5, 25]", "[5]")
    job = limit_job(spec.parse(text, "a.toml", folder), [0.01, 0.1])
    running.run(job, folder / "l.nc", command="slipsweep limit a.toml")
    running.run(job, folder / "m.nc", command="slipsweep limit a.toml")
    assert_same_data(folder / "l.nc", folder / "m.nc")
    with xr.open_dataset(folder / "l.nc") as result:
        assert result.limit_amplitude.dims == (
            "theta",
            "mu_s",
            "time_scale",
            "polarity",
            "motion",
            "displacement",
        )
        assert result.limit_amplitude.notnull().any()


def test_info_and_export_show_the_motions(folder: Path) -> None:
    (folder / "motions" / "m4.csv").write_text((folder / "motions" / "m0.csv").read_text())
    done = command(folder, "run", "a.toml")
    assert "the same motion under several labels: m0, m4" in done.stdout
    lines = command(folder, "info", "a.nc").stdout.splitlines()
    assert [line.split()[:3] for line in lines[lines.index("motions, as recorded:") + 1 :][:4]] == [
        ["motion", "samples", "interval"],
        ["m0", "150", "0.01"],
        ["m1", "80", "0.02"],
        ["m2", "200", "0.005"],
    ]
    one = command(folder, "info", "a.nc", "--at", "polarity=1", "-d", "5cm")
    assert "permanent displacement (mm) over 4 motion x 1 polarity:" in one.stdout
    assert "median" in one.stdout.split()
    (folder / "b.toml").write_text(
        SAMPLES.replace("[uncertainty]", "[uncertainty]\nover = 'motion'")
    )
    assert command(folder, "run", "b.toml", "--quiet").returncode == 0
    with xr.open_dataset(folder / "b.nc") as samples:
        d, u = (float(samples[name].max()) for name in ("threshold", "displacement_quantile"))
    told = command(folder, "info", "b.nc", "-d", f"{d}m", "--at", "theta=5").stdout
    assert f"P(u > {d * 1000:g} mm)" in told
    assert f"{u * 1000:.3g}" in told
    assert command(folder, "export", "a.nc", "-o", "a.csv", "--quiet").returncode == 0
    header, row = (folder / "a.csv").read_text().splitlines()[:2]
    assert dict(zip(header.split(","), row.split(","), strict=True))["motion"] == "m0"
    assert "motion_pga (m s-2)" in header
    assert "sha256" not in header


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            '["motions/*.csv"]',
            '["motions/*.AT2"]',
            r"excitation\.records: motions/\*\.AT2: no file fits",
        ),
        ('["motions/*.csv"]', '["motions/*.csv"]\npairs = ["_NS"]', "excitation.pairs = "),
        (
            'records = ["motions/*.csv"]',
            'record = "motions/m0.csv"\npairs = ["a", "b"]',
            "excitation.pairs: only",
        ),
        ("time_scale.values", "frequency.values", "frequency: not allowed with a Suite"),
        ("time_scale.values", "pgv.values", "amplitude, pgv: must not both be given"),
    ],
)
def test_what_sweep_files_refuse(folder: Path, before: str, after: str, message: str) -> None:
    assert before in SWEEP
    (folder / "a.toml").write_text(SWEEP.replace(before, after))
    with pytest.raises(InputError, match=message):
        spec.load(folder / "a.toml").plan()
