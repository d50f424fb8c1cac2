"""How uncertain inputs are drawn: distributions of scipy.stats by quasi-random numbers of scipy.stats.qmc, checked."""

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model.parameters import (
    BOUNDS,
    check_choice,
    check_finite,
    check_list,
    check_numbers,
    check_values,
    check_whole,
    computed,
    number_text,
    shown,
)
from slipsweep.model.units import conversion, quantity
from slipsweep.model.variables import DRAWN, PARAMETERS

Floats = NDArray[np.float64]

#: What a caller may give as displacements: m, or with a unit.
Thresholds = float | str | Sequence[float | str] | np.ndarray

KINDS = ("absolute", "factor", "offset")

METHODS = ("sobol", "latin_hypercube", "random")

#: Parameters that have an estimate where they are not given, in the order in which each needs those before it.
ESTIMATED = ("yield_acceleration", "minimum_friction", "delta_mu", "decay_rate")

#: Most samples a grid point: 2**24 take about 1.5 GB.
MOST_SAMPLES = 2**24

#: Attributes hold 32 bits.
_MOST_SEED = 2**31 - 1

#: Distributions that errors name.
_USUAL = ("norm", "lognorm", "uniform", "triang", "truncnorm", "beta", "gamma", "weibull_min")

#: Half of the last digit of scipy's Sobol numbers, some of which are 0: the quantile there may be infinite.
_LEAST = 2.0**-31


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

    def applied(self, base: Any, draws: Any) -> Any:
        """The parameter's values: draws, or draws with the values they are relative to."""
        if self.kind == "absolute":
            return draws
        with np.errstate(over="ignore"):
            return base * draws if self.kind == "factor" else base + draws


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
    sensitivity : bool
        Whether Sobol indices are wanted.
    over : tuple of str
        Dimensions of the grid whose values are equally likely draws.
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
    sensitivity: bool
    over: tuple[str, ...]
    keys: str

    @property
    def absolute(self) -> tuple[str, ...]:
        """Parameters whose draws are their values."""
        return tuple(name for name, one in self.distributions.items() if one.kind == "absolute")

    def key(self, parameter: str) -> str:
        """What a distribution is called in errors."""
        return f"{self.keys or 'uncertain.'}{parameter}"

    @property
    def independent(self) -> tuple[tuple[str, ...], ...]:
        """The parameters, those that are correlated with one another together, in the order of `distributions`."""
        from scipy.sparse.csgraph import connected_components

        number, group = connected_components(self._matrix(), directed=False)
        names = [*self.distributions]
        return tuple(tuple(name for name, own in zip(names, group, strict=True) if own == k) for k in range(number))

    @property
    def sensitivity_runs(self) -> int:
        """Runs that the Sobol indices of a grid point take; 0 where none are wanted."""
        return self.samples * (len(self.independent) + 2) if self.sensitivity else 0

    def draws(self, sets: int = 1) -> list[dict[str, Floats]]:
        """Draw all parameters, in sets that are independent of each other: arrays of `samples`, the same each time."""
        number = len(self.distributions)
        uniform = self._uniform(sets * number)
        return [self._draws(uniform[at * number : (at + 1) * number]) for at in range(sets)]

    def _uniform(self, dimensions: int) -> Floats:
        """Numbers from 0 to 1 that fill a cube of so many dimensions: (dimension, sample)."""
        from scipy.stats import qmc

        # a generator of its own: the numbers depend only on the seed
        generator = np.random.default_rng(self.seed)
        if self.method == "random":
            uniform = generator.random((self.samples, dimensions))
        else:
            engines = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}
            uniform = engines[self.method](dimensions, rng=generator).random(self.samples)
        return np.maximum(uniform.T, _LEAST)

    def _draws(self, uniform: Floats) -> dict[str, Floats]:
        """Turn a row of numbers from 0 to 1 for each parameter into draws."""
        from scipy.stats import norm

        if self.correlation:
            uniform = norm.cdf(np.linalg.cholesky(self._matrix()) @ norm.ppf(uniform))
            uniform = np.clip(uniform, _LEAST, 1.0 - 2.0**-53)
        return {name: one.draws(row) for (name, one), row in zip(self.distributions.items(), uniform, strict=True)}

    def _matrix(self) -> Floats:
        """Correlations of all parameters."""
        names = list(self.distributions)
        matrix = np.eye(len(names))
        for first, second, value in self.correlation:
            i, j = names.index(first), names.index(second)
            matrix[i, j] = matrix[j, i] = value
        return matrix

    def check_given(self, given: Sequence[str]) -> None:
        """Refuse parameters both given and drawn, those that others replace, and factors on nothing.

        Raises
        ------
        InputError
        """
        for name, one in self.distributions.items():
            if one.kind == "absolute" and name in given:
                raise InputError(
                    f'{self.key(name)}: is drawn, but {name} is given as well: remove it, or give kind = "factor" '
                    'or "offset" to draw about what is given'
                )
            estimated = name in ESTIMATED and (one.kind == "factor" or name == "yield_acceleration")
            if one.kind != "absolute" and name not in given and not estimated:
                raise InputError(f'{self.key(name)}: kind = "{one.kind}" needs {name} given, to which it is relative')
        if "yield_acceleration" in self.distributions and "yield_coefficient" in {*given, *self.distributions}:
            raise InputError(f"{self.key('yield_acceleration')}: not allowed with yield_coefficient, which replaces it")

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
    sensitivity: Any = False,
    over: Any = (),
    keys: str = "",
) -> Sampling:
    """Check what is uncertain and how it is sampled.

    Parameters
    ----------
    uncertain : mapping of str to mapping or frozen distribution
    samples, method, seed, quantiles, thresholds, correlation, sensitivity, over
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
    named = {name: f"{keys or 'uncertain.'}{name}" for name in uncertain}
    for name, key in named.items():
        if name not in DRAWN:
            raise InputError(f"{key}: cannot be drawn; {did_you_mean(str(name), DRAWN)}")
    # in one order, whatever that of the caller: the draws are then the same
    drawn = {name: distribution_of(named[name], name, uncertain[name], g) for name in DRAWN if name in uncertain}
    method = check_choice(f"{keys}method", method, METHODS)
    samples = check_whole(f"{keys}samples", samples, 2, MOST_SAMPLES)
    if method == "sobol" and samples & (samples - 1):
        below = 1 << (samples.bit_length() - 1)
        raise InputError(
            f'{keys}samples = {samples}: must be a power of 2 with method = "sobol", such as {below} or {2 * below}; '
            "latin_hypercube takes any number"
        )
    if not isinstance(sensitivity, (bool, np.bool_)):
        raise InputError(f"{keys}sensitivity = {shown(sensitivity)}: must be true or false")
    pooled = [over] if isinstance(over, str) else check_list(f"{keys}over", over, "dimensions")
    if pooled and sensitivity:
        raise InputError(f"{keys}sensitivity = true: not allowed with {keys}over: indices are of drawn inputs only")
    sampling = Sampling(
        distributions=drawn,
        samples=samples,
        method=method,
        seed=check_whole(f"{keys}seed", seed, 0, _MOST_SEED),
        quantiles=check_quantiles(f"{keys}quantiles", quantiles),
        thresholds=check_thresholds(f"{keys}thresholds", thresholds, g),
        correlation=_pairs(f"{keys}correlation", correlation, drawn),
        sensitivity=bool(sensitivity),
        over=tuple(map(str, pooled)),
        keys=keys,
    )
    if sampling.correlation and np.linalg.eigvalsh(sampling._matrix()).min() < 1e-12:
        raise InputError(f"{keys}correlation: no such correlations exist together (their matrix is not positive)")
    if sampling.sensitivity_runs > MOST_SAMPLES:
        raise InputError(
            f"{keys}samples = {samples}: Sobol indices take {sampling.sensitivity_runs} runs a grid point with these; "
            f"must be {MOST_SAMPLES} at most"
        )
    return sampling


def distribution_of(key: str, parameter: str, given: Any, g: float) -> Distribution:
    """One entry of `uncertain`, called `key` in errors."""
    entries = dict(given) if isinstance(given, Mapping) else {"distribution": given}
    if "distribution" not in entries:
        raise InputError(f"{key}.distribution: missing: the name of a continuous distribution of scipy.stats")
    chosen = entries.pop("distribution")
    kind = check_choice(f"{key}.kind", entries.pop("kind", "absolute"), KINDS)
    units = entries.pop("units", None)
    if units is not None and (kind == "factor" or not isinstance(units, str)):
        raise InputError(
            f"{key}.units = {shown(units)}: not allowed with kind = 'factor', else a unit that converts to "
            f"{PARAMETERS[parameter]['units']}"
        )
    if isinstance(chosen, str):
        frozen = _frozen(key, chosen, entries)
    elif callable(getattr(chosen, "ppf", None)) and not entries:
        frozen = chosen
    else:
        raise InputError(
            f"{key}.distribution = {shown(chosen)}: must be the name of a distribution of scipy.stats, with its "
            "parameters, or a frozen one without"
        )
    about = _described(frozen)
    with np.errstate(all="ignore"):
        median = check_numbers(f"{key}: its median", frozen.ppf(0.5))
    if median.ndim or not np.isfinite(median):
        raise InputError(f"{key}: parameters that scipy.stats does not allow for one distribution: {about}")
    factor = conversion(f"{key}.units", PARAMETERS[parameter]["units"], units, g)
    return Distribution(
        parameter, kind, frozen, factor, {**about, **({"units": units} if units is not None else {}), "kind": kind}
    )


def _frozen(key: str, name: str, given: Mapping[str, Any]) -> Any:
    """A distribution of scipy.stats with its parameters."""
    from scipy import stats

    family = getattr(stats, name, None)
    if not isinstance(family, stats.rv_continuous):
        known = [one for one in dir(stats) if isinstance(getattr(stats, one), stats.rv_continuous)]
        hint = did_you_mean(name, known)
        if hint.startswith("known here"):
            hint = f"it must be a continuous one of scipy.stats, such as {', '.join(_USUAL)}"
        raise InputError(f'{key}.distribution = "{name}": no such distribution; {hint}')
    shapes = _shapes(family)
    for parameter in given:
        if parameter not in (*shapes, "loc", "scale"):
            allowed = ("distribution", "kind", "units", *shapes, "loc", "scale")
            raise InputError(f"{key}.{parameter}: unknown key; {did_you_mean(str(parameter), allowed)}")
    for shape in shapes:
        if shape not in given:
            raise InputError(f"{key}.{shape}: missing: {name} needs {', '.join(shapes)}")
    return family(**{parameter: check_finite(f"{key}.{parameter}", value) for parameter, value in given.items()})


def _shapes(family: Any) -> list[str]:
    """Names of a distribution's shape parameters."""
    return [shape.strip() for shape in (family.shapes or "").split(",") if shape.strip()]


def _described(frozen: Any) -> dict[str, Any]:
    """A frozen distribution in words and numbers."""
    family = getattr(frozen, "dist", None)
    if family is None:
        return {"distribution": repr(frozen)}
    numbers = dict(zip((*_shapes(family), "loc", "scale"), frozen.args, strict=False)) | frozen.kwds
    return {"distribution": family.name, **{name: float(value) for name, value in numbers.items()}}


def check_quantiles(key: str, given: Any) -> Floats:
    """Quantiles, one at least, as an increasing coordinate."""
    return _increasing(key, given, "quantile")


def check_thresholds(key: str, given: Any, g: float) -> Floats:
    """Displacements, m or with a unit, one at least, as an increasing coordinate."""
    entries = np.atleast_1d(np.asarray(computed(given), object)).tolist()
    values = [quantity(key, one, "m", g) if isinstance(one, str) else one for one in entries]
    return _increasing(key, values, "threshold")


def _increasing(key: str, given: Any, bound: str) -> Floats:
    """A list of numbers, one at least, as an increasing coordinate."""
    values = np.atleast_1d(check_values(bound, given, key))
    if values.ndim > 1 or not values.size:
        raise InputError(f"{key} = {shown(given)}: must be a list of one number or more")
    for before, after in itertools.pairwise(map(float, values)):
        if after <= before:
            raise InputError(f"{key}: {number_text(after)} after {number_text(before)}: they must increase")
    return values


def _pairs(key: str, given: Any, known: Mapping[str, Distribution]) -> tuple[tuple[str, str, float], ...]:
    """Correlations: pairs of drawn parameters with a number between -1 and 1."""
    pairs: dict[frozenset[str], tuple[str, str, float]] = {}
    for entry in check_list(key, given, '["NAME", "OTHER", NUMBER]'):
        one = check_list(key, entry, "two names and a number")
        if len(one) != 3:
            raise InputError(f'{key} = {shown(entry)}: must be ["NAME", "OTHER", NUMBER]')
        for name in one[:2]:
            if not isinstance(name, str) or name not in known:
                raise InputError(f"{key}: {shown(name)} is not drawn; {did_you_mean(str(name), tuple(known))}")
        first, second, value = *map(str, one[:2]), check_finite(key, one[2])
        if first == second or frozenset((first, second)) in pairs:
            raise InputError(f"{key}: {first}, {second}: must be two different parameters, and each pair once")
        if not -1.0 < value < 1.0:
            raise InputError(f"{key}: {first}, {second} = {number_text(value)}: must be between -1 and 1")
        pairs[frozenset((first, second))] = first, second, value
    return tuple(pairs.values())


def check_draws(
    sampling: Sampling, draws: Mapping[str, Floats], names: Sequence[str], coords: Mapping[str, xr.Variable]
) -> None:
    """Refuse draws of some parameters that no physics allows, anywhere on the grid."""
    for name in names:
        one, bound = sampling.distributions[name], BOUNDS[name]
        # each draw's value is monotone in what it is applied to: the ends of the axis are its extremes.  A factor on an
        # estimate is checked by itself: the failure of the estimate is a flag of the result
        bases = [1.0 if one.kind == "factor" else 0.0]
        if name in coords:
            bases = [float(coords[name].values.min()), float(coords[name].values.max())]
        outside, base = max((float(np.mean(~bound.holds(one.applied(at, draws[name])))), at) for at in bases)
        if outside:
            about = f" as {one.kind} on {name} = {base:.6g}" if name in coords else ""
            raise InputError(
                f"{sampling.key(name)} = {one}{about}: {outside:.2%} of the draws are not {bound.text}: "
                "take a distribution that has none there, such as lognorm, or truncate it (truncnorm)"
            )
