"""Page to explore a result in: an HTML file that needs neither server nor network.

Bokeh draws (its library, 1.3 MB, is put into the page); the script of the page, in the folder
`script`, looks up cells and scales them by the laws below, and computes no physics.  Everything it
shows was computed by slipsweep and lies in the page as deflated little-endian arrays in base64.

What comes from a file meets the page in its template alone, which escapes it: text as HTML, all
else in an element of JSON.  The page's policy runs two scripts, which it knows by their digests:
Bokeh's library and that of the page.
"""

import base64
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.charts.style import SYMBOLS, caption, is_acceleration, unit
from slipsweep.errors import InputError, check_extra
from slipsweep.explore.excerpt import LAYERS, RESULT_TYPES, Excerpt, read_excerpt
from slipsweep.explore.figures import axis_title, colour_scale, decades, figures
from slipsweep.explore.histories import POINTS, Histories, compute_histories
from slipsweep.explore.scripts import bokeh_script, digest, page_script
from slipsweep.files import outputs
from slipsweep.files.selection import axis_numbers
from slipsweep.grid.resources import size_text
from slipsweep.model.variables import (
    FLAG_KIND_TEXT,
    PARAMETERS,
    FlagKind,
    SlidingMode,
    flags_of,
    has_signed_displacements,
)

#: Bytes of a page when no other number is asked for: what every mail server lets pass.
PAGE_BYTES = 10_000_000

#: Bytes of the figures, the notes and the page's script.
_FIXED_BYTES = 150_000

#: Bytes that a page has for data at least.
_LEAST_DATA_BYTES = 50_000

#: Share of the data that cells may take; histories have the rest.
_CELLS_SHARE = 0.75

#: Some thousands of histories: beyond them another shows nothing new.
_HISTORIES_BYTES = 4_500_000

#: Powers by which displacements follow from one frequency to others, and from one time scale
#: (MODEL, motion rules).
_LAWS = {"frequency": -2.0, "time_scale": 2.0}

#: Array in the page: type, shape, further descriptions, and its deflated bytes in base64.
Array = dict[str, Any]


def packed(values: NDArray[Any], **descriptions: Any) -> Array:
    """Deflate an array."""
    data = zlib.compress(np.ascontiguousarray(values).tobytes())
    return {
        "dtype": values.dtype.str[1:],
        "shape": values.shape,
        **descriptions,
        "data": base64.b64encode(data).decode(),
    }


def cell_arrays(excerpt: Excerpt) -> dict[str, Array]:
    """Results and coordinates of the cells, of length 1 along dimensions they do not depend on."""
    arrays = {}
    for name in filter(excerpt.table.__contains__, RESULT_TYPES):
        variable = excerpt.table[name]
        values = variable.values.reshape([variable.sizes.get(dim, 1) for dim in excerpt.sizes])
        law = None
        if colour_scale(name) == "displacement":
            values, law = _by_law(excerpt, values)
        arrays[name] = packed(values, dims=variable.dims, law=law)
    for key, coord in excerpt.table.coords.items():
        if key not in coord.dims:
            arrays[f"coordinate_{key}"] = packed(coord.values.astype("<f8"), dims=coord.dims)
    return arrays


def _by_law(excerpt: Excerpt, values: NDArray[Any]) -> tuple[NDArray[Any], dict[str, Any] | None]:
    """Displacements at frequency or time scale 1 and the power, or all displacements and None.

    The law holds if all displacements follow from it in single precision.
    """
    for axis, dim in enumerate(excerpt.sizes):
        if dim not in _LAWS or values.shape[axis] == 1:
            continue
        shape = [-1 if other == dim else 1 for other in excerpt.sizes]
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            factor = (axis_numbers(excerpt.table, dim) ** _LAWS[dim]).reshape(shape)
            at_one = (values.take([0], axis) / factor.take([0], axis)).astype(values.dtype)
            if np.allclose(at_one * factor, values, rtol=4e-7, atol=0.0, equal_nan=True):
                return at_one, {"dim": dim, "power": _LAWS[dim]}
    return values, None


def write_page(
    path: Path, output: Path, *, size: int = PAGE_BYTES, overwrite: bool = False
) -> Excerpt:
    """Write the page of a result, of at most `size` bytes, complete or not at all.

    Return the part of the result that it shows.  InputError: the file cannot be read or drawn,
    `size` is too small, Bokeh is not installed, or the output exists.  RunError: writing failed.
    """
    check_extra("explore", "explore", "bokeh", "jinja2")  # which Bokeh brings along
    outputs.check_outputs([output], overwrite, reads=[path])
    bokeh = bokeh_script()
    fixed = len(bokeh.encode()) + _FIXED_BYTES
    least = fixed + _LEAST_DATA_BYTES
    if size < least:
        raise InputError(
            f"--size = {size_text(size)}: must be {size_text(least)} at least, "
            "most of it Bokeh's library"
        )
    excerpt, arrays, histories = _data(path, size - fixed)
    text = _page(path, bokeh, excerpt, arrays, histories)
    with outputs.complete_or_absent(output, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return excerpt


def _data(path: Path, most_bytes: int) -> tuple[Excerpt, dict[str, Array], Histories | None]:
    """Cells and histories of a result, and their arrays, of at most `most_bytes`."""
    # two bytes a cell: if frequencies follow from each other it takes next to nothing; if they do
    # not, again with fewer cells
    cells = most_bytes // 2
    while True:
        excerpt = read_excerpt(path, cells)
        arrays = cell_arrays(excerpt)
        taken = sum(len(array["data"]) for array in arrays.values())
        if taken <= _CELLS_SHARE * most_bytes:
            break
        cells = int(math.prod(excerpt.sizes.values()) * 0.95 * _CELLS_SHARE * most_bytes / taken)
    # base64 makes four bytes of three
    histories = compute_histories(excerpt, min(most_bytes - taken, _HISTORIES_BYTES) * 3 // 4)
    if histories is not None:
        arrays["histories"] = packed(histories.values.astype("<i2"))
        arrays["history_scale"] = packed(histories.scale.astype("<f4"))
    return excerpt, arrays, histories


def _page(
    path: Path,
    bokeh: str,
    excerpt: Excerpt,
    arrays: Mapping[str, Array],
    histories: Histories | None,
) -> str:
    """Fill the template."""
    from jinja2 import Environment, PackageLoader
    from markupsafe import Markup

    environment = Environment(loader=PackageLoader("slipsweep", "explore"), autoescape=True)
    # not sorted: what Bokeh's has an order
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False, "allow_nan": False}
    # it may have bytes that are no UTF-8
    name = path.name.encode(errors="backslashreplace").decode()
    attrs = excerpt.table.attrs
    script = page_script()
    return environment.get_template("page.html").render(
        title=attrs.get("title", name),
        file=name,
        caption=caption(excerpt.table).split("\n"),
        source=f"{attrs.get('source', 'slipsweep')}; {attrs.get('references', '')}",
        notes=_notes(excerpt, histories),
        thinned=_thinned_axes(excerpt),
        meta=_contents(excerpt, arrays, histories),
        bokeh=Markup(bokeh),
        script=Markup(script),
        allowed=Markup(" ".join(map(digest, (bokeh, script)))),
    )


def _contents(
    excerpt: Excerpt, arrays: Mapping[str, Array], histories: Histories | None
) -> dict[str, Any]:
    """Everything that the script shows, or needs to know of it."""
    table = excerpt.table
    return {
        "dims": [_dimension(excerpt, dim) for dim in excerpt.sizes],
        "coords": {
            key: _parameter(str(key))
            for key, coord in table.coords.items()
            if key not in coord.dims
        },
        "map": {"y": excerpt.map_dims[0], "x": excerpt.map_dims[1]},
        "layers": _layers(excerpt),
        "arrays": arrays,
        "figures": figures(excerpt),
        "modes": {int(mode): mode.name.lower() for mode in SlidingMode},
        "flags": _flags(),
        "kinds": {str(kind): text for kind, text in FLAG_KIND_TEXT.items()},
        "cautions": int(flags_of(FlagKind.CAUTION)),
        "unsound": int(flags_of(FlagKind.CAUTION) | flags_of(FlagKind.NO_VALUE)),
        "g": float(table.attrs["g"]),
        "signed": has_signed_displacements(table.attrs),
        "histories": histories and _history_store(histories, int(table.attrs["cycles"])),
    }


def _dimension(excerpt: Excerpt, dim: str) -> dict[str, Any]:
    """Names, unit, values and labels of a dimension."""
    return _parameter(dim) | {
        "values": axis_numbers(excerpt.table, dim).tolist(),
        "log": excerpt.is_log(dim),
        "labels": excerpt.labels.get(dim, []),
    }


def _parameter(name: str) -> dict[str, Any]:
    """Names and unit of a dimension or coordinate."""
    units = "m" if name == "threshold" else ""
    return {
        "name": name,
        "title": axis_title(name),
        "symbol": SYMBOLS.get(name, name.replace("_", " ")),
        "unit": unit(name) if name in PARAMETERS else units,
        "acceleration": is_acceleration(name),
    }


def _layers(excerpt: Excerpt) -> list[dict[str, Any]]:
    """Results of the readout; those with a short name can colour the map."""
    names = [*excerpt.layers]
    if "valueless_share" in excerpt.table:
        names.append("valueless_share")
    return [
        {
            "name": name,
            "title": excerpt.table[name].attrs["long_name"],
            "short": LAYERS.get(name),
            "scale": colour_scale(name),
        }
        for name in names
    ]


def _flags() -> list[dict[str, Any]]:
    """All flags, kind by kind."""
    return [
        {
            "mask": int(flag),
            "name": (flag.name or "").lower(),
            "kind": str(kind),
            "text": flag.text,
        }
        for kind in FlagKind
        for flag in flags_of(kind)
    ]


def _history_store(histories: Histories, cycles: int) -> dict[str, Any]:
    """Cells that have a history, and its points; the shaking has `cycles` cycles."""
    return {
        "keep": {dim: indices.tolist() for dim, indices in histories.keep.items()},
        "phase": histories.phase.tolist(),
        "ground": histories.ground.tolist(),
        "cycles": histories.cycles,
        "of": cycles,
    }


def _thinned_axes(excerpt: Excerpt) -> list[tuple[str, str]]:
    """Axes of which some values are left out, and the values that are kept."""
    axes = []
    for dim, length in excerpt.lengths.items():
        if excerpt.sizes[dim] < length:
            values = ", ".join(f"{value:.5g}" for value in axis_numbers(excerpt.table, dim))
            units = f" {unit(dim)}" if dim in PARAMETERS else ""
            axes.append((f"{dim}: {excerpt.sizes[dim]} of {length} values", values + units))
    return axes


def _notes(excerpt: Excerpt, histories: Histories | None) -> list[str]:
    """Sentences on what the page leaves out."""
    unsound = str(excerpt.table.attrs.get("unsound", "")).splitlines()
    notes = [_cells_note(excerpt), _colours_note(excerpt)]
    if "motion" in excerpt.sizes and "quantile" in excerpt.sizes:
        notes.append(
            "Quantiles and probabilities are those of all motions and polarities that have a "
            "value, as slipsweep.suite_statistics gives them."
        )
    notes += [f"Unsound: {text}." for text in unsound]
    return [*notes, _histories_note(excerpt, histories)]


def _cells_note(excerpt: Excerpt) -> str:
    shown = math.prod(excerpt.sizes[dim] for dim in excerpt.lengths)
    total = math.prod(excerpt.lengths.values())
    if shown == total:
        return f"All {shown:,} cells of the file are in this page."
    return (
        f"Thinned: {shown:,} of the file's {total:,} cells are in this page. Of each axis evenly "
        "spaced values are kept, with the first and last. Nothing is averaged."
    )


def _colours_note(excerpt: Excerpt) -> str:
    low, high = decades(excerpt)
    return (
        "Each cell is drawn half way to its neighbours. Displacements are kept in single "
        f"precision; those beyond {10.0**low:g} and {10.0**high:g} mm have the colours at the "
        "ends of the scale."
    )


def _histories_note(excerpt: Excerpt, histories: Histories | None) -> str:
    if histories is None:
        return (
            "The page has no time histories. They need harmonic motion without uncertain inputs, "
            "and space in the page. slipsweep simulate computes one for any case."
        )
    counts = " × ".join(f"{len(indices)} {dim}" for dim, indices in histories.keep.items())
    return (
        f"Time histories: the first {histories.cycles} of {excerpt.table.attrs['cycles']} cycles, "
        f"{POINTS} points a cycle, computed event by event for {counts or 'one case'} and kept to "
        "1/32767 of their largest value. They are scaled to the frequency of the cell "
        "(velocity ~ 1/ω, displacement ~ 1/ω²), which is exact."
    )
