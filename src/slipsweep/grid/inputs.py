"""The parameters of a block and its shaking as a caller gives them, checked and laid out."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid.problem import Problem
from slipsweep.model import variables as known
from slipsweep.model.options import Model, Newmark
from slipsweep.model.parameters import (
    BOUNDS,
    check_given,
    check_numbers,
    check_values,
    number_text,
    shown,
    with_friction_coefficient,
)
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Waveform, peak_acceleration


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What `slipsweep.sweep` takes beside its options; None is not given.

    Each is a number, a 1-D array, or an `xarray.Variable` or `DataArray` with dimensions of its own, in the units of
    `slipsweep.model.variables.PARAMETERS`.  The functions that take one check them.

    Examples
    --------
    >>> Inputs(theta=5.0, mu_s=0.4).given
    {'theta': 5.0, 'mu_s': 0.4}
    """

    theta: Any = None
    mu_s: Any = None
    phi: Any = None
    amplitude: Any = None
    frequency: Any = None
    displacement_amplitude: Any = None
    scale: Any = None
    pgv: Any = None
    arias_intensity: Any = None
    time_scale: Any = None
    polarity: Any = None
    azimuth: Any = None
    yield_acceleration: Any = None
    yield_coefficient: Any = None
    decay_rate: Any = None
    delta_mu: Any = None
    minimum_friction: Any = None
    structure_frequency: Any = None

    @property
    def given(self) -> dict[str, Any]:
        """The parameters that are given; of `phi` the friction coefficient, an array that has it as a coordinate."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return with_friction_coefficient({name: value for name, value in values.items() if value is not None})

    def but(self, others: Mapping[str, Any]) -> "Inputs":
        """The same with other values of some parameters; None leaves one out."""
        return replace(self, **others)


def check_parameters(problem: Problem, inputs: Inputs) -> dict[str, xr.Variable]:
    """The parameters of a sweep, all that it needs and no others, as `checked` has them."""
    motion = problem.excitation
    parameters = inputs.given
    if isinstance(motion, Waveform):
        check_inputs(parameters, known.WAVEFORM_INPUTS, "a waveform")
        if ("amplitude" in parameters) == ("displacement_amplitude" in parameters):
            raise InputError("amplitude, displacement_amplitude: exactly one of them must be given")
        _check_interface(problem.model, parameters)
        check_given(parameters, ("frequency",))
        return checked(parameters, problem.model.g)
    check_inputs(parameters, known.RECORD_INPUTS, "a Suite" if isinstance(motion, Suite) else "a Record")
    _check_interface(problem.model, parameters)
    strengths = [name for name in known.STRENGTHS if name in parameters]
    if len(strengths) > 1:
        raise InputError(f"{', '.join(strengths[:2])}: must not both be given; either is the strength of the motion")
    if isinstance(motion, Suite) and motion.has_pairs:
        if "azimuth" not in parameters:
            raise InputError("azimuth: must be given with pairs of components")
    elif "azimuth" in parameters:
        raise InputError("azimuth: only with a Suite of pairs of components (read_suite: pairs)")
    if isinstance(problem.model, Newmark):
        for name in ("decay_rate", "delta_mu", "minimum_friction"):
            if name in parameters:
                raise InputError(f"{name}: not allowed with model = 'newmark', which has no friction law")
    polarity = _polarity(parameters.pop("polarity", 1))
    defaults = {"time_scale": 1.0} if strengths else {"scale": 1.0, "time_scale": 1.0}
    parameters = defaults | parameters
    found = checked({name: parameters[name] for name in known.PARAMETERS if name in parameters}, problem.model.g)
    found["polarity"] = polarity
    found |= motion_coordinates(motion, found)
    if strengths and strengths != ["scale"]:
        _check_moving(motion, found, strengths[0])
    return found


def _check_interface(model: Model, parameters: Mapping[str, Any]) -> None:
    """Refuse an interface that is not known, or known twice."""
    if "yield_coefficient" not in parameters:
        check_given(parameters, ("theta", "mu_s"))
        return
    if not isinstance(model, Newmark):
        raise InputError(
            f"yield_coefficient: not allowed with model = {model.name!r}, whose friction needs theta and mu_s; "
            "only with model = 'newmark'"
        )
    for name in known.INTERFACE_INPUTS:
        if name in parameters:
            raise InputError(f"{name}: not allowed beside yield_coefficient, which replaces it")


def check_inputs(given: Collection[str], shaking: Collection[str], what: str) -> None:
    """Refuse inputs of another kind of shaking."""
    others = {*known.WAVEFORM_INPUTS, *known.RECORD_INPUTS} - {*shaking}
    for name in given:
        if name in others:
            raise InputError(f"{name}: not allowed with {what}, which takes {', '.join(shaking)}")


def motion_coordinates(motion: Record | Suite, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The labels of a suite and its intensity measures: coordinates along `motion`, of pairs also along the azimuth."""
    if not isinstance(motion, Suite):
        return {}
    found = {"motion": xr.Variable(("motion",), np.array(motion.labels), known.MOTION)}
    found |= {
        name: xr.Variable(("motion",), one, known.MOTION_COORDINATES[name]) for name, one in motion.measures.items()
    }
    if motion.has_pairs:
        azimuth, places = coords["azimuth"], xr.Variable(("motion",), np.arange(len(motion)))
        sizes = grid_sizes({"azimuth": azimuth, "motion": places})
        both = aligned({"motion": places, "azimuth": azimuth}, sizes)
        at = np.broadcast_arrays(both["motion"], both["azimuth"], np.empty(tuple(sizes.values())))
        for name, one in motion.intensities(at[0], at[1]).items():
            found[name] = xr.Variable(tuple(sizes), one, known.MOTION_COORDINATES[name])
    return found


def _check_moving(motion: Record | Suite, coords: Mapping[str, xr.Variable], strength: str) -> None:
    """Refuse to scale a motion that has no acceleration."""
    if isinstance(motion, Record):
        if not motion.peak > 0.0:
            raise InputError(f"{strength}: {motion.name} has no acceleration to scale; give scale")
        return
    peaks = coords["motion_pga"]
    still = np.argwhere(~(peaks.values > 0.0))
    if still.size:
        at = dict(zip(peaks.dims, still[0], strict=True))
        where = f" at azimuth {float(coords['azimuth'].isel(at, missing_dims='ignore')):g}" if motion.has_pairs else ""
        raise InputError(f"{strength}: {motion.labels[at['motion']]}{where} has no acceleration to scale; give scale")


def _polarity(given: Any) -> xr.Variable:
    """The signs asked for: 1, -1, both."""
    both = isinstance(given, str) and given == "both"
    try:
        values = check_numbers("polarity", (1, -1) if both else given)
    except InputError:
        values = np.empty(0)
    if values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(f"polarity = {shown(given)}: must be 1, -1, a list of these, or 'both'")
    dims = ("polarity",) if values.ndim else ()
    return xr.Variable(dims, values.astype(np.int8), known.PARAMETERS["polarity"])


def checked(parameters: Mapping[str, Any], g: float) -> dict[str, xr.Variable]:
    """Every parameter as a float64 array with named dimensions, within its bounds, described.

    `g` is what "g" as the unit of an array stands for.
    """
    checked = {}
    for name, given in parameters.items():
        if isinstance(given, (xr.Variable, xr.DataArray)):
            dims = tuple(map(str, given.dims))
            if len(set(dims)) < len(dims):
                raise InputError(f"{name}: dimensions {', '.join(dims)}: must be named each once")
            variable = xr.Variable(dims, check_values(name, given, g=g), {**given.attrs, **known.PARAMETERS[name]})
        else:
            values = check_values(name, given, g=g)
            if values.ndim > 1:
                raise InputError(
                    f"{name}: an array of {values.ndim} dimensions; must be a scalar, a 1-D array, or a DataArray "
                    "that names its dimensions"
                )
            variable = xr.Variable((name,) if values.ndim else (), values, known.PARAMETERS[name])
        if variable.values.size == 0:
            raise InputError(f"{name} = []: must hold at least one value")
        checked[name] = variable
        if name == "mu_s" and isinstance(given, xr.DataArray) and "phi" in given.coords:
            checked["phi"] = given["phi"].variable.to_base_variable()
    return checked


def check_amplitudes(displacement_amplitude: xr.Variable, frequency: xr.Variable) -> None:
    """Refuse peak displacements that make an amplitude out of its bounds: A grows with both."""
    d, f = displacement_amplitude.values.max(), frequency.values.max()
    if not BOUNDS["amplitude"].holds(peak_acceleration(d, f)):
        raise InputError(
            f"displacement_amplitude = {number_text(float(d))}: with frequency = {number_text(float(f))} its amplitude "
            f"A = (2 pi f)^2 d must be {BOUNDS['amplitude'].text}"
        )


def grid_sizes(variables: Mapping[str, xr.Variable]) -> dict[str, int]:
    """Dimensions of the grid in the order of the results, and their lengths."""
    sizes: dict[str, int] = {}
    for name, variable in variables.items():
        for dim, size in zip(map(str, variable.dims), variable.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise InputError(f"{name}: {size} values along {dim!r}, where another parameter has {sizes[dim]}")
    ordered = [dim for dim in known.DIMENSION_ORDER if dim in sizes] + [
        dim for dim in sizes if dim not in known.DIMENSION_ORDER
    ]
    return {dim: sizes[dim] for dim in ordered}


def aligned(variables: Mapping[str, xr.Variable], sizes: Mapping[str, int]) -> dict[str, NDArray[Any]]:
    """Plain arrays with all dimensions, of length 1 where they do not vary."""
    aligned = {}
    for name, variable in variables.items():
        own = variable.values.transpose([variable.dims.index(dim) for dim in sizes if dim in variable.dims])
        aligned[name] = own.reshape([variable.sizes.get(dim, 1) for dim in sizes])
    return aligned


def inputs_of(problem: Problem, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The coordinates that cells are solved for: no friction angle; of a motion its place in the suite, and no more."""
    own = {name: one for name, one in coords.items() if name not in ("phi", *known.MOTION_COORDINATES)}
    suite = problem.excitation
    if not isinstance(suite, Suite):
        return own
    places = np.array([suite.index(str(label)) for label in coords["motion"].values], np.float64)
    return own | {"motion": xr.Variable(("motion",), places)}
