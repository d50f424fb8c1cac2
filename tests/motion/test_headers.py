"""Headers of recorded motions: count and interval of the samples, units by their codes."""

from pathlib import Path

import numpy as np
import pytest

from slipsweep import InputError, read_record

PEER = "STRONG MOTION\nA PLACE, 1/1/2000\nACCELERATION TIME HISTORY IN UNITS OF G\n"

COSMOS = Path(__file__).parents[1] / "data" / "cosmos.V1"

#: The line of integers that the code of the unit stands in, and this code.
COSMOS_LINE = "       1       1       4     120"


@pytest.mark.parametrize(
    "header",
    [
        "   4    0.0200    NPTS, DT",  # of the first database
        "NPTS=   4, DT=   .0200 SEC,",
        "NPTS= 4, DT= 2.0E-02 SEC",
    ],
)
def test_peer_headers_have_a_count_and_an_interval(tmp_path: Path, header: str) -> None:
    path = tmp_path / "motion.AT2"
    path.write_text(f"{PEER}{header}\n  .1000E+00  -.2000E+00\n  .3000E+00  -.4000E+00\n")
    record = read_record(path)
    np.testing.assert_allclose(record.times, [0.0, 0.02, 0.04, 0.06], rtol=1e-15)
    expected = 9.80665 * np.array([0.1, -0.2, 0.3, -0.4])
    np.testing.assert_allclose(record.acceleration, expected, rtol=1e-15)


def test_a_peer_header_of_the_first_database_counts_its_samples(tmp_path: Path) -> None:
    path = tmp_path / "motion.AT2"
    path.write_text(f"{PEER}   5    0.0200    NPTS, DT\n .1 .2 .3 .4\n")
    with pytest.raises(InputError, match="4 accelerations, where its header says 5"):
        read_record(path)


@pytest.mark.parametrize(
    ("code", "unit", "factor"), [(2, "g", 9.80665), (4, "cm/s2", 0.01), (10, "gal", 0.01)]
)
def test_codes_of_cosmos_are_units(tmp_path: Path, code: int, unit: str, factor: float) -> None:
    """Table 2 of the format; 1.5 is a value of the file."""
    text = COSMOS.read_text()
    assert text.count(COSMOS_LINE) == 1
    path = tmp_path / "motion.V1"
    text = text.replace(COSMOS_LINE, f"       1       1{code:8d}     120")
    path.write_text(text.replace("cm/sec2 (04)", f"{unit} ({code:02d})"))
    record = read_record(path, implausible="accept")
    assert record.acceleration[2] == pytest.approx(1.5 * factor, rel=1e-15)
    assert record.attrs["record_units"] == unit


def test_esm_headers_have_a_unit_and_an_interval(tmp_path: Path) -> None:
    path = tmp_path / "motion.ASC"
    path.write_text("SAMPLING_INTERVAL_S: 0.005\nNDATA: 3\nUNITS: cm/s^2\n10\n-20\n30\n")
    record = read_record(path)
    np.testing.assert_allclose(record.times, [0.0, 0.005, 0.01], rtol=1e-15)
    np.testing.assert_allclose(record.acceleration, [0.1, -0.2, 0.3], rtol=1e-15)


def test_knet_headers_scale_counts(tmp_path: Path) -> None:
    """3 gal for each 100 counts, at 50 samples a second."""
    path = tmp_path / "motion.EW"
    path.write_text(
        "Origin Time       2000/01/01 12:00:00\nSampling Freq(Hz) 50Hz\nDuration Time(s)  0.06\n"
        "Scale Factor      3(gal)/100\nMemo.\n 1000 -2000 500\n"
    )
    record = read_record(path)
    np.testing.assert_allclose(record.times, [0.0, 0.02, 0.04], rtol=1e-15)
    np.testing.assert_allclose(record.acceleration, [0.3, -0.6, 0.15], rtol=1e-14)
