"""Curves: their data are the model's, and they break where values have no meaning."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.cli import main
from slipsweep.studies.cautions import percent
from tests.support.charts import (
    AMPLITUDES,
    FREQUENCIES,
    LINED_SINE,
    SINE,
    caption,
    labelled,
    legend,
    named,
)


def test_one_curve_has_newmarks_beside(grid: xr.Dataset, lined: xr.Dataset) -> None:
    """Over the frequency, the amplitude and ky; with one axis left it is what is drawn."""
    at: dict[str, Any] = {"theta": 6, "mu_s": 0.45}
    for x, cut in (("amplitude", {"frequency": 2.0}), ("frequency", {"amplitude": 9.0})):
        figure = grid.slipsweep.chart(at=at | cut)
        given: dict[str, Any] = {x: grid[x].values, **cut, "excitation": SINE}
        ours, theirs = (
            slipsweep.sweep(6.0, 0.45, **given, model=model).permanent_displacement.values * 1000
            for model in ("mendez", "newmark")
        )
        xs, ys = labelled(figure, "this result")[0].get_data()
        on_grid = np.isin(xs, grid[x]) & np.isfinite(ys)
        np.testing.assert_allclose(ys[on_grid], ours[np.isin(grid[x], xs[on_grid])], rtol=1e-12)
        assert on_grid.sum() > 10
        (line,) = named(figure, "newmark")
        np.testing.assert_allclose(
            line.get_ydata(), np.where(theirs > 0, theirs, np.nan), rtol=1e-12
        )
        lines = (
            {"yield": "yield_line", "mode limit (Eq. 7)": "limit_line"} if x == "amplitude" else {}
        )
        assert {*legend(figure)} >= {"Newmark's block", *lines}
        marks = [line.get_xdata()[0] for gid in lines.values() for line in named(figure, gid)]
        assert marks == pytest.approx(
            [3.2306287100, 7.9326887206] if lines else []
        )  # g tan(φ − θ), Eq. 7


def test_newmarks_block_over_its_yield_coefficient(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ky = np.linspace(0.05, 0.4, 8)
    given: dict[str, Any] = {
        "amplitude": np.linspace(1, 6, 11),
        "frequency": [0.5, 1, 2],
        "model": "newmark",
    }
    result = slipsweep.sweep(yield_coefficient=ky, **given)
    result.to_netcdf("ky.nc")
    assert main(["chart", "ky.nc"]) == 0
    assert capsys.readouterr().out.split() == [
        f"ky-{kind}.png" for kind in ("contours", "modes", "families", "dimensionless")
    ]
    assert main(["report", "ky.nc"]) == 0
    assert (
        Path("ky.pdf").read_bytes().count(b"/Type /Page ") == 1 + 4
    )  # no ratio of Newmark's block to itself
    for at in ({"amplitude": 3.0, "frequency": 1}, {"ky": ky[2], "frequency": 1}):
        figure = result.slipsweep.chart(at=at)
        expected = result.permanent_displacement.rename(yield_coefficient="ky").sel(at) * 1000
        xs, ys = labelled(figure, "Newmark's block")[0].get_data()
        np.testing.assert_array_equal(xs, expected[expected.dims[0]])
        np.testing.assert_allclose(ys, expected.where(expected > 0))
        assert ("no sliding: Üy above A" in legend(figure)) == ("amplitude" in at)
    (line,) = named(result.slipsweep.chart("modes", at={"frequency": 1}), "yield_line")
    along, amplitudes = np.concatenate(line.allsegs[0]).T
    np.testing.assert_allclose(amplitudes, along * 9.81, rtol=1e-12)
    assert along.size > 5


def test_the_dimensionless_chart_is_of_any_frequency(grid: xr.Dataset) -> None:
    for frequency in FREQUENCIES[[0, 24]]:
        at = {"theta": 6, "mu_s": (0.3, 0.6), "frequency": frequency}
        figure = grid.slipsweep.chart("dimensionless", y="mu_s", at=at)
        for mu_s in (0.3, 0.6):
            onset = slipsweep.friction_parameters(6.0, mu_s, 1.0).yield_acceleration.item()
            found = dict(zip(*labelled(figure, f"μs = {mu_s:g}")[0].get_data(), strict=True))
            u = grid.permanent_displacement.sel(
                theta=6, mu_s=mu_s, frequency=FREQUENCIES[12]
            ).values
            ys = np.array([found[x] for x in AMPLITUDES / onset])
            there = np.isfinite(ys) & (ys > 0)
            expected = u * (2 * np.pi * FREQUENCIES[12]) ** 2 / AMPLITUDES
            np.testing.assert_allclose(ys[there], expected[there], rtol=1e-12)
        assert figure.axes[0].get_xlabel() == "peak ground acceleration over yield, A / Üy"
        assert figure.axes[0].get_ylabel() == "permanent displacement, u\u00a0ω²\u00a0/\u00a0A"
        assert figure.axes[0].get_xlim()[0] == 1.0
        assert figure.axes[0].get_xscale() == figure.axes[0].get_yscale() == "log"


def test_curves_break_at_the_mode_limit(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart(
        "families", at={"theta": 6, "mu_s": 0.45, "frequency": (1.0, 5.0)}
    )
    limit = slipsweep.friction_parameters(6.0, 0.45, 1.0).limiting_acceleration.item()
    beyond = int(np.searchsorted(AMPLITUDES, limit))
    for line, jump in zip(labelled(figure, "f = "), named(figure, "jump"), strict=True):
        xs, ys = line.get_data()
        assert (xs[beyond], np.isnan(ys[beyond])) == (AMPLITUDES[beyond], True)
        np.testing.assert_array_equal(jump.get_xdata(), AMPLITUDES[[beyond - 1, beyond]])
        np.testing.assert_array_equal(jump.get_ydata(), ys[[beyond - 1, beyond + 1]])


def test_values_that_are_unreliable_leave_a_gap(lined: xr.Dataset) -> None:
    direct = slipsweep.sweep(14.0, 0.25, lined.amplitude.values, 1.0, excitation=LINED_SINE)
    flags = slipsweep.flags(direct)
    assert flags.not_recoupled.any()
    assert flags.upslope.any()
    at: dict[str, Any] = {"theta": 14, "frequency": 1, "mu_s": (0.25, 0.35)}
    for shown in (False, True):
        figure = lined.slipsweep.chart("families", at=at, show_cautions=shown)
        xs, ys = labelled(figure, "μs = 0.25")[0].get_data()
        seen = [
            bool(np.isfinite(ys[xs == amplitude]).any()) for amplitude in direct.amplitude.values
        ]
        # a logarithmic axis has no place for upslope
        expected = ~flags.upslope.values if shown else ~(flags.not_recoupled | flags.upslope).values
        np.testing.assert_array_equal(seen, expected & (direct.permanent_displacement.values > 0))
        text = caption(figure)
        assert ("Drawn on request: values flagged not_recoupled" in text) == shown
        assert ("Left out: values flagged not_recoupled (does not come to rest" in text) == (
            not shown
        )
        (mark,) = [one for one in named(figure, "caution") if np.isfinite(one.get_ydata()).any()][
            :1
        ]
        assert mark.get_linewidth() > 5
    velocity = lined.slipsweep.chart(
        "families",
        y="mu_s",
        at=at | {"mu_s": (0.25,)},
        variable="peak_relative_velocity",
        show_cautions=True,
    )
    assert np.isfinite(
        labelled(velocity, "μs = 0.25")[0].get_ydata()[-1]
    )  # of a block that ends upslope it is above 0


def test_a_single_point_is_barred_too_and_angles_are_not_logarithmic() -> None:
    result = slipsweep.sweep([8.0, 11.0, 14.0, 18.4], 0.35, 4.905, 1.0, excitation=LINED_SINE)
    figure = result.slipsweep.chart("curve", x="theta", width="90mm")
    assert figure.axes[0].get_xscale() == "linear"
    (line,) = named(figure, "caution")
    there = np.isfinite(line.get_ydata())
    assert there.any()
    assert line.get_marker() == "."
    figure.draw_without_rendering()
    label = figure.axes[0].yaxis.label.get_window_extent()
    assert label.y1 <= figure.legends[0].get_window_extent().y0
    assert [percent(share) for share in (1.0, 0.996, 0.054, 0.00312)] == [
        "100 %",
        "100 %",
        "5.4 %",
        "0.31 %",
    ]


def test_spread_is_between_the_options_there_are(lined: xr.Dataset) -> None:
    figure = lined.slipsweep.chart("spread", at={"theta": 11, "mu_s": 0.35, "frequency": 1})
    amplitudes = lined.amplitude.values
    given: dict[str, Any] = {"theta": 11.0, "mu_s": 0.35, "amplitude": amplitudes, "frequency": 1.0}
    given["excitation"] = LINED_SINE
    expected = {"Newmark's block": slipsweep.sweep(**given, model="newmark")}
    for recoupling, text in (("eq12", "stop by Eq. 12"), ("integrate", "stop by integration")):
        model = slipsweep.Mendez(recoupling=recoupling)  # type: ignore[arg-type]
        expected[f"λ by Eq. 6, {text}"] = slipsweep.sweep(**given, model=model)
        for rate in (2.0, 3.0):
            expected[f"λ = {rate:g}, {text}"] = slipsweep.sweep(
                **given, model=model, decay_rate=rate
            )
    expected["this result:\nλ by Eq. 6, stop by Eq. 12"] = expected["λ by Eq. 6, stop by Eq. 12"]
    rows = []
    for label, answer in expected.items():
        xs, ys = labelled(figure, label)[0].get_data()
        values = answer.permanent_displacement.values * 1000
        at = np.searchsorted(xs, amplitudes, side="right") - 1  # behind the gap at the mode limit
        np.testing.assert_allclose(ys[at], np.where(values > 0, values, np.nan), rtol=1e-12)
        assert label in legend(figure)
        rows.append(values)
    vertices = np.concatenate([path.vertices for path in named(figure, "spread")[0].get_paths()])
    ends = zip(np.min(rows, axis=0), np.max(rows, axis=0), strict=True)
    for amplitude, (least, most) in zip(amplitudes, ends, strict=True):
        if most > 0:
            drawn = vertices[vertices[:, 0] == amplitude, 1]
            assert drawn.max() == pytest.approx(most, rel=1e-12)
            assert drawn.min() == pytest.approx(max(least, 1e-300), rel=1e-12)


@pytest.mark.parametrize(("units", "factor"), [("m/s2", 1.0), ("g", 1.0 / 1.62)])
def test_curves_and_thresholds_over_the_amplitude_in_both_units(units: str, factor: float) -> None:
    """On the moon: "g" is the gravity of the result."""
    amplitudes = np.linspace(0.1, 2.0, 20)
    model = slipsweep.Mendez(g=1.62)
    result = slipsweep.sweep(5.0, [0.4, 0.5], amplitudes, [1.0, 2.0], model=model)
    figure = result.slipsweep.chart(at={"mu_s": 0.4, "frequency": 2}, units=units)
    (line,) = labelled(figure, "this result")
    expected = 1000.0 * result.permanent_displacement.sel(mu_s=0.4, frequency=2.0)
    there = np.isfinite(line.get_ydata())
    np.testing.assert_allclose(line.get_ydata()[there], expected[expected > 0.0], rtol=1e-12)
    slides = amplitudes[(expected > 0.0).values]
    np.testing.assert_allclose(line.get_xdata()[there], factor * slides, rtol=1e-12)
    thresholds = slipsweep.friction_parameters(5.0, 0.4, 1.0, model=model)
    for gid, name in (
        ("yield_line", "yield_acceleration"),
        ("limit_line", "limiting_acceleration"),
    ):
        (mark,) = named(figure, gid)
        assert mark.get_xdata()[0] == pytest.approx(factor * thresholds[name].item(), rel=1e-12)
    label = {"m/s2": "(m/s²)", "g": "(g)"}[units]
    assert figure.axes[0].get_xlabel() == f"peak ground acceleration A {label}"
    assert figure.axes[0].get_ylabel() == "permanent displacement, downslope (mm)"


def test_families_have_their_unit_and_newmarks_curves_their_dash(grid: xr.Dataset) -> None:
    """Velocities in m/s; of displacements in mm a thin curve of Newmark's block beside each."""
    at: dict[str, Any] = {"theta": 6, "mu_s": 0.45, "frequency": (1.0, 5.0)}
    figure = grid.slipsweep.chart("families", at=at, variable="peak_relative_velocity")
    assert figure.axes[0].get_ylabel() == "largest downslope relative velocity (m/s)"
    frequencies = grid.frequency.values[[14, 17]]
    figure = grid.slipsweep.chart("families", at=at | {"frequency": tuple(frequencies)})
    lines = labelled(figure, "f = ")
    theirs = named(figure, "newmark")
    for frequency, line, other in zip(frequencies, lines, theirs, strict=True):
        assert line.get_label() == f"f = {frequency:.4g} Hz"
        direct = slipsweep.sweep(
            6.0, 0.45, AMPLITUDES, frequency, excitation=SINE, model="newmark"
        ).permanent_displacement
        np.testing.assert_allclose(
            other.get_ydata(), 1000.0 * direct.where(direct > 0.0), rtol=1e-12
        )
        assert other.is_dashed() == line.is_dashed()
    assert [line.is_dashed() for line in theirs] == [False, True]
    assert "Newmark's block (same dash)" in legend(figure)
