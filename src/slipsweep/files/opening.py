"""Results opened as datasets, also if other programs have changed them; their contents in words."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError, check_extra
from slipsweep.files.motions import RECORD_DIM, SUITE_DIM
from slipsweep.files.outputs import NO_LOCKS
from slipsweep.files.selection import units_text
from slipsweep.grid.chunks import CHUNK_CELLS, chunk_lengths, grid_chunks
from slipsweep.locks import has_locks
from slipsweep.model import variables

#: Results that commands of slipsweep write, but for the samples of records.
_RESULTS = {
    **variables.RECORD_RESULTS,
    **variables.LIMIT_RESULTS,
    **variables.HISTORY,
    **variables.STATISTICS,
    **variables.RESULTS,
}

#: Columns of the table of motions: the heading of each coordinate.
_MOTION_COLUMNS = {
    "motion_samples": "samples",
    "motion_interval": "interval (s)",
    "motion_pga": "PGA (m/s2)",
    "motion_pgv": "PGV (m/s)",
    "motion_pgd": "PGD (m)",
    "motion_arias_intensity": "Arias (m/s)",
    "motion_cav": "CAV (m/s)",
    "motion_significant_duration": "D5-95 (s)",
    "motion_mean_period": "Tm (s)",
}


def place_of(text: str | os.PathLike[str]) -> Path | str:
    """Return the place of a result: a path, or the address of a store for fsspec (``s3://…``)."""
    return os.fspath(text) if "://" in os.fspath(text) else Path(text)


def open_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a result of any size lazily: nothing is read before it is asked for.

    Parameters
    ----------
    path : str or path-like
        A netCDF file or a Zarr store, or the address of a store (``s3://…``).

    Returns
    -------
    xarray.Dataset
        As `sweep` returns it: modes and counts are whole numbers, -1 where there is no value.  Its
        variables are dask arrays; those of a store in the chunks that they were written in.  Where
        another program has left cells without flags (a join, a mask), `validity` is a number, NaN
        there.

    Raises
    ------
    InputError
        There is no result, it cannot be read, or it was not written by slipsweep.

    See Also
    --------
    sweep : returns results of grids that memory holds

    Examples
    --------
    >>> import slipsweep
    >>> computed = slipsweep.sweep(theta=5, mu_s=0.4, amplitude=[4.0, 6.0], frequency=2.0)
    >>> computed.to_netcdf("first.nc")
    >>> result = slipsweep.open_result("first.nc")
    >>> print(f"{result.permanent_displacement.max().compute().item():.3f} m")
    0.445 m
    """
    table = read_result(path)
    stored = {
        dim: length
        for result in table.values()
        for dim, length in (result.encoding.get("preferred_chunks") or {}).items()
    }
    widest: Any = max((result.sizes for result in table.data_vars.values()), key=len, default={})
    return table.chunk(
        stored or (chunk_lengths(widest, CHUNK_CELLS) if 0 not in widest.values() else {})
    )


def read_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a result without dask; values are read when used (InputError: see `open_result`)."""
    table = _open(path)
    if (
        not str(table.attrs.get("source", "")).startswith("slipsweep ")
        and "sweep" not in table.attrs
    ):
        raise InputError(f"{path}: not written by slipsweep, or its global attributes are lost")
    for name, stored in dict(table.variables).items():
        # these say how values are stored, not what they mean
        fills = [table[name].attrs.pop(key, None) for key in ("_FillValue", "missing_value")]
        if stored.dtype.kind in "UST":
            table[name] = table[name].astype(object)
        dtype = np.dtype(variables.RESULT_DTYPES.get(str(name), "f8"))
        if dtype.kind == "i":
            missing = [fill for fill in fills if fill is not None]
            table[name] = _as_codes(table[name], dtype, missing)
            # with this dtype xarray would write NaN, which joins leave, as 0
            table[name].encoding.pop("dtype", None)
    return table


def _as_codes(codes: xr.DataArray, dtype: np.dtype[Any], fills: list[float]) -> xr.DataArray:
    """Return codes as whole numbers; another program may have made floating-point numbers of them.

    A missing code is -1.  Flags have no such code: if some are missing, they stay floating-point
    numbers, NaN where they are missing.  A 0 would mean that no flag is raised.
    """
    for fill in fills:
        if fill != -1:
            codes = codes.where(codes != fill)
    if codes.dtype == dtype:
        return codes
    if codes.name != "validity":
        codes = codes.fillna(-1)
    elif _are_missing(codes):
        return codes
    return codes.astype(dtype)


def _are_missing(values: xr.DataArray) -> bool:
    """Return True if any value is NaN, read in chunks."""
    sizes = {str(dim): size for dim, size in values.sizes.items()}
    return any(bool(values[part].isnull().any()) for part in grid_chunks(sizes, CHUNK_CELLS))


def _open(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a netCDF file or a Zarr store; all values are decoded but codes."""
    # a decoded fill value would make codes floating-point numbers
    codes = {
        name: False
        for name, dtype in variables.RESULT_DTYPES.items()
        if np.dtype(dtype).kind == "i"
    }
    how: dict[str, Any] = {"mask_and_scale": codes, "decode_times": False}
    place = place_of(path)
    if isinstance(place, str) or (place / "zarr.json").is_file():
        check_zarr(path)
        try:
            table = xr.open_dataset(os.fspath(path), engine="zarr", consolidated=False, **how)
        except Exception as error:  # whatever the storage behind the address may raise
            raise InputError(
                f"{path}: cannot be read as a Zarr store: {_first_line(error)}"
            ) from None
        if "unfinished" in table.attrs:
            raise InputError(f"{path}: is not finished; run its sweep again with --resume")
        # a store has no order of its variables: they get slipsweep's
        order = dict.fromkeys(
            (*variables.PARAMETERS, *variables.MOTION_COORDINATES, *_RESULTS, *table.variables)
        )
        return table[[name for name in order if name in table.variables]]
    parts = place if place.suffix == ".part" else place.with_name(f"{place.name}.part")
    if (parts / "identity.json").is_file() and (parts == place or not place.exists()):
        chunks = sum(1 for chunk in parts.glob("*.chunk"))
        raise InputError(
            f"{path}: is not finished: {chunks} of its chunks are in {parts}; "
            "run its sweep again with --resume"
        )
    if not place.exists():
        raise InputError(f"{path}: no such file")
    if not place.is_file():
        raise InputError(f"{path}: is neither a netCDF file nor a Zarr store of format 3")
    try:
        return xr.open_dataset(place, engine="netcdf4", **how)
    except Exception as error:  # netCDF4 and xarray raise many types on a damaged file
        if not has_locks(place):
            raise InputError(f"{path}: cannot be read: {NO_LOCKS}") from None
        if isinstance(error, PermissionError):
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        made = "; of a sweep file slipsweep run makes one" if place.suffix == ".toml" else ""
        raise InputError(
            f"{path}: not a netCDF file, or a damaged one ({_first_line(error)}){made}"
        ) from None


def check_zarr(path: object) -> None:
    """Raise InputError if the packages that read and write Zarr stores are missing."""
    check_extra(f"{path}: a Zarr store", "zarr", "zarr", "fsspec")


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


def result_names(table: xr.Dataset) -> list[str]:
    """Return the names of the results of a file, also of those that another program added.

    These lie along the same dimensions as slipsweep's own.  The samples of a record do not, nor do
    bounds of cells.
    """
    names = [str(name) for name in table.data_vars]
    dims = {
        dim
        for name in [name for name in names if name in _RESULTS] or names
        for dim in table[name].dims
    }
    dims -= {RECORD_DIM, SUITE_DIM}
    return [name for name in names if dims.issuperset(table[name].dims)]


def coordinate_texts(table: xr.Dataset) -> dict[str, str]:
    """Return the coordinates in words, but for those in the table of motions."""
    suite = bool(motions_text(table))
    return {
        str(name): f"{coordinate.size} motions"
        if suite and name == "motion"
        else values_text(coordinate)
        for name, coordinate in table.coords.items()
        if not (suite and name in variables.MOTION_COORDINATES and coordinate.dims == ("motion",))
    }


def values_text(values: xr.DataArray) -> str:
    """Return the values of a coordinate in words."""
    if values.dtype.kind in "OUST":
        return ", ".join(map(str, values.values.ravel()))
    numbers = values.values[np.isfinite(values.values)]
    units = units_text(values)
    if values.size == 1 == numbers.size:
        return f"{numbers.min():.6g}{units}"
    ends = f", {numbers.min():.6g} to {numbers.max():.6g}{units}" if numbers.size else ""
    missing = f", {values.size - numbers.size} missing" if numbers.size < values.size else ""
    return f"{values.size} values{ends}{missing}"


def variable_texts(table: xr.Dataset) -> dict[str, str]:
    """Return the variables in words."""
    return {
        str(name): f"{variable.attrs.get('long_name', '')}{units_text(variable, ', ')} "
        f"({'text' if variable.dtype.kind in 'OUST' else variable.dtype})".lstrip(", ")
        for name, variable in table.data_vars.items()
        if variable.dims != (SUITE_DIM,)
    }


def motions_text(table: xr.Dataset) -> tuple[str, ...]:
    """Return the motions of a suite as lines of a table, a header first; without a suite none."""
    if (
        "motion" not in table.coords
        or table["motion"].dims != ("motion",)
        or table["motion"].dtype.kind not in "OUST"
    ):
        return ()
    names = [
        name for name in _MOTION_COLUMNS if name in table.coords and table[name].dims == ("motion",)
    ]
    rows = (
        table[names]
        .to_dataframe()[names]
        .rename(columns=_MOTION_COLUMNS)
        .rename_axis(columns="motion", index=None)
    )
    return tuple(rows.to_string(float_format="{:.4g}".format, na_rep="").splitlines())
