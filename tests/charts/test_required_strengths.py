"""Charts of required strengths: curves, the band of a suite or of samples, published equations."""

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import InputError
from tests.support.charts import caption, drawn_as, legend, named

G = 9.81
NAMES = ["jibson-2007", "bray-travasarou-2007"]


@pytest.fixture(scope="module")
def strengths(suite: slipsweep.Suite) -> xr.Dataset:
    return slipsweep.required_strength(
        [0.02, 0.05], np.array([0.2, 0.4, 0.8]) * G, excitation=suite, polarity="both"
    )


def test_motions_and_their_band_over_the_amplitude(strengths: xr.Dataset) -> None:
    figure = strengths.slipsweep.chart(at={"displacement": "50mm"})
    axes = figure.axes[0]
    assert axes.get_ylabel() == "required yield coefficient ky"
    assert axes.get_xlabel() == "peak ground acceleration A (m/s²)"
    assert axes.get_ylim()[0] == 0.0
    block = strengths.sel(displacement=0.05)
    drawn = sorted(tuple(line.get_ydata()) for line in named(figure, "motion"))
    each = block.required_yield_coefficient.values.reshape(3, -1)
    np.testing.assert_array_equal(drawn, sorted(map(tuple, each.T)))
    low, middle, high = block.required_yield_coefficient_quantile.values.T
    (median,) = named(figure, "median")
    np.testing.assert_array_equal(median.get_ydata(), middle)
    for edge, expected in zip(named(figure, "edge"), (low, high), strict=True):
        np.testing.assert_array_equal(edge.get_ydata(), expected)
    assert legend(figure) == ["median", "16 to 84 %", "a motion"]
    assert "quantiles of the required strength over 2 polarity x 8 motion." in caption(figure)


def test_each_displacement_has_a_panel(strengths: xr.Dataset) -> None:
    figure = strengths.slipsweep.chart()
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["u = 0.02 m", "u = 0.05 m"]


def test_one_grid_point_has_a_marker_for_each_motion(strengths: xr.Dataset) -> None:
    block = strengths.isel(amplitude=1, displacement=1)
    figure = block.slipsweep.chart()
    for polarity in (1, -1):
        (points,) = drawn_as(figure, f"polarity {polarity}")
        expected = block.required_yield_coefficient.sel(polarity=polarity)
        np.testing.assert_array_equal(points.get_ydata(), expected)
    (median,) = named(figure, "median")
    middle = block.required_yield_coefficient_quantile.sel(quantile=0.5)
    np.testing.assert_array_equal(median.get_ydata(), np.full(2, middle))


def test_equations_are_drawn_beside_the_band(strengths: xr.Dataset) -> None:
    figure = strengths.slipsweep.chart(at={"displacement": "50mm"}, equations=NAMES, magnitude=7.0)
    block = strengths.sel(displacement=0.05)
    beside = slipsweep.published_strength(block, NAMES, magnitude=7.0, quantiles=0.5)
    for name in NAMES:
        (line,) = named(figure, f"{name} 50%")
        values = beside.sel(equation=name).isel(quantile=0)
        inside = values.in_range.values == 1
        required = values.required_yield_coefficient_quantile.values
        np.testing.assert_allclose(line.get_ydata()[inside], required[inside], rtol=1e-12)
        assert np.isnan(line.get_ydata()[~inside]).all()
        assert slipsweep.published.EQUATIONS[name].label in legend(figure)
    assert "Published equations are for other conditions" in caption(figure)


def test_samples_have_the_band_alone() -> None:
    uncertain = {"frequency": {"distribution": "lognorm", "s": 0.3}}
    found = slipsweep.required_strength(
        0.05, [2.0, 4.0, 6.0], uncertain=uncertain, samples=64, quantiles=[0.05, 0.5, 0.95]
    )
    figure = found.slipsweep.chart()
    (median,) = named(figure, "median")
    expected = found.required_yield_coefficient_quantile.sel(quantile=0.5)
    np.testing.assert_array_equal(median.get_ydata(), expected)
    assert legend(figure) == ["median", "5 to 95 %"]


def test_one_motion_has_a_curve_for_each_displacement() -> None:
    both = slipsweep.Newmark(sliding="both")
    found = slipsweep.required_strength(
        [0.02, 0.1], [2.0, 4.0, 6.0], 2.0, of="phi", theta=3.0, model=both
    )
    figure = found.slipsweep.chart()
    assert figure.axes[0].get_ylabel() == "required friction angle of the interface φ (°)"
    for displacement in (0.02, 0.1):
        (line,) = drawn_as(figure, f"u = {displacement:g} m")
        expected = found.required_phi.sel(displacement=displacement)
        np.testing.assert_array_equal(line.get_ydata(), expected)
    assert "largest displacement over time" in caption(figure)
    with pytest.raises(InputError, match="equations: only beside required yield coefficients"):
        found.slipsweep.chart(at={"displacement": 0.02}, equations=NAMES, magnitude=7.0)
