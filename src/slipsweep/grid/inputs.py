"""Checks of the inputs of a grid: what all its cells share, and the parameters that span it."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model import parameters, variables
from slipsweep.model.options import (
    MODELS,
    Model,
    Newmark,
    Solver,
    changing_strength,
    slides_both_ways,
    solver_for,
)
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform, peak_acceleration

#: Parameters that are given, by name: each a number, a 1-D array, or an `xarray.Variable` or
#: `DataArray` with dimensions of its own.
Inputs: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class Problem:
    """Model, excitation and solver, which all cells of a grid share."""

    model: Model
    excitation: Waveform | Record | Suite
    solver: Solver
    #: True if cells under a sine are walked like those under any wave, not solved in batches.
    walked: bool = False


def check_problem(excitation: Any, model: Any, solver: Any) -> Problem:
    """Return the problem; each argument is an object, or the name of one with its defaults."""
    is_recorded = isinstance(excitation, (Record, Suite))
    motion = excitation if is_recorded else WAVEFORMS.of(excitation)
    checked_model = MODELS.of(model)
    return Problem(checked_model, motion, solver_for(checked_model, solver))


def given_inputs(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters among the arguments of a function that are given, i.e. not None.

    A function that spells the parameters out in its signature passes its own ``locals()``.  The
    names, and their order in the result, are those of `model/parameter_table.py`.

    Examples
    --------
    >>> given_inputs({"mu_s": 0.4, "theta": 5.0, "amplitude": None, "solver": "auto"})
    {'theta': 5.0, 'mu_s': 0.4}
    """
    return {
        name: arguments[name] for name in variables.PARAMETERS if arguments.get(name) is not None
    }


def check_parameters(problem: Problem, inputs: Inputs) -> dict[str, xr.Variable]:
    """Return the parameters of a sweep as `check_arrays` does, with those that have a default.

    InputError: a parameter is missing, belongs to another model or shaking, or is out of bounds.
    """
    motion = problem.excitation
    inputs = given_inputs(inputs)
    _refuse_other_shaking(motion, inputs)
    _check_interface(problem.model, inputs)
    if isinstance(motion, Waveform):
        return _check_waveform_parameters(problem, inputs)
    strengths = [name for name in variables.STRENGTHS if name in inputs]
    if len(strengths) > 1:
        raise InputError(
            f"{', '.join(strengths[:2])}: must not both be given; either is the strength of the "
            "motion"
        )
    has_pairs = isinstance(motion, Suite) and motion.has_pairs
    if has_pairs and "azimuth" not in inputs:
        raise InputError("azimuth: must be given with pairs of components")
    if not has_pairs and "azimuth" in inputs:
        raise InputError("azimuth: only with a Suite of pairs of components (read_suite: pairs)")
    for name in ("decay_rate", "delta_mu", "minimum_friction"):
        if name in inputs and isinstance(problem.model, Newmark):
            raise InputError(
                f"{name}: not allowed with model = 'newmark', which has no friction law"
            )
    polarity = _check_polarity(inputs.get("polarity", 1))
    defaults = {"time_scale": 1.0} if strengths else {"time_scale": 1.0, "scale": 1.0}
    numbers = given_inputs({**defaults, **inputs, "polarity": None})
    coords = check_arrays(numbers, problem.model.g)
    coords["polarity"] = polarity
    if isinstance(motion, Suite):
        coords |= _motion_coordinates(motion, coords)
    if strengths and strengths != ["scale"]:
        _check_moving(motion, coords, strengths[0])
    return coords


def _check_waveform_parameters(problem: Problem, inputs: Inputs) -> dict[str, xr.Variable]:
    """Return the parameters of a sweep under a waveform."""
    if ("amplitude" in inputs) == ("displacement_amplitude" in inputs):
        raise InputError("amplitude, displacement_amplitude: exactly one of them must be given")
    parameters.check_given(inputs, ("frequency",))
    coords = check_arrays(inputs, problem.model.g)
    if "displacement_amplitude" in coords:
        # A = ω²d grows with both, so that the largest values have the largest A
        d = coords["displacement_amplitude"].values.max()
        f = coords["frequency"].values.max()
        key = f"displacement_amplitude = {d:g}: with frequency = {f:g}, A = (2 pi f)^2 d"
        parameters.check_single("amplitude", peak_acceleration(d, f), key)
    return coords


def _refuse_other_shaking(motion: Waveform | Record | Suite, inputs: Inputs) -> None:
    """Raise InputError if a parameter belongs to another kind of shaking."""
    if isinstance(motion, Waveform):
        kind = "waveform"
        allowed = variables.WAVEFORM_INPUTS
    else:
        kind = type(motion).__name__
        allowed = variables.RECORD_INPUTS
    refused = {*variables.WAVEFORM_INPUTS, *variables.RECORD_INPUTS} - {*allowed}
    for name in inputs:
        if name in refused:
            raise InputError(f"{name}: not allowed with a {kind}, which takes {', '.join(allowed)}")


def _check_interface(model: Model, inputs: Inputs) -> None:
    """Raise InputError unless the interface of the block is given, and given once."""
    _check_strength(model, inputs)
    both = slides_both_ways(model)
    if "upslope_yield_acceleration" in inputs and not both:
        raise InputError(
            "upslope_yield_acceleration: only with model = Newmark(sliding='both'), "
            "not where the block slides downslope only"
        )
    if "yield_coefficient" not in inputs:
        parameters.check_given(inputs, ("theta",))
        parameters.check_friction(inputs)
        return
    if not isinstance(model, Newmark):
        raise InputError(
            f"yield_coefficient: not allowed with model = {model.name!r}, whose friction needs "
            "theta and mu_s; only with model = 'newmark'; here give yield_acceleration"
        )
    if both and "theta" not in inputs and "upslope_yield_acceleration" not in inputs:
        raise InputError(
            "theta, upslope_yield_acceleration: one of them must be given beside yield_coefficient "
            "with sliding = 'both'"
        )
    for name in variables.INTERFACE_INPUTS:
        if name in inputs and not (both and name == "theta"):
            raise InputError(f"{name}: not allowed beside yield_coefficient, which replaces it")


def _check_strength(model: Model, inputs: Inputs) -> None:
    """Raise InputError unless the inputs of a changing strength are those that the model has."""
    changing = changing_strength(model)
    for strength, names in variables.STRENGTH_INPUTS.items():
        angles = [angle for angle, name in variables.ANGLES.items() if name in names]
        for name in (*names, *angles):
            if strength != changing and name in inputs:
                raise InputError(f"{name}: only with model = Newmark(strength={strength!r})")
    if changing is None:
        return
    if "residual_mu" in inputs and "residual_phi" in inputs:
        raise InputError(
            "residual_phi, residual_mu: must not both be given; residual_mu = tan(residual_phi)"
        )
    replaced = ("residual_mu",) if "residual_phi" in inputs else ()
    needed = [name for name in variables.STRENGTH_INPUTS[changing] if name not in replaced]
    for name in needed:
        if name not in inputs:
            raise InputError(f"{name}: must be given with strength = {changing!r}")
    for name in ("yield_acceleration", "yield_coefficient", "upslope_yield_acceleration"):
        if name in inputs:
            raise InputError(
                f"{name}: not allowed with strength = {changing!r}, which follows from theta and "
                "friction; for a yield coefficient give theta = 0 and mu_s"
            )


def _check_polarity(polarity: Any) -> xr.Variable:
    """Return the polarities, 1 and -1, from numbers or "both"."""
    is_both = isinstance(polarity, str) and polarity == "both"
    signs = np.empty(0)
    with suppress(InputError):
        signs = parameters.check_numbers("polarity", (1, -1) if is_both else polarity)
    if signs.ndim > 1 or not signs.size or not np.isin(signs, (1, -1)).all():
        raise InputError(
            f"polarity = {parameters.shown(polarity)}: must be 1, -1, a list of these, or 'both'"
        )
    attributes = variables.PARAMETERS["polarity"]
    return xr.Variable(("polarity",) * signs.ndim, signs.astype(np.int8), attributes)


def _motion_coordinates(suite: Suite, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return the labels and the intensity measures of a suite: coordinates along `motion`.

    Measures of pairs of components also lie along the azimuth.
    """
    about = variables.MOTION_COORDINATES
    labels = xr.Variable("motion", np.array(suite.labels), {"long_name": "recorded motion"})
    along_motion = {"motion": labels}
    along_motion |= {
        name: xr.Variable("motion", values, about[name]) for name, values in suite.measures.items()
    }
    if suite.has_pairs:
        places = xr.Variable("motion", np.arange(len(suite)))
        sizes = grid_sizes({"azimuth": coords["azimuth"], "motion": places})
        measures = suite.intensities(
            places.set_dims(sizes).values, coords["azimuth"].set_dims(sizes).values
        )
        along_motion |= {
            name: xr.Variable(tuple(sizes), values, about[name])
            for name, values in measures.items()
        }
    return along_motion


def _check_moving(motion: Record | Suite, coords: Mapping[str, xr.Variable], strength: str) -> None:
    """Raise InputError if a motion without acceleration is to be scaled to a strength."""
    peaks = xr.Variable((), motion.peak) if isinstance(motion, Record) else coords["motion_pga"]
    for place in np.argwhere(~(peaks.values > 0.0))[:1]:
        at = dict(zip(peaks.dims, place, strict=True))
        name = motion.name if isinstance(motion, Record) else motion.labels[at["motion"]]
        if "azimuth" in coords:
            name += f" at azimuth {float(coords['azimuth'].isel(at, missing_dims='ignore')):g}"
        raise InputError(f"{strength}: {name} has no acceleration to scale; give scale")


def check_arrays(inputs: Inputs, g: float) -> dict[str, xr.Variable]:
    """Return each parameter as a float64 array with named dimensions and its CF attributes.

    The unit "g" of an array is `g` m/s².  The tangent of a friction angle is added.  InputError: a
    value is out of bounds, or an array has no values or no names for its dimensions.
    """
    arrays = {}
    for name, argument in inputs.items():
        values = parameters.check_values(name, argument, g=g)
        attrs = variables.PARAMETERS[name]
        dims = (name,) * values.ndim
        if isinstance(argument, (xr.Variable, xr.DataArray)):
            dims = tuple(map(str, argument.dims))
            attrs = {**argument.attrs, **attrs}
            if len({*dims}) < len(dims):
                raise InputError(f"{name}: dimensions {', '.join(dims)}: must be named each once")
        elif values.ndim > 1:
            raise InputError(
                f"{name}: an array of {values.ndim} dimensions; must be a scalar, a 1-D array, or "
                "a DataArray that names its dimensions"
            )
        if values.size == 0:
            raise InputError(f"{name} = []: must hold at least one value")
        arrays[name] = xr.Variable(dims, values, attrs)
        if name in variables.ANGLES:
            tangent = variables.ANGLES[name]
            friction = parameters.friction_coefficient(values)
            arrays[tangent] = xr.Variable(dims, friction, variables.PARAMETERS[tangent])
    return arrays


def grid_sizes(arrays: Mapping[str, xr.Variable]) -> dict[str, int]:
    """Return the dimensions of the grid in the order of the results, and their lengths."""
    sizes: dict[str, int] = {}
    for name, array in arrays.items():
        for dim, size in zip(map(str, array.dims), array.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise InputError(
                    f"{name}: {size} values along {dim!r}, where another parameter has {sizes[dim]}"
                )
    order = [*dict.fromkeys((*variables.DIMENSION_ORDER, *sizes))]
    return {dim: sizes[dim] for dim in order if dim in sizes}


def inputs_of(problem: Problem, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return the coordinates that cells are solved for.

    Friction angles are left out, as their tangents are there, and so is what describes a motion:
    `motion` is its place in the suite.
    """
    inputs = {
        name: values
        for name, values in coords.items()
        if name not in (*variables.ANGLES, *variables.MOTION_COORDINATES)
    }
    suite = problem.excitation
    if isinstance(suite, Suite):
        places = [suite.index(str(label)) for label in coords["motion"].values]
        inputs["motion"] = xr.Variable(("motion",), np.array(places, np.float64))
    return inputs
