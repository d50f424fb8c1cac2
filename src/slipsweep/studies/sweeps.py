"""`sweep` and `friction_parameters`: parameters in, an xarray.Dataset out."""

import functools
import inspect
import itertools
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np
import xarray as xr
from xarray.indexes import PandasMultiIndex

from slipsweep.errors import InputError
from slipsweep.grid.inputs import Inputs, given_inputs
from slipsweep.grid.plans import Plan, plan_friction_parameters, plan_sweep
from slipsweep.model.choices import declared
from slipsweep.model.docstrings import with_parameters
from slipsweep.model.options import MODELS, SOLVERS, Model, Solver
from slipsweep.model.parameters import shown
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

Function = TypeVar("Function", bound=Callable[..., Any])

#: Types of a parameter, of `polarity`, and of the motion of the base.
Values = float | Sequence[float] | np.ndarray | xr.DataArray
Signs = int | Sequence[int] | str
Excitation = Waveform | Record | Suite | str


def naming_choices(function: Function) -> Function:
    """Decorate a function: explain where an option of a choice goes that was passed to it.

    For example ``cycles=5`` belongs into ``excitation=Sine(cycles=5)`` (TypeError).
    """
    accepted = inspect.signature(function).parameters

    @functools.wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        for name, family in itertools.product(options, (WAVEFORMS, MODELS, SOLVERS)):
            if name not in accepted and name in family.options:
                owner = next(
                    choice
                    for choice in family.choices
                    if name in {option.name for option in declared(choice)}
                )
                raise TypeError(
                    f"{function.__name__}() has no argument {name!r}: give "
                    f"{family.keyword}={owner.__name__}({name}={shown(options[name])})"
                )
        return function(*arguments, **options)

    return cast(Function, call)


@naming_choices
@with_parameters
def sweep(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    excitation: Excitation = "sine",
    model: Model | str = "mendez",
    solver: Solver | str = "auto",
    phi: Values | None = None,
    displacement_amplitude: Values | None = None,
    yield_acceleration: Values | None = None,
    yield_coefficient: Values | None = None,
    upslope_yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    residual_mu: Values | None = None,
    residual_phi: Values | None = None,
    weakening_distance: Values | None = None,
    fast_mu: Values | None = None,
    rate_constant: Values | None = None,
    structure_frequency: Values | None = None,
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: Signs | None = None,
    azimuth: Values | None = None,
    variables: Sequence[str] | None = None,
    chunks: Any = None,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Response of a sliding block over a grid of parameters.

    The model is that of Mendez, Romo and Botero [1]_, or Newmark's block.  A scalar becomes a
    scalar coordinate, a 1-D array a dimension of the parameter's own name; the grid is the outer
    product of all of them.  A DataArray keeps its dimensions, so that several on one shared
    dimension are combined value by value, not crossed.

    Parameters
    ----------
    variables : sequence of str, optional
        Results to compute: `permanent_displacement`, `peak_relative_velocity`, `sliding_mode`,
        `validity` (these by default), `newmark_displacement` (of Newmark's block on the same cells,
        with the same yield acceleration), the parameters of Eqs. 7-11, and `amplitude`.  With
        ``Newmark(sliding="both")`` also `largest_displacement` and `smallest_displacement`, the
        extremes of u over time (m; by default, too), and `clearance`, their difference.  Under a
        record `sliding_mode` gives way to `number_of_slips` (that begin at rest),
        `stick_slip_pulses` and `continuous_pulses` (by Eq. 7 with each pulse's own peak: an
        extension of the paper's harmonic motion), the parameters and `amplitude` to
        `motion_factor`, by which the recorded acceleration is multiplied (under a suite by default,
        too).
    chunks : int, tuple, dict or "auto", optional
        Chunks as dask takes them; the result is then lazy.  Do not divide the frequency.
    progress : callable, optional
        Called with the number of cells just finished, from any thread; not with `chunks`.

    Returns
    -------
    Dataset
        Dimensions theta, mu_s, amplitude, frequency, then others, `motion` last.  The parameters of
        Eqs. 7-11 do not vary with frequency and have no such dimension.  With
        `displacement_amplitude` the result has A as a coordinate, except if it and `frequency` span
        a grid: there A is a result, for `variables`.  A suite has its labels as
        `motion`, and the file and the intensity measures of each motion, as it was recorded, as
        coordinates along it (``motion_pga`` and others: `slipsweep.motion.intensity`).

    Raises
    ------
    InputError
        A physically impossible value, an unknown option, a grid that memory cannot hold.  A result
        that double precision does not hold (of inputs near their bounds) is refused when it is
        computed: with `chunks`, later.

    See Also
    --------
    simulate : time history of one block
    limit_amplitude : the amplitude at which a displacement is reached
    sample : statistics under uncertain inputs
    flags : the flags in `validity`

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on
       frictional interfaces under harmonic loading", Soil Dynamics and Earthquake Engineering 32,
       152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=[0, 5], mu_s=0.4, amplitude=[2.0, 4.0, 6.0], frequency=2.0)
    >>> result.permanent_displacement.dims
    ('theta', 'amplitude')
    >>> result.permanent_displacement.round(3).values
    array([[0.   , 0.   , 0.222],
           [0.   , 0.081, 0.445]])
    """
    inputs = given_inputs(locals())
    plan = plan_sweep(
        inputs, excitation=excitation, model=model, solver=solver, variables=variables
    )
    results = plan.solve(progress) if chunks is None else _lazy(plan, chunks)
    return results.assign_coords(brought_coordinates(inputs, plan.coords, plan.names))


@with_parameters
def friction_parameters(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    *,
    model: Model | str = "mendez",
    phi: Values | None = None,
    yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
) -> xr.Dataset:
    """Friction parameters of the model over a grid: those of Eqs. 7-11 of the paper, and λ.

    The paper is reference [1] of `sweep`.

    Returns
    -------
    Dataset
        `yield_acceleration`, `limiting_acceleration` (m/s²), `acceleration_ratio`,
        `minimum_friction`, `delta_mu`, `decay_rate`, `sliding_mode`, and the part of `validity`
        that is known before the motion.  A parameter that was given is a coordinate.

    Raises
    ------
    InputError
        A value that no physics allows.

    See Also
    --------
    sweep : the displacements that follow from them
    calibrate : measured ones, from a test on a shaking table

    Examples
    --------
    The stick-slip test of the paper's Table 1:

    >>> import slipsweep
    >>> results = slipsweep.friction_parameters(5, 0.38, 3.55, yield_acceleration=0.59)
    >>> results.limiting_acceleration.round(2).item()  # m/s2
    4.43
    >>> results.acceleration_ratio.round(2).item()
    0.8
    >>> slipsweep.SlidingMode(results.sliding_mode.item()).name
    'STICK_SLIP'
    """
    inputs = given_inputs(locals())
    plan = plan_friction_parameters(inputs, model=model)
    return plan.solve().assign_coords(brought_coordinates(inputs, plan.coords, plan.names))


def brought_coordinates(
    inputs: Inputs, coords: Mapping[str, xr.Variable], results: Collection[str]
) -> dict[Hashable, xr.Variable]:
    """Return the coordinates of DataArrays among the parameters, which must agree (InputError)."""
    brought: dict[Hashable, xr.Variable] = {}
    dims = {dim for variable in coords.values() for dim in variable.dims}
    for parameter, array in inputs.items():
        if not isinstance(array, xr.DataArray):
            continue
        # levels of stacked coordinates come along; their tuples, which no file can hold, do not
        stacked = [
            dim for dim in array.dims if isinstance(array.xindexes.get(dim), PandasMultiIndex)
        ]
        for name, coordinate in array.reset_index(stacked).coords.items():
            variable = coordinate.variable.to_base_variable()
            other = brought.get(name)
            # a parameter of that name is the coordinate, and labels the dimension of that name
            if name in array.dims and name in coords and name != parameter:
                other = coords[str(name)]
            if other is not None and not other.equals(variable):
                raise InputError(
                    f"{parameter}: its coordinate {name!r} differs from that of another parameter"
                )
            if name in results:
                raise InputError(
                    f"{parameter}: its coordinate {name!r} has the name of a result: must have "
                    "another"
                )
            if name in dims and name not in coords and name not in variable.dims:
                raise InputError(
                    f"{parameter}: its coordinate {name!r} has the name of a dimension: must have "
                    "another"
                )
            brought[name] = variable
    return {name: variable for name, variable in brought.items() if name not in coords}


def _lazy(plan: Plan, chunks: Any) -> xr.Dataset:
    """Return the results as dask arrays; "auto" does not cut the frequency, which costs little."""
    from dask.array.core import normalize_chunks

    dims = ", ".join(plan.sizes)
    requested = chunks
    if isinstance(chunks, str) and chunks == "auto":
        requested = dict.fromkeys(plan.sizes, "auto") | {"frequency": -1}
    if isinstance(requested, Mapping):
        for dim in {*requested} - {*plan.sizes, "frequency"}:
            raise InputError(
                f"chunks = {shown(chunks)}: {dim!r} is not a dimension; they are {dims}"
            )
        requested = tuple(requested.get(dim, -1) for dim in plan.sizes)
    try:
        lengths = normalize_chunks(requested, tuple(plan.sizes.values()), dtype=np.dtype("f8"))
        if (isinstance(chunks, int) and chunks == 0) or any(
            length <= 0 for of_dim in lengths for length in of_dim
        ):
            raise ValueError
    except (TypeError, ValueError, ArithmeticError, AttributeError, LookupError):
        raise InputError(
            f"chunks = {shown(chunks)}: must be whole numbers > 0 along {dims}"
        ) from None
    return plan.lazy(dict(zip(plan.sizes, lengths, strict=True)))
