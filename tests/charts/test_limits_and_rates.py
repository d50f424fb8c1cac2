"""Charts of limit amplitudes, in g, and of annual rates over displacements in mm."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import slipsweep
from slipsweep.model.variables import LimitStatus
from tests.support.charts import caption, drawn_as, legend, named

G = 9.81


@pytest.fixture(scope="module")
def limits() -> xr.Dataset:
    """Limits, some of which a jump of the displacement sets."""
    return slipsweep.limit_amplitude(
        [0.02, 0.1, 0.5], [2.0, 8.0], 0.4, [0.5, 1.0, 2.0, 4.0], amplitude_steps=64
    )


def test_limits_over_the_frequency_are_in_g(limits: xr.Dataset) -> None:
    figure = limits.slipsweep.chart(y="displacement", at={"theta": 8.0})
    axes = figure.axes[0]
    assert axes.get_xlabel() == "excitation frequency f (Hz)"
    assert axes.get_ylabel() == "limit amplitude A / g"
    assert axes.get_ylim()[0] == 0.0
    for displacement in limits.displacement.values:
        (line,) = drawn_as(figure, f"u = {displacement:g} m")
        expected = limits.limit_amplitude.sel(theta=8.0, displacement=displacement) / G
        np.testing.assert_array_equal(line.get_xdata(), limits.frequency)
        np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-14)


def test_limits_that_a_discontinuity_sets_are_circled(limits: xr.Dataset) -> None:
    figure = limits.slipsweep.chart(y="displacement", at={"theta": 8.0})
    block = limits.sel(theta=8.0)
    status = block.limit_status
    abrupt = (status == LimitStatus.AT_MODE_JUMP) | (status == LimitStatus.AT_JUMP)
    abrupt |= status == LimitStatus.AFTER_GAP
    assert abrupt.any()
    assert (~abrupt).any()
    circles = drawn_as(figure, "set by a discontinuity\nof the model")
    circled = {point for line in circles for point in zip(*line.get_data(), strict=True)}
    cells = block.limit_amplitude.stack(cell=["frequency", "displacement"])
    chosen = cells[abrupt.stack(cell=["frequency", "displacement"]).values]
    assert circled == {
        (frequency, amplitude / G)
        for frequency, amplitude in zip(chosen.frequency.values, chosen.values, strict=True)
    }


def test_limits_over_the_inclination_have_a_curve_for_each_frequency(limits: xr.Dataset) -> None:
    """An axis of two values, a label with a degree, other values at the middle."""
    figure = limits.slipsweep.chart(x="theta", y="frequency", at={"displacement": "100mm"})
    assert figure.axes[0].get_xlabel() == "base inclination θ (°)"
    assert legend(figure)[:4] == ["f = 0.5 Hz", "f = 1 Hz", "f = 2 Hz", "f = 4 Hz"]
    for frequency in limits.frequency.values:
        (line,) = drawn_as(figure, f"f = {frequency:g} Hz")
        expected = limits.limit_amplitude.sel(frequency=frequency, displacement=0.1) / G
        np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-14)
    assert "u = 0.1 m" in caption(figure)


@pytest.fixture(scope="module")
def suite_limits(suite: slipsweep.Suite) -> xr.Dataset:
    return slipsweep.limit_amplitude(
        0.05,
        5.0,
        [0.3, 0.4],
        excitation=suite,
        polarity="both",
        maximum_amplitude=12.0,
        model="newmark",
        amplitude_steps=64,
    )


def test_limits_of_every_motion_and_their_band_are_in_g(suite_limits: xr.Dataset) -> None:
    figure = suite_limits.slipsweep.chart()
    each = suite_limits.limit_amplitude.stack(each=["motion", "polarity"]) / G
    drawn = sorted(tuple(line.get_ydata()) for line in named(figure, "motion"))
    assert np.isfinite(each).all()
    np.testing.assert_allclose(drawn, sorted(map(tuple, each.T.values)), rtol=1e-14)
    low, middle, high = np.quantile(each, [0.16, 0.5, 0.84], axis=each.dims.index("each"))
    (median,) = named(figure, "median")
    np.testing.assert_allclose(median.get_ydata(), middle, rtol=1e-14)
    for edge, expected in zip(named(figure, "edge"), (low, high), strict=True):
        np.testing.assert_allclose(edge.get_ydata(), expected, rtol=1e-14)
    assert legend(figure) == ["median", "16 to 84 %", "a motion"]
    assert "Median and band are of 8 motions in 2 polarities." in caption(figure)


def test_limits_along_the_motions_have_a_marker_for_each_polarity(
    suite_limits: xr.Dataset,
) -> None:
    block = suite_limits.isel(mu_s=0)
    figure = block.slipsweep.chart()
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == [*block.motion.values]
    for polarity in (1, -1):
        (points,) = drawn_as(figure, f"polarity {polarity}")
        expected = block.limit_amplitude.sel(polarity=polarity) / G
        np.testing.assert_allclose(points.get_ydata(), expected, rtol=1e-14)
    (median,) = named(figure, "median")
    middle = float(block.limit_amplitude.median()) / G
    np.testing.assert_allclose(median.get_ydata(), middle, rtol=1e-14)


def test_annual_rates_are_drawn_over_millimetres(result: xr.Dataset) -> None:
    """Of each grid point a curve with markers at the displacements requested."""
    curve = slipsweep.HazardCurve(np.array([0.5, 10.0]), np.array([1e-2, 1e-5]))
    lengths = [0.001, 0.01, 0.1]
    rates = slipsweep.displacement_hazard(result.sel(theta=5.0), curve, lengths)
    figure = rates.slipsweep.chart()
    axes = figure.axes[0]
    assert axes.get_xlabel() == "permanent displacement d (mm)"
    assert axes.get_ylabel() == "mean annual rate of u > d (1/year)"
    assert legend(figure) == ["μs = 0.3", "μs = 0.4"]
    for line in axes.lines:
        np.testing.assert_allclose(line.get_xdata(), [1.0, 10.0, 100.0], rtol=1e-14)
    for mu_s in (0.3, 0.4):
        (marks,) = drawn_as(figure, f"μs = {mu_s:g}")
        assert marks.get_marker() not in ("", "None")
        expected = rates.annual_rate.sel(mu_s=mu_s)
        np.testing.assert_allclose(marks.get_ydata(), expected.where(expected > 0.0), rtol=1e-14)
    assert "Rates are computed at the markers; between them the lines are straight." in caption(
        figure
    )


def test_rates_that_come_from_above_the_amplitudes_are_dotted(result: xr.Dataset) -> None:
    """Where more than half of the rate is held; of many displacements only those marked have
    markers.
    """
    block = result.sel(theta=5.0, mu_s=0.3)
    curve = slipsweep.HazardCurve(np.array([0.5, 5.9, 30.0]), np.array([1e-2, 1e-3, 9e-4]))
    lengths = np.geomspace(0.0005, 0.06, 41)
    rates = slipsweep.displacement_hazard(block, curve, lengths)
    rates = rates.assign_attrs(marked=lengths[[10, 20]])
    held = rates.held_rate.values > 0.5 * rates.annual_rate.values
    assert held.any()
    assert not held.all()
    figure = rates.slipsweep.chart()
    solid, dotted, marks = figure.axes[0].lines
    drawn = np.where(rates.annual_rate > 0.0, rates.annual_rate, np.nan)
    np.testing.assert_array_equal(solid.get_ydata(), np.where(held, np.nan, drawn))
    shown = np.isfinite(dotted.get_ydata())
    # a dotted line begins at its neighbour that is not
    beside = held | np.append(False, held[:-1]) | np.append(held[1:], False)
    np.testing.assert_array_equal(shown, beside & np.isfinite(drawn))
    assert (solid.get_linestyle(), dotted.get_linestyle()) == ("-", ":")
    np.testing.assert_allclose(marks.get_xdata(), 1000.0 * lengths[[10, 20]], rtol=1e-14)
    text = "Dotted: more than half of the rate comes from above the largest amplitude of the sweep"
    assert text in caption(figure)
    assert not figure.legends  # the caption has what the curve is of
    assert "θ = 5°, μs = 0.3" in caption(figure)
    assert "Rates are computed at the markers" not in caption(figure)


def test_limits_of_motions_that_do_not_reach_the_displacement_are_above_all_others(
    suite: slipsweep.Suite,
) -> None:
    """The median counts them; the caption says how many they are."""
    limits = slipsweep.limit_amplitude(
        0.05, 5.0, [0.3, 0.4], excitation=suite, maximum_amplitude=7.2, model="newmark"
    )
    missing = limits.limit_amplitude.isnull().sum("motion").values
    assert 0 < missing[-1] < 4
    figure = limits.slipsweep.chart()
    (median,) = named(figure, "median")
    ordered = np.sort(limits.limit_amplitude.fillna(np.inf).values, axis=-1)
    np.testing.assert_allclose(median.get_ydata(), ordered[:, 3:5].mean(axis=1) / 9.81, rtol=1e-12)
    assert len(named(figure, "motion")) == 8
    assert f"{missing.sum()} of 16 limits are above {7.2 / 9.81:.4g} g;" in caption(figure)
    # where nothing varies but the motion, they lie along the abscissa
    axes = Figure().subplots()
    assert limits.isel(mu_s=0).slipsweep.chart(ax=axes) is axes
    assert [text.get_text() for text in axes.get_xticklabels()] == list(suite.labels)


def test_rates_beyond_the_end_of_the_hazard_curve_are_named(result: xr.Dataset) -> None:
    curve = slipsweep.HazardCurve(np.array([0.5, 10.0]), np.array([1e-2, 1e-5]))
    rates = slipsweep.displacement_hazard(result.sel(theta=5.0), curve, [0.001, 0.01, 0.1])
    axes = Figure().subplots()
    assert rates.slipsweep.chart(ax=axes) is axes
    figure = slipsweep.displacement_hazard(
        result.sel(mu_s=0.3), curve, [0.001, 0.01, 0.1]
    ).slipsweep.chart()
    assert legend(figure) == ["θ = 5°", "θ = 20°"]
    short = slipsweep.HazardCurve(np.array([0.5, 4.0]), np.array([1e-2, 8e-3]))
    figure = slipsweep.displacement_hazard(
        result.sel(theta=5.0), short, [0.001, 0.01]
    ).slipsweep.chart()
    assert "above the end of the hazard curve, where" in caption(figure)
    figure.draw_without_rendering()
    assert not any(
        "times" in text.get_text() for text in figure.axes[0].get_xticklabels(which="both")
    )
    marks = [line for line in axes.lines if line.get_marker() not in ("", "None", None)]
    for line, mu_s in zip(marks, rates.mu_s, strict=True):
        expected = rates.annual_rate.sel(mu_s=mu_s).values
        np.testing.assert_allclose(
            line.get_ydata()[expected > 0], expected[expected > 0], rtol=1e-12
        )
