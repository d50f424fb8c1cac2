"""Cells of a result solved again: as they were, by another model, or with other parameters.

A result has its choices as attributes and its parameters as coordinates, so that a slice of it can
be solved once more.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.model.options import (
    MODELS,
    SOLVERS,
    Mendez,
    Model,
    Newmark,
    Solver,
    changing_strength,
    slides_both_ways,
)
from slipsweep.model.variables import PARAMETERS, RECORD_INPUTS, STRENGTH_INPUTS, WAVEFORM_INPUTS
from slipsweep.motion.waveforms import WAVEFORMS, peak_acceleration
from slipsweep.studies.sweeps import sweep

#: Amplitudes of a motion.
DRIVES = ("amplitude", "displacement_amplitude")

DISPLACEMENT = "permanent_displacement"

#: Parameters from which the yield acceleration follows.
INTERFACE = ("theta", "mu_s", "yield_acceleration")


def is_recorded(data: xr.Dataset) -> bool:
    """Return True if a result is of recorded motions."""
    return not {"record", "suite"}.isdisjoint(data.attrs)


def is_newmark(data: xr.Dataset) -> bool:
    """Return True if a result is of Newmark's block."""
    return bool(data.attrs["model"] == "newmark")


def solve_again(
    data: xr.Dataset,
    names: Iterable[str],
    model: Model | None = None,
    motion: Any = None,
    **changed: Any,
) -> xr.Dataset:
    """Solve the cells of a slice as its result was, or with a change.

    Parameters
    ----------
    data
        A result or a slice of one.
    names
        Results to compute.
    model
        Another model.
    motion
        The recorded motion of the result; None if it is of a waveform.
    **changed
        Parameters with other values; None leaves one to the model's estimate.
    """
    chosen = model or MODELS.from_attributes(data.attrs)
    block: tuple[str, ...] = INTERFACE
    if "yield_coefficient" in data.coords:
        block = ("yield_coefficient",)
    if slides_both_ways(chosen):
        block += ("theta", "upslope_yield_acceleration")
    friction: tuple[str, ...] = ()
    if isinstance(chosen, Mendez):
        friction = ("decay_rate", "delta_mu", "minimum_friction")
    friction += STRENGTH_INPUTS.get(changing_strength(chosen) or "", ())
    names_of_inputs = (*block, *friction, *WAVEFORM_INPUTS, *RECORD_INPUTS[1:])
    inputs = {
        name: without_coordinates(data[name]) for name in names_of_inputs if name in data.coords
    }
    inputs |= changed
    if inputs.get("displacement_amplitude") is not None:
        inputs["amplitude"] = None
    solver: Solver | str = SOLVERS.default
    if SOLVERS.attribute in data.attrs:
        solver = SOLVERS.from_attributes(data.attrs)
    return sweep(
        **inputs,
        model=chosen,
        excitation=motion or WAVEFORMS.from_attributes(data.attrs),
        solver=solver,
        variables=list(names),
    )


def without_coordinates(array: xr.DataArray) -> Any:
    """Return values along their dimensions, as the public functions take them."""
    return array.astype(np.float64).reset_coords(drop=True)


def with_amplitude(data: xr.Dataset) -> xr.Dataset:
    """Return a result with A = ω²d as a coordinate.

    Files do not have it where displacement amplitude d and frequency span a grid.
    """
    if "amplitude" in data.coords or not {"displacement_amplitude", "frequency"} <= {*data.coords}:
        return data
    peak = xr.apply_ufunc(peak_acceleration, data["displacement_amplitude"], data["frequency"])
    return data.assign_coords(amplitude=peak.assign_attrs(PARAMETERS["amplitude"]))


def newmark_displacement(data: xr.Dataset) -> xr.DataArray | None:
    """Return the permanent displacement of Newmark's block on the cells of a slice.

    It is that of the file, or solved; None if the file has none and the motions are recorded.
    """
    if "newmark_displacement" in data or is_recorded(data):
        return data.get("newmark_displacement")
    model = Newmark(g=float(data.attrs["g"]))
    return solve_again(data, [DISPLACEMENT], model)[DISPLACEMENT]
