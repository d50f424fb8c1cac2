"""How uncertain inputs are sampled: draws by quasi-random numbers of scipy.stats.qmc, and what is allowed of them."""

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
    check_values,
    check_whole,
    computed,
    number_text,
    shown,
)
from slipsweep.model.units import quantity
from slipsweep.model.variables import DRAWN
from slipsweep.studies.distributions import Distribution, distribution_of

Floats = NDArray[np.float64]

METHODS = ("sobol", "latin_hypercube", "random")

#: Parameters that have an estimate where they are not given, in the order in which each needs those before it.
ESTIMATED = ("yield_acceleration", "minimum_friction", "delta_mu", "decay_rate")

#: Most samples a grid point: 2**24 take about 1.5 GB.
MOST_SAMPLES = 2**24

#: Attributes hold 32 bits.
_MOST_SEED = 2**31 - 1

#: Half of the last digit of scipy's Sobol numbers, some of which are 0: the quantile there may be infinite.
_LEAST = 2.0**-31


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

    def draws(self) -> dict[str, Floats]:
        """Draw all parameters: arrays of `samples`, the same ones each time."""
        return self._draws(self._uniform(len(self.distributions)))

    def two_draws(self) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Draw all parameters twice: two sets as `draws` that are independent of each other."""
        number = len(self.distributions)
        uniform = self._uniform(2 * number)
        return self._draws(uniform[:number]), self._draws(uniform[number:])

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
    for name in uncertain:
        if name not in DRAWN:
            raise InputError(f"{keys or 'uncertain.'}{name}: cannot be drawn; {did_you_mean(str(name), DRAWN)}")
    # in one order, whatever that of the caller: the draws are then the same
    distributions = {
        name: distribution_of(f"{keys or 'uncertain.'}{name}", name, uncertain[name], g)
        for name in DRAWN
        if name in uncertain
    }
    for other in ("displacement_amplitude", "scale"):
        if {"amplitude", other} <= distributions.keys():
            raise InputError(f"{keys or 'uncertain.'}{other}: not allowed with amplitude")

    method = check_choice(f"{keys}method", method, METHODS)
    samples = check_whole(f"{keys}samples", samples, 2, MOST_SAMPLES)
    if method == "sobol" and samples & (samples - 1):
        below = 1 << (samples.bit_length() - 1)
        raise InputError(
            f'{keys}samples = {samples}: must be a power of 2 with method = "sobol", such as {below} or {2 * below}; '
            "latin_hypercube takes any number"
        )
    wanted = check_quantiles(f"{keys}quantiles", quantiles)
    limits = check_thresholds(f"{keys}thresholds", thresholds, g)
    pairs = _pairs(f"{keys}correlation", correlation, distributions)
    if not isinstance(sensitivity, (bool, np.bool_)):
        raise InputError(f"{keys}sensitivity = {shown(sensitivity)}: must be true or false")
    seed = check_whole(f"{keys}seed", seed, 0, _MOST_SEED)
    dims = [over] if isinstance(over, str) else check_list(f"{keys}over", over, "dimensions")
    if not all(isinstance(dim, str) for dim in dims):
        raise InputError(f"{keys}over = {shown(over)}: must be names of dimensions")
    pooled = tuple(dict.fromkeys(dims))
    if pooled and sensitivity:
        raise InputError(f"{keys}sensitivity = true: not allowed with {keys}over: indices are of drawn inputs only")
    sampling = Sampling(distributions, samples, method, seed, wanted, limits, pairs, bool(sensitivity), pooled, keys)
    if pairs and np.linalg.eigvalsh(sampling._matrix()).min() < 1e-12:
        raise InputError(f"{keys}correlation = {list(pairs)}: no such correlations exist together (not positive)")
    if sampling.sensitivity_runs > MOST_SAMPLES:
        raise InputError(
            f"{keys}samples = {samples}: Sobol indices take {sampling.sensitivity_runs} runs a grid point with these; "
            f"must be {MOST_SAMPLES} at most"
        )
    return sampling


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


def check_draws(
    sampling: Sampling, draws: Mapping[str, Floats], names: Sequence[str], coords: Mapping[str, xr.Variable]
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
