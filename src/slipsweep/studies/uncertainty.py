"""`sample`: statistics of the displacement at every grid point under uncertain inputs.

Parameters are drawn once (`sampling`), and the same draws serve every grid point: curves over an
axis are then as smooth as the model, and differences between grid points are not blurred by
sampling.  u = W/ω²: where the samples do not depend on the frequency (under a record 1 / time
scale) they are solved once for all frequencies.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import chunks, engine, plans, resources, solvers, threads
from slipsweep.grid.inputs import (
    Inputs,
    Problem,
    check_problem,
    given_inputs,
    grid_sizes,
    inputs_of,
)
from slipsweep.model import options, parameters, variables
from slipsweep.model.docstrings import with_parameters
from slipsweep.motion.waveforms import Waveform
from slipsweep.studies.sampling import ENDS, SOBOL_MEMORY, Sampling, Thresholds, sobol_indices
from slipsweep.studies.sweeps import Excitation, Signs, Values, brought_coordinates, naming_choices

TITLE = "Permanent displacement of a rigid block under uncertain inputs"

#: Statistics, and their dimensions in addition to those of the grid.
STATISTICS: dict[str, tuple[str, ...]] = {
    "displacement_quantile": ("quantile",),
    "mean_displacement": (),
    "exceedance_probability": ("threshold",),
    "mode_share": ("mode",),
    "flag_share": ("flag",),
    "valueless_share": (),
}
SENSITIVITY: dict[str, tuple[str, ...]] = {
    "first_order_index": ("input",),
    # in this order: CDO reads no variable whose last dimension but one has texts
    "first_order_interval": ("bound", "input"),
    "total_index": ("input",),
    "total_interval": ("bound", "input"),
    "sensitivity_status": (),
}

#: Statistics that depend on the frequency even where the samples do not.
_BY_FREQUENCY = ("displacement_quantile", "mean_displacement", "exceedance_probability")

_MODES = tuple(mode for mode in variables.SlidingMode if mode is not variables.SlidingMode.MISSING)

#: Parameters that have an estimate where they are not given.  Each may need those before it.
_ESTIMATED = ("yield_acceleration", "minimum_friction", "delta_mu", "decay_rate")

#: Names that no dimension and no coordinate of a caller's may have.
_TAKEN = {*variables.STATISTICS, *variables.STATISTIC_COORDINATES}

#: The dimension of the draws; no result has it.
_DRAW = "draw of the uncertain inputs"


@naming_choices
@with_parameters
def sample(
    theta: Values | None = None,
    mu_s: Values | None = None,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    uncertain: Mapping[str, Any],
    excitation: Excitation = "sine",
    model: options.Model | str = "mendez",
    solver: options.Solver | str = "auto",
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
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: Signs | None = None,
    azimuth: Values | None = None,
    samples: int = 4096,
    method: str = "sobol",
    seed: int = 0,
    quantiles: float | Sequence[float] | np.ndarray = (0.05, 0.5, 0.95),
    thresholds: Thresholds = (0.01, 0.1, 1.0),
    correlation: Sequence[tuple[str, str, float]] = (),
    sensitivity: bool = False,
    over: str | Sequence[str] = (),
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Quantiles and exceedance probabilities of the permanent displacement under uncertain inputs.

    Parameters span a grid as in `sweep`; at every grid point those in `uncertain` are drawn, with
    the same draws.

    Parameters
    ----------
    uncertain : mapping of str to mapping or frozen distribution
        For any parameter but `polarity` and `azimuth` either a frozen distribution of scipy.stats,
        or a mapping with

        - ``distribution``: the name of a continuous distribution of scipy.stats (or a frozen one),
          whose shape parameters, ``loc`` and ``scale`` are further keys;
        - ``kind``: "absolute" (a draw is the value; by default), "factor" (it multiplies the value
          at the grid point or, for `yield_acceleration`, and without a record for `decay_rate`,
          `delta_mu` and `minimum_friction`, the estimate) or "offset" (it is added to it).  A
          parameter that is drawn with "absolute" must not be given;
        - ``units``: of the draws, if not the parameter's own; not with factors.
    samples : int
        Samples a grid point; a power of 2 for Sobol's.
    method : {"sobol", "latin_hypercube", "random"}
        Scrambled Sobol sequence, Latin hypercube (scipy.stats.qmc) or pseudo-random numbers.
    seed : int
        The same seed gives the same draws.
    quantiles, thresholds : float, str or list of these
        Increasing, as in `suite_statistics`: shares, and displacements in m or with a unit
        ("50mm").
    correlation : list of (str, str, float)
        Pairs of drawn parameters and the correlation of their normal scores (a Gaussian copula).
    sensitivity : bool
        Compute Sobol indices [1]_ of the displacement, too: from ``samples * (k + 2)`` runs a grid
        point, of k inputs, the samples among them.
    over : str or list of str
        Dimensions of the grid, such as ``["motion", "polarity"]`` of a suite, whose values are
        equally likely draws: each meets all samples, and statistics are over all of them together;
        by default each motion has its own.  Not with `sensitivity`, nor a dimension of `frequency`
        or `time_scale`.
    progress : callable, optional
        Called with the number of samples just solved, from any thread.

    Returns
    -------
    Dataset
        Over the grid:

        - `displacement_quantile` (m), dimension `quantile`, `mean_displacement` (m) and
          `exceedance_probability`, dimension `threshold` (m): P(u > threshold).  They are of the
          samples that have a value; NaN where none has. Statically unstable samples, and those that
          do not come to rest after the shaking, have no value, and are counted as exceeding every
          threshold.  Of a block that slides both ways they are of ``|u|``.
        - `mode_share` (not under a record), dimension `mode`, `flag_share`, dimension `flag`, and
          `valueless_share`: of all samples, how many slide in which mode, have which flag, and have
          no value.  They do not depend on the frequency (of a record: the time scale) and have no
          such dimension (but with `displacement_amplitude`).
        - with `sensitivity`, `first_order_index` and `total_index`, dimension `input`: the part of
          the variance of the displacement that an input makes by itself, and with all that depends
          on it; their 95 % intervals by a bootstrap, `first_order_interval` and `total_interval`,
          dimension `bound`.  They lack the frequency as shares do.  Inputs that are correlated
          count as one, named as in "decay_rate+delta_mu".  There are none (NaN) where
          `sensitivity_status` is 1 (all runs have the same displacement) or 2 (a run has no value).

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
    .. [1] A. Saltelli et al. (2010), "Variance based sensitivity analysis of model output",
       Computer Physics Communications 181, 259-270, https://doi.org/10.1016/j.cpc.2009.09.018

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
    inputs = given_inputs(locals())
    sampling = Sampling(
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
    coords = brought_coordinates(inputs, plan.coords, _TAKEN)
    return plan.solve(progress).assign_coords(coords).drop_dims(sampling.over, errors="ignore")


def plan_samples(
    sampling: Sampling, inputs: Inputs, *, excitation: Any, model: Any, solver: Any
) -> "SamplePlan":
    """Return the plan of the samples of a grid, drawn and checked; errors as of `sample`."""
    problem = check_problem(excitation, model, solver)
    check_drawn(sampling, tuple(inputs), problem)
    drawn = sampling.distributions
    absolute = [name for name, distribution in drawn.items() if distribution.kind == "absolute"]
    # 0.5: a value that every parameter may have
    planned = {**inputs, **dict.fromkeys(absolute, 0.5)}
    names = ["permanent_displacement"]
    plan = plans.plan_sweep(
        planned, excitation=excitation, model=model, solver=solver, variables=names
    )
    tangents = [name for angle, name in variables.ANGLES.items() if angle in drawn]
    dropped = {*absolute, *tangents}
    if (
        "displacement_amplitude" in plan.coords
        and {"displacement_amplitude", "frequency"} & dropped
    ):
        dropped.add("amplitude")  # without values of d and f there is no A = ω²d
    coords = {name: variable for name, variable in plan.coords.items() if name not in dropped}
    sampling.check_draws(coords)
    about = options.friction_inputs(
        problem.model.name,
        coords,
        {name: distribution.kind for name, distribution in drawn.items()},
    )
    title = variables.counted_text(TITLE, plan.attrs)
    attrs = {**plan.attrs, "title": title, "friction_inputs": about, **sampling.attributes}
    return SamplePlan(sampling, problem, coords, attrs)


def check_drawn(sampling: Sampling, given_names: Sequence[str], problem: Problem) -> None:
    """Raise InputError for draws that cannot be used.

    They are draws of a parameter that the model or the shaking does not have, that is given as
    well, or of which a factor or an offset has no value to act on.
    """
    if "structure_frequency" in given_names:
        raise InputError(
            "structure_frequency: not allowed with uncertain inputs: the displacement does not "
            "depend on it"
        )
    recorded = not isinstance(problem.excitation, Waveform)
    kinds = (variables.WAVEFORM_INPUTS, variables.RECORD_INPUTS)
    foreign = {*kinds[not recorded]} - {*kinds[recorded]}
    for name, distribution in sampling.distributions.items():
        key = sampling.key(name)
        friction_law = name in ("decay_rate", "delta_mu", "minimum_friction")
        if name in foreign:
            raise InputError(f"{key}: not allowed with {'a Record' if recorded else 'a waveform'}")
        if friction_law and isinstance(problem.model, options.Newmark):
            raise InputError(f"{key}: not allowed with Newmark's block, which has no friction law")
        if distribution.kind == "absolute" and name in given_names:
            raise InputError(
                f'{key}: is drawn, but {name} is given as well: remove it, or give kind = "factor" '
                'or "offset" to draw about what is given'
            )
        # under a record each pulse has estimates of its own, but for Coulomb's yield acceleration
        estimated = friction_law and distribution.kind == "factor" and not recorded
        if name == "yield_acceleration":
            estimated = "yield_coefficient" not in {*given_names, *sampling.distributions}
        if distribution.kind != "absolute" and name not in given_names and not estimated:
            raise InputError(
                f'{key}: kind = "{distribution.kind}" needs {name} given, to which it is relative'
            )


def _check_pooled(
    sampling: Sampling, sizes: Mapping[str, int], clock_values: xr.Variable | None, clock: str
) -> None:
    """Raise InputError for a pooled dimension that the grid lacks, or that the clock varies along.

    `clock` is the frequency or the time scale: the samples of a grid point serve all its values.
    """
    for dim in sampling.over:
        key = f"{sampling.keys}over = {parameters.shown(dim)}"
        if dim not in sizes:
            raise InputError(
                f"{key}: must be a dimension of the grid: {', '.join(sizes) or 'there is none'}"
            )
        if clock_values is not None and dim in clock_values.dims:
            raise InputError(f"{key}: must not be a dimension of {clock}")


def _obeys_scaling_law(
    sampling: Sampling,
    problem: Problem,
    coords: Mapping[str, xr.Variable],
    clock: str,
) -> bool:
    """Return True if u = W/ω² holds with the same W for all frequencies (or time scales).

    It does not hold where the strength of the shaking changes with the time, where an offset is
    drawn on the frequency, and where friction changes while the block slides.
    """
    drawn = sampling.distributions
    timed = {"displacement_amplitude", "pgv", "arias_intensity"} & {*coords, *drawn}
    has_offset = clock in drawn and drawn[clock].kind == "offset"
    changes = options.changing_strength(problem.model) is not None
    return not (timed or has_offset or changes)


class SamplePlan(plans.Plan):
    """The samples of every grid point: cells along `solved` dimensions, frequencies along `scaled`.

    Along `pooled` dimensions all values are combined with all draws, and make up the samples of one
    grid point.
    """

    def __init__(
        self,
        sampling: Sampling,
        problem: Problem,
        coords: dict[str, xr.Variable],
        attrs: dict[str, Any],
    ) -> None:
        is_wave = isinstance(problem.excitation, Waveform)
        drawn = sampling.distributions
        #: Results, and their dimensions in addition to those of the grid.
        self.results = STATISTICS | (SENSITIVITY if sampling.sensitivity else {})
        if not is_wave:
            del self.results["mode_share"]
        clock = "frequency" if is_wave else "time_scale"
        inputs = inputs_of(problem, coords)
        for angle in variables.ANGLES:
            if angle in coords and angle in drawn:
                inputs[angle] = coords[angle]
        if "displacement_amplitude" in {*inputs, *drawn}:
            inputs.pop("amplitude", None)  # A = ω²d
        sizes = grid_sizes(inputs)
        plans.check_dimensions(sizes, coords, _TAKEN)
        _check_pooled(sampling, sizes, coords.get(clock), clock)
        pooled = {dim: sizes[dim] for dim in sampling.over}
        points = {dim: size for dim, size in sizes.items() if dim not in pooled}
        # the dimensions of the grid that the samples depend on
        scaling = _obeys_scaling_law(sampling, problem, coords, clock)
        dims = grid_sizes(
            {name: values for name, values in inputs.items() if name != clock or not scaling}
        )
        scaled = {dim: size for dim, size in points.items() if dim not in dims}
        solved = {dim: size for dim, size in points.items() if dim in dims}
        #: The variable by whose square displacements are divided.  Where it is not 1, cells are
        #: solved at a frequency of 1 Hz, or a time scale of 1.
        self.frequency = xr.Variable((), 1.0)
        if scaled:
            self.frequency = inputs[clock] if is_wave else 1.0 / inputs[clock]
            inputs[clock] = xr.Variable((), 1.0)
        pooled_values = math.prod(pooled.values())
        #: Samples and runs of a grid point: all draws with all that is pooled.
        self.samples = sampling.samples * pooled_values
        self.runs = sampling.runs * pooled_values
        #: Number of points that are solved together: in 30 MB, yet enough to keep the kernels busy.
        self.points = max(1_000_000 // self.runs, 1)
        self.sampling = sampling
        self.problem = problem
        self.inputs = inputs
        self.pooled = pooled
        self.scaled = scaled
        self.solved = solved
        cost = max(1.0, solvers.cost_of(problem) * self.runs / math.prod(scaled.values()))
        bytes_per_run = 24 * len(drawn) + self.points * (8 * (2 + len(drawn)) + 11)
        memory = self.runs * bytes_per_run + solvers.memory_of(problem)
        if sampling.sensitivity:
            cost += 30_000  # cells of the cycle solver: the time of the bootstrap
            memory += SOBOL_MEMORY + 64 * sampling.runs
        super().__init__(
            sizes=points,
            coords=coords,
            tasks=(),
            names=tuple(self.results),
            attrs=attrs | ({"pooled": resources.grid_text(pooled)} if pooled else {}),
            cost=cost,
            together=tuple(scaled),
            memory=memory,
        )

    @property
    def cells(self) -> int:
        """Number of samples to solve."""
        return math.prod(self.solved.values()) * self.runs

    def part(self, chunk: chunks.Chunk) -> "SamplePlan":
        """Return the plan cut to a chunk of its grid."""
        return SamplePlan(
            self.sampling, self.problem, chunks.variables_within(chunk, self.coords), self.attrs
        )

    def template(self) -> xr.Dataset:
        """Return the statistics with their coordinates but no values: zeros that take no memory."""
        values: dict[str, Any] = {
            "quantile": self.sampling.quantiles,
            "threshold": self.sampling.thresholds,
            "mode": np.array(_MODES, np.int8),
            "flag": np.array(variables.Validity, np.int16),
            "input": ["+".join(entry) for entry in self.sampling.independent],
            "bound": [*ENDS],
        }
        own_dims = dict.fromkeys(dim for dims in self.results.values() for dim in dims)
        own_coords = {
            dim: xr.Variable((dim,), values[dim], variables.STATISTIC_COORDINATES[dim])
            for dim in own_dims
        }
        lengths = self.sizes | {dim: entry.size for dim, entry in own_coords.items()}
        results = {}
        for name, more_dims in self.results.items():
            dims = (*(self.sizes if name in _BY_FREQUENCY else self.solved), *more_dims)
            zero = np.zeros((), variables.RESULT_DTYPES.get(name, "float64"))
            results[name] = (
                dims,
                np.broadcast_to(zero, [lengths[dim] for dim in dims]),
                variables.counted(variables.STATISTICS[name], self.attrs),
            )
        return xr.Dataset(results, self.coords | own_coords, self.attrs).drop_dims(self.pooled)

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Solve the samples, a million at a time, and return their statistics."""
        parameters.check_progress(progress)
        table = self.template()
        resources.check_memory(
            f"grid of {resources.grid_text(self.sizes) or 'one point'}, {self.runs} samples",
            self.memory + table.nbytes,
            "ask for fewer samples, grid points, quantiles or thresholds",
        )
        table = xr.zeros_like(table)
        for chunk in chunks.grid_chunks(self.solved, self.points):
            for name, values in self._statistics(chunk, progress).items():
                target = table[name].variable
                sizes = target[chunk].sizes
                scaled = self.scaled if name in _BY_FREQUENCY else {}
                dims = (*self.solved, *scaled, *self.results[name])
                target[chunk] = xr.Variable(dims, values.reshape([sizes[dim] for dim in dims]))
        return table

    def _statistics(
        self, chunk: chunks.Chunk, progress: Callable[[int], None] | None
    ) -> dict[str, NDArray[Any]]:
        """Return the statistics at grid points of a chunk, (solved, frequencies, own dimension)."""
        sampling = self.sampling
        sizes = {dim: cut.stop - cut.start for dim, cut in chunk.items()}
        inputs, drawn = self._drawn(chunk, sizes)
        names = (
            "permanent_displacement",
            "validity",
            *(["sliding_mode"] if "mode_share" in self.names else []),
        )
        solved = engine.solve(engine.Request(self.problem, drawn, inputs, names, progress))
        if options.slides_both_ways(self.problem.model):
            solved["permanent_displacement"].values[:] = abs(solved["permanent_displacement"])
        runs = [solved[name].values.reshape(math.prod(sizes.values()), -1) for name in names]
        # of Sobol indices the first runs are the samples
        displacement, flags, *modes = (values[:, : self.samples] for values in runs)
        clocks = self.frequency.isel(chunk, missing_dims="ignore").set_dims(sizes | self.scaled)
        frequency = clocks.values.reshape(len(displacement), -1)
        squares = frequency[..., np.newaxis] ** 2
        # quantiles, and last the mean
        moved = np.full((*frequency.shape, sampling.quantiles.size + 1), np.nan)
        exceeding = np.full((*frequency.shape, sampling.thresholds.size), np.nan)

        def reduce(point: int) -> None:
            values = np.sort(displacement[point])
            values = values[: np.searchsorted(values, np.nan)]  # NaN goes last
            # blocks that slide without any shaking, or do not stop after it, have no displacement;
            # they exceed every threshold
            unstable = np.count_nonzero(flags[point] & variables.ENDLESS.value)
            if values.size + unstable:
                above = values.size - np.searchsorted(
                    values, sampling.thresholds * squares[point], side="right"
                )
                exceeding[point] = (above + unstable) / (values.size + unstable)
            if values.size:
                with np.errstate(over="ignore"):  # refused below
                    moved[point] = (
                        np.append(np.quantile(values, sampling.quantiles), values.mean())
                        / squares[point]
                    )

        threads.spread(range(len(displacement)), reduce)
        for wrong in frequency[np.isinf(moved).any(axis=-1)][:1]:
            text = parameters.number_text(float(wrong))
            raise InputError(f"frequency or 1 / time_scale = {text}: must be nearer to 1")
        statistics = {
            "displacement_quantile": moved[..., :-1],
            "mean_displacement": moved[..., -1],
            "exceedance_probability": exceeding,
            "flag_share": np.stack(
                [np.mean(flags & flag.value != 0, axis=-1) for flag in variables.Validity], axis=-1
            ),
            "valueless_share": np.isnan(displacement).mean(axis=-1),
        }
        for codes in modes:
            statistics["mode_share"] = np.stack(
                [np.mean(codes == mode, axis=-1) for mode in _MODES], axis=-1
            )
        if sampling.sensitivity:
            statistics |= sobol_indices(sampling, runs[0])
        return statistics

    def _drawn(
        self, chunk: chunks.Chunk, sizes: dict[str, int]
    ) -> tuple[dict[str, xr.Variable], dict[str, int]]:
        """Return the inputs of the runs of a chunk, and their sizes, (solved, pooled, draw)."""
        inputs = chunks.variables_within(chunk, self.inputs)
        sizes = sizes | self.pooled | {_DRAW: self.sampling.runs}
        drawn = {name: xr.Variable((_DRAW,), draws) for name, draws in self.sampling.draws.items()}
        for name, distribution in self.sampling.distributions.items():
            if name in inputs or distribution.kind == "absolute":
                inputs[name] = distribution.applied(inputs.get(name), drawn.pop(name))
        for angle, name in variables.ANGLES.items():
            if angle in inputs:
                inputs[name] = parameters.friction_coefficient(inputs.pop(angle))
        for name in (estimated for estimated in _ESTIMATED if estimated in drawn):
            # Coulomb's yield acceleration does not depend on the amplitude, which a record lacks
            every = {"amplitude": xr.Variable((), 0.0), **inputs}
            request = engine.Request(self.problem, grid_sizes(every), every, (name,))
            estimate = engine.friction_parameters(request, finite=False)[name]
            values = self.sampling.distributions[name].applied(estimate, drawn[name])
            # where the estimate fails, NaN lets the kernel estimate it and raise the flag
            inputs[name] = values.where(parameters.BOUNDS[name].holds(values))
        return inputs, sizes
