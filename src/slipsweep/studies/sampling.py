"""Draws of uncertain inputs, and Sobol indices of results of the draws.

Distributions are those of scipy.stats, quasi-random numbers those of scipy.stats.qmc.

Sobol indices take two independent sets of draws, A and B, and for each of k inputs a third set: A,
but with this input from B.  That is k + 2 runs for each sample, of which A has the samples of all
other statistics.  With means over the samples, and V the variance of A and B, the indices of an
input are

    first order   mean(u_B (u_AB − u_A)) / V          total   mean((u_A − u_AB)²) / (2 V)

(Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018, Table 2, b and f).
`scipy.stats.sobol_indices` has the same estimators, but its bootstrap takes no seed, so that a run
could not be repeated.
"""

import functools
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model import parameters
from slipsweep.model.parameters import (
    check_choice,
    check_finite,
    check_list,
    check_whole,
    number_text,
    shown,
)
from slipsweep.model.units import conversion, quantity
from slipsweep.model.variables import DRAWN, PARAMETERS, SensitivityStatus

Floats = NDArray[np.float64]

#: Type of displacements: m, or texts with a unit.
Thresholds = float | str | Sequence[float | str] | np.ndarray

#: Most samples a grid point: 2**24 take about 1.5 GB.
MOST_SAMPLES = 2**24

#: Half of the last digit of scipy's Sobol numbers, some of which are 0: the quantile there may be
#: infinite.
_LEAST = 2.0**-31

#: Resamples of the bootstrap, and the shares of them below the ends of an interval.
RESAMPLES = 1000
ENDS = (0.025, 0.975)

#: Most parts that a bootstrap resamples: of more samples, neighbours are resampled together.
_PARTS = 1024

#: Bytes that the bootstrap of a grid point takes.
SOBOL_MEMORY = 8 * RESAMPLES * _PARTS


class Distribution:
    """Distribution of an uncertain parameter: an entry of `uncertain`, called `key` in errors."""

    def __init__(self, key: str, parameter: str, entry: Any, g: float) -> None:
        entries = dict(entry) if isinstance(entry, Mapping) else {"distribution": entry}
        chosen = entries.pop("distribution", None)
        #: "absolute": a draw is the value; "factor": it multiplies the value of the grid point;
        #: "offset": it is added to that.
        self.kind = check_choice(
            f"{key}.kind", entries.pop("kind", "absolute"), ("absolute", "factor", "offset")
        )
        units = entries.pop("units", None)
        unit_of_parameter = PARAMETERS[parameter]["units"]
        if units is not None and (self.kind == "factor" or not isinstance(units, str)):
            raise InputError(
                f"{key}.units = {shown(units)}: not allowed with kind = 'factor', else a unit "
                f"that converts to {unit_of_parameter}"
            )
        #: A frozen distribution of scipy.stats, or anything else with a ``ppf``.
        self.frozen = _frozen(key, chosen, entries)
        #: The distribution in words and numbers, as it was given.
        self.about: dict[str, Any] = {"distribution": repr(self.frozen)}
        if family := getattr(self.frozen, "dist", None):
            numbers = (
                dict(zip(_arguments(family), self.frozen.args, strict=False)) | self.frozen.kwds
            )
            self.about = {"distribution": family.name}
            self.about |= {name: float(value) for name, value in numbers.items()}
        with np.errstate(all="ignore"):
            median = parameters.check_numbers(f"{key}: its median", self.frozen.ppf(0.5))
        if median.ndim or not np.isfinite(median):
            raise InputError(
                f"{key}: parameters that scipy.stats does not allow for one distribution: "
                f"{self.about}"
            )
        #: Factor on draws, to have them in the parameter's own unit.
        self.unit = conversion(f"{key}.units", unit_of_parameter, units, g)
        if units is not None:
            self.about["units"] = units
        self.about["kind"] = self.kind

    def __str__(self) -> str:
        numbers = [
            f"{name}={value}"
            for name, value in self.about.items()
            if name not in ("distribution", "kind")
        ]
        return f"{self.about['distribution']}({', '.join(numbers)})"

    def draws(self, uniform: Floats) -> Floats:
        """Turn numbers from 0 to 1 into draws, in the parameter's own unit."""
        with np.errstate(all="ignore"):  # what is not finite is refused by `check_draws`
            return np.asarray(self.frozen.ppf(uniform), np.float64) * self.unit

    def applied(self, base: Any, draws: Any) -> Any:
        """Return the parameter's values: draws, or draws applied to `base`."""
        if self.kind == "absolute":
            return draws
        with np.errstate(over="ignore"):
            return base * draws if self.kind == "factor" else base + draws


def _frozen(key: str, chosen: Any, entries: Mapping[str, Any]) -> Any:
    """Return a frozen distribution: the one of a name with its parameters, or `chosen` itself."""
    from scipy import stats

    if not isinstance(chosen, str):
        if entries or not callable(getattr(chosen, "ppf", None)):
            raise InputError(
                f"{key}.distribution = {shown(chosen)}: must be the name of a distribution of "
                "scipy.stats, with its parameters, or a frozen one without"
            )
        return chosen
    family = getattr(stats, chosen, None)
    if not isinstance(family, stats.rv_continuous):
        raise InputError(
            f'{key}.distribution = "{chosen}": must be a continuous one of scipy.stats, such as '
            "norm, lognorm, uniform, triang, truncnorm, beta, gamma, weibull_min"
        )
    allowed = _arguments(family)
    if not {*allowed[:-2]} <= {*entries} <= {*allowed}:
        raise InputError(
            f"{key}: has {', '.join(map(str, entries)) or 'no parameters'}: {chosen} takes "
            f"{', '.join(allowed)}, of which loc and scale may be left out (and the keys kind and "
            "units)"
        )
    numbers = {name: check_finite(f"{key}.{name}", value) for name, value in entries.items()}
    return family(**numbers)


class Sampling:
    """Uncertain inputs, their draws and their statistics: the arguments of `sample`, checked.

    "g" as a unit of acceleration is `g` m/s²; `keys` stands before the names of options in errors.
    InputError: the first thing that is not allowed.
    """

    def __init__(
        self,
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
    ) -> None:
        from scipy.sparse.csgraph import connected_components

        self.keys = keys
        if not isinstance(uncertain, Mapping) or not uncertain:
            advice = f"must give the distribution of one parameter at least: {', '.join(DRAWN)}"
            raise InputError(f"{self.key('').removesuffix('.')}: {advice}")
        for name in uncertain:
            if name not in DRAWN:
                raise InputError(
                    f"{self.key(name)}: cannot be drawn; {did_you_mean(str(name), DRAWN)}"
                )
        # always in the same order, so that the draws do not depend on the caller's order
        names = [name for name in DRAWN if name in uncertain]
        self.distributions = {
            name: Distribution(self.key(name), name, uncertain[name], g) for name in names
        }
        self.method = check_choice(f"{keys}method", method, ("sobol", "latin_hypercube", "random"))
        self.samples = check_whole(f"{keys}samples", samples, 2, MOST_SAMPLES)
        if method == "sobol" and self.samples & (self.samples - 1):
            below = 1 << (self.samples.bit_length() - 1)
            raise InputError(
                f'{keys}samples = {self.samples}: must be a power of 2 with method = "sobol", '
                f"such as {below} or "
                f"{2 * below}; latin_hypercube takes any number"
            )
        if not isinstance(sensitivity, (bool, np.bool_)):
            raise InputError(f"{keys}sensitivity = {shown(sensitivity)}: must be true or false")
        self.sensitivity = bool(sensitivity)
        pooled = [over] if isinstance(over, str) else check_list(f"{keys}over", over, "dimensions")
        if pooled and sensitivity:
            raise InputError(
                f"{keys}sensitivity = true: not allowed with {keys}over: indices are of drawn "
                "inputs only"
            )
        self.over = tuple(map(str, pooled))
        self.seed = check_whole(f"{keys}seed", seed, 0, 2**31 - 1)  # attributes hold 32 bits
        self.quantiles = check_increasing(f"{keys}quantiles", quantiles, "quantile")
        self.thresholds = check_thresholds(f"{keys}thresholds", thresholds, g)
        self.correlation = _pairs(f"{keys}correlation", correlation, names)
        #: Correlations of the normal scores of all parameters.
        self.matrix = np.eye(len(names))
        for *pair, value in self.correlation:
            i, j = map(names.index, pair)
            self.matrix[i, j] = self.matrix[j, i] = value
        if np.linalg.eigvalsh(self.matrix).min() < 1e-12:
            raise InputError(
                f"{keys}correlation: no such correlations exist together (their matrix is not "
                "positive)"
            )
        number, group = connected_components(self.matrix, directed=False)
        #: The parameters, those that are correlated with one another together.
        self.independent = tuple(tuple(np.array(names)[group == k].tolist()) for k in range(number))
        #: Runs of a grid point: the samples, or all that its Sobol indices take.
        self.runs = self.samples * (number + 2 if sensitivity else 1)
        if self.runs > MOST_SAMPLES:
            raise InputError(
                f"{keys}samples = {self.samples}: Sobol indices take {self.runs} runs a grid point "
                f"with these; must be {MOST_SAMPLES} at most"
            )

    def key(self, parameter: Any) -> str:
        """Return the name of a distribution in errors."""
        return f"{self.keys or 'uncertain.'}{parameter}"

    @functools.cached_property
    def draws(self) -> dict[str, Floats]:
        """Draws of each parameter for all runs.

        They are the set A; for Sobol indices also B, and A with each input from B.
        """
        from scipy.stats import norm, qmc

        sets = 2 if self.sensitivity else 1
        number = len(self.distributions)
        # a new generator, so that the numbers depend only on the seed
        generator = np.random.default_rng(self.seed)
        if self.method == "random":
            uniform = generator.random((self.samples, sets * number))
        else:
            engines = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}
            uniform = engines[self.method](sets * number, rng=generator).random(self.samples)
        uniform = np.maximum(uniform.T, _LEAST).reshape(sets, number, -1)
        if self.correlation:
            uniform = norm.cdf(np.linalg.cholesky(self.matrix) @ norm.ppf(uniform))
            uniform = np.clip(uniform, _LEAST, 1.0 - 2.0**-53)
        drawn = {}
        for at, (name, distribution) in enumerate(self.distributions.items()):
            first, *others = (distribution.draws(row) for row in uniform[:, at])
            mixed = [
                second if name in group else first
                for second in others
                for group in self.independent
            ]
            drawn[name] = np.concatenate([first, *others, *mixed])
        return drawn

    def check_draws(self, coords: Mapping[str, xr.Variable]) -> None:
        """Raise InputError for draws that no physics allows, on a grid of these coordinates."""
        for name, distribution in self.distributions.items():
            bound = parameters.BOUNDS[name]
            # each draw's value is monotone in what it is applied to: the ends of the axis are its
            # extremes.  A factor on an estimate is checked by itself: the failure of the estimate
            # is a flag of the result
            bases = [1.0 if distribution.kind == "factor" else 0.0]
            if name in coords:
                bases = [float(coords[name].values.min()), float(coords[name].values.max())]
            outside, base = max(
                (float(np.mean(~bound.holds(distribution.applied(at, self.draws[name])))), at)
                for at in bases
            )
            if outside:
                about = f" as {distribution.kind} on {name} = {base:.6g}" if name in coords else ""
                raise InputError(
                    f"{self.key(name)} = {distribution}{about}: {outside:.2%} of the draws are not "
                    f"{bound.text}: take a distribution that has none there, such as lognorm, or "
                    "truncate it (truncnorm)"
                )

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of results, from which the same draws can be made again."""
        from scipy import __version__

        attributes = {
            "uncertain": json.dumps(
                {name: distribution.about for name, distribution in self.distributions.items()}
            ),
            "samples": self.samples,
            "sampling": f"{self.method} (scipy {__version__})",
            "seed": self.seed,
        }
        if self.correlation:
            attributes["correlation"] = json.dumps(self.correlation)
        if self.sensitivity:
            attributes["sensitivity"] = (
                f"Saltelli et al. (2010), {self.runs} runs; bootstrap of {RESAMPLES}"
            )
        return attributes


def _arguments(family: Any) -> tuple[str, ...]:
    """Return the names of a distribution's parameters: its shapes, loc and scale."""
    return (*(family.shapes or "").replace(",", " ").split(), "loc", "scale")


def check_thresholds(key: str, thresholds: Any, g: float) -> Floats:
    """Return displacements, m or with a unit, as an increasing coordinate of one value at least."""
    entries = np.atleast_1d(np.asarray(parameters.computed(thresholds), object)).tolist()
    values = [
        quantity(key, entry, "m", g) if isinstance(entry, str) else entry for entry in entries
    ]
    return check_increasing(key, values, "threshold")


def check_increasing(key: str, numbers: Any, bound: str) -> Floats:
    """Return numbers within the bounds of a parameter as an increasing coordinate (not empty)."""
    values = np.atleast_1d(parameters.check_values(bound, numbers, key))
    if values.ndim > 1 or not values.size:
        raise InputError(f"{key} = {shown(numbers)}: must be a list of one number or more")
    for at in np.flatnonzero(np.diff(values) <= 0.0)[:1]:
        before, after = (number_text(float(value)) for value in values[at : at + 2])
        raise InputError(f"{key}: {after} after {before}: they must increase")
    return values


def _pairs(key: str, correlation: Any, names: Sequence[str]) -> tuple[tuple[str, str, float], ...]:
    """Return correlations: pairs of drawn parameters with a number between -1 and 1."""
    pairs: dict[frozenset[str], tuple[str, str, float]] = {}
    for entry in check_list(key, correlation, '["NAME", "OTHER", NUMBER]'):
        triple = check_list(key, entry, "two names and a number")
        if len(triple) != 3:
            raise InputError(f'{key} = {shown(entry)}: must be ["NAME", "OTHER", NUMBER]')
        first, second = (check_choice(key, name, names) for name in triple[:2])
        value = check_finite(key, triple[2])
        pair = frozenset((first, second))
        if len(pair) < 2 or pair in pairs or not -1.0 < value < 1.0:
            what = "two parameters, each pair once, and a number between -1 and 1"
            raise InputError(f"{key} = {shown(entry)}: must be {what}")
        pairs[pair] = first, second, value
    return tuple(pairs.values())


def sobol_indices(sampling: Sampling, displacement: Floats) -> dict[str, NDArray[Any]]:
    """Return Sobol indices, their intervals and their status, at each grid point.

    `displacement`, (point, run), is that of the runs of `Sampling.draws`.  Indices do not depend on
    the frequency, as u = W/ω².
    """
    runs = displacement.reshape(-1, len(sampling.independent) + 2, sampling.samples)
    status, values = zip(*(_of_point(of_point, sampling.seed) for of_point in runs), strict=True)
    results = {"sensitivity_status": np.array(status, np.int8)}
    for at, kind in enumerate(("first_order", "total")):
        indices = np.stack(values)[:, :, at]  # (point, index and ends of its interval, input)
        results |= {f"{kind}_index": indices[:, 0], f"{kind}_interval": indices[:, 1:]}
    return results


def _of_point(runs: Floats, seed: int) -> tuple[SensitivityStatus, Floats]:
    """Return the status of a grid point, its indices (kind, input) and the ends of intervals."""
    inputs = runs.shape[0] - 2
    samples = runs.shape[1]
    largest = np.abs(runs).max()
    none = np.full((3, 2, inputs), np.nan)
    if np.isnan(largest):
        return SensitivityStatus.RUNS_WITHOUT_VALUE, none
    if np.ptp(runs[:2]) <= 1e-12 * largest:  # they differ by rounding
        return SensitivityStatus.NO_VARIANCE, none
    scaled = runs / largest  # squares of no displacement are then too large or too small
    a, b, *mixed = scaled - scaled[:2].mean()
    terms = np.stack(
        [
            a + b,
            a**2 + b**2,
            *(b * (ab - a) for ab in mixed),
            *(0.5 * (a - ab) ** 2 for ab in mixed),
        ]
    )
    starts = np.arange(0, samples, -(-samples // _PARTS))
    weights = _resamples(starts.size, seed)
    counts = np.diff(starts, append=samples) @ weights
    resampled = _ratios(np.add.reduceat(terms, starts, axis=-1) @ weights, counts)
    # a resample may have no variance
    ends = np.nanquantile(resampled, ENDS, axis=-1)
    return SensitivityStatus.COMPUTED, np.concatenate(
        [_ratios(terms.sum(axis=-1), samples)[None], ends]
    )


def _ratios(sums: Floats, count: Any) -> Floats:
    """Return first-order and total indices (kind, input, ...) from sums over `count` samples."""
    means = sums / count
    variance = means[1] / 2.0 - (means[0] / 2.0) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        indices = means[2:] / np.where(variance > 0.0, variance, np.nan)
    return np.asarray(indices.reshape(2, -1, *indices.shape[1:]))


@functools.lru_cache(maxsize=1)
def _resamples(parts: int, seed: int) -> Floats:
    """Return the times that each part of the samples is in each resample, (part, resample)."""
    drawn = np.random.default_rng(seed).multinomial(parts, np.full(parts, 1.0 / parts), RESAMPLES)
    return np.ascontiguousarray(drawn.T, np.float64)
