"""A page to explore a result in: one HTML file that needs neither server nor network.

Bokeh draws (its library, 1.3 MB, is put into the page), `explore.js` beside this file moves the
numbers: it looks up cells and scales time histories, and computes no physics.  Everything it shows
was computed by slipsweep and lies in the page as little-endian arrays in base64.
"""

import base64
import importlib.resources
import json
import math
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.charts.answers import amplitude_of
from slipsweep.charts.slices import CODES, check_drawable, check_harmonic, check_sweep
from slipsweep.charts.style import BLUE, VERMILION, axis_label, caption, unit, value_text
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.files.results import FileVariable, result_file
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.grid.resources import size_text
from slipsweep.grid.tables import Table, Variable
from slipsweep.model.options import MODELS
from slipsweep.model.variables import CAUTIONS, PARAMETERS, VALIDITY_TEXT, VALUELESS, FlagKind, SlidingMode, flags_of
from slipsweep.motion.waveforms import WAVEFORMS
from slipsweep.studies.history import history_table

#: Bytes of a page when no other number is asked for: what most mail servers let pass.
PAGE_BYTES = 25_000_000

#: Of the room beside Bokeh, the most that cells take; histories have the rest.
_CELLS_SHARE = 0.75

#: Some thousands of histories: beyond them another one shows nothing new, and takes 0.8 ms to compute.
_HISTORIES_BYTES = 6_000_000

#: What a page shows of a cell, and its type in the page.
_SHOWN = {"permanent_displacement": "<f4", "sliding_mode": "<i1", "validity": "<i2"}

_VERTICAL = ("amplitude", "displacement_amplitude")
_HORIZONTAL = ("frequency",)

#: A history in the page: points a cycle, and how many cycles at most.
_POINTS, _CYCLES = 64, 3
_HISTORY = ("block_acceleration", "relative_velocity", "relative_displacement")

#: base64 makes four bytes of three.
_BASE64 = 4 / 3

_MAP_SIZE = (620, 470)

Indices = dict[str, NDArray[np.intp]]


# ------------------------------------------------------------------------------- thinning


def thinned_lengths(lengths: Mapping[str, int], cells: int, map_dims: Sequence[str] = ()) -> dict[str, int]:
    """Cut the axes of a grid down to a number of cells.

    Parameters
    ----------
    lengths : mapping of str to int
        Dimensions and their lengths.
    cells : int
        The most cells that may remain, at least 1.
    map_dims : sequence of str
        Dimensions of the map: four of their values count as one of another dimension, since a map
        needs more of them than a slider.

    Returns
    -------
    dict of str to int
        The lengths, the longest cut first; a dimension of the map keeps two values.
    """
    left = dict(lengths)
    while math.prod(left.values()) > cells:
        least = {dim: min(lengths[dim], 2) if dim in map_dims else 1 for dim in left}
        spare = {dim: n / (4 if dim in map_dims else 1) for dim, n in left.items() if n > least[dim]}
        if not spare:
            break
        longest = max(spare, key=lambda dim: spare[dim])
        # a twentieth at a time: axes shrink together, and long ones in few steps
        left[longest] = max(least[longest], left[longest] - max(1, left[longest] // 20))
    return left


def evenly(length: int, kept: int) -> NDArray[np.intp]:
    """Return `kept` indices of `length`, first and last among them, as evenly as whole numbers allow."""
    return np.unique(np.linspace(0, length - 1, kept).round().astype(np.intp))


@dataclass(frozen=True)
class Excerpt:
    """What a page shows of a result.

    Attributes
    ----------
    table : Table
        Coordinates (increasing along each dimension) and the results in `_SHOWN`.
    map_dims : tuple of str
        Dimensions up and across the map.
    lengths : dict of str to int
        Lengths of the dimensions in the file.
    labels : list of str
        Names of the cases kept; empty without them.
    """

    table: Table
    map_dims: tuple[str, str]
    lengths: dict[str, int]
    labels: list[str]


def read_excerpt(path: Path, cells: int) -> Excerpt:
    """Read a result, or an evenly spaced part of it that has at most `cells` cells.

    Memory stays small whatever the size of the file.

    Raises
    ------
    InputError
        The file cannot be read, or holds no displacement over amplitude and frequency.
    """
    with result_file(path) as file:
        check_harmonic(file)
        if "exceedance_probability" in file:
            raise InputError(f"{path}: holds statistics of uncertain inputs, which slipsweep chart draws")
        if "permanent_displacement" not in file.results:
            raise InputError(
                f"{path}: holds no permanent_displacement to draw; add it to output.variables and run the sweep again"
            )
        lengths = file["permanent_displacement"].sizes
        if 0 in lengths.values():
            raise InputError(f"{path}: holds no cells")
        map_dims = _map_dims(path, lengths)
        check_sweep(file)
        left = thinned_lengths(lengths, cells, map_dims)
        if math.prod(left.values()) > cells:
            raise InputError(f"{path}: a grid of {len(lengths)} dimensions does not fit into a page of this size")

        keep: Indices = {dim: file.axis(dim)[1][evenly(length, left[dim])] for dim, length in lengths.items()}
        coords = {
            name: Variable(file[name].dims, file[name].read_floats(keep).astype(np.float64), PARAMETERS[name])
            for name in PARAMETERS
            if name in file.coordinates and lengths.keys() >= {*file[name].dims}
        }
        if {"displacement_amplitude", "frequency"} <= coords.keys() and "amplitude" not in coords:
            coords["amplitude"] = amplitude_of(coords["displacement_amplitude"], coords["frequency"])
        for name in ("theta", "mu_s", "amplitude", "frequency"):
            if name not in coords:
                raise InputError(f"{path}: {name}: not in the file, but the page needs it")
        for name, coord in coords.items():
            check_drawable(path, name, coord.values)
            if np.isnan(coord.values).any():
                raise InputError(f"{path}: {name}: values are missing")
        results = {name: np.empty([*left.values()], kind) for name, kind in _SHOWN.items() if name in file.results}
        for chunk in grid_chunks(lengths, CHUNK_CELLS):
            inside = {
                dim: np.flatnonzero((keep[dim] >= part.start) & (keep[dim] < part.stop)) for dim, part in chunk.items()
            }
            if not all(map(len, inside.values())):
                continue
            source = np.ix_(*(keep[dim][at] - chunk[dim].start for dim, at in inside.items()))
            for name, values in results.items():
                values[np.ix_(*inside.values())] = _read_chunk(file[name], chunk)[source]
        labels = [file.labels[at] for at in keep["case"]] if file.labels and "case" in keep else []
        attrs = file.attrs
    table = Table(coords, {name: Variable(tuple(left), values) for name, values in results.items()}, attrs)
    return Excerpt(table, map_dims, lengths, labels)


def _read_chunk(variable: FileVariable, chunk: Mapping[str, slice]) -> NDArray[Any]:
    """Read the part of a chunk along the chunk's dimensions, in their order."""
    beyond = [dim for dim in variable.dims if dim not in chunk]
    if beyond:
        raise InputError(
            f"{variable.path}: {variable.name}: lies along {beyond[0]}, along which permanent_displacement does not"
        )
    if variable.name in CODES:
        values = variable.read_codes(chunk, CODES[variable.name])
    else:
        values = variable.read_floats(chunk)
        check_drawable(variable.path, variable.name, values, float(np.finfo(np.float32).max))
    values = values.transpose([variable.dims.index(dim) for dim in chunk if dim in variable.dims])
    sizes = variable.sizes
    values = values.reshape([part.stop - part.start if dim in sizes else 1 for dim, part in chunk.items()])
    return np.broadcast_to(values, [part.stop - part.start for part in chunk.values()])


def _map_dims(path: Path, lengths: Mapping[str, int]) -> tuple[str, str]:
    """The dimensions up and across the map."""
    up = [dim for dim in _VERTICAL if lengths.get(dim, 1) > 1]
    across = [dim for dim in _HORIZONTAL if lengths.get(dim, 1) > 1]
    if not up or not across:
        held = ", ".join(f"{dim} ({length})" for dim, length in lengths.items()) or "none"
        raise InputError(
            f"{path}: no map to draw: explore needs two values or more of both amplitude (or displacement_amplitude) "
            f"and frequency as axes; the dimensions are: {held}"
        )
    return up[0], across[0]


# ------------------------------------------------------------------------------ histories


@dataclass(frozen=True)
class Histories:
    """Time histories of some cells, over phase: what they are at ω = 1 rad/s.

    Attributes
    ----------
    keep : dict of str to ndarray
        Dimensions that histories depend on, and the indices of the excerpt that have them.
    phase, ground : ndarray
        Phase (rad), and ground acceleration over its amplitude.
    values : ndarray of int16, shape (..., quantity, point)
        Block acceleration, relative velocity and displacement, in units of `scale`.
    scale : ndarray of float32, shape (..., quantity)
        NaN where the cell has no history.
    cycles : int
        Cycles shown.
    """

    keep: Indices
    phase: NDArray[np.float64]
    ground: NDArray[np.float64]
    values: NDArray[np.int16]
    scale: NDArray[np.float32]
    cycles: int


def compute_histories(excerpt: Excerpt, most_bytes: int) -> Histories | None:
    """Compute the histories of as many cells, evenly spaced, as fit into `most_bytes`.

    They depend on time through the phase only: v(f) = V/ω and u(f) = W/ω², so that one
    history serves all frequencies and the page scales it (MODEL, motion rules).

    Returns
    -------
    Histories or None
        None where the shaking is not periodic or ends with a ramp beyond the cycles shown, or where not
        even one history fits.
    """
    table = excerpt.table
    if "waveform" not in table.attrs:
        return None
    motion = WAVEFORMS.from_attributes(table.attrs)
    if motion.cycles > _CYCLES and motion.ramp_out > 0.0:
        return None  # the first cycles alone have no ramp at their end
    inputs = {
        name: variable
        for name, variable in table.coords.items()
        if name not in ("frequency", "displacement_amplitude", "structure_frequency")
    }
    sizes = {
        dim: table["permanent_displacement"].sizes[dim]
        for dim in table["permanent_displacement"].dims
        if any(dim in variable.dims for variable in inputs.values())
    }
    cycles = min(motion.cycles, _CYCLES)
    motion, model = motion.but(cycles=cycles), MODELS.from_attributes(table.attrs)
    points = _POINTS * cycles + 1
    each = len(_HISTORY) * (2 * points + 4) * _BASE64
    if each > most_bytes:
        return None
    left = thinned_lengths(sizes, int(most_bytes / each), [dim for dim in excerpt.map_dims if dim in sizes])
    keep = {dim: evenly(length, left[dim]) for dim, length in sizes.items()}
    if math.prod(left.values()) * each > most_bytes:
        return None
    phase = np.linspace(0.0, 2.0 * math.pi * cycles, points)
    ground = np.zeros(points)
    values = np.zeros((*left.values(), len(_HISTORY), points), np.int16)
    scale = np.full((*left.values(), len(_HISTORY)), np.nan, np.float32)
    for at in np.ndindex(*left.values()):
        cell = {dim: int(keep[dim][i]) for dim, i in zip(keep, at, strict=True)}
        case = {name: variable.values[tuple(cell[dim] for dim in variable.dims)] for name, variable in inputs.items()}
        given: dict[str, Any] = {name: float(value) for name, value in case.items()}
        given["frequency"] = 1.0 / (2.0 * math.pi)
        history = history_table(times=phase, excitation=motion, model=model, **given)
        columns = np.array([history[name].values for name in _HISTORY])
        if np.isfinite(columns).all():
            largest = np.abs(columns).max(axis=1)
            scale[at] = largest / 32767.0
            with np.errstate(invalid="ignore"):
                values[at] = np.where(largest[:, None] > 0.0, columns / largest[:, None] * 32767.0, 0.0).round()
            if case["amplitude"] > 0.0:
                ground = history["ground_acceleration"].values / case["amplitude"]
    return Histories(keep, phase, ground, values, scale, cycles)


# ------------------------------------------------------------------------------- the page


def write_page(
    path: Path,
    output: Path,
    *,
    size: int = PAGE_BYTES,
    overwrite: bool = False,
) -> Excerpt:
    """Write the page of a result; complete or not at all.

    Parameters
    ----------
    path : Path
        A file that slipsweep wrote.
    output : Path
        The page.
    size : int
        The most bytes that the page may have.
    overwrite : bool
        Replace `output` if it exists.

    Returns
    -------
    Excerpt
        What the page shows.

    Raises
    ------
    InputError
        The file cannot be read or drawn, `size` is too small, Bokeh is not installed, or the
        output exists.
    RunError
        Writing failed.
    """
    outputs.check_outputs([output], overwrite, reads=[path])
    script = _bokeh().resources.Resources(mode="inline", components=["bokeh"]).render()
    # the page without its arrays, and its figures and notes
    overhead = len(script.encode()) + 150_000
    least = overhead + 50_000
    if size < least:
        raise InputError(f"--size = {size_text(size)}: must be {size_text(least)} at least, most of it Bokeh's library")
    room = size - overhead
    # mostly the modes and flags do not vary with frequency, and take next to nothing; if they do, again with less
    for per_cell in (4.2 * _BASE64, sum(np.dtype(kind).itemsize for kind in _SHOWN.values()) * _BASE64):
        excerpt = read_excerpt(path, int(_CELLS_SHARE * room / per_cell))
        taken = sum(_squeezed(excerpt.table[name].values).nbytes for name in _SHOWN if name in excerpt.table) * _BASE64
        if taken <= _CELLS_SHARE * room:
            break
    histories = compute_histories(excerpt, int(min(room - taken, _HISTORIES_BYTES)))
    name = path.name.encode(errors="backslashreplace").decode()  # it may have bytes that are no UTF-8
    text = page(excerpt, histories, name, script)
    with outputs.complete_or_absent(output, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return excerpt


def page(excerpt: Excerpt, histories: Histories | None, name: str, script: str) -> str:
    """Return the page's HTML; `name` is that of the file, `script` Bokeh's library as HTML."""
    from bokeh.embed import components

    table = excerpt.table
    drawn, divs = components(_figures(excerpt))
    arrays = {
        result: _squeezed(table[result].values) for result in _SHOWN if result in table
    }  # in the order of `_SHOWN`
    if histories is not None:
        arrays |= {"histories": histories.values.astype("<i2"), "history_scale": histories.scale.astype("<f4")}
    meta = {
        "dims": [_dimension(excerpt, dim) for dim in table["permanent_displacement"].dims],
        "map": {"y": excerpt.map_dims[0], "x": excerpt.map_dims[1], "width": _MAP_SIZE[0], "height": _MAP_SIZE[1]},
        "arrays": {key: {"dtype": array.dtype.str[1:], "shape": array.shape} for key, array in arrays.items()},
        "coords": {
            key: {"dims": coord.dims, "values": coord.values.ravel().tolist(), "shape": coord.values.shape}
            for key, coord in table.coords.items()
            if key not in coord.dims
        },
        "units": {key: unit(key) for key in table.coords},
        "symbols": {key: value_text(key, 0.0).split(" = ")[0] for key in table.coords},
        "modes": {int(mode): mode.name.lower() for mode in SlidingMode},
        "flags": [
            {"mask": int(flag), "name": (flag.name or "").lower(), "kind": str(kind), "text": VALIDITY_TEXT[flag]}
            for kind in FlagKind
            for flag in flags_of(kind)
        ],
        "valueless": int(VALUELESS),
        "cautions": int(CAUTIONS),
        "g": float(table.attrs.get("g", 9.81)),
        "histories": None
        if histories is None
        else {
            "keep": {dim: indices.tolist() for dim, indices in histories.keep.items()},
            "phase": histories.phase.tolist(),
            "ground": histories.ground.tolist(),
            "cycles": histories.cycles,
            "of": int(table.attrs["cycles"]),
        },
    }
    # "</" would end the script element
    told = json.dumps(meta, ensure_ascii=False, allow_nan=False).replace("</", "<\\/")
    blobs = "\n".join(
        f'<script type="application/octet-stream" id="array-{key}">'
        f"{base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()}</script>"
        for key, array in arrays.items()
    )
    files = importlib.resources.files("slipsweep.explore")
    return string.Template((files / "page.html").read_text(encoding="utf-8")).substitute(
        title=escape(str(table.attrs.get("title", name))),
        file=escape(name),
        caption=escape(caption(table)).replace("\n", "<br>"),
        source=escape(f"{table.attrs.get('source', 'slipsweep')}; {table.attrs.get('references', '')}"),
        notes="".join(f"<li>{note}</li>" for note in _notes(excerpt, histories)),
        bokeh=script,
        figures=drawn,
        map=divs["map"],
        accelerations=divs["accelerations"],
        velocity=divs["velocity"],
        displacement=divs["displacement"],
        blobs=blobs,
        meta=told,
        script=(files / "page.js").read_text(encoding="utf-8"),
    )


def _bokeh() -> ModuleType:
    """Bokeh, which is not among what slipsweep always needs."""
    try:
        import bokeh.resources
    except ImportError:
        raise InputError('explore draws with Bokeh, which is not installed: pip install "slipsweep[explore]"') from None
    return bokeh


def _squeezed(values: NDArray[Any]) -> NDArray[Any]:
    """Return the array with length 1 along dimensions it does not vary along, such as a mode along frequency."""
    for axis in range(values.ndim):
        first = values.take([0], axis)
        if values.shape[axis] > 1 and np.array_equal(
            np.broadcast_to(first, values.shape), values, values.dtype.kind == "f"
        ):
            values = first
    return values


def _log_spaced(values: NDArray[np.float64]) -> bool:
    """Whether an axis is spread by factors rather than by steps."""
    if values.size < 3 or values[0] <= 0.0 or values[-1] < 3.0 * values[0]:
        return False
    steps, factors = np.diff(values), np.diff(np.log(values))
    return bool(np.std(factors) / np.mean(factors) < np.std(steps) / np.mean(steps))


def _values(excerpt: Excerpt, dim: str) -> NDArray[np.float64]:
    """The values along a dimension; one without a coordinate, such as `case`, counts from 1."""
    if dim in excerpt.table.coords:
        return excerpt.table[dim].values
    return np.arange(1.0, 1.0 + excerpt.table["permanent_displacement"].sizes[dim])


def _dimension(excerpt: Excerpt, dim: str) -> dict[str, Any]:
    values = _values(excerpt, dim)
    return {
        "name": dim,
        "title": axis_label(dim) if dim in PARAMETERS else dim,
        "values": values.tolist(),
        "labels": excerpt.labels if dim == "case" else [],
        "log": _log_spaced(values),
    }


def _decades(excerpt: Excerpt) -> tuple[int, int]:
    """Powers of ten, in mm, that the colours span: those of nine cells in ten, five at most and from 1 mm up."""
    values = excerpt.table["permanent_displacement"].values
    positive = values[np.isfinite(values) & (values > 0.0)]
    if positive.size == 0:
        return 0, 1
    fifth, ninety_fifth = np.log10(np.percentile(positive, (5.0, 95.0)) * 1000.0)
    low, high = math.floor(fifth), max(math.ceil(ninety_fifth), math.floor(fifth) + 1)
    if high - low > 5:
        low = min(max(low, 0), high - 5)
    return low, min(high, low + 5)


def _figures(excerpt: Excerpt) -> dict[str, Any]:
    """The map and the three panels of a history, empty; `explore.js` fills them."""
    from bokeh.models import (
        ColumnDataSource,
        CustomJS,
        FixedTicker,
        LogColorMapper,
        PrintfTickFormatter,
        Range1d,
    )
    from bokeh.models.annotations import ColorBar
    from bokeh.plotting import figure
    from matplotlib.colors import to_hex

    from slipsweep.charts.maps import COLOURS

    up, across = excerpt.map_dims
    low, high = _decades(excerpt)
    log = {dim: _log_spaced(_values(excerpt, dim)) for dim in excerpt.map_dims}
    chart: Any = figure(  # its properties take more than their annotations say
        name="map",
        frame_width=_MAP_SIZE[0],
        frame_height=_MAP_SIZE[1],
        x_axis_type="log" if log[across] else "linear",
        y_axis_type="log" if log[up] else "linear",
        x_axis_label=axis_label(across),
        y_axis_label=axis_label(up),
        x_range=Range1d(start=1, end=2, name="x_range"),
        y_range=Range1d(start=1, end=2, name="y_range"),
        tools="pan,wheel_zoom,box_zoom,reset,save",
        active_scroll=None,
    )
    chart.toolbar.logo = None
    chart.grid.visible = False
    # three bands a decade: their edges are contours of displacement
    palette = [to_hex(colour) for colour in COLOURS(np.linspace(0, 1, 3 * (high - low)))]
    mapper = LogColorMapper(palette=palette, low=10.0**low, high=10.0**high, nan_color="rgba(0, 0, 0, 0)")
    place: dict[str, Any] = {"x": "x", "y": "y", "dw": "dw", "dh": "dh"}
    corner: dict[str, Any] = {"x": [1.0], "y": [1.0], "dw": [1.0], "dh": [1.0]}
    colours = ColumnDataSource({"image": [np.zeros((1, 1), np.float32)], **corner}, name="colours")
    marks = ColumnDataSource({"image": [np.zeros((1, 1), np.uint32)], **corner}, name="marks")
    chart.image(image="image", **place, color_mapper=mapper, source=colours)
    chart.image_rgba(image="image", **place, source=marks)
    chosen = ColumnDataSource({"x": [1.0], "y": [1.0]}, name="chosen")
    for size, colour, width in ((15, "white", 5), (15, "black", 2)):
        chart.scatter(
            "x", "y", source=chosen, size=size, marker="circle", fill_color=None, line_color=colour, line_width=width
        )
    bar = ColorBar(
        color_mapper=mapper,
        title="permanent displacement (mm)",
        title_standoff=8,
        ticker=FixedTicker(ticks=[10.0**power for power in range(low, high + 1)]),
        formatter=PrintfTickFormatter(format="%g"),
    )
    chart.add_layout(bar, "above")
    for event, function in (("mousemove", "point"), ("mouseleave", "leave"), ("tap", "choose")):
        chart.js_on_event(event, CustomJS(code=f"window.slipsweep && window.slipsweep.{function}(cb_obj.x, cb_obj.y)"))

    panels = {"map": chart}
    history = ColumnDataSource({"t": [0.0], "ground": [0.0], "block": [0.0], "v": [0.0], "u": [0.0]}, name="history")
    shared: Any = None
    for name, label, height in (
        ("accelerations", "acceleration (m/s²)", 165),
        ("velocity", "rel. velocity (m/s)", 130),
        ("displacement", "rel. displacement (mm)", 155),
    ):
        panel: Any = figure(
            name=name,
            width=480,
            height=height,
            x_axis_label="time (s)" if name == "displacement" else None,
            y_axis_label=label,
            tools="",
            toolbar_location=None,
            min_border_left=75,
            **({"x_range": shared} if shared else {}),
        )
        shared = panel.x_range
        panel.x_range.range_padding = 0
        panel.yaxis.axis_label_text_font_size = "11px"
        if name == "accelerations":
            panel.line("t", "ground", source=history, color=BLUE, line_width=1.8, legend_label="plane")
            panel.line(
                "t", "block", source=history, color=VERMILION, line_width=1.8, line_dash="dashed", legend_label="block"
            )
            panel.legend.orientation = "horizontal"
            panel.legend.padding = 1
            panel.legend.border_line_color = None
            panel.legend.label_text_font_size = "11px"
            panel.add_layout(panel.legend[0], "above")
        else:
            panel.line("t", "v" if name == "velocity" else "u", source=history, color=VERMILION, line_width=1.8)
        panels[name] = panel
    return panels


def _notes(excerpt: Excerpt, histories: Histories | None) -> list[str]:
    """What the page leaves out, and how."""
    shown = excerpt.table["permanent_displacement"].sizes
    notes = []
    if shown == excerpt.lengths:
        notes.append(f"All {math.prod(shown.values()):,} cells of the file are here.")
    else:
        notes.append(
            f"Thinned: {math.prod(shown.values()):,} of the file's {math.prod(excerpt.lengths.values()):,} cells are "
            "here, whole values of the file's axes, evenly spaced by number, first and last kept; nothing is averaged."
        )
        for dim, length in shown.items():
            if length < excerpt.lengths[dim]:
                kept = ", ".join(f"{value:.5g}" for value in _values(excerpt, dim))
                notes.append(
                    f"<details><summary>{dim}: {length} of {excerpt.lengths[dim]} values</summary>{kept}"
                    f"{' ' + unit(dim) if dim in PARAMETERS else ''}</details>"
                )
    low, high = _decades(excerpt)
    notes.append(
        "Each cell reaches half way to its neighbours. Displacements are kept in single precision; those beyond "
        f"{10.0**low:g} and {10.0**high:g} mm have the colours at the ends of the scale."
    )
    if histories is None:
        notes.append("Time histories are left out: the shaking is not harmonic, or the page has no room for them.")
        return notes
    each = " × ".join(f"{len(indices)} {dim}" for dim, indices in histories.keep.items())
    notes.append(
        f"Time histories: the first {histories.cycles} of {excerpt.table.attrs['cycles']} cycles, {_POINTS} points a "
        f"cycle, computed event by event for {each or 'one case'} and kept to 1/32767 of their largest value. "
        "The one nearest to the chosen cell is shown, scaled to its frequency (velocity ~ 1/ω, displacement ~ 1/ω²)."
    )
    return notes
