"""What a page shows of a result: an evenly spaced part of it, small enough for a page."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.charts.sheet import is_log
from slipsweep.charts.slices import Result
from slipsweep.errors import InputError
from slipsweep.files.opening import open_result
from slipsweep.files.selection import axis_labels, axis_numbers
from slipsweep.model.variables import (
    PARAMETERS,
    RESULTS,
    SIGNED,
    STATISTIC_COORDINATES,
    STATISTICS,
    STRENGTHS,
    UNFLAGGED_TEXT,
    has_signed_displacements,
)
from slipsweep.studies.solved_again import with_amplitude
from slipsweep.studies.suite_statistics import suite_statistics

#: What can be chosen for the map, in the order in which it is offered, and in words that fit on a
#: phone.
LAYERS = {
    "permanent_displacement": "displacement",
    "newmark_displacement": "Newmark's displacement",
    "clearance": "clearance",
    "displacement_quantile": "quantile of displacement",
    "mean_displacement": "mean displacement",
    "exceedance_probability": "probability of exceeding",
}

#: What a page shows of a cell, and its type in the page.
SHOWN = dict.fromkeys((*LAYERS, "valueless_share"), "<f4") | {
    "sliding_mode": "<i1",
    "validity": "<i2",
}

#: Dimensions of which statistics are made, or which are statistics themselves: none of their values
#: is left out.
_WHOLE = ("polarity", "motion", "quantile", "threshold")

#: Largest magnitude of a coordinate: products of a few of them are still numbers.
_MOST = 1e75

_VERTICAL = ("amplitude", "displacement_amplitude", *STRENGTHS[1:])


def thinned_lengths(
    lengths: Mapping[str, int],
    cells: int,
    map_dims: Sequence[str] = (),
    whole: Collection[str] = (),
) -> dict[str, int]:
    """Lengths of the axes of a grid cut down to a number of cells, the longest cut first.

    Four values of a dimension of the map count as one of another, since a map needs more of them
    than a slider; it keeps two values.  Dimensions in `whole` are not cut.
    """
    left = dict(lengths)
    least = {
        dim: n if dim in whole else min(n, 2) if dim in map_dims else 1
        for dim, n in lengths.items()
    }
    while math.prod(left.values()) > cells:
        spare = {
            dim: n / (4 if dim in map_dims else 1) for dim, n in left.items() if n > least[dim]
        }
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

    `table` has the coordinates, which increase along each dimension, and the results in `SHOWN`;
    `map_dims` are the dimensions up and across the map; `lengths` are those of the file, `sizes`
    those of the page; `labels` are names along dimensions that have no numbers: cases and motions.
    """

    table: xr.Dataset
    map_dims: tuple[str, str]
    lengths: dict[str, int]
    sizes: dict[str, int]
    labels: dict[str, list[str]]

    @property
    def layers(self) -> list[str]:
        """The results that the map can show."""
        return [name for name in LAYERS if name in self.table]

    def is_log(self, dim: str) -> bool:
        """Return True if an axis is drawn by factors: the frequency, and others that are spread so."""
        values = axis_numbers(self.table, dim)
        return (dim == "frequency" and values.size > 1) or is_log(values)


def read_excerpt(path: Path, cells: int) -> Excerpt:
    """Read a result, or an evenly spaced part of it that has at most `cells` cells, in chunks.

    InputError: the file cannot be read, or holds no displacement over two parameters.
    """
    result = Result(open_result(path), path).data  # checked, in increasing order
    result = result.sortby([dim for dim in ("polarity",) if dim in result.dims])
    names = [name for name in SHOWN if name in result.data_vars]
    layers = [name for name in names if name in LAYERS]
    if not layers:
        raise InputError(
            f"{path}: holds no permanent_displacement to draw; add it to output.variables and run the sweep again"
        )
    lengths = {str(dim): size for name in layers for dim, size in result[name].sizes.items()}
    map_dims = _map_dims(path, lengths)
    left = thinned_lengths(lengths, cells, map_dims, _WHOLE)
    if math.prod(left.values()) > cells:
        raise InputError(
            f"{path}: a grid of {len(lengths)} dimensions does not fit into a page of this size"
        )
    keep = {dim: evenly(length, left[dim]) for dim, length in lengths.items()}
    table = with_amplitude(
        result[names].isel(keep).transpose(*lengths, ...).load(scheduler="single-threaded")
    )
    for name in names:
        beyond = [dim for dim in table[name].dims if dim not in lengths]
        if beyond:
            raise InputError(
                f"{path}: {name}: lies along {beyond[0]}, along which no displacement does"
            )
        if name == "validity" and table[name].isnull().any():
            raise InputError(f"{path}: validity: {UNFLAGGED_TEXT}")
        described = dict((STATISTICS | RESULTS)[name])
        if name in SIGNED and has_signed_displacements(result.attrs):
            described["long_name"] += "; colours show its magnitude"
        table[name] = table[name].astype(SHOWN[name]).assign_attrs(described)
    labels = {dim: axis_labels(table, dim) for dim in lengths if dim not in PARAMETERS}
    table = xr.Dataset(
        {name: table[name].variable for name in names}, _coordinates(path, table), result.attrs
    )
    if "motion" in left and {"permanent_displacement", "validity"} <= {*names}:
        table = _with_statistics(table)
        left |= {dim: table.sizes[dim] for dim in ("quantile", "threshold")}
    return Excerpt(
        table, map_dims, lengths, left, {dim: texts for dim, texts in labels.items() if texts}
    )


def _with_statistics(table: xr.Dataset) -> xr.Dataset:
    """Add the statistics over the motions of a suite."""
    found = suite_statistics(table)
    table = table.assign_coords({dim: found[dim].variable for dim in ("quantile", "threshold")})
    for name in [one for one in SHOWN if one in found.data_vars]:
        text = str(found[name].attrs["long_name"])
        text = text if "motions" in text else f"{text}, over all motions"
        table[name] = found[name].astype(SHOWN[name]).assign_attrs(long_name=text).variable
    return table


def _map_dims(path: Path, lengths: Mapping[str, int]) -> tuple[str, str]:
    """The dimensions up and across the map: the strength of the shaking over its frequency, or what there is."""
    axes = [
        dim
        for dim, length in lengths.items()
        if length > 1 and dim in PARAMETERS and dim != "polarity"
    ]
    axes.sort(key=lambda dim: -lengths[dim])
    axes += [dim for dim in ("motion",) if lengths.get(dim, 1) > 1]
    if len(axes) < 2:
        held = ", ".join(f"{dim} ({length})" for dim, length in lengths.items()) or "none"
        raise InputError(
            f"{path}: no map to draw: explore needs two parameters as axes with two values or more; "
            f"the dimensions are: {held}"
        )
    up = next(dim for dim in (*_VERTICAL, *axes) if dim in axes and dim != "frequency")
    across = next(dim for dim in ("frequency", *axes) if dim in axes and dim != up)
    return up, across


def _coordinates(path: Path, table: xr.Dataset) -> dict[str, Any]:
    """The parameters along the dimensions of a page."""
    coords: dict[str, Any] = {
        name: (table[name].dims, table[name].values.astype(np.float64), about)
        for name, about in (PARAMETERS | STATISTIC_COORDINATES).items()
        if name in table.coords and table[name].dtype.kind in "iuf"
    }
    for name, (_, values, _) in coords.items():
        if not (np.abs(values) < _MOST).all():
            raise InputError(f"{path}: {name}: values are missing, or too large to draw")
    return coords
