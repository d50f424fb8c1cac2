"""The one builder of figures: layout, size, panels, axes, a legend outside of the data, caption, grey.

Figures are made without pyplot, hence without a window system or state between calls;
`matplotlib.figure.Figure.savefig` writes them in any format.
"""

import itertools
import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from slipsweep.charts.answers import unsound
from slipsweep.charts.style import (
    LEFT_OUT,
    LEFT_OUT_TEXT,
    SYMBOLS,
    Look,
    axis_label,
    caption,
    grey_map,
    is_acceleration,
    left_out_text,
    length_text,
    plain,
    to_grey,
    unsound_text,
    value_text,
)
from slipsweep.errors import InputError
from slipsweep.files.selection import axis_labels, axis_numbers

Floats = NDArray[np.float64]

_DASHES = ("-", (0, (7, 2)), (0, (3, 1.5)), (0, (7, 2, 1.5, 2)), (0, (7, 2, 1.5, 2, 1.5, 2)), (0, (12, 3)))
_MARKERS = ("o", "s", "^", "D", "v", "x")

#: Width of a figure of one panel, inches, and characters of a caption in an inch.
_WIDTH, _CHARACTERS = 7.0, 16

#: Height of a line of a caption or legend, inches, and lines that the usual height has a place for.
_LINE, _LINES = 0.165, 4

#: Markers on a curve.
_MARKED = 7


# ------------------------------------------------------------------------ any figure


class Drawing:
    """A figure of panels with a legend and a caption.

    Parameters
    ----------
    look : Look
    rows, columns : int
    size : tuple of float
        Width and height, inches; `look.width` scales both.
    axes : Axes, optional
        What to draw the one panel in, instead of a new figure.
    shared
        Further options of `Figure.subplots`.

    Attributes
    ----------
    figure : Figure
    grid : ndarray of Axes
    legend, remarks : dict of str to Artist
        Entries of the legend by text: what is drawn in several panels has one.  Remarks come last.
    notes : list of str
        Sentences for the caption.
    """

    def __init__(
        self, look: Look, rows: int, columns: int, size: tuple[float, float], axes: Axes | None = None, **shared: Any
    ) -> None:
        factor = 1.0 if look.width is None else look.width / size[0]
        self.look, self.axes = look, axes
        if axes is None:
            self.figure = Figure(figsize=(size[0] * factor, size[1] * factor), layout="constrained")
            self.grid = self.figure.subplots(rows, columns, **{"sharex": True, "sharey": True, **shared}, squeeze=False)
        else:
            root = axes.get_figure(root=True) if isinstance(axes, Axes) else None
            if root is None:
                raise InputError(f"ax = {axes!r}: must be the axes of a matplotlib figure")
            if rows * columns > 1:
                raise InputError(f"ax: is one panel, and this chart has {rows * columns}; leave out ax")
            self.figure, self.grid = root, np.array([[axes]], dtype=object)
        self.legend: dict[str, Artist] = {}
        self.remarks: dict[str, Artist] = {}
        self.notes: list[str] = []

    def mark_zero(self, panels: Iterable[Axes]) -> None:
        """A line at zero and a grid in panels over time."""
        for panel in panels:
            panel.axhline(0, color="0.6", linewidth=0.8, zorder=0)
            panel.margins(x=0)
            panel.grid(color="0.9")
        self.figure.align_ylabels()

    def finish(self, texts: Sequence[str], beside: bool = True) -> Figure:
        """Draw the legend, beside or above the panels, and a caption of `texts` and the notes under them."""
        entries = self.legend | self.remarks
        lines = 0
        width, height = self.figure.get_size_inches()
        if self.axes is not None:
            right = any(other.yaxis.get_ticks_position() == "right" for other in self.axes.child_axes)
            if entries:
                self.axes.legend(
                    list(entries.values()), list(entries), fontsize="small", frameon=False,
                    loc="upper left", bbox_to_anchor=(1.2 if right else 1.02, 1.0),
                )  # fmt: skip
            add_caption(self.figure, self.axes, [*texts, *self.notes])
        else:
            self._set_small()
            if entries:
                beside = beside and width > 5.0
                columns = 1 if beside else max(1, int(width * 10.0 / self.look.font / 2.2))
                self.figure.legend(
                    list(entries.values()), list(entries), ncols=columns, handlelength=3.2, fontsize="small",
                    frameon=False, loc="outside right upper" if beside else "outside upper center",
                )  # fmt: skip
                longest = max(text.count("\n") + 1 for text in entries)
                lines = 0 if beside else math.ceil(len(entries) / columns) * longest - 1
            lines += add_caption(self.figure, None, [*texts, *self.notes], self.look.font)
            more = max(0, lines - _LINES) * _LINE * self.look.font / 10.0
            self.figure.set_size_inches(width, height + more)
        if self.look.grey:
            without_colour(self.figure)
        return self.figure

    def _set_small(self) -> None:
        """Sizes of text, in points: ticks are made only when the figure is drawn."""
        several = self.grid.size > 1
        size = self.look.font * (0.833 if several else 1.0)
        for panel in self.grid.ravel():
            for axes in (panel, *panel.child_axes):
                axes.tick_params(labelsize=size)
            if several:
                panel.xaxis.label.set_fontsize(size)
                panel.yaxis.label.set_fontsize(size)


def add_caption(figure: Figure, axes: Axes | None, texts: Sequence[str], font: float = 10.0) -> int:
    """A caption under a figure, or under the one panel that is given, as wide as that; returns its lines."""
    width = figure.get_figwidth() if axes is None else axes.get_window_extent().width / figure.dpi
    characters = max(20, int(_CHARACTERS * 10.0 / font * width))
    lines = [line for text in texts for one in text.splitlines() for line in textwrap.wrap(one, characters)]
    if axes is None:
        figure.supxlabel("\n".join(lines), fontsize="small")
    else:
        axes.annotate(
            "\n".join(lines), (0.5, 0.0), (0.0, -4.0), xycoords=axes.xaxis.label, textcoords="offset points",
            ha="center", va="top", fontsize="x-small", annotation_clip=False,
        )  # fmt: skip
    return len(lines)


def without_colour(figure: Figure) -> None:
    """Replace all colours by their lightness."""
    for artist in figure.findobj():
        if isinstance(artist, ScalarMappable) and artist.get_array() is not None:
            artist.set_cmap(grey_map(artist.get_cmap()))
        elif isinstance(artist, Line2D | Patch):
            kinds = ("color", "markerfacecolor", "markeredgecolor")
            for kind in kinds if isinstance(artist, Line2D) else ("facecolor", "edgecolor"):
                artist.set(**{kind: tuple(to_grey(getattr(artist, f"get_{kind}")())[0])})
        elif isinstance(artist, mpl.collections.Collection):
            for kind in ("facecolor", "edgecolor"):
                colours = getattr(artist, f"get_{kind}")()
                if len(colours):
                    artist.set(**{kind: to_grey(colours)})


# ------------------------------------------------------------------- of slices of a sweep


class Panel:
    """A part of a sheet's slice and the axes it is drawn in.

    Attributes
    ----------
    axes : Axes
    x, y : str
        The axes of a map; of curves `y` is the curve parameter, or None.
    look : Look
    g : float
        Gravity, m/s².
    """

    def __init__(self, sheet: "Sheet", axes: Axes, where: dict[str, int]) -> None:
        self._sheet, self._where = sheet, where
        self.axes, self.x, self.y, self.look = axes, sheet.x, sheet.y, sheet.look
        self.g = float(sheet.data.attrs["g"])

    @property
    def data(self) -> xr.Dataset:
        """The sheet's slice at the panel's values."""
        return self._sheet.data.isel(self._where, missing_dims="ignore")

    def values(self, name: str) -> Floats:
        """The values along an axis, in the units that they are drawn in."""
        return axis_numbers(self.data, name) * self.look.scale(name, self.g)

    def grid(self, name: str | xr.DataArray, along: str | None = None) -> Any:
        """A variable over (y, x), or over (y, `along`); without y of one row."""
        array = self.data[name] if isinstance(name, str) else name
        return over(array, self.data, (self.y, along or self.x))

    def reliable(self, name: str) -> xr.DataArray:
        """A result of the slice as it may be drawn."""
        return reliable(self.data, name, self.look)

    def member(self, index: int) -> str:
        """What a curve is called."""
        return "" if self.y is None else member_text(self.data, self.y, index, self.look)


class Sheet(Drawing):
    """A figure of panels that share their scales, of one slice.

    Parameters
    ----------
    data : Dataset
        The slice of all panels.
    x, y : str
        The axes of a map; of curves `y` is the curve parameter, or None.
    across, down : str, optional
        Dimensions that panels lie along.
    """

    def __init__(
        self, data: xr.Dataset, x: str, y: str | None, look: Look,
        across: str | None = None, down: str | None = None, axes: Axes | None = None,
    ) -> None:  # fmt: skip
        columns, rows = (data.sizes[dim] if dim else 1 for dim in (across, down))
        size = (_WIDTH, 5.3) if rows == columns == 1 else (max(_WIDTH, 2.0 + 2.7 * columns), 2.0 + 2.5 * rows)
        super().__init__(look, rows, columns, size, axes)
        self.data, self.x, self.y, self.across, self.down = data, x, y, across, down
        self.panels: list[Panel] = []
        for (row, column), one in np.ndenumerate(self.grid):
            where = {dim: at for dim, at in ((across, column), (down, row)) if dim}
            self.panels.append(Panel(self, one, where))
            title = ", ".join(member_text(data, dim, at, look) for dim, at in where.items())
            if title:
                one.set_title(title, fontsize="medium")

    def set_axis(self, side: str, name: str) -> None:
        """Scale, ticks and label of an axis, and the acceleration in the other unit on the opposite side."""
        values = self.panels[0].values(name)
        for panel in self.panels:
            set_scale(panel.axes, side, values)
            getattr(panel.axes, f"set_{side}label")(axis_label(name, self.look))
            place = panel.axes.get_subplotspec()
            outer = place is None or (place.is_last_col() if side == "y" else place.is_first_row())
            if is_acceleration(name) and (outer or self.axes is not None):
                second_scale(panel.axes, side, panel.g, self.look, SYMBOLS[name])

    def note_left_out(self, name: str, *others: xr.DataArray) -> None:
        """Say which values of a result are left out: by the slice's flags and others."""
        flags = [*others, *([self.data["validity"]] if "validity" in self.data else [])]
        raised = [flag for flag in LEFT_OUT_TEXT if any(has_flags(one, flag).any() for one in flags)]
        self.notes += left_out_text(raised, self.look, name == "permanent_displacement")

    def find_unsound(self, drawn: xr.DataArray, theirs: xr.DataArray, what: str) -> None:
        """Add to the slice where its displacement has a trend that no block has, and note how much of it that is.

        `drawn` is the displacement as it is drawn, `theirs` that of Newmark's block, `what` how such places are marked.
        """
        found = unsound(self.data, theirs)
        shown = drawn > 0
        either = shown & (found["falls"] | found["below"])
        self.data["unsound"] = either.transpose(*drawn.dims)
        falls, below = (int((shown & found[name]).sum()) for name in ("falls", "below"))
        self.notes += unsound_text(falls, below, int(either.sum()), int(shown.sum()), what)

    def done(self, beside: bool = True) -> Figure:
        """Draw legend and caption."""
        if self.axes is None:
            for panel in self.panels:
                panel.axes.label_outer()
        picked = "".join(f"{dim} {plain(label)}: " for dim, label in self.data.attrs.get("picked", {}).items())
        text = f"{picked}{caption(self.data, self.look)}; {self.data.attrs.get('source', 'slipsweep')}"
        return self.finish([text, *self._cases()], beside)

    def _cases(self) -> list[str]:
        """What the cases are that tell curves or panels apart."""
        own = [name for name in SYMBOLS if name in self.data.coords and self.data[name].dims == ("case",)]
        texts = []
        for at in range(self.data.sizes.get("case", 0)):
            values = ", ".join(member_text(self.data, name, at, self.look) for name in own)
            texts.append(f"{member_text(self.data, 'case', at, self.look)}: {values}.")
        return texts


def reliable(results: xr.Dataset, name: str, look: Look) -> xr.DataArray:
    """A result as it may be drawn: NaN where it is upslope, or left out for its flags."""
    values = results[name]
    shown = values >= 0
    if "validity" in results and not look.show_cautions:
        shown = shown & ~has_flags(results["validity"], LEFT_OUT)
    return values.where(shown).transpose(*values.dims)


def has_flags(validity: xr.DataArray, flags: int) -> xr.DataArray:
    """Where any of some flags is set."""
    return (validity.fillna(0).astype(np.int64) & int(flags)) != 0


def member_text(data: xr.Dataset, dim: str, index: int, look: Look) -> str:
    """A value of an axis that tells curves or panels apart: ``θ = 5°``, or a case by its label."""
    labels = axis_labels(data, dim)
    if labels:
        return plain(labels[index])
    value = float(axis_numbers(data, dim)[index]) if dim in data.sizes else float(data[dim].values[index])
    if dim == "threshold":
        return f"d = {length_text(value)}"
    if dim not in SYMBOLS:
        return f"{value:g}"
    return value_text(dim, value * look.scale(dim, float(data.attrs["g"])), look.unit(dim))


def over(array: xr.DataArray, data: xr.Dataset, dims: Sequence[str | None]) -> Any:
    """A variable's values over `dims`, in that order, repeated along those it lacks; None has length 1."""
    named = [dim for dim in dims if dim]
    lacking = {dim: data.sizes.get(dim, 1) for dim in named if dim not in array.dims}
    full = array.variable.set_dims({**lacking, **array.sizes}).transpose(*named)
    return full.values.reshape([full.sizes[dim] if dim else 1 for dim in dims])


# ------------------------------------------------------------------------------------- axes


def is_log(values: Floats) -> bool:
    """Whether an axis is spaced by a constant factor rather than a constant step."""
    if values.size < 3 or values[0] <= 0:
        return False
    steps, factors = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(factors) / factors.mean() < np.ptp(steps) / steps.mean())


def set_scale(axes: Axes, side: str, values: Floats) -> None:
    """From the first to the last of some values, on the scale that they are spaced on."""
    getattr(axes, f"set_{side}lim")(values[0], values[-1])
    if is_log(values):
        getattr(axes, f"set_{side}scale")("log")
        log_ticks(getattr(axes, f"{side}axis"), values[-1] / values[0])


def log_ticks(axis: Any, span: float) -> None:
    """Ticks of a logarithmic axis over some ratio of its ends, with numbers as people write them."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if span < 2000 else (1,)))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:,.0f}".replace(",", " ") if value >= 1e4 else f"{value:g}")
    )
    axis.set_minor_formatter(NullFormatter())


def second_scale(axes: Axes, side: str, g: float, look: Look, symbol: str = "A") -> None:
    """An acceleration in the other unit, on the other side, with round values of its own."""
    factor, text = (g, f"{symbol} (m/s²)") if look.units == "g" else (1 / g, f"{symbol} (g)")
    functions = (lambda a: a * factor, lambda a: a / factor)
    other = (
        axes.secondary_yaxis("right", functions=functions)
        if side == "y"
        else axes.secondary_xaxis("top", functions=functions)
    )
    getattr(other, f"set_{side}label")(text)
    low, high = getattr(axes, f"get_{side}lim")()
    # it would take them when it is drawn, too late for the layout to leave space for its numbers
    getattr(other, f"set_{side}lim")(low * factor, high * factor)
    if getattr(axes, f"get_{side}scale")() == "log":
        log_ticks(getattr(other, f"{side}axis"), high / low)


# ----------------------------------------------------------------------------------- curves


def curve_looks(number: int) -> list[dict[str, Any]]:
    """Colour, dash and marker of the curves of a family: told apart without colour."""
    # not up to the yellow end, which is faint on white and in grey
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.68, number))
    return [
        {"color": tuple(colour), "linestyle": dash, "marker": marker, "markersize": 4, "markerfacecolor": "white"}
        for colour, dash, marker in zip(colours, itertools.cycle(_DASHES), itertools.cycle(_MARKERS), strict=False)
    ]


def plot_curve(axes: Axes, xs: Floats, ys: Floats, offset: float = 0.0, **look: Any) -> Any:
    """Draw a line with a few markers, and one on each value that has no neighbour to be joined with.

    `offset` moves the markers by that part of their distance, so that those of several curves lie apart.
    """
    there = np.concatenate([[False], np.isfinite(ys), [False]])
    single = np.flatnonzero(there[1:-1] & ~there[:-2] & ~there[2:])
    inside = np.flatnonzero(there[1:-1])
    regular = inside[((np.arange(_MARKED) + offset) / _MARKED * inside.size).astype(int)] if inside.size else inside
    if "marker" not in look:
        look, regular = {**look, "marker": "." if single.size else ""}, regular[:0]
    (line,) = axes.plot(xs, ys, markevery=sorted({*regular.tolist(), *single.tolist()}), **look)
    return line


def check_positive(name: str, values: Floats) -> None:
    """Refuse what a logarithmic axis cannot show (InputError)."""
    there = values[np.isfinite(values)]
    if not (there > 0).any():
        reason = "no value" if not there.size else "no value above zero"
        raise InputError(f"{name}: {reason} in this slice, and the axis is logarithmic; choose another slice (--at)")


def log_axis(axes: Axes, values: Floats, least: float | None, zeros: bool = False) -> float:
    """A logarithmic ordinate that shows what is above `least`, and no more than seven decades.

    With `zeros` curves come from below the axis: it begins at `least`.  Returns what may be drawn for values of zero:
    a number below the end of the axis.
    """
    axes.set_yscale("log")
    there = values[np.isfinite(values) & (values > 0)]
    high = float(there.max())
    low = max(float(there.min()), high * 1e-7)
    if least is not None and high > 10 * least:
        low = least if zeros and (values <= 0).any() else max(low, least)
    axes.set_ylim(low / 1.2, high * 1.5)
    log_ticks(axes.yaxis, high / low * 100)
    axes.grid(color="0.9", which="major")
    axes.set_axisbelow(True)
    return axes.get_ylim()[0] / 10
