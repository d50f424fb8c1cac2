"""Strength that changes while the block slides, in commands and files: asked for, and said."""

from pathlib import Path

import numpy as np
import pytest

import slipsweep
from tests.support.commands import command

SWEEP = """
[model]
friction = "newmark"
strength = "weakening"
residual_phi = 9
[excitation]
waveform = "sine"
cycles = 3
[axes]
theta.values = [5, 10]
phi.values = [14]
weakening_distance = {values = [20, 100], units = "mm"}
amplitude = {start = 0.05, stop = 0.3, num = 6, units = "g"}
frequency.values = [1, 2]
"""

WORDS = "friction falls from μs to μr over the slip D"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("strength")
    (path / "liner.toml").write_text(SWEEP)
    done = command(path, "run", "liner.toml", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    return path


def test_a_sweep_file_gives_what_python_gives(folder: Path) -> None:
    expected = slipsweep.sweep(
        [5.0, 10.0],
        phi=[14.0],
        residual_phi=9.0,
        weakening_distance=[0.02, 0.1],
        amplitude=np.linspace(0.05, 0.3, 6) * 9.81,
        frequency=[1.0, 2.0],
        model=slipsweep.Newmark(strength="weakening"),
        excitation=slipsweep.Sine(cycles=3),
    )
    with slipsweep.open_result(folder / "liner.nc") as result:
        for name in ("permanent_displacement", "validity"):
            values = expected[name].transpose(*result[name].dims).values
            np.testing.assert_allclose(result[name].values, values, rtol=1e-12)
        assert result.attrs["strength"] == "weakening"
        flags = slipsweep.flags(result)
        assert flags.may_not_stop.any()
        assert flags.not_at_rest.any()


def test_info_the_page_the_table_and_a_repeated_run_say_it(folder: Path) -> None:
    about = command(folder, "info", "liner.nc").stdout
    assert WORDS in about
    assert "not_at_rest" in about
    for name in ("page.html", "table.csv"):
        kind = ("explore",) if name == "page.html" else ("export",)
        done = command(folder, *kind, "liner.nc", "-o", name)
        assert (done.returncode, done.stderr) == (0, "")
    assert WORDS in (folder / "page.html").read_text(encoding="utf-8")
    assert "residual_mu (1),residual_phi (degree),weakening_distance (m)" in (
        folder / "table.csv"
    ).read_text(encoding="utf-8")
    again = command(folder, "run", "liner.nc", "-o", "again.nc", "--quiet")
    assert (again.returncode, again.stderr) == (0, "")


def test_a_chart_names_the_changing_strength() -> None:
    result = slipsweep.sweep(
        5.0,
        phi=14.0,
        residual_phi=9.0,
        weakening_distance=[0.02, 0.1],
        amplitude=np.linspace(1.0, 3.0, 9),
        frequency=[1.0, 2.0],
        model=slipsweep.Newmark(strength="weakening"),
    )
    figure = result.slipsweep.chart("families", at={"frequency": 1})
    texts = [*(text.get_text() for text in figure.texts), figure.get_supxlabel()]
    assert "friction falls with slip" in " ".join(" ".join(texts).split())


def test_one_case_from_the_command_line(folder: Path) -> None:
    block = ["--theta", "5", "--phi", "14", "--residual-phi", "9", "--weakening-distance", "50mm"]
    shaking = ["--amplitude", "0.3g", "--frequency", "2"]
    model = ["--model", "newmark", "--strength", "weakening"]
    done = command(folder, "simulate", *block, *shaking, *model)
    assert (done.returncode, done.stderr) == (0, "")
    assert WORDS in done.stdout
    refused = command(folder, "simulate", *block[:4], *shaking, *model)
    assert refused.returncode == 2
    assert "residual_mu: must be given with strength = 'weakening'" in refused.stderr


def test_the_cycle_solver_is_refused(folder: Path) -> None:
    done = command(folder, "run", "liner.toml", "--solver", "cycle", "-o", "other.nc")
    assert done.returncode == 2
    assert "solver = 'cycle': not allowed with strength = 'weakening'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_limits_of_a_result(folder: Path) -> None:
    done = command(folder, "limit", "liner.nc", "-d", "50mm")
    assert (done.returncode, done.stderr) == (0, "")
    refused = command(folder, "limit", "liner.nc", "-d", "50mm", "--of", "phi")
    assert refused.returncode == 2
