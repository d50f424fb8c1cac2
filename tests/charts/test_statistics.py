"""Charts of statistics: probabilities, bands of quantiles and Sobol indices, as they are in the
result.
"""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from tests.support.charts import caption, labelled, legend

SYMBOLS = {"A": "amplitude", "μs": "mu_s"}


@pytest.fixture(scope="module")
def sampled() -> xr.Dataset:
    uncertain = {
        "mu_s": {"distribution": "lognorm", "s": 0.1, "scale": 0.4},
        "amplitude": {"kind": "factor", "distribution": "lognorm", "s": 0.3},
    }
    return slipsweep.sample(
        5,
        amplitude=[4.0, 5.0, 6.0],
        frequency=[1.0, 2.0],
        uncertain=uncertain,
        quantiles=[0.05, 0.16, 0.5, 0.84, 0.95],
        samples=256,
        sensitivity=True,
    )


def test_fragility_is_the_probability_of_exceeding_each_threshold(sampled: xr.Dataset) -> None:
    figure = sampled.slipsweep.chart("fragility", at={"frequency": "2000mHz"})
    axes = figure.axes[0]
    for line, threshold in zip(axes.lines, sampled.threshold, strict=True):
        expected = sampled.exceedance_probability.sel(threshold=threshold, frequency=2.0)
        np.testing.assert_array_equal(line.get_xdata(), sampled.amplitude)
        np.testing.assert_array_equal(line.get_ydata(), expected)
    assert legend(figure) == ["d = 10 mm", "d = 100 mm", "d = 1 m"]
    assert axes.get_xlabel() == "peak ground acceleration A (m/s²)"
    assert axes.get_ylabel() == "probability of exceedance P(u > d)"
    assert axes.get_ylim()[0] < 0.0 < 1.0 < axes.get_ylim()[1]
    text = "uncertain: μs ~ lognorm(s=0.1, scale=0.4), A × lognorm(s=0.3); 256 samples"
    assert text in caption(figure)


def test_fragility_of_one_threshold_has_a_curve_for_each_frequency(sampled: xr.Dataset) -> None:
    """The displacement stands in the label; accelerations in g where they are chosen so."""
    figure = sampled.slipsweep.chart(
        "fragility", y="frequency", at={"threshold": "10cm"}, units="g"
    )
    axes = figure.axes[0]
    assert axes.get_ylabel() == "probability of exceedance P(u > 100 mm)"
    assert axes.get_xlabel() == "peak ground acceleration A (g)"
    for frequency in (1.0, 2.0):
        (line,) = labelled(figure, f"f = {frequency:g} Hz")
        expected = sampled.exceedance_probability.sel(threshold=0.1, frequency=frequency)
        np.testing.assert_allclose(line.get_xdata(), sampled.amplitude / 9.81, rtol=1e-14)
        np.testing.assert_array_equal(line.get_ydata(), expected)


def test_the_share_without_a_value_is_dotted(sampled: xr.Dataset) -> None:
    missing = sampled.valueless_share.copy(data=[0.0, 0.25, 0.5])
    figure = sampled.assign(valueless_share=missing).slipsweep.chart("fragility")
    assert legend(figure)[-1] == "no value (share)"
    (line,) = (line for line in figure.axes[0].lines if line.get_linestyle() == ":")
    np.testing.assert_array_equal(line.get_ydata(), [0.0, 0.25, 0.5])
    text = "Without a value: up to 50.0% of the samples."
    assert text in caption(sampled.assign(valueless_share=missing).slipsweep.chart("quantiles"))


def test_bands_lie_between_quantiles_in_millimetres(sampled: xr.Dataset) -> None:
    figure = sampled.slipsweep.chart("quantiles", at={"frequency": 2})
    axes = figure.axes[0]
    assert axes.get_ylabel() == "permanent displacement (mm)"
    assert legend(figure) == ["5 to 95 %", "16 to 84 %", "median"]
    low = axes.get_ylim()[0]
    values = sampled.displacement_quantile.sel(frequency=2.0) * 1000.0
    for band, (first, last) in zip(axes.collections, ((0.05, 0.95), (0.16, 0.84)), strict=True):
        (path,) = band.get_paths()
        for at, amplitude in enumerate(sampled.amplitude.values):
            corners = path.vertices[path.vertices[:, 0] == amplitude, 1]
            ends = values.isel(amplitude=at).sel(quantile=[first, last]).values
            drawn = np.array([corners.min(), corners.max()])
            np.testing.assert_allclose(drawn[ends >= low], ends[ends >= low], rtol=1e-12)
            assert (drawn[ends < low] < low).all()
    (median,) = labelled(figure, "median")
    np.testing.assert_allclose(median.get_ydata(), values.sel(quantile=0.5), rtol=1e-14)


def test_curves_of_sobol_indices(sampled: xr.Dataset) -> None:
    """Total indices with markers and their intervals, first-order ones dashed in the
    same colour.
    """
    figure = sampled.slipsweep.chart("sensitivity", at={"frequency": 2})
    axes = figure.axes[0]
    assert axes.get_ylabel() == "Sobol index of the permanent displacement"
    entries = legend(figure)
    assert sorted(entries[:2]) == ["A", "μs"]
    assert entries[2:] == ["total", "first order", "95 % interval (total)"]
    for symbol, name in SYMBOLS.items():
        (total,) = labelled(figure, symbol)
        own = sampled.sel(input=name)
        np.testing.assert_array_equal(total.get_ydata(), own.total_index)
        first = [
            line
            for line in axes.lines
            if line.get_color() == total.get_color() and line is not total
        ]
        np.testing.assert_array_equal(first[0].get_ydata(), own.first_order_index)
        bands = [
            band
            for band in axes.collections
            if tuple(band.get_facecolor()[0][:3]) == tuple(total.get_color()[:3])
        ]
        (path,) = bands[0].get_paths()
        for at, amplitude in enumerate(sampled.amplitude.values):
            corners = path.vertices[path.vertices[:, 0] == amplitude, 1]
            ends = own.total_interval.isel(amplitude=at)
            np.testing.assert_allclose([corners.min(), corners.max()], ends, rtol=1e-12)


def test_bars_of_sobol_indices_at_one_grid_point(sampled: xr.Dataset) -> None:
    """The largest total index is uppermost; each bar has its interval."""
    figure = sampled.slipsweep.chart("sensitivity", at={"frequency": 2, "amplitude": 6.0})
    axes = figure.axes[0]
    assert axes.get_xlabel() == "Sobol index of the permanent displacement"
    order = [text.get_text() for text in axes.get_yticklabels()]
    names = [SYMBOLS[one] for one in order]
    point = sampled.sel(amplitude=6.0)
    totals = point.total_index.sel(input=names).values
    assert sorted(totals) == totals.tolist()
    bars = np.array(
        [[patch.get_y() + patch.get_height() / 2, patch.get_width()] for patch in axes.patches]
    )
    places = np.arange(len(order))
    np.testing.assert_allclose(bars[: len(order), 0], places + 0.2, rtol=1e-12)
    np.testing.assert_array_equal(bars[: len(order), 1], totals)
    np.testing.assert_allclose(bars[len(order) :, 0], places - 0.2, rtol=1e-12)
    np.testing.assert_array_equal(bars[len(order) :, 1], point.first_order_index.sel(input=names))
    assert legend(figure) == ["total", "first order", "95 % interval"]
    colours = [handle.get_facecolor() for handle in figure.legends[0].legend_handles[:2]]
    assert axes.patches[0].get_facecolor() == colours[0]
    assert axes.patches[-1].get_facecolor() == colours[1]
    intervals = [point.total_interval.sel(input=names), point.first_order_interval.sel(input=names)]
    for errors, interval in zip(axes.containers[1::2], intervals, strict=True):
        segments: Any = errors.lines[2][0].get_segments()
        ends = [segment[:, 0] for segment in segments]
        np.testing.assert_allclose(ends, interval.transpose("input", "bound"), atol=1e-12)
