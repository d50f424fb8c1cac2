"""Statistics of the displacements of drawn inputs, at every grid point.

Quantiles, mean, probabilities, shares of flags and modes are of the samples that have a value; probabilities also count
the statically unstable ones, as exceeding every threshold.

Sobol indices say which uncertain input moves the displacement.  They take two independent sets of draws, A and B, and
for each of k inputs a third set: A, but with this input from B.  That is k + 2 runs for each sample, of which A has the
samples of all other statistics.  With means over the samples, and V the variance of A and B, the indices of an input
are

    first order   mean(u_B (u_AB − u_A)) / V          total   mean((u_A − u_AB)²) / (2 V)

(Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018, Table 2, b and f).  `scipy.stats.sobol_indices` has the same
estimators, but its bootstrap takes no seed, so that a run could not be repeated.
"""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import threads
from slipsweep.model.parameters import number_text
from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity
from slipsweep.studies.sampling import Sampling

Floats = NDArray[np.float64]

#: Results of a grid point, and their dimensions in addition to those of the grid.
RESULTS: dict[str, tuple[str, ...]] = {
    "displacement_quantile": ("quantile",),
    "mean_displacement": (),
    "exceedance_probability": ("threshold",),
    "mode_share": ("mode",),
    "flag_share": ("flag",),
    "valueless_share": (),
}
SENSITIVITY_RESULTS: dict[str, tuple[str, ...]] = {
    "first_order_index": ("input",),
    # in this order: CDO reads no variable whose last dimension but one has texts
    "first_order_interval": ("bound", "input"),
    "total_index": ("input",),
    "total_interval": ("bound", "input"),
    "sensitivity_status": (),
}

#: Those that depend on the frequency even where the samples do not.
BY_FREQUENCY = ("displacement_quantile", "mean_displacement", "exceedance_probability")

MODES: tuple[SlidingMode, ...] = tuple(mode for mode in SlidingMode if mode is not SlidingMode.MISSING)

#: Resamples of the bootstrap, and the shares of them below the ends of an interval.
RESAMPLES = 1000
ENDS = (0.025, 0.975)

#: Most parts that a bootstrap resamples: of more samples, neighbours are resampled together.
_PARTS = 1024

#: Displacements that differ by less, relative to the largest, differ by rounding.
_SAME = 1e-12

#: Cost of the indices of a grid point in addition to its runs, in cells of the cycle solver.
WORK = 30_000


def statistics_of_samples(
    sampling: Sampling, solved: Mapping[str, NDArray[Any]], frequency: Floats
) -> dict[str, NDArray[Any]]:
    """Statistics of the samples of grid points, at each of their frequencies.

    Parameters
    ----------
    sampling : Sampling
        Its quantiles and thresholds.
    solved : mapping of str to array, (point, sample)
        `permanent_displacement`, `validity` and, under a waveform, `sliding_mode`.  Of Sobol indices the first runs are
        the samples.
    frequency : array, (point, frequency)
        Displacements are divided by its square.

    Returns
    -------
    dict of str to array
        `RESULTS`: (point, frequency, own dimension) of those `BY_FREQUENCY`, (point, own dimension) of the others.

    Raises
    ------
    InputError
        A quantile is beyond double precision.
    """
    if sampling.sensitivity:
        solved = {name: values[:, : sampling.samples] for name, values in solved.items()}
    displacement, flags = solved["permanent_displacement"], solved["validity"]
    points, samples = displacement.shape
    squares = frequency[..., np.newaxis] ** 2
    quantiles = np.full((*frequency.shape, sampling.quantiles.size), np.nan)
    means = np.full((*frequency.shape, 1), np.nan)
    exceeding = np.full((*frequency.shape, sampling.thresholds.size), np.nan)

    def reduce(first: int, last: int) -> None:
        for point in range(first, last):
            values = np.sort(displacement[point])
            values = values[: np.searchsorted(values, np.nan)]  # NaN goes last
            # these slide without any shaking: their displacement has no value and exceeds every threshold
            unstable = np.count_nonzero(flags[point] & Validity.STATICALLY_UNSTABLE.value)
            if values.size + unstable:
                above = values.size - np.searchsorted(values, sampling.thresholds * squares[point], side="right")
                exceeding[point] = (above + unstable) / (values.size + unstable)
            if values.size:
                with np.errstate(over="ignore"):  # refused below
                    quantiles[point] = np.quantile(values, sampling.quantiles) / squares[point]
                    means[point] = values.mean() / squares[point]

    threads.spread(points, reduce, max(samples // 8, 1))
    wrong = (np.isinf(quantiles) | np.isinf(means)).any(axis=-1)
    if wrong.any():
        raise InputError(
            f"frequency or 1 / time_scale = {number_text(float(frequency[wrong][0]))}: must be nearer to 1"
        )
    found = {
        "displacement_quantile": quantiles,
        "mean_displacement": means,
        "exceedance_probability": exceeding,
        "flag_share": np.stack([np.mean(flags & flag.value != 0, axis=-1) for flag in Validity], axis=-1),
        "valueless_share": np.isnan(displacement).mean(axis=-1),
    }
    if "sliding_mode" in solved:
        modes = solved["sliding_mode"]
        found["mode_share"] = np.stack([np.mean(modes == mode.value, axis=-1) for mode in MODES], axis=-1)
    return found


def draws_of_runs(sampling: Sampling) -> dict[str, Floats]:
    """Draws of each parameter for all runs: A and, for Sobol indices, B and A with each independent input from B."""
    if not sampling.sensitivity:
        return sampling.draws()[0]
    first, second = sampling.draws(2)
    return {
        name: np.concatenate(
            [first[name], second[name], *((second if name in one else first)[name] for one in sampling.independent)]
        )
        for name in first
    }


def memory_of_bootstrap(sampling: Sampling) -> int:
    """Bytes of the resamples, and of the terms of a grid point."""
    return 8 * RESAMPLES * _PARTS + 64 * sampling.sensitivity_runs


def sobol_indices(sampling: Sampling, displacement: Floats) -> dict[str, NDArray[Any]]:
    """Sobol indices of grid points, their intervals and their status.

    Parameters
    ----------
    sampling : Sampling
    displacement : array, (point, run)
        Of the runs of `draws_of_runs`.  The indices do not depend on the frequency, as u = W/ω².

    Returns
    -------
    dict of str to array
        `SENSITIVITY_RESULTS`; the first dimension is that of the grid points.  NaN where the status says why.
    """
    inputs = len(sampling.independent)
    runs = displacement.reshape(-1, inputs + 2, sampling.samples)
    points = [_of_point(one, sampling.seed) for one in runs]
    indices = np.array([values for values, _, _ in points]).reshape(-1, 2, inputs)
    intervals = np.array([ends for _, ends, _ in points]).reshape(-1, 2, 2, inputs)
    return {
        "first_order_index": indices[:, 0],
        "first_order_interval": intervals[:, :, 0],
        "total_index": indices[:, 1],
        "total_interval": intervals[:, :, 1],
        "sensitivity_status": np.array([status for _, _, status in points], np.int8),
    }


def _of_point(runs: Floats, seed: int) -> tuple[Floats, Floats, SensitivityStatus]:
    """Indices (kind, input) of one grid point, ends of their intervals (end, kind, input), and the status."""
    inputs, samples = runs.shape[0] - 2, runs.shape[1]
    largest = np.abs(runs).max()
    none = np.full((2, inputs), np.nan), np.full((2, 2, inputs), np.nan)
    if np.isnan(largest):
        return *none, SensitivityStatus.RUNS_WITHOUT_VALUE
    if np.ptp(runs[:2]) <= _SAME * largest:
        return *none, SensitivityStatus.NO_VARIANCE
    scaled = runs / largest  # squares of no displacement are then too large or too small
    a, b, *mixed = scaled - scaled[:2].mean()
    terms = np.stack(
        [a + b, a**2 + b**2, *(b * (ab - a) for ab in mixed), *(0.5 * (a - ab) ** 2 for ab in mixed)],
    )
    starts = np.arange(0, samples, -(-samples // _PARTS))
    weights = _resamples(starts.size, seed)
    counts = np.diff(starts, append=samples) @ weights
    resampled = _ratios(np.add.reduceat(terms, starts, axis=-1) @ weights, counts)
    # a resample may have no variance
    ends = np.nanquantile(resampled, ENDS, axis=-1)
    return _ratios(terms.sum(axis=-1), samples), ends, SensitivityStatus.COMPUTED


def _ratios(sums: Floats, count: Any) -> Floats:
    """First-order and total indices (kind, input, ...) from the sums of `count` samples' terms."""
    means = sums / count
    variance = means[1] / 2.0 - (means[0] / 2.0) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        found = means[2:] / np.where(variance > 0.0, variance, np.nan)
    return np.asarray(found.reshape(2, -1, *found.shape[1:]))


@functools.lru_cache(maxsize=1)
def _resamples(parts: int, seed: int) -> Floats:
    """How often each resample of the bootstrap has each part of the samples, (part, resample)."""
    generator = np.random.default_rng(seed)
    drawn = generator.multinomial(parts, np.full(parts, 1.0 / parts), RESAMPLES)
    return np.ascontiguousarray(drawn.T, np.float64)
