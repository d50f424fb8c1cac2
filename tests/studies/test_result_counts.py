"""Counts of tables made by hand: sliding modes, flags, ratios to Newmark's block, Sobol indices."""

import math

import numpy as np
import pytest
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity
from slipsweep.studies import result_counts
from slipsweep.studies.result_counts import Ratios, tally_of

MODES = [[0, 1, 1], [2, -1, 1]]
FLAGS = [[0, 16, 16 | 1024], [512, 1, 0]]


def table(**more: object) -> xr.Dataset:
    codes = {"sliding_mode": np.array(MODES, np.int8), "validity": np.array(FLAGS, np.int16)}
    arrays = {name: (("theta", "amplitude"), values) for name, values in {**codes, **more}.items()}
    return xr.Dataset(arrays)


@pytest.mark.parametrize("cells", [1, 4, 100])
def test_modes_and_flags_are_counted_once_in_chunks(
    cells: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(result_counts, "CHUNK_CELLS", cells)
    counts_of_table = tally_of(table())
    assert counts_of_table.cells == 6
    assert counts_of_table.modes == {
        SlidingMode.MISSING: 1,
        SlidingMode.STUCK: 1,
        SlidingMode.STICK_SLIP: 3,
        SlidingMode.CONTINUOUS: 1,
    }
    counts = dict.fromkeys(Validity, 0) | {
        Validity.STATICALLY_UNSTABLE: 1,
        Validity.YIELD_GOVERNS: 2,
        Validity.NEAR_MODE_LIMIT: 1,
        Validity.FRICTION_ESTIMATED: 1,
    }
    assert counts_of_table.flags == counts
    assert counts_of_table.share(3) == 0.5
    assert counts_of_table.ratios is None


def test_ratios_are_of_cells_in_which_both_blocks_slide() -> None:
    """Zeros and missing values are left out; quantiles to 0.1 %."""
    ours = np.array([[0.0, 0.2, 0.3], [4.0, np.nan, 0.5]])
    theirs = np.array([[0.1, 0.1, 0.1], [1.0, 1.0, 0.0]])
    ratios = tally_of(table(permanent_displacement=ours, newmark_displacement=theirs)).ratios
    assert ratios is not None
    assert ratios.number == 3
    for share, expected in ((0.1, 2.0), (0.5, 3.0), (0.9, 4.0)):
        assert ratios.quantile(share) == pytest.approx(expected, rel=1.1e-3)


def test_ratios_beyond_the_classes_count_at_their_ends() -> None:
    ratios = Ratios()
    ratios.add(np.array([1e-20, 1e20, -1.0]), np.array([1.0, 1.0, 1.0]))
    assert ratios.number == 3
    assert ratios.quantile(0.5) == pytest.approx(1e-7, rel=1e-3)
    assert ratios.quantile(1.0) == pytest.approx(1e7, rel=1e-3)
    assert math.isnan(Ratios().quantile(0.5))


def test_codes_of_other_cells_are_refused() -> None:
    with pytest.raises(InputError, match="are not of the same cells"):
        tally_of(table().assign(validity=("theta", np.zeros(2, np.int16))))


def test_shares_of_samples_are_summed_over_grid_points() -> None:
    """Modes, flags, cells without a value; the input with the largest total index."""
    first = np.array([[0.6, 0.3], [0.5, 0.4], [np.nan, np.nan]])
    total = np.array([[0.5, 0.8], [0.3, 0.9], [np.nan, np.nan]])
    sums = tally_of(
        xr.Dataset(
            {
                "flag_share": (("amplitude", "flag"), [[0.25, 0.5], [0.0, 0.0], [0.5, 1.0]]),
                "mode_share": (("amplitude", "mode"), [[0.5, 0.25], [1.0, 0.0], [0.0, 0.5]]),
                "valueless_share": ("amplitude", [0.25, 0.0, 0.5]),
                "first_order_index": (("amplitude", "input"), first),
                "total_index": (("amplitude", "input"), total),
                "sensitivity_status": ("amplitude", np.array([0, 0, 2], np.int8)),
            },
            {
                "flag": [1, 16],
                "mode": [0, 1],
                "input": ["mu_s", "amplitude"],
            },
        )
    )
    assert sums.cells == 3
    assert sums.flags == {Validity.STATICALLY_UNSTABLE: 0.75, Validity.YIELD_GOVERNS: 1.5}
    assert sums.modes == {
        SlidingMode.MISSING: 0.75,
        SlidingMode.STUCK: 1.5,
        SlidingMode.STICK_SLIP: 0.75,
    }
    assert sums.share(1.5) == 0.5
    indices = sums.indices
    assert indices is not None
    assert indices.status == {
        SensitivityStatus.COMPUTED: 2,
        SensitivityStatus.NO_VARIANCE: 0,
        SensitivityStatus.RUNS_WITHOUT_VALUE: 1,
    }
    assert indices.first == pytest.approx({"mu_s": 0.55, "amplitude": 0.35})
    assert indices.total == pytest.approx({"mu_s": 0.4, "amplitude": 0.85})
    assert indices.largest == {"mu_s": 0, "amplitude": 2}
