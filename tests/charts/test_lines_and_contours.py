"""Lines of thresholds and contours of maps: they lie where the equations put them."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

import slipsweep
from slipsweep.charts import style
from tests.support.charts import (
    AMPLITUDES,
    LINED_SINE,
    SINE,
    caption,
    inside,
    legend,
    named,
)


@pytest.mark.parametrize(
    ("x", "y"), [("frequency", "amplitude"), ("theta", "amplitude"), ("amplitude", "theta")]
)
def test_lines_of_yield_and_mode_limit_lie_where_the_equations_put_them(
    grid: xr.Dataset, x: str, y: str
) -> None:
    at = {"theta": 6, "mu_s": 0.3} if x == "frequency" else {"frequency": 1, "mu_s": 0.3}
    figure = grid.slipsweep.chart("modes", x=x, y=y, at=at)
    other = x if y == "amplitude" else y
    thetas = 6.0 if other == "frequency" else grid.theta.values
    expected = slipsweep.friction_parameters(thetas, 0.3, 1.0)
    for gid, name in (
        ("yield_line", "yield_acceleration"),
        ("limit_line", "limiting_acceleration"),
    ):
        (line,) = named(figure, gid)
        vertices = np.concatenate(line.allsegs[0])
        along, values = vertices.T if y == "amplitude" else vertices.T[::-1]
        on_grid = np.isin(along, grid[other])
        assert on_grid.sum() > 3
        # also below what slides under its own weight, which covers the rest of the line
        at_cells = expected[name].sel(theta=along[on_grid]) if expected.dims else expected[name]
        np.testing.assert_allclose(values[on_grid], at_cells, rtol=1e-12)


def test_lines_over_a_displacement_amplitude() -> None:
    """A = ω²d: on the line of yield d = Üy/ω²."""
    result = slipsweep.sweep(
        5.0, 0.4, displacement_amplitude=np.linspace(0.01, 0.4, 23), frequency=[1.0, 2.0, 4.0]
    )
    (line,) = named(result.slipsweep.chart("contours"), "yield_line")
    threshold = slipsweep.friction_parameters(5.0, 0.4, 1.0).yield_acceleration.item()
    frequencies, amplitudes = np.concatenate(line.allsegs[0]).T
    on_grid = np.isin(frequencies, result.frequency)
    assert on_grid.sum() >= 2
    expected = threshold / (2 * np.pi * frequencies) ** 2
    np.testing.assert_allclose(amplitudes[on_grid], expected[on_grid], rtol=1e-12)


def test_contours_lie_where_the_displacement_is_their_level(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    drawn = named(figure, "contours")
    assert len(drawn) == 2  # below the mode limit and beyond it
    assert all(len(segments[0]) for segments in drawn[0].allsegs)
    checked = 0
    for side in drawn:
        for level, segments in zip(side.levels, side.allsegs, strict=True):
            every = np.concatenate([*segments, np.empty((0, 2))])
            # between rows the amplitude is interpolated too
            rows = every[np.isclose(every[:, 1:], AMPLITUDES).any(axis=1)][::5]
            for frequency, amplitude in rows:
                exact = slipsweep.sweep(
                    6.0, 0.45, amplitude, frequency, excitation=SINE
                ).permanent_displacement
                assert exact.item() == pytest.approx(
                    10**level, rel=0.02
                )  # straight in f between points
            checked += len(rows)
    assert checked > 20


def test_what_does_not_slide_has_no_colour_of_a_displacement(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    figure.draw_without_rendering()
    axes = figure.axes[0]
    threshold = slipsweep.friction_parameters(6.0, 0.45, 1.0).yield_acceleration.item()
    covers = [one for one in axes.collections if one.get_zorder() == 1.05]
    low, high = covers[0].get_paths()[0].get_extents().intervaly
    assert low <= axes.get_ylim()[0]
    assert high == pytest.approx(threshold, rel=1e-12)
    np.testing.assert_array_equal(covers[0].get_facecolor(), [[1, 1, 1, 1]])
    assert min(style.COLOURS(0)[:3]) < 0.9  # not the white of no sliding
    assert legend(figure)[0] == legend(grid.slipsweep.chart("modes"))[0] == "no sliding"


@pytest.mark.parametrize("kind", ["contours", "newmark"])
def test_contours_leave_them_out_too(lined: xr.Dataset, kind: str) -> None:
    figure = lined.slipsweep.chart(kind, x="frequency", at={"theta": 14, "mu_s": 0.25})
    (patch,) = named(figure, "not_recoupled")
    for lines in named(figure, "contours"):
        for segment in (one for segments in lines.allsegs for one in segments):
            assert not inside(patch, segment).any()


def test_ratio_to_newmark_is_that_of_a_direct_sweep(lined: xr.Dataset) -> None:
    at = {"mu_s": 0.25, "frequency": 1}
    figure = lined.slipsweep.chart("contours", x="theta", at=at)
    given: dict[str, Any] = {
        "theta": lined.theta.values,
        "mu_s": 0.25,
        "amplitude": lined.amplitude.values,
    }
    ours, theirs = (
        slipsweep.sweep(**given, frequency=1.0, model=model, excitation=LINED_SINE)
        for model in ("mendez", "newmark")
    )
    kept = slipsweep.flags(ours).not_recoupled.values == 0
    ratio = ours.permanent_displacement.values / theirs.permanent_displacement.values.clip(1e-300)
    ratio = ratio[kept & (theirs.permanent_displacement.values > 0) & (ratio > 0)]
    low, middle, high = np.quantile(ratio, (0.05, 0.5, 0.95))
    spread = f"90 % of the sliding cells shown lie between {low:.3g} and {high:.3g}."
    text = f"median {middle:.3g}; {spread}"
    assert text in caption(figure)


def cells_of(figure: Figure, xs: Any, ys: Any) -> np.ndarray:
    """Values drawn at cells; on either side of the mode limit they have a mesh of their own."""
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    drawn = np.full((len(ys), len(xs)), np.nan)
    for mesh in (one for one in figure.axes[0].collections if isinstance(one, QuadMesh)):
        logs: Any = np.ma.filled(np.ma.asarray(mesh.get_array()), np.nan)
        seen = np.ones(len(points), bool)
        clip: Any = mesh.get_clip_path()
        if clip is not None:
            region = clip.get_fully_transformed_path()
            seen = region.contains_points(figure.axes[0].transData.transform(points))
        seen = seen.reshape(drawn.shape)
        drawn[seen] = 10.0 ** logs.reshape(drawn.shape)[seen]
    return drawn


def test_the_map_of_ratios_is_our_displacement_over_newmarks(lined: xr.Dataset) -> None:
    """Cells coloured by the ratio; contours at levels and at their inverses."""
    figure = lined.slipsweep.chart("newmark", at={"mu_s": 0.25, "frequency": 1})
    given: dict[str, Any] = {
        "theta": lined.theta.values,
        "mu_s": 0.25,
        "amplitude": lined.amplitude.values,
        "frequency": 1.0,
        "excitation": LINED_SINE,
    }
    ours = slipsweep.sweep(**given)
    theirs = slipsweep.sweep(**given, model="newmark").permanent_displacement
    kept = ~(slipsweep.flags(ours).not_recoupled | slipsweep.flags(ours).upslope)
    ratio = (ours.permanent_displacement / theirs).where(kept & (theirs > 0.0))
    drawn = cells_of(figure, lined.theta.values, lined.amplitude.values)
    expected = ratio.transpose("amplitude", "theta").values
    shown = np.isfinite(drawn) & np.isfinite(expected)
    assert shown.any()
    np.testing.assert_allclose(drawn[shown], expected[shown], rtol=1e-12)
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "displacement over that of Newmark's block"
    texts = [text.get_text() for text in bar.get_yticklabels()]
    assert "1.1" in texts
    assert "0.91" in texts


def test_cells_of_contours_have_the_colour_of_their_displacement(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    moved = grid.sel(theta=6.0, mu_s=0.45).permanent_displacement
    expected = moved.transpose("amplitude", "frequency").values
    drawn = cells_of(figure, grid.frequency.values, grid.amplitude.values)
    shown = (expected > 1e-5) & np.isfinite(drawn)  # less is a hundredth of the lowest level
    assert shown.sum() > 100
    np.testing.assert_allclose(drawn[shown], expected[shown], rtol=1e-12)
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "permanent displacement, downslope"
    assert [text.get_text() for text in bar.get_yticklabels()][:3] == ["1 mm", "3 mm", "10 mm"]


def test_every_cell_lies_under_the_patch_of_its_mode(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("modes", x="frequency", at={"theta": 6, "mu_s": 0.45})
    cells = grid.sel(theta=6.0, mu_s=0.45).transpose("amplitude", "frequency")
    mesh = np.stack(np.meshgrid(grid.frequency, grid.amplitude), axis=-1).reshape(-1, 2)
    topmost = np.full(cells.sliding_mode.shape, -1)
    patches = {mode: named(figure, text)[0] for mode, text in style.MODE_TEXT.items()}
    for mode in sorted(patches, key=lambda mode: patches[mode].get_zorder()):
        topmost[inside(patches[mode], mesh).reshape(topmost.shape)] = int(mode)
    np.testing.assert_array_equal(topmost, cells.sliding_mode)
