"""Helpers of the tests of charts: what is drawn in a figure, and the grids that are drawn."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline

import slipsweep
from slipsweep.charts import kinds

SINE = slipsweep.Sine(cycles=5)
AMPLITUDES = np.linspace(0.5, 13.5, 53)
FREQUENCIES = np.geomspace(0.2, 20, 25)

SWEEP_KINDS = list(kinds.kinds_of("sweep"))

#: A lined slope: the interface is weak, the block does not come to rest, and ends upslope.
LINED_SINE = slipsweep.Sine(cycles=15)

SWEEPS = Path(__file__).parents[2] / "sweeps"

#: Peak ground accelerations at which no motion slides, some do, and all do, m/s².
SUITE_AMPLITUDES = np.array([1.0, 2.5, 4.0, 6.0])


def named(figure: Figure, gid: str) -> list[Any]:
    """The artists of a chart's first axes with a name."""
    return [child for child in figure.axes[0].get_children() if child.get_gid() == gid]


def labelled(figure: Figure, begin: str) -> list[Any]:
    """Lines of a chart's first axes whose label begins so."""
    return [line for line in figure.axes[0].lines if str(line.get_label()).startswith(begin)]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def caption(figure: Figure) -> str:
    """A caption as one line."""
    return " ".join(figure.get_supxlabel().split())


def inside(area: Any, cells: Any) -> Any:
    """Which points a filled area covers, those on its edge among them, where it is not clipped."""
    (path,) = area.get_paths()
    covered = _contains(path, cells)
    if area.get_clip_path() is not None:
        region = area.get_clip_path().get_fully_transformed_path()
        covered &= _contains(region, area.axes.transData.transform(cells))
    return covered


def _contains(path: Outline, points: Any) -> Any:
    return path.contains_points(points, radius=1e-9) | path.contains_points(points, radius=-1e-9)


def drawn_as(figure: Figure, text: str) -> list[Any]:
    """Lines of the first axes with the colour, dash and marker of an entry of the legend."""
    texts = [entry.get_text() for entry in figure.legends[0].get_texts()]
    entry = figure.legends[0].legend_handles[texts.index(text)]
    return [line for line in figure.axes[0].lines if _look(line) == _look(entry)]


def _look(line: Any) -> tuple[Any, ...]:
    marker = str(line.get_marker()).replace("None", "")  # both are no marker
    return to_hex(line.get_color()), line.get_linestyle(), marker, line.get_linewidth()
