"""Statistics of sampled displacements at every grid point: quantiles, mean, probabilities, shares of flags and modes.

They are of the samples that have a value; probabilities also count the statically unstable ones, as exceeding every
threshold.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import threads
from slipsweep.model.parameters import number_text
from slipsweep.model.variables import SlidingMode, Validity
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

#: Those that depend on the frequency even where the samples do not.
BY_FREQUENCY = ("displacement_quantile", "mean_displacement", "exceedance_probability")

MODES: tuple[SlidingMode, ...] = tuple(mode for mode in SlidingMode if mode is not SlidingMode.MISSING)


def statistics_of_samples(
    sampling: Sampling, solved: Mapping[str, NDArray[Any]], frequency: Floats
) -> dict[str, NDArray[Any]]:
    """Statistics of the samples of grid points, at each of their frequencies.

    Parameters
    ----------
    sampling : Sampling
        Its quantiles and thresholds.
    solved : mapping of str to array, (point, sample)
        `permanent_displacement` at 1 Hz, `validity` and, under a waveform, `sliding_mode`.
    frequency : array, (point, frequency)
        Displacements are divided by its square.

    Returns
    -------
    dict of str to array
        `RESULTS`: (point, frequency, own dimension) of those `BY_FREQUENCY`, (point, own dimension) of the others.

    Raises
    ------
    InputError
        A quantile or mean is beyond double precision.
    """
    displacement, flags = solved["permanent_displacement"], solved["validity"]
    points, samples = displacement.shape
    squares = frequency**2
    quantiles = np.full((*squares.shape, sampling.quantiles.size), np.nan)
    means = np.full(squares.shape, np.nan)
    exceeding = np.full((*squares.shape, sampling.thresholds.size), np.nan)

    def reduce(first: int, last: int) -> None:
        for point in range(first, last):
            values = np.sort(displacement[point])
            values = values[: np.searchsorted(values, np.nan)]  # NaN goes last
            # these slide without any shaking: their displacement has no value and exceeds every threshold
            unstable = np.count_nonzero(flags[point] & Validity.STATICALLY_UNSTABLE.value)
            square = squares[point][:, np.newaxis]
            if values.size + unstable:
                above = values.size - np.searchsorted(values, sampling.thresholds * square, side="right")
                exceeding[point] = (above + unstable) / (values.size + unstable)
            if values.size:
                with np.errstate(over="ignore"):  # refused below
                    quantiles[point] = np.quantile(values, sampling.quantiles) / square
                    means[point] = values.mean() / squares[point]

    threads.spread(points, reduce, max(samples // 8, 1))
    valueless = np.isnan(displacement).mean(axis=-1)
    for name, values in (("displacement_quantile", quantiles), ("mean_displacement", means[..., np.newaxis])):
        wrong = (valueless[:, np.newaxis] < 1.0) & ~np.isfinite(values).all(axis=-1)
        if wrong.any():
            worst = number_text(float(frequency[wrong].flat[0]))
            clock = "frequency" if "sliding_mode" in solved else "1 / time_scale"
            raise InputError(f"{clock} = {worst}: {name} is then no finite number; must be nearer to 1")
    found = {
        "displacement_quantile": quantiles,
        "mean_displacement": means,
        "exceedance_probability": exceeding,
        "flag_share": np.stack([np.mean(flags & flag.value != 0, axis=-1) for flag in Validity], axis=-1),
        "valueless_share": valueless,
    }
    if "sliding_mode" in solved:
        found["mode_share"] = np.stack(
            [np.mean(solved["sliding_mode"] == mode.value, axis=-1) for mode in MODES], axis=-1
        )
    return found
