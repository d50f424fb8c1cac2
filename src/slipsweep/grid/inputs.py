"""What a caller gives, checked and laid out: what all cells share, and the parameters that span the grid."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model import parameters
from slipsweep.model import variables as known
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


@dataclass(frozen=True)
class Problem:
    """What all cells of a grid share."""

    model: Model
    excitation: Waveform | Record | Suite
    solver: Solver
    #: Cells under a sine are walked like those under any wave, and not put into batches.
    walked: bool = False


def check_problem(excitation: Any, model: Any, solver: Any) -> Problem:
    """What is to be solved, and how; each is an object, or the name of one with its defaults."""
    motion = excitation if isinstance(excitation, (Record, Suite)) else WAVEFORMS.of(excitation)
    chosen = MODELS.of(model)
    return Problem(chosen, motion, solver_for(chosen, solver))


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What `slipsweep.sweep` takes beside its options; None is not given.

    Each is a number, a 1-D array, or an `xarray.Variable` or `DataArray` with dimensions of its
    own, in the units of `slipsweep.model.variables.PARAMETERS`.  The functions that take one check
    them.

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
    upslope_yield_acceleration: Any = None
    decay_rate: Any = None
    delta_mu: Any = None
    minimum_friction: Any = None
    residual_mu: Any = None
    residual_phi: Any = None
    weakening_distance: Any = None
    fast_mu: Any = None
    rate_constant: Any = None
    structure_frequency: Any = None

    @property
    def given(self) -> dict[str, Any]:
        """The parameters that are given."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


def check_parameters(problem: Problem, inputs: Inputs) -> dict[str, xr.Variable]:
    """The parameters of a sweep, all that it needs and no others, as `checked` has them."""
    motion = problem.excitation
    given = inputs.given
    _refuse_others(motion, given)
    _check_interface(problem.model, given)
    if isinstance(motion, Waveform):
        if ("amplitude" in given) == ("displacement_amplitude" in given):
            raise InputError("amplitude, displacement_amplitude: exactly one of them must be given")
        parameters.check_given(given, ("frequency",))
        found = checked(given, problem.model.g)
        if "displacement_amplitude" in found:  # A grows with both
            d, f = (found[name].values.max() for name in ("displacement_amplitude", "frequency"))
            key = f"displacement_amplitude = {d:g}: with frequency = {f:g}, A = (2 pi f)^2 d"
            parameters.check_single("amplitude", peak_acceleration(d, f), key)
        return found
    strengths = [name for name in known.STRENGTHS if name in given]
    if len(strengths) > 1:
        raise InputError(
            f"{', '.join(strengths[:2])}: must not both be given; either is the strength of the motion"
        )
    has_pairs = isinstance(motion, Suite) and motion.has_pairs
    if has_pairs and "azimuth" not in given:
        raise InputError("azimuth: must be given with pairs of components")
    if not has_pairs and "azimuth" in given:
        raise InputError("azimuth: only with a Suite of pairs of components (read_suite: pairs)")
    for name in ("decay_rate", "delta_mu", "minimum_friction"):
        if name in given and isinstance(problem.model, Newmark):
            raise InputError(
                f"{name}: not allowed with model = 'newmark', which has no friction law"
            )
    polarity = _polarity(given.pop("polarity", 1))
    given = {"time_scale": 1.0} | ({} if strengths else {"scale": 1.0}) | given
    found = checked(
        {name: given[name] for name in known.PARAMETERS if name in given}, problem.model.g
    )
    found["polarity"] = polarity
    if isinstance(motion, Suite):
        found |= _motion_coordinates(motion, found)
    if strengths and strengths != ["scale"]:
        _check_moving(motion, found, strengths[0])
    return found


def _refuse_others(motion: Waveform | Record | Suite, given: Mapping[str, Any]) -> None:
    """Refuse inputs of another kind of shaking."""
    is_wave = isinstance(motion, Waveform)
    what, taken = (
        ("waveform", known.WAVEFORM_INPUTS)
        if is_wave
        else (type(motion).__name__, known.RECORD_INPUTS)
    )
    for name in given:
        if name in {*known.WAVEFORM_INPUTS, *known.RECORD_INPUTS} - {*taken}:
            raise InputError(f"{name}: not allowed with a {what}, which takes {', '.join(taken)}")


def _check_interface(model: Model, given: Mapping[str, Any]) -> None:
    """Refuse an interface that is not known, or known twice."""
    _check_strength(model, given)
    both = slides_both_ways(model)
    if "upslope_yield_acceleration" in given and not both:
        raise InputError(
            "upslope_yield_acceleration: only with model = Newmark(sliding='both'), "
            "not where the block slides downslope only"
        )
    if "yield_coefficient" not in given:
        parameters.check_given(given, ("theta",))
        parameters.check_friction(given)
        return
    if not isinstance(model, Newmark):
        raise InputError(
            f"yield_coefficient: not allowed with model = {model.name!r}, whose friction needs theta and mu_s; "
            "only with model = 'newmark'; here give yield_acceleration"
        )
    if both and "theta" not in given and "upslope_yield_acceleration" not in given:
        raise InputError(
            "theta, upslope_yield_acceleration: one of them must be given beside yield_coefficient "
            "with sliding = 'both'"
        )
    for name in known.INTERFACE_INPUTS:
        if name in given and not (both and name == "theta"):
            raise InputError(f"{name}: not allowed beside yield_coefficient, which replaces it")


def _check_strength(model: Model, given: Mapping[str, Any]) -> None:
    """Refuse a changing strength that is not given as a whole, or that the model does not have."""
    chosen = changing_strength(model)
    for strength, names in known.STRENGTH_INPUTS.items():
        angles = [angle for angle, name in known.ANGLES.items() if name in names]
        for name in (*names, *angles):
            if strength != chosen and name in given:
                raise InputError(f"{name}: only with model = Newmark(strength={strength!r})")
    if chosen is None:
        return
    if "residual_mu" in given and "residual_phi" in given:
        raise InputError(
            "residual_phi, residual_mu: must not both be given; residual_mu = tan(residual_phi)"
        )
    replaced = ("residual_mu",) if "residual_phi" in given else ()
    needed = [name for name in known.STRENGTH_INPUTS[chosen] if name not in replaced]
    for name in needed:
        if name not in given:
            raise InputError(f"{name}: must be given with strength = {chosen!r}")
    for name in ("yield_acceleration", "yield_coefficient", "upslope_yield_acceleration"):
        if name in given:
            raise InputError(
                f"{name}: not allowed with strength = {chosen!r}, which follows from theta and "
                "friction; for a yield coefficient give theta = 0 and mu_s"
            )


def _polarity(given: Any) -> xr.Variable:
    """The signs asked for: 1, -1, both."""
    values = np.empty(0)
    with suppress(InputError):
        values = parameters.check_numbers(
            "polarity", (1, -1) if isinstance(given, str) and given == "both" else given
        )
    if values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(
            f"polarity = {parameters.shown(given)}: must be 1, -1, a list of these, or 'both'"
        )
    return xr.Variable(
        ("polarity",) * values.ndim, values.astype(np.int8), known.PARAMETERS["polarity"]
    )


def _motion_coordinates(suite: Suite, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The labels of a suite and its intensity measures: coordinates along `motion`, of pairs also along the azimuth."""
    about = known.MOTION_COORDINATES
    found = {
        "motion": xr.Variable("motion", np.array(suite.labels), {"long_name": "recorded motion"})
    }
    found |= {name: xr.Variable("motion", one, about[name]) for name, one in suite.measures.items()}
    if suite.has_pairs:
        both = {
            "azimuth": coords["azimuth"],
            "motion": xr.Variable("motion", np.arange(len(suite))),
        }
        sizes = grid_sizes(both)
        azimuths, places = (one.set_dims(sizes).values for one in both.values())
        measures = suite.intensities(places, azimuths)
        found |= {
            name: xr.Variable(tuple(sizes), one, about[name]) for name, one in measures.items()
        }
    return found


def _check_moving(motion: Record | Suite, coords: Mapping[str, xr.Variable], strength: str) -> None:
    """Refuse to scale a motion that has no acceleration."""
    peaks = xr.Variable((), motion.peak) if isinstance(motion, Record) else coords["motion_pga"]
    for place in np.argwhere(~(peaks.values > 0.0))[:1]:
        at = dict(zip(peaks.dims, place, strict=True))
        name = motion.name if isinstance(motion, Record) else motion.labels[at["motion"]]
        if "azimuth" in coords:
            name += f" at azimuth {float(coords['azimuth'].isel(at, missing_dims='ignore')):g}"
        raise InputError(f"{strength}: {name} has no acceleration to scale; give scale")


def checked(given: Mapping[str, Any], g: float) -> dict[str, xr.Variable]:
    """Every parameter as a float64 array with named dimensions, within its bounds, described.

    `g` is what "g" as the unit of an array stands for.  With an angle there is its tangent, too.
    """
    checked = {}
    for name, one in given.items():
        values = parameters.check_values(name, one, g=g)
        attrs = known.PARAMETERS[name]
        dims = (name,) * values.ndim
        if isinstance(one, (xr.Variable, xr.DataArray)):
            dims = tuple(map(str, one.dims))
            attrs = {**one.attrs, **attrs}
            if len({*dims}) < len(dims):
                raise InputError(f"{name}: dimensions {', '.join(dims)}: must be named each once")
        elif values.ndim > 1:
            raise InputError(
                f"{name}: an array of {values.ndim} dimensions; must be a scalar, a 1-D array, or a DataArray "
                "that names its dimensions"
            )
        if values.size == 0:
            raise InputError(f"{name} = []: must hold at least one value")
        checked[name] = xr.Variable(dims, values, attrs)
        if name in known.ANGLES:
            tangent = known.ANGLES[name]
            checked[tangent] = xr.Variable(
                dims, parameters.friction_coefficient(values), known.PARAMETERS[tangent]
            )
    return checked


def grid_sizes(variables: Mapping[str, xr.Variable]) -> dict[str, int]:
    """Dimensions of the grid in the order of the results, and their lengths."""
    sizes: dict[str, int] = {}
    for name, variable in variables.items():
        for dim, size in zip(map(str, variable.dims), variable.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise InputError(
                    f"{name}: {size} values along {dim!r}, where another parameter has {sizes[dim]}"
                )
    order = [*dict.fromkeys((*known.DIMENSION_ORDER, *sizes))]
    return {dim: sizes[dim] for dim in order if dim in sizes}


def inputs_of(problem: Problem, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The coordinates that cells are solved for: no friction angle; of a motion its place in the suite, and no more."""
    own = {
        name: one
        for name, one in coords.items()
        if name not in (*known.ANGLES, *known.MOTION_COORDINATES)
    }
    suite = problem.excitation
    if not isinstance(suite, Suite):
        return own
    places = np.array([suite.index(str(label)) for label in coords["motion"].values], np.float64)
    return own | {"motion": xr.Variable(("motion",), places)}
