"""A block that slides both ways in statistics, hazard, samples and charts: |u| is counted."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import slipsweep
from slipsweep import HazardCurve, InputError, Newmark, Record, Suite, sweep
from slipsweep.cli import main
from slipsweep.studies.suite_statistics import summary_lines

BOTH = Newmark(sliding="both")
LEVEL: dict[str, Any] = {"theta": 0.0, "mu_s": [0.1, 0.2], "model": BOTH}
AMPLITUDES = [2.0, 3.0, 4.0]


def suite() -> Suite:
    """Eight records of filtered noise, under which blocks end downslope and upslope."""
    random = np.random.default_rng(10)
    taper = np.hanning(400)
    rows = (np.convolve(random.normal(size=400), np.hanning(12), "same") for _ in range(8))
    records = tuple(Record.sampled(row * taper, 0.02) for row in rows)
    return Suite(records, tuple("abcdefgh"))


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return sweep(**LEVEL, amplitude=AMPLITUDES, excitation=suite())


def test_statistics_of_a_suite_are_of_magnitudes(result: xr.Dataset) -> None:
    moved = result.permanent_displacement
    assert 0.2 < float((moved < 0).mean()) < 0.8
    found = slipsweep.suite_statistics(result, thresholds=[0.01, 0.05], quantiles=[0.3, 0.5])
    magnitude = np.abs(moved)
    for d in (0.01, 0.05):
        share = (magnitude > d).mean("motion")
        np.testing.assert_array_equal(found.exceedance_probability.sel(threshold=d), share)
    median = magnitude.median("motion")
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), median, rtol=1e-12)
    np.testing.assert_allclose(found.nonzero_median, median, rtol=1e-12)
    for name in ("displacement_quantile", "exceedance_probability", "zero_probability"):
        assert found[name].attrs["long_name"].endswith("|u|"), name
    assert found.attrs["title"].endswith("|u|")
    lines = summary_lines(result.sel(mu_s=0.1), 0.05)
    assert lines[0].startswith("magnitude of the permanent displacement (mm) over")
    assert "P(|u| > 50 mm)" in lines[1]


def test_hazard_is_of_magnitudes(result: xr.Dataset) -> None:
    curve = HazardCurve(np.array([1.0, 3.0, 8.0]), np.array([1e-2, 1e-3, 1e-5]))
    rates = slipsweep.displacement_hazard(result, curve, 0.02)
    positive = result.assign(permanent_displacement=np.abs(result.permanent_displacement))
    same = slipsweep.displacement_hazard(positive.assign_attrs(sliding="downslope"), curve, 0.02)
    np.testing.assert_array_equal(rates.annual_rate, same.annual_rate)
    assert (rates.annual_rate > 0).all()
    assert rates.annual_rate.attrs["long_name"].endswith("|u|")


def test_samples_are_of_magnitudes() -> None:
    """Mean and probability are integrals over the quantiles of μs."""
    drawn = stats.lognorm(s=0.5, scale=0.12)
    shaking: dict[str, Any] = {"amplitude": 3.0, "excitation": suite()["h"]}
    found = slipsweep.sample(
        theta=0.0, model=BOTH, **shaking, uncertain={"mu_s": drawn}, thresholds=0.02
    )
    every = drawn.ppf((np.arange(20_000) + 0.5) / 20_000)
    cells = sweep(0.0, xr.DataArray(every, dims="draw"), model=BOTH, **shaking)
    moved = cells.permanent_displacement.values
    assert abs(moved.mean()) < 0.9 * np.abs(moved).mean()  # there are both signs
    assert float(found.mean_displacement) == pytest.approx(np.abs(moved).mean(), rel=2e-3)
    share = np.mean(np.abs(moved) > 0.02)
    assert found.exceedance_probability.item() == pytest.approx(share, rel=2e-3)
    assert found.mean_displacement.attrs["long_name"].endswith("|u|")


def test_upslope_yield_acceleration_can_be_drawn() -> None:
    """The block ends the more downslope, the more it takes to slide it back."""
    shaking: dict[str, Any] = {"amplitude": 4.0, "frequency": 2.0, "excitation": "cosine"}
    block: dict[str, Any] = {"yield_coefficient": 0.1, "model": BOTH}
    spread = {"upslope_yield_acceleration": stats.uniform(1.0, 1e-9)}
    found = slipsweep.sample(**block, **shaking, uncertain=spread, samples=4)
    alone = sweep(**block, **shaking, upslope_yield_acceleration=1.0)
    expected = abs(float(alone.permanent_displacement))
    assert float(found.mean_displacement) == pytest.approx(expected, rel=1e-7)


def test_clearance_is_the_range_of_the_displacement() -> None:
    wanted = ["clearance", "largest_displacement", "smallest_displacement"]
    shaking: dict[str, Any] = {"amplitude": AMPLITUDES, "frequency": [1.0, 2.0]}
    found = sweep(**LEVEL, **shaking, variables=wanted)
    extent = found.largest_displacement - found.smallest_displacement
    np.testing.assert_allclose(found.clearance, extent, rtol=1e-15)
    assert "clearance" not in sweep(**LEVEL, **shaking)


# ------------------------------------------------------------------ charts


def test_charts_draw_magnitudes_and_say_so(result: xr.Dataset) -> None:
    figure = result.slipsweep.chart("motions", at={"mu_s": 0.1})
    axes = figure.axes[0]
    assert axes.get_ylabel() == "magnitude of the permanent displacement (mm)"
    drawn = np.sort([line.get_ydata()[0] for line in axes.lines if line.get_gid() == "motion"])
    moved = result.permanent_displacement.sel(mu_s=0.1, amplitude=AMPLITUDES[0])
    np.testing.assert_allclose(drawn, np.sort(np.abs(moved)) * 1000.0, rtol=1e-12)
    caption = figure.get_supxlabel()
    ends = result.permanent_displacement.sel(mu_s=0.1)
    share = float((ends < 0).sum() / (ends != 0).sum())
    assert f"{100 * share:.2g} % of the sliding cells shown end upslope" in caption
    assert "sliding both ways" in caption


def test_a_slice_between_values_is_solved_both_ways() -> None:
    shaking: dict[str, Any] = {"amplitude": np.linspace(2.0, 6.0, 9), "frequency": 1.0}
    block: dict[str, Any] = {"theta": 0.0, "upslope_yield_acceleration": 1.5, "model": BOTH}
    result = sweep(mu_s=[0.1, 0.3], **block, **shaking)
    figure = result.slipsweep.chart("curve", at={"mu_s": 0.2})
    exact = sweep(mu_s=0.2, **block, **shaking).permanent_displacement
    assert (exact < 0).any()
    drawn = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, np.abs(exact) * 1000.0, rtol=1e-9)


def test_the_line_of_yield_is_where_the_block_slides_either_way() -> None:
    """With the smaller yield acceleration upslope, the block slides from that on."""
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 0.4, "upslope_yield_acceleration": 1.5}
    shaking: dict[str, Any] = {"amplitude": np.linspace(0.5, 6.0, 12), "frequency": [1.0, 2.0]}
    figure = sweep(**block, **shaking, model=BOTH).slipsweep.chart("contours")
    (line,) = (one for one in figure.axes[0].collections if one.get_gid() == "yield_line")
    np.testing.assert_allclose(line.get_paths()[0].vertices[:, 1], 1.5, rtol=1e-9)


def test_options_that_slide_one_way_are_no_spread() -> None:
    shaking: dict[str, Any] = {"amplitude": AMPLITUDES, "frequency": [1.0, 2.0]}
    result = sweep(**LEVEL, **shaking)
    with pytest.raises(InputError, match="slides both ways"):
        result.slipsweep.chart("spread")


# ------------------------------------------------------------------ commands


def test_simulate_prints_the_extremes(capsys: pytest.CaptureFixture[str]) -> None:
    words = "simulate --yield-coefficient 0.1 --upslope-yield-acceleration 0.12g --amplitude 0.3g"
    words += " --frequency 2 --model newmark --sliding both --waveform cosine"
    assert main(words.split()) == 0
    printed = capsys.readouterr().out
    exact = sweep(
        yield_coefficient=0.1,
        upslope_yield_acceleration=0.12 * 9.81,
        amplitude=0.3 * 9.81,
        frequency=2.0,
        model=BOTH,
        excitation="cosine",
    )
    for name in ("permanent_displacement", "largest_displacement", "smallest_displacement"):
        assert f"{name.replace('_', ' '):<23} {float(exact[name]):.6g} m" in printed
    clearance = float(exact.largest_displacement - exact.smallest_displacement)
    assert f"{'clearance':<23} {clearance:.6g} m" in printed


def test_a_sweep_file_and_its_page(tmp_path: Path) -> None:
    """Displacements of either sign reach the page, which colours them by magnitude."""
    (tmp_path / "level.toml").write_text(
        """
        [model]
        friction = "newmark"
        sliding = "both"
        upslope_yield_acceleration = 1.2
        [axes.theta]
        values = [0]
        [axes.mu_s]
        values = [0.1, 0.2]
        [axes.amplitude]
        values = [2.0, 3.0, 4.0]
        [axes.frequency]
        values = [1.0, 2.0]
        """
    )
    output = tmp_path / "level.nc"
    assert main(["run", str(tmp_path / "level.toml"), "-o", str(output), "--quiet"]) == 0
    page = tmp_path / "level.html"
    assert main(["explore", str(output), "-o", str(page)]) == 0
    assert '"signed":true' in page.read_text().replace(" ", "")
