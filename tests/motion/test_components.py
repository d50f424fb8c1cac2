"""Files with several components side by side are not read as one series."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, Record, read_record

INTERVAL = 0.01
TIMES = INTERVAL * np.arange(40)
#: Three components in gal, 40 samples of each.
PARTS = [
    np.round(factor * np.sin(rate * TIMES) * np.hanning(40), 4)
    for factor, rate in ((150.0, 9.0), (120.0, 14.0), (60.0, 31.0))
]

#: Made up after files of Instituto de Ingeniería, UNAM: names and values, of each channel between
#: slashes, then columns of ten.
ASA = """\
**************************************************************************
                       INSTITUTO DE INGENIERIA, UNAM
**************************************************************************
ARCHIVO ESTANDAR DE ACELERACION:
VERSION DEL FORMATO                    : 2.0
NOMBRE DEL ARCHIVO                     : XXXX0001.011
ALTITUD (msnm)                         : 13
ORIENTACION C1-C6 (rumbo;orientacion)  : /V/N00E/N90E
ORIENTACION C7-C12 (rumbo;orientacion) :
VEL. DE MUESTREO, C1-C6 (muestras/s)   : /100/100/100
INTERVALO DE MUESTREO, C1-C6 (s)       : /0.01/0.01/0.01
INTERVALO DE MUESTREO, C7-C12 (s)      :
UMBRAL DE DISPARO, C1-C6 (Gal)         : /4/4/4
DURACION DEL REGISTRO (s), C1-C6       : /0.40/0.40/0.40
NUM. TOTAL DE MUESTRAS, C1-C6          : /40/40/40
UNIDADES DE LOS DATOS                  : Gal (cm/s/s)
FORMATO DATOS (FORTRAN,10 campos/dato) : 3F10.4
COMENTARIOS:

==========================================================================
DATOS DE ACELERACION:
---------+---------+---------+---------+---------+---------+---------+
   CANAL-1   CANAL-2   CANAL-3
         V      N00E      N90E
---------+---------+---------+---------+---------+---------+---------+
"""

#: Made up after the description of JMA's CSV files.
JMA = """\
SITE CODE= 99999 somewhere,35.0,139.0,10.0,5.0,,,
 LAT.=   35.1234,,,,,,,
 LON.=  139.1234,,,,,,,
 SAMPLING RATE= 100Hz,,,,,,,
 UNIT  = gal(cm/s/s),,,,,,,
INITIAL TIME = 2024 01 01 16 10 00,,,,,,,
NS,EW,UD,,,,,
"""

#: Made up after files of AFAD, Türkiye.
AFAD = """\
STRONG GROUND MOTION RECORDS OF TURKIYE
STATION ALTITUDE (m)    : 66
RECORD TIME             : 20/07/2017 22:30:58.000000 (GMT)
NUMBER OF DATA          : 40
SAMPLING INTERVAL (sec) : 0.01
RAW PGA VALUES (gal)    : (N-S) 13.2 (E-W) 12.1 (U-D) 9.8
       N-S          E-W          U-D
"""

#: Made up after files of the Central Weather Bureau, Taiwan.
CWB = """\
#StationCode: XYZ
#SampleRate(Hz): 100
#AmplitudeUnit:  gal. DCoffset(corr)
#AmplitudeMAX. U:    0.658~   -0.837
#DataSequence: Time U(+); N(+); E(+)
#Data: 4F10.3
"""


def write(folder: Path, header: str, form: str, parts: Any = PARTS, name: str = "a.txt") -> Path:
    """A file with a header, and a line in a Python format for each sample."""
    path = folder / name
    rows = zip(*parts, strict=True)
    path.write_text(header + "".join(f"{form.format(*row)}\n" for row in rows), encoding="utf-8")
    return path


def assert_is(record: Record, part: int) -> None:
    """The record has the samples of a component, and no others."""
    np.testing.assert_allclose(record.acceleration, 0.01 * PARTS[part], rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(record.times, TIMES, rtol=1e-14)
    assert record.attrs["record_units"] == "gal"
    assert record.attrs["record_channel"] == str(part + 1)


FILES = {
    "asa": (ASA, "{:10.4f}{:10.4f}{:10.4f}", PARTS, "1 V, 2 N00E, 3 N90E"),
    "jma": (JMA, "{:.4f},{:.4f},{:.4f}", PARTS, "3 numbers on a line (NS, EW, UD)"),
    "commas": (JMA, "{:.4f},{:.4f},{:.4f},,,,,", PARTS, "3 numbers on a line (NS, EW, UD)"),
    "afad": (AFAD, "{:12.4f}{:12.4f}{:12.4f}", PARTS, "3 numbers on a line (N-S, E-W, U-D)"),
    "cwb": (CWB, "{:10.3f}{:10.4f}{:10.4f}{:10.4f}", [TIMES, *PARTS], "1 U(+), 2 N(+), 3 E(+)"),
    "plain": ("dt = 0.01 s, in gal\n", "{:.4f} {:.4f} {:.4f}", PARTS, "3 numbers on a line: "),
    "times": (
        "time (s);NS (gal);EW (gal);UD (gal)\n",
        "{:.2f};{:.4f};{:.4f};{:.4f}",
        [TIMES, *PARTS],
        "1 NS (gal), 2 EW (gal), 3 UD (gal)",
    ),
}


@pytest.mark.parametrize("kind", FILES)
def test_components_are_named_and_each_is_read(tmp_path: Path, kind: str) -> None:
    header, form, parts, named = FILES[kind]
    path = write(tmp_path, header, form, parts)
    with pytest.raises(InputError, match="channel") as refused:
        read_record(path)
    assert named in str(refused.value)
    for part in range(3):
        assert_is(read_record(path, channel=part + 1), part)
    with pytest.raises(InputError, match="channel = 4: must be one of"):
        read_record(path, channel=4)


@pytest.mark.parametrize("units", [" s  gal  gal  gal\n", "[s] [gal] [gal] [gal]\n"])
def test_names_above_their_units(tmp_path: Path, units: str) -> None:
    form = "{:.2f} {:.4f} {:.4f} {:.4f}"
    path = write(tmp_path, f"Time  NS  EW  UD\n{units}", form, [TIMES, *PARTS])
    assert_is(read_record(path, channel=2), 1)
    assert read_record(path, channel=3).attrs["record_vertical"] == "UD"
    path = write(tmp_path, "Time acc\nms g\n", "{:.0f} {:.4f}", [1000.0 * TIMES, PARTS[0]])
    with pytest.raises(InputError, match="time in ms: must be in s"):
        read_record(path)


@pytest.mark.parametrize("count", [2, 3, 4, 6, 8])
def test_columns_are_no_series_whatever_their_number(tmp_path: Path, count: int) -> None:
    """The interval that a file without times wants does not make one record of its columns."""
    parts = [0.001 * PARTS[part % 3] * (1.0 + part) for part in range(count)]
    path = write(tmp_path, "", " ".join(["{:.7f}"] * count), parts)
    with pytest.raises(InputError, match=f"{count} numbers on a line: channel = 1 to {count} "):
        read_record(path, units="g", interval=INTERVAL)
    with pytest.raises(InputError, match="interval: must be given"):
        read_record(path, units="g", channel=2)
    record = read_record(path, units="g", interval=INTERVAL, channel=2)
    np.testing.assert_allclose(record.acceleration, 9.80665 * parts[1], rtol=1e-4, atol=1e-6)


def test_one_component_in_lines_of_several_numbers(tmp_path: Path) -> None:
    """It cannot be told from components side by side, and is read at an explicit word."""
    whole = PARTS[0]
    lines = [" ".join(f"{value:.4f}" for value in whole[at : at + 7]) for at in range(0, 40, 7)]
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="format = 'values' a single one whose lines follow"):
        read_record(path, units="gal", interval=INTERVAL)
    record = read_record(path, units="gal", interval=INTERVAL, format="values")
    np.testing.assert_allclose(record.acceleration, 0.01 * whole, rtol=1e-14, atol=1e-16)
    path.write_text("\n".join((lines[0], *lines)) + " 1 2 3 4\n" + lines[0])
    with pytest.raises(InputError, match="line 7: 9 numbers, where others have 7"):
        read_record(path, units="gal", interval=INTERVAL)


def test_columns_of_a_format_may_touch(tmp_path: Path) -> None:
    path = write(tmp_path, ASA, "{:10.4f}{:10.4f}{:10.4f}", [-1200.0 - part for part in PARTS])
    assert "-1200.0000-1200.0000-1200.0000\n" in path.read_text()
    record = read_record(path, channel=2)
    np.testing.assert_allclose(record.acceleration, -12.0 - 0.01 * PARTS[1], rtol=1e-14)


def test_a_short_header_of_unam_suffices(tmp_path: Path) -> None:
    """Neither rules above the data nor directions nor lengths."""
    kept = ("INTERVALO", "UNIDADES")
    header = "".join(line for line in ASA.splitlines(True) if line.startswith(kept))
    path = write(tmp_path, header, "{:10.4f}{:10.4f}{:10.4f}")
    with pytest.raises(InputError, match="channel = None: must be one of 1, 2, 3: the file holds"):
        read_record(path)
    for part in range(3):
        assert_is(read_record(path, channel=part + 1), part)


@pytest.mark.parametrize(
    ("old", "new", "options", "message"),
    [
        ("", "", {"units": "g"}, "the file itself says 'gal'"),
        ("", "", {"interval": 0.02}, "interval = 0.02: only for a file without times"),
        ("Gal (cm/s/s)", "cm/s", {}, "its heading says 'cm/s'"),
        ("/40/40/40", "/50/50/50", {}, "40 accelerations, where its header says 50"),
        ("/0.01/0.01/0.01", "/ / /", {}, "no INTERVALO DE MUESTREO in its header"),
        ("/0.01/0.01/0.01", "/0.01/0.01", {}, "INTERVALO DE MUESTREO: 2 values, where"),
        ("    0.0000    0.0000    0.0000\n", "    0.0000    0.0000\n", {}, "must be 3 accel"),
    ],
)
def test_damaged_files_of_unam_are_refused(
    tmp_path: Path, old: str, new: str, options: dict[str, Any], message: str
) -> None:
    path = write(tmp_path, ASA, "{:10.4f}{:10.4f}{:10.4f}")
    text = path.read_text()
    if "40" in old:  # the length is said twice, and in some files one of the two is wrong
        text = text.replace("/0.40/0.40/0.40", "/0.50/0.50/0.50")
        path.write_text(text)
        assert_is(read_record(path, channel=1), 0)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=r"a\.txt") as refused:
        read_record(path, **{"channel": 1, **options})
    assert message in str(refused.value)


def test_the_interval_of_a_header_holds(tmp_path: Path) -> None:
    path = write(tmp_path, JMA, "{:.4f},{:.4f},{:.4f}")
    assert_is(read_record(path, channel=1, interval=INTERVAL), 0)
    with pytest.raises(InputError, match=r"interval = 0\.02: the file itself says 0\.01"):
        read_record(path, channel=1, interval=0.02)
    for said in ("dt (ms): 10", "Sampling interval, s = 0,01", "sampling frequency 100 Hz"):
        path = write(tmp_path, f"{said}\nin gal\n", "{:.4f}", PARTS[:1])
        np.testing.assert_allclose(read_record(path).times, TIMES, rtol=1e-14)


@pytest.mark.parametrize("name", ["period (s)", "Frequency (Hz)", "No.", "sample"])
def test_a_first_column_of_something_else_is_no_time(tmp_path: Path, name: str) -> None:
    first = 0.1 * np.arange(1, 41)
    path = write(tmp_path, f"{name},acceleration (g)\n", "{:.1f},{:.4f}", [first, PARTS[0] / 981.0])
    with pytest.raises(InputError, match=r"its first column is .*: must be time"):
        read_record(path)
