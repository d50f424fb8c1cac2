"""Figures of the page before they have data: labels, units, legends, scales of colours."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import sweep
from slipsweep.explore import figures
from slipsweep.explore.excerpt import Excerpt, read_excerpt


def excerpt_of(displacements: Any) -> Excerpt:
    """Excerpt that has displacements, m, and nothing else."""
    values = np.asarray(displacements, float)
    table = xr.Dataset({"permanent_displacement": ("amplitude", values)})
    return Excerpt(table, ("amplitude", "frequency"), {}, {}, {})


@pytest.mark.parametrize(
    ("lowest", "highest", "decades"),
    [
        (2e-3, 0.7, (0, 3)),  # 1 mm to 1 m
        (2e-5, 0.7, (-2, 3)),  # five decades
        (2e-8, 0.7, (-2, 3)),  # of more those at the top
        (2e-5, 500.0, (0, 5)),  # but from 1 mm up
        (2e-6, 0.0003, (-3, 0)),
        (0.02, 0.03, (1, 2)),
    ],
)
def test_colours_span_five_decades_at_most(
    lowest: float, highest: float, decades: tuple[int, int]
) -> None:
    """Of nine cells in ten; zeros, missing ones and the twentieth at each end do not count."""
    displacements = [0.0, np.nan, -1.0, 1e-15, *np.geomspace(lowest, highest, 100), 1e9]
    assert figures.decades(excerpt_of(displacements)) == decades


def test_colours_of_nothing_span_a_decade() -> None:
    assert figures.decades(excerpt_of([0.0, np.nan])) == (0, 1)


def test_colours_of_displacements_have_three_bands_a_decade_and_lengths_at_its_ends() -> None:
    pytest.importorskip("bokeh")
    mapper, bar = figures.colours_and_bar("displacement", (0, 4))
    assert len(mapper.palette) == 3 * 4
    assert (mapper.low, mapper.high) == (1.0, 1e4)  # mm
    assert bar.major_label_overrides == {
        1.0: "1 mm",
        10.0: "10 mm",
        100.0: "100 mm",
        1000.0: "1 m",
        10000.0: "10 m",
    }


def test_colours_of_probabilities_have_ten_bands() -> None:
    pytest.importorskip("bokeh")
    mapper, bar = figures.colours_and_bar("probability", (0, 4))
    assert (mapper.low, mapper.high, len(mapper.palette)) == (0.0, 1.0, 10)
    assert list(bar.major_label_overrides.values()) == ["0", "0.2", "0.4", "0.6", "0.8", "1"]


def test_panels_of_a_history_have_their_quantities_and_units() -> None:
    pytest.importorskip("bokeh")
    panels = figures.history_panels().children
    assert [panel.yaxis[0].axis_label for panel in panels] == [
        "acceleration (m/s²)",
        "velocity (m/s)",
        "displacement (mm)",
    ]
    assert panels[-1].xaxis[0].axis_label == "time (s)"
    lines = [[line.glyph.y for line in panel.renderers] for panel in panels]
    assert lines == [["ground", "block"], ["v"], ["u"]]
    (legend,) = panels[0].legend
    drawn = {item.label.value: item.renderers[0].glyph.y for item in legend.items}
    assert drawn == {"base": "ground", "block": "block"}
    assert panels[0].yaxis[-1].axis_label == "(g)"


@pytest.mark.parametrize(
    ("axes", "labels", "logs", "has_g"),
    [
        (
            {"amplitude": [1.0, 2.0, 3.0], "frequency": [1.0, 2.0, 3.0]},
            ("peak ground acceleration A (m/s²)", "excitation frequency f (Hz)"),
            (False, True),
            True,
        ),
        (
            {"displacement_amplitude": [0.01, 0.1, 1.0], "frequency": [1.0, 2.0]},
            ("peak ground displacement d (m)", "excitation frequency f (Hz)"),
            (True, True),
            False,
        ),
        (
            {
                "amplitude": 3.0,
                "frequency": 1.0,
                "mu_s": [0.3, 0.4, 0.5],
                "theta": [1.0, 2.0, 4.0, 8.0],
            },
            ("base inclination θ (°)", "static friction coefficient μs"),
            (True, False),
            False,
        ),
    ],
)
def test_axes_of_the_map_have_names_units_and_scales(
    tmp_path: Path,
    axes: dict[str, Any],
    labels: tuple[str, str],
    logs: tuple[bool, bool],
    has_g: bool,
) -> None:
    """Frequencies, and axes of constant ratios, are logarithmic; accelerations are also in g."""
    pytest.importorskip("bokeh")
    parameters: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4} | axes
    sweep(**parameters).to_netcdf(tmp_path / "a.nc")
    chart = figures.map_figure(read_excerpt(tmp_path / "a.nc", 1000))
    scales = [type(scale).__name__ == "LogScale" for scale in (chart.y_scale, chart.x_scale)]
    assert tuple(scales) == logs
    titles = [
        f"{label}, logarithmic scale" if log else label
        for label, log in zip(labels, logs, strict=True)
    ]
    assert [chart.yaxis[0].axis_label, chart.xaxis[0].axis_label] == titles
    assert ("(g)" in [axis.axis_label for axis in chart.yaxis]) == has_g
