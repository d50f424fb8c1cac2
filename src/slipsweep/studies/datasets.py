"""The public functions: parameters as scalars, axes or DataArrays in, an xarray.Dataset out.

A thin translation over `slipsweep.grid.plans` and `slipsweep.studies.history`: coordinates that came
with DataArrays are kept, and `chunks` makes a dask graph of a plan's tasks.
"""

import functools
import inspect
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from numbers import Integral
from typing import Any, TypeVar, cast

import numpy as np
import xarray as xr
from xarray.indexes import PandasMultiIndex

from slipsweep.errors import InputError
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import Plan, plan_friction_parameters, plan_sweep
from slipsweep.model.choices import declared
from slipsweep.model.options import MODELS, SOLVERS, Model, Solver
from slipsweep.model.parameters import shown
from slipsweep.model.variables import STATISTIC_COORDINATES, STATISTICS
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform
from slipsweep.studies.history import time_history
from slipsweep.studies.limits import AMPLITUDE_STEPS, plan_limits

Function = TypeVar("Function", bound=Callable[..., Any])


def _named(function: Function) -> Function:
    """Say of an option of the shaking, the model or the solver that was given to the function itself where it goes."""
    known = inspect.signature(function).parameters

    @functools.wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        for name, value in options.items():
            for family in (WAVEFORMS, MODELS, SOLVERS):
                if name not in known and name in family.options:
                    owner = next(one for one in family.choices if name in {f.name for f in declared(one)})
                    raise TypeError(
                        f"{function.__name__}() has no argument {name!r}: give "
                        f"{family.keyword}={owner.__name__}({name}={shown(value)})"
                    )
        return function(*arguments, **options)

    return cast(Function, call)


#: What a caller may give for a parameter.
Values = float | Sequence[float] | np.ndarray | xr.DataArray


@_named
def sweep(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    phi: Values | None = None,
    excitation: Waveform | Record | Suite | str = "sine",
    model: Model | str = "mendez",
    solver: Solver | str = "auto",
    displacement_amplitude: Values | None = None,
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: int | Sequence[int] | str | None = None,
    azimuth: Values | None = None,
    yield_acceleration: Values | None = None,
    yield_coefficient: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    structure_frequency: Values | None = None,
    variables: Sequence[str] | None = None,
    chunks: Any = None,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Response of a sliding block over a grid of parameters.

    The model is that of Mendez, Romo and Botero [1]_, or Newmark's block.

    A scalar becomes a scalar coordinate, a 1-D array a dimension of the parameter's own
    name; the grid is the outer product of all of them.  A DataArray keeps its dimensions,
    so that several on one shared dimension are combined value by value, not crossed.

    Parameters
    ----------
    theta : float, array or DataArray
        Inclination of the base, degrees, 0 ≤ θ < 90.
    mu_s : float, array or DataArray
        Static friction coefficient, > 0.
    amplitude : float, array or DataArray
        Peak ground acceleration A, m/s², ≥ 0; a record, or every motion of a suite, is scaled to it.
    frequency : float, array or DataArray
        Excitation frequency, Hz, > 0; not with a record.
    phi : float, array or DataArray, optional
        Friction angle, degrees, instead of `mu_s` = tan φ.
    excitation : Sine, Cosine, Triangle, Square, Harmonics, Record, Suite or str
        Motion of the base; "sine", "cosine", "triangle" and "square" are ten cycles without ramps.  All that is written
        about a record below holds for each motion of a suite.
    model : Mendez, Newmark or str
        The paper's friction law, or the classical rigid block; "mendez", "newmark".
    solver : Cycle, Step or str
        Event by event, exact to rounding, or time stepping; "auto" takes "cycle".
    displacement_amplitude : float, array or DataArray
        Peak ground displacement d, m, instead of `amplitude`: A = (2πf)² d.  The result has A as a
        coordinate, except if d and `frequency` span a grid: there it is a result, for `variables`.
    scale : float, array or DataArray
        With a record: factor on its acceleration, > 0, instead of `amplitude`; by default 1.
    pgv, arias_intensity : float, array or DataArray
        With a record, instead of `amplitude`: peak ground velocity or Arias intensity (m/s) that it is scaled to, after
        `time_scale` has stretched it.
    time_scale : float, array or DataArray
        With a record: factor on its time, > 0; 2 makes it last twice as long.
    polarity : {1, -1}, list of these, or "both"
        With a record: 1, positive recorded acceleration drives the block downslope; -1, negative
        recorded acceleration does.
    azimuth : float, array or DataArray
        With a suite of pairs of components, of which it is needed: the direction of sliding, degrees from the first
        component towards the second, 0 to 360.
    yield_acceleration : float, array or DataArray, optional
        Üy, m/s²; by default Coulomb's, g tan(φs − θ).
    yield_coefficient : float, array or DataArray, optional
        ky = Üy/g of Newmark's block, instead of `theta`, `mu_s` and `yield_acceleration`.
    decay_rate, delta_mu, minimum_friction : float, array or DataArray, optional
        λ, Δμ and μmin where they are known; each replaces its estimate (Eqs. 6, 9-11), which under a
        record every pulse has from its own peak.
    structure_frequency : float, array or DataArray, optional
        Natural frequency of the sliding structure, Hz, for the `flexible_block` flag; not with a record.
    variables : sequence of str, optional
        Results to compute: `permanent_displacement`, `peak_relative_velocity`,
        `sliding_mode`, `validity` (these by default), `newmark_displacement` (of Newmark's block on the same cells,
        with the same yield acceleration), the parameters of Eqs. 7-11, and `amplitude`.  Under a record
        `permanent_displacement`, `peak_relative_velocity`, `number_of_slips` (that begin at rest),
        `stick_slip_pulses` and `continuous_pulses` (by Eq. 7 with each pulse's own peak: an extension of
        the paper's harmonic motion) and `validity`, these by default, `newmark_displacement`, and `motion_factor`, by
        which the recorded acceleration is multiplied (under a suite by default, too).
    chunks : int, tuple, dict or "auto", optional
        Chunks as dask takes them; the result is then lazy.  Do not divide the frequency.
    progress : callable, optional
        Called with the number of cells just finished, from any thread; not with `chunks`.

    Returns
    -------
    Dataset
        Dimensions theta, mu_s, amplitude, frequency, then others, `motion` last.  The parameters of
        Eqs. 7-11 do not vary with frequency and have no such dimension.  A suite has its labels as `motion`, and the
        file and the intensity measures of each motion, as it was recorded, as coordinates along it (``motion_pga``
        and others: `slipsweep.motion.intensity`).

    Raises
    ------
    InputError
        A physically impossible value, an unknown option, a grid that memory cannot hold.  A result that double
        precision does not hold (of inputs beyond 1e40, say) is refused when it is computed: with `chunks`, later.

    See Also
    --------
    simulate : time history of one block
    limit_amplitude : the amplitude at which a displacement is reached
    sample : statistics under uncertain inputs
    flags : the flags in `validity`

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
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
    inputs = Inputs(
        theta=theta,
        mu_s=mu_s,
        phi=phi,
        amplitude=amplitude,
        frequency=frequency,
        displacement_amplitude=displacement_amplitude,
        scale=scale,
        pgv=pgv,
        arias_intensity=arias_intensity,
        time_scale=time_scale,
        polarity=polarity,
        azimuth=azimuth,
        yield_acceleration=yield_acceleration,
        yield_coefficient=yield_coefficient,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        structure_frequency=structure_frequency,
    )
    plan = plan_sweep(inputs, excitation=excitation, model=model, solver=solver, variables=variables)
    brought = _brought(inputs, plan.coords, plan.names)
    return (plan.solve(progress) if chunks is None else _lazy(plan, chunks)).assign_coords(brought)


def friction_parameters(
    theta: Values,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    *,
    phi: Values | None = None,
    yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    model: Model | str = "mendez",
) -> xr.Dataset:
    """Friction parameters of the model over a grid.

    They are those of Eqs. 7-11 of the paper [1]_, and λ.

    Parameters
    ----------
    theta, mu_s, amplitude : float, array or DataArray
        Inclination (degrees), static friction coefficient and peak ground acceleration (m/s²), as in `sweep`.
    phi : float, array or DataArray, optional
        Friction angle, degrees, instead of `mu_s`.
    yield_acceleration, decay_rate, delta_mu, minimum_friction : float, array or DataArray, optional
        Those that are known, as in `sweep`; each replaces its estimate.
    model : Mendez, Newmark or str
        As in `sweep`.

    Returns
    -------
    Dataset
        `yield_acceleration`, `limiting_acceleration` (m/s²), `acceleration_ratio`,
        `minimum_friction`, `delta_mu`, `decay_rate`, `sliding_mode`, and the part of
        `validity` that is known before the motion.  A parameter that was given is a coordinate.

    Raises
    ------
    InputError
        A value that no physics allows.

    See Also
    --------
    sweep : the displacements that follow from them
    calibrate : measured ones, from a test on a shaking table

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    The stick-slip test of the paper's Table 1:

    >>> import slipsweep
    >>> found = slipsweep.friction_parameters(theta=5, mu_s=0.38, amplitude=3.55, yield_acceleration=0.59)
    >>> print(f"{found.limiting_acceleration.item():.2f} m/s2, {found.acceleration_ratio.item():.2f}")
    4.43 m/s2, 0.80
    >>> slipsweep.SlidingMode(found.sliding_mode.item()).name
    'STICK_SLIP'
    """
    inputs = Inputs(
        theta=theta,
        mu_s=mu_s,
        phi=phi,
        amplitude=amplitude,
        yield_acceleration=yield_acceleration,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
    )
    plan = plan_friction_parameters(inputs, model=model)
    brought = _brought(inputs, plan.coords, plan.names)
    return plan.solve().assign_coords(brought)


@_named
def simulate(
    theta: float | None = None,
    mu_s: float | None = None,
    amplitude: float | None = None,
    frequency: float | None = None,
    *,
    phi: float | None = None,
    excitation: Waveform | Record | Suite | str = "sine",
    model: Model | str = "mendez",
    times: Sequence[float] | np.ndarray | None = None,
    points_per_cycle: int | None = None,
    displacement_amplitude: float | None = None,
    scale: float | None = None,
    pgv: float | None = None,
    arias_intensity: float | None = None,
    time_scale: float | None = None,
    polarity: int | None = None,
    yield_acceleration: float | None = None,
    yield_coefficient: float | None = None,
    decay_rate: float | None = None,
    delta_mu: float | None = None,
    minimum_friction: float | None = None,
    structure_frequency: float | None = None,
) -> xr.Dataset:
    """Time history of one block, event by event: the samples carry rounding errors only.

    Parameters
    ----------
    theta, mu_s, amplitude, frequency : float
        One case; these and the remaining parameters as in `slipsweep.sweep`, but that of a suite one motion is taken:
        ``excitation=suite["label"]``, of a pair ``suite["label"].rotated(azimuth)``.
    times : array, optional
        Times to sample, s, increasing, and not negative under a waveform; by default `points_per_cycle` a
        cycle, from 0 to the end of the shaking, or the times of a record's samples; and on until the block has
        come to rest, if that is later.  A slide that lasts long after the shaking has as many points as 100 cycles
        have (after a record 20 000, or as many as it has samples), evenly spaced.
    points_per_cycle : int, optional
        Samples a cycle where `times` is not given, 512 by default; not with a record.

    Returns
    -------
    Dataset
        Along `time` (s): `ground_acceleration`, `block_acceleration` (m/s²),
        `friction_coefficient` (what Eq. 1 gives for the two; not with `yield_coefficient`), `relative_velocity` (m/s)
        and `relative_displacement` (m); and the results of `sweep` for the case.  Where the base's acceleration
        jumps, as at the end of a record, the values are those after the jump.  NaN where
        the case has no value (`validity`).

    Raises
    ------
    InputError
        As `sweep`; or times that are not increasing.

    See Also
    --------
    sweep : many blocks, without their histories

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    The stick-slip test of the paper [1]_, with its printed λ:

    >>> import slipsweep
    >>> history = slipsweep.simulate(
    ...     5, 0.38, 3.55, 1.8, yield_acceleration=0.59, decay_rate=2.7, excitation=slipsweep.Sine(cycles=5)
    ... )
    >>> print(f"{history.permanent_displacement.item() * 1000:.0f} mm after {history.time.values[-1]:.2f} s")
    331 mm after 2.78 s
    """
    inputs = Inputs(
        theta=theta,
        mu_s=mu_s,
        phi=phi,
        amplitude=amplitude,
        frequency=frequency,
        displacement_amplitude=displacement_amplitude,
        scale=scale,
        pgv=pgv,
        arias_intensity=arias_intensity,
        time_scale=time_scale,
        polarity=polarity,
        yield_acceleration=yield_acceleration,
        yield_coefficient=yield_coefficient,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        structure_frequency=structure_frequency,
    )
    return time_history(inputs, excitation=excitation, model=model, times=times, points_per_cycle=points_per_cycle)


@_named
def limit_amplitude(
    displacement: Values,
    theta: Values | None = None,
    mu_s: Values | None = None,
    frequency: Values | None = None,
    *,
    phi: Values | None = None,
    excitation: Waveform | Record | Suite | str = "sine",
    model: Model | str = "mendez",
    time_scale: Values | None = None,
    polarity: int | Sequence[int] | str | None = None,
    azimuth: Values | None = None,
    yield_acceleration: Values | None = None,
    yield_coefficient: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    structure_frequency: Values | None = None,
    maximum_amplitude: float | None = None,
    amplitude_steps: int = AMPLITUDE_STEPS,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Smallest amplitude at which the permanent displacement reaches a tolerable one.

    The inverse of `sweep`, exact to the last bit: `sweep` with the cycle solver gives at
    least `displacement` at the amplitude returned, and less (or no value) at the
    double-precision number before it.

    The displacement u(A) need not grow with A, jumps where the sliding mode changes, and has
    gaps where the model gives no value (`validity`), so that a displacement may be reached at
    several amplitudes, or passed in a jump.  The smallest is returned: the first step of a scan
    with ``u >= displacement`` holds it.  The scan runs from the yield acceleration to
    `maximum_amplitude` in `amplitude_steps` equal ratios, finer where it may hide a peak, and has
    both sides of the change of mode.  A peak narrower than a part of a step can be missed.  Under a
    record the amplitude is that peak ground acceleration to which it is scaled, and the scan has both
    sides of every amplitude at which one of its 128 highest pulses begins to count, or changes its mode.

    Parameters
    ----------
    displacement : float, array or DataArray
        Tolerable permanent displacement, m, > 0.
    theta, mu_s, frequency : float, array or DataArray
        These and the remaining parameters as in `slipsweep.sweep`; the solver is "cycle".  A record has no frequency,
        but a `time_scale`.
    maximum_amplitude : float, optional
        Where the search ends, m/s²; by default 5 g.
    amplitude_steps : int
        Steps of the scan, 2 or more.
    progress : callable, optional
        Called with the number of cells just finished.

    Returns
    -------
    Dataset
        Dimensions theta, mu_s, frequency, then others, displacement last:

        - `limit_amplitude`, m/s²; NaN where there is none.
        - `limit_status`: 0 reached, 1 at_mode_jump, 2 at_jump (u rises by more than 1e-6 of
          itself between neighbouring numbers, with and without a change of sliding mode),
          3 after_gap (no value just below), 4 not_reached, 5 invalid (no value anywhere).
        - `permanent_displacement`, m, and `sliding_mode` (under a record the counts of slips and pulses) at the
          limit; more than `displacement` where a discontinuity of the model sets the limit.
        - `validity` at the limit or, where there is none, at `maximum_amplitude`.

    Raises
    ------
    InputError
        As `sweep`; or a displacement or a maximum amplitude that is not positive.

    See Also
    --------
    sweep : the displacement at an amplitude
    displacement_hazard : the annual rate at which a displacement is exceeded

    Examples
    --------
    >>> import slipsweep
    >>> limits = slipsweep.limit_amplitude(0.05, theta=5, mu_s=0.4, frequency=[1, 2])
    >>> limits.limit_amplitude.round(3).values
    array([3.34 , 3.756])
    """
    inputs = Inputs(
        theta=theta,
        mu_s=mu_s,
        phi=phi,
        frequency=frequency,
        time_scale=time_scale,
        polarity=polarity,
        azimuth=azimuth,
        yield_acceleration=yield_acceleration,
        yield_coefficient=yield_coefficient,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        structure_frequency=structure_frequency,
    )
    plan = plan_limits(
        displacement,
        inputs,
        excitation=excitation,
        model=model,
        maximum_amplitude=maximum_amplitude,
        amplitude_steps=amplitude_steps,
    )
    brought = _brought(inputs, plan.coords, plan.names)
    return plan.solve(progress).assign_coords(brought)


@_named
def sample(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    phi: Values | None = None,
    uncertain: Mapping[str, Any],
    excitation: Waveform | Record | Suite | str = "sine",
    model: Model | str = "mendez",
    solver: Solver | str = "auto",
    samples: int = 4096,
    method: str = "sobol",
    seed: int = 0,
    quantiles: float | Sequence[float] | np.ndarray = (0.05, 0.5, 0.95),
    thresholds: float | str | Sequence[float | str] | np.ndarray = (0.01, 0.1, 1.0),
    correlation: Sequence[tuple[str, str, float]] = (),
    sensitivity: bool = False,
    over: str | Sequence[str] = (),
    displacement_amplitude: Values | None = None,
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: int | Sequence[int] | str | None = None,
    azimuth: Values | None = None,
    yield_acceleration: Values | None = None,
    yield_coefficient: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Quantiles and exceedance probabilities of the permanent displacement under uncertain inputs.

    Parameters span a grid as in `sweep`; at every grid point those in `uncertain` are drawn.  The
    draws are the same at all grid points.

    Parameters
    ----------
    theta, mu_s, amplitude, frequency : float, array or DataArray
        As in `sweep`.  One that is drawn with ``kind="absolute"`` must not be given.
    uncertain : mapping of str to mapping or frozen distribution
        For any of `theta`, `mu_s`, `amplitude`, `displacement_amplitude`, `frequency`, `scale`, `time_scale`,
        `yield_acceleration`, `decay_rate`, `delta_mu` and `minimum_friction` either a frozen
        distribution of scipy.stats, or a mapping with

        - ``distribution``: the name of a continuous distribution of scipy.stats (or a frozen one),
          whose shape parameters, ``loc`` and ``scale`` are further keys;
        - ``kind``: "absolute" (a draw is the value; by default), "factor" (it multiplies the value
          at the grid point or, for the last four, the estimate; under a record for the yield acceleration only) or
          "offset" (it is added to it);
        - ``units``: of the draws, if not the parameter's own; not with factors.
    samples : int
        Samples a grid point; a power of 2 for Sobol's.
    method : {"sobol", "latin_hypercube", "random"}
        Scrambled Sobol sequence, Latin hypercube (scipy.stats.qmc) or pseudo-random numbers.
    seed : int
        The same seed gives the same draws.
    quantiles : float or array
        Increasing, between 0 and 1.
    thresholds : float, str or list of these
        Increasing displacements, m or with a unit ("50mm"), ≥ 0.
    correlation : list of (str, str, float)
        Pairs of drawn parameters and the correlation of their normal scores (a Gaussian copula).
    sensitivity : bool
        Compute Sobol indices [1]_ of the displacement, too: from ``samples * (k + 2)`` further runs a grid point, of k
        inputs.
    over : str or list of str
        Dimensions of the grid, such as ``["motion", "polarity"]`` of a suite, whose values are equally likely draws
        beside the uncertain inputs: each meets all samples, statistics are over all of them together, and the result
        does not have these dimensions.  By default there are none: a suite has statistics for each motion.  Not with
        `sensitivity`, nor a dimension of `frequency` or `time_scale`.
    yield_acceleration, decay_rate, delta_mu, minimum_friction : float, array or DataArray, optional
        These and the remaining parameters as in `sweep`.
    progress : callable, optional
        Called with the number of samples just solved, from any thread.

    Returns
    -------
    Dataset
        Over the grid:

        - `displacement_quantile` (m), dimension `quantile`, `mean_displacement` (m) and
          `exceedance_probability`, dimension `threshold` (m): P(u > threshold).  They are of the
          samples that have a value; NaN where none has.  Statically unstable samples have no value, and are counted
          as exceeding every threshold.
        - `mode_share`, dimension `mode`, `flag_share`, dimension `flag`, and `valueless_share`: of
          all samples, how many slide in which mode, have which flag, and have no value.  They do not
          depend on the frequency (of a record: the time scale) and have no such dimension (but with
          `displacement_amplitude`).  Under a record there is no `mode_share`.
        - with `sensitivity`, `first_order_index` and `total_index`, dimension `input`: the part of the
          variance of the displacement that an input makes by itself, and with all that depends on it.
          `first_order_interval` and `total_interval` are their 95 % intervals (dimension `bound`), by a bootstrap.
          Inputs that are correlated count as one, named as in "decay_rate+delta_mu".  There are none (NaN) where
          `sensitivity_status` is 1 (all runs have the same displacement) or 2 (a run has no value).  They lack the
          frequency as shares do.

        How the inputs were drawn is in the attributes.

    Raises
    ------
    InputError
        As `sweep`; a distribution that is not in scipy.stats, or physically impossible draws.

    See Also
    --------
    sweep : the displacements of known inputs
    suite_statistics : statistics over recorded motions

    References
    ----------
    .. [1] A. Saltelli et al. (2010), "Variance based sensitivity analysis of model output", Computer Physics
       Communications 181, 259-270, https://doi.org/10.1016/j.cpc.2009.09.018

    Examples
    --------
    >>> import slipsweep
    >>> friction = {"distribution": "lognorm", "s": 0.1, "scale": 0.4}
    >>> result = slipsweep.sample(
    ...     theta=5, amplitude=[3.0, 5.0], frequency=2.0, uncertain={"mu_s": friction}, samples=1024
    ... )
    >>> result.exceedance_probability.sel(threshold=0.1).round(2).values
    array([0.  , 0.97])
    >>> result.displacement_quantile.sel(quantile=0.5).round(3).values
    array([0.   , 0.265])
    """
    from slipsweep.studies.sampling import check_sampling
    from slipsweep.studies.uncertainty import plan_samples

    inputs = Inputs(
        theta=theta,
        mu_s=mu_s,
        phi=phi,
        amplitude=amplitude,
        frequency=frequency,
        displacement_amplitude=displacement_amplitude,
        scale=scale,
        pgv=pgv,
        arias_intensity=arias_intensity,
        time_scale=time_scale,
        polarity=polarity,
        azimuth=azimuth,
        yield_acceleration=yield_acceleration,
        yield_coefficient=yield_coefficient,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
    )
    sampling = check_sampling(
        uncertain,
        samples=samples,
        method=method,
        seed=seed,
        quantiles=quantiles,
        thresholds=thresholds,
        correlation=correlation,
        sensitivity=sensitivity,
        over=over,
        g=MODELS.of(model).g,
    )
    plan = plan_samples(sampling, inputs, excitation=excitation, model=model, solver=solver)
    brought = _brought(inputs, plan.coords, {*STATISTICS, *STATISTIC_COORDINATES})
    kept = {name: one for name, one in brought.items() if not {*sampling.over} & {*one.dims}}
    return plan.solve(progress).assign_coords(kept)


def _brought(
    inputs: Inputs, coords: Mapping[str, xr.Variable], results: Collection[str]
) -> dict[Hashable, xr.Variable]:
    """Coordinates that the DataArrays among the parameters brought along; they must agree.

    The levels of stacked coordinates come along as coordinates of their own; their tuples, which the levels
    say again and no file can hold, do not.
    """
    brought: dict[Hashable, xr.Variable] = {}
    dims = {dim for variable in coords.values() for dim in variable.dims}
    for parameter, array in inputs.given.items():
        if not isinstance(array, xr.DataArray):
            continue
        stacked = [name for name, index in array.xindexes.items() if isinstance(index, PandasMultiIndex)]
        for name, coordinate in array.coords.items():
            if name in stacked and name in array.dims:
                continue
            variable = coordinate.variable.to_base_variable()
            known = brought.get(name)
            # a parameter of that name is the coordinate, and labels the dimension of that name
            if name in array.dims and name in coords and name != parameter:
                known = xr.Variable(coords[str(name)].dims, coords[str(name)].values)
            if known is not None and not known.equals(variable):
                raise InputError(f"{parameter}: its coordinate {name!r} differs from that of another parameter")
            if name in results:
                raise InputError(f"{parameter}: its coordinate {name!r} has the name of a result: must have another")
            if name in dims and name not in coords and name not in variable.dims:
                raise InputError(f"{parameter}: its coordinate {name!r} has the name of a dimension: must have another")
            brought[name] = variable
    return {name: variable for name, variable in brought.items() if name not in coords}


def _lazy(plan: Plan, chunks: Any) -> xr.Dataset:
    """The results as dask arrays."""
    from slipsweep.grid.graph import lazy_dataset

    return lazy_dataset(plan, _chunk_lengths(chunks, plan.sizes))


def _chunk_lengths(chunks: Any, sizes: Mapping[str, int]) -> dict[str, tuple[int, ...]]:
    """Chunk lengths along every dimension; "auto" leaves frequency, which costs next to nothing, whole."""
    from dask.array.core import normalize_chunks

    if isinstance(chunks, Integral) and chunks <= 0 and chunks != -1:
        raise InputError(f"chunks = {shown(chunks)}: must be whole numbers > 0")
    asked = dict.fromkeys(sizes, "auto") | {"frequency": -1} if isinstance(chunks, str) and chunks == "auto" else chunks
    if isinstance(asked, Mapping):
        unknown = [dim for dim in asked if dim not in sizes and dim != "frequency"]
        if unknown:
            raise InputError(
                f"chunks = {shown(chunks)}: {unknown[0]!r} is not a dimension; they are {', '.join(sizes)}"
            )
        asked = tuple(asked.get(dim, -1) for dim in sizes)
    try:
        normal: tuple[tuple[int, ...], ...] = normalize_chunks(asked, tuple(sizes.values()), dtype=np.dtype("f8"))
    except (TypeError, ValueError, ArithmeticError, AttributeError, LookupError) as error:
        raise InputError(f"chunks = {shown(chunks)}: {' '.join(str(error).split())}") from None
    for lengths, size in zip(normal, sizes.values(), strict=True):
        if sum(lengths) != size or not all(isinstance(length, Integral) and length > 0 for length in lengths):
            raise InputError(
                f"chunks = {shown(chunks)}: must be whole numbers > 0 that make up {size} along a dimension"
            )
    return dict(zip(sizes, normal, strict=True))
