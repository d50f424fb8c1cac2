"""Published equations on the command line: info, export, hazard and chart."""

from pathlib import Path

import numpy as np
import openpyxl
import pytest

import slipsweep
from slipsweep import published
from tests.support.commands import command

SUITE = Path(__file__).parents[2] / "sweeps" / "data" / "suite"

CURVE = "PGA (g), annual rate\n0.05, 0.02\n0.2, 0.002\n0.8, 0.00006\n1.5, 0.000008\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("published")
    result = slipsweep.sweep(
        yield_coefficient=[0.04, 0.1],
        amplitude=np.array([0.2, 0.4]) * 9.81,
        excitation=slipsweep.read_suite(str(SUITE / "*_H1.AT2")),
        model="newmark",
    )
    result.to_netcdf(root / "a.nc")
    (root / "hazard.csv").write_text(CURVE)
    return root


def test_info_prints_equations_beside_the_suite(folder: Path) -> None:
    done = command(
        folder, "info", "a.nc", "-d", "50mm", "--at", "ky=0.04", "--equations", "jibson-2007"
    )
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    start = lines.index("published equations beside:")
    title = lines[start + 1]
    suite = lines[start + 4]
    jibson = lines[start + 5]
    assert title.split() == [
        *("PGA", "(g)", "displacement", "of", "16", "%", "(mm)", "median", "(mm)", "84", "%"),
        *("(mm)", "zero", "P(u", ">", "50", "mm)", "range"),
    ]
    assert suite.split()[:3] == ["0.4", "this", "suite"]
    estimate = published.jibson_2007(0.04, 0.4)
    assert jibson.split() == [
        "0.4",
        "Jibson",
        "2007",
        f"{1000 * estimate.quantile(0.16):.3g}",
        f"{1000 * estimate.quantile(0.5):.3g}",
        f"{1000 * estimate.quantile(0.84):.3g}",
        "0.0%",
        f"{estimate.exceedance_probability(0.05):.1%}",
        "outside",
    ]
    assert lines[start + 6] == "outside: an input lies outside of the range of the equation"
    assert lines[start + 7].startswith("Published equations are for other conditions")


def test_a_sheet_has_equations_beside_the_suite(folder: Path) -> None:
    arguments = ("--equations", "rathje-saygili-2009", "--magnitude", "7")
    done = command(folder, "export", "a.nc", "-o", "a.xlsx", *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    book = openpyxl.load_workbook(folder / "a.xlsx")
    assert book.sheetnames == ["a", "equations", "about"]
    header, *rows = book["equations"].values
    assert header[:4] == ("PGA (g)", "ky", "displacement of", "16 % (mm)")
    assert [row[2] for row in rows] == ["this suite", "Rathje and Saygili 2009"] * 4
    for pga, ky, *_, median, _, _, _ in rows[1::2]:
        expected = 1000.0 * published.rathje_saygili_2009(ky, pga, 7.0).median
        assert median == pytest.approx(expected, rel=1e-9)


def test_hazard_takes_equations_in_place_of_the_suite(folder: Path) -> None:
    arguments = ("--curve", "hazard.csv", "-d", "50mm", "--at", "ky=0.1")
    equations = ("--equations", "jibson-2007,ambraseys-menu-1988")
    written = ("-o", "rates.png", "-o", "fragility.xml")
    done = command(folder, "hazard", "a.nc", *arguments, *equations, *written)
    assert (done.returncode, done.stderr) == (0, "")
    curve = slipsweep.HazardCurve(
        np.array([0.05, 0.2, 0.8, 1.5]) * 9.81, np.array([0.02, 0.002, 0.00006, 0.000008])
    )
    result = slipsweep.open_result(folder / "a.nc").sel(yield_coefficient=0.1)
    rates = slipsweep.displacement_hazard(
        result, curve, ["50mm"], equations=["jibson-2007", "ambraseys-menu-1988"]
    ).squeeze()
    assert "P(u > d | PGA): by published equations, hazard curve 0.05 to 1.5 g" in done.stdout
    for name, rate in zip(rates.equation.values, rates.annual_rate.values, strict=True):
        assert f"{name}" in done.stdout
        assert f"{rate:.4g}" in done.stdout
    assert "outside its range: the part of the rate" in done.stdout
    assert "Jibson 2007: under 2270 records" in done.stdout
    text = (folder / "fragility.xml").read_text()
    assert 'id="equation_jibson-2007"' in text
    assert (folder / "rates.png").stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("info", "a.nc", "--magnitude", "7"), "--magnitude 7: only with --equations"),
        (("chart", "a.nc", "--magnitude", "7"), "--magnitude 7: only with --equations"),
        (("info", "a.nc", "--equations", "jibson-2006"), "no such published equation"),
        (
            ("export", "a.nc", "-o", "a.csv", "--equations", "jibson-2007"),
            "a.csv: --equations: are a sheet of their own: must end in .xlsx",
        ),
        (
            ("hazard", "a.nc", "--curve", "hazard.csv", "-d", "5cm", "--equations", "yegian-1991"),
            "yegian-1991: needs period T, s (period): the result does not have it",
        ),
    ],
)
def test_options_that_do_not_fit_are_refused(
    folder: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = command(folder, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
