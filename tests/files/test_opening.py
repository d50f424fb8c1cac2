"""Results opened again: as they were written, rewritten by other programs, or no results at all."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import slipsweep
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.files.opening import read_result
from slipsweep.studies.result_counts import tally_of
from tests.support.commands import command
from tests.support.stored_runs import job_of, run


def test_results_open_as_sweep_returns_them(folder: Path) -> None:
    run(job_of(folder, "sweep"), folder / "a.nc")
    opened = slipsweep.open_result(folder / "a.nc")
    assert all(result.chunks is not None for result in opened.data_vars.values())
    arguments = {"theta": [0, 5, 10], "mu_s": [0.3, 0.5], "amplitude": opened.amplitude.values}
    expected = slipsweep.sweep(
        **arguments, frequency=[0.5, 1, 2], variables=list(map(str, opened.data_vars))
    )
    xr.testing.assert_equal(opened, expected)
    assert opened.sliding_mode.dtype == expected.sliding_mode.dtype == np.int8
    for name in opened.data_vars:
        assert opened[name].attrs["long_name"] == expected[name].attrs["long_name"]


def packed(table: xr.Dataset) -> xr.Dataset:
    encoding = {"scale_factor": 1e-5, "dtype": "int32", "_FillValue": -9}
    table.permanent_displacement.encoding = encoding
    return table


#: Edits of other programs that leave the meaning of a file.
EDITS: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "packed": packed,
    "transposed": lambda table: table.transpose(*reversed(table.permanent_displacement.dims)),
    "codes as numbers": lambda table: table.assign(sliding_mode=table.sliding_mode.astype(float)),
    "flags as numbers": lambda table: table.assign(validity=table.validity.astype(float)),
    "single precision": lambda table: table.astype("float32", keep_attrs=True).assign(
        validity=table.validity
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_rewritten_result_opens_with_its_values(folder: Path, edit: str) -> None:
    run(job_of(folder, "sweep"), folder / "a.nc")
    whole = read_result(folder / "a.nc").load()
    EDITS[edit](xr.open_dataset(folder / "a.nc").load()).to_netcdf(folder / "b.nc")
    again = slipsweep.open_result(folder / "b.nc")
    assert again.sliding_mode.dtype.kind in "if"
    np.testing.assert_allclose(
        again.permanent_displacement.transpose(*whole.permanent_displacement.dims),
        whole.permanent_displacement,
        atol=2e-5,
    )
    for name in ("sliding_mode", "validity"):
        np.testing.assert_array_equal(again[name].transpose(*whole[name].dims), whole[name])


def outer(table: xr.Dataset) -> xr.Dataset:
    """Cells that one of two results has, joined with those of both."""
    other = table.isel(mu_s=[0]).assign_coords(theta=table.theta + 1.0)
    return xr.concat([table, other], "theta", join="outer")


#: Edits that make another grid of a result, and the message.
OTHER_GRIDS: dict[str, tuple[Callable[[xr.Dataset], xr.Dataset], str]] = {
    "joined": (
        lambda table: xr.concat([table, table.assign_coords(theta=table.theta + 20)], "theta"),
        "theta: 6 values, 0 to 30 degree, where the sweep that it stores has 3 values, 0 to 10 "
        "degree",
    ),
    "joined along another axis": (
        lambda table: xr.concat([table, table], xr.IndexVariable("cycles", [5, 10])),
        "cycles: is no dimension of the sweep that it stores",
    ),
    "joined along a parameter": (
        lambda table: xr.concat([table, table], xr.IndexVariable("yield_acceleration", [1.0, 2.0])),
        "yield_acceleration: is no dimension of the sweep that it stores",
    ),
    "outer": (outer, "theta: 6 values, 0 to 11 degree, where"),
    "cut": (
        lambda table: table.isel(mu_s=0),
        "mu_s: 0.3, where the sweep that it stores has 2 values, 0.3 to 0.5",
    ),
    "shifted": (
        lambda table: table.assign_coords(frequency=table.frequency * 1.001),
        "frequency: 3 values, 0.5005 to 2.002 Hz, where",
    ),
    "mean": (
        lambda table: table.mean("theta", keep_attrs=True),
        "theta: no values, where the sweep that it stores has 3 values, 0 to 10",
    ),
}


@pytest.mark.parametrize("change", OTHER_GRIDS)
def test_a_result_with_another_grid_than_its_sweep_is_not_solved_again(
    folder: Path, change: str
) -> None:
    make, message = OTHER_GRIDS[change]
    job = job_of(folder, "sweep")
    run(job, folder / "a.nc")
    make(slipsweep.open_result(folder / "a.nc").load()).to_netcdf(folder / "b.nc")
    with pytest.raises(InputError, match=rf"b\.nc: {message}"):
        spec.load(folder / "b.nc")  # which run and limit do
    with pytest.raises(InputError, match=rf"b\.nc: {message}"):
        run(job, folder / "b.nc", resume=True)


def test_a_suite_with_other_motions_is_not_solved_again(folder: Path) -> None:
    run(job_of(folder, "suite"), folder / "a.nc")
    whole = slipsweep.open_result(folder / "a.nc").load()
    whole.isel(motion=[0]).to_netcdf(folder / "b.nc")
    with pytest.raises(InputError, match=r"b\.nc: motion: m1, where .* has m1, m2: "):
        spec.load(folder / "b.nc")


@dataclass(frozen=True)
class Unflagged:
    """A result of which another program has removed the flags of some cells."""

    path: Path
    table: xr.Dataset
    lost: xr.DataArray


@pytest.fixture(params=["masked", "outer", "filled"])
def unflagged(request: pytest.FixtureRequest, folder: Path) -> Unflagged:
    """Cells masked, joined in from another result, or written with a fill value."""
    run(job_of(folder, "sweep"), folder / "a.nc")
    whole = slipsweep.open_result(folder / "a.nc").load()
    if request.param == "outer":
        table = outer(whole)
        lost = table.permanent_displacement.isnull() & (table.theta % 5 == 1)
    else:
        lost = whole.theta == 5
        table = whole.where(~lost)
        if request.param == "filled":
            table["validity"].encoding |= {"dtype": "int16", "_FillValue": -9}
    table.to_netcdf(folder / "b.nc")
    return Unflagged(folder / "b.nc", table, lost.broadcast_like(table.validity))


def test_cells_that_have_lost_their_flags_open_without_a_value(unflagged: Unflagged) -> None:
    opened = slipsweep.open_result(unflagged.path)
    xr.testing.assert_equal(opened.validity.isnull().compute(), unflagged.lost)
    assert (opened.sliding_mode.where(unflagged.lost, -1) == -1).all()


def test_flags_of_cells_that_have_lost_them_are_refused(unflagged: Unflagged) -> None:
    with pytest.raises(InputError, match="whole numbers, of which none is missing"):
        slipsweep.flags(slipsweep.open_result(unflagged.path))


def test_cells_that_have_lost_their_flags_are_counted_by_themselves(unflagged: Unflagged) -> None:
    tally = tally_of(slipsweep.open_result(unflagged.path))
    assert tally.unflagged == int(unflagged.lost.sum()) > 0
    assert tally.flags is not None
    bits = unflagged.table.validity.fillna(0).astype(int)
    for flag, count in tally.flags.items():
        assert count == int(((bits & int(flag)) != 0).sum())


def test_a_table_has_no_words_for_flags_that_are_lost(unflagged: Unflagged) -> None:
    folder = unflagged.path.parent
    done = command(folder, "export", "b.nc", "-o", "b.csv", "--words")
    assert done.returncode == 0, done.stderr
    words = pd.read_csv(folder / "b.csv", keep_default_na=False)["validity"].to_numpy()
    opened = slipsweep.open_result(unflagged.path)
    bits = unflagged.table.validity.transpose(*opened.validity.dims).values.ravel()
    assert [bool(word) for word in words] == (np.nan_to_num(bits) != 0).tolist()


def test_info_prints_the_share_of_flags_that_are_lost(unflagged: Unflagged) -> None:
    share = float(unflagged.lost.mean())
    line = f"  not known              {share:9.2%}  another program has"
    assert line in command(unflagged.path.parent, "info", "b.nc").stdout


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "not a netCDF file, or a damaged one"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "not a netCDF file, or a damaged one"),
        ("foreign", "not written by slipsweep"),
        ("folder", "neither a netCDF file nor a Zarr store"),
    ],
)
def test_a_file_that_is_no_result_is_refused_in_a_line(
    tmp_path: Path, content: Any, message: str
) -> None:
    path = tmp_path / "a.nc"
    if content == "foreign":
        xr.Dataset({"a": 1}).to_netcdf(path)
    elif content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as refused:
        slipsweep.open_result(path)
    assert "\n" not in str(refused.value)
