"""Formats of recorded motions that headers describe; plain text is read by `columns`.

docs/records.md#files describes them.
"""

import itertools
import re
from collections.abc import Callable
from pathlib import Path

from slipsweep.errors import InputError
from slipsweep.model.parameter_table import LARGEST
from slipsweep.model.parameters import check_choice
from slipsweep.motion.columns import chosen_channel, read_plain
from slipsweep.motion.foreign import text_refusal
from slipsweep.motion.headings import unit_said
from slipsweep.motion.intensity import Floats
from slipsweep.motion.lines import (
    COUNT,
    NUMBER,
    Samples,
    check_count,
    even_times,
    fields_in,
    numbers_in,
)
from slipsweep.motion.reading import UNITS, Reading

_ASA_HEAD = r"ARCHIVO EST[AÁ]NDAR DE ACELERACI[OÓ]N|^INTERVALO DE MUESTREO,? C1"


def read_samples(path: Path, lines: list[str], reading: Reading) -> tuple[str, Samples, str]:
    """Return the format of a file, its samples and their unit (InputError: it is no record)."""
    try:
        if refusal := text_refusal(lines):
            raise InputError(refusal)
        kind = _format_of(lines) if reading.format == "auto" else reading.format
        if kind in _READERS:
            if reading.interval is not None:
                raise InputError(
                    f"interval = {reading.interval:g}: only for a file without times; "
                    f"this one is {kind}"
                )
            if reading.channel is not None and kind not in _SEVERAL:
                raise InputError(
                    f"channel = {reading.channel}: only for a file that holds several; "
                    f"this one is {kind}"
                )
            samples = _READERS[kind](lines, reading)
        else:
            kind, samples = read_plain(lines, reading)
        return kind, samples, _unit_of(samples, reading)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _unit_of(samples: Samples, reading: Reading) -> str:
    """Return the unit of samples: that of the file, or the one that the user gives."""
    unit = samples.unit or reading.units
    if unit is None:
        raise InputError(
            f"units: must be given, one of {', '.join(UNITS)}: the file does not name the unit"
        )
    if reading.units and UNITS[unit] != UNITS[reading.units]:
        raise InputError(
            f"units = {reading.units!r}: the file itself says {unit!r}; "
            "correct it, or leave units out"
        )
    return unit


def _format_of(lines: list[str]) -> str:
    first = lines[0] if lines else ""
    if re.search(_COSMOS_HEAD, first, re.IGNORECASE):
        return "cosmos"
    if any(re.search(_ASA_HEAD, line, re.IGNORECASE) for line in lines[:100]):
        return "asa"
    if any("NPTS" in line.upper() for line in lines[:6]):
        return "at2"
    if any(line.startswith("SAMPLING_INTERVAL_S:") for line in lines[:100]):
        return "esm"
    if first.startswith("Origin Time"):
        return "knet"
    return "plain"


def _at2(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines[:6]) if "NPTS" in line.upper()), 0)
    header = "\n".join(lines[:at])
    unit = unit_said(header)
    # in files of the first database "4096  0.0100  NPTS, DT"
    line = re.sub(
        rf"(?i)^\s*{COUNT}\s+{NUMBER}\s+NPTS,\s*DT",
        r"NPTS=\1, DT=\2",
        "".join(lines[at : at + 1]),
    )
    points, interval = fields_in(
        line, {"NPTS=": rf"NPTS\s*=\s*{COUNT}", "DT=": rf"DT\s*=\s*{NUMBER}"}
    )
    values = numbers_in(enumerate(lines[at + 1 :], at + 2))
    check_count(values, int(points))
    # the second line ends with the component
    component = lines[1].rpartition(",")[2].strip() if at > 1 else ""
    times = even_times(values.size, float(interval))
    return Samples(times, values, unit or reading.units or "g", component)


def _esm(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines) if ":" not in line), len(lines))
    header = "\n".join(lines[:at])
    fields = {"SAMPLING_INTERVAL_S": NUMBER, "NDATA": COUNT, "UNITS": r"(\S+)"}
    interval, points, unit = fields_in(
        header, {name: rf"^{name}:\s*{fields[name]}\s*$" for name in fields}
    )
    data_type = _field(header, "DATA_TYPE:") or "ACCELERATION"
    if data_type != "ACCELERATION":
        raise InputError(f"DATA_TYPE: {data_type}: must be ACCELERATION")
    unit = check_choice("UNITS", unit.lower().replace("^", ""), UNITS)
    values = numbers_in(enumerate(lines[at:], at + 1))
    check_count(values, int(points))
    times = even_times(values.size, float(interval))
    return Samples(times, values, unit, _field(header, "STREAM:"))


def _knet(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines[:40]) if line.startswith("Memo")), 0)
    header = "\n".join(lines[:at])
    fields = {
        "Sampling Freq(Hz)": NUMBER,
        "Duration Time(s)": NUMBER,
        "Scale Factor": rf"{NUMBER}\(gal\)/{NUMBER}",
    }
    patterns = {name: rf"^{re.escape(name)}\s*{pattern}" for name, pattern in fields.items()}
    frequency, duration, gals, counts = map(float, fields_in(header, patterns))
    if not (0.0 < frequency < 1e6 and 0.0 < counts <= LARGEST and 0.0 < gals <= LARGEST):
        raise InputError(f"{frequency:g} Hz, {gals:g} gal, {counts:g} counts: must be > 0")
    values = numbers_in(enumerate(lines[at + 1 :], at + 2)) * (gals / counts)
    check_count(values, round(min(duration * frequency, 1e9)))
    times = even_times(values.size, 1.0 / frequency)
    return Samples(times, values, "gal", _field(header, "Dir."))


def _field(header: str, name: str) -> str:
    """Return a field of a header, empty if it is not there."""
    match = re.search(rf"(?m)^{re.escape(name)}[ \t]*(\S*)", header)
    return match[1] if match else ""


def _asa(lines: list[str], reading: Reading) -> Samples:
    """Return the chosen channel of a file of Mexican networks.

    Archivo Estándar de Aceleración 2.0: a header of names and values, those of each channel between
    slashes, then the channels side by side in columns of a Fortran format, which may touch.
    """
    at = _asa_data(lines)
    header = "\n".join(lines[:at])
    intervals = _asa_field(header, "INTERVALO DE MUESTREO", NUMBER)
    if not intervals:
        raise InputError(
            "no INTERVALO DE MUESTREO in its header, or none that can be read: damaged"
        )
    names = _asa_field(header, "ORIENTACION", r"\S.*") or [""] * len(intervals)
    if len(intervals) not in (1, len(names)):
        raise InputError(
            f"INTERVALO DE MUESTREO: {len(intervals)} values, where ORIENTACION has {len(names)}"
        )
    channel = chosen_channel(reading.channel, names)
    interval = float(intervals[min(channel, len(intervals) - 1)])
    width = re.search(r"(?im)^FORMATO DATOS[^:\n]*:.*?[FEG](\d+)", header)
    column = f".{{1,{width[1]}}}" if width else r"\S+"

    def cells(line: str) -> list[str]:
        words = line.split()
        words = words if len(words) == len(names) else re.findall(column, line.rstrip())
        if len(words) != len(names):
            raise ValueError
        return words

    rows = ((number, line) for number, line in enumerate(lines[at:], at + 1) if line.strip())
    values = numbers_in(rows, cells, f"{len(names)} accelerations").reshape(-1, len(names))
    # in some files one of the two is wrong
    durations = _asa_field(header, "DURACION DEL REGISTRO", NUMBER)
    points = _asa_field(header, "NUM. TOTAL DE MUESTRAS", COUNT)
    is_as_long = len(durations) > channel and (
        abs(float(durations[channel]) - len(values) * interval) <= 2.0 * interval
    )
    if not is_as_long and len(points) > channel:
        check_count(values[:, channel], int(points[channel]))
    times = even_times(len(values), interval)
    return Samples(times, values[:, channel], unit_said(header), names[channel])


def _asa_data(lines: list[str]) -> int:
    """Return the first line of data: after two lines of ---------+, or the first of numbers."""
    rules = [at for at, line in enumerate(lines) if line.startswith("---------")]
    if len(rules) > 1:
        return rules[1] + 1
    first = (at for at, line in enumerate(lines) if re.fullmatch(rf"\s*{NUMBER}(\s+\S+)*\s*", line))
    return next(first, len(lines))


def _asa_field(header: str, name: str, pattern: str) -> list[str]:
    """Return the values of a field for each channel, from the lines of C1-C6 and C7-C12."""
    texts = re.findall(rf"(?im)^{re.escape(name)}[^:\n]*:(.*)$", header)
    parts = [
        part.strip() for text in texts if text.strip() for part in text.strip(" \t/").split("/")
    ]
    return parts if all(re.fullmatch(pattern, part) for part in parts) else []


#: Codes of units that are accelerations (Table 2 of the format).
_COSMOS_UNITS = {2: "g", 4: "cm/s2", 10: "gal"}

#: Codes of directions that are vertical.
_COSMOS_VERTICAL = {400: "Up", 401: "Down", 402: "Vertical"}

_COSMOS_HEAD = r"\(Format v\s*[\d.]+ with\s+(\d{1,4})\s+text lines\)"
# of each section's first line: how many numbers follow, how many to a line, and columns of each of
# them
_COSMOS_FORMAT = r".*Format\s*=?\s*\((\d{0,3})[IFEG](\d{1,3})"
_COSMOS_HEADER = rf"^\s*{COUNT}\s+%s-header values follow on\s+\d+\s+lines\s*,{_COSMOS_FORMAT}"
_COSMOS_DATA = rf"^\s*{COUNT}\s+\w+.*?\bpts?\b{_COSMOS_FORMAT}"


def _cosmos(lines: list[str], reading: Reading) -> Samples:
    starts = [at for at, line in enumerate(lines) if re.search(_COSMOS_HEAD, line, re.IGNORECASE)]
    read = (
        _cosmos_channel(lines[:end], at) for at, end in itertools.pairwise([*starts, len(lines)])
    )
    channels = [channel for channel in read if channel is not None]
    number = reading.channel or 1
    if number > len(channels) or (reading.channel is None and len(channels) > 1):
        raise InputError(
            f"channel = {reading.channel}: must be one of its {len(channels)} channels of "
            "acceleration"
        )
    return channels[number - 1]


def _cosmos_channel(lines: list[str], at: int) -> Samples | None:
    """Return the channel in the lines from one on; None if it is no acceleration.

    Lines of text, 100 integers, 100 reals, comments, then values in a Fortran format, without
    blanks between them. Integers 1 to 3 are the stage (1: uncorrected), the physical parameter (1:
    acceleration) and the code of the unit, 54 the direction; reals 35 and 63 the length as recorded
    and of the values, s, 62 the sampling interval, ms (Strong Motion Data Format 1.20, 2001).
    """

    def head(what: str, pattern: str) -> list[str]:
        return fields_in("".join(lines[at : at + 1]), {what: pattern}, f"line {at + 1}")

    def section(what: str, pattern: str) -> tuple[int, Floats]:
        """Return the line after the values of a section, and the values."""
        count, each, width = (int(number or 1) for number in head(what, pattern))
        end = at + 1 + -(-count // (each or 1))
        column = f".{{1,{width or 1}}}"
        rows = enumerate(lines[at + 1 : end], at + 2)
        numbers = f"numbers, {width or 1} columns each"
        values = numbers_in(rows, lambda line: re.findall(column, line.rstrip()), numbers)
        if values.size != count:
            raise InputError(f"line {end}: {values.size} values, where {count} are announced")
        return end, values

    begin = at
    at += int(*head("number of text lines", _COSMOS_HEAD))
    at, whole = section("integer header", _COSMOS_HEADER % "Integer")
    at, reals = section("real header", _COSMOS_HEADER % "Real")
    if whole.size < 3 or reals.size < 62:
        raise InputError(f"line {at}: {whole.size} integers and {reals.size} reals: not enough")
    at += 1 + int(*head("number of comment lines", rf"^\s*{COUNT}\s+Comment line"))
    data = at
    at, values = section("number and format of values", _COSMOS_DATA)
    # a V2 file may have velocity and displacement after the acceleration
    if not any(line.lstrip().lower().startswith("end-of-data") for line in lines[at:]):
        raise InputError("no line End-of-data after the values: cut off, or damaged")
    if whole[0] == 3:
        raise InputError("is COSMOS V3 (response spectra), which is not read: give V1 or V2")
    if whole[1] != 1:
        return None
    unit = _cosmos_unit(int(whole[2]), lines[data])
    times = even_times(values.size, reals[61] / 1000.0)
    _check_cosmos_length(times, whole, reals, lines[data])
    code = int(whole[53]) if whole.size > 53 else 0
    text = re.search(r"(?im)^Sta +Cha\w* *\S*: *([^(\n]*)", "\n".join(lines[begin:data]))
    component = _COSMOS_VERTICAL.get(code, text[1].strip() if text else "")
    return Samples(times, values, unit, component)


def _cosmos_unit(code: int, line: str) -> str:
    """Return the unit of a code in the integer header, checked by the line before the values."""
    if code not in _COSMOS_UNITS:
        counts = ", counts of a digitizer (V0)" if code == 50 else ""
        raise InputError(
            f"code {code} for the unit of its values{counts}: must be one of {[*_COSMOS_UNITS]}"
        )
    unit = _COSMOS_UNITS[code]
    if said := re.search(r"(?i)units?\s*=\s*([^(,]*?)\s*(?:\(\s*(\d+)\s*\)|,)", line):
        text = unit_said("", f"({said[1]})")
        if int(said[2] or code) != code or (text and UNITS[text] != UNITS[unit]):
            raise InputError(
                f"its integer header says {code} ({unit}) for the unit, the line of its values "
                f"{said[0].strip(',')}: damaged"
            )
    return unit


def _check_cosmos_length(times: Floats, whole: Floats, reals: Floats, line: str) -> None:
    """Raise InputError if the length of the record in the header is not that of its samples."""
    interval = times[1] - times[0] if times.size > 1 else 0.0
    length = times.size * interval
    said = {"real 63": reals[62] if reals.size > 62 else 0.0}
    if whole[0] == 1:  # uncorrected: as long as it was recorded
        said["real 35"] = reals[34]
    if approximate := re.search(rf"(?i)approx\.?\s*{NUMBER}\s*s", line):
        said["the line of its values"] = float(approximate[1])
    for where, seconds in said.items():
        rounded = 1.0 if where.startswith("the") else 2.0 * interval
        if seconds > 0.0 and abs(seconds - length) > max(rounded, 0.005 * length):
            raise InputError(
                f"{where} says {seconds:g} s, and {times.size} samples every {interval:g} s are "
                f"{length:g} s: its header is damaged"
            )


_READERS: dict[str, Callable[[list[str], Reading], Samples]] = {
    "at2": _at2,
    "esm": _esm,
    "knet": _knet,
    "asa": _asa,
    "cosmos": _cosmos,
}

#: Formats whose files hold several channels.
_SEVERAL = ("asa", "cosmos")
