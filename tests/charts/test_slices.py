"""Slices that charts read: the values requested, and no others."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.charts import kinds
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Options
from slipsweep.errors import InputError
from slipsweep.files.selection import find, places_at
from tests.support.charts import (
    AMPLITUDES,
    FREQUENCIES,
    SINE,
)


def test_only_what_is_shown_is_read(grid_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counting the values that are loaded, chart by chart."""
    read: Counter[str] = Counter()
    original = xr.Dataset.load

    def counted(self: xr.Dataset, **options: Any) -> xr.Dataset:
        read.update({str(name): one.size for name, one in self.data_vars.items()})
        return original(self, **options)

    # times 53 amplitudes: 25 frequencies, 11 angles, every sixth frequency, one, 4 coefficients of
    # friction
    curves = {
        "contours": 25,
        "modes": 11,
        "families": 5,
        "curve": 1,
        "dimensionless": 4,
        "newmark": 11,
        "spread": 1,
    }
    monkeypatch.setattr(xr.Dataset, "load", counted)
    with slipsweep.open_result(grid_file) as data:
        for kind, count in curves.items():
            read.clear()
            kinds.draw(Result(data, "grid"), kind, Options())
            drawn = "sliding_mode" if kind == "modes" else "permanent_displacement"
            assert read == {drawn: count * 53, "validity": count * 53}


@pytest.mark.parametrize(("theta", "mu_s"), [(6.0, 0.45), (4.9, 0.45), (6.0, 0.37), (19.3, 0.59)])
def test_slices_are_at_the_very_values_requested(
    grid: xr.Dataset, theta: float, mu_s: float
) -> None:
    """Where the result has none the slice is solved."""
    keep: dict[str, Any] = {"frequency": slice(None), "amplitude": slice(None)}
    found = Result(grid, "grid").select(
        ["permanent_displacement", "validity"], keep, {"theta": theta, "mu_s": mu_s}
    )
    direct = slipsweep.sweep(theta, mu_s, AMPLITUDES, FREQUENCIES, excitation=SINE)
    for name in ("theta", "mu_s", "permanent_displacement", "validity"):
        np.testing.assert_array_equal(found[name].transpose(*direct[name].dims), direct[name])


def test_values_on_axes_are_found_as_messages_print_them(grid: xr.Dataset) -> None:
    result = slipsweep.sweep(5.0, [0.3, 1 / 3, 0.4], [0.3 * 9.81, 4.0], np.geomspace(0.3, 3, 7))
    printed = f"{result.frequency.values[2]:.4g}"
    for at, expected in (
        ({"amplitude": "0.3g"}, {"amplitude": [0]}),
        ({"amplitude": "294.3 cm/s^2, 4"}, {"amplitude": [0, 1]}),
        ({"mu_s": "0.3333", "theta": "5deg"}, {"mu_s": [1]}),
        ({"frequency": printed}, {"frequency": [2]}),
        ({"frequency": f"{printed}Hz"}, {"frequency": [2]}),
        ({"frequency": f"{float(printed) * 1000:g}mHz"}, {"frequency": [2]}),
    ):
        found = places_at(result, "result", at, list(map(str, result.dims)))
        assert {name: places.tolist() for name, places in found.items()} == expected
    assert find(result, {"mu_s": 0.3333})["mu_s"][0].index is None  # a number is what it is
    wrong: tuple[tuple[dict[str, Any], str], ...] = (
        (
            {"frequency": "1.2"},
            r"frequency = 1.2: not among the values of the result; its neighbours are 0.948683 and",
        ),
        ({"frequency": "1200mHz"}, "frequency = 1.2: not among the values"),
        ({"theta": 6}, "theta = 6: outside the range of the result, 5 degree"),
        ({"thta": 5}, 'did you mean "theta"'),
    )
    for cut, message in wrong:
        with pytest.raises(InputError, match=message):
            places_at(result, "result", cut, list(map(str, result.dims)))


def test_values_that_nothing_lies_between_are_refused_with_their_neighbours() -> None:
    measured = xr.DataArray([0.5, 0.6, 0.7], dims="theta", coords={"theta": [0.0, 3.0, 6.0]})
    result = slipsweep.sweep([0.0, 3.0, 6.0], 0.4, [2.0, 3.0], 1.0, yield_acceleration=measured)
    with pytest.raises(
        InputError,
        match=r"theta = 4: .*neighbours are 3 and 6 degree .yield_acceleration is known at",
    ):
        result.slipsweep.chart("families", at={"theta": 4})
