"""`slipsweep limit --of`: what it prints, its files, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import slipsweep
from tests.support.commands import command

G = 9.81

SWEEP = """
[model]
friction = "newmark"
[excitation]
records = ["sweeps/data/suite/rock-*.AT2"]
polarity = "both"
[axes.theta]
values = [5]
[axes.mu_s]
values = [0.3]
[axes.amplitude]
values = [0.2, 0.4]
units = "g"
"""

UNCERTAIN = """
[uncertainty]
samples = 64
over = ["motion"]
[uncertainty.time_scale]
distribution = "lognorm"
s = 0.2
[uncertainty.yield_coefficient]
distribution = "lognorm"
s = 0.1
kind = "factor"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sweep file, one of uncertain inputs, and the motions."""
    place = tmp_path_factory.mktemp("strength")
    (place / "sweeps").symlink_to(Path(__file__).parents[2] / "sweeps")
    (place / "suite.toml").write_text(SWEEP)
    (place / "uncertain.toml").write_text(SWEEP + UNCERTAIN)
    return place


@pytest.fixture(scope="module")
def expected() -> xr.Dataset:
    suite = slipsweep.read_suite("sweeps/data/suite/rock-*.AT2")
    return slipsweep.required_strength(
        ["20mm", "50mm"], [0.2 * G, 0.4 * G], excitation=suite, polarity="both"
    )


def test_file_and_table_have_the_quantiles_of_the_suite(folder: Path, expected: xr.Dataset) -> None:
    """Of a sweep file or of its result, at once or in chunks: what Python gives."""
    assert command(folder, "run", "suite.toml", "-q", "-o", "suite.nc").returncode == 0
    sources = (("suite.toml", "one.nc", ()), ("suite.nc", "two.nc", ("--memory", "700MB")))
    for source, result, options in sources:
        displacements = ("-d", "50mm", "-d", "2cm", "--of", "yield_coefficient")
        done = command(folder, "limit", source, *displacements, "-o", result, *options)
        assert (done.returncode, done.stderr) == (0, "")
        assert "32 required strengths (2 amplitude x 2 displacement x 2 polarity x 4 motion)" in (
            done.stdout
        )
        lines = done.stdout.splitlines()
        headings = [" ".join(line.split()) for line in lines if line.endswith("always  never")]
        assert headings == ["16 % median 84 % always never"]
        rows = [line.split() for line in lines if line.startswith("amplitude =")]
        assert [" ".join(words[:-5]) for words in rows] == [
            f"amplitude = {pga}, displacement = {length}"
            for pga in (0.2, 0.4)
            for length in (0.02, 0.05)
        ]
        quantiles = expected.required_yield_coefficient_quantile.values.reshape(4, 3)
        printed = np.array([[float(word) for word in words[-5:-2]] for words in rows])
        np.testing.assert_allclose(printed, quantiles, rtol=6e-4)
        assert [words[-2:] for words in rows] == [["0", "0"]] * 4
        with slipsweep.open_result(folder / result) as table:
            for name in expected.data_vars:
                np.testing.assert_array_equal(table[name], expected[name], err_msg=str(name))
            about = table.required_yield_coefficient.attrs
            assert about["ancillary_variables"] == "required_status"
            meanings = table.required_status.attrs["flag_meanings"]
            assert meanings == "solved always_within never_within"
            counts = "always_within_count never_within_count"
            about = table.required_yield_coefficient_quantile.attrs
            assert about["ancillary_variables"] == counts


def test_friction_angle_of_the_sweeps_inclination(folder: Path) -> None:
    done = command(folder, "limit", "suite.toml", "-d", "5cm", "--of", "phi", "-o", "phi.nc")
    assert (done.returncode, done.stderr) == (0, "")
    with slipsweep.open_result(folder / "phi.nc") as table:
        suite = slipsweep.read_suite("sweeps/data/suite/rock-*.AT2")
        result = slipsweep.sweep(
            theta=table.theta,
            phi=table.required_phi.load(),
            amplitude=table.amplitude,
            excitation=suite,
            polarity="both",
            model="newmark",
        )
        np.testing.assert_allclose(result.permanent_displacement, 0.05, rtol=1e-9)
        assert float(table.required_phi.min()) > 5.0


def test_uncertain_inputs_of_a_sweep_file(folder: Path) -> None:
    """Quantiles over samples, motions and polarities together; of both ends of the sweep file."""
    options = ("-d", "5cm", "--of", "yield_coefficient", "-o", "samples.nc", "-o", "samples.svg")
    done = command(folder, "limit", "uncertain.toml", *options)
    assert (done.returncode, done.stderr) == (0, "")
    suite = slipsweep.read_suite("sweeps/data/suite/rock-*.AT2")
    required = slipsweep.required_strength(
        0.05,
        [0.2 * G, 0.4 * G],
        excitation=suite,
        polarity="both",
        uncertain={
            "time_scale": {"distribution": "lognorm", "s": 0.2},
            "yield_coefficient": {"distribution": "lognorm", "s": 0.1, "kind": "factor"},
        },
        samples=64,
        quantiles=[0.05, 0.5, 0.95],
    )
    with slipsweep.open_result(folder / "samples.nc") as table:
        np.testing.assert_array_equal(
            table.required_yield_coefficient_quantile, required.required_yield_coefficient_quantile
        )
        assert table.attrs["pooled"] == "2 polarity x 4 motion"
    assert "2 polarity x 4 motion x 64 samples" in done.stdout
    assert "<svg" in (folder / "samples.svg").read_text()


def test_equations_stand_beside_the_suite(folder: Path, expected: xr.Dataset) -> None:
    names = ["jibson-2007", "bray-travasarou-2007"]
    options = ("--of", "yield_coefficient", "--equations", ",".join(names), "--magnitude", "7")
    done = command(folder, "limit", "suite.toml", "-d", "50mm", *options)
    assert (done.returncode, done.stderr) == (0, "")
    beside = slipsweep.published_strength(expected, names, magnitude=7.0).sel(displacement=0.05)
    for name in names:
        label = slipsweep.published.EQUATIONS[name].label
        rows = [line for line in done.stdout.splitlines() if f" {label} " in line]
        for line, place in zip(rows, range(2), strict=True):
            values = beside.sel(equation=name).isel(amplitude=place)
            words = line.split(label)[1].split()
            printed = [float(word) for word in words[:3]]
            np.testing.assert_allclose(
                printed, values.required_yield_coefficient_quantile, rtol=6e-4
            )
            outside = not bool(values.in_range.all())
            assert words[3:] == (["outside"] if outside else [])
    assert "Published equations are for other conditions" in done.stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--of", "cohesion"),
            "--of = 'cohesion': must be one of 'amplitude', 'yield_coefficient'",
        ),
        (("--of", "mu_s", "--maximum-amplitude", "2g"), "--maximum-amplitude: not with --of mu_s"),
        (
            ("--of", "mu_s", "--equations", "jibson-2007"),
            "--equations: only with --of yield_coefficient",
        ),
        (("--equations", "jibson-2007"), "--equations: only with --of yield_coefficient"),
    ],
)
def test_options_that_do_not_go_together(
    folder: Path, options: tuple[str, ...], message: str
) -> None:
    done = command(folder, "limit", "suite.toml", "-d", "50mm", *options)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_the_papers_law_is_refused_in_one_line(folder: Path) -> None:
    (folder / "law.toml").write_text(SWEEP.replace('"newmark"', '"mendez"'))
    done = command(folder, "limit", "law.toml", "-d", "50mm", "--of", "mu_s")
    assert done.returncode == 2
    assert "law.toml: model = 'mendez': must be 'newmark' for a required strength" in done.stderr
    assert done.stderr.count("\n") == 1
