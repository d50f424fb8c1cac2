"""Uncertain inputs: samples of a sweep's parameters, and the statistics of the displacement at every grid point.

Parameters are drawn once, from distributions of scipy.stats by quasi-random numbers of scipy.stats.qmc,
and the same draws serve every grid point: curves over an axis are then as smooth as the model, and
differences between grid points are not blurred by sampling.  A draw is the parameter itself, a factor on
its value at the grid point, or an offset to it.  u = W/ω²: where the samples do not depend on the frequency
they are solved and sorted once, and quantiles and probabilities of all frequencies read off that.
"""

import functools
import itertools
import json
import math
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine, threads
from slipsweep.grid.chunks import Chunk, slabs
from slipsweep.grid.engine import Problem, Request
from slipsweep.grid.plans import aligned, check_dimensions, cost_of, grid_sizes, plan_sweep
from slipsweep.grid.resources import check_memory, grid_text
from slipsweep.grid.tables import Empty, Table, Variable
from slipsweep.grid.tally import Tally
from slipsweep.model.estimates import friction_inputs
from slipsweep.model.options import MODELS, Model, Newmark
from slipsweep.model.parameters import (
    BOUNDS,
    check_choice,
    check_finite,
    check_list,
    check_numbers,
    check_progress,
    check_values,
    check_whole,
    computed,
    number_text,
    shown,
)
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.units import quantity, unit_factor
from slipsweep.model.variables import (
    DRAWN,
    FRICTION_PARAMETERS,
    PARAMETERS,
    RECORD_INPUTS,
    STATISTIC_COORDINATES,
    STATISTICS,
    WAVEFORM_INPUTS,
    SlidingMode,
    Validity,
)
from slipsweep.motion.records import Record

Floats = NDArray[np.float64]

METHODS = ("sobol", "latin_hypercube", "random")
KINDS = ("absolute", "factor", "offset")

#: Parameters that have an estimate where they are not given, in the order in which each needs those before it.
_ESTIMATED = ("yield_acceleration", "minimum_friction", "delta_mu", "decay_rate")

#: Most samples a grid point: 2**24 take about 1.5 GB.
MOST_SAMPLES = 2**24

#: Attributes hold 32 bits.
_MOST_SEED = 2**31 - 1

#: Samples solved together: 30 MB, yet enough to keep the kernels busy.
_CELLS = 1_000_000

#: Statistics and the dimensions that they have beside those of the grid.
_STATISTICS: dict[str, tuple[str, ...]] = {
    "displacement_quantile": ("quantile",),
    "mean_displacement": (),
    "exceedance_probability": ("threshold",),
    "mode_share": ("mode",),
    "flag_share": ("flag",),
    "valueless_share": (),
}

#: Those that depend on the frequency even where the samples do not.
_BY_FREQUENCY = ("displacement_quantile", "mean_displacement", "exceedance_probability")

TITLE = "Permanent displacement of a rigid block under uncertain inputs"

#: Half of the last digit of scipy's Sobol numbers, some of which are 0: the quantile there may be infinite.
_LEAST = 2.0**-31

_USUAL = ("norm", "lognorm", "uniform", "triang", "truncnorm", "beta", "gamma", "weibull_min")


@dataclass(frozen=True)
class Distribution:
    """What an uncertain parameter is drawn from.

    Attributes
    ----------
    parameter : str
    kind : {"absolute", "factor", "offset"}
        Whether a draw is the value, multiplies the grid point's, or is added to it.
    frozen : object
        A frozen distribution of scipy.stats, or anything else with a ``ppf``.
    unit : float
        What to multiply draws by, to have them in the parameter's own unit.
    about : dict
        The distribution in words and numbers, as it was given.
    """

    parameter: str
    kind: str
    frozen: Any
    unit: float
    about: dict[str, Any]

    def __str__(self) -> str:
        numbers = [f"{name}={value}" for name, value in self.about.items() if name not in ("distribution", "kind")]
        return f"{self.about['distribution']}({', '.join(numbers)})"

    def draws(self, uniform: Floats) -> Floats:
        """Turn numbers from 0 to 1 into draws, in the parameter's own unit."""
        with np.errstate(all="ignore"):  # what is not finite is refused by `_check_draws`
            return np.asarray(self.frozen.ppf(uniform), np.float64) * self.unit

    def applied(self, base: Any, draws: Floats) -> Floats:
        """The parameter's values: draws alone, or with the values they are relative to."""
        if self.kind == "absolute":
            return draws
        with np.errstate(over="ignore"):
            return np.asarray(base * draws if self.kind == "factor" else base + draws)


@dataclass(frozen=True)
class Sampling:
    """How inputs are sampled and which statistics are wanted, checked.

    Attributes
    ----------
    distributions : dict of str to Distribution
    samples : int
    method : str
    seed : int
    quantiles, thresholds : ndarray
    correlation : tuple of (str, str, float)
        Correlations of normal scores, by pairs of parameters.
    keys : str
        What stands before the names of these options in errors.
    """

    distributions: dict[str, Distribution]
    samples: int
    method: str
    seed: int
    quantiles: Floats
    thresholds: Floats
    correlation: tuple[tuple[str, str, float], ...]
    keys: str

    @property
    def absolute(self) -> tuple[str, ...]:
        """Parameters whose draws are their values."""
        return tuple(name for name, one in self.distributions.items() if one.kind == "absolute")

    def key(self, parameter: str) -> str:
        """What a distribution is called in errors."""
        return f"{self.keys or 'uncertain.'}{parameter}"

    def draws(self) -> dict[str, Floats]:
        """Draw all parameters: arrays of `samples`, the same ones each time."""
        from scipy.stats import norm, qmc

        number = len(self.distributions)
        # a generator of its own: the numbers depend on the seed alone
        generator = np.random.default_rng(self.seed)
        if self.method == "random":
            uniform = generator.random((self.samples, number))
        else:
            engines = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}
            uniform = engines[self.method](number, rng=generator).random(self.samples)
        columns = np.maximum(uniform.T, _LEAST)
        if self.correlation:
            columns = norm.cdf(np.linalg.cholesky(self._matrix()) @ norm.ppf(columns))
            columns = np.clip(columns, _LEAST, 1.0 - 2.0**-53)
        return {
            name: one.draws(column) for (name, one), column in zip(self.distributions.items(), columns, strict=True)
        }

    def _matrix(self) -> Floats:
        names = list(self.distributions)
        matrix = np.eye(len(names))
        for first, second, value in self.correlation:
            i, j = names.index(first), names.index(second)
            matrix[i, j] = matrix[j, i] = value
        return matrix

    def check_given(self, given: Sequence[str]) -> None:
        """Refuse parameters both given and drawn, and factors on nothing.

        Raises
        ------
        InputError
        """
        for name, one in self.distributions.items():
            if one.kind == "absolute" and name in given:
                raise InputError(
                    f'{self.key(name)}: is drawn, but {name} is given as well: take it away, or give kind = "factor" '
                    'or "offset" to draw about what is given'
                )
            estimated = name in _ESTIMATED and (one.kind == "factor" or name == "yield_acceleration")
            if one.kind != "absolute" and name not in given and not estimated:
                raise InputError(f'{self.key(name)}: kind = "{one.kind}" wants {name} given, which it is relative to')

    @property
    def attributes(self) -> dict[str, Any]:
        """What results say of how they were sampled; with it they can be drawn again."""
        from scipy import __version__

        correlation = {"correlation": json.dumps(self.correlation)} if self.correlation else {}
        return {
            "uncertain": json.dumps({name: one.about for name, one in self.distributions.items()}),
            "samples": self.samples,
            "sampling": f"{self.method} (scipy {__version__})",
            "seed": self.seed,
            **correlation,
        }


# --------------------------------------------------------------------------------- checking


def check_sampling(
    uncertain: Any,
    *,
    samples: Any,
    method: Any,
    seed: Any,
    quantiles: Any,
    thresholds: Any,
    correlation: Any,
    g: float,
    keys: str = "",
) -> Sampling:
    """Check what is uncertain and how it is sampled.

    Parameters
    ----------
    uncertain : mapping of str to mapping or frozen distribution
    samples, method, seed, quantiles, thresholds, correlation
        As `slipsweep.sample`.
    g : float
        What "g" as a unit of acceleration stands for, m/s².
    keys : str
        What stands before option names in errors.

    Raises
    ------
    InputError
        The first thing that is not allowed.
    """
    if not isinstance(uncertain, Mapping) or not uncertain:
        raise InputError(
            f"{keys or 'uncertain'}: must give the distribution of one parameter at least: {', '.join(DRAWN)}"
        )
    for name in uncertain:
        if name not in DRAWN:
            raise InputError(f"{keys or 'uncertain.'}{name}: cannot be drawn; {did_you_mean(str(name), DRAWN)}")
    # in one order, whatever that of the caller: the draws are then the same
    distributions = {
        name: _distribution(f"{keys or 'uncertain.'}{name}", name, uncertain[name], g)
        for name in DRAWN
        if name in uncertain
    }
    for other in ("displacement_amplitude", "scale"):
        if {"amplitude", other} <= distributions.keys():
            raise InputError(f"{keys or 'uncertain.'}{other}: not allowed beside amplitude")

    method = check_choice(f"{keys}method", method, METHODS)
    samples = check_whole(f"{keys}samples", samples, 2, MOST_SAMPLES)
    if method == "sobol" and samples & (samples - 1):
        below = 1 << (samples.bit_length() - 1)
        raise InputError(
            f'{keys}samples = {samples}: must be a power of 2 with method = "sobol", such as {below} or {2 * below}; '
            "latin_hypercube takes any number"
        )
    wanted = _increasing(f"{keys}quantiles", quantiles, "quantile")
    thresholds = computed(thresholds)
    strings = isinstance(thresholds, np.ndarray) and thresholds.ndim and thresholds.dtype.kind in "UO"
    if isinstance(thresholds, (list, tuple)) or strings:
        thresholds = check_list(f"{keys}thresholds", thresholds, "displacements")
    if isinstance(thresholds, (str, list)):
        thresholds = [
            quantity(f"{keys}thresholds", one, "displacement_amplitude", g) if isinstance(one, str) else one
            for one in ([thresholds] if isinstance(thresholds, str) else thresholds)
        ]
    limits = _increasing(f"{keys}thresholds", thresholds, "threshold")
    pairs = _pairs(f"{keys}correlation", correlation, distributions)
    sampling = Sampling(
        distributions, samples, method, check_whole(f"{keys}seed", seed, 0, _MOST_SEED), wanted, limits, pairs, keys
    )
    if pairs and np.linalg.eigvalsh(sampling._matrix()).min() < 1e-12:
        raise InputError(f"{keys}correlation = {list(pairs)}: no such correlations exist together (not positive)")
    return sampling


def _distribution(key: str, parameter: str, given: Any, g: float) -> Distribution:
    """One entry of `uncertain`."""
    entries = dict(given) if isinstance(given, Mapping) else {"distribution": given}
    if "distribution" not in entries:
        raise InputError(f"{key}.distribution: missing: the name of a continuous distribution of scipy.stats")
    chosen = entries.pop("distribution")
    kind = check_choice(f"{key}.kind", entries.pop("kind", "absolute"), KINDS)
    units = entries.pop("units", None)
    if units is not None and kind == "factor":
        raise InputError(f"{key}.units = {shown(units)}: not allowed with kind = 'factor', which has no unit")
    if units is not None and not isinstance(units, str):
        raise InputError(
            f"{key}.units = {shown(units)}: must be a unit that converts to {PARAMETERS[parameter]['units']}"
        )
    if isinstance(chosen, str):
        frozen = _named(key, chosen, entries)
    elif not callable(getattr(chosen, "ppf", None)):
        raise InputError(
            f"{key}.distribution = {shown(chosen)}: must be the name of a distribution of scipy.stats, or a frozen one"
        )
    elif entries:
        raise InputError(f"{key}.{next(iter(entries))}: not allowed beside a frozen distribution, which has its own")
    else:
        frozen = chosen
    try:
        with np.errstate(all="ignore"):
            middle = check_numbers(f"{key}: its median", frozen.ppf(0.5))
    except InputError:
        raise
    except Exception as error:  # of a class that is not ours
        raise InputError(f"{key}.distribution = {shown(chosen)}: its median cannot be had: {shown(error)}") from None
    if middle.ndim:
        raise InputError(f"{key}: is {middle.size} distributions; must be one")
    about = _described(frozen)
    if not np.isfinite(middle):
        raise InputError(f"{key}: parameters that scipy.stats does not allow: {about}")
    if units is not None:
        about["units"] = units
    factor = unit_factor(f"{key}.units", parameter, units, g)
    return Distribution(parameter, kind, frozen, factor, {**about, "kind": kind})


def _numbers(key: str, given: Mapping[str, Any]) -> dict[str, float]:
    """Parameters of a distribution as floats."""
    numbers = {}
    for name, value in given.items():
        numbers[str(name)] = check_finite(f"{key}.{name}", value)
    return numbers


def _named(key: str, name: str, given: Mapping[str, Any]) -> Any:
    """A distribution of scipy.stats with its parameters, frozen."""
    from scipy import stats

    known = [one for one in dir(stats) if isinstance(getattr(stats, one), stats.rv_continuous)]
    if name not in known:
        hint = did_you_mean(name, known)
        if hint.startswith("known here"):
            hint = f"it must be a continuous one of scipy.stats, such as {', '.join(_USUAL)}"
        raise InputError(f'{key}.distribution = "{name}": no such distribution; {hint}')
    family = getattr(stats, name)
    shapes = [shape.strip() for shape in (family.shapes or "").split(",") if shape.strip()]
    for parameter in given:
        if parameter not in (*shapes, "loc", "scale"):
            allowed = ("distribution", "kind", "units", *shapes, "loc", "scale")
            raise InputError(f"{key}.{parameter}: unknown key; {did_you_mean(str(parameter), allowed)}")
    for shape in shapes:
        if shape not in given:
            raise InputError(f"{key}.{shape}: missing: {name} needs {', '.join(shapes)}")
    return family(**_numbers(key, given))


def _described(frozen: Any) -> dict[str, Any]:
    """A frozen distribution in words and numbers."""
    family = getattr(frozen, "dist", None)
    if family is None:
        return {"distribution": repr(frozen)}
    shapes = [shape.strip() for shape in (family.shapes or "").split(",") if shape.strip()]
    numbers = dict(zip((*shapes, "loc", "scale"), frozen.args, strict=False)) | frozen.kwds
    return {"distribution": family.name, **{name: float(value) for name, value in numbers.items()}}


def _increasing(key: str, given: Any, bound: str) -> Floats:
    """A list of numbers, one at least, as an increasing coordinate."""
    values = np.atleast_1d(check_values(bound, given, key))
    if values.ndim > 1 or not values.size:
        raise InputError(f"{key} = {shown(given)}: must be a list of one number or more")
    for before, after in itertools.pairwise(values):
        if after <= before:
            raise InputError(
                f"{key}: {number_text(float(after))} after {number_text(float(before))}: they must increase"
            )
    return values


def _pairs(key: str, given: Any, known: Mapping[str, Distribution]) -> tuple[tuple[str, str, float], ...]:
    """Correlations: pairs of drawn parameters with a number between -1 and 1."""
    pairs: dict[frozenset[str], tuple[str, str, float]] = {}
    for entry in () if given is None else check_list(key, given, '["NAME", "OTHER", NUMBER]'):
        try:
            first, second, value = check_list(key, entry, "names and a number")
            value = check_finite(key, value)
        except ValueError:  # as InputError is
            raise InputError(f'{key} = {shown(entry)}: must be ["NAME", "OTHER", NUMBER]') from None
        for name in (first, second):
            if not isinstance(name, str) or name not in known:
                raise InputError(f"{key}: {shown(name)} is not drawn; {did_you_mean(str(name), tuple(known))}")
        pair = frozenset((first, second))
        if first == second or pair in pairs:
            raise InputError(f"{key}: {first}, {second}: must be two different parameters, and each pair once")
        if not -1.0 < value < 1.0:
            raise InputError(f"{key}: {first}, {second} = {number_text(value)}: must be between -1 and 1")
        pairs[pair] = (str(first), str(second), value)
    return tuple(pairs.values())


def _check_draws(
    sampling: Sampling, draws: Mapping[str, Floats], names: Sequence[str], coords: Mapping[str, Variable]
) -> None:
    """Refuse draws of some parameters that no physics allows, anywhere on the grid."""
    for name in names:
        one = sampling.distributions[name]
        if one.kind == "absolute":
            bases: list[float | None] = [None]
        elif name in coords:
            bases = [float(coords[name].values.min()), float(coords[name].values.max())]
        elif one.kind == "factor":
            bases = [1.0]  # on an estimate, whose own failure is a flag of the result
        else:
            bases = [0.0]
        bound = BOUNDS[name]
        # each draw's value is monotone in what it is applied to: the ends of the axis are its extremes
        outside = [float(np.mean(~bound.holds(one.applied(base, draws[name])))) for base in bases]
        if not any(outside):
            continue
        worst = int(np.argmax(outside))
        base = bases[worst]
        about = f" as {one.kind} on {name} = {base:.6g}" if base is not None and name in coords else ""
        raise InputError(
            f"{sampling.key(name)} = {one}{about}: {outside[worst]:.2%} of the draws are not {bound.text}: "
            "take a distribution that has none there, such as lognorm, or truncate it (truncnorm)"
        )


# --------------------------------------------------------------------------------- sampling


def plan_samples(sampling: Sampling, **given: Any) -> "SamplePlan":
    """Plan of the samples of a grid, drawn and checked.

    Parameters
    ----------
    sampling : Sampling
    **given
        Keyword arguments of `plans.plan_sweep` but for `variables`.

    Raises
    ------
    InputError
        As `slipsweep.sample`.
    """
    names = [name for name in PARAMETERS if given.get(name) is not None]
    if "structure_frequency" in names:
        raise InputError("structure_frequency: not allowed with uncertain inputs: it flags cells, and moves none")
    recorded = isinstance(given.get("excitation"), Record)
    _check_drawn(sampling, names, recorded, MODELS.of(given.get("model", "mendez")))
    sampling.check_given(names)
    for name in ("theta", "mu_s", *(() if recorded else ("frequency",))):
        if name not in (*names, *sampling.absolute):
            raise InputError(f"{name}: must be given, or drawn")
    draws = sampling.draws()
    _check_draws(sampling, draws, sampling.absolute, {})
    # what has no value of its own is planned for with one of its draws
    stand_ins = {name: float(draws[name][0]) for name in sampling.absolute}
    plan = plan_sweep(**{**given, **stand_ins}, variables=["permanent_displacement"])
    dropped = {*stand_ins}
    if "displacement_amplitude" in plan.coords and {"displacement_amplitude", "frequency"} & dropped:
        dropped.add("amplitude")  # A = ω²d of the stand-ins is nobody's amplitude
    coords = {name: variable for name, variable in plan.coords.items() if name not in dropped}
    _check_draws(sampling, draws, [name for name in sampling.distributions if name not in stand_ins], coords)
    kinds = {name: one.kind for name, one in sampling.distributions.items()}
    inputs = friction_inputs(plan.tasks[0].problem.model.name, coords, kinds)
    attrs = {**plan.attrs, "title": TITLE, "friction_inputs": inputs, **sampling.attributes}
    return SamplePlan(sampling, draws, plan.tasks[0].problem, coords, attrs)


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
                f'{sampling.key(name)}: kind = "{one.kind}" wants {name} given: under a record each pulse has an '
                "estimate of its own"
            )


class SamplePlan:
    """The samples of every grid point: cells along `solved` dimensions, frequencies along `scaled` ones.

    A plan as all others are (`anyplan.AnyPlan`); its parts have the draws of the whole.  Under a record the inverse of
    the time scale stands for the frequency, and there is no sliding mode.
    """

    cell_memory = 0

    def __init__(
        self,
        sampling: Sampling,
        draws: Mapping[str, Floats],
        problem: Problem,
        coords: dict[str, Variable],
        attrs: dict[str, Any],
    ) -> None:
        self.sampling, self.draws, self.problem = sampling, draws, problem
        self.coords, self.attrs = coords, attrs
        self.by_displacement = "displacement_amplitude" in {*coords, *draws}
        recorded = isinstance(problem.excitation, Record)
        self.clock = clock = "time_scale" if recorded else "frequency"
        self.names = tuple(name for name in _STATISTICS if not (recorded and name == "mode_share"))
        own = {
            name: variable
            for name, variable in coords.items()
            if name != clock and not (name == "amplitude" and self.by_displacement)
        }
        everything = own | ({clock: coords[clock]} if clock in coords else {})
        offset = clock in draws and sampling.distributions[clock].kind == "offset"
        # A = ω²d, and (f + offset)/f, depend on the frequency itself: no scaling law along its dimensions then
        self.sizes = grid_sizes(everything)
        check_dimensions(self.sizes, coords, {*STATISTICS, *STATISTIC_COORDINATES})
        self.solved = grid_sizes(everything if self.by_displacement or offset else own)
        self.scaled = {dim: size for dim, size in self.sizes.items() if dim not in self.solved}
        self.base = aligned(everything if clock in everything and not self.scaled else own, self.solved)

        dims = (*self.solved, *self.scaled)
        frequency = coords.get(clock, Variable((), np.ones(())))
        shape = (*self.solved.values(), math.prod(self.scaled.values()))
        lengths = [frequency.sizes.get(dim, 1) for dim in dims]
        axes = [frequency.dims.index(dim) for dim in dims if dim in frequency.dims]
        values = np.broadcast_to(frequency.values.transpose(axes).reshape(lengths), [self.sizes[dim] for dim in dims])
        self.frequency: Floats = 1.0 / values.reshape(shape) if recorded else values.reshape(shape)

    def __reduce__(self) -> tuple[Any, ...]:
        # to another process goes what is drawn from, a few numbers, and not what was drawn
        return _drawn_again, (self.sampling, self.problem, self.coords, self.attrs)

    @property
    def cells(self) -> int:
        """Number of samples to solve, of all grid points."""
        return math.prod(self.solved.values()) * self.sampling.samples

    @property
    def is_ordinary(self) -> bool:
        """Whether no statistic can be too large for double precision."""
        given = {name: one.values for name, one in self.coords.items()}
        for name, one in self.sampling.distributions.items():
            base = given.get(name, np.ones(1)).reshape(-1, 1)
            ends = np.array([[base.min()], [base.max()]])
            given[name] = one.applied(ends, self.draws[name])
        return engine.are_ordinary(self.problem, given)

    @property
    def cost(self) -> float:
        """What a grid point takes, in cells of the cycle solver."""
        return max(1.0, cost_of(self.problem) * self.sampling.samples / math.prod(self.scaled.values()))

    @property
    def together(self) -> tuple[str, ...]:
        """Dimensions along which the same samples serve."""
        return tuple(self.scaled)

    @property
    def memory(self) -> int:
        """Bytes of the draws, while they are made, and of the samples that are solved together."""
        samples, drawn = self.sampling.samples, len(self.draws)
        return 24 * samples * drawn + self._points * samples * (8 * (2 + drawn) + 11)

    @property
    def _points(self) -> int:
        """Grid points solved together."""
        return max(_CELLS // self.sampling.samples, 1)

    def part(self, chunk: Chunk) -> "SamplePlan":
        """The plan cut to a chunk of its grid."""
        coords = {name: one.cut(chunk) for name, one in self.coords.items()}
        return SamplePlan(self.sampling, self.draws, self.problem, coords, self.attrs)

    def empty(self) -> Table:
        """The statistics with their dimensions and coordinates but no values: zeros that take no memory."""
        return self._table(lambda shape, dtype: np.broadcast_to(np.zeros((), dtype), shape))

    def _table(self, empty: Empty) -> Table:
        """The statistics, in arrays that `empty` makes."""
        coordinates: dict[str, NDArray[Any]] = {
            "quantile": self.sampling.quantiles,
            "threshold": self.sampling.thresholds,
            "mode": np.array([int(mode) for mode in SlidingMode if mode is not SlidingMode.MISSING], np.int8),
            "flag": np.array([int(flag) for flag in Validity], np.int16),
        }
        results = {}
        for name in self.names:
            own = _STATISTICS[name]
            over = [dim for dim in self.sizes if name in _BY_FREQUENCY or dim in self.solved]
            shape = (*(self.sizes[dim] for dim in over), *(coordinates[dim].size for dim in own))
            results[name] = Variable((*over, *own), empty(shape, "float64"), STATISTICS[name])
        coords = {
            name: Variable((name,), values, STATISTIC_COORDINATES[name])
            for name, values in coordinates.items()
            if any(name in _STATISTICS[one] for one in self.names)
        }
        return Table(self.coords | coords, results, self.attrs)

    def solve(self, progress: Callable[[int], None] | None = None, empty: Empty = np.empty) -> Table:
        """Solve the samples slab by slab, and reduce them to what `slipsweep.sample` returns.

        Parameters
        ----------
        progress : callable, optional
            Called with a number of samples just solved, from any thread.
        empty : callable, optional
            Makes the arrays of the statistics.
        """
        check_progress(progress)
        samples = self.sampling.samples
        check_memory(
            f"grid of {grid_text(self.sizes) or 'one point'}, {samples} samples",
            self.memory + sum(one.values.size * 8 for one in self.empty().data_vars.values()),
            "ask for fewer samples, grid points, quantiles or thresholds",
        )
        table = self._table(empty)
        # cells first, their frequencies after them, wherever these have their places among the others
        order = [*self.solved, *self.scaled]
        views = {
            name: one.values.transpose(
                [*(one.dims.index(dim) for dim in order if dim in one.dims), *map(one.dims.index, _STATISTICS[name])]
            )
            for name, one in table.data_vars.items()
        }
        for slab in slabs(tuple(self.solved.values()), self._points):
            where: Any = (*slab, ...)
            frequencies = self.frequency[where].reshape(-1, self.frequency.shape[-1])
            for name, values in self._reduce(self._solve(slab, progress), frequencies).items():
                target = views[name][where]
                target[...] = values.reshape(target.shape)
        return table

    def tally(self, results: Mapping[str, NDArray[Any]]) -> Tally:
        """Samples by sliding mode and by flag, from their shares."""
        shares = [name for name in ("mode_share", "flag_share", "valueless_share") if name in self.names]
        if not {*shares} <= results.keys():
            return Tally()
        counts = {name: np.rint(results[name] * np.float64(self.sampling.samples)).astype(np.int64) for name in shares}
        by_flag = dict(zip(Validity, counts["flag_share"].reshape(-1, len(Validity)).sum(0).tolist(), strict=True))
        if "mode_share" not in counts:
            return Tally(0, None, by_flag)
        known: list[SlidingMode] = [mode for mode in SlidingMode if mode is not SlidingMode.MISSING]
        by_mode = dict(zip(known, counts["mode_share"].reshape(-1, len(known)).sum(0).tolist(), strict=True))
        return Tally(0, {SlidingMode.MISSING: int(counts["valueless_share"].sum()), **by_mode}, by_flag)

    def _solve(self, slab: tuple[slice, ...], progress: Callable[[int], None] | None) -> dict[str, NDArray[Any]]:
        """Displacement (at 1 Hz or, where it is drawn, at the frequency over the grid's), mode and flags of a slab.

        Under a record at time scale 1, or at the one drawn over the grid's.
        """
        base = {name: values[..., None] for name, values in engine.cut(self.base, slab).items()}
        one = np.ones((1,) * (len(slab) + 1))
        clock = self.clock
        frequency = base.pop(clock, one)
        drawn = self.sampling.distributions
        arrays = {
            name: drawn[name].applied(base.get(name), self._row(name, len(slab))) if name in drawn else base[name]
            for name in (*DRAWN, "polarity")
            if name != clock and (name in base or (name in drawn and drawn[name].kind == "absolute"))
        }
        relative = one
        if clock in drawn:
            row = self._row(clock, len(slab))
            relative = 1.0 + row / frequency if drawn[clock].kind == "offset" else row
        if self.by_displacement:
            omega = 2.0 * math.pi * relative * frequency
            arrays["amplitude"] = omega * omega * arrays.pop("displacement_amplitude")
        lengths = (*(part.stop - part.start for part in slab), self.sampling.samples)
        for name in _ESTIMATED:
            if name in drawn and name not in arrays:
                arrays[name] = self._about_estimate(drawn[name], arrays, lengths)
        arrays[clock] = relative
        modes = ("sliding_mode",) if "mode_share" in self.names else ()
        names = ("permanent_displacement", *modes, "validity")
        return engine.solve(Request(self.problem, lengths, arrays, names, progress))

    def _row(self, name: str, dimensions: int) -> Floats:
        return self.draws[name].reshape((1,) * dimensions + (-1,))

    def _about_estimate(self, one: Distribution, arrays: Mapping[str, Floats], shape: tuple[int, ...]) -> Floats:
        """A parameter drawn about its estimate; NaN, which leaves it to the estimate and its flag, where that fails."""
        name = one.parameter
        assert name in FRICTION_PARAMETERS
        dims = np.broadcast_shapes(*(values.shape for values in arrays.values()))
        full = tuple(max(a, b) for a, b in zip(dims, (1,) * len(shape), strict=True))
        estimate = engine.estimates(Request(self.problem, full, arrays, (name,)))[name]
        values = one.applied(estimate, self._row(name, len(shape) - 1))
        return np.where(BOUNDS[name].holds(values), values, np.nan)

    def _reduce(self, solved: Mapping[str, NDArray[Any]], frequency: Floats) -> dict[str, Floats]:
        """Statistics of the samples of each cell (rows), for each of its frequencies (columns)."""
        samples = self.sampling.samples
        rows_of = {name: values.reshape(-1, samples) for name, values in solved.items()}
        displacement, flags, modes = (
            rows_of["permanent_displacement"],
            rows_of["validity"],
            rows_of.get("sliding_mode"),
        )
        rows, squares = frequency.shape[0], frequency**2
        quantiles, thresholds = self.sampling.quantiles, self.sampling.thresholds
        found = {
            "displacement_quantile": np.full((*squares.shape, quantiles.size), np.nan),
            "mean_displacement": np.full(squares.shape, np.nan),
            "exceedance_probability": np.full((*squares.shape, thresholds.size), np.nan),
            **({} if modes is None else {"mode_share": np.empty((rows, 3))}),
            "flag_share": np.empty((rows, len(Validity))),
            "valueless_share": np.empty(rows),
        }
        codes = 1 + sum(Validity)
        bits = np.array([[code & int(flag) != 0 for flag in Validity] for code in range(codes)], np.float64)

        def work(first: int, last: int) -> None:
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite then is refused below
                for row in range(first, last):
                    values = displacement[row]
                    values.sort()  # NaN goes last
                    count = int(np.searchsorted(values, np.nan))
                    if modes is not None:
                        found["mode_share"][row] = np.bincount(modes[row] + 1, minlength=4)[1:] / samples
                    found["flag_share"][row] = np.bincount(flags[row], minlength=codes) @ bits / samples
                    found["valueless_share"][row] = (samples - count) / samples
                    if not count:
                        continue
                    there, square = values[:count], squares[row][:, None]
                    found["displacement_quantile"][row] = _quantiles(there, quantiles) / square
                    found["mean_displacement"][row] = there.mean() / squares[row]
                    above = count - np.searchsorted(there, thresholds * square, side="right")
                    found["exceedance_probability"][row] = above / count

        # sorting and counting take about an eighth of what solving takes
        threads.spread(rows, work, max(samples // 8, 1))
        for name in ("displacement_quantile", "mean_displacement"):
            there = found["valueless_share"][:, None] < 1.0
            wrong = (~np.isfinite(found[name].reshape(*squares.shape, -1)).all(axis=-1)) & there
            if wrong.any():
                worst = number_text(float(frequency[wrong].flat[0]))
                clock = "frequency" if self.clock == "frequency" else "1 / time_scale"
                raise InputError(f"{clock} = {worst}: {name} is then no finite number; must be nearer to 1")
        return found


def _drawn_again(
    sampling: Sampling, problem: Problem, coords: dict[str, Variable], attrs: dict[str, Any]
) -> SamplePlan:
    """The plan that another process has sent."""
    return SamplePlan(sampling, _draws_of(pickle.dumps(sampling)), problem, coords, attrs)


@functools.lru_cache(maxsize=1)
def _draws_of(sampling: bytes) -> dict[str, Floats]:
    """Draws of a sampling that was sent: of one part after the other the same."""
    sent: Sampling = pickle.loads(sampling)
    return sent.draws()


def _quantiles(ordered: Floats, wanted: Floats) -> Floats:
    """Quantiles of sorted values, linear between them (numpy's default)."""
    place = wanted * (ordered.size - 1)
    below = np.floor(place).astype(np.intp)
    above = np.minimum(below + 1, ordered.size - 1)
    return np.asarray(ordered[below] + (place - below) * (ordered[above] - ordered[below]))
