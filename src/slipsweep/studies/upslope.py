"""Sliding upslope, which a block under both models leaves out.

Both models let a block slide downslope only, but for continuous sliding by the paper's law.  On a
level or gentle base a block also slides back, and ends near where it began.
"""

from typing import Any

import numpy as np
import xarray as xr

from slipsweep.grid import engine
from slipsweep.model import equations
from slipsweep.model.options import Mendez
from slipsweep.motion.cutting import wave_of
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Pair, Suite
from slipsweep.motion.waveforms import WAVEFORMS, peak_acceleration


def upslope_yield_acceleration(
    yield_acceleration: xr.DataArray, theta: xr.DataArray, g: float
) -> xr.DataArray:
    """Return the acceleration of the base beyond which a block slides upslope, m/s².

    It follows from Üy by statics, g tan(arctan(Üy/g) + 2θ), which is g tan(φs + θ) with Coulomb's
    Üy; `theta` is in degrees.  Infinite where the angle reaches 90°.
    """
    tan_theta = xr.apply_ufunc(np.tan, np.radians(1.0) * theta)

    def by_statics(onset: Any, tangent: Any) -> Any:
        interface = {"yield_acceleration": onset, "tan_theta": tangent}
        return engine.upslope_yield_acceleration(interface, g)

    onset: xr.DataArray = xr.apply_ufunc(by_statics, yield_acceleration, tan_theta)
    return onset


def sliding_ways(
    data: xr.Dataset, motion: Record | Suite | None = None
) -> tuple[xr.DataArray, xr.DataArray] | None:
    """Find where a block slides, and where one that slides both ways would also slide upslope.

    Parameters
    ----------
    data : Dataset
        A result, a slice of one, or a time history; of results the coordinates are enough.
    motion : Record or Suite, optional
        The recorded motion of the result.

    Returns
    -------
    (DataArray, DataArray) or None
        True where the base's acceleration exceeds Üy, and where it exceeds the upslope yield
        acceleration, but not in continuous sliding by the paper's law under a waveform, which goes
        both ways already.  None where that is not known: of a result without θ, or without its
        motion; and where the result is of a block that slides both ways.
    """
    if "theta" not in data.coords or data.attrs.get("sliding") == "both":
        return None
    peaks = _peaks(data, motion)
    if peaks is None:
        return None
    g = float(data.attrs["g"])
    theta = _values(data, "theta")
    tan_theta = xr.apply_ufunc(np.tan, np.radians(1.0) * theta)
    if "yield_acceleration" in data.coords:
        onset = _values(data, "yield_acceleration")
    else:
        onset = xr.apply_ufunc(
            equations.coulomb_yield_acceleration, _values(data, "mu_s"), tan_theta, g
        )
    onset = onset.where(onset > 0.0)
    slides = peaks[0] > onset
    slides_back = peaks[1] > upslope_yield_acceleration(onset, theta, g)
    if WAVEFORMS.attribute in data.attrs and data.attrs["model"] == Mendez.name:
        mu_s = _values(data, "mu_s")
        in_contact = _amplitude(data) * tan_theta < g
        limit = xr.apply_ufunc(equations.limiting_acceleration, onset, mu_s, tan_theta, g)
        slides = slides & in_contact
        slides_back = slides_back & in_contact & ~(_amplitude(data) > limit)
    return slides, slides_back


def _values(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return a parameter without its coordinates, which would have to agree with others."""
    return data[name].astype(np.float64).reset_coords(drop=True)


def _amplitude(data: xr.Dataset) -> Any:
    """Return the peak ground acceleration under a waveform, m/s²."""
    if "amplitude" in data.variables:
        return _values(data, "amplitude")
    return peak_acceleration(_values(data, "displacement_amplitude"), _values(data, "frequency"))


def _peaks(data: xr.Dataset, motion: Record | Suite | None) -> tuple[Any, Any] | None:
    """Return the largest accelerations of the base downslope and upslope, m/s².

    None: they are not known.
    """
    if WAVEFORMS.attribute in data.attrs:
        wave = wave_of(WAVEFORMS.from_attributes(data.attrs))
        amplitude = _amplitude(data)
        return amplitude * wave.highest, amplitude * -wave.lowest
    if "ground_acceleration" in data:
        return data["ground_acceleration"].max(), -data["ground_acceleration"].min()
    return None if motion is None else _recorded_peaks(data, motion)


def _recorded_peaks(data: xr.Dataset, motion: Record | Suite) -> tuple[Any, Any]:
    """Return `_peaks` of a record, or of each motion of a suite."""
    for name in ("motion", "azimuth"):
        if name in data.coords and data[name].ndim:
            (dim,) = data[name].dims
            cuts = [data.isel({dim: at}) for at in range(data.sizes[dim])]
            down, up = zip(*(_recorded_peaks(cut, motion) for cut in cuts), strict=True)
            return xr.concat(down, dim), xr.concat(up, dim)
    if isinstance(motion, Suite):
        record = motion[str(data["motion"].item())]
        motion = record.rotated(data["azimuth"].item()) if isinstance(record, Pair) else record
    coords = {
        str(name): coordinate.reset_coords(drop=True) for name, coordinate in data.coords.items()
    }
    factor = strength_factor(motion.times, motion.acceleration, coords) * coords["polarity"]
    ends = [factor * end for end in (motion.acceleration.min(), motion.acceleration.max())]
    return np.maximum(*ends), -np.minimum(*ends)
