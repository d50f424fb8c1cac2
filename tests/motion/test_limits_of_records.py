"""Records just within and just beyond each limit that docs/records.md names."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, Record, read_record

G = 9.80665

TIMES = np.arange(1001) * 0.01
SHAKING = 0.3 * np.sin(7.0 * TIMES) * np.hanning(1001)


def read(folder: Path, times: Any, values: Any, **how: Any) -> Record:
    """Read samples in g from a file."""
    path = folder / "motion.csv"
    rows = (f"{time:.6g},{value:.9g}\n" for time, value in zip(times, values, strict=True))
    path.write_text("".join(rows))
    return read_record(path, units="g", **how)


@pytest.mark.parametrize(("baseline", "degree"), [("mean", 0), ("linear", 1)])
def test_a_baseline_is_the_constant_or_the_line_of_least_squares(
    baseline: Any, degree: int
) -> None:
    """Of a drift that is neither."""
    times: Any = TIMES + 3.0
    values: Any = SHAKING + 0.01 * (TIMES - 2.0) ** 2
    record = Record(times, values)
    taken = record.acceleration - record.corrected(baseline).acceleration
    line = np.polyfit(record.times, record.acceleration, degree)
    np.testing.assert_allclose(taken, np.polyval(line, record.times), rtol=1e-9)


@pytest.mark.parametrize(("intervals", "refused"), [(4, False), (6, True)])
def test_a_gap_is_more_than_five_intervals(tmp_path: Path, intervals: int, refused: bool) -> None:
    kept = np.delete(np.arange(1001), np.arange(500, 499 + intervals))
    if refused:
        with pytest.raises(InputError, match=r"no samples from t = 4\.99 to 5\.05 s"):
            read(tmp_path, TIMES[kept], SHAKING[kept])
    else:
        assert read(tmp_path, TIMES[kept], SHAKING[kept]).times.size == kept.size


@pytest.mark.parametrize(
    ("step", "samples", "refused"),
    [
        (0.01, 50, False),  # 0.49 s
        (0.01, 52, True),  # 0.51 s
        (0.05, 20, False),  # 0.95 s, but 19 intervals
        (0.05, 21, True),
    ],
)
def test_a_value_is_held_for_half_a_second_and_twenty_samples(
    tmp_path: Path, step: float, samples: int, refused: bool
) -> None:
    times = step * np.arange(1001)
    values = 0.3 * np.sin(7.0 * times) * np.hanning(1001)
    values[500 : 500 + samples] = 0.1
    if refused:
        with pytest.raises(InputError, match=r"the value 0\.1 is held from t = "):
            read(tmp_path, times, values, implausible="accept")
    else:
        assert read(tmp_path, times, values, implausible="accept").times.size == 1001


@pytest.mark.parametrize(
    ("peak", "message"),
    [
        (2.99, ""),
        (3.01, r"peak acceleration 3\.01 g .*: above 3 g"),
        (0.00101, ""),
        (0.00099, r"peak acceleration 0\.00099 g .*: below 0\.001 g"),
    ],
)
def test_peaks_lie_between_a_thousandth_and_three_g(
    tmp_path: Path, peak: float, message: str
) -> None:
    values = SHAKING / SHAKING[np.abs(SHAKING).argmax()] * peak
    if message:
        with pytest.raises(InputError, match=message):
            read(tmp_path, TIMES, values)
    else:
        assert read(tmp_path, TIMES, values).peak == pytest.approx(peak * G, rel=1e-6)


@pytest.mark.parametrize(("offset", "refused"), [(0.038, False), (0.042, True)])
def test_ground_that_moves_on_drifts_beyond_two_metres(
    tmp_path: Path, offset: float, refused: bool
) -> None:
    """An offset c m/s² moves it by 50 c m in 10 s, and leaves it moving."""
    values = SHAKING + offset / G
    if refused:
        with pytest.raises(
            InputError, match=r"the ground moves 2\.\d* m and has a velocity of 0\.4"
        ):
            read(tmp_path, TIMES, values)
    else:
        assert read(tmp_path, TIMES, values).times.size == 1001


@pytest.mark.parametrize(("push", "refused"), [(0.39, False), (0.41, True)])
def test_ground_that_comes_to_rest_may_move_ten_metres(
    tmp_path: Path, push: float, refused: bool
) -> None:
    """c m/s² for 5 s and −c for 5 s: 25 c m, and no velocity at the end."""
    values = SHAKING + np.where(TIMES < 5.0, push, -push) / G
    values[500] = SHAKING[500]
    if refused:
        with pytest.raises(InputError, match=r"the ground moves 10\.\d* m and has a velocity of"):
            read(tmp_path, TIMES, values)
    else:
        assert read(tmp_path, TIMES, values).times.size == 1001
