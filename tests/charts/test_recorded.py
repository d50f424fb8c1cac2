"""Charts of a record and of a suite, compared with numpy and the public functions."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import slipsweep
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.model.variables import INTENSITY_MEASURES
from tests.support.charts import SUITE_AMPLITUDES, SWEEPS, caption, labelled, legend, named
from tests.support.intensity import measures_by_sums


def check_regression(figure: Figure, xs: np.ndarray, ys: np.ndarray) -> None:
    """Least squares of ln u over ln of the measure, by numpy."""
    slid = ys > 0
    logs = np.log(xs[slid]), np.log(ys[slid])
    slope, intercept = np.polyfit(*logs, 1)
    scatter = np.sqrt(np.sum((logs[1] - intercept - slope * logs[0]) ** 2) / (slid.sum() - 2))
    explained = np.corrcoef(*logs)[0, 1] ** 2
    assert (
        figure.axes[0].get_title() == f"slope {slope:.2f}, R² = {explained:.2f}, σ = {scatter:.2f}"
    )
    (line,) = named(figure, "regression")
    np.testing.assert_allclose(
        line.get_ydata(), np.exp(intercept) * line.get_xdata() ** slope, rtol=1e-9
    )


def bars_of(figure: Figure) -> tuple[np.ndarray, np.ndarray]:
    """Heights and edges of a histogram, each bar with a line around it."""
    (bars,) = figure.axes[0].containers
    edges = [patch.get_x() for patch in bars] + [bars[-1].get_x() + bars[-1].get_width()]
    assert all(
        patch.get_linewidth() > 0 and patch.get_edgecolor()[:3] == (0, 0, 0) for patch in bars
    )
    return np.array([patch.get_height() for patch in bars]), np.array(edges)


def displacements(result: xr.Dataset, **where: float) -> xr.DataArray:
    values = result["permanent_displacement"].sel(where)
    return values.stack(each=["motion", "polarity"]) * 1000.0


# ------------------------------------------------------------------------------- suites


@pytest.mark.parametrize("x", ["amplitude", "mu_s"])
def test_median_and_band_are_quantiles_of_all_motions(result: xr.Dataset, x: str) -> None:
    at = {"theta": 5.0, "mu_s": 0.3} if x == "amplitude" else {"theta": 5.0, "amplitude": 6.0}
    figure = result.slipsweep.chart("motions", x=x, at=at)
    values = displacements(result, **at)
    expected = np.quantile(values, [0.16, 0.5, 0.84], axis=values.dims.index("each"))
    (median,), edges, lines = (named(figure, gid) for gid in ("median", "edge", "motion"))
    low = figure.axes[0].get_ylim()[0]
    for line, row in zip((edges[0], median, edges[1]), expected, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), result[x])
        seen = row >= low
        assert seen.any()
        np.testing.assert_allclose(line.get_ydata()[seen], row[seen], rtol=1e-12)
        assert (line.get_ydata()[~seen] < low).all()  # zero lies below the axis, not nowhere
    drawn = np.sort([line.get_ydata() for line in lines], axis=0)
    settled = result.where(slipsweep.flags(result).not_recoupled == 0)
    shown = np.sort(displacements(settled, **at).transpose("each", x), axis=0)
    np.testing.assert_allclose(drawn[shown >= low], shown[shown >= low], rtol=1e-12)
    zeros = (values == 0).sum("each").max().item()
    text = caption(figure)
    assert "8 motions in 2 polarities; all have a value." in text
    assert ("Zero displacement: up to" in text) == (zeros > 0)
    assert "Üy by Coulomb" in text
    (theirs,) = named(figure, "newmark")  # the result is of Newmark's block itself
    np.testing.assert_array_equal(theirs.get_ydata(), median.get_ydata())


def test_motions_without_a_value_are_counted_by_reason(suite: slipsweep.Suite) -> None:
    """Scaled by 6, strong motions take the plane away from under the block."""
    result = slipsweep.sweep(35.0, 0.9, excitation=suite, scale=[1.0, 2.0, 6.0])
    missing = result.permanent_displacement.isnull()
    most = int(missing.sum("motion").max())
    assert 0 < most < 8
    figure = result.slipsweep.chart()
    assert f"up to {most} of 8 have no value and are left out (uplift {most})" in caption(figure)
    (median,) = named(figure, "median")
    expected = 1000.0 * np.asarray(np.nanquantile(result.permanent_displacement, 0.5, axis=1))
    seen = expected > figure.axes[0].get_ylim()[0]
    assert seen.any()
    np.testing.assert_allclose(median.get_ydata()[seen], expected[seen], rtol=1e-12)


@pytest.mark.parametrize("measure", list(INTENSITY_MEASURES))
def test_intensity_is_that_of_the_motion_as_it_shakes_the_block(
    suite: slipsweep.Suite, measure: str
) -> None:
    """Against the measures of a record that is scaled and stretched before they are taken."""
    stretched = (
        1.0 if measure == "mean_period" else 1.25
    )  # it is of frequencies that time does not change
    result = slipsweep.sweep(
        5.0, 0.3, 2.5, excitation=suite, time_scale=stretched
    )  # one does not slide
    figure = result.slipsweep.chart("intensity", x=measure)
    pairs = zip(suite.components, result.motion_factor.values, strict=True)
    shaken = [
        slipsweep.Record(one.times * stretched, one.acceleration * factor) for one, factor in pairs
    ]
    expected = np.array([measures_by_sums(one.times, one.acceleration)[measure] for one in shaken])
    values = result.permanent_displacement.values * 1000.0
    (points,) = named(figure, "a motion")
    (below,) = named(figure, "below")
    shown = values >= figure.axes[0].get_ylim()[0]
    assert shown.sum() > 3
    drawn = np.empty(values.size)
    drawn[shown] = points.get_xdata()
    drawn[~shown] = below.get_xdata()
    np.testing.assert_allclose(drawn, expected, rtol=1e-5)
    np.testing.assert_allclose(points.get_ydata(), values[shown], rtol=1e-12)
    if measure == "pga":  # all are scaled to it
        assert figure.axes[0].get_title() == "no regression: one value for all motions"
    else:
        check_regression(figure, drawn, values)


def test_histogram_counts_every_motion_that_slides(result: xr.Dataset) -> None:
    at = {"theta": 5.0, "mu_s": 0.4, "amplitude": 4.0}
    values = displacements(result, **at).values
    zeros = np.count_nonzero(values == 0)
    assert 0 < zeros < values.size
    figure = result.slipsweep.chart("histogram", at=at)
    counts, edges = bars_of(figure)
    np.testing.assert_array_equal(counts, np.histogram(values[values > 0], edges)[0])
    assert counts.sum() == values.size - zeros
    for amplitude in SUITE_AMPLITUDES[
        2:
    ]:  # the largest lies in the last bar, however its logarithm is rounded
        for mu_s in (0.3, 0.4):
            at = {"theta": 5.0, "mu_s": mu_s, "amplitude": amplitude}
            shown, _ = bars_of(result.slipsweep.chart("histogram", at=at))
            assert shown.sum() == np.count_nonzero(displacements(result, **at) > 0)
    assert figure.axes[0].get_title() == f"zero displacement: {zeros / values.size:.0%}"
    assert f"Zero displacement: {zeros} of {values.size}" in caption(figure)


def test_displacements_that_are_rounding_count_as_zero(result: xr.Dataset) -> None:
    at = {"theta": 5.0, "mu_s": 0.3, "amplitude": 6.0}
    rounded = result.copy(deep=True)
    rounded.permanent_displacement.loc[{**at, "motion": result.motion[0]}] = 1e-48
    figure = rounded.slipsweep.chart("histogram", at=at)
    assert bars_of(figure)[1][0] > 1e-3
    assert "Zero displacement: 2 of 16" in caption(figure)
    assert "below 10⁻¹² m count as zero" in caption(figure)


def test_fragility_is_the_share_of_motions_that_exceed(result: xr.Dataset) -> None:
    at = {"theta": 5.0, "mu_s": 0.3}
    figure = result.slipsweep.chart("fragility", at=at, levels=["1mm", "5cm"])
    values = displacements(result, **at)
    for line, threshold in zip(figure.axes[0].lines[:2], (1.0, 50.0), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), (values > threshold).mean("each"))
    assert legend(figure) == ["d = 1 mm", "d = 50 mm"]
    # the same of the statistics themselves
    found = slipsweep.suite_statistics(result, thresholds=["1mm", "5cm"])
    again = found.slipsweep.chart("fragility", at=at)
    for one, other in zip(figure.axes[0].lines[:2], again.axes[0].lines[:2], strict=True):
        np.testing.assert_array_equal(one.get_ydata(), other.get_ydata())


def test_some_motions_of_a_suite(result: xr.Dataset, suite: slipsweep.Suite) -> None:
    chosen = suite.labels[:2]
    figure = result.slipsweep.chart(
        "motions", at={"motion": chosen, "polarity": -1, "theta": 5, "mu_s": 0.3}
    )
    assert len(named(figure, "motion")) == 2
    (median,) = named(figure, "median")
    values = result.permanent_displacement.sel(motion=list(chosen), polarity=-1, theta=5, mu_s=0.3)
    assert median.get_ydata()[-1] == pytest.approx(
        1000.0 * values.isel(amplitude=-1).median().item(), rel=1e-12
    )


def test_charts_that_recorded_motions_do_not_have_are_refused(result: xr.Dataset) -> None:
    for arguments, message in (
        (
            ("contours",),
            "--kind contours: is a sweep under a suite of motions: "
            "must be one of motions, fragility",
        ),
        (
            ("motions", {"at": {"mu_s": 0.35}}),
            "its neighbours are 0.3 and 0.4 .nothing is computed again",
        ),
        (
            ("motions", {"at": {"motion": "none"}}),
            "motion = none: must be a number or one of rock-far_H1",
        ),
        (("motions", {"y": "mu_s"}), "--y mu_s: not with a chart over one axis, --x; use --panels"),
        (("intensity", {"x": "mu_s"}), "--x mu_s: no intensity measure; known here: pga, pgv"),
        (
            ("motions", {"panels": ["mu_s"], "ax": Figure().subplots()}),
            "ax: is one panel, and this chart has 2",
        ),
    ):
        kind, options = (*arguments, {})[:2]
        with pytest.raises(InputError, match=message):
            result.slipsweep.chart(kind, **options)


def test_a_record_has_a_curve_for_each_friction_coefficient() -> None:
    record = slipsweep.read_record(SWEEPS / "data" / "synthetic.csv")
    result = slipsweep.sweep(
        5.0, [0.3, 0.4], excitation=record, scale=[1.0, 1.5, 2.0], polarity="both"
    )
    figure = result.slipsweep.chart(show_cautions=True)
    for line, mu_s in zip(labelled(figure, "μs"), result.mu_s, strict=True):
        expected = (
            result.permanent_displacement.sel(mu_s=mu_s, polarity=1) * 1000.0
        )  # the record as it is
        np.testing.assert_allclose(
            line.get_ydata()[expected > 0], expected[expected > 0], rtol=1e-12
        )
    # marked as unsound: where the displacement falls as the shaking grows
    scales = np.linspace(0.5, 12, 60)
    many = slipsweep.sweep(0.0, 0.3, excitation=record, scale=scales, polarity=-1).squeeze()
    u = many.permanent_displacement.values
    sound = ~slipsweep.flags(many).not_recoupled.values
    marked = [
        line.get_xdata()[np.isfinite(line.get_ydata())]
        for line in named(many.slipsweep.chart(), "unsound")
    ]
    np.testing.assert_array_equal(
        np.isin(scales[1:], np.concatenate(marked)), (u[1:] < u[:-1]) & (u[1:] > 0) & sound[1:]
    )


def test_newmarks_block_is_solved_under_the_record_in_the_file(tmp_path: Path) -> None:
    """A dataset without the record has no curve of it, and no word of it in the legend."""
    sweep = (SWEEPS / "records.toml").read_text().replace("data/", f"{SWEEPS}/data/")
    (tmp_path / "r.toml").write_text(sweep.replace("values = [0.5, 1, 2]", "values = [2.0]"))
    assert main(["run", str(tmp_path / "r.toml"), "-o", str(tmp_path / "r.nc"), "-q"]) == 0
    at = {"theta": 0, "mu_s": 0.3, "polarity": -1}
    record = slipsweep.read_record(SWEEPS / "data" / "synthetic.csv", units="g", baseline="linear")
    with slipsweep.open_result(tmp_path / "r.nc") as data:
        expected = (
            1000
            * slipsweep.sweep(
                0,
                0.3,
                excitation=record,
                scale=data.scale.values,
                time_scale=2.0,
                polarity=-1,
                model="newmark",
            ).permanent_displacement
        )
        (line,) = named(data.slipsweep.chart(at=at), "newmark")
        np.testing.assert_allclose(line.get_ydata(), expected.where(expected > 0), rtol=1e-12)
        without = data.drop_vars(["record_time", "record_acceleration"]).slipsweep.chart(at=at)
    assert "falls with A" in legend(without)
    assert not any("Newmark" in text for text in legend(without))
