"""Figures over time: each panel has the values that its label names, in its unit."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes

import slipsweep
from slipsweep.model.options import Model
from tests.support.charts import SWEEPS, caption, named


def lines_of(axes: Axes) -> dict[str, Any]:
    """The lines of a panel by their labels in the legend."""
    return {str(line.get_label()): line for line in axes.lines if np.size(line.get_xdata()) > 2}


def check_line(line: Any, times: Any, values: Any) -> None:
    np.testing.assert_array_equal(line.get_xdata(), times)
    np.testing.assert_allclose(line.get_ydata(), values, rtol=1e-14)


@pytest.mark.parametrize(("frequency", "unit", "factor"), [(1.8, "mm", 1000.0), (0.2, "m", 1.0)])
def test_a_history_has_a_panel_for_each_quantity(
    frequency: float, unit: str, factor: float
) -> None:
    """Displacements in mm, in m where one is a metre or more."""
    history = slipsweep.simulate(
        5.0, 0.38, 3.55, frequency, excitation=slipsweep.Sine(cycles=3), points_per_cycle=32
    )
    assert (float(history.relative_displacement.max()) < 1.0) == (unit == "mm")
    figure = history.slipsweep.chart()
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "acceleration\n(m/s²)",
        "friction\ncoefficient",
        "relative\nvelocity (m/s)",
        f"relative\ndisplacement ({unit})",
    ]
    assert figure.axes[-1].get_xlabel() == "time (s)"
    accelerations = lines_of(figure.axes[0])
    assert accelerations.keys() == {"base", "block"}
    check_line(accelerations["base"], history.time, history.ground_acceleration)
    check_line(accelerations["block"], history.time, history.block_acceleration)
    for axes, values in zip(
        figure.axes[1:],
        (
            history.friction_coefficient,
            history.relative_velocity,
            factor * history.relative_displacement,
        ),
        strict=True,
    ):
        (line,) = lines_of(axes).values()
        check_line(line, history.time, values)
    assert f"θ = 5°, μs = 0.38, A = 3.55 m/s², f = {frequency:g} Hz" in caption(figure)
    assert "3 cycles of a sine" in caption(figure)


def test_a_history_by_yield_coefficient_has_no_friction() -> None:
    history = slipsweep.simulate(
        yield_coefficient=0.1, amplitude=3.0, frequency=1.0, model="newmark", points_per_cycle=8
    )
    labels = [axes.get_ylabel() for axes in history.slipsweep.chart().axes]
    assert labels == [
        "acceleration\n(m/s²)",
        "relative\nvelocity (m/s)",
        "relative\ndisplacement (m)",
    ]


@pytest.mark.parametrize("model", [slipsweep.Mendez(), slipsweep.Newmark()])
def test_a_history_of_a_record_has_lines_of_its_thresholds(model: Model) -> None:
    """Of Newmark's block no mode limit; how many half waves have which mode stands above."""
    record = slipsweep.read_record(SWEEPS / "data" / "synthetic.csv")
    given: dict[str, Any] = {"excitation": record, "scale": 2.5, "model": model}
    history = slipsweep.simulate(5.0, 0.35, **given)
    modes, accelerations, *_ = history.slipsweep.chart().axes
    expected = slipsweep.friction_parameters(5.0, 0.35, 1.0)
    lines = {"yield": expected.yield_acceleration.item()}
    if model.name == "mendez":
        lines["mode limit (Eq. 7)"] = expected.limiting_acceleration.item()
    drawn = {
        str(line.get_label()): line.get_ydata()
        for line in accelerations.lines
        if line.get_gid() is not None
    }
    assert drawn.keys() == lines.keys()
    for name, value in lines.items():
        np.testing.assert_allclose(drawn[name], value, rtol=1e-12)
    counts = [int((history.half_wave_mode == mode).sum()) for mode in range(3)]
    assert [text.get_text() for text in modes.get_legend().get_texts()] == [
        f"no sliding ({counts[0]})",
        f"stick–slip ({counts[1]})",
        f"continuous ({counts[2]})",
    ]


@pytest.fixture(scope="module")
def friction() -> xr.Dataset:
    path = SWEEPS / "data" / "shaking_test.csv"
    return slipsweep.measured_friction(path, 5.0, 0.38)


def test_measured_friction_is_drawn_by_eq_1_and_by_statics(friction: xr.Dataset) -> None:
    figure = friction.slipsweep.chart()
    accelerations, coefficient = figure.axes
    assert accelerations.get_ylabel() == "acceleration\n(m/s²)"
    assert coefficient.get_ylabel() == "friction\ncoefficient"
    lines = lines_of(accelerations)
    check_line(lines["table"], friction.time, friction.ground_acceleration)
    check_line(lines["block"], friction.time, friction.block_acceleration)
    lines = lines_of(coefficient)
    check_line(lines["by statics"], friction.time, friction.free_body_friction)
    check_line(lines["μ(t) by Eq. 1"], friction.time, friction.friction_coefficient)
    (static,) = (line for line in coefficient.lines if line.get_label() == "μs")
    np.testing.assert_array_equal(static.get_ydata(), 0.38)
    assert f"beyond {friction.attrs['threshold']:.3g} m/s²" in caption(figure)


def test_slides_are_shaded_from_their_onset_to_their_stop(friction: xr.Dataset) -> None:
    """One that does not stop is shaded to the end of the test."""
    stops = friction.slide_stop.copy()
    stops[-1] = np.nan
    figure = friction.assign(slide_stop=stops).slipsweep.chart()
    ends = [*friction.slide_stop.values[:-1], friction.time.values[-1]]
    for axes in figure.axes:
        spans = [
            patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches
        ]
        drawn = [span.intervalx for span in spans]
        expected = np.column_stack([friction.slide_onset, ends])
        np.testing.assert_allclose(drawn, expected, rtol=1e-9)


def test_constant_friction_is_the_first_word_of_the_caption(friction: xr.Dataset) -> None:
    sentence = "This is a block of constant friction."
    told = friction.assign_attrs(constant_friction=sentence).slipsweep.chart()
    assert told.get_supxlabel().startswith(f"{sentence}\nθ = 5°, μs = 0.38; shaded")
    assert friction.slipsweep.chart().get_supxlabel().startswith("θ = 5°, μs = 0.38; shaded")


def test_every_half_wave_of_a_history_has_its_mode() -> None:
    """As many of each mode as the solver counted, and the times are zeros of the record."""
    record = slipsweep.read_record(SWEEPS / "data" / "synthetic.csv")
    given: dict[str, Any] = {"excitation": record, "scale": 2.5, "time_scale": 2.0, "polarity": -1}
    history = slipsweep.simulate(5.0, 0.35, **given)
    assert history.half_wave_peak.units == history.ground_acceleration.units == "m s-2"
    modes = history.half_wave_mode.values
    assert np.count_nonzero(modes == 1) == history.stick_slip_pulses
    assert np.count_nonzero(modes == 2) == history.continuous_pulses
    assert (
        min(history.stick_slip_pulses, history.continuous_pulses, np.count_nonzero(modes == 0)) > 0
    )
    figure = history.slipsweep.chart("history")
    for name, mode in (("stuck", 0), ("stick_slip", 1), ("continuous", 2)):
        (boxes,) = named(figure, name)
        spans = np.array([path.get_extents().intervalx for path in boxes.get_paths()])
        np.testing.assert_allclose(spans[:, 0], history.half_wave_start[modes == mode], rtol=1e-12)
        np.testing.assert_allclose(spans[:, 1], history.half_wave_end[modes == mode], rtol=1e-12)
