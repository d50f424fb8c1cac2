"""`required_strength`: the smallest strength that keeps Newmark's block within a displacement."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.grid import chunks, plans, resources, solvers
from slipsweep.grid.engine import Request
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
from slipsweep.model.variables import StrengthStatus
from slipsweep.studies import limited_displacement
from slipsweep.studies.limits import check_displacement
from slipsweep.studies.required_yield import SCAN_MEMORY, yield_accelerations
from slipsweep.studies.sampling import Floats, Sampling, check_increasing
from slipsweep.studies.suite_statistics import QUANTILES, SUITE, THRESHOLDS
from slipsweep.studies.sweeps import Excitation, Signs, Values, brought_coordinates, naming_choices
from slipsweep.studies.uncertainty import check_drawn

TITLE = "Strength that is required for a tolerable displacement"

#: Inputs that are the strength of the interface, of which one is solved for.
_STRENGTHS = (*variables.REQUIRED_STRENGTHS, "yield_acceleration")

#: A strength that every model allows, in place of the required one.
_ANY = 0.5

#: Evaluations of the kernel for each required strength, about.
_EVALUATIONS = 6.0

#: Required strengths that are solved together, and bytes that each of them takes.
_TOGETHER = 262_144
_CELL_MEMORY = 300

#: The dimension of the draws; no result has it.
_DRAW = "draw of the uncertain inputs"


@naming_choices
@with_parameters
def required_strength(
    displacement: Values | str | Sequence[str],
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    of: str = "yield_coefficient",
    excitation: Excitation = "sine",
    model: options.Model | str = "newmark",
    theta: Values | None = None,
    displacement_amplitude: Values | None = None,
    upslope_yield_acceleration: Values | None = None,
    scale: Values | None = None,
    pgv: Values | None = None,
    arias_intensity: Values | None = None,
    time_scale: Values | None = None,
    polarity: Signs | None = None,
    azimuth: Values | None = None,
    uncertain: Mapping[str, Any] | None = None,
    samples: int = 4096,
    method: str = "sobol",
    seed: int = 0,
    correlation: Sequence[tuple[str, str, float]] = (),
    quantiles: float | Sequence[float] | np.ndarray = QUANTILES,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Smallest strength at which the displacement of Newmark's block stays within a tolerable one.

    The inverse of `sweep` in the yield coefficient ky, the friction coefficient or the friction
    angle.  It is solved on the kernel: `sweep` with the required strength gives the tolerable
    displacement to 1e-9 of itself.

    The permanent displacement of a block that slides downslope falls with its strength.  A block
    that slides both ways stays within by the largest ``|u|`` over time, which may rise with the
    strength: the required strength is then the one above which no strength of a scan exceeds the
    displacement.  A peak that is narrower than a step of the scan can be missed.

    Parameters
    ----------
    displacement : float, array or DataArray, str or list of str
        Tolerable permanent displacement, > 0, m or with a unit ("50mm").
    of : {"yield_coefficient", "mu_s", "phi"}
        The strength to solve for: Üy/g, or the friction coefficient or angle of Coulomb's Üy.
        `theta` is needed for "mu_s" and "phi", and for a block that slides both ways.
    model : Newmark or "newmark"
        The paper's law is refused: its displacement may grow with the friction coefficient.
    uncertain, samples, method, seed, correlation
        Uncertain inputs, as in `sample`.  The strength may be drawn about its value, of kind
        "factor" or "offset": the required strength is then the value that it is drawn about.
    quantiles : float or array
        Increasing, between 0 and 1: shares of the motions of a suite, and of the samples.
    progress : callable, optional
        Called with the number of strengths just solved, from any thread.

    Returns
    -------
    Dataset
        Dimensions amplitude, frequency, then others, displacement, polarity and motion last:

        - `required_yield_coefficient`, `required_mu_s` or `required_phi` (degrees), of every
          motion; NaN where there is none.
        - `required_status`: 0 solved, 1 always_within (also where nothing slides: ky is 0, μs is
          tan θ), 2 never_within.

        Under a suite, over all motions and polarities:

        - ``required_…_quantile``, dimension `quantile`: the strength that is enough for this share
          of them, linear between two of them.  It is infinite where too many are never within.
        - `always_within_count` and `never_within_count`.

        With uncertain inputs there are only these, over all samples (of all motions).

    Raises
    ------
    InputError
        As `sweep` and `sample`; a strength that is given as well; a displacement that is not
        positive; the paper's law.

    See Also
    --------
    limit_amplitude : the peak ground acceleration that a block can bear
    sweep : the displacement of a given strength

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> design = slipsweep.required_strength("50mm", amplitude=[2.0, 4.0], excitation=suite)
    >>> design.required_yield_coefficient_quantile.sel(quantile=0.84).values.round(3)
    array([0.089, 0.206])
    """
    inputs = given_inputs(locals())
    chosen = options.MODELS.of(model)
    sampling = None
    if uncertain is not None:
        sampling = Sampling(
            uncertain,
            samples=samples,
            method=method,
            seed=seed,
            quantiles=quantiles,
            thresholds=THRESHOLDS,
            correlation=correlation,
            g=chosen.g,
        )
    plan = plan_strength(
        displacement,
        inputs,
        of=of,
        excitation=excitation,
        model=chosen,
        sampling=sampling,
        quantiles=quantiles,
    )
    taken = {*variables.REQUIRED_RESULTS, *variables.STATISTIC_COORDINATES}
    return plan.solve(progress).assign_coords(brought_coordinates(inputs, plan.coords, taken))


def plan_strength(
    displacement: Any,
    inputs: Inputs,
    *,
    of: Any = "yield_coefficient",
    excitation: Any = "sine",
    model: Any = "newmark",
    sampling: Sampling | None = None,
    quantiles: Any = QUANTILES,
) -> "StrengthPlan":
    """Return the plan of `required_strength`; same parameters and errors."""
    of = parameters.check_choice("of", of, variables.REQUIRED_STRENGTHS)
    options.check_constant_strength("a required strength", options.MODELS.of(model))
    problem = check_problem(excitation, model, "cycle")
    if not isinstance(problem.model, options.Newmark):
        raise InputError(
            f"model = {problem.model.name!r}: must be 'newmark' for a required strength: by the "
            "paper's law the displacement may grow with mu_s, so that no strength is enough for "
            "all above it"
        )
    target = check_displacement(displacement)
    for name in _STRENGTHS:
        if name in inputs:
            raise InputError(f"{name}: not allowed beside of = {of!r}: the strength is solved for")
    absolute = []
    if sampling is not None:
        drawn = sampling.distributions
        for name in _STRENGTHS:
            if name in drawn and name != of:
                raise InputError(
                    f"{sampling.key(name)}: not allowed beside of = {of!r}: only that strength may "
                    'be drawn, with kind = "factor" or "offset"'
                )
        check_drawn(sampling, (*inputs, of), problem)
        absolute = [name for name, entry in drawn.items() if entry.kind == "absolute"]
    planned = {**inputs, of: _ANY, **dict.fromkeys(absolute, _ANY)}
    names = ["permanent_displacement"]
    plan = plans.plan_sweep(planned, excitation=excitation, model=model, variables=names)
    dropped = {of, "mu_s", *absolute}
    if "displacement_amplitude" in plan.coords and (
        {"displacement_amplitude", "frequency"} & {*absolute}
    ):
        dropped.add("amplitude")  # without values of d and f there is no A = ω²d
    coords = {name: value for name, value in plan.coords.items() if name not in dropped}
    source = plan.attrs["friction_inputs"].partition(";")[2]
    attrs = {
        **plan.attrs,
        "title": TITLE,
        "required": of,
        "friction_inputs": f"Üy solved for{';' if source else ''}{source}",
    }
    attrs |= limited_displacement.attributes_of(problem.model)
    if sampling is not None:
        sampling.check_draws(coords)
        attrs |= sampling.attributes
        attrs.pop("sensitivity", None)
    shares = check_increasing("quantiles", quantiles, "quantile")
    return StrengthPlan(of, problem, coords | {"displacement": target}, attrs, sampling, shares)


class StrengthPlan(plans.Plan):
    """Required strengths of a grid, with those of each motion along `pooled` dimensions."""

    def __init__(
        self,
        of: str,
        problem: Problem,
        coords: dict[str, xr.Variable],
        attrs: dict[str, Any],
        sampling: Sampling | None,
        quantiles: Floats,
    ) -> None:
        self.of = of
        self.problem = problem
        self.sampling = sampling
        self.quantiles = quantiles if sampling is None else sampling.quantiles
        self.inputs = inputs_of(problem, coords)
        if "displacement_amplitude" in self.inputs or (
            sampling is not None and "displacement_amplitude" in sampling.distributions
        ):
            self.inputs.pop("amplitude", None)  # A = ω²d
        sizes = grid_sizes(self.inputs)
        over = () if sampling is None else sampling.over
        for dim in over:
            if dim not in sizes:
                raise InputError(f"uncertainty.over = {parameters.shown(dim)}: is no dimension")
        of_suite = {*over, *(SUITE if "motion" in sizes else ())}
        #: Dimensions that make up a suite, and the number of samples at each point.
        self.pooled = {dim: sizes[dim] for dim in sizes if dim in of_suite}
        self.draws = 1 if sampling is None else sampling.samples
        self.runs = self.draws * math.prod(self.pooled.values())
        #: Results, and their dimensions in addition to those of the grid.
        self.results: dict[str, tuple[str, ...]] = {}
        if sampling is None:
            self.results[f"required_{of}"] = tuple(self.pooled)
            self.results["required_status"] = tuple(self.pooled)
        if sampling is not None or self.pooled:
            self.results[f"required_{of}_quantile"] = ("quantile",)
            self.results["always_within_count"] = ()
            self.results["never_within_count"] = ()
        plans.check_dimensions(sizes, coords, (*self.results, "quantile"))
        #: Number of points that are solved together.
        self.points = max(_TOGETHER // self.runs, 1)
        memory = _CELL_MEMORY * max(_TOGETHER, self.runs) + solvers.memory_of(problem)
        if options.slides_both_ways(problem.model):
            memory += SCAN_MEMORY
        super().__init__(
            sizes={dim: size for dim, size in sizes.items() if dim not in self.pooled},
            coords=coords,
            tasks=(),
            names=tuple(self.results),
            attrs=attrs | ({"pooled": resources.grid_text(self.pooled)} if self.pooled else {}),
            cost=solvers.cost_of(problem) * self.runs * _EVALUATIONS,
            memory=memory,
        )

    @property
    def cells(self) -> int:
        """Number of strengths to solve."""
        return math.prod(self.sizes.values()) * self.runs

    def part(self, chunk: chunks.Chunk) -> "StrengthPlan":
        """Return the plan cut to a chunk of its grid."""
        coords = chunks.variables_within(chunk, self.coords)
        return StrengthPlan(
            self.of, self.problem, coords, self.attrs, self.sampling, self.quantiles
        )

    def template(self) -> xr.Dataset:
        """Return the results with their coordinates but no values: zeros that take no memory."""
        coords = dict(self.coords)
        lengths = self.sizes | self.pooled | {"quantile": self.quantiles.size}
        if "always_within_count" in self.results:
            about = variables.STATISTIC_COORDINATES["quantile"] | {
                "long_name": "share of the motions or samples that need no more"
            }
            coords["quantile"] = xr.Variable("quantile", self.quantiles, about)
        results = {}
        for name, more_dims in self.results.items():
            dims = (*self.sizes, *more_dims)
            zero = np.zeros((), variables.RESULT_DTYPES.get(name, "float64"))
            shape = [lengths[dim] for dim in dims]
            results[name] = (
                dims,
                np.broadcast_to(zero, shape),
                variables.REQUIRED_RESULTS[name],
            )
        table = xr.Dataset(results, coords, self.attrs)
        return table if self.sampling is None else table.drop_dims(self.pooled)

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Solve the grid, some points at a time."""
        parameters.check_progress(progress)
        table = self.template()
        resources.check_memory(
            f"grid of {resources.grid_text(self.sizes | self.pooled) or 'one point'}",
            self.memory + table.nbytes,
            "ask for fewer grid points",
        )
        table = xr.zeros_like(table)
        for chunk in chunks.grid_chunks(self.sizes, self.points):
            for name, values in self._solved(chunk, progress).items():
                target = table[name].variable
                target[chunk] = xr.Variable(target.dims, values)
        return table

    def _solved(
        self, chunk: chunks.Chunk, progress: Callable[[int], None] | None
    ) -> dict[str, np.ndarray]:
        """Return the results at the grid points of a chunk."""
        grid = chunks.sizes_within(chunk, self.sizes)
        inputs = chunks.variables_within(chunk, self.inputs)
        sizes = grid | self.pooled
        drawn: Mapping[str, xr.Variable] = {}
        if self.sampling is not None:
            sizes[_DRAW] = self.draws
            # of draws for Sobol indices, which are not computed, the first are the samples
            drawn = {
                name: xr.Variable(_DRAW, draws[: self.draws])
                for name, draws in self.sampling.draws.items()
            }
            for name, draws in drawn.items():
                if name != self.of:
                    about = self.sampling.distributions[name]
                    inputs[name] = about.applied(inputs.get(name), draws)
        request = Request(self.problem, sizes, inputs, ("displacement",), progress)
        onset, status = yield_accelerations(request)
        strength = onset / self.problem.model.g
        if self.of != "yield_coefficient":
            theta = np.radians(inputs["theta"].set_dims(sizes).values)
            strength = friction_of(strength, theta, self.of)
            # a friction angle of 90° and more
            status[np.isnan(strength)] = StrengthStatus.NEVER_WITHIN
        if self.of in drawn and self.sampling is not None:
            scatter = drawn[self.of].values
            kind = self.sampling.distributions[self.of].kind
            strength = strength / scatter if kind == "factor" else strength - scatter
        results: dict[str, np.ndarray] = {
            f"required_{self.of}": strength,
            "required_status": status,
        }
        if f"required_{self.of}_quantile" in self.results:
            shape = (*grid.values(), -1)
            never = status.reshape(shape) == StrengthStatus.NEVER_WITHIN
            always = status.reshape(shape) == StrengthStatus.ALWAYS_WITHIN
            results["always_within_count"] = always.sum(axis=-1)
            results["never_within_count"] = never.sum(axis=-1)
            results[f"required_{self.of}_quantile"] = quantiles_of(
                strength.reshape(shape), never, self.quantiles
            )
        return {name: results[name] for name in self.results}


def friction_of(yield_coefficient: Floats, theta: Floats, of: str) -> Floats:
    """Return μs or φ (degrees) of Coulomb's ky at θ (radians), tan(φ − θ) = ky; NaN from 90° on."""
    angle = theta + np.arctan(yield_coefficient)
    tangent = np.tan(theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        friction = (tangent + yield_coefficient) / (1.0 - tangent * yield_coefficient)
    strength = friction if of == "mu_s" else np.degrees(angle)
    return np.where(angle < 0.5 * math.pi, strength, math.nan)


def quantiles_of(strengths: Floats, never: np.ndarray, shares: Floats) -> Floats:
    """Return quantiles along the last axis; strengths of cells `never` within are infinite.

    A quantile that lies among them, or between them and the largest of the others, is infinite.
    """
    # so large that a value interpolated towards it is above all others
    beyond = np.finfo(np.float64).max / 4.0
    filled = np.where(never, beyond, strengths)
    interpolated = np.moveaxis(np.quantile(filled, shares, axis=-1), 0, -1)
    largest = np.where(never, -np.inf, strengths).max(axis=-1)
    return np.where(interpolated > largest[..., np.newaxis], np.inf, interpolated)
