"""Files that are not read, recognised by their beginnings: archives, binary records, texts."""

import re
from collections.abc import Sequence

_OBSPY = "read it with ObsPy, and give its traces, as accelerations, to Record.from_obspy"
_CONVERT = "write its times and accelerations as two columns of a CSV file"
_UNPACK = "unpack it, and give the files that are in it"

#: First bytes of files that are no text, with the name of the format and the advice.
_BINARY: tuple[tuple[bytes, str, str], ...] = (
    (
        rb"PK(?:\x03\x04|\x05\x06)(?s:.{0,4000})(?:xl/|\[Content_Types\])",
        "an Excel workbook",
        _CONVERT,
    ),
    (rb"PK(?:\x03\x04|\x05\x06)", "a zip archive", _UNPACK),
    (rb"\x1f\x8b", "packed by gzip", _UNPACK),
    (rb"BZh[1-9]1AY&SY", "packed by bzip2", _UNPACK),
    (rb"\xfd7zXZ\x00", "packed by xz", _UNPACK),
    (rb"\x28\xb5\x2f\xfd", "packed by zstd", _UNPACK),
    (rb"\x1f[\x9d\xa0]", "packed by compress", _UNPACK),
    (rb"7z\xbc\xaf\x27\x1c", "a 7z archive", _UNPACK),
    (rb"Rar!\x1a\x07", "a rar archive", _UNPACK),
    (rb"(?s:.{257})ustar", "a tar archive", _UNPACK),
    (rb"\xd0\xcf\x11\xe0", "an Excel workbook", _CONVERT),
    (rb"%PDF", "a PDF", _CONVERT),
    (rb"\xff\xfe|\xfe\xff", "text in UTF-16", "save it in UTF-8"),
    (
        rb"[0-9 ]{6}[DRQM][ \x00](?s:.{0,100})\x00|\d{6}(?:[DRQM] |[VAST][ *]\d{3})|MS\x03",
        "a miniSEED file",
        _OBSPY,
    ),
    # the version of the header, 6 or 7, is its 77th word
    (rb"(?s:.{304})(?:[\x06\x07]\x00\x00\x00|\x00\x00\x00[\x06\x07])", "a SAC file", _OBSPY),
)

#: The same for texts: patterns for the first lines.
_TEXTS: tuple[tuple[str, str, str], ...] = (
    (r"\s*(?:<!doctype html|<html)", "a web page, not the record itself", "load the file itself"),
    (r"\s*<\?xml", "an XML file", _CONVERT),
    (
        r"(?:\s*-12345(?:\.0+)?\b|\s*[-+\d.eE]+){5}\s*\n(?:.*-12345.*\n){3}",
        "a SAC file in text",
        _OBSPY,
    ),
    (r"TIMESERIES .*\b(?:SLIST|TSPAIR)", "an SLIST or TSPAIR file", _OBSPY),
    (r"(?:BEGIN GSE2|WID[12] )", "a GSE file", _OBSPY),
    (
        r"\s*\d\s+(?:(?:UN)?CORRECTED ACCELEROGRAM|(?:VELOCITY|DISPLACEMENT|.*SPECTR).*\n\s*\*)",
        "an SMC file of USGS",
        _CONVERT,
    ),
    (r"(?:un)?corrected accelerogram.*\bGNS\b", "a file of GeoNet (V1A, V2A)", _CONVERT),
    (r".*\bspectr.*\(Format v", "COSMOS V3 (response spectra)", "give V1 or V2, accelerations"),
    (
        r"(?:.*\n){0,12}?.*UNITS (?:OF UNCOR ACCEL )?ARE SEC(?:ONDS)? AND G/10",
        "a file in CSMIP's or BHRC's format (V1)",
        _CONVERT,
    ),
    (r"response\b.*\bspectr", "V3 of CSMIP (response spectra)", "give V1 or V2, accelerations"),
    (
        r"(?:un)?corrected accelerogram",
        "a file in CSMIP's own format (V1, V2)",
        f"give COSMOS V1 or V2, or {_CONVERT}",
    ),
)

#: Numbers of bytes and of lines that are examined.
_BYTES = 4096
_LINES = 15


def binary_refusal(content: bytes) -> str | None:
    """Return the format of a file that is no text, with the advice; None for text."""
    begin = content[:_BYTES]
    for pattern, name, advice in _BINARY:
        if re.match(pattern, begin):
            return f"is {name}, which is not read: {advice}"
    if b"\0" in begin:
        return f"is a binary file, which is not read; if it is a record, {_OBSPY}"
    return None


def text_refusal(lines: Sequence[str]) -> str | None:
    """Return a format of records that is not read, with the advice; None for others."""
    begin = "\n".join(lines[:_LINES])
    for pattern, name, advice in _TEXTS:
        if re.match(pattern, begin, re.IGNORECASE):
            return f"is {name}, which is not read: {advice}"
    return None
