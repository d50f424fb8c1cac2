"""Results in the hands of xarray's neighbours: what docs/files.md says of them works."""

import copy
import pickle
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import slipsweep


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return slipsweep.sweep(
        theta=[2.0, 5.0], mu_s=[0.3, 0.4], amplitude=[2.0, 5.0, 9.0], frequency=2.0
    )


def test_copies_are_the_result_again(result: xr.Dataset) -> None:
    for again in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        xr.testing.assert_identical(again, result)
    lazy = slipsweep.sweep(
        theta=[2.0, 5.0], mu_s=[0.3, 0.4], amplitude=[2.0, 5.0, 9.0], frequency=2.0, chunks=2
    )
    xr.testing.assert_equal(pickle.loads(pickle.dumps(lazy)).compute(), result)


def test_a_dataframe_has_a_row_for_each_cell(result: xr.Dataset) -> None:
    rows = result.to_dataframe()
    assert list(rows.index.names) == ["theta", "mu_s", "amplitude"]
    expected = result.permanent_displacement.sel(theta=5.0, mu_s=0.4, amplitude=9.0)
    assert rows.loc[(5.0, 0.4, 9.0), "permanent_displacement"] == expected.item()


@pytest.mark.parametrize("chunks", [None, 2])
def test_numpy_functions_apply_to_results(result: xr.Dataset, chunks: int | None) -> None:
    values = (
        result.permanent_displacement
        if chunks is None
        else result.permanent_displacement.chunk(chunks)
    )
    rooted = xr.apply_ufunc(np.sqrt, values, dask="parallelized", output_dtypes=[float])
    assert (rooted.chunks is None) == (chunks is None)
    np.testing.assert_array_equal(rooted, np.sqrt(result.permanent_displacement))


def test_plots_have_names_and_units(result: xr.Dataset) -> None:
    result.permanent_displacement.isel(theta=0).plot.line(x="amplitude", hue="mu_s")
    labels = [" ".join(text.split()) for text in (plt.gca().get_xlabel(), plt.gca().get_ylabel())]
    assert labels == ["peak ground acceleration [m s-2]", "permanent displacement, downslope [m]"]
    plt.close("all")


def test_units_by_pint_xarray(result: xr.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("pint_xarray")
    pytest.importorskip("cf_xarray.units")  # pint reads "m s-2" then
    result.to_netcdf(tmp_path / "a.nc")
    for dataset in (result, slipsweep.open_result(tmp_path / "a.nc").load()):
        quantities = dataset.pint.quantify()
        millimetres = quantities.pint.to(permanent_displacement="mm").permanent_displacement
        np.testing.assert_allclose(
            millimetres.pint.magnitude, 1e3 * result.permanent_displacement, rtol=1e-14
        )
        in_g = quantities.amplitude.pint.to("standard_gravity")
        again = slipsweep.sweep(
            theta=quantities.theta, mu_s=quantities.mu_s, amplitude=in_g, frequency=2.0
        )
        np.testing.assert_allclose(
            again.permanent_displacement, result.permanent_displacement, rtol=1e-12
        )
        assert quantities.pint.dequantify(format="cf").amplitude.attrs["units"] == "m s-2"


def test_flags_by_cf_xarray(result: xr.Dataset) -> None:
    pytest.importorskip("cf_xarray")
    np.testing.assert_array_equal(result.sliding_mode.cf == "stick_slip", result.sliding_mode == 1)
    flags = slipsweep.flags(result)
    for name, flag in result.validity.cf.flags.data_vars.items():
        np.testing.assert_array_equal(flag, flags[name])
    assert "validity" in result.cf["permanent_displacement"].coords


def test_flags_without_a_value_come_first_then_cautions_then_notes(result: xr.Dataset) -> None:
    flags = slipsweep.flags(result)
    kinds = [described.attrs["kind"] for described in flags.data_vars.values()]
    order = ["no value", "caution", "note"]
    assert kinds == sorted(kinds, key=order.index)
    assert {*kinds} == {*order}
    for name, described in flags.data_vars.items():
        flag = slipsweep.Validity[str(name).upper()]
        assert described.attrs == {"long_name": flag.text, "kind": str(flag.kind)}
    assert flags.equals(result.slipsweep.flags())
