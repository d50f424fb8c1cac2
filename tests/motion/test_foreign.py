"""Files that are not read are refused by the name of what they are, with what to do."""

import bz2
import gzip
import io
import lzma
import struct
import tarfile
import zipfile
from pathlib import Path

import pytest

from slipsweep import InputError, read_record
from slipsweep.studies.hazard_curve import read_hazard_curve

AT2 = b"PEER\nA place, 1/1/2000, 90\nACCELERATION IN UNITS OF G\nNPTS= 2, DT= .01\n .1 .2\n"


def zipped(name: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(name, AT2)
    return file.getvalue()


def tarred() -> bytes:
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w") as archive:
        about = tarfile.TarInfo("a.AT2")
        about.size = len(AT2)
        archive.addfile(about, io.BytesIO(AT2))
    return file.getvalue()


#: A header of SAC: 70 reals, 40 whole numbers of which the seventh is its version, 192 characters.
SAC = [
    struct.pack(f"{order}70f40i192s2f", 0.01, *[-12345.0] * 69, *[0] * 6, 6, *[0] * 33, b"", 1, 2)
    for order in "<>"
]
#: Of miniSEED: sequence number and quality, station, location, channel, network, and the start.
MSEED = struct.pack(
    ">8s5s2s3s2sHHBBBxHHhh",
    b"000001D ",
    b"ABC  ",
    b"",
    b"HNE",
    b"XX",
    2020,
    1,
    0,
    0,
    0,
    0,
    2,
    100,
    1,
)

SMC = "2 CORRECTED ACCELEROGRAM\n*\nA020A\n     1989  10  18    0004 Loma Prieta, CA\n"
GEONET = (
    "Uncorrected accelerogram 20161113_110256_WTMC_20 GNS Science\n"
    "Site WTMC      42 37 10S  173 03 13E     Cusp file:  20161113_110259_WTMC\n"
)
COSMOS_V3 = (
    "Response Spectra          (Format v01.20 with 13 text lines) Src: made up\nEvent: none\n"
)
CSMIP = (
    "Corrected accelerogram   89146-L2500-12044.02       Chan  1: 360 Deg     from\nUncorrected\n"
)
CSMIP_V3 = f"Response and Fourier amplitude spectra (78 periods,  .04 -  6.0 sec)   for\n{CSMIP}"
SAC_TEXT = "       0.01000      -12345.00      -12345.00      -12345.00      -12345.00\n" * 14
SLIST = (
    "TIMESERIES XX_A__HNE_R, 4 samples, 100 sps, 2020-01-01T00:00:00, SLIST, FLOAT, M/S**2\n1 2\n"
)
BHRC = "* VOL1DS FILE:  5520/01\nInst Type = SSA-2\nCOMP L1\nUNITS ARE SECONDS AND G/10\n 0 0 0\n"

FILES: dict[str, tuple[bytes | str, str, str]] = {
    "zip": (zipped("a.AT2"), "a zip archive", "unpack it"),
    "xlsx": (zipped("xl/workbook.xml"), "an Excel workbook", "two columns of a CSV file"),
    "gzip": (gzip.compress(AT2), "packed by gzip", "unpack it"),
    "bzip2": (bz2.compress(AT2), "packed by bzip2", "unpack it"),
    "xz": (lzma.compress(AT2), "packed by xz", "unpack it"),
    "tar": (tarred(), "a tar archive", "unpack it"),
    "sac": (SAC[0], "a SAC file", "Record.from_obspy"),
    "sac, big-endian": (SAC[1], "a SAC file", "Record.from_obspy"),
    "sac, text": (SAC_TEXT, "a SAC file", "Record.from_obspy"),
    "mseed": (MSEED, "a miniSEED file", "Record.from_obspy"),
    "slist": (SLIST, "an SLIST or TSPAIR file", "Record.from_obspy"),
    "smc": (SMC, "an SMC file", "two columns of a CSV file"),
    "geonet": (GEONET, "a file of GeoNet", "two columns of a CSV file"),
    "cosmos v3": (COSMOS_V3, "COSMOS V3", "give V1 or V2"),
    "csmip": (CSMIP, "CSMIP's own format", "give COSMOS V1 or V2"),
    "csmip v3": (CSMIP_V3, "V3 of CSMIP", "give V1 or V2"),
    "bhrc": (BHRC, "BHRC's format", "two columns of a CSV file"),
    "page": ("<!DOCTYPE html>\n<html><body>404", "a web page", "load the file itself"),
    "utf-16": ("time,acc\n0,1\n".encode("utf-16"), "text in UTF-16", "save it in UTF-8"),
    "others": (b"\x93NUMPY\x01\x00v\x00{", "a binary file", "Record.from_obspy"),
}


@pytest.mark.parametrize("kind", FILES)
def test_files_are_refused_by_their_name(tmp_path: Path, kind: str) -> None:
    content, name, advice = FILES[kind]
    path = tmp_path / "a.txt"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as refused:
        read_record(path, units="g", interval=0.01)
    text = str(refused.value)
    assert text.startswith(f"{path}: is ")
    assert name in text
    assert advice in text
    assert "\n" not in text


def test_no_table_is_read_of_an_archive(tmp_path: Path) -> None:
    path = tmp_path / "hazard.csv"
    path.write_bytes(gzip.compress(b"PGA (g), annual rate\n0.1,0.1\n0.2,0.01\n"))
    with pytest.raises(InputError, match="is packed by gzip, which is not read"):
        read_hazard_curve(path, 9.81)


def test_a_line_of_names_is_no_binary_file(tmp_path: Path) -> None:
    """Six blanks and a letter begin a record of miniSEED as well."""
    path = tmp_path / "a.txt"
    path.write_text("      T  acc (g)\n0 0.1\n0.01 0.2\n")
    assert read_record(path).times.size == 2
