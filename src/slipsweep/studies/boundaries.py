"""Boundaries of no sliding and of the sliding modes on the grid of a result.

They are the accelerations of yield and of the mode limit (Eq. 7), and the inclination at which the
block slides under its own weight.
"""

import numpy as np
import xarray as xr

from slipsweep.model.options import Mendez
from slipsweep.model.variables import Validity, has_signed_displacements
from slipsweep.studies.solved_again import (
    INTERFACE,
    is_newmark,
    is_recorded,
    without_coordinates,
)
from slipsweep.studies.sweeps import friction_parameters
from slipsweep.studies.upslope import upslope_yield_acceleration


def thresholds(data: xr.Dataset, always: bool = False) -> xr.Dataset:
    """Return the accelerations of yield and of the mode limit (Eq. 7) of a slice, m/s².

    Along the dimensions that they depend on; NaN where the block slides under its own weight.
    There are none for a record, each pulse of which has its own peak.

    Returns
    -------
    Dataset
        ``yield_line``, and ``limit_line``, but for Newmark's block only if `always`.  For a block
        that slides both ways ``yield_line`` is the smaller of Üy and Üy,up, and there are also
        ``downslope_line``, Üy, and ``upslope_line``, −Üy,up.
    """
    if is_recorded(data) and "half_wave_peak" not in data:
        return xr.Dataset()
    lines = boundaries(data, always)
    return lines.drop_vars("rest_angle").where(lines["rest_angle"] > 0)


def boundaries(data: xr.Dataset, always: bool = False) -> xr.Dataset:
    """Return `thresholds`, also where the block slides under its own weight, and ``rest_angle``.

    The angle, arctan(Üy/g) in degrees, is by how much the base may be steeper before the block
    slides under its own weight: φ − θ with Coulomb's Üy.  All are smooth where it passes 0, so that
    a map may interpolate them between cells on either side.
    """
    g = float(data.attrs["g"])
    lines = {}
    if "yield_coefficient" in data.coords:
        onset = data["yield_coefficient"] * g
    else:
        interface = {
            name: without_coordinates(data[name]) for name in INTERFACE if name in data.coords
        }
        # yield and limit do not depend on the amplitude, nor on Δμ and λ
        results = friction_parameters(
            amplitude=0.0, delta_mu=0.0, decay_rate=0.0, model=Mendez(g=g), **interface
        )
        onset = results["yield_acceleration"]
        if always or not is_newmark(data):
            undefined = has_flags(results["validity"], Validity.LIMIT_UNDEFINED)
            lines["limit_line"] = results["limiting_acceleration"].where(~undefined)
    lines["yield_line"] = onset
    if has_signed_displacements(data.attrs):
        upslope = _upslope_yield(data, onset)
        lines["yield_line"] = xr.apply_ufunc(np.minimum, onset.reset_coords(drop=True), upslope)
        lines["downslope_line"] = onset
        lines["upslope_line"] = -upslope
    lines["rest_angle"] = xr.apply_ufunc(lambda ratio: np.degrees(np.arctan(ratio)), onset / g)
    return xr.Dataset(lines).reset_coords(drop=True)


def _upslope_yield(data: xr.Dataset, onset: xr.DataArray) -> xr.DataArray:
    """Return Üy,up of a block that slides both ways: that of the result, or by statics from Üy."""
    if "upslope_yield_acceleration" in data.coords:
        measured: xr.DataArray = without_coordinates(data["upslope_yield_acceleration"])
        return measured
    theta = without_coordinates(data["theta"])
    return upslope_yield_acceleration(onset, theta, float(data.attrs["g"]))


def has_flags(validity: xr.DataArray, flags: int) -> xr.DataArray:
    """Return True where any of some flags is set."""
    return (validity.fillna(0).astype(np.int64) & int(flags)) != 0
