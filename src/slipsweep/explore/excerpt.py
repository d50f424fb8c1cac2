"""What a page shows of a result: an evenly spaced part of it, small enough for a page."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.charts.slices import check_attributes
from slipsweep.errors import InputError
from slipsweep.files.results import FileVariable, ResultFile, result_file
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.model.variables import PARAMETERS, RESULTS, STATISTIC_COORDINATES, STATISTICS, STRENGTHS
from slipsweep.motion.amplitude import peak_acceleration
from slipsweep.studies.suite_statistics import suite_statistics

#: Codes of cells, and what stands for a missing one.
CODES = {"sliding_mode": -1, "validity": 0}

#: Largest number that is drawn: products of a few of them are still numbers.
_MOST = 1e75

#: What can be chosen for the map, in the order in which it is offered, and in words that fit on a phone.
LAYERS = {
    "permanent_displacement": "displacement",
    "displacement_quantile": "quantile of displacement",
    "mean_displacement": "mean displacement",
    "exceedance_probability": "probability of exceeding",
}

#: What a page shows of a cell, and its type in the page.
SHOWN = dict.fromkeys((*LAYERS, "valueless_share"), "<f4") | {"sliding_mode": "<i1", "validity": "<i2"}

#: Over the motions of a suite: median with its band of a standard deviation, and the thresholds of `suite_statistics`.
_QUANTILES, _THRESHOLDS = (0.16, 0.5, 0.84), (0.01, 0.1, 1.0)

#: Dimensions of which statistics are made, or which are statistics themselves: none of their values is left out.
_WHOLE = ("polarity", "motion", "quantile", "threshold")

_ABOUT = STATISTICS | RESULTS

_VERTICAL = ("amplitude", "displacement_amplitude", *STRENGTHS[1:])

Indices = dict[str, NDArray[np.intp]]


def thinned_lengths(
    lengths: Mapping[str, int], cells: int, map_dims: Sequence[str] = (), whole: Collection[str] = ()
) -> dict[str, int]:
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
    whole : collection of str
        Dimensions that are not cut.

    Returns
    -------
    dict of str to int
        The lengths, the longest cut first; a dimension of the map keeps two values.
    """
    left = dict(lengths)
    least = {dim: n if dim in whole else min(n, 2) if dim in map_dims else 1 for dim, n in lengths.items()}
    while math.prod(left.values()) > cells:
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
    table : xr.Dataset
        Coordinates (increasing along each dimension) and the results in `SHOWN`.
    map_dims : tuple of str
        Dimensions up and across the map.
    lengths : dict of str to int
        Lengths of the dimensions in the file.
    sizes : dict of str to int
        Lengths of all dimensions of the page.
    labels : dict of str to list of str
        Names along dimensions that have no numbers: cases and motions.
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

    def values(self, dim: str) -> NDArray[np.float64]:
        """The values along a dimension; one without a coordinate, such as `case`, counts from 1."""
        return self.table[dim].values if dim in self.table.coords else np.arange(1.0, 1.0 + self.sizes[dim])

    def is_log(self, dim: str) -> bool:
        """Whether an axis is drawn by factors: the frequency, and others that are spread so."""
        values = self.values(dim)
        if values.size < 2 or values[0] <= 0.0 or dim in self.labels:
            return False
        if dim == "frequency":
            return True
        if values.size < 3 or values[-1] < 3.0 * values[0]:
            return False
        steps, factors = np.diff(values), np.diff(np.log(values))
        return bool(np.std(factors) / np.mean(factors) < np.std(steps) / np.mean(steps))


def read_excerpt(path: Path, cells: int) -> Excerpt:
    """Read a result, or an evenly spaced part of it that has at most `cells` cells.

    Memory stays small whatever the size of the file.

    Raises
    ------
    InputError
        The file cannot be read, or holds no displacement over two parameters.
    """
    with result_file(path) as file:
        names = [name for name in SHOWN if name in file.results]
        layers = [name for name in names if name in LAYERS]
        if not layers:
            raise InputError(
                f"{path}: holds no permanent_displacement to draw; add it to output.variables and run the sweep again"
            )
        lengths = {dim: size for name in layers for dim, size in file[name].sizes.items()}
        if 0 in lengths.values():
            raise InputError(f"{path}: holds no cells")
        map_dims = _map_dims(path, lengths)
        check_attributes(file.attrs, str(path))
        left = thinned_lengths(lengths, cells, map_dims, _WHOLE)
        if math.prod(left.values()) > cells:
            raise InputError(f"{path}: a grid of {len(lengths)} dimensions does not fit into a page of this size")
        keep = {dim: file.axis(dim)[1][evenly(length, left[dim])] for dim, length in lengths.items()}
        coords = _coordinates(file, keep)
        results = {name: _read(file[name], keep, SHOWN[name]) for name in names}
        labels = {dim: file.labels if dim == "case" else file.texts(dim) for dim in lengths if dim not in coords}
        labels = {dim: [texts[at] for at in keep[dim]] for dim, texts in labels.items() if texts}
        table = xr.Dataset(results, coords, file.attrs)
    if "motion" in left and {"permanent_displacement", "validity"} <= results.keys():
        table = _with_statistics(table)
        left |= {dim: table[dim].values.size for dim in ("quantile", "threshold")}
    return Excerpt(table, map_dims, lengths, left, labels)


def _with_statistics(table: xr.Dataset) -> xr.Dataset:
    """Add the statistics over the motions of a suite."""
    found = suite_statistics(table, thresholds=_THRESHOLDS, quantiles=_QUANTILES)
    results = {
        name: xr.Variable(found[name].dims, found[name].values.astype(kind), _over_motions(found[name].attrs))
        for name, kind in SHOWN.items()
        if name in found.data_vars
    }
    return table.assign(results).assign_coords({dim: found[dim] for dim in ("quantile", "threshold")})


def _over_motions(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes that name what a statistic is of."""
    text = str(attrs["long_name"])
    return {**attrs, "long_name": text if "motions" in text else f"{text}, over all motions"}


def amplitude_of(displacement_amplitude: xr.Variable, frequency: xr.Variable) -> xr.Variable:
    """The amplitude A = ω²d: files do not hold it where d and the frequency span a grid."""
    return xr.apply_ufunc(peak_acceleration, displacement_amplitude, frequency)


def check_drawable(path: Path, name: str, values: NDArray[Any], most: float = _MOST) -> None:
    """Refuse numbers that no drawing library can place (InputError)."""
    beyond = values[np.abs(values) > np.float64(most)]  # np.float64: single precision would make it infinite
    if beyond.size:
        raise InputError(f"{path}: {name}: holds {beyond.flat[0]:.4g}; what is drawn must be within +-{most:g}")


def _map_dims(path: Path, lengths: Mapping[str, int]) -> tuple[str, str]:
    """The dimensions up and across the map: the strength of the shaking over its frequency, or what there is."""
    axes = [dim for dim, length in lengths.items() if length > 1 and dim in PARAMETERS and dim != "polarity"]
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


def _coordinates(file: ResultFile, keep: Indices) -> dict[str, xr.Variable]:
    """The parameters along the dimensions of a page."""
    coords = {
        name: xr.Variable(file[name].dims, file[name].read_floats(keep).astype(np.float64), about)
        for name, about in (PARAMETERS | STATISTIC_COORDINATES).items()
        if name in file.coordinates and not file[name].is_text and keep.keys() >= {*file[name].dims}
    }
    if {"displacement_amplitude", "frequency"} <= coords.keys() and "amplitude" not in coords:
        coords["amplitude"] = amplitude_of(coords["displacement_amplitude"], coords["frequency"])
    if "waveform" in file.attrs and not any(name in STATISTICS for name in file.results):
        interface = () if "yield_coefficient" in coords else ("theta", "mu_s")
        for name in (*interface, "amplitude", "frequency"):
            if name not in coords:
                raise InputError(f"{file.path}: {name}: not in the file, but the page needs it")
    for name, coord in coords.items():
        check_drawable(file.path, name, coord.values)
        if np.isnan(coord.values).any():
            raise InputError(f"{file.path}: {name}: values are missing")
    return coords


def _read(variable: FileVariable, keep: Indices, kind: str) -> xr.Variable:
    """Read a result at some places along each dimension, in the order of `keep`."""
    beyond = [dim for dim in variable.dims if dim not in keep]
    if beyond:
        raise InputError(f"{variable.path}: {variable.name}: lies along {beyond[0]}, along which no displacement does")
    dims = tuple(dim for dim in keep if dim in variable.dims)
    values = np.empty([keep[dim].size for dim in dims], kind)
    for chunk in grid_chunks({dim: variable.sizes[dim] for dim in dims}, CHUNK_CELLS):
        inside = {
            dim: np.flatnonzero((keep[dim] >= part.start) & (keep[dim] < part.stop)) for dim, part in chunk.items()
        }
        if not all(map(len, inside.values())):
            continue
        source = np.ix_(*(keep[dim][at] - chunk[dim].start for dim, at in inside.items()))
        values[np.ix_(*inside.values())] = _read_chunk(variable, chunk)[source]
    return xr.Variable(dims, values, _ABOUT[variable.name])


def _read_chunk(variable: FileVariable, chunk: Mapping[str, slice]) -> NDArray[Any]:
    """Read the part of a chunk along the chunk's dimensions, in their order."""
    if variable.name in CODES:
        values = variable.read_codes(chunk, CODES[variable.name])
    else:
        values = variable.read_floats(chunk)
        check_drawable(variable.path, variable.name, values, float(np.finfo(np.float32).max))
    return values.transpose([variable.dims.index(dim) for dim in chunk])
