"""Part of a result that a page shows: the thinning of its axes, and the two of the map."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, sweep
from slipsweep.explore.excerpt import evenly_spaced, read_excerpt, thinned_lengths

GRID = {"theta": 50, "mu_s": 8, "amplitude": 400, "frequency": 300}
MAP = ("amplitude", "frequency")


def test_axes_of_the_map_keep_four_values_for_one_of_a_slider() -> None:
    """All shrink together, to hardly less than the cells allowed."""
    lengths = thinned_lengths(GRID, 500_000, MAP)
    cells = int(np.prod([*lengths.values()]))
    assert 0.85 * 500_000 < cells <= 500_000
    assert lengths["mu_s"] == 8  # short already
    assert lengths["amplitude"] == pytest.approx(lengths["frequency"], rel=0.06)
    assert lengths["amplitude"] == pytest.approx(4 * lengths["theta"], rel=0.1)


def test_axes_of_the_map_keep_two_values_and_sliders_one() -> None:
    lengths = thinned_lengths(GRID, 1, MAP)
    assert lengths == {"theta": 1, "mu_s": 1, "amplitude": 2, "frequency": 2}


def test_motions_are_never_thinned() -> None:
    lengths = thinned_lengths({**GRID, "motion": 11}, 44, MAP, ["motion"])
    assert lengths == {"theta": 1, "mu_s": 1, "amplitude": 2, "frequency": 2, "motion": 11}


def test_a_grid_that_fits_keeps_all_values() -> None:
    assert thinned_lengths(GRID, 10**9, MAP) == GRID


@pytest.mark.parametrize(("length", "kept"), [(10, 4), (11, 11), (100, 7), (5, 2), (3, 1)])
def test_values_are_kept_evenly_with_the_first_and_the_last(length: int, kept: int) -> None:
    places = evenly_spaced(length, kept)
    assert places.size == kept
    assert places[0] == 0
    if kept > 1:
        assert places[-1] == length - 1
        steps = np.diff(places)
        assert steps.max() - steps.min() <= 1


@pytest.mark.parametrize(
    ("axes", "map_dims"),
    [
        ({"theta": [1, 2], "amplitude": [1, 2], "frequency": [1, 2]}, ("amplitude", "frequency")),
        ({"theta": [1, 2, 3], "mu_s": [0.3, 0.4], "amplitude": [1, 2]}, ("amplitude", "theta")),
        ({"theta": [1, 2], "mu_s": [0.3, 0.4, 0.5], "frequency": [1, 2]}, ("mu_s", "frequency")),
        ({"theta": [1, 2], "mu_s": [0.3, 0.4, 0.5]}, ("mu_s", "theta")),
    ],
)
def test_the_map_is_of_strength_over_frequency_or_of_the_longest_axes(
    tmp_path: Path, axes: dict[str, Any], map_dims: tuple[str, str]
) -> None:
    parameters = {"theta": 1.0, "mu_s": 0.4, "amplitude": 4.0, "frequency": 1.0} | axes
    sweep(**parameters).to_netcdf(tmp_path / "a.nc")
    excerpt = read_excerpt(tmp_path / "a.nc", 10_000)
    assert excerpt.map_dims == map_dims
    assert excerpt.sizes == excerpt.lengths == {dim: len(values) for dim, values in axes.items()}


def test_a_single_axis_is_no_map(tmp_path: Path) -> None:
    sweep(1.0, 0.4, [2.0, 4.0], 1.0).to_netcdf(tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"the dimensions are: amplitude \(2\)"):
        read_excerpt(tmp_path / "a.nc", 10_000)
