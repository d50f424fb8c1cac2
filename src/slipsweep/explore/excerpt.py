"""Part of a result that a page shows: evenly spaced values of its axes, few enough for a page."""

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

#: Results that can colour the map, in the order in which they are offered, and in words that fit on
#: a phone.
LAYERS = {
    "permanent_displacement": "displacement",
    "newmark_displacement": "Newmark's displacement",
    "clearance": "clearance",
    "displacement_quantile": "quantile of displacement",
    "mean_displacement": "mean displacement",
    "exceedance_probability": "probability of exceeding",
}

#: Results that a page shows, and the type of their numbers in the page.
RESULT_TYPES = dict.fromkeys((*LAYERS, "valueless_share"), "<f4") | {
    "sliding_mode": "<i1",
    "validity": "<i2",
}

#: Dimensions of which statistics are made, or along which they lie: all their values are kept.
_UNTHINNED = ("polarity", "motion", "quantile", "threshold")

#: Largest magnitude of a coordinate: products of a few of them are still numbers.
_LARGEST_COORDINATE = 1e75

#: Strengths of the shaking, of which the first that is an axis goes up the map.
_UP_THE_MAP = ("amplitude", "displacement_amplitude", *STRENGTHS[1:])

#: Values along an axis of the map that count as one of another axis: it needs more than a slider.
_MAP_WEIGHT = 4


def thinned_lengths(
    lengths: Mapping[str, int],
    cells: int,
    map_dims: Sequence[str] = (),
    unthinned: Collection[str] = (),
) -> dict[str, int]:
    """Cut the axes of a grid down to a number of cells, the longest first; return their lengths.

    Four values of a dimension of the map count as one of another.  It keeps two values, others keep
    one, and those in `unthinned` all.
    """
    thinned = dict(lengths)
    least = {}
    for dim, length in lengths.items():
        least[dim] = length if dim in unthinned else min(length, 2 if dim in map_dims else 1)
    while math.prod(thinned.values()) > cells:
        weighted = {
            dim: length / (_MAP_WEIGHT if dim in map_dims else 1)
            for dim, length in thinned.items()
            if length > least[dim]
        }
        if not weighted:
            break
        longest = max(weighted, key=lambda dim: weighted[dim])
        # a twentieth at a time: axes shrink together, and long ones in few steps
        step = max(1, thinned[longest] // 20)
        thinned[longest] = max(least[longest], thinned[longest] - step)
    return thinned


def evenly_spaced(length: int, count: int) -> NDArray[np.intp]:
    """Return `count` of the indices below `length`, as evenly as possible, with first and last."""
    return np.unique(np.linspace(0, length - 1, count).round().astype(np.intp))


@dataclass(frozen=True)
class Excerpt:
    """Part of a result that a page shows.

    `table` has the coordinates, which increase along each dimension, and results of `RESULT_TYPES`;
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
        """Results that the map can show."""
        return [name for name in LAYERS if name in self.table]

    def is_log(self, dim: str) -> bool:
        """Return True for a frequency, and for axes whose values have constant ratios."""
        values = axis_numbers(self.table, dim)
        return (dim == "frequency" and values.size > 1) or is_log(values)


def read_excerpt(path: Path, cells: int) -> Excerpt:
    """Read a result, or an evenly spaced part of it that has at most `cells` cells, in chunks.

    InputError: the file cannot be read, or holds no displacement over two parameters.
    """
    result = Result(open_result(path), path).data  # checked, in increasing order
    result = result.sortby([dim for dim in ("polarity",) if dim in result.dims])
    names = [name for name in RESULT_TYPES if name in result.data_vars]
    layers = [name for name in names if name in LAYERS]
    if not layers:
        raise InputError(
            f"{path}: holds no permanent_displacement to draw; "
            "add it to output.variables and run the sweep again"
        )
    lengths = {str(dim): size for name in layers for dim, size in result[name].sizes.items()}
    map_dims = _map_dims(path, lengths)
    sizes = thinned_lengths(lengths, cells, map_dims, _UNTHINNED)
    if math.prod(sizes.values()) > cells:
        raise InputError(
            f"{path}: a grid of {len(lengths)} dimensions does not fit into a page of this size"
        )
    indices = {dim: evenly_spaced(length, sizes[dim]) for dim, length in lengths.items()}
    part = result[names].isel(indices).transpose(*lengths, ...).load(scheduler="single-threaded")
    part = with_amplitude(part)
    _check_results(path, part, names, lengths)
    table = _table(path, part, names)
    if "motion" in sizes and {"permanent_displacement", "validity"} <= {*names}:
        table = _with_statistics(table)
        sizes |= {dim: table.sizes[dim] for dim in ("quantile", "threshold")}
    labels = {dim: axis_labels(part, dim) for dim in lengths if dim not in PARAMETERS}
    labels = {dim: texts for dim, texts in labels.items() if texts}
    return Excerpt(table, map_dims, lengths, sizes, labels)


def _check_results(
    path: Path, part: xr.Dataset, names: Sequence[str], dims: Collection[str]
) -> None:
    """Raise InputError if a result lies along other dimensions, or cells have no flags."""
    for name in names:
        others = [dim for dim in part[name].dims if dim not in dims]
        if others:
            raise InputError(
                f"{path}: {name}: lies along {others[0]}, along which no displacement does"
            )
    if "validity" in names and part["validity"].isnull().any():
        raise InputError(f"{path}: validity: {UNFLAGGED_TEXT}")


def _table(path: Path, part: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Results with the types and long names of the page, and the parameters."""
    results = {}
    for name in names:
        attrs = dict((STATISTICS | RESULTS)[name])
        if name in SIGNED and has_signed_displacements(part.attrs):
            attrs["long_name"] += "; colours show its magnitude"
        results[name] = part[name].astype(RESULT_TYPES[name]).assign_attrs(attrs).variable
    return xr.Dataset(results, _coordinates(path, part), part.attrs)


def _with_statistics(table: xr.Dataset) -> xr.Dataset:
    """Add the statistics over the motions of a suite."""
    statistics = suite_statistics(table)
    dims = {dim: statistics[dim].variable for dim in ("quantile", "threshold")}
    table = table.assign_coords(dims)
    for name, number_type in RESULT_TYPES.items():
        if name not in statistics.data_vars:
            continue
        long_name = str(statistics[name].attrs["long_name"])
        if "motions" not in long_name:
            long_name += ", over all motions"
        values = statistics[name].astype(number_type)
        table[name] = values.assign_attrs(long_name=long_name).variable
    return table


def _map_dims(path: Path, lengths: Mapping[str, int]) -> tuple[str, str]:
    """Dimensions up and across the map: strength over frequency, or else the longest ones."""
    axes = [
        dim
        for dim, length in lengths.items()
        if length > 1 and dim in PARAMETERS and dim != "polarity"
    ]
    axes.sort(key=lambda dim: -lengths[dim])
    axes += [dim for dim in ("motion",) if lengths.get(dim, 1) > 1]
    if len(axes) < 2:
        dims = ", ".join(f"{dim} ({length})" for dim, length in lengths.items()) or "none"
        raise InputError(
            f"{path}: no map to draw: explore needs two parameters as axes with two values or "
            f"more; the dimensions are: {dims}"
        )
    up = next(dim for dim in (*_UP_THE_MAP, *axes) if dim in axes and dim != "frequency")
    across = next(dim for dim in ("frequency", *axes) if dim in axes and dim != up)
    return up, across


def _coordinates(path: Path, part: xr.Dataset) -> dict[str, Any]:
    """Parameters along the dimensions of a page.  InputError: they are no numbers to draw."""
    coords: dict[str, Any] = {}
    for name, attrs in (PARAMETERS | STATISTIC_COORDINATES).items():
        if name not in part.coords or part[name].dtype.kind not in "iuf":
            continue
        values = part[name].values.astype(np.float64)
        if not (np.abs(values) < _LARGEST_COORDINATE).all():
            raise InputError(f"{path}: {name}: values are missing, or too large to draw")
        coords[name] = (part[name].dims, values, attrs)
    return coords
