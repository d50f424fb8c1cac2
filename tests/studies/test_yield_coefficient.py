"""Newmark's block given by its yield coefficient alone: as by Üy, wherever a block is given, and
refused elsewhere.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from slipsweep import InputError, Record, limit_amplitude, sample, simulate, sweep
from slipsweep.cli import main

G = 9.81
KY = np.array([0.05, 0.1, 0.3])

RECORD = Record.sampled(3.0 * np.sin(np.arange(0.0, 30.0, 0.1)), 0.01)

MOTIONS = (
    {"amplitude": 3.0, "frequency": [1.0, 2.0]},
    {"amplitude": 3.0, "frequency": 1.0, "solver": "step"},
    {"displacement_amplitude": 0.1, "frequency": 1.0, "excitation": "triangle"},
    {"amplitude": [3.0, 5.0], "excitation": RECORD},
)


@pytest.mark.parametrize("motion", MOTIONS)
def test_results_are_those_of_the_yield_acceleration(motion: dict[str, Any]) -> None:
    found = sweep(**motion, yield_coefficient=KY, model="newmark")
    known = sweep(0.0, 0.5, **motion, yield_acceleration=KY * G, model="newmark")
    assert "yield_coefficient" in found.dims
    assert not {"theta", "mu_s"} & {*found.coords}
    assert found.attrs["friction_inputs"] == "Üy given"
    for name in found.data_vars:
        np.testing.assert_array_equal(found[name].values, known[name].values, strict=True)


def test_limits_are_those_of_the_yield_acceleration() -> None:
    for motion in ({"frequency": 1.0}, {"excitation": RECORD}):
        found = limit_amplitude(0.05, **motion, yield_coefficient=KY, model="newmark")
        known = limit_amplitude(
            0.05, 0.0, 0.5, **motion, yield_acceleration=KY * G, model="newmark"
        )
        np.testing.assert_array_equal(found.limit_amplitude.values, known.limit_amplitude.values)


def test_samples_are_those_of_the_yield_acceleration() -> None:
    shared: dict[str, Any] = {"amplitude": 3.0, "frequency": 1.0, "model": "newmark", "samples": 64}
    found = sample(**shared, uncertain={"yield_coefficient": stats.uniform(0.1, 0.1)})
    known = sample(
        0.0, 0.5, **shared, uncertain={"yield_acceleration": stats.uniform(0.1 * G, 0.1 * G)}
    )
    np.testing.assert_allclose(
        found.mean_displacement.values, known.mean_displacement.values, rtol=1e-12
    )


def test_a_history_has_no_friction_coefficient() -> None:
    """It would take θ and μs (Eq. 1)."""
    found = simulate(amplitude=3.0, frequency=1.0, yield_coefficient=0.1, model="newmark")
    assert "friction_coefficient" not in found
    assert found.relative_displacement[-1].item() == pytest.approx(
        found.permanent_displacement.item(), rel=1e-12
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"model": "mendez"}, "yield_coefficient: not allowed with model = 'mendez'"),
        ({"mu_s": 0.4}, "mu_s: not allowed beside yield_coefficient"),
        ({"yield_coefficient": np.nan}, "yield_coefficient = nan: must be"),
    ],
)
def test_what_makes_no_sense_beside_it_is_refused(given: dict[str, Any], message: str) -> None:
    block: dict[str, Any] = {
        "amplitude": 1.0,
        "frequency": 1.0,
        "yield_coefficient": 0.1,
        "model": "newmark",
    }
    with pytest.raises(InputError, match=message):
        sweep(**block | given)


def test_sweep_files_and_the_command_line_take_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "ky.toml"
    out = tmp_path / "ky.nc"
    file.write_text(
        "[model]\nfriction = 'newmark'\n[axes]\nyield_coefficient.values = [0.05, 0.1, 0.3]\n"
        "amplitude.values = [3.0]\nfrequency.values = [1.0]\n"
    )
    assert main(["run", str(file), "-o", str(out), "-q"]) == 0
    known = sweep(amplitude=3.0, frequency=1.0, yield_coefficient=KY, model="newmark")
    with xr.open_dataset(out) as found:
        np.testing.assert_array_equal(
            found.permanent_displacement.values.ravel(), known.permanent_displacement.values.ravel()
        )
    command = ["simulate", "--yield-coefficient", "0.1", "--amplitude", "3", "--frequency", "1"]
    figure = tmp_path / "one.png"
    rows = tmp_path / "one.csv"
    assert main([*command, "--model", "newmark", "-o", str(figure), "-o", str(rows)]) == 0
    assert f"{known.permanent_displacement.values[1]:.6g} m" in capsys.readouterr().out
    assert "friction_coefficient" not in rows.read_text().splitlines()[0]
    assert main(command) == 2
