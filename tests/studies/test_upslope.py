"""Where a block would also slide upslope: a caution of `run`, `info`, `simulate` and captions."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.cli import main
from slipsweep.studies.cautions import percent, slides_back_text
from slipsweep.studies.upslope import sliding_ways, upslope_yield_acceleration

G = 9.81

#: A level floor of a building: g, Hz, cycles.
FLOOR: dict[str, Any] = {"theta": 0.0, "mu_s": 0.3, "amplitude": 0.5 * G, "frequency": 5.0}


def slides_back(result: xr.Dataset, motion: Any = None) -> xr.DataArray:
    ways = sliding_ways(result, motion)
    assert ways is not None
    return ways[1]


def text_of(printed: str) -> list[str]:
    return [line for line in printed.splitlines() if "upslope yield" in line]


def test_the_upslope_yield_acceleration_is_that_of_statics() -> None:
    """Of a block on the point of sliding up: weight, normal force and friction down the plane."""
    theta = xr.DataArray([0.0, 3.0, 12.0, 30.0], dims="theta")
    mu_s = xr.DataArray([0.2, 0.4, 0.9], dims="mu_s")
    sine, cosine = np.sin(np.radians(theta)), np.cos(np.radians(theta))
    # along the plane a cosθ − g sinθ = μ N/m, across it a sinθ = N/m − g cosθ
    expected = G * (sine + mu_s * cosine) / (cosine - mu_s * sine)
    coulomb = G * (mu_s - sine / cosine) / (1 + mu_s * sine / cosine)
    found = upslope_yield_acceleration(coulomb, theta, G)
    np.testing.assert_allclose(found.transpose(*expected.dims), expected, rtol=1e-14)
    # a plane so steep that no acceleration drives the block up
    steep = upslope_yield_acceleration(xr.DataArray(2.0 * G), xr.DataArray(20.0), G)
    assert steep.item() == math.inf


@pytest.mark.parametrize("model", ["mendez", "newmark"])
def test_a_level_floor_has_the_caution_and_moves_a_tenth_in_truth(model: str) -> None:
    result = slipsweep.sweep(**FLOOR, model=model)
    assert result.permanent_displacement.item() == pytest.approx(0.0392, rel=0.02)
    text = slides_back_text(result)
    assert text.startswith("the base's acceleration also exceeds the upslope yield acceleration")
    assert 'sliding = "both" of [model] friction = "newmark"' in text
    # the same block, stepped, sliding both ways under friction of constant size
    step = 1e-5
    velocity = displacement = largest = 0.0
    onset = 0.3 * G
    for ground in 0.5 * G * np.sin(2 * np.pi * 5.0 * step * np.arange(int(2.0 / step))):
        if velocity == 0.0 and abs(ground) <= onset:
            continue
        friction = onset * (np.sign(velocity) if velocity else np.sign(ground))
        after = velocity + (ground - friction) * step
        velocity = 0.0 if after * velocity < 0.0 else after
        displacement += velocity * step
        largest = max(largest, abs(displacement))
    assert largest < 0.0040 < 0.2 * result.permanent_displacement.item()


@pytest.mark.parametrize("model", ["mendez", "newmark"])
@pytest.mark.parametrize("measured", [None, 0.6])
def test_the_caution_is_where_the_base_exceeds_both_yield_accelerations(
    model: str, measured: float | None
) -> None:
    given: dict[str, Any] = {
        "theta": [0.0, 4.0, 9.0, 14.0],
        "mu_s": [0.3, 0.45],
        "amplitude": np.linspace(0.5, 9.0, 18),
        "frequency": [1.0, 2.0],
    }
    if measured is not None:
        given["yield_acceleration"] = measured
    result = slipsweep.sweep(**given, model=model)
    found = slides_back(result)
    theta = np.radians(result.theta)
    rest = np.arctan(result.mu_s) - theta if measured is None else math.atan(measured / G)
    parameters = slipsweep.friction_parameters(
        result.theta, result.mu_s, result.amplitude, yield_acceleration=measured
    )
    # in continuous sliding the paper's block slides both ways
    continuous = (parameters.sliding_mode == 2) & (model == "mendez")
    expected = (result.amplitude > G * np.tan(rest + 2.0 * theta)) & ~continuous
    slides = parameters.sliding_mode > 0
    assert (found == expected).where(slides, True).all()
    share = float((expected & slides).sum() / slides.sum())
    assert 0.1 < share < 0.9
    text = slides_back_text(result)
    assert text.startswith(f"in {percent(share)} of the sliding cells the base's")


def test_nothing_is_said_where_it_is_not_known_or_not_so() -> None:
    steep = slipsweep.sweep(14.0, 0.3, 4.905, 5.0, model="newmark")
    ky = slipsweep.sweep(yield_coefficient=0.3, amplitude=4.905, frequency=5.0, model="newmark")
    stuck = slipsweep.sweep(0.0, 0.6, 4.905, 5.0)
    both = slipsweep.sweep(**FLOOR, model="newmark").assign_attrs(sliding="both")
    for result in (steep, ky, stuck, both):
        assert slides_back_text(result) == ""


def test_a_wave_that_drives_upslope_less_than_downslope_is_taken_by_its_trough() -> None:
    """sin φ − 0.5 cos 2φ has the peak 1.5 and the lowest point −0.75: half of the peak."""
    wave = slipsweep.Harmonics([1.0, 0.5], [1, 2], [0.0, -90.0])
    amplitudes = [0.5 * G, 0.7 * G]  # troughs 0.25 g and 0.35 g, μ 0.3
    result = slipsweep.sweep(0.0, 0.3, amplitudes, 2.0, excitation=wave, model="newmark")
    found = slides_back(result)
    assert found.values.tolist() == [False, True]


def test_recorded_motions_are_taken_by_their_sign_and_factor() -> None:
    """A record of peaks +4 and −2 m/s², as it is and reversed, on a level base of μ 0.2."""
    record = slipsweep.Record.sampled([0.0, 4.0, 0.0, -2.0, 0.0], 0.1, "uneven")
    scales = [0.8, 1.2]
    given: dict[str, Any] = {"theta": 0.0, "mu_s": 0.2, "polarity": "both", "model": "newmark"}
    onset = 0.2 * G
    expected = [
        [sign * scale * peak > onset for scale in scales] for sign, peak in ((1, 2), (1, 4))
    ]
    assert expected == [[False, True], [True, True]]
    suite = slipsweep.Suite((record, record), ("a", "b"))
    strengths: tuple[dict[str, Any], ...] = (
        {"scale": scales},
        {"amplitude": [scale * 4.0 for scale in scales]},
    )
    for strength in strengths:
        result = slipsweep.sweep(**given, **strength, excitation=record)
        found = slides_back(result, record)
        assert found.transpose("polarity", ...).values.tolist() == expected
        several = slipsweep.sweep(**given, **strength, excitation=suite)
        found = slides_back(several, suite)
        for label in range(2):
            own = found.isel(motion=label).transpose("polarity", ...)
            assert own.values.tolist() == expected
        assert sliding_ways(result) is None


def test_commands_and_captions_say_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    axes = {"theta": [0], "mu_s": [0.3], "amplitude": [1.0, 2.0, 4.0, 5.0], "frequency": [5]}
    tables = "\n".join(f"[axes.{name}]\nvalues = {values}" for name, values in axes.items())
    Path("floor.toml").write_text(f'[model]\nfriction = "newmark"\n{tables}\n')
    assert main(["run", "floor.toml"]) == 0
    expected = "caution: in 100 % of the sliding cells the base's acceleration also exceeds"
    (line,) = text_of(capsys.readouterr().out)
    assert line.startswith(expected)
    assert main(["info", "floor.nc"]) == 0
    assert text_of(capsys.readouterr().out) == [line]
    with slipsweep.open_result("floor.nc") as result:
        full = " ".join(result.slipsweep.chart().get_supxlabel().split())
        short = " ".join(result.slipsweep.chart(caption="short").get_supxlabel().split())
    assert "In 100 % of the sliding cells shown the base's acceleration also exceeds" in full
    assert 'sliding = "both" of [model] friction = "newmark"' in full
    assert "100 % would also slide upslope: displacement too large." in short
    typed = "simulate --theta 0 --mu-s 0.3 --amplitude 0.5g --frequency 5 --model newmark -o a.nc"
    assert main(typed.split()) == 0
    (line,) = text_of(capsys.readouterr().out)
    assert re.match(r"caution +the base's acceleration also exceeds", line)
    with xr.open_dataset("a.nc") as history:
        assert "Here the base's acceleration also exceeds" in " ".join(
            history.slipsweep.chart().get_supxlabel().split()
        )
