"""Files of recorded motions: formats, units, baseline, channels, warnings and refusals."""

import hashlib
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, Record, read_record, read_suite

AT2 = (
    "PEER STRONG MOTION DATABASE RECORD\n"
    "A PLACE, 1/1/2000\n"
    "ACCELERATION TIME HISTORY IN UNITS OF G\n"
)

#: Typed in after the description of the format: 2^23 counts are 2000 gal, at 100 samples a second
#: for 0.05 s.
KNET = """Origin Time       2000/01/01 12:00:00
Lat.              35.0
Station Code      XYZ001
Sampling Freq(Hz) 100Hz
Duration Time(s)  0.05
Dir.              N-S
Scale Factor      2000(gal)/8388608
Max. Acc. (gal)   200.000
Memo.
   419430        0  -838861
   41943     -4194
"""

#: A file as the format's description has it (Ver. 1.20, 2001), typed in, not made by any code of
#: ours: 13 lines of text, headers with 999s for what is unknown, values in columns with no blanks
#: between them.
V1 = Path(__file__).parents[1] / "data" / "cosmos.V1"


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "units", "factor"),
    [
        ("0,0.1\n0.01,0.2\n", "g", 9.80665),
        ("time (s),acceleration (m/s2)\n0,0.1\n0.01,0.2\n", None, 1.0),
        ("peak 0.35 (g)\ntime (s),acceleration (m/s2)\n0,0.1\n0.01,0.2\n", None, 1.0),
        ("# a comment\n# Time (s),Acceleration (g's)\n0;0.1\n0.01;0.2\n", None, 9.80665),
        ("t [s]\ta [cm/s^2]\n0\t0.1\n0.01\t0.2\n\n", None, 0.01),
        ("Zeit (s);Beschleunigung (g)\n0,00;0,1\n0,01;2,0e-1\n", None, 9.80665),
        ("0,00 0,1\n0,01\t0,2\n", "m/s2", 1.0),
        (f"{AT2}NPTS= 2, DT= .0100 SEC\n .1 .2\n", None, 9.80665),
        ("SAMPLING_INTERVAL_S: 0.01\nNDATA: 2\nUNITS: cm/s^2\n0.1\n0.2\n", None, 0.01),
        ("dt = 0.01 s, in g\n0.1\n0.2\n", "g", 9.80665),
        (f"{AT2.replace('OF G', 'OF M/S**2')}NPTS= 2, DT= .0100 SEC\n .1 .2\n", None, 1.0),
        (f"{AT2.replace('OF G', 'OF CM/SEC/SEC')}NPTS= 2, DT= .01 SEC\n .1 .2\n", "gal", 0.01),
        ("NPTS= 2, DT= .0100 SEC\n .1 .2\n", None, 9.80665),
    ],
)
def test_columns_of_times_and_accelerations_in_each_unit(
    tmp_path: Path, text: str, units: Any, factor: float
) -> None:
    record = read_record(write(tmp_path, "a", text), units=units)
    np.testing.assert_allclose(record.times, [0.0, 0.01], rtol=1e-15)
    np.testing.assert_allclose(record.acceleration, [0.1 * factor, 0.2 * factor], rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "format"),
    [
        ("0.1\n-0.2\n0.3\n", "auto"),
        ("0.1, -0.2\n0.3\n", "values"),
        ("0,1\n-0,2\n0,3\n", "auto"),
        ("acc (g)\n0.1 -0.2 0.3\n", "auto"),
    ],
)
def test_accelerations_alone_with_their_interval(tmp_path: Path, text: str, format: Any) -> None:
    """As SLAMMER has them: numbers between blanks, commas or lines."""
    path = write(tmp_path, "a.txt", text)
    record = read_record(path, units="g", interval=0.005, format=format)
    np.testing.assert_allclose(record.times, [0.0, 0.005, 0.01], rtol=1e-15)
    np.testing.assert_allclose(
        record.acceleration, 9.80665 * np.array([0.1, -0.2, 0.3]), rtol=1e-15
    )


def test_counts_of_knet_become_accelerations(tmp_path: Path) -> None:
    record = read_record(write(tmp_path, "XYZ001.NS", KNET))
    counts = np.array([419430, 0, -838861, 41943, -4194])
    np.testing.assert_allclose(record.acceleration, counts * 2000 / 8388608 * 0.01, rtol=1e-14)
    np.testing.assert_allclose(record.times, np.arange(5) * 0.01, rtol=1e-15)
    assert (record.attrs["record_format"], record.attrs["record_units"]) == ("knet", "gal")


def test_corrections_remove_the_mean_or_the_trend() -> None:
    times = np.linspace(0.0, 4.0, 401)
    record = Record(times, np.cos(2 * pi * times) + 0.3 + 0.2 * times)
    np.testing.assert_array_equal(record.corrected("none").acceleration, record.acceleration)
    assert record.corrected("mean").acceleration.mean() == pytest.approx(0.0, abs=1e-15)
    slope, offset = np.polyfit(times, record.corrected("linear").acceleration, 1)
    assert (slope, offset) == pytest.approx((0.0, 0.0), abs=1e-14)


@pytest.mark.parametrize(
    ("name", "text", "options", "message"),
    [
        ("a.csv", "0,1\n1,2\n", {}, "units: must be given"),
        ("a.csv", "time (ms),a (g)\n0,1\n1,2\n", {}, "time in ms: must be in s"),
        ("a.csv", "t,a (g)\n0,1\n1,2\n", {"units": "gal"}, "the file itself says 'g'; correct it"),
        ("a.csv", "0,1\n1,x\n", {"units": "g"}, "line 2: '1,x'"),
        ("a.csv", "0,1\n1,\n", {"units": "g"}, "first at t = 1 s"),
        (
            "a.csv",
            "0,1\n1,1\n1,2\n",
            {"units": "g"},
            "time of sample 3 = 1: must be greater than 1",
        ),
        ("a.csv", "no numbers\n", {"units": "g"}, "no line of a time and an acceleration"),
        (
            "a.csv",
            "0,1\n1,2\n",
            {"units": "g", "channel": 1},
            "channel = 1: only for a file that holds several",
        ),
        ("a.txt", "1\n2\n", {"units": "g"}, "interval: must be given"),
        (
            "a.txt",
            "0,1\n0.1,2\n",
            {"units": "g", "interval": 0.1},
            "the first column is that of times",
        ),
        (
            "a.txt",
            "dt = 0.01\n1\n2\n",
            {"units": "g", "interval": 0.02},
            "the file itself says 0.01",
        ),
        (
            "a.AT2",
            f"{AT2}NPTS= 3, DT= .005 SEC\n 1 2\n",
            {},
            "2 accelerations, where its header says 3",
        ),
        ("a.AT2", f"{AT2}NPTS= 3, DT= .005 SEC\n 1 2\n oops\n", {}, "line 6: ' oops'"),
        ("a.AT2", f"{AT2}NPTS= 3, DT= .005 SEC\n 1 2 1e999\n", {}, "sample 3 = inf"),
        (
            "a.AT2",
            f"{AT2}NPTS= 2, DT= .005 SEC\n 1 2\n",
            {"interval": 0.01},
            "only for a file without times",
        ),
        (
            "a.AT2",
            f"{AT2.replace('OF G', 'OF M/S**2')}NPTS= 2, DT= .005 SEC\n 1 2\n",
            {"units": "g"},
            "units = 'g': the file itself says 'm/s2'",
        ),
        (
            "a.AT2",
            f"{AT2.replace('OF G', 'OF FT/SEC2')}NPTS= 2, DT= .005 SEC\n 1 2\n",
            {"units": "g"},
            "its heading says 'FT/SEC2': must be an acceleration",
        ),
        (
            "a.VT2",
            "PEER\nA place, 0\nVELOCITY TIME HISTORY IN UNITS OF CM/S\nNPTS= 2, DT= .01\n 1 2\n",
            {"units": "g"},
            "its heading says 'VELOCITY in CM/S'",
        ),
        (
            "a.ASC",
            "SAMPLING_INTERVAL_S: 0.01\nNDATA: 2\nUNITS: cm/s\nDATA_TYPE: VELOCITY\n0.1\n0.2\n",
            {},
            "DATA_TYPE: VELOCITY: must be ACCELERATION",
        ),
        ("a.NS", KNET.replace("  -4194", ""), {}, "4 accelerations, where its header says 5"),
        ("a.AT2", f"{AT2}NPTS= many, DT= .005 SEC\n 1 2\n", {}, "no NPTS= in its header"),
    ],
)
def test_files_that_are_refused(
    tmp_path: Path, name: str, text: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=name.replace(".", "[.]")) as error:
        read_record(write(tmp_path, name, text), **options)
    assert message in str(error.value)
    assert len(str(error.value)) < 400
    assert "\n" not in str(error.value)


# ---------------------------------------------------------------------------- looked at before used

TIMES = np.arange(1001) * 0.01
SHAKING = 0.3 * np.sin(7.0 * TIMES) * np.hanning(1001)


def motion(folder: Path, times: Any = TIMES, values: Any = SHAKING) -> Path:
    rows = "".join(f"{time:.2f},{value:.7g}\n" for time, value in zip(times, values, strict=True))
    return write(folder, "motion.csv", rows)


def changed(value: float, *at: int) -> Any:
    values = SHAKING.copy()
    values[list(at)] = value
    return values


OUT = np.r_[:400, 600:1001]
#: Seconds that are interpolated let the ground drift.
BOTH = {"gaps": "linear", "implausible": "accept"}
WRONG: dict[str, tuple[Any, Any, dict[str, Any], str]] = {
    "gap": (TIMES[OUT], SHAKING[OUT], BOTH, "no samples from t = 3.99 to 6 s (201 times"),
    "-999": (
        TIMES,
        changed(-999, 500),
        {"gaps": "linear"},
        "1 fill value (-999), first at t = 5 s",
    ),
    "blank": (
        TIMES,
        changed(np.nan, 500),
        {"gaps": "linear"},
        "1 fill value (blank), first at t = 5 s",
    ),
    "repeated": (
        TIMES,
        changed(-1e5, 500, 700),
        {"gaps": "linear"},
        "2 fill values (-100000), first at t = 5 s",
    ),
    "held": (
        TIMES,
        changed(0.1, *range(500, 600)),
        BOTH,
        "the value 0.1 is held from t = 5 to 5.99 s",
    ),
    "peak": (
        TIMES,
        changed(4.0, 500),
        {"implausible": "accept"},
        "peak acceleration 4 g at t = 5 s",
    ),
    "unit": (TIMES, SHAKING * 980.665, {"implausible": "accept"}, "in cm/s2 it would be 0.299 g"),
    "weak": (
        TIMES,
        SHAKING / 980.665,
        {"implausible": "accept"},
        "below 0.001 g, check units and header",
    ),
    "drift": (TIMES, SHAKING + 0.02, {"implausible": "accept"}, "the ground moves 9.79 m"),
}


@pytest.mark.parametrize("what", WRONG)
def test_records_are_looked_at_before_they_are_used(tmp_path: Path, what: str) -> None:
    times, values, word, message = WRONG[what]
    path = motion(tmp_path, times, values)
    for read in (read_record, read_suite):
        with pytest.raises(InputError) as error:
            read(path, units="g")
        text = "\n".join([str(error.value), *getattr(error.value, "__notes__", ())])
        assert f"{path}: " in text
        assert message in text
    assert message in read_record(path, units="g", **word).summary()
    assert read_suite(path, units="g", **word)[0] == read_record(path, units="g", **word)


def test_missing_samples_are_interpolated_and_drifts_taken_off(tmp_path: Path) -> None:
    whole = read_record(motion(tmp_path), units="g")
    for values in (changed(-999, 500, 501), changed(np.nan, 500, 501)):
        record = read_record(motion(tmp_path, TIMES, values), units="g", gaps="linear")
        kept = np.r_[:500, 502:1001]
        np.testing.assert_array_equal(record.times, whole.times[kept])
        np.testing.assert_array_equal(record.acceleration, whole.acceleration[kept])
    drifting = motion(tmp_path, TIMES, SHAKING + 0.02)
    assert "record_accepted" not in read_record(drifting, units="g", baseline="linear").attrs
    with pytest.raises(InputError, match="the ground moves 9"):  # a gap excuses no drift
        read_record(
            motion(tmp_path, TIMES, np.where(TIMES == 5.0, -999, SHAKING + 0.02)),
            units="g",
            gaps="linear",
        )


def test_peaks_of_999_gal_are_no_fill_values(tmp_path: Path) -> None:
    values = np.round(SHAKING / np.abs(SHAKING).max() * 999)
    record = read_record(motion(tmp_path, TIMES, values), units="gal")
    assert record.peak == pytest.approx(9.99)


def test_a_summary_has_interval_peaks_unit_and_cautions(tmp_path: Path) -> None:
    path = motion(tmp_path, TIMES, np.where(TIMES == 5.0, 0.3, 0.0))  # a triangle of 0.02 s
    expected = f"{path}: 10 s at 0.01 s, PGA 0.3 g, PGV {0.003 * 9.80665:.4g} m/s, read in g"
    expected = f"{expected}; caution: 100% of its samples are 0"
    assert read_record(path, units="g").summary() == expected


def test_a_clipped_record_is_said(tmp_path: Path) -> None:
    """At the largest value, the smallest, or both; steps onto it tell it from rounding."""
    level = 0.6 * np.abs(SHAKING).max()
    clipped = {
        f"flat at its largest value {level:.4g} g": np.minimum(SHAKING, level),
        f"flat at its smallest value {-level:.4g} g": np.maximum(SHAKING, -level),
    }
    for text, values in clipped.items():
        path = motion(tmp_path, TIMES, values)
        record = read_record(path, units="g", implausible="accept")
        samples = int((np.abs(values) == level).sum())
        assert f"; caution: {text} ({samples} samples, first at t = " in record.summary()
    both = read_record(motion(tmp_path, TIMES, np.clip(SHAKING, -level, level)), units="g")
    assert all(text in both.attrs["record_caution"] for text in clipped)
    # written with few digits, each peak is flat as well, but a smallest step from its neighbours
    for digits in (2, 3):
        rounded = motion(tmp_path, TIMES, np.round(SHAKING, digits))
        assert "record_caution" not in read_record(rounded, units="g").attrs


def test_a_record_of_which_half_is_zero_is_said(tmp_path: Path) -> None:
    for values in (np.where(TIMES < 5.0, SHAKING, 0.0), SHAKING * (np.arange(1001) % 2)):
        record = read_record(motion(tmp_path, TIMES, values), units="g", implausible="accept")
        assert record.attrs["record_caution"] == "50% of its samples are 0"
    assert "record_caution" not in read_record(motion(tmp_path), units="g").attrs


# --------------------------------------------------------------------------------- ObsPy


def trace(data: Any, delta: float = 0.01) -> Any:
    return SimpleNamespace(data=data, id="XX.ABC..HNE", stats=SimpleNamespace(delta=delta))


def test_a_trace_of_obspy() -> None:
    record = Record.from_obspy(trace(30.0 * SHAKING.astype(np.float32)), "cm/s2")
    np.testing.assert_allclose(record.acceleration, 0.3 * SHAKING, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(record.times, TIMES, rtol=1e-15)
    assert (record.name, record.attrs["record_units"]) == ("XX.ABC..HNE", "cm/s2")
    assert (
        abs(Record.from_obspy(trace(SHAKING + 0.01), "m/s2", baseline="mean").acceleration.mean())
        < 1e-12
    )
    masked = np.ma.masked_array(SHAKING, np.arange(1001) == 500)
    with pytest.raises(
        InputError, match=r"XX\.ABC\.\.HNE: 1 fill value \(blank\), first at t = 5 s"
    ):
        Record.from_obspy(trace(masked), "m/s2")
    assert Record.from_obspy(trace(masked), "m/s2", gaps="linear").times.size == 1000
    vertical = trace(SHAKING)
    vertical.id = "XX.ABC..HNZ"
    assert Record.from_obspy(vertical, "m/s2").attrs["record_caution"] == "vertical component (HNZ)"
    for none, message in (
        (trace(np.arange(5)), "whole numbers, counts of a digitizer"),
        ([1.0], "must be a Trace of"),
    ):
        with pytest.raises(InputError, match=message):
            Record.from_obspy(none, "m/s2")


# --------------------------------------------------------------------------------- COSMOS


def test_cosmos_by_its_columns() -> None:
    """Eight values to a line in columns of ten, cm/s², at 200 samples a second; the last touch."""
    record = read_record(V1)
    expected = [
        0.03630,
        -0.03632,
        1.5,
        -20.25,
        98.0665,
        -980.665,
        12.00001,
        -0.5,
        -234.56789,
        -100.00001,
    ]
    np.testing.assert_allclose(record.acceleration, 0.01 * np.array(expected), rtol=1e-15)
    np.testing.assert_allclose(record.times, 0.005 * np.arange(10), rtol=1e-15)
    assert (record.attrs["record_format"], record.attrs["record_units"]) == ("cosmos", "cm/s2")
    assert record.attrs["record_sha256"] == hashlib.sha256(V1.read_bytes()).hexdigest()


def test_cosmos_with_several_channels(tmp_path: Path) -> None:
    first = V1.read_text()
    end = first.index("End-of-data")  # a V2 file has velocities behind its accelerations
    pts = (
        "       2 velocity pts, approx 0 secs, units=cm/s (05),Format=(8F10.5)\n"
        "   1.00000   2.00000\n"
    )
    other = first.replace("   0.03630", "  77.00000")
    velocity = first.replace("       1       1       4     120", "       2       2       5     120")
    path = write(tmp_path, "three.V2", first[:end] + pts + first[end:] + velocity + other)
    with pytest.raises(
        InputError, match="channel = None: must be one of its 2 channels of acceleration"
    ):
        read_record(path)
    channels = [read_record(path, channel=number) for number in (1, 2)]
    assert [float(record.acceleration[0]) for record in channels] == pytest.approx(
        [0.000363, 0.77], rel=1e-15
    )
    assert channels[1].attrs["record_channel"] == "2"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "       1       1       4     120",
            "       0       1      50     120",
            "code 50 for the unit",
        ),
        (
            "       1       1       4     120",
            "       1       2       5     120",
            "channel = None: must be one of its 0 channels",
        ),
        ("     5.000000     0.050000", "  -999.000000     0.050000", "sampling interval -0.999"),
        ("      10 acceleration", "      11 acceleration", "10 values, where 11 are announced"),
        ("-100.00001", "-100.0x001", "must be numbers, 10 columns each"),
        ("End-of-data", "end of file", "no line End-of-data"),
        (
            "       1       1       4     120",
            "       3       1       4     120",
            "is COSMOS V3 (response spectra), which is not read",
        ),
        ("     5.000000     0.050000", "     5.000000     0.500000", "real 63 says 0.5 s"),
        ("     0.005000     0.050000", "     0.005000     0.200000", "real 35 says 0.2 s"),
        ("     5.000000     0.050000", "    50.000000     0.050000", "every 0.05 s are 0.5 s"),
        ("approx   0 secs", "approx  70 secs", "the line of its values says 70 s"),
        ("units=cm/sec2 (04)", "units=g (02)", "says 4 (cm/s2) for the unit, the line of its"),
        ("units=cm/sec2 (04)", "units=g (04)", "the line of its values units=g (04): damaged"),
        ("units=cm/sec2 (04)", "units=cm/sec2 (02)", "units=cm/sec2 (02): damaged"),
        ("units=cm/sec2 (04)", "units=mg (04)", "its heading says 'mg'"),
        (" 100 Real-header", " 100 Complex-header", "line 25"),
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
