"""Uncertain inputs: samples of a sweep's parameters, and the statistics of the displacement at every grid point.

Parameters are drawn once (`sampling`), and the same draws serve every grid point: curves over an axis are then as
smooth as the model, and differences between grid points are not blurred by sampling.  A draw is the parameter itself, a
factor on its value at the grid point, or an offset to it.  u = W/ω²: where the samples do not depend on the frequency
they are solved once for all frequencies.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.chunks import Chunk, slabs
from slipsweep.grid.engine import Request
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import aligned, check_dimensions, cost_of, grid_sizes, inputs_of, memory_of, plan_sweep
from slipsweep.grid.problem import Problem
from slipsweep.grid.resources import check_memory, grid_text
from slipsweep.grid.tally import Indices, Tally
from slipsweep.model.options import MODELS, Model, Newmark, friction_inputs
from slipsweep.model.parameters import BOUNDS, check_progress, shown
from slipsweep.model.variables import (
    DRAWN,
    FRICTION_PARAMETERS,
    RECORD_INPUTS,
    RESULT_DTYPES,
    STATISTIC_COORDINATES,
    STATISTICS,
    WAVEFORM_INPUTS,
    SlidingMode,
    Validity,
)
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.studies import sample_statistics, sensitivity
from slipsweep.studies.distributions import Distribution
from slipsweep.studies.sampling import ESTIMATED, Sampling, check_draws

Floats = NDArray[np.float64]
Arrays = Mapping[str, NDArray[Any]]

#: Samples solved together: 30 MB, yet enough to keep the kernels busy.
_CELLS = 1_000_000

TITLE = "Permanent displacement of a rigid block under uncertain inputs"


@dataclass(frozen=True)
class Study:
    """Results that are made of one set of draws at every grid point.

    Attributes
    ----------
    draws : mapping of str to array
        Draws of each uncertain parameter.
    runs : int
        How many there are of each.
    results : mapping of str to tuple of str
        Results, and their dimensions in addition to those of the grid.
    reduce : callable
        ``reduce(sampling, solved, frequency)`` gives the results of grid points: see
        `sample_statistics.statistics_of_samples`.
    by_frequency : collection of str
        Results that depend on the frequency even where the runs do not.
    work : float
        Cost of a grid point in addition to its runs, in cells of the cycle solver.
    memory : int
        Bytes in addition to draws and displacements.
    """

    draws: Mapping[str, Floats]
    runs: int
    results: Mapping[str, tuple[str, ...]]
    reduce: Callable[[Sampling, Arrays, Floats], Arrays]
    by_frequency: Collection[str] = ()
    work: float = 0.0
    memory: int = 0


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
    by_angle = inputs.phi is not None
    names = [name for name in inputs.given if not (by_angle and name == "mu_s")] + ["phi"] * by_angle
    if "structure_frequency" in names:
        raise InputError(
            "structure_frequency: not allowed with uncertain inputs: the displacement does not depend on it"
        )
    recorded = isinstance(excitation, (Record, Suite))
    _check_drawn(sampling, names, recorded, MODELS.of(model))
    sampling.check_given(names)
    known = {*names, *sampling.absolute}
    friction = "phi" if "phi" in known else "mu_s"
    if {"mu_s", "phi"} <= known:
        raise InputError("phi, mu_s: must not both be given or drawn; mu_s = tan(phi)")
    interface = () if "yield_coefficient" in known else ("theta", friction)
    for name in (*interface, *(() if recorded else ("frequency",))):
        if name not in known:
            raise InputError(f"{name}: must be given, or drawn")
    studies = _studies(sampling, recorded)
    for study in studies:
        check_draws(sampling, study.draws, sampling.absolute, {})
    # what has no value of its own is planned for with one of its draws
    stand_ins = {name: float(studies[0].draws[name][0]) for name in sampling.absolute}
    plan = plan_sweep(
        inputs.but(stand_ins), excitation=excitation, model=model, solver=solver, variables=["permanent_displacement"]
    )
    dropped = {*stand_ins, *(["mu_s"] if "phi" in sampling.distributions else [])}
    if "displacement_amplitude" in plan.coords and {"displacement_amplitude", "frequency"} & dropped:
        dropped.add("amplitude")  # A = ω²d of the stand-ins is nobody's amplitude
    coords = {name: variable for name, variable in plan.coords.items() if name not in dropped}
    for study in studies:
        check_draws(sampling, study.draws, [name for name in sampling.distributions if name not in stand_ins], coords)
    problem = plan.tasks[0].problem
    kinds = {name: one.kind for name, one in sampling.distributions.items()}
    about = friction_inputs(problem.model.name, coords, kinds)
    attrs = {**plan.attrs, "title": TITLE, "friction_inputs": about, **sampling.attributes}
    if sampling.over:
        attrs["pooled"] = _pooled_text(sampling, coords, "time_scale" if recorded else "frequency")
    if sampling.sensitivity:
        runs = f"{sampling.sensitivity_runs} runs; bootstrap of {sensitivity.RESAMPLES}"
        attrs["sensitivity"] = f"Saltelli et al. (2010), {runs}"
    return SamplePlan(sampling, studies, problem, coords, attrs)


def _studies(sampling: Sampling, recorded: bool) -> tuple[Study, ...]:
    """The statistics of the displacement and, where they are requested, Sobol indices."""
    own = {name: dims for name, dims in sample_statistics.RESULTS.items() if not (recorded and name == "mode_share")}
    statistics = Study(
        sampling.draws(),
        sampling.samples,
        own,
        sample_statistics.statistics_of_samples,
        sample_statistics.BY_FREQUENCY,
    )
    if not sampling.sensitivity:
        return (statistics,)
    indices = Study(
        sensitivity.draws_of_runs(sampling),
        sampling.sensitivity_runs,
        sensitivity.RESULTS,
        sensitivity.sobol_indices,
        work=sensitivity.WORK,
        memory=sensitivity.memory_of_bootstrap(sampling),
    )
    return statistics, indices


def _check_drawn(sampling: Sampling, given: Sequence[str], recorded: bool, model: Model) -> None:
    """Refuse to draw what the model or the shaking does not have."""
    others = {*(WAVEFORM_INPUTS if recorded else RECORD_INPUTS)} - {*(RECORD_INPUTS if recorded else WAVEFORM_INPUTS)}
    for name, one in sampling.distributions.items():
        friction_law = name in ("decay_rate", "delta_mu", "minimum_friction")
        if name in others:
            raise InputError(f"{sampling.key(name)}: not allowed with {'a Record' if recorded else 'a waveform'}")
        if friction_law and isinstance(model, Newmark):
            raise InputError(f"{sampling.key(name)}: not allowed with Newmark's block, which has no friction law")
        if friction_law and recorded and one.kind != "absolute" and name not in given:
            raise InputError(
                f'{sampling.key(name)}: kind = "{one.kind}" needs {name} given: under a record each pulse has an '
                "estimate of its own"
            )


def _pooled_text(sampling: Sampling, coords: Mapping[str, xr.Variable], clock: str) -> str:
    """What is pooled, in words: ``8 motion x 2 polarity``; refuse what cannot be."""
    sizes = grid_sizes(coords)
    for dim in sampling.over:
        if dim not in sizes:
            there = ", ".join(sizes) or "there is none"
            raise InputError(f"{sampling.keys}over = {shown(dim)}: must be a dimension of the grid: {there}")
        # the samples of a grid point serve all its frequencies
        if clock in coords and dim in coords[clock].dims:
            raise InputError(f"{sampling.keys}over = {shown(dim)}: must not be a dimension of {clock}")
    return grid_text({dim: sizes[dim] for dim in sampling.over})


class SamplePlan:
    """The samples of every grid point: cells along `solved` dimensions, frequencies along `scaled` ones.

    Along `pooled` dimensions all values meet all draws, and make up the samples of one grid point.

    A plan as all others are (`anyplan.AnyPlan`); its parts have the draws of the whole.  Under a record the inverse of
    the time scale takes the place of the frequency, and there is no sliding mode.
    """

    cell_memory = 0

    def __init__(
        self,
        sampling: Sampling,
        studies: tuple[Study, ...],
        problem: Problem,
        coords: dict[str, xr.Variable],
        attrs: dict[str, Any],
    ) -> None:
        self.sampling, self.studies, self.problem = sampling, studies, problem
        self.coords, self.attrs = coords, attrs
        drawn = sampling.distributions
        self.by_displacement = "displacement_amplitude" in {*coords, *drawn}
        recorded = isinstance(problem.excitation, (Record, Suite))
        self.clock = clock = "time_scale" if recorded else "frequency"
        self.names = tuple(name for study in studies for name in study.results)
        # strengths of a motion that change with its time
        self.timed = tuple(name for name in ("pgv", "arias_intensity") if name in {*coords, *drawn})
        own = {
            name: variable
            for name, variable in inputs_of(problem, coords).items()
            if name != clock and not (name == "amplitude" and self.by_displacement)
        }
        if {"phi"} <= coords.keys() & drawn.keys():
            own["phi"] = coords["phi"]
        everything = own | ({clock: coords[clock]} if clock in coords else {})
        # A = ω²d, and (f + offset)/f, depend on the frequency itself: no scaling law along its dimensions then
        unscaled = self.by_displacement or self.timed or (clock in drawn and drawn[clock].kind == "offset")
        sizes = grid_sizes(everything)
        check_dimensions(sizes, coords, {*STATISTICS, *STATISTIC_COORDINATES})
        solved = grid_sizes(everything if unscaled else own)
        self.pooled = {dim: sizes[dim] for dim in sampling.over}
        self.sizes = {dim: size for dim, size in sizes.items() if dim not in self.pooled}
        self.scaled = {dim: size for dim, size in self.sizes.items() if dim not in solved}
        self.solved = {dim: size for dim, size in solved.items() if dim not in self.pooled}
        self.base = aligned(
            everything if clock in everything and not self.scaled else own, {**self.solved, **self.pooled}
        )
        clocks = coords.get(clock, xr.Variable((), 1.0)).set_dims({**self.solved, **self.scaled}).values
        clocks = clocks.reshape(*self.solved.values(), -1)
        self.frequency: Floats = 1.0 / clocks if recorded else clocks

    @property
    def cells(self) -> int:
        """Number of samples to solve, of all grid points."""
        return math.prod(self.solved.values()) * sum(map(self._runs, self.studies))

    def _runs(self, study: Study) -> int:
        """Runs of a grid point: all draws with all that is pooled."""
        return study.runs * math.prod(self.pooled.values())

    def _points(self, study: Study) -> int:
        """Grid points solved together."""
        return max(_CELLS // self._runs(study), 1)

    @property
    def cost(self) -> float:
        """Cost of a grid point, in cells of the cycle solver."""
        cells = sum(cost_of(self.problem) * self._runs(study) + study.work for study in self.studies)
        return max(1.0, cells / math.prod(self.scaled.values()))

    @property
    def together(self) -> tuple[str, ...]:
        """Dimensions along which the same samples serve."""
        return tuple(self.scaled)

    @property
    def memory(self) -> int:
        """Bytes of the draws, while they are made, and of the samples that are solved together."""
        drawn = len(self.sampling.distributions)
        draws = sum(24 * study.runs * drawn + study.memory for study in self.studies)
        together = max(self._points(study) * self._runs(study) * (8 * (2 + drawn) + 11) for study in self.studies)
        return draws + together + memory_of(self.problem)

    def part(self, chunk: Chunk) -> "SamplePlan":
        """The plan cut to a chunk of its grid."""
        coords = {name: one.isel(chunk, missing_dims="ignore") for name, one in self.coords.items()}
        return SamplePlan(self.sampling, self.studies, self.problem, coords, self.attrs)

    def template(self) -> xr.Dataset:
        """The statistics with their dimensions and coordinates but no values: zeros that take no memory."""
        return self._dataset(lambda study: {name: np.zeros(()) for name in study.results})

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Solve the samples slab by slab, and reduce them to what `slipsweep.sample` returns.

        Parameters
        ----------
        progress : callable, optional
            Called with a number of samples just solved, from any thread.
        """
        check_progress(progress)
        check_memory(
            f"grid of {grid_text(self.sizes) or 'one point'}, {sum(map(self._runs, self.studies))} samples",
            self.memory + self.template().nbytes,
            "ask for fewer samples, grid points, quantiles or thresholds",
        )
        return self._dataset(lambda study: self._reduced(study, progress))

    def _dataset(self, values_of: Callable[[Study], Arrays]) -> xr.Dataset:
        """The results as a Dataset, of values that broadcast to (solved, scaled, own dimensions)."""
        lengths = {**self.sizes, **{name: one.size for name, one in self._statistic_coords().items()}}
        results = {}
        for study in self.studies:
            for name, values in values_of(study).items():
                own = study.results[name]
                scaled = self.scaled if name in study.by_frequency else {}
                dims = (*self.solved, *scaled, *own)
                shape = [lengths[dim] for dim in dims]
                filled = values.reshape(shape) if values.ndim else np.broadcast_to(values, shape)
                dtype = RESULT_DTYPES.get(name, "float64")
                variable = xr.Variable(dims, filled.astype(dtype, copy=False), STATISTICS[name])
                results[name] = variable.transpose(*(dim for dim in self.sizes if dim in dims), *own)
        coords = {name: one for name, one in self.coords.items() if not {*self.pooled} & {*one.dims}}
        return xr.Dataset(results, coords | self._statistic_coords(), self.attrs)

    def _statistic_coords(self) -> dict[str, xr.Variable]:
        """Coordinates of the dimensions that the results have in addition to those of the grid."""
        values: dict[str, NDArray[Any]] = {
            "quantile": self.sampling.quantiles,
            "threshold": self.sampling.thresholds,
            "mode": np.array(sample_statistics.MODES, np.int8),
            "flag": np.array(Validity, np.int16),
            "input": np.array(["+".join(one) for one in self.sampling.independent]),
            "bound": np.array(sensitivity.ENDS),
        }
        own = {dim for study in self.studies for dims in study.results.values() for dim in dims}
        return {dim: xr.Variable((dim,), one, STATISTIC_COORDINATES[dim]) for dim, one in values.items() if dim in own}

    def _reduced(self, study: Study, progress: Callable[[int], None] | None) -> Arrays:
        """The results of a study at all grid points, (solved, frequencies, own dimension)."""
        parts: list[Arrays] = []
        for slab in slabs(tuple(self.solved.values()), self._points(study)):
            solved = self._solve(study, slab, progress)
            frequency = self.frequency[slab].reshape(-1, self.frequency.shape[-1])
            rows = {name: values.reshape(len(frequency), -1) for name, values in solved.items()}
            parts.append(study.reduce(self.sampling, rows, frequency))
        # slabs follow one another in the order of the grid
        return {name: np.concatenate([part[name] for part in parts]) for name in study.results}

    def tally(self, results: Mapping[str, NDArray[Any]]) -> Tally:
        """Samples by sliding mode and by flag, from their shares; grid points by what moves the displacement."""
        indices = None
        if "sensitivity_status" in results:
            indices = Indices.counted(
                self._statistic_coords()["input"].values.tolist(),
                *(results[name] for name in ("first_order_index", "total_index", "sensitivity_status")),
            )
        shares = [name for name in ("mode_share", "flag_share", "valueless_share") if name in self.names]
        if not {*shares} <= results.keys():
            return Tally(indices=indices)
        samples = self.sampling.samples * math.prod(self.pooled.values())
        counts = {name: np.rint(results[name] * np.float64(samples)).astype(np.int64) for name in shares}
        by_flag = dict(zip(Validity, counts["flag_share"].reshape(-1, len(Validity)).sum(0).tolist(), strict=True))
        tally = Tally(0, None, by_flag, indices=indices, counted=counts["valueless_share"].size * samples)
        if "mode_share" in counts:
            known = sample_statistics.MODES
            by_mode = dict(zip(known, counts["mode_share"].reshape(-1, len(known)).sum(0).tolist(), strict=True))
            tally.modes = {SlidingMode.MISSING: int(counts["valueless_share"].sum())} | by_mode
        return tally

    def _solve(self, study: Study, slab: tuple[slice, ...], progress: Callable[[int], None] | None) -> Arrays:
        """Displacement (at 1 Hz or, where it is drawn, at the frequency over the grid's), mode and flags of a slab.

        Under a record at time scale 1, or at the one drawn over the grid's.
        """
        slab = (*slab, *(slice(0, size) for size in self.pooled.values()))
        base = {name: values[..., None] for name, values in engine.cut(self.base, slab).items()}
        one = np.ones((1,) * (len(slab) + 1))
        frequency = base.pop(self.clock, one)
        drawn = self.sampling.distributions
        rows = {name: draws.reshape((1,) * len(slab) + (-1,)) for name, draws in study.draws.items()}
        arrays = {
            name: drawn[name].applied(base.get(name), rows[name]) if name in drawn else base[name]
            for name in (*DRAWN, "polarity", "azimuth", "motion")
            if name != self.clock and (name in base or (name in drawn and drawn[name].kind == "absolute"))
        }
        relative = one
        if self.clock in drawn:
            by_offset = drawn[self.clock].kind == "offset"
            relative = 1.0 + rows[self.clock] / frequency if by_offset else rows[self.clock]
        if "phi" in arrays:
            arrays["mu_s"] = np.tan(np.radians(arrays.pop("phi")))
        if self.by_displacement:
            omega = 2.0 * math.pi * relative * frequency
            arrays["amplitude"] = omega * omega * arrays.pop("displacement_amplitude")
        # targets as they are at the time scale 1 that is solved for
        arrays |= {name: arrays[name] / frequency for name in self.timed}
        shape = (*(part.stop - part.start for part in slab), study.runs)
        for name in ESTIMATED:
            if name in drawn and name not in arrays:
                arrays[name] = self._about_estimate(drawn[name], rows[name], arrays, shape)
        arrays[self.clock] = relative
        modes = ("sliding_mode",) if "mode_share" in self.names else ()
        names = ("permanent_displacement", *modes, "validity")
        return engine.solve(Request(self.problem, shape, arrays, names, progress))

    def _about_estimate(
        self, one: Distribution, row: Floats, arrays: Mapping[str, Floats], shape: tuple[int, ...]
    ) -> Floats:
        """A parameter drawn about its estimate; NaN, which leaves it to the estimate and its flag, where that fails."""
        name = one.parameter
        assert name in FRICTION_PARAMETERS
        if name == "yield_acceleration":
            # it depends on no axis of the shaking
            estimate = engine.coulomb_yield_acceleration(arrays["theta"], arrays["mu_s"], self.problem.model.g)
        else:
            dims = np.broadcast_shapes(*(values.shape for values in arrays.values()), (1,) * len(shape))
            estimate = engine.friction_parameters(Request(self.problem, dims, arrays, (name,)), finite=False)[name]
        values = one.applied(estimate, row)
        return np.where(BOUNDS[name].holds(values), values, np.nan)
