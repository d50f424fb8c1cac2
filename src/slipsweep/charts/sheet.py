"""A figure of one or several panels, and what all charts put on one: axes, legend, caption.

Figures are made without pyplot, hence without a window system or state between calls;
`matplotlib.figure.Figure.savefig` writes them in any format.
"""

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from slipsweep.charts.answers import boundaries, newmark
from slipsweep.charts.style import SYMBOLS, Look, axis_label, caption, is_acceleration, length_text, plain, value_text
from slipsweep.errors import InputError
from slipsweep.model.variables import Validity

Floats = NDArray[np.float64]

#: Amplitudes of a motion.
DRIVES = ("amplitude", "displacement_amplitude")

#: Flags of values that are not to be relied on at all: left out unless asked for.
LEFT_OUT = Validity.NOT_RECOUPLED | Validity.UPSLOPE

#: What these flags say, in captions.
_LEFT_OUT_TEXT = {
    Validity.NOT_RECOUPLED: "not_recoupled (does not come to rest within the cycle)",
    Validity.UPSLOPE: "upslope (ends above where it began)",
}

#: How the lines of yield and of the mode limit are drawn.
LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "yield_acceleration": ("yield", {"color": "black", "linestyle": "-", "linewidth": 1.6}),
    "limiting_acceleration": ("mode limit (Eq. 7)", {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.6}),
}

_DASHES = ("-", (0, (7, 2)), (0, (3, 1.5)), (0, (7, 2, 1.5, 2)), (0, (7, 2, 1.5, 2, 1.5, 2)), (0, (12, 3)))
_MARKERS = ("o", "s", "^", "D", "v", "x")

#: Characters of a caption in an inch.
_CHARACTERS = 18

#: Markers on a curve.
_MARKED = 7


def curve_looks(number: int) -> list[dict[str, Any]]:
    """Colour, dash and marker of the curves of a family: told apart without colour."""
    # not up to the yellow end, which is faint on white and in grey
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.68, number))
    return [
        {"color": colour, "linestyle": dash, "marker": marker, "markersize": 4, "markerfacecolor": "white"}
        for colour, dash, marker in zip(colours, itertools.cycle(_DASHES), itertools.cycle(_MARKERS), strict=False)
    ]


@dataclass
class Panel:
    """One slice and the axes it is drawn in.

    Attributes
    ----------
    axes : Axes
    table : xr.Dataset
    x, y : str
        The axes of a map; of curves `y` is the curve parameter, or None.
    look : Look
    """

    axes: Axes
    table: xr.Dataset
    x: str
    y: str | None
    look: Look

    @cached_property
    def lines(self) -> Mapping[str, xr.Variable]:
        """Yield and limiting acceleration."""
        return boundaries(self.table)

    @property
    def g(self) -> float:
        """Gravity, m/s²."""
        return float(self.table.attrs["g"])

    def values(self, name: str) -> Floats:
        """The values along an axis, in the units that they are drawn in."""
        return np.asarray(self.table[name].values * self.look.scale(name, self.g))

    def grid(self, variable: Any, along: str | None = None) -> Any:
        """A variable over (y, x), or over (y, `along`); without y of one row."""
        return broadcast(variable, self.table, (self.y, along or self.x))

    def result(self, name: str) -> xr.Variable:
        """A result of the slice as it may be drawn."""
        return reliable(self.table.data_vars, name, self.look)

    def member(self, index: int) -> str:
        """What a curve is called."""
        return "" if self.y is None else member_text(self.table, self.y, index, self.look)


def reliable(results: Mapping[Any, Any], name: str, look: Look) -> xr.Variable:
    """A result as it may be drawn: NaN where it is upslope, or left out for its flags."""
    values = results[name]
    left_out = values.values < 0
    if "validity" in results and not look.show_cautions:
        # another program, or a result solved anew beside one that was read, may have another order of dimensions
        flagged = validity_has(results["validity"], LEFT_OUT)
        left_out = left_out | broadcast(flagged, xr.Dataset({name: values}), values.dims)
    return xr.Variable(values.dims, np.where(left_out, np.nan, values.values), values.attrs)


def validity_has(validity: Any, flags: Validity) -> xr.Variable:
    """Where any of some flags is set."""
    return xr.Variable(validity.dims, (validity.values.astype(np.int64) & int(flags)) != 0)


def member_text(table: xr.Dataset, dim: str, index: int, look: Look) -> str:
    """A value of an axis that tells curves or panels apart: ``θ = 5°``, or a case by its label."""
    if dim in table.attrs["labels"]:
        return plain(table.attrs["labels"][dim][index])
    value = float(table[dim].values[index])
    if dim == "threshold":
        return f"d = {length_text(value)}"
    return value_text(dim, value * look.scale(dim, float(table.attrs["g"])), look.unit(dim))


def broadcast(variable: Any, table: xr.Dataset, dims: Sequence[Any]) -> Any:
    """A variable over `dims`, in that order, broadcast along those it does not vary along; None has length 1."""
    own = variable.values.transpose([variable.dims.index(dim) for dim in dims if dim in variable.dims])
    sizes = {**table.sizes, **variable.sizes}
    return np.broadcast_to(
        own.reshape([variable.sizes.get(dim, 1) if dim else 1 for dim in dims]),
        [sizes.get(dim, 1) if dim else 1 for dim in dims],
    )


@dataclass
class Sheet:
    """A figure of panels that share their scales, a legend and a caption.

    Attributes
    ----------
    table : xr.Dataset
        The slice of all panels.
    axes : Axes, optional
        What to draw the one panel in, instead of a new figure.
    figure : Figure
    panels : list of Panel
    legend, remarks : dict of str to Artist
        Entries of the legend by text: what is drawn in several panels has one.  Remarks come last.
    notes : list of str
        Sentences for the caption.
    """

    table: xr.Dataset
    x: str
    y: str | None
    look: Look
    across: str | None = None
    down: str | None = None
    axes: Axes | None = None
    figure: Figure = field(init=False)
    panels: list[Panel] = field(init=False)
    legend: dict[str, Artist] = field(default_factory=dict)
    remarks: dict[str, Artist] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        columns, rows = (self.table[dim].values.size if dim else 1 for dim in (self.across, self.down))
        size = (7.0, 5.3) if rows == columns == 1 else (max(7.0, 2.0 + 2.7 * columns), 2.0 + 2.5 * rows)
        self.figure, grid = new_panels(self.axes, rows, columns, size)
        self.panels = []
        for (row, column), axes in np.ndenumerate(grid):
            where = {dim: at for dim, at in ((self.across, column), (self.down, row)) if dim}
            self.panels.append(Panel(axes, self.table.isel(where, missing_dims="ignore"), self.x, self.y, self.look))
            title = ", ".join(member_text(self.table, dim, at, self.look) for dim, at in where.items())
            if title:
                axes.set_title(title, fontsize="medium")

    def set_axis(self, side: str, name: str) -> None:
        """Scale, ticks and label of an axis, and the acceleration in the other unit on the opposite side."""
        g = float(self.table.attrs["g"])
        values = self.panels[0].values(name)
        for panel in self.panels:
            set_scale(panel.axes, side, values)
            getattr(panel.axes, f"set_{side}label")(axis_label(name, self.look))
            place = panel.axes.get_subplotspec()
            outer = place is None or (place.is_last_col() if side == "y" else place.is_first_row())
            outer = outer or self.axes is not None
            if is_acceleration(name) and outer:
                second_scale(panel.axes, side, g, self.look)

    def note_left_out(self, name: str, *others: xr.Variable) -> None:
        """Say which values of a result are left out, and which are drawn on request: by the slice's flags and others.

        No scale shows what is below zero: displacements upslope are left out in any case.
        """
        flags = [*others, *(self.table.data_vars[one] for one in ("validity",) if one in self.table.data_vars)]
        raised = [flag for flag in LEFT_OUT if any(validity_has(one, flag).values.any() for one in flags)]
        below_zero = Validity.UPSLOPE if name == "permanent_displacement" else Validity(0)
        left_out = [flag for flag in raised if not self.look.show_cautions or flag in below_zero]
        left_out_as = "Left out, below zero on a logarithmic scale" if self.look.show_cautions else "Left out"
        drawn = [flag for flag in raised if flag not in left_out]
        for heading, found in ((left_out_as, left_out), ("Drawn on request", drawn)):
            if found:
                texts = " or ".join(_LEFT_OUT_TEXT[flag] for flag in found)
                self.notes.append(f"{heading}: values flagged {texts}.")

    def note_newmark(self) -> None:
        """Say how the displacements drawn compare with those of Newmark's block."""
        if self.table.attrs["model"] == "newmark":
            return
        ours = reliable(self.table.data_vars, "permanent_displacement", self.look)
        ratio = ratios(ours, newmark(self.table), self.table)
        ratio = ratio[np.isfinite(ratio) & (ratio > 0)]
        if ratio.size:
            low, middle, high = np.quantile(ratio, (0.05, 0.5, 0.95))
            self.notes.append(
                f"Displacement over that of Newmark's block with the same Üy: median {middle:.3g}, "
                f"in 90 % of the cells {low:.3g} to {high:.3g}."
            )

    def finish(self, loc: Any = "outside upper center") -> Figure:
        """Draw legend and caption."""
        for panel in self.panels:
            if self.axes is None:
                panel.axes.label_outer()
            if len(self.panels) > 1:  # long names beside small panels
                for axis in (panel.axes.xaxis, panel.axes.yaxis):
                    axis.label.set_fontsize("small")
                for axes in (panel.axes, *panel.axes.child_axes):
                    axes.tick_params(labelsize="small")
        if legend := self.legend | self.remarks:
            columns = 3 if "center" in loc and self.axes is None else 1
            add_legend(self.figure, self.axes, legend, loc, ncols=columns, handlelength=3.2)
        self._add_caption()
        return self.figure

    def _add_caption(self) -> None:
        picked = "".join(f"{dim} {plain(label)}: " for dim, label in self.table.attrs["picked"].items())
        text = f"{picked}{caption(self.table, self.look)}; {self.table.attrs.get('source', 'slipsweep')}"
        add_caption(self.figure, self.axes, [text, *self._cases(), *self.notes])

    def _cases(self) -> list[str]:
        """What the cases are that tell curves or panels apart."""
        if "case" not in self.table.coords:
            return []
        own = [name for name in SYMBOLS if name in self.table.coords and self.table[name].dims == ("case",)]
        texts = []
        for at in range(self.table["case"].values.size):
            values = ", ".join(member_text(self.table, name, at, self.look) for name in own)
            texts.append(f"{member_text(self.table, 'case', at, self.look)}: {values}.")
        return texts


# ------------------------------------------------------- a figure of its own, or a panel of another


def new_panels(
    axes: Axes | None, rows: int, columns: int, size: tuple[float, float], **shared: Any
) -> tuple[Figure, NDArray[Any]]:
    """Panels of a new figure, or the one that is given, with its figure (InputError if one is not enough)."""
    if axes is None:
        figure = Figure(figsize=size, layout="constrained")
        return figure, figure.subplots(rows, columns, **{"sharex": True, "sharey": True, **shared}, squeeze=False)
    root = axes.get_figure(root=True) if isinstance(axes, Axes) else None
    if root is None:
        raise InputError(f"ax = {axes!r}: must be the axes of a matplotlib figure")
    if rows * columns > 1:
        raise InputError(f"ax: is one panel, and this chart has {rows * columns}; leave out ax")
    return root, np.array([[axes]], dtype=object)


def add_legend(figure: Figure, axes: Axes | None, entries: Mapping[str, Any], loc: Any, **options: Any) -> None:
    """A legend beside the panels of a figure, or inside of the one panel that is given."""
    look: dict[str, Any] = {"fontsize": "small", "frameon": False, **options}
    if axes is None:
        figure.legend(list(entries.values()), list(entries), loc=loc, **look)
    else:
        axes.legend(list(entries.values()), list(entries), **look)


def add_caption(figure: Figure, axes: Axes | None, texts: Sequence[str]) -> None:
    """A caption under a figure, or under the one panel that is given, as wide as that."""
    if axes is None:
        figure.supxlabel("\n".join(texts), fontsize="small", wrap=True)
        return
    characters = max(20, int(_CHARACTERS * axes.get_window_extent().width / figure.dpi))
    lines = [line for text in texts for one in text.splitlines() for line in textwrap.wrap(one, characters)]
    axes.annotate(
        "\n".join(lines), (0.5, 0.0), (0.0, -4.0), xycoords=axes.xaxis.label, textcoords="offset points",
        ha="center", va="top", fontsize="x-small", annotation_clip=False,
    )  # fmt: skip


def ratios(ours: xr.Variable, theirs: xr.Variable, table: xr.Dataset) -> Floats:
    """One result over another, on the cells of the first; NaN where either is missing or both are zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(ours.values / broadcast(theirs, table, ours.dims))


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


def second_scale(axes: Axes, side: str, g: float, look: Look) -> None:
    """An acceleration in the other unit, on the other side, with round values of its own."""
    factor, text = (g, "A (m/s²)") if look.units == "g" else (1 / g, "A (g)")
    functions = (lambda a: a * factor, lambda a: a / factor)
    other = (
        axes.secondary_yaxis("right", functions=functions)
        if side == "y"
        else axes.secondary_xaxis("top", functions=functions)
    )
    getattr(other, f"set_{side}label")(text)
    low, high = getattr(axes, f"get_{side}lim")()
    # it would take them when it is drawn, too late for the layout to make room for its numbers
    getattr(other, f"set_{side}lim")(low * factor, high * factor)
    if getattr(axes, f"get_{side}scale")() == "log":
        log_ticks(getattr(other, f"{side}axis"), high / low)


# ----------------------------------------------------------------------------------- curves


def log_axis_of(axes: Axes, values: Floats, least: float) -> float:
    """A logarithmic ordinate of values some of which are zero; returns what is drawn for them, below its end."""
    log_axis(axes, values, least)
    if (values <= 0).any() and axes.get_ylim()[1] > 10 * least:
        axes.set_ylim(bottom=least / 1.2)
    return axes.get_ylim()[0] / 10


def plot_curve(axes: Axes, xs: Floats, ys: Floats, offset: float = 0.0, **look: Any) -> Any:
    """Draw a line with a few markers, and one on each value that has no neighbour to be joined with.

    `offset` moves the markers by that part of their distance, so that those of several curves lie apart.
    """
    there = np.concatenate([[False], np.isfinite(ys), [False]])
    alone = np.flatnonzero(there[1:-1] & ~there[:-2] & ~there[2:])
    inside = np.flatnonzero(there[1:-1])
    regular = inside[((np.arange(_MARKED) + offset) / _MARKED * inside.size).astype(int)] if inside.size else inside
    if "marker" not in look:
        look, regular = {**look, "marker": "." if alone.size else ""}, regular[:0]
    (line,) = axes.plot(xs, ys, markevery=sorted({*regular.tolist(), *alone.tolist()}), **look)
    return line


def check_positive(name: str, values: Floats) -> None:
    """Refuse what a logarithmic axis cannot show (InputError)."""
    there = values[np.isfinite(values)]
    if not (there > 0).any():
        reason = "no value" if not there.size else "no value above zero"
        raise InputError(f"{name}: {reason} in this slice, and the axis is logarithmic; choose another slice (--at)")


def log_axis(axes: Axes, values: Floats, least: float | None) -> None:
    """A logarithmic ordinate that shows what is above `least`, and no more than seven decades."""
    axes.set_yscale("log")
    there = values[np.isfinite(values) & (values > 0)]
    high = float(there.max())
    low = max(float(there.min()), high * 1e-7)
    if least is not None and high > 10 * least:
        low = max(low, least)
    axes.set_ylim(low / 1.2, high * 1.5)
    log_ticks(axes.yaxis, high / low * 100)
    axes.grid(color="0.9", which="major")
    axes.set_axisbelow(True)
