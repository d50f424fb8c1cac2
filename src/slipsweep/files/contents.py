"""What a result holds, in words and counts: for `slipsweep info`, and the sheet "about" of a table."""

from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.files.motions import RECORD_DIM, SUITE_DIM
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.grid.tally import Indices, Tally
from slipsweep.model.variables import (
    HISTORY,
    LIMIT_RESULTS,
    MOTION_COORDINATES,
    RECORD_RESULTS,
    RESULTS,
    STATISTICS,
)

#: All that a command of slipsweep writes, but for the samples of records.
_RESULTS = {**RECORD_RESULTS, **LIMIT_RESULTS, **HISTORY, **STATISTICS, **RESULTS}

#: Columns of the table of motions: what stands above, by its coordinate.
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


def result_names(table: xr.Dataset) -> list[str]:
    """Names of the results of a file: slipsweep's own, and those that lie along the same dimensions.

    The samples of a record do not, nor do bounds of cells that another program added.
    """
    names = [str(name) for name in table.data_vars]
    dims = {dim for name in [one for one in names if one in _RESULTS] or names for dim in table[name].dims}
    dims -= {RECORD_DIM, SUITE_DIM}
    return [name for name in names if dims.issuperset(table[name].dims)]


def tally_in(table: xr.Dataset) -> Tally:
    """Count modes, flags and ratios of a result, read in chunks (InputError: not of the same cells)."""
    names = [name for name in ("sliding_mode", "validity") if name in table.data_vars]
    if len({table[name].size for name in names}) > 1:
        raise InputError("sliding_mode and validity are not of the same cells")
    tally = Tally(max((table[name].size for name in names), default=0))
    moved = ("permanent_displacement", "newmark_displacement")
    if all(one in table.data_vars for one in moved) and table[moved[0]].sizes == table[moved[1]].sizes:
        names += moved
    widest: Any = max((table[name].sizes for name in names), key=len, default={})
    for chunk in grid_chunks(widest, CHUNK_CELLS) if names else ():
        tally.merge(Tally.of({name: table[name].isel(chunk, missing_dims="ignore").values for name in names}))
    if {"sensitivity_status", "first_order_index", "total_index"} <= {*table.data_vars} and "input" in table.coords:
        order = [*table["sensitivity_status"].dims, "input"]
        first, total = (table[name].transpose(*order).values for name in ("first_order_index", "total_index"))
        inputs = [str(one) for one in table["input"].values]
        tally.indices = Indices.counted(inputs, first, total, table["sensitivity_status"].values)
    return tally


def coordinate_texts(table: xr.Dataset) -> dict[str, str]:
    """The coordinates in words, but for what the table of motions says."""
    suite = bool(motions_text(table))
    return {
        str(name): f"{one.size} motions" if suite and name == "motion" else values_text(one)
        for name, one in table.coords.items()
        if not (suite and name in MOTION_COORDINATES and one.dims == ("motion",))
    }


def values_text(values: xr.DataArray) -> str:
    """The values of a coordinate in words."""
    if values.dtype.kind in "OUST":
        return ", ".join(map(str, values.values.ravel()))
    units = _units_text(values, " ")
    there = values.values[np.isfinite(values.values)]
    missing = f", {values.size - there.size} missing" if there.size < values.size else ""
    if values.size == 1 == there.size:
        return f"{there.min():.6g}{units}"
    return (
        f"{values.size} values" + (f", {there.min():.6g} to {there.max():.6g}{units}" if there.size else "") + missing
    )


def variable_texts(table: xr.Dataset) -> dict[str, str]:
    """The variables in words."""
    return {
        str(name): f"{one.attrs.get('long_name', '')}{_units_text(one, ', ')} "
        f"({'text' if one.dtype.kind in 'OUST' else one.dtype})".lstrip(", ")
        for name, one in table.data_vars.items()
        if one.dims != (SUITE_DIM,)
    }


def _units_text(variable: xr.DataArray, before: str) -> str:
    units = str(variable.attrs.get("units", "1"))
    return "" if units == "1" else f"{before}{units}"


def motions_text(table: xr.Dataset) -> tuple[str, ...]:
    """The motions of a suite as a table, a header and a line each; empty without them."""
    if "motion" not in table.coords or table["motion"].dims != ("motion",) or table["motion"].dtype.kind not in "OUST":
        return ()
    names = [name for name in _MOTION_COLUMNS if name in table.coords and table[name].dims == ("motion",)]
    rows = table[names].to_dataframe()[names].rename(columns=_MOTION_COLUMNS).rename_axis(columns="motion", index=None)
    return tuple(rows.to_string(float_format="{:.4g}".format, na_rep="").splitlines())
