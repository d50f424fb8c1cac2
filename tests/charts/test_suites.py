"""Charts of suites of motions: units, legends, Newmark's block beside the paper's, what a
regression is of.
"""

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.studies.cautions import percent
from tests.support.charts import SUITE_AMPLITUDES, caption, drawn_as, legend, named

G = 9.81


@pytest.fixture(scope="module")
def both(suite: slipsweep.Suite) -> xr.Dataset:
    """The paper's block with a decaying interface, and Newmark's, whose
    displacements are others.
    """
    return slipsweep.sweep(
        2.0,
        0.3,
        SUITE_AMPLITUDES,
        excitation=suite,
        polarity="both",
        yield_acceleration=1.0,
        decay_rate=2.5,
        variables=["permanent_displacement", "validity", "newmark_displacement", "motion_factor"],
    )


def quantiles_of(values: xr.DataArray) -> np.ndarray:
    """16, 50 and 84 % of all motions and polarities, mm."""
    stacked = values.stack(each=["motion", "polarity"])
    return 1000.0 * np.quantile(stacked, [0.16, 0.5, 0.84], axis=stacked.dims.index("each"))


def test_newmarks_median_is_that_of_newmarks_block(both: xr.Dataset) -> None:
    figure = both.slipsweep.chart("motions", show_cautions=True)
    axes = figure.axes[0]
    low = axes.get_ylim()[0]
    medians = {
        "median": quantiles_of(both.permanent_displacement)[1],
        "median, Newmark's block": quantiles_of(both.newmark_displacement)[1],
    }
    ours, theirs = medians.values()
    seen = np.maximum(ours, theirs) >= low
    assert (np.abs(ours - theirs)[seen] > 0.05 * ours[seen]).any()
    for text, expected in medians.items():
        (line,) = drawn_as(figure, text)
        np.testing.assert_allclose(line.get_xdata(), SUITE_AMPLITUDES, rtol=1e-14)
        shown = expected >= low
        assert shown.any()
        np.testing.assert_allclose(line.get_ydata()[shown], expected[shown], rtol=1e-12)
    assert legend(figure) == ["median", "16 to 84 %", "a motion", "median, Newmark's block"]
    assert axes.get_xlabel() == "peak ground acceleration A (m/s²)"
    assert axes.get_ylabel() == "permanent displacement (mm)"


def test_motions_over_accelerations_in_g(both: xr.Dataset) -> None:
    figure = both.slipsweep.chart("motions", units="g", show_cautions=True)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "peak ground acceleration A (g)"
    assert "Üy = 0.1019 g" in caption(figure)
    for gid in ("median", "motion", "edge", "newmark"):
        for line in named(figure, gid):
            np.testing.assert_allclose(line.get_xdata(), SUITE_AMPLITUDES / G, rtol=1e-14)
    (second,) = axes.child_axes
    assert second.get_xlabel() == "A (m/s²)"
    assert second.get_xlim() == pytest.approx([G * end for end in axes.get_xlim()])


def test_ratio_to_newmark_in_the_caption_is_that_of_the_motions_drawn(both: xr.Dataset) -> None:
    text = caption(both.slipsweep.chart("motions"))
    reliable = ~(slipsweep.flags(both).not_recoupled | slipsweep.flags(both).upslope)
    slides = (both.permanent_displacement > 0.0) & (both.newmark_displacement > 0.0) & reliable
    ratio = (both.permanent_displacement / both.newmark_displacement).where(slides)
    low, middle, high = np.nanquantile(ratio, (0.05, 0.5, 0.95))
    assert (
        f"median {middle:.3g}; 90 % of the sliding cells shown lie between {low:.3g} and {high:.3g}"
        in text
    )


def test_histogram_marks_median_and_quantiles_in_millimetres(both: xr.Dataset) -> None:
    figure = both.slipsweep.chart("histogram", at={"amplitude": 6.0})
    axes = figure.axes[0]
    assert axes.get_xlabel() == "permanent displacement (mm)"
    assert axes.get_ylabel() == "number of motions"
    low, middle, high = quantiles_of(both.permanent_displacement.sel(amplitude=6.0))
    (median,) = named(figure, "median")
    np.testing.assert_allclose(median.get_xdata(), middle, rtol=1e-12)
    edges = [line.get_xdata()[0] for line in named(figure, "16 and 84 %")]
    np.testing.assert_allclose(edges, [low, high], rtol=1e-12)
    assert legend(figure) == ["median", "16 and 84 %"]


def test_intensity_has_a_mark_for_each_polarity(both: xr.Dataset) -> None:
    """Every motion at its own measure; those that slide too little lie at the lower edge."""
    figure = both.slipsweep.chart("intensity", x="cav", at={"amplitude": 6.0}, show_cautions=True)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "cumulative absolute velocity (m/s)"
    assert axes.get_ylabel() == "permanent displacement (mm)"
    block = both.sel(amplitude=6.0)
    low = axes.get_ylim()[0]
    names = {1: "polarity 1", -1: "polarity −1"}
    for polarity, name in names.items():
        own = block.sel(polarity=polarity)
        values = 1000.0 * own.permanent_displacement
        shown = (values >= low).values
        assert shown.any()
        (points,) = named(figure, name)
        expected = own.motion_cav * own.motion_factor
        np.testing.assert_allclose(points.get_xdata(), expected[shown], rtol=1e-12)
        np.testing.assert_allclose(points.get_ydata(), values[shown], rtol=1e-12)
        assert drawn_as(figure, name) == [points]


@pytest.mark.parametrize(
    ("measure", "label"),
    [
        ("pga", "peak ground acceleration (m/s²)"),
        ("pgv", "peak ground velocity (m/s)"),
        ("pgd", "peak ground displacement (m)"),
        ("arias_intensity", "Arias intensity (m/s)"),
        ("significant_duration", "significant duration, 5 to 95 % of the Arias intensity (s)"),
        ("mean_period", "mean period, 0.25 to 20 Hz (s)"),
    ],
)
def test_measures_have_their_units(both: xr.Dataset, measure: str, label: str) -> None:
    figure = both.slipsweep.chart("intensity", x=measure, at={"amplitude": 6.0})
    assert figure.axes[0].get_xlabel() == label


@pytest.mark.parametrize("shown", [False, True])
def test_a_regression_says_how_many_motions_it_leaves_out(both: xr.Dataset, shown: bool) -> None:
    """Those flagged not_recoupled, unless they are drawn on request."""
    flagged = both.copy(deep=True)
    block = {"amplitude": 6.0, "polarity": 1}
    slides = flagged.permanent_displacement.sel(block) > 0.0
    assert slides.sum() > 4
    three = flagged.motion.values[slides.values][:3]
    flagged.validity.loc[{**block, "motion": three}] |= int(slipsweep.Validity.NOT_RECOUPLED)
    figure = flagged.slipsweep.chart("intensity", at=block, show_cautions=shown)
    reliable = ~slipsweep.flags(flagged.sel(block)).not_recoupled | shown
    used = (slides & reliable).values
    own = flagged.sel(block)
    xs = (own.motion_pgv * own.motion_factor).values[used]
    slope, _ = np.polyfit(np.log(xs), np.log(own.permanent_displacement.values[used]), 1)
    assert figure.axes[0].get_title().startswith(f"slope {slope:.2f}, ")
    left = int((slides & ~reliable).sum())
    text = "Regression of ln u on the logarithm of the abscissa, of all motions that slide"
    assert f"{text}{f', but for {left} left out' if left else ''}; σ" in caption(figure)
    assert (left > 0) != shown


def test_the_caption_counts_zeros_and_shares_of_cautions(result: xr.Dataset) -> None:
    """Zeros at the grid point that has most of them; a caution's share of all values
    of the slice.
    """
    at = {"theta": 5.0, "mu_s": 0.3}
    flagged = result.sel(at).copy(deep=True)
    zeros = (flagged.permanent_displacement == 0.0).sum(["motion", "polarity"])
    assert zeros.min() < zeros.max()
    two = {"amplitude": 6.0, "motion": flagged.motion.values[:2], "polarity": 1}
    flagged.validity.loc[two] |= int(slipsweep.Validity.NOT_RECOUPLED)
    text = caption(flagged.slipsweep.chart("motions", show_cautions=True))
    assert f"Zero displacement: up to {int(zeros.max())} of 16; they lie below" in text
    share = percent(2 / flagged.validity.size)
    cautions = "Statistics are of all values, also those with a caution: not_recoupled"
    assert f"{cautions} {share}." in text
