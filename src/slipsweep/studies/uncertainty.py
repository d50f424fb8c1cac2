"""Uncertain inputs: samples of a sweep's parameters, and the statistics of the displacement at every grid point.

Parameters are drawn once (`sampling`), and the same draws serve every grid point: curves over an axis are then as
smooth as the model, and differences between grid points are not blurred by sampling.  A draw is the parameter itself, a
factor on its value at the grid point, or an offset to it.  u = W/ω²: where the samples do not depend on the frequency
they are solved once for all frequencies; under a record the inverse of the time scale takes its place.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import chunks, engine, plans, resources, tally
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.problem import Problem
from slipsweep.model import options, parameters, variables
from slipsweep.motion.waveforms import Waveform
from slipsweep.studies import datasets, sample_statistics
from slipsweep.studies.datasets import Values
from slipsweep.studies.sampling import ESTIMATED, Sampling, Thresholds, check_draws, check_sampling

Floats = NDArray[np.float64]
Arrays = Mapping[str, NDArray[Any]]

#: Samples solved together: 30 MB, yet enough to keep the kernels busy.
_CELLS = 1_000_000

#: The dimension of the draws; no result has it.
_DRAW = "draw of the uncertain inputs"

TITLE = "Permanent displacement of a rigid block under uncertain inputs"


@datasets.naming_choices
def sample(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    phi: Values | None = None,
    uncertain: Mapping[str, Any],
    excitation: datasets.Excitation = "sine",
    model: options.Model | str = "mendez",
    solver: options.Solver | str = "auto",
    samples: int = 4096,
    method: str = "sobol",
    seed: int = 0,
    quantiles: float | Sequence[float] | np.ndarray = (0.05, 0.5, 0.95),
    thresholds: Thresholds = (0.01, 0.1, 1.0),
    correlation: Sequence[tuple[str, str, float]] = (),
    sensitivity: bool = False,
    over: str | Sequence[str] = (),
    displacement_amplitude: Values | None = None,
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: datasets.Signs | None = None,
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
        Compute Sobol indices [1]_ of the displacement, too: from ``samples * (k + 2)`` runs a grid point, of k inputs,
        the samples among them.
    over : str or list of str
        Dimensions of the grid, such as ``["motion", "polarity"]`` of a suite, whose values are equally likely draws:
        each meets all samples, statistics are over all of them together, and the result does not have these dimensions.
        By default there are none: a suite has statistics for each motion.  Not with `sensitivity`, nor a dimension of
        `frequency` or `time_scale`.
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
    inputs = Inputs(
        theta=theta, mu_s=mu_s, phi=phi, amplitude=amplitude, frequency=frequency,
        displacement_amplitude=displacement_amplitude, scale=scale, pgv=pgv, arias_intensity=arias_intensity,
        time_scale=time_scale, polarity=polarity, azimuth=azimuth, yield_acceleration=yield_acceleration,
        yield_coefficient=yield_coefficient, decay_rate=decay_rate, delta_mu=delta_mu,
        minimum_friction=minimum_friction,
    )  # fmt: skip
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
        g=options.MODELS.of(model).g,
    )
    plan = plan_samples(sampling, inputs, excitation=excitation, model=model, solver=solver)
    coords = datasets.brought_coordinates(
        inputs, plan.coords, {*variables.STATISTICS, *variables.STATISTIC_COORDINATES}
    )
    kept = {name: one for name, one in coords.items() if not {*sampling.over} & {*one.dims}}
    return plan.solve(progress).assign_coords(kept)


def plan_samples(
    sampling: Sampling, inputs: Inputs, *, excitation: Any = "sine", model: Any = "mendez", solver: Any = "auto"
) -> "SamplePlan":
    """Plan of the samples of a grid, drawn and checked.

    Parameters
    ----------
    sampling : Sampling
    inputs : Inputs
    excitation, model, solver
        As `plans.plan_sweep`.

    Raises
    ------
    InputError
        As `slipsweep.sample`.
    """
    # friction may be given, or drawn about, by its angle
    given = ["phi" if name == "mu_s" and inputs.phi is not None else name for name in inputs.given]
    if "structure_frequency" in given:
        raise InputError(
            "structure_frequency: not allowed with uncertain inputs: the displacement does not depend on it"
        )
    problem = plans.check_problem(excitation, model, solver)
    _check_drawn(sampling, given, problem)
    sampling.check_given(given)
    draws = sample_statistics.draws_of_runs(sampling)
    check_draws(sampling, draws, sampling.absolute, {})
    # what has no value of its own is planned for with one of its draws
    stand_ins = {name: float(draws[name][0]) for name in sampling.absolute}
    plan = plans.plan_sweep(
        inputs.but(stand_ins), excitation=excitation, model=model, solver=solver, variables=["permanent_displacement"]
    )
    dropped = {*stand_ins, *(["mu_s"] if "phi" in sampling.distributions else [])}
    if "displacement_amplitude" in plan.coords and {"displacement_amplitude", "frequency"} & dropped:
        dropped.add("amplitude")  # A = ω²d of the stand-ins is nobody's amplitude
    coords = {name: variable for name, variable in plan.coords.items() if name not in dropped}
    check_draws(sampling, draws, [name for name in sampling.distributions if name not in stand_ins], coords)
    kinds = {name: one.kind for name, one in sampling.distributions.items()}
    about = options.friction_inputs(problem.model.name, coords, kinds)
    attrs = {**plan.attrs, "title": TITLE, "friction_inputs": about, **sampling.attributes}
    if sampling.sensitivity:
        runs = f"{sampling.sensitivity_runs} runs; bootstrap of {sample_statistics.RESAMPLES}"
        attrs["sensitivity"] = f"Saltelli et al. (2010), {runs}"
    found = SamplePlan(sampling, draws, problem, coords, attrs)
    if sampling.over:
        attrs["pooled"] = resources.grid_text(found.pooled)
    return found


def _check_drawn(sampling: Sampling, given: Sequence[str], problem: Problem) -> None:
    """Refuse to draw what the model or the shaking does not have."""
    recorded = not isinstance(problem.excitation, Waveform)
    own = variables.RECORD_INPUTS if recorded else variables.WAVEFORM_INPUTS
    other = variables.WAVEFORM_INPUTS if recorded else variables.RECORD_INPUTS
    for name, one in sampling.distributions.items():
        friction_law = name in ("decay_rate", "delta_mu", "minimum_friction")
        if name in other and name not in own:
            raise InputError(f"{sampling.key(name)}: not allowed with {'a Record' if recorded else 'a waveform'}")
        if friction_law and isinstance(problem.model, options.Newmark):
            raise InputError(f"{sampling.key(name)}: not allowed with Newmark's block, which has no friction law")
        if friction_law and recorded and one.kind != "absolute" and name not in given:
            raise InputError(
                f'{sampling.key(name)}: kind = "{one.kind}" needs {name} given: under a record each pulse has an '
                "estimate of its own"
            )


class SamplePlan:
    """The samples of every grid point: cells along `solved` dimensions, frequencies along `scaled` ones.

    Along `pooled` dimensions all values meet all draws, and make up the samples of one grid point.

    A plan as all others are (`anyplan.AnyPlan`); its parts have the draws of the whole.  Under a record there is no
    sliding mode.
    """

    cell_memory = 0

    def __init__(
        self,
        sampling: Sampling,
        draws: dict[str, Floats],
        problem: Problem,
        coords: dict[str, xr.Variable],
        attrs: dict[str, Any],
    ) -> None:
        self.sampling, self.draws, self.problem = sampling, draws, problem
        self.coords, self.attrs = coords, attrs
        #: Results, and their dimensions in addition to those of the grid.
        self.results = sample_statistics.RESULTS | (
            sample_statistics.SENSITIVITY_RESULTS if sampling.sensitivity else {}
        )
        if not isinstance(problem.excitation, Waveform):
            self.results = {name: dims for name, dims in self.results.items() if name != "mode_share"}
        self.names = tuple(self.results)
        drawn = sampling.distributions
        self.clock = clock = "frequency" if isinstance(problem.excitation, Waveform) else "time_scale"
        inputs = plans.inputs_of(problem, coords)
        if {"phi"} <= coords.keys() & drawn.keys():
            inputs["phi"] = coords["phi"]
        if "displacement_amplitude" in {*inputs, *drawn}:
            inputs.pop("amplitude", None)  # A = ω²d
        sizes = plans.grid_sizes(inputs)
        plans.check_dimensions(sizes, coords, {*variables.STATISTICS, *variables.STATISTIC_COORDINATES})
        # strengths that change with the time, and f + offset, depend on the frequency itself: no scaling law then
        unscaled = {"displacement_amplitude", "pgv", "arias_intensity"} & {*coords, *drawn} or (
            clock in drawn and drawn[clock].kind == "offset"
        )
        own = plans.grid_sizes({name: one for name, one in inputs.items() if name != clock or unscaled})
        self.pooled = {dim: sizes[dim] for dim in self._pooled(sizes)}
        self.sizes = {dim: size for dim, size in sizes.items() if dim not in self.pooled}
        self.scaled = {dim: size for dim, size in self.sizes.items() if dim not in own}
        self.solved = {dim: size for dim, size in self.sizes.items() if dim in own}
        #: What displacements are divided by the square of; where it is not 1, cells are solved at 1.
        self.frequency = xr.Variable((), 1.0)
        if self.scaled:
            clocks = inputs.pop(clock)
            self.frequency = clocks if clock == "frequency" else 1.0 / clocks
            if clock not in drawn:
                inputs[clock] = xr.Variable((), 1.0)
        self.inputs = inputs
        #: Runs of a grid point, all draws with all that is pooled; and how many points are solved together.
        self.runs = max(map(len, draws.values())) * math.prod(self.pooled.values())
        self.points = max(_CELLS // self.runs, 1)
        # as in `anyplan.AnyPlan`
        self.cells = math.prod(self.solved.values()) * self.runs
        self.together = tuple(self.scaled)
        self.cost = max(1.0, plans.cost_of(problem) * self.runs / math.prod(self.scaled.values()))
        run = 24 * len(drawn) + self.points * (8 * (2 + len(drawn)) + 11)
        self.memory = self.runs * run + plans.memory_of(problem)
        if sampling.sensitivity:
            self.cost += sample_statistics.WORK
            self.memory += sample_statistics.memory_of_bootstrap(sampling)

    def _pooled(self, sizes: Mapping[str, int]) -> tuple[str, ...]:
        """The dimensions that are pooled (InputError: which cannot be)."""
        over, clock = self.sampling.over, self.coords.get(self.clock, xr.Variable((), 1.0))
        for dim in over:
            key = f"{self.sampling.keys}over = {parameters.shown(dim)}"
            if dim not in sizes:
                raise InputError(f"{key}: must be a dimension of the grid: {', '.join(sizes) or 'there is none'}")
            if dim in clock.dims:  # the samples of a grid point serve all its frequencies
                raise InputError(f"{key}: must not be a dimension of {self.clock}")
        return over

    def part(self, chunk: chunks.Chunk) -> "SamplePlan":
        """The plan cut to a chunk of its grid."""
        coords = {name: one.isel(chunk, missing_dims="ignore") for name, one in self.coords.items()}
        return SamplePlan(self.sampling, self.draws, self.problem, coords, self.attrs)

    def template(self) -> xr.Dataset:
        """The statistics with their dimensions and coordinates but no values: zeros that take no memory."""
        return self._dataset({name: np.zeros(()) for name in self.results})

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Solve the samples, a million at a time, and reduce them to what `slipsweep.sample` returns.

        Parameters
        ----------
        progress : callable, optional
            Called with a number of samples just solved, from any thread.
        """
        parameters.check_progress(progress)
        resources.check_memory(
            f"grid of {resources.grid_text(self.sizes) or 'one point'}, {self.runs} samples",
            self.memory + self.template().nbytes,
            "ask for fewer samples, grid points, quantiles or thresholds",
        )
        return self._dataset(self._reduced(progress))

    def _dataset(self, found: Arrays) -> xr.Dataset:
        """The results as a Dataset, of values that broadcast to (solved, scaled, own dimensions)."""
        own_coords = self._statistic_coords()
        lengths = {**self.sizes, **{name: one.size for name, one in own_coords.items()}}
        results = {}
        for name, own in self.results.items():
            dims = (*self.solved, *(self.scaled if name in sample_statistics.BY_FREQUENCY else ()), *own)
            shape = [lengths[dim] for dim in dims]
            filled = found[name].reshape(shape) if found[name].ndim else np.broadcast_to(found[name], shape)
            dtype = variables.RESULT_DTYPES.get(name, "float64")
            variable = xr.Variable(dims, filled.astype(dtype, copy=False), variables.STATISTICS[name])
            results[name] = variable.transpose(*(dim for dim in self.sizes if dim in dims), *own)
        coords = {name: one for name, one in self.coords.items() if not {*self.pooled} & {*one.dims}}
        return xr.Dataset(results, coords | own_coords, self.attrs)

    def _statistic_coords(self) -> dict[str, xr.Variable]:
        """Coordinates of the dimensions that the results have in addition to those of the grid."""
        values: dict[str, NDArray[Any]] = {
            "quantile": self.sampling.quantiles,
            "threshold": self.sampling.thresholds,
            "mode": np.array(sample_statistics.MODES, np.int8),
            "flag": np.array(variables.Validity, np.int16),
            "input": np.array(["+".join(one) for one in self.sampling.independent]),
            "bound": np.array(sample_statistics.ENDS),
        }
        own = {dim for dims in self.results.values() for dim in dims}
        about = variables.STATISTIC_COORDINATES
        return {dim: xr.Variable((dim,), one, about[dim]) for dim, one in values.items() if dim in own}

    def _reduced(self, progress: Callable[[int], None] | None) -> Arrays:
        """The results at all grid points, (solved, frequencies, own dimension)."""
        parts: list[Arrays] = []
        for chunk in chunks.grid_chunks(self.solved, self.points):
            solved = self._solve(chunk, progress)
            sizes = {dim: cut.stop - cut.start for dim, cut in chunks.places(chunk, self.solved).items()}
            rows = math.prod(sizes.values())
            values = {name: one.reshape(rows, -1) for name, one in solved.items()}
            frequency = self.frequency.isel(chunk, missing_dims="ignore").set_dims(sizes | self.scaled)
            found = sample_statistics.statistics_of_samples(self.sampling, values, frequency.values.reshape(rows, -1))
            if self.sampling.sensitivity:
                found |= sample_statistics.sobol_indices(self.sampling, values["permanent_displacement"])
            parts.append(found)
        # chunks follow one another in the order of the grid
        return {name: np.concatenate([part[name] for part in parts]) for name in self.results}

    def _solve(self, chunk: chunks.Chunk, progress: Callable[[int], None] | None) -> dict[str, NDArray[Any]]:
        """Displacement, mode and flags of a chunk, (solved, pooled, draw): a sweep with one more dimension."""
        inputs = {name: one.isel(chunk, missing_dims="ignore") for name, one in self.inputs.items()}
        sizes = {dim: cut.stop - cut.start for dim, cut in chunks.places(chunk, self.solved).items()}
        drawn = {name: xr.Variable((_DRAW,), draws) for name, draws in self.draws.items()}
        sizes |= self.pooled | {_DRAW: max(map(len, self.draws.values()))}
        about_estimates = {}
        for name, one in self.sampling.distributions.items():
            if name in inputs or one.kind == "absolute":
                inputs[name] = one.applied(inputs.get(name), drawn[name])
            elif name == self.clock:  # a factor on the frequencies that displacements are scaled to
                inputs[name] = drawn[name]
            else:
                about_estimates[name] = one
        if "phi" in inputs:
            angles = inputs.pop("phi")
            inputs["mu_s"] = angles.copy(data=np.tan(np.radians(angles.values)))
        arrays = plans.aligned(inputs, sizes)
        for name in ESTIMATED:
            if name in about_estimates:
                draws = plans.aligned({name: drawn[name]}, sizes)[name]
                arrays[name] = self._about_estimate(about_estimates[name], draws, arrays)
        modes = ("sliding_mode",) if "mode_share" in self.names else ()
        names = ("permanent_displacement", *modes, "validity")
        return engine.solve(engine.Request(self.problem, tuple(sizes.values()), arrays, names, progress))

    def _about_estimate(self, one: Any, draws: Floats, arrays: Mapping[str, Floats]) -> Floats:
        """A parameter drawn about its estimate; NaN, which leaves it to the estimate and its flag, where that fails."""
        name = one.parameter
        # Coulomb's yield acceleration depends on no shaking, which a record has of its own
        arrays = {"amplitude": np.zeros((1,) * draws.ndim), **arrays}
        shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
        estimate = engine.friction_parameters(engine.Request(self.problem, shape, arrays, (name,)), finite=False)[name]
        values = one.applied(estimate, draws)
        return np.where(parameters.BOUNDS[name].holds(values), values, np.nan)

    def tally(self, results: Mapping[str, NDArray[Any]]) -> tally.Tally:
        """Samples by sliding mode and by flag, from their shares; grid points by what moves the displacement."""
        indices = None
        if "sensitivity_status" in results:
            indices = tally.Indices.counted(
                self._statistic_coords()["input"].values.tolist(),
                *(results[name] for name in ("first_order_index", "total_index", "sensitivity_status")),
            )
        samples = self.sampling.samples * math.prod(self.pooled.values())

        def counts(name: str, codes: Sequence[Any]) -> dict[Any, int]:
            shares = results[name].reshape(-1, len(codes)).astype(np.float64)
            return dict(zip(codes, np.rint(shares * samples).astype(np.int64).sum(axis=0).tolist(), strict=True))

        found = tally.Tally(indices=indices)
        if {"flag_share", "valueless_share"} <= results.keys():
            found.flags = counts("flag_share", tuple(variables.Validity))
            found.counted = results["valueless_share"].size * samples
            if "mode_share" in results:
                found.modes = counts("valueless_share", (variables.SlidingMode.MISSING,))
                found.modes |= counts("mode_share", sample_statistics.MODES)
        return found
