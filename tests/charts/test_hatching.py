"""Hatching of flagged cells, and shares of cells that are not to be read."""

import re
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.charts import style
from slipsweep.charts.slices import Result
from slipsweep.model.variables import NOTES
from slipsweep.studies.cautions import unsound_texts
from tests.support.charts import (
    LINED_SINE,
    SINE,
    caption,
    inside,
    named,
)


@pytest.mark.parametrize("x", ["theta", "frequency"])
def test_hatching_is_where_validity_says_so(grid: xr.Dataset, x: str) -> None:
    at = {"mu_s": 0.2, **({"theta": 4.0} if x == "frequency" else {"frequency": 1.0})}
    figure = grid.slipsweep.chart("modes", x=x, at=at)
    cells = grid.validity.sel(at, method="nearest").transpose("amplitude", x)
    mesh = np.stack(np.meshgrid(grid[x], grid.amplitude), axis=-1).reshape(-1, 2)
    seen = 0
    for flag in ~NOTES:
        expected = (cells.values & int(flag)) != 0
        name = (flag.name or "").lower()
        patches = named(figure, name)
        small = re.search(rf"{name} \((\d+) cell", caption(figure))
        left = int(small[1]) if small else 0
        covered = np.zeros(cells.shape, bool)
        for patch in patches:
            covered |= inside(patch, mesh).reshape(cells.shape)
        if flag != slipsweep.Validity.STATICALLY_UNSTABLE:
            # hatches go on to φ; what slides under its own weight covers the rest of them
            covered &= (cells.values & slipsweep.Validity.STATICALLY_UNSTABLE) == 0
        assert not (covered & ~expected).any()
        assert (
            covered.sum() + left == expected.sum()
        )  # regions too small for a hatch are counted in the caption
        assert all(patch.hatches[0] for patch in patches)
        seen += covered.sum()
    assert seen > 0


def test_what_no_block_does_is_marked_and_its_share_told(lined: xr.Dataset) -> None:
    """Displacements that fall with A, or lie below half of Newmark's: against sweeps of this test's
    own.
    """
    given: dict[str, Any] = {
        "theta": 14.0,
        "mu_s": 0.25,
        "frequency": 1.0,
        "excitation": LINED_SINE,
    }
    amplitudes = lined.amplitude.values
    ours = slipsweep.sweep(amplitude=amplitudes, **given)
    before = slipsweep.sweep(amplitude=amplitudes * 0.99, **given).permanent_displacement.values
    theirs = slipsweep.sweep(
        amplitude=amplitudes, model="newmark", **given
    ).permanent_displacement.values
    u = ours.permanent_displacement.values
    flags = slipsweep.flags(ours)
    shown = (u > 0) & ~flags.not_recoupled.values
    falls = shown & (u < before)
    below = shown & (u < theirs / 2)
    assert falls.any()
    assert below.any()
    figure = lined.slipsweep.chart("curve", at={"theta": 14, "mu_s": 0.25, "frequency": 1})
    (line,) = named(figure, "unsound")
    xs, ys = line.get_data()
    np.testing.assert_array_equal(np.isin(amplitudes, xs[np.isfinite(ys)]), falls | below)
    share = [f"{100 * one.sum() / shown.sum():.2g} %" for one in (falls | below, falls, below)]
    falling = f"The displacement falls with A in {share[1]}"
    trends = f"{falling} and lies below half of Newmark's in {share[2]}"
    assert f"{share[0]} of the sliding cells shown. {trends}" in caption(figure)
    ratio = lined.slipsweep.chart("newmark", at={"mu_s": 0.25, "frequency": 1})
    cells = np.stack([np.full_like(amplitudes, 14.0), amplitudes], axis=-1)
    hatched = np.any([inside(patch, cells) for patch in named(ratio, style.UNSOUND)], axis=0)
    np.testing.assert_array_equal(hatched, falls | below)
    sound = slipsweep.sweep(5.0, 0.4, [2.0, 4.0, 6.0], 1.0, model="newmark").slipsweep.chart(
        "curve"
    )
    assert "falls with A" not in caption(sound)


def test_a_fall_is_counted_against_an_amplitude_one_percent_smaller() -> None:
    """Just beyond the jump at the mode limit the displacement falls, and is larger than before the
    jump.
    """
    limit = slipsweep.friction_parameters(11.0, 0.25, 1.0).limiting_acceleration.item()
    amplitudes = limit * np.array([0.55, 1.03, 1.06, 1.08])
    block: dict[str, Any] = {"theta": 11.0, "mu_s": 0.25, "frequency": 1.0, "excitation": SINE}
    result = slipsweep.sweep(**block, amplitude=amplitudes)
    u = result.permanent_displacement.values
    less, tenth = (
        slipsweep.sweep(**block, amplitude=part * amplitudes).permanent_displacement.values
        for part in (0.99, 0.9)
    )
    falls = (u > 0.0) & (u < less)
    np.testing.assert_array_equal(falls, [False, True, True, True])
    assert (u > tenth)[1:].all()
    figure = result.slipsweep.chart()
    (line,) = named(figure, "unsound")
    drawn = line.get_xdata()[np.isfinite(line.get_ydata())]
    np.testing.assert_array_equal(np.isin(amplitudes, drawn), falls)
    assert "The displacement falls with A in 75 %" in caption(figure)


def test_shares_of_what_is_unsound_are_those_of_all_cells() -> None:
    """Of some 300 000 cells half are counted: to a percent or two what all of them say, on axes
    long and short.
    """
    axes = (
        np.linspace(0, 20, 11),
        np.linspace(0.2, 0.9, 8),
        np.geomspace(0.5, 14, 61),
        np.geomspace(0.1, 20, 58),
    )
    result = slipsweep.sweep(*axes)
    slides = result.permanent_displacement.where(~slipsweep.flags(result).not_recoupled) > 0
    estimated = slides & (result.sliding_mode == 2) & slipsweep.flags(result).friction_estimated
    trends, continuous = unsound_texts(result)
    share, counted = re.findall(
        r"^([\d.]+) % .* \(counted in (\d+) cells, evenly spaced\)$", continuous
    )[0]
    assert abs(float(share) - 100 * float(estimated.sum() / slides.sum())) < 1.5
    assert 100_000 < int(counted) < 250_000
    assert trends.startswith("the displacement falls with A in ")


def test_what_is_not_to_be_read_is_said() -> None:
    """A coarse grid, estimated friction in continuous sliding; a slice at another friction angle is
    solved.
    """
    coarse = slipsweep.sweep(5.0, 0.3, [1.0, 3.0, 4.0, 9.0], [1.0, 2.0, 4.0])
    text = caption(coarse.slipsweep.chart("contours"))
    assert "Coarse grid: values grow more than tenfold from cell to cell" in text
    assert (
        "of the sliding cells slide continuously with estimated friction: not for design." in text
    )
    angles = slipsweep.sweep(5.0, phi=[20.0, 24.0], amplitude=[2.0, 4.0, 6.0], frequency=[1.0, 2.0])
    slices = Result(angles, "angles").select(
        ["permanent_displacement"], {"amplitude": slice(None)}, {"phi": 22.0}
    )
    own = slipsweep.sweep(5.0, phi=22.0, amplitude=[2.0, 4.0, 6.0], frequency=1.0)
    np.testing.assert_array_equal(slices.permanent_displacement, own.permanent_displacement)
