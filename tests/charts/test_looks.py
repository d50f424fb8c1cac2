"""Labels, units, legends, captions and colours of charts."""

import itertools

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import slipsweep
from slipsweep.charts import kinds, style
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Options
from slipsweep.errors import InputError
from tests.support.charts import (
    SWEEP_KINDS,
    caption,
    labelled,
    named,
)


def test_axes_have_units_and_the_caption_its_parameters(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    axes = figure.axes[0]
    assert axes.get_xlabel() == "excitation frequency f (Hz)"
    assert axes.get_ylabel() == "peak ground acceleration A (m/s²)"
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert figure.get_supxlabel().startswith(
        "θ = 6°, μs = 0.45\nÜy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated\n"
        "Mendez et al. 2012, monotone rise, recoupling by Eq. 12; 5 cycles of a sine; slipsweep "
    )


def test_acceleration_in_g(lined: xr.Dataset) -> None:
    for units, ends, label, other in (
        ("m/s2", (0.1962, 7.848), "(m/s²)", "A (g)"),
        ("g", (0.02, 0.8), "(g)", "A (m/s²)"),
    ):
        figure = lined.slipsweep.chart("contours", x="theta", at={"mu_s": 0.35}, units=units)
        axes = figure.axes[0]
        assert axes.get_ylim() == pytest.approx(ends)
        assert axes.get_ylabel().endswith(label)
        (second,) = axes.child_axes
        assert second.get_ylabel() == other
        factor = 9.81 if units == "g" else 1 / 9.81
        assert second.get_ylim() == pytest.approx([end * factor for end in ends])
        expected = slipsweep.friction_parameters(lined.theta, 0.35, 1.0).yield_acceleration.values
        vertices = np.concatenate(named(figure, "yield_line")[0].allsegs[0])
        drawn = vertices[np.isin(vertices[:, 0], lined.theta), 1]
        np.testing.assert_allclose(
            drawn, np.sort(expected)[::-1] / (9.81 if units == "g" else 1), rtol=1e-12
        )
    modes = lined.slipsweep.chart("modes", x="theta", y="mu_s", at={"amplitude": "0.5g"}, units="g")
    assert "A = 0.5 g" in caption(modes)


def test_ratios_have_one_order_of_lightness() -> None:
    colours = style.ratio_colours(5)
    lightness = style.to_grey(colours(np.arange(colours.N)))[:, 0]
    assert (np.diff(lightness) < -0.01).all()
    assert np.ptp(colours(5)[:3]) < 0.01  # grey at 1
    assert colours(0)[0] > colours(0)[2]  # warm below
    assert colours(10)[0] < colours(10)[2]  # cold above


@pytest.mark.parametrize("kind", SWEEP_KINDS)
def test_a_narrow_grey_chart_is_legible(lined: xr.Dataset, kind: str) -> None:
    """Nothing is cut off, no legend lies on the data, no entry is without its mark, and nothing has
    a colour.
    """
    figure = lined.slipsweep.chart(
        kind, at={"mu_s": 0.25}, width=90 if kind == "modes" else "90mm", grey=True
    )
    figure.draw_without_rendering()
    width, height = figure.get_size_inches()
    assert width == pytest.approx(90 / 25.4)
    box = figure.get_tightbbox()
    assert min(box.x0, box.y0) >= -0.02
    assert box.x1 <= width + 0.02
    assert box.y1 <= height + 0.02
    frame = figure.legends[0].get_window_extent()
    assert not any(frame.overlaps(axes.get_window_extent()) for axes in figure.axes)
    for handle in figure.legends[0].legend_handles:
        assert handle is not None
        if isinstance(handle, Line2D):
            assert handle.get_linestyle() not in ("", "None") or handle.get_marker() not in (
                "",
                "None",
            )
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert np.ptp(np.asarray(canvas.buffer_rgba(), float)[..., :3], axis=-1).max() <= 2


@pytest.mark.parametrize("kind", ["contours", "newmark"])
def test_a_grey_colour_bar_has_the_same_numbers(lined: xr.Dataset, kind: str) -> None:
    bars = [
        lined.slipsweep.chart(kind, at={"mu_s": 0.25}, grey=grey).axes[-1] for grey in (False, True)
    ]
    coloured, grey = ([text.get_text() for text in bar.get_yticklabels()] for bar in bars)
    assert coloured == grey
    assert ("30 mm" if kind == "contours" else "3") in grey


def test_curves_and_modes_differ_without_colour(lined: xr.Dataset) -> None:
    figure = lined.slipsweep.chart("families", y="mu_s", at={"theta": 11})
    looks = [(str(line._dash_pattern), line.get_marker()) for line in labelled(figure, "μs")]
    assert len({dash for dash, _ in looks}) == len({marker for _, marker in looks}) == 3
    figure = lined.slipsweep.chart("modes")
    hatches = [named(figure, text)[0].hatches[0] for text in style.MODE_TEXT.values()]
    assert len(set(hatches)) == 3


@pytest.mark.parametrize("kind", [kind for kind in SWEEP_KINDS if kind != "curve"])
def test_panels_share_their_scale(lined: xr.Dataset, kind: str) -> None:
    x = {"x": "theta"} if kind in ("contours", "modes", "newmark") else {}
    figure = lined.slipsweep.chart(kind, panels=["mu_s"], at={"mu_s": "0.25,0.4"}, **x)
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in panels] == ["μs = 0.25", "μs = 0.4"]
    assert panels[0].get_ylim() == panels[1].get_ylim()
    with pytest.raises(InputError, match="--panels"):
        lined.slipsweep.chart(kind, panels=["mu_s", "mu_s"])


def test_cases_tell_curves_and_panels_apart() -> None:
    result = slipsweep.sweep(
        xr.DataArray([2.0, 12.0], dims="case"),
        xr.DataArray([0.4, 0.5], dims="case"),
        np.linspace(1, 12, 23),
        [1, 2, 4],
    ).assign_coords(label=("case", ["gentle", "steep"]))
    figure = result.slipsweep.chart("families", y="case", at={"frequency": 2})
    (line,) = labelled(figure, "steep")
    assert "steep: θ = 12°, μs = 0.5." in caption(figure)
    np.testing.assert_array_equal(np.unique(line.get_xdata()), result.amplitude)
    panels = result.slipsweep.chart("contours", panels=["case"]).axes[:2]
    assert [axes.get_title() for axes in panels] == ["gentle", "steep"]
    picked = result.slipsweep.chart("contours", at={"case": "steep"})
    assert picked.get_supxlabel().startswith("case steep: θ = 12°")
    for options, message in (
        ({"x": "case"}, "--x case: no such axis; known here: amplitude, frequency"),
        ({"at": {"case": "stepe"}}, "must be a number or one of gentle, steep"),
        ({"at": {"case": 1.5}}, r"case = 1.5: must be a number or one of"),
    ):
        with pytest.raises(InputError, match=message):
            result.slipsweep.chart("contours", **options)


def test_labels_of_panels_lie_apart(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("dimensionless", panels=["theta"])
    figure.draw_without_rendering()
    boxes = [axes.xaxis.label.get_window_extent() for axes in figure.axes]
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


def test_charts_of_zeros_of_nothing_and_of_one_value(grid: xr.Dataset) -> None:
    """All zero, all missing, one value: what can be drawn is, and the rest says why."""
    small = slipsweep.sweep([0.0, 5.0, 30.0], [0.3, 0.5], [1.0, 2.0, 4.0, 7.0], [1.0, 2.0, 4.0])
    for fill in (0.0, np.nan):
        data = small.assign(permanent_displacement=small.permanent_displacement * 0 + fill)
        result = Result(data, "small")
        options = Options()
        figures, left_out = kinds.draw_all(
            result, kinds.fitting(result, options), options, strict=False
        )
        assert set(left_out) == {"families", "dimensionless"}
        assert "No contours: no values" in caption(figures["contours"])
    single = small.permanent_displacement.where(small.amplitude == 7.0, 0.0)
    figure = small.assign(permanent_displacement=single).slipsweep.chart(
        "families", at={"theta": 0, "mu_s": 0.5}
    )
    for line in labelled(figure, "f = "):  # a line through one point is none: it has a marker
        assert np.isfinite(line.get_ydata()[np.asarray(line.get_markevery())]).tolist() == [True]


def test_a_chart_in_axes_of_another_figure() -> None:
    """Map and curves of a sweep, side by side, each with its legend and caption."""
    sweep = slipsweep.sweep(
        [2.0, 5.0], 0.4, np.linspace(2, 8, 9), [1.0, 2.0, 4.0], excitation=slipsweep.Sine(cycles=3)
    )
    figure = Figure(figsize=(12, 5), layout="constrained")
    left, right = figure.subplots(1, 2)
    assert sweep.slipsweep.chart("contours", ax=left, at={"theta": 5}) is left
    assert sweep.slipsweep.chart("families", ax=right, at={"theta": 5}, y="frequency") is right
    assert [line for line in right.lines if str(line.get_label()).startswith("f = ")]
    for axes in (left, right):
        assert axes.get_legend() is not None
        assert any("Mendez et al. 2012" in text.get_text() for text in axes.texts)
    assert not figure.legends
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in (left, right)]
    assert boxes[0].x1 <= boxes[1].x0  # nothing of one lies in the other
