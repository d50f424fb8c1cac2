"""A page to explore a result in: one HTML file that needs neither server nor network.

Bokeh draws (its library, 1.3 MB, is put into the page), `page.js` beside this file moves the
numbers: it looks up cells and scales them by the laws below, and computes no physics.  Everything
it shows was computed by slipsweep and lies in the page as deflated little-endian arrays in base64.

What comes from a file meets the page in its template alone, which escapes it: text as HTML, all
else in one element of JSON.  The page's policy runs two scripts, known by their digests: Bokeh's
library and `page.js`.
"""

import base64
import hashlib
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.charts.style import SYMBOLS, caption, is_acceleration, unit
from slipsweep.errors import InputError, check_extra
from slipsweep.explore.excerpt import LAYERS, SHOWN, Excerpt, read_excerpt
from slipsweep.explore.figures import decades, figures, label, scale_of
from slipsweep.explore.histories import POINTS, Histories, compute_histories
from slipsweep.files import outputs
from slipsweep.files.selection import axis_numbers
from slipsweep.grid.resources import size_text
from slipsweep.model import variables as known

#: Bytes of a page when no other number is asked for: what every mail server lets pass.
PAGE_BYTES = 10_000_000

#: Of the bytes that Bokeh leaves, the share that cells may take; histories have the rest.
_CELLS_SHARE = 0.75

#: Some thousands of histories: beyond them another one shows nothing new.
_HISTORIES_BYTES = 4_500_000

#: Powers by which displacements follow from one frequency to others, and from one time scale
#: (MODEL, motion rules).
_LAWS = {"frequency": -2.0, "time_scale": 2.0}

#: An array in the page: type, shape, what else is known of it, and its deflated bytes in base64.
Array = dict[str, Any]


def packed(values: NDArray[Any], **about: Any) -> Array:
    """Deflate an array."""
    data = zlib.compress(np.ascontiguousarray(values).tobytes())
    return {
        "dtype": values.dtype.str[1:],
        "shape": values.shape,
        **about,
        "data": base64.b64encode(data).decode(),
    }


def cell_arrays(excerpt: Excerpt) -> dict[str, Array]:
    """What the page shows of its cells, with length 1 along dimensions that it does not depend on, and their inputs."""
    arrays = {}
    for name in filter(excerpt.table.__contains__, SHOWN):
        variable = excerpt.table[name]
        values = variable.values.reshape([variable.sizes.get(dim, 1) for dim in excerpt.sizes])
        values, law = (
            _by_law(excerpt, values) if scale_of(name) == "displacement" else (values, None)
        )
        arrays[name] = packed(values, dims=variable.dims, law=law)
    for key, coord in excerpt.table.coords.items():
        if key not in coord.dims:
            arrays[f"coordinate_{key}"] = packed(coord.values.astype("<f8"), dims=coord.dims)
    return arrays


def _by_law(excerpt: Excerpt, values: NDArray[Any]) -> tuple[NDArray[Any], dict[str, Any] | None]:
    """Displacements at frequency (or time scale) 1 alone, if all others follow from them in single precision."""
    for axis, dim in enumerate(excerpt.sizes):
        if dim in _LAWS and values.shape[axis] > 1:
            shape = [-1 if other == dim else 1 for other in excerpt.sizes]
            with np.errstate(over="ignore", invalid="ignore", under="ignore"):
                factor = (axis_numbers(excerpt.table, dim) ** _LAWS[dim]).reshape(shape)
                first = (values.take([0], axis) / factor.take([0], axis)).astype(values.dtype)
                if np.allclose(first * factor, values, rtol=4e-7, atol=0.0, equal_nan=True):
                    return first, {"dim": dim, "power": _LAWS[dim]}
    return values, None


def write_page(
    path: Path, output: Path, *, size: int = PAGE_BYTES, overwrite: bool = False
) -> Excerpt:
    """Write the page of a result, of at most `size` bytes, complete or not at all; return what it shows.

    InputError: the file cannot be read or drawn, `size` is too small, Bokeh is not installed, or
    the output exists. RunError: writing failed.
    """
    check_extra("explore", "explore", "bokeh", "jinja2")  # which Bokeh brings along
    from jinja2 import Environment, PackageLoader
    from markupsafe import Markup

    outputs.check_outputs([output], overwrite, reads=[path])
    bokeh = _bokeh_script()
    overhead = len(bokeh.encode()) + 150_000  # figures and notes
    least = overhead + 50_000
    if size < least:
        raise InputError(
            f"--size = {size_text(size)}: must be {size_text(least)} at least, most of it Bokeh's library"
        )
    left = size - overhead
    # where frequencies follow from one another a cell takes next to nothing; if they do not, again
    # with less
    cells = left // 2
    while True:
        excerpt = read_excerpt(path, cells)
        arrays = cell_arrays(excerpt)
        taken = sum(len(array["data"]) for array in arrays.values())
        if taken <= _CELLS_SHARE * left:
            break
        cells = int(math.prod(excerpt.sizes.values()) * 0.95 * _CELLS_SHARE * left / taken)
    # base64 makes four bytes of three
    histories = compute_histories(excerpt, min(left - taken, _HISTORIES_BYTES) * 3 // 4)
    if histories is not None:
        arrays["histories"] = packed(histories.values.astype("<i2"))
        arrays["history_scale"] = packed(histories.scale.astype("<f4"))
    name = path.name.encode(
        errors="backslashreplace"
    ).decode()  # it may have bytes that are no UTF-8
    attrs = excerpt.table.attrs
    files = PackageLoader("slipsweep", "explore")
    environment = Environment(loader=files, autoescape=True)
    environment.policies["json.dumps_kwargs"] = {
        "sort_keys": False,
        "allow_nan": False,
    }  # Bokeh's have an order
    script = files.get_source(environment, "page.js")[0]
    text = environment.get_template("page.html").render(
        title=attrs.get("title", name),
        file=name,
        caption=caption(excerpt.table).split("\n"),
        source=f"{attrs.get('source', 'slipsweep')}; {attrs.get('references', '')}",
        notes=_notes(excerpt, histories),
        thinned=_thinned(excerpt),
        meta=_contents(excerpt, arrays, histories),
        bokeh=Markup(bokeh),
        script=Markup(script),
        allowed=Markup(" ".join(map(_digest, (bokeh, script)))),
    )
    with outputs.complete_or_absent(output, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return excerpt


def _digest(script: str) -> str:
    """Digest by which a content security policy knows an inline script."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _bokeh_script() -> str:
    """Bokeh's library."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)


def _contents(
    excerpt: Excerpt, arrays: Mapping[str, Array], histories: Histories | None
) -> dict[str, Any]:
    """What `page.js` shows, and what it needs to know of it."""
    table = excerpt.table
    return {
        "dims": [
            _dimension(dim)
            | {"values": axis_numbers(excerpt.table, dim).tolist(), "log": excerpt.is_log(dim)}
            | {"labels": excerpt.labels.get(dim, [])}
            for dim in excerpt.sizes
        ],
        "coords": {
            key: _dimension(str(key))
            for key, coord in table.coords.items()
            if key not in coord.dims
        },
        "map": {"y": excerpt.map_dims[0], "x": excerpt.map_dims[1]},
        "layers": [
            {"name": name, "title": table[name].attrs["long_name"]}
            | {"short": LAYERS.get(name), "scale": scale_of(name)}
            for name in (
                *excerpt.layers,
                *(["valueless_share"] if "valueless_share" in table else []),
            )
        ],
        "arrays": arrays,
        "figures": figures(excerpt),
        "modes": {int(mode): mode.name.lower() for mode in known.SlidingMode},
        "flags": [
            {
                "mask": int(flag),
                "name": (flag.name or "").lower(),
                "kind": str(kind),
                "text": flag.text,
            }
            for kind in known.FlagKind
            for flag in known.flags_of(kind)
        ],
        "kinds": {str(kind): text for kind, text in known.FLAG_KIND_TEXT.items()},
        "cautions": int(known.flags_of(known.FlagKind.CAUTION)),
        "unsound": int(
            known.flags_of(known.FlagKind.CAUTION) | known.flags_of(known.FlagKind.NO_VALUE)
        ),
        "g": float(table.attrs["g"]),
        "signed": known.has_signed_displacements(table.attrs),
        "histories": histories
        and {
            "keep": {dim: indices.tolist() for dim, indices in histories.keep.items()},
            "phase": histories.phase.tolist(),
            "ground": histories.ground.tolist(),
            "cycles": histories.cycles,
            "of": int(table.attrs["cycles"]),
        },
    }


def _dimension(name: str) -> dict[str, Any]:
    """Names and unit of a dimension or coordinate."""
    return {
        "name": name,
        "title": label(name),
        "symbol": SYMBOLS.get(name, name.replace("_", " ")),
        "unit": unit(name) if name in known.PARAMETERS else "m" if name == "threshold" else "",
        "acceleration": is_acceleration(name),
    }


def _thinned(excerpt: Excerpt) -> list[tuple[str, str]]:
    """Axes of which some values are left out, and those that are kept."""
    found = []
    for dim, length in excerpt.lengths.items():
        if excerpt.sizes[dim] < length:
            values = ", ".join(f"{value:.5g}" for value in axis_numbers(excerpt.table, dim))
            units = f" {unit(dim)}" if dim in known.PARAMETERS else ""
            found.append((f"{dim}: {excerpt.sizes[dim]} of {length} values", values + units))
    return found


def _notes(excerpt: Excerpt, histories: Histories | None) -> list[str]:
    """Sentences on what the page leaves out."""
    shown, whole = (
        math.prod(sizes[dim] for dim in excerpt.lengths)
        for sizes in (excerpt.sizes, excerpt.lengths)
    )
    unsound = str(excerpt.table.attrs.get("unsound", "")).splitlines()
    notes = [f"All {shown:,} cells of the file are in this page."]
    if shown < whole:
        notes = [
            f"Thinned: {shown:,} of the file's {whole:,} cells are in this page. Of each axis evenly spaced values are "
            "kept, with the first and last. Nothing is averaged."
        ]
    low, high = decades(excerpt)
    notes.append(
        "Each cell is drawn half way to its neighbours. Displacements are kept in single precision; those beyond "
        f"{10.0**low:g} and {10.0**high:g} mm have the colours at the ends of the scale."
    )
    if "motion" in excerpt.sizes and "quantile" in excerpt.sizes:
        notes.append(
            "Quantiles and probabilities are those of all motions and polarities that have a value, as "
            "slipsweep.suite_statistics gives them."
        )
    notes += [f"Unsound: {text}." for text in unsound]
    if histories is None:
        notes.append(
            "The page has no time histories. They need harmonic motion without uncertain inputs, and space in the "
            "page. slipsweep simulate computes one for any case."
        )
        return notes
    each = " × ".join(f"{len(indices)} {dim}" for dim, indices in histories.keep.items())
    notes.append(
        f"Time histories: the first {histories.cycles} of {excerpt.table.attrs['cycles']} cycles, {POINTS} points a "
        f"cycle, computed event by event for {each or 'one case'} and kept to 1/32767 of their largest value. "
        "They are scaled to the frequency of the cell (velocity ~ 1/ω, displacement ~ 1/ω²), which is exact."
    )
    return notes
