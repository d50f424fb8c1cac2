"""What is estimated is named in words wherever a number is shown."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep.charts import style
from slipsweep.files.opening import read_result
from slipsweep.model.options import friction_inputs
from tests.support.commands import command

RECORD = slipsweep.Record(np.arange(3.0), np.array([0.0, 5.0, 0.0]))
BLOCK: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4, "amplitude": 4.0, "frequency": 2.0}


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({}, "Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated"),
        ({"yield_acceleration": [0.5, 1.0]}, "Üy given; λ by Eq. 6, Δμ by Eqs. 10–11: estimated"),
        (
            {"minimum_friction": 0.1},
            "Üy by Coulomb, λ by Eq. 6 (μmin given), Δμ by Eqs. 10–11: estimated",
        ),
        (
            {"decay_rate": 2.7, "minimum_friction": 0.1},
            "λ given; Üy by Coulomb, Δμ by Eqs. 10–11: estimated",
        ),
        ({"yield_acceleration": 0.59, "decay_rate": 2.7, "delta_mu": 0.09}, "Üy, λ, Δμ given"),
        ({"model": "newmark"}, "Üy by Coulomb: estimated"),
        ({"model": "newmark", "yield_acceleration": 0.59, "decay_rate": 2.7}, "Üy given"),
    ],
)
def test_every_result_says_what_is_estimated(inputs: dict[str, Any], words: str) -> None:
    attrs = slipsweep.sweep(**BLOCK, **inputs).attrs
    assert attrs["friction_inputs"] == words
    assert style.model_text(attrs).startswith(f"{words}\n")
    if "yield_acceleration" not in inputs or np.ndim(inputs["yield_acceleration"]) == 0:
        assert slipsweep.simulate(**BLOCK, **inputs).attrs["friction_inputs"] == words
    limit = {name: value for name, value in BLOCK.items() if name != "amplitude"}
    assert slipsweep.limit_amplitude(0.1, **limit, **inputs).attrs["friction_inputs"] == words
    if inputs.get("model") != "newmark":
        record = slipsweep.sweep(5.0, 0.4, excitation=RECORD, **inputs)
        assert record.attrs["friction_inputs"] == words


@pytest.mark.parametrize(
    ("names", "drawn", "words"),
    [
        ((), {"mu_s": "absolute"}, "Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated"),
        ((), {"decay_rate": "absolute"}, "λ drawn; Üy by Coulomb, Δμ by Eqs. 10–11: estimated"),
        (
            (),
            {"decay_rate": "factor"},
            "Üy by Coulomb, λ by Eq. 6 (drawn about it), Δμ by Eqs. 10–11: estimated",
        ),
        (
            ("decay_rate",),
            {"decay_rate": "factor"},
            "λ drawn; Üy by Coulomb, Δμ by Eqs. 10–11: estimated",
        ),
        (
            ("yield_acceleration", "minimum_friction"),
            {"decay_rate": "factor", "delta_mu": "absolute"},
            "Üy given; Δμ drawn; λ by Eq. 6 (μmin given, drawn about it): estimated",
        ),
    ],
)
def test_drawn_parameters_are_named_as_drawn(
    names: tuple[str, ...], drawn: dict[str, str], words: str
) -> None:
    assert friction_inputs("mendez", names, drawn) == words
    uncertain = {
        name: {"distribution": "uniform", "loc": 0.9, "scale": 0.2, "kind": kind}
        for name, kind in drawn.items()
    }
    block = {name: value for name, value in BLOCK.items() if drawn.get(name) != "absolute"}
    about: dict[str, Any] = dict.fromkeys(names, 0.5)
    samples = slipsweep.sample(**block, **about, uncertain=uncertain, samples=4)
    assert samples.attrs["friction_inputs"] == words


def test_summaries_files_and_info_say_it(tmp_path: Path) -> None:
    words = "Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated"
    sweep = tmp_path / "a.toml"
    sweep.write_text(
        "".join(f"[axes.{name}]\nvalues = [{value}]\n" for name, value in BLOCK.items())
    )
    path = tmp_path / "a.nc"
    assert f"\ninputs: {words}\n" in command(tmp_path, "run", sweep, "-o", path).stdout
    assert read_result(path).attrs["friction_inputs"] == words
    assert f"\nfriction_inputs: {words}\n" in command(tmp_path, "info", path).stdout
    assert (
        f"\ninputs: {words}\n" in command(tmp_path, "limit", sweep, "--displacement", "10mm").stdout
    )
    options = [
        option
        for name, value in BLOCK.items()
        for option in (f"--{name.replace('_', '-')}", str(value))
    ]
    assert f"\ninputs                  {words}\n" in command(tmp_path, "simulate", *options).stdout
