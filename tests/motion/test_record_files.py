"""Files of recorded motions: formats, units, baseline, channels, and what is refused."""

import hashlib
from contextlib import suppress
from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slipsweep import InputError, Record, read_record
from slipsweep.motion import records


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "units", "factor"),
    [
        ("0,0.1\n0.01,0.2\n", "g", 9.80665),
        ("time (s),acceleration (m/s2)\n0,0.1\n0.01,0.2\n", None, 1.0),
        ("# a comment\n# Time (s),Acceleration (g's)\n0;0.1\n0.01;0.2\n", None, 9.80665),
        ("t [s]\ta [cm/s^2]\n0\t0.1\n0.01\t0.2\n\n", None, 0.01),
        ("0 0.1\n0.01 0.2\n", "gal", 0.01),
    ],
)
def test_csv(tmp_path: Path, text: str, units: str | None, factor: float) -> None:
    record = read_record(write(tmp_path, "a.csv", text), units=units)
    np.testing.assert_array_equal(record.times, [0.0, 0.01])
    np.testing.assert_allclose(record.acceleration, [0.1 * factor, 0.2 * factor], rtol=1e-15)


AT2 = "PEER STRONG MOTION DATABASE RECORD\nA PLACE, 1/1/2000\nACCELERATION TIME HISTORY IN UNITS OF G\n"


def test_at2_and_esm(tmp_path: Path) -> None:
    at2 = write(tmp_path, "a.AT2", f"{AT2}NPTS=   3, DT=   .0050 SEC\n  .1E-01 -.2E-01\n  .3E-01\n")
    esm = write(tmp_path, "a.ASC", "SAMPLING_INTERVAL_S: 0.005\nNDATA: 3\nUNITS: cm/s^2\n9.80665\n-19.6133\n29.41995\n")
    for path in (at2, esm):
        record = read_record(path)
        np.testing.assert_allclose(record.times, [0.0, 0.005, 0.01], rtol=1e-15)
        np.testing.assert_allclose(record.acceleration, np.array([1, -2, 3]) * 0.0980665, rtol=1e-14)


def test_baseline() -> None:
    times = np.linspace(0.0, 4.0, 401)
    record = Record(times, np.cos(2 * pi * times) + 0.3 + 0.2 * times)
    np.testing.assert_array_equal(record.corrected("none").acceleration, record.acceleration)
    assert record.corrected("mean").acceleration.mean() == pytest.approx(0.0, abs=1e-15)
    slope, offset = np.polyfit(times, record.corrected("linear").acceleration, 1)
    assert (slope, offset) == pytest.approx((0.0, 0.0), abs=1e-14)


@pytest.mark.parametrize(
    ("name", "text", "units", "message"),
    [
        ("a.csv", "0,1\n1,2\n", None, "units: must be given"),
        ("a.csv", "t,a (g)\n0,1\n1,2\n", "gal", "the file itself says 'g'"),
        ("a.csv", "0,1\n1,x\n", "g", "line 2: '1,x'"),
        ("a.csv", "0,1\n1,nan\n", "g", "line 2"),
        ("a.csv", "0,1\n1,1\n1,2\n", "g", "line 3: time 1: must be greater than 1"),
        ("a.csv", "0,1\n1,2,3\n", "g", "line 2"),
        ("a.csv", "no numbers\n", "g", "no line of a time and an acceleration"),
        ("a.csv", "0,1\n", "g", "must be at least 2"),
        ("a.AT2", f"{AT2}NPTS= 3, DT= .005 SEC\n 1 2\n", None, "2 accelerations, where its header says 3"),
        ("a.AT2", f"{AT2}NPTS= 3, DT= .005 SEC\n 1 2\n oops\n", None, "line 6: ' oops'"),
        ("a.AT2", f"{AT2}NPTS= 2, DT= .005 SEC\n 1 nan\n", None, "sample 2 = nan"),
        ("a.VT2", f"{AT2}VELOCITY\nNPTS= 2, DT= .005 SEC\n 1 2\n", None, "velocity or displacement"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, name: str, text: str, units: str | None, message: str) -> None:
    with pytest.raises(InputError, match=name.replace(".", "[.]")) as error:
        read_record(write(tmp_path, name, text), units=units)
    assert message in str(error.value)


# ---------------------------------------------------------------------------------- COSMOS

#: A file as the format's description has it (Ver. 1.20, 2001), typed in, not made by any code of ours: 13 lines
#: of text, headers with 999s for what is unknown, values in columns with no blanks between them.
V1 = Path(__file__).parents[1] / "data" / "cosmos.V1"


def test_cosmos_by_its_columns() -> None:
    """Eight values to a line in columns of ten, cm/s², at 200 samples a second; the last ones touch."""
    record = read_record(V1)
    expected = [0.03630, -0.03632, 1.5, -20.25, 98.0665, -980.665, 12.00001, -0.5, -234.56789, -100.00001]
    np.testing.assert_allclose(record.acceleration, 0.01 * np.array(expected), rtol=1e-15)
    np.testing.assert_allclose(record.times, 0.005 * np.arange(10), rtol=1e-15)
    assert (record.attrs["record_format"], record.attrs["record_units"]) == ("cosmos", "cm/s2")


def with_velocity(text: str) -> str:
    """What a V2 file has behind its acceleration."""
    end = text.index("End-of-data")
    return (
        text[:end]
        + "       2 velocity pts, approx 0 secs, units=cm/s (05),Format=(8F10.5)\n   1.00000   2.00000\n"
        + text[end:]
    )


def test_cosmos_with_several_channels(tmp_path: Path) -> None:
    first = V1.read_text()
    other = first.replace("   0.03630", "  77.00000")
    velocity = first.replace("       1       1       4     120", "       2       2       5     120")
    path = write(tmp_path, "three.V2", with_velocity(first) + velocity + other)
    with pytest.raises(InputError, match="holds 2 channels of acceleration: give channel"):
        read_record(path)
    found = [read_record(path, channel=number) for number in (1, 2)]
    assert [float(record.acceleration[0]) for record in found] == pytest.approx([0.000363, 0.77], rel=1e-15)
    assert found[1].attrs["record_channel"] == "2"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("       1       1       4     120", "       0       1      50     120", "code 50 for the unit"),
        ("       1       1       4     120", "       1       2       5     120", "it holds 0 channels of acceleration"),
        ("     5.000000     0.050000", "  -999.000000     0.050000", "sampling interval -0.999"),
        ("      10 acceleration", "      11 acceleration", "10 values, where 11 are announced"),
        ("      10 acceleration", "       9 acceleration", "10 values, where 9 are announced"),
        ("-100.00001", "-100.0x001", "must be numbers, 10 columns each"),
        ("End-of-data", "end of file", "no line End-of-data"),
        ("   2 Comment", "   1 Comment", "not what the COSMOS format has here"),
        (" 100 Real-header", " 100 Complex-header", "line 25"),
        ("-0.03632", "     nan", "sample 2 = nan"),
    ],
)
def test_cosmos_files_that_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = V1.read_text()
    assert text.count(old) == 1
    with pytest.raises(InputError, match=r"a\.V1") as error:
        read_record(write(tmp_path, "a.V1", text.replace(old, new)))
    assert message in str(error.value)


def test_no_cosmos_file_cut_off_anywhere_is_taken_for_whole(tmp_path: Path) -> None:
    lines = V1.read_text().splitlines(keepends=True)
    for count in range(1, len(lines)):
        with pytest.raises(InputError):
            read_record(write(tmp_path, "a.V1", "".join(lines[:count])))


# ------------------------------------------------------------------------------- all files


SAMPLES = {
    "cosmos": V1.read_bytes(),
    "at2": f"{AT2}NPTS=   3, DT=   .0050 SEC\n  .1E-01 -.2E-01\n  .3E-01\n".encode(),
    "esm": b"SAMPLING_INTERVAL_S: 0.005\nNDATA: 3\nUNITS: cm/s^2\n9.8\n-19.6\n29.4\n",
    "csv": b"time (s),acceleration (g)\n0,0.1\n0.01,0.2\n0.02,-0.1\n",
}
PIECES = [
    b"",
    b"\n",
    b" ",
    b"-",
    b"1e999",
    b"nan",
    b"9" * 5000,
    b"\xb2",
    b"0",
    b"\x00",
    b":",
    b"=",
    b"(1F0.0)",
    b"1e308",
]


@pytest.mark.parametrize("kind", SAMPLES)
@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files_are_refused_or_read_but_never_break(tmp_path: Path, kind: str, data: st.DataObject) -> None:
    content = SAMPLES[kind]
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content)))
        content = content[:at] + data.draw(st.sampled_from(PIECES)) + content[at + data.draw(st.integers(0, 3)) :]
    path = tmp_path / "a"
    path.write_bytes(content)
    with suppress(InputError):
        record = read_record(path, format=kind, baseline=data.draw(st.sampled_from(["none", "mean", "linear"])))
        assert np.isfinite(record.acceleration).all()


def test_checksum_is_that_of_the_file() -> None:
    assert read_record(V1).attrs["record_sha256"] == hashlib.sha256(V1.read_bytes()).hexdigest()


def test_channel_of_a_file_that_has_one(tmp_path: Path) -> None:
    path = write(tmp_path, "a.csv", "0,1\n1,2\n")
    with pytest.raises(InputError, match="channel = 1: only COSMOS files hold several"):
        read_record(path, units="g", channel=1)


def test_a_file_too_large_for_a_record_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate(records.MOST_BYTES + 1)
    with pytest.raises(InputError, match="bytes: a record must have"):
        read_record(path, units="g")
