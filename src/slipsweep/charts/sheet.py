"""Figures without pyplot: size, panels, axes, legend beside the data, caption, grey.

All charts are built with the classes of this module.
"""

import io
import itertools
import math
import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from slipsweep.charts import style
from slipsweep.charts.magnitudes import UPSLOPE_SHARE
from slipsweep.charts.style import Floats, Look, Options
from slipsweep.errors import InputError
from slipsweep.files.selection import axis_labels, axis_numbers
from slipsweep.model.variables import Validity
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.studies.boundaries import has_flags, thresholds
from slipsweep.studies.cautions import (
    LEFT_OUT,
    SLIDES_BACK,
    estimated_friction_text,
    percent,
    reliable,
    unsound,
)
from slipsweep.studies.solved_again import DISPLACEMENT, is_newmark, newmark_displacement
from slipsweep.studies.upslope import sliding_ways

#: Dashes and markers of the curves of a family, and how many markers a curve has.
_DASHES = (
    "-",
    (0, (7, 2)),
    (0, (3, 1.5)),
    (0, (7, 2, 1.5, 2)),
    (0, (7, 2, 1.5, 2, 1.5, 2)),
    (0, (12, 3)),
)
_MARKERS = ("o", "s", "^", "D", "v", "x")
_MARKED = 7

#: Width of a figure of one panel, inches.
_WIDTH = 7.0

#: Characters of a caption in an inch.
_CHARACTERS = 15

#: Characters in a line of a label of a small panel.
_LABEL = 26

#: Height of a line of a caption or legend, inches, and number of lines in the usual height.
_LINE = 0.165
_LINES = 4

#: Name of colour maps without colour.
_GREY = "grey of slipsweep"


class Chart(Figure):
    """A figure that a notebook shows as a picture without pyplot and without a backend."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png")
        return content.getvalue()


class Drawing:
    """A figure of panels with one legend and a caption.

    `size` is in inches, and `options.width` scales it.  With `options.ax` these axes are drawn in,
    and there is no new figure.  `shared` goes to `Figure.subplots`.  Remarks come last in the
    legend; notes are sentences of the caption.
    """

    def __init__(
        self, options: Options, rows: int, columns: int, size: tuple[float, float], **shared: Any
    ) -> None:
        self.options = options
        self.figure: Figure
        axes: object = options.ax
        if axes is None:
            factor = 1.0 if options.inches is None else options.inches / size[0]
            self.figure = Chart(figsize=(size[0] * factor, size[1] * factor), layout="constrained")
            self.grid = self.figure.subplots(
                rows, columns, **{"sharex": True, "sharey": True, **shared}, squeeze=False
            )
        else:
            root = axes.get_figure(root=True) if isinstance(axes, Axes) else None
            if root is None:
                raise InputError(f"ax = {axes!r}: must be the axes of a matplotlib figure")
            if rows * columns > 1:
                raise InputError(
                    f"ax: is one panel, and this chart has {rows * columns}; leave out ax"
                )
            self.figure = root
            self.grid = np.array([[axes]], dtype=object)
        self.legend: dict[str, Artist] = {}
        self.remarks: dict[str, Artist] = {}
        self.notes: list[str] = []

    def note(self, text: str, short: str | None = None) -> None:
        """Add a sentence to the caption, or a shorter one to a short caption ("": none)."""
        sentence = short if short is not None and self.options.is_brief else text
        if sentence:
            self.notes.append(sentence)

    def finish(self, texts: Sequence[str], beside: bool = True) -> Figure:
        """Draw the title, the legend (`beside` or above the panels), and the caption."""
        entries = self.legend | self.remarks
        look = Look(fontsize="small", frameon=False)
        if any(isinstance(artist, Patch) for artist in entries.values()):
            look["handleheight"] = 1.3  # for hatches
        if self.options.ax is None:
            self._lay_out(texts, entries, beside, look)
        else:
            self._add_to(self.options.ax, texts, entries, look)
        if self.options.grey:
            _without_colour(self.figure)
        return self.figure

    def _wrapped(self, texts: Sequence[str], characters: int) -> list[str]:
        """Return the lines of a caption; the notes of a short one are a paragraph."""
        notes = [" ".join(self.notes)] if self.options.is_brief else self.notes
        every = [line for text in (*texts, *notes) for line in text.splitlines()]
        return [line for text in every for line in textwrap.wrap(text, characters)]

    def _add_to(
        self, axes: Axes, texts: Sequence[str], entries: dict[str, Artist], look: Look
    ) -> None:
        """Draw title, legend and caption beside the axes of another figure."""
        if self.options.title:
            axes.set_title(style.plain(self.options.title))
        right = any(other.yaxis.get_ticks_position() == "right" for other in axes.child_axes)
        if entries:
            place = (1.2 if right else 1.02, 1.0)
            axes.legend(
                [*entries.values()], [*entries], loc="upper left", bbox_to_anchor=place, **look
            )
        width = axes.get_window_extent().width / self.figure.dpi
        axes.annotate(
            "\n".join(self._wrapped(texts, max(20, int(_CHARACTERS * width)))),
            (0.5, 0.0),
            (0.0, -4.0),
            xycoords=axes.xaxis.label,
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize="x-small",
            annotation_clip=False,
        )

    def _lay_out(
        self, texts: Sequence[str], entries: dict[str, Artist], beside: bool, look: Look
    ) -> None:
        """Draw title, legend and caption; make the figure higher by the lines that they need."""
        self._set_small()
        width, height = self.figure.get_size_inches()
        size = self.options.font / 10.0
        text_width = width / size  # inches of text of 10 points
        characters = int(_CHARACTERS * text_width)
        caption = self._wrapped(texts, characters)
        beside = beside and width > 5.0
        columns = 1 if beside else max(1, int(text_width / 2.2))
        longest = max((text.count("\n") + 1 for text in entries), default=0)
        above = 0 if beside or not entries else math.ceil(len(entries) / columns) * longest - 1
        lines: float = max(0, above + len(caption) - _LINES)
        if self.options.title:
            # the layout cannot put a legend below the title of the figure: it becomes the legend's
            is_left = bool(entries) and beside  # of the legend
            shown = textwrap.fill(self.options.title, int((0.42 if is_left else 0.66) * characters))
            lines += shown.count("\n") + 1.5
            if entries and not beside:
                look |= {"title": style.plain(shown), "title_fontsize": "large"}
            else:
                place = 0.36 if is_left else 0.5
                self.figure.suptitle(style.plain(shown), fontsize="large", x=place)
        self.figure.set_size_inches(width, height + lines * _LINE * size)
        if entries:
            legend = self.figure.legend(
                [*entries.values()],
                [*entries],
                loc="outside right upper" if beside else "outside upper center",
                ncols=columns,
                handlelength=3.2,
                **look,
            )
            legend.get_title().set_multialignment("center")
        self.figure.supxlabel("\n".join(caption), fontsize="small")

    def _set_small(self) -> None:
        """Set sizes of text, in points (ticks are made only when the figure is drawn)."""
        several = self.grid.size > 1
        size = self.options.font * (0.833 if several else 1.0)
        for panel in self.grid.ravel():
            for axes in (panel, *panel.child_axes):
                axes.tick_params(labelsize=size)
            for label in [panel.yaxis.label, *([panel.xaxis.label] if several else [])]:
                label.set_fontsize(size)
                if size < 10 and "\n" not in label.get_text():
                    label.set_text(textwrap.fill(label.get_text(), _LABEL))


def _without_colour(figure: Figure) -> None:
    """Replace all colours by their lightness, in maps by lighter greys, so that hatches show."""
    for artist in figure.findobj():
        if isinstance(artist, ScalarMappable) and artist.get_array() is not None:
            colour_map = artist.get_cmap()
            if colour_map.name == _GREY:  # of a chart that was drawn in other axes before
                continue
            # lines and areas of contours of one colour keep its lightness
            one_colour = getattr(artist, "colors", None) is not None
            to_grey = style.to_grey if one_colour else style.to_light_grey
            ends = {"under": colour_map.get_under(), "over": colour_map.get_over()}
            shades = ListedColormap(to_grey(colour_map(np.arange(colour_map.N))), _GREY)
            extremes = {end: to_grey(colour)[0] for end, colour in ends.items()}
            artist.set_cmap(shades.with_extremes(**extremes))
            continue
        for kind in ("color", "markerfacecolor", "markeredgecolor", "facecolor", "edgecolor"):
            grey = style.to_grey(getattr(artist, f"get_{kind}", list)())
            if len(grey):
                artist.set(**{kind: grey if len(grey) > 1 else tuple(grey[0])})


class Panel:
    """A part of a sheet's slice, and its axes; `at` is its row and column."""

    def __init__(self, sheet: "Sheet", axes: Axes, at: tuple[int, ...]) -> None:
        self._sheet = sheet
        self._where = dict(zip(sheet.along, at[::-1], strict=False))
        self.axes = axes
        self.x = sheet.x
        self.y = sheet.y
        self.options = sheet.options
        self.g = float(sheet.data.attrs["g"])
        names = [
            member_text(sheet.data, dim, index, self.options) for dim, index in self._where.items()
        ]
        if names:
            axes.set_title(", ".join(names), fontsize="medium")
        # the values along x and y, in the units that they are drawn in
        self.xs, self.ys = (
            axis_numbers(self.data, name) * self.options.scale(name, self.g)
            if name
            else np.zeros(0)
            for name in (self.x, self.y)
        )

    @property
    def data(self) -> xr.Dataset:
        """The sheet's slice, cut at the panel's values."""
        return self._sheet.data.isel(self._where, missing_dims="ignore")

    def grid(self, values: str | xr.DataArray, *dims: str | None) -> Any:
        """Return values over (y, x) or other dimensions, in that order.

        They are repeated along dimensions that they lack; None is a dimension of length 1.
        """
        data = self.data
        dims = dims or (self.y, self.x)
        array = data[values] if isinstance(values, str) else values
        named = [dim for dim in dims if dim]
        lacking = {dim: data.sizes.get(dim, 1) for dim in named if dim not in array.dims}
        full = array.variable.set_dims({**lacking, **array.sizes}).transpose(*named)
        return full.values.reshape([full.sizes[dim] if dim else 1 for dim in dims])

    def member(self, index: int) -> str:
        """Return the name of a curve."""
        return "" if self.y is None else member_text(self.data, self.y, index, self.options)

    def add_title(self, text: str) -> None:
        """Add a line of text over the panel."""
        title = self.axes.get_title()
        self.axes.set_title(f"{title}\n{text}" if title else text, fontsize="small")


class Sheet(Drawing):
    """A figure of one slice, in panels that share their scales.

    Panels lie across and down along the dimensions `along`.

    `x` and `y` are the axes of a map; of curves `y` is the curve parameter, or None.
    """

    def __init__(
        self, data: xr.Dataset, x: str, y: str | None, options: Options, along: Sequence[str]
    ) -> None:
        columns, rows = [*(data.sizes[dim] for dim in along), 1, 1][:2]
        size = (
            (_WIDTH, 5.3)
            if rows == columns == 1
            else (max(_WIDTH, 2.0 + 2.7 * columns), 2.0 + 2.5 * rows)
        )
        super().__init__(options, rows, columns, size)
        self.data = data
        self.x = x
        self.y = y
        self.along = along
        self.panels = [Panel(self, axes, at) for at, axes in np.ndenumerate(self.grid)]

    def set_axis(self, side: str) -> None:
        """Set scale, ticks and label of an axis.

        An acceleration has its other unit on the opposite side.
        """
        name, values = (
            (self.x, self.panels[0].xs) if side == "x" else (str(self.y), self.panels[0].ys)
        )
        for panel in self.panels:
            axes = panel.axes
            axes.set(
                **{
                    f"{side}lim": (values[0], values[-1]),
                    f"{side}label": style.axis_label(name, self.options),
                }
            )
            if name not in ("theta", "phi") and is_log(values):
                axes.set(**{f"{side}scale": "log"})
                log_ticks(getattr(axes, f"{side}axis"), values[-1] / values[0])
            if style.is_acceleration(name) and axes in (
                self.grid[:, -1] if side == "y" else self.grid[0]
            ):
                _second_scale(axes, side, panel.g, self.options.units, style.SYMBOLS[name])

    def note_left_out(self, name: str, *others: xr.DataArray) -> None:
        """Add to the caption which unreliable values are left out, or drawn on request.

        Displacements upslope are always left out, as they have no logarithm.
        """
        validities = [*others, *([self.data["validity"]] if "validity" in self.data else [])]
        groups: dict[str, list[Validity]] = {}
        for flag in LEFT_OUT:
            if any(has_flags(validity, flag).any() for validity in validities):
                drawn = self.options.show_cautions and not (
                    name == DISPLACEMENT and flag == Validity.UPSLOPE
                )
                groups.setdefault("Drawn on request" if drawn else "Left out", []).append(flag)
        for heading, flags in groups.items():
            texts = " or ".join(LEFT_OUT[flag] for flag in flags)
            words = ", ".join(style.FLAG_TEXT[flag] for flag in flags)
            self.note(f"{heading}: values flagged {texts}.", f"{heading}: {words}.")

    def note_slides_back(self, motion: Record | Suite | None) -> None:
        """Add to the caption the share of sliding cells whose block would also slide upslope."""
        shown = reliable(self.data, DISPLACEMENT, self.options.show_cautions) > 0
        ways = sliding_ways(self.data, motion)
        if ways is not None and (shown & ways[1]).any():
            share = percent(int((shown & ways[1]).sum()) / int(shown.sum()))
            self.note(
                f"In {share} of the sliding cells shown {SLIDES_BACK}.",
                f"{share} would also slide upslope: displacement too large.",
            )

    def note_magnitude(self) -> None:
        """Add to the caption that displacements are drawn without signs, if they have signs."""
        share = self.data.attrs.get(UPSLOPE_SHARE)
        if share is not None:
            text = percent(share)
            self.note(
                f"Drawn is |u|: {text} of the sliding cells shown end upslope, u < 0.",
                f"|u|: {text} end upslope.",
            )

    def show(self, name: str, marked: str, always: bool = False) -> None:
        """Add to the slice the variables that charts of a result draw.

        They are ``drawn``, the values that may be drawn; those of `thresholds`; and for
        displacements ``newmark``, those of Newmark's block, and ``unsound``, True where there is a
        trend that no block has.  Notes in the caption compare the two displacements, and give the
        share of unsound cells after the words `marked`.
        """
        drawn = reliable(self.data, name, self.options.show_cautions)
        self.data = self.data.merge(thresholds(self.data, always)).assign(drawn=drawn)
        if name != DISPLACEMENT or is_newmark(self.data):
            return
        of_newmark = newmark_displacement(self.data)
        if of_newmark is not None:
            self.data["newmark"] = of_newmark.reset_coords(drop=True)
            ratio = (drawn / of_newmark).where(lambda values: np.isfinite(values) & (values > 0))
            if ratio.notnull().any():
                low, middle, high = np.nanquantile(ratio, (0.05, 0.5, 0.95))
                self.note(
                    "Ratio to the displacement of Newmark's block with the same Üy: "
                    f"median {middle:.3g}; "
                    f"90 % of the sliding cells shown lie between {low:.3g} and {high:.3g}.",
                    short="",
                )
        self.data["unsound"], trends = unsound(self.data, drawn, of_newmark)
        if trends:
            share = percent(int(self.data["unsound"].sum()) / int((drawn > 0).sum()))
            self.note(
                f"{marked}: {share} of the sliding cells shown. {trends[0].upper()}{trends[1:]}.",
                f"{marked}: {share} of the sliding cells, a trend that no block has.",
            )
        if "limit_line" in self.data and "validity" in self.data:
            continuous = self.data["amplitude"] > self.data["limit_line"]
            text = estimated_friction_text(self.data, drawn, continuous.reset_coords(drop=True))
            if text:
                self.note(f"{text}.", f"{text}.".replace(" of the sliding cells", ""))

    def done(self, beside: bool = True) -> Figure:
        """Draw legend and caption."""
        if self.options.ax is None:
            for panel in self.panels:
                panel.axes.label_outer()
        picked = "".join(
            f"{dim} {style.plain(label)}: "
            for dim, label in self.data.attrs.get("picked", {}).items()
        )
        text = f"{picked}{style.caption(self.data, self.options)}"
        if not self.options.is_brief:
            text += f"; {self.data.attrs.get('source', 'slipsweep')}"
        cases = []
        of_cases = [
            name
            for name in style.SYMBOLS
            if name in self.data.coords and self.data[name].dims == ("case",)
        ]
        for at in range(self.data.sizes.get("case", 0)):
            values = ", ".join(member_text(self.data, name, at, self.options) for name in of_cases)
            cases.append(f"{member_text(self.data, 'case', at, self.options)}: {values}.")
        return self.finish([text, *cases], beside)


def member_text(data: xr.Dataset, dim: str, index: int, options: Options) -> str:
    """Return the name of a curve or panel: a value (``θ = 5°``) or a label."""
    labels = axis_labels(data, dim)
    if labels:
        return style.plain(labels[index])
    return style.value_text(data, dim, float(axis_numbers(data, dim)[index]), options)


def is_log(values: Floats) -> bool:
    """Return True if an axis is spaced by a constant factor rather than a constant step."""
    if values.size < 3 or values[0] <= 0 or values[-1] < 3 * values[0]:
        return False
    steps = np.diff(values)
    factors = np.diff(np.log(values))
    return bool(np.ptp(factors) / factors.mean() < np.ptp(steps) / steps.mean())


def log_ticks(axis: Any, span: float) -> None:
    """Set ticks of a logarithmic axis; `span` is the ratio of its ends."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if span < 2000 else (1,)))
    axis.set_major_formatter(
        lambda value, _: f"{value:,.0f}".replace(",", " ") if value >= 1e4 else f"{value:g}"
    )
    axis.set_minor_formatter(NullFormatter())


def _second_scale(axes: Axes, side: str, g: float, units: str, symbol: str) -> None:
    """Draw an acceleration in the other unit on the other side, with round values there."""
    factor, text = (g, f"{symbol} (m/s²)") if units == "g" else (1 / g, f"{symbol} (g)")
    add: Any = axes.secondary_yaxis if side == "y" else axes.secondary_xaxis
    other = add(
        "right" if side == "y" else "top", functions=(lambda a: a * factor, lambda a: a / factor)
    )
    low, high = getattr(axes, f"get_{side}lim")()
    # set now: matplotlib would set them when it draws, after the layout has left space for numbers
    other.set(**{f"{side}lim": (low * factor, high * factor), f"{side}label": text})
    if getattr(axes, f"get_{side}scale")() == "log":
        log_ticks(getattr(other, f"{side}axis"), high / low)


def log_axis(
    axes: Axes, values: Floats, label: str, least: float | None = 1.0, zeros: bool = False
) -> float:
    """Set a logarithmic ordinate for the values above `least`, of seven decades at most.

    With `zeros` the axis begins at `least` if a value is zero: curves come from below it.  Return a
    number below the axis that may be drawn for zero.  InputError: no value is above zero.
    """
    finite = values[np.isfinite(values)]
    there = finite[finite > 0]
    if not there.size:
        what = "no value above zero" if finite.size else "no value"
        raise InputError(
            f"{label}: {what} in this slice, and the axis is logarithmic; choose another slice "
            "(--at)"
        )
    high = float(there.max())
    low = max(float(there.min()), high * 1e-7)
    if least is not None and high > 10 * least:
        low = least if zeros and (values <= 0).any() else max(low, least)
    axes.set(yscale="log", ylim=(low / 1.2, high * 1.5), ylabel=label)
    log_ticks(axes.yaxis, high / low * 100)
    axes.grid(color="0.9", which="major")
    axes.set_axisbelow(True)
    return axes.get_ylim()[0] / 10


def curve_looks(number: int) -> list[Look]:
    """Return colour, dash and marker of the curves of a family, told apart without colour."""
    # not up to the yellow end, which is faint on white and in grey
    colours = mpl.colormaps["viridis"](np.linspace(0, 0.68, number))
    return [
        {
            "color": tuple(colour),
            "linestyle": dash,
            "marker": marker,
            "markersize": 4,
            "markerfacecolor": "white",
        }
        for colour, dash, marker in zip(
            colours, itertools.cycle(_DASHES), itertools.cycle(_MARKERS), strict=False
        )
    ]


def plot_curve(axes: Axes, xs: Floats, ys: Floats, offset: float = 0.0, **look: Any) -> Any:
    """Draw a line with a few markers, and one on each value without a neighbour.

    `offset` moves the markers by that part of their distance.  Zeros leave gaps where the ordinate
    is logarithmic.
    """
    if axes.get_yscale() == "log":
        ys = np.where(ys > 0, ys, np.nan)
    there = np.concatenate([[False], np.isfinite(ys), [False]])
    single = np.flatnonzero(there[1:-1] & ~there[:-2] & ~there[2:])
    inside = np.flatnonzero(there[1:-1])
    regular = (
        inside[((np.arange(_MARKED) + offset) / _MARKED * inside.size).astype(int)]
        if inside.size
        else inside
    )
    if "marker" not in look:
        look = {**look, "marker": "." if single.size else ""}
        regular = regular[:0]
    (line,) = axes.plot(xs, ys, markevery=sorted({*regular.tolist(), *single.tolist()}), **look)
    return line
