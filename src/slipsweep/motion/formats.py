"""Files of what was measured: recorded motions in the formats that they come in, and columns that have names.

docs/records.md#files describes the formats.
"""

import hashlib
import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from slipsweep.errors import InputError
from slipsweep.model.parameters import LARGEST, check_choice, shown
from slipsweep.motion.intensity import Floats
from slipsweep.motion.reading import UNITS, Reading

#: Other spellings of units in headers.
_SPELLINGS = {
    "g's": "g",
    "gals": "gal",
    "cm/s/s": "cm/s2",
    "cm/sec2": "cm/s2",
    "m/s/s": "m/s2",
    "m/sec2": "m/s2",
}

_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_COUNT = r"(\d{1,9})\b"
_INTERVAL = rf"(?i)\b(?:dt|interval)\s*[=:]\s*{_NUMBER}"  # in the header of a file without times: ``dt = 0.01``

#: What a file holds: times (s), accelerations in its own unit (NaN where blank), and that unit if
#: it names one.
Samples: TypeAlias = tuple[Floats, Floats, str | None]


def read_lines(path: Path) -> tuple[str, list[str]]:
    """The SHA-256 of a file, and its lines (InputError: it cannot be read)."""
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a name that no system has
        raise InputError(
            f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    # some editors put a byte-order mark in front; headers of old files are in whatever alphabet
    return hashlib.sha256(content).hexdigest(), content.decode(
        "utf-8-sig", errors="replace"
    ).splitlines()


def read_samples(path: Path, lines: list[str], reading: Reading) -> tuple[str, Floats, Floats, str]:
    """The name of a file's format, its times (s), and its accelerations and their unit (InputError: it has none)."""
    kind = _format_of(lines, reading) if reading.format == "auto" else reading.format
    read = {
        "csv": _csv,
        "values": _values,
        "at2": _at2,
        "esm": _esm,
        "knet": _knet,
        "cosmos": _cosmos,
    }[kind]
    try:
        if kind != "cosmos" and reading.channel is not None:
            raise InputError(
                f"channel = {reading.channel}: only COSMOS files hold several; this one is {kind}"
            )
        if kind != "values" and reading.interval is not None:
            raise InputError(
                f"interval = {reading.interval:g}: only for a file without times; this one is {kind}"
            )
        times, values, own = read(lines, reading)
        if own and reading.units and UNITS[own] != UNITS[reading.units]:
            raise InputError(
                f"units = {reading.units!r}: the file itself says {own!r}; correct it, or leave units out"
            )
        if not (unit := own or reading.units):
            raise InputError(
                f"units: must be given, one of {', '.join(UNITS)}: the file does not name the unit"
            )
        return kind, times, values, unit
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _format_of(lines: list[str], reading: Reading) -> str:
    first = lines[0] if lines else ""
    if re.search(_COSMOS_HEAD, first, re.IGNORECASE):
        return "cosmos"
    if any("NPTS" in line.upper() for line in lines[:6]):
        return "at2"
    if any(line.startswith("SAMPLING_INTERVAL_S:") for line in lines[:100]):
        return "esm"
    if first.startswith("Origin Time"):
        return "knet"
    header, body = _header(lines)
    has_times = not body or len(_cells(body[0][1])) > 1
    return (
        "csv"
        if has_times and reading.interval is None and not re.search(_INTERVAL, header)
        else "values"
    )


def _csv(lines: list[str], reading: Reading) -> Samples:
    header, body = _header(lines)
    if not body:
        raise InputError("no line of a time and an acceleration")
    if unit := re.search(
        r"(?i)\bt(?:ime)?\s*[(\[]\s*(ms|msecs?|milliseconds?|min|minutes?)\b", header
    ):
        raise InputError(f"time in {unit[1]}: must be in s")

    def two(line: str) -> list[str]:
        time, value = _cells(line)
        return [time, value or "nan"]

    times, values = _numbers(body, two, "a time and an acceleration").reshape(-1, 2).T
    return times, values, _unit_in(header)


def _values(lines: list[str], reading: Reading) -> Samples:
    header, body = _header(lines)
    own = next(map(float, re.findall(_INTERVAL, header)), None)
    step = reading.interval or own
    if step is None:
        raise InputError(
            "interval: must be given, s: the file has accelerations alone, without times"
        )
    if own and step != own:
        raise InputError(f"interval = {step:g}: the file itself says {own:g}; leave interval out")
    # in a single column of 0,123 commas are decimal, elsewhere as in any line
    decimal = all(re.fullmatch(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", line) for _, line in body)
    values = _numbers(
        body, lambda line: [line.replace(",", ".")] if decimal else filter(None, _cells(line))
    )
    if values.size == 2 * len(body) > 2 and (np.diff(values[::2]) > 0.0).all():
        raise InputError(
            f"interval = {step:g}: the first of two columns is that of times; leave interval out"
        )
    return _even(values, step, _unit_in(header))


def _header(lines: list[str]) -> tuple[str, list[tuple[int, str]]]:
    """The text before the numbers, and the numbered lines from the first that begins with one; no comments."""
    first = next(
        (at for at, line in enumerate(lines) if re.fullmatch(_NUMBER, [*_cells(line), ""][0])),
        len(lines),
    )
    rows = enumerate(lines[first:], first + 1)
    return "\n".join(lines[:first]), [
        row for row in rows if row[1].strip() and not row[1].startswith("#")
    ]


def _cells(line: str) -> list[str]:
    """The cells of a line, between semicolons, tabs, commas or blanks; decimal commas become points."""
    for separator in ";\t":
        if separator in line:
            return [cell.strip().replace(",", ".") for cell in line.split(separator)]
    words = line.split()
    if "," in line and (
        len(words) == 1 or any(word[0] == "," or word[-1] == "," for word in words)
    ):
        return [cell.strip() for cell in line.split(",")]
    return [word.replace(",", ".") for word in words]


def _unit_in(header: str) -> str | None:
    """The unit of acceleration that a header gives in brackets, the last if there are several."""
    texts = re.findall(r"[(\[]\s*([^)\]]+?)\s*[)\]]", header.lower())
    units = [
        re.sub(r"\s+|\^|\*\*", "", text).replace("²", "2").replace("s-2", "/s2") for text in texts
    ]
    return next(
        (unit for one in reversed(units) if (unit := _SPELLINGS.get(one, one)) in UNITS), None
    )


def _at2(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines[:6]) if "NPTS" in line.upper()), 0)
    if re.search("VELOCITY|DISPLACEMENT", "\n".join(lines[:at]), re.IGNORECASE):
        raise InputError(
            "its header speaks of velocity or displacement: must be an acceleration (.AT2)"
        )
    # in files of the first database "4096  0.0100  NPTS, DT"
    line = re.sub(
        rf"(?i)^\s*{_COUNT}\s+{_NUMBER}\s+NPTS,\s*DT",
        r"NPTS=\1, DT=\2",
        "".join(lines[at : at + 1]),
    )
    points, interval = _fields(
        line, {"NPTS=": rf"NPTS\s*=\s*{_COUNT}", "DT=": rf"DT\s*=\s*{_NUMBER}"}
    )
    return _even(_numbers(enumerate(lines[at + 1 :], at + 2)), float(interval), "g", int(points))


def _esm(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines) if ":" not in line), len(lines))
    known = {"SAMPLING_INTERVAL_S": _NUMBER, "NDATA": _COUNT, "UNITS": r"(\S+)"}
    interval, points, unit = _fields(
        "\n".join(lines[:at]), {name: rf"^{name}:\s*{known[name]}\s*$" for name in known}
    )
    unit = check_choice("UNITS", unit.lower().replace("^", ""), UNITS)
    return _even(_numbers(enumerate(lines[at:], at + 1)), float(interval), unit, int(points))


def _knet(lines: list[str], reading: Reading) -> Samples:
    at = next((at for at, line in enumerate(lines[:40]) if line.startswith("Memo")), 0)
    known = {
        "Sampling Freq(Hz)": _NUMBER,
        "Duration Time(s)": _NUMBER,
        "Scale Factor": rf"{_NUMBER}\(gal\)/{_NUMBER}",
    }
    patterns = {name: rf"^{re.escape(name)}\s*{pattern}" for name, pattern in known.items()}
    frequency, duration, gals, counts = map(float, _fields("\n".join(lines[:at]), patterns))
    if not (0.0 < frequency < 1e6 and 0.0 < counts <= LARGEST and 0.0 < gals <= LARGEST):
        raise InputError(f"{frequency:g} Hz, {gals:g} gal, {counts:g} counts: must be > 0")
    values = _numbers(enumerate(lines[at + 1 :], at + 2)) * (gals / counts)
    return _even(values, 1.0 / frequency, "gal", round(min(duration * frequency, 1e9)))


#: Codes of units that are accelerations (Table 2 of the format).
_COSMOS_UNITS = {2: "g", 4: "cm/s2", 10: "gal"}

_COSMOS_HEAD = r"\(Format v\s*[\d.]+ with\s+(\d{1,4})\s+text lines\)"
# of each section's first line: how many numbers follow, how many to a line, and columns of each of
# them
_COSMOS_FORMAT = r".*Format\s*=?\s*\((\d{0,3})[IFEG](\d{1,3})"
_COSMOS_HEADER = rf"^\s*{_COUNT}\s+%s-header values follow on\s+\d+\s+lines\s*,{_COSMOS_FORMAT}"
_COSMOS_DATA = rf"^\s*{_COUNT}\s+\w+.*?\bpts?\b{_COSMOS_FORMAT}"


def _cosmos(lines: list[str], reading: Reading) -> Samples:
    starts = [at for at, line in enumerate(lines) if re.search(_COSMOS_HEAD, line, re.IGNORECASE)]
    read = (
        _cosmos_channel(lines[:end], at) for at, end in itertools.pairwise([*starts, len(lines)])
    )
    channels = [one for one in read if one is not None]
    number = reading.channel or 1
    if number > len(channels) or (reading.channel is None and len(channels) > 1):
        raise InputError(
            f"channel = {reading.channel}: must be one of its {len(channels)} channels of acceleration"
        )
    return channels[number - 1]


def _cosmos_channel(lines: list[str], at: int) -> Samples | None:
    """The channel that begins at a line and goes to the last one; None if it is no acceleration.

    Lines of text, 100 integers, 100 reals, comments, then values in a Fortran format, without
    blanks between them. Integers 2 and 3 are the physical parameter (1: acceleration) and the code
    of the unit, real 62 the sampling interval in milliseconds (Strong Motion Data Format 1.20,
    2001).
    """

    def head(what: str, pattern: str) -> list[str]:
        return _fields("".join(lines[at : at + 1]), {what: pattern}, f"line {at + 1}")

    def section(what: str, pattern: str) -> tuple[int, Floats]:
        """The line after the values of a section, and these."""
        count, each, width = (int(number or 1) for number in head(what, pattern))
        end = at + 1 + -(-count // (each or 1))
        column = f".{{1,{width or 1}}}"
        rows = enumerate(lines[at + 1 : end], at + 2)
        numbers = f"numbers, {width or 1} columns each"
        values = _numbers(rows, lambda line: re.findall(column, line.rstrip()), numbers)
        if values.size != count:
            raise InputError(f"line {end}: {values.size} values, where {count} are announced")
        return end, values

    at += int(*head("number of text lines", _COSMOS_HEAD))
    at, whole = section("integer header", _COSMOS_HEADER % "Integer")
    at, reals = section("real header", _COSMOS_HEADER % "Real")
    if whole.size < 3 or reals.size < 62:
        raise InputError(f"line {at}: {whole.size} integers and {reals.size} reals: not enough")
    at += 1 + int(*head("number of comment lines", rf"^\s*{_COUNT}\s+Comment line"))
    at, values = section("number and format of values", _COSMOS_DATA)
    # what a V2 file may have behind the acceleration is its velocity and displacement
    if not any(line.lstrip().lower().startswith("end-of-data") for line in lines[at:]):
        raise InputError("no line End-of-data after the values: cut off, or damaged")
    if whole[1] != 1:
        return None
    if whole[2] not in _COSMOS_UNITS:
        raise InputError(
            f"code {whole[2]:.0f} for the unit of its values: must be one of {[*_COSMOS_UNITS]}"
        )
    return _even(values, reals[61] / 1000.0, _COSMOS_UNITS[int(whole[2])])


def _fields(header: str, patterns: Mapping[str, str], where: str = "its header") -> list[str]:
    """What patterns, by the names that errors have, find in a header (InputError: nothing)."""
    fields: list[str] = []
    for name, pattern in patterns.items():
        found = re.search(pattern, header, re.MULTILINE | re.IGNORECASE | re.ASCII)
        if found is None:
            raise InputError(
                f"no {name} in {where}, or none that can be read: another format, or damaged"
            )
        fields += found.groups()
    return fields


def _numbers(
    rows: Iterable[tuple[int, str]],
    cells: Callable[[str], Iterable[str]] = str.split,
    what: str = "numbers",
    where: str = "",
) -> Floats:
    """All numbers in the cells of numbered lines, in their order."""
    values: list[float] = []
    for number, line in rows:
        try:
            values.extend(map(float, cells(line)))
        except ValueError:
            raise InputError(f"{where}line {number}: {shown(line)}: must be {what}") from None
    return np.array(values)


def _even(values: Floats, interval: float, unit: str | None, points: int | None = None) -> Samples:
    """Evenly sampled values, whose header may say how many they are."""
    if points is not None and values.size != points:
        raise InputError(
            f"{values.size} accelerations, where its header says {points}: cut off, or damaged"
        )
    if not 0.0 < interval <= LARGEST:
        raise InputError(f"sampling interval {interval:g}: must be a finite number > 0")
    return np.arange(values.size, dtype=np.float64) * interval, values, unit


def read_columns(
    path: Path,
    lines: list[str],
    holds: Callable[[str, set[str], str], tuple[str, float] | None],
    names: dict[str, str],
) -> dict[str, Floats]:
    """Columns of numbers, by what they hold and in its unit; a blank cell is NaN (InputError: the line, and why).

    The first line that is not blank and does not begin with ``#`` names the columns.  Separators
    are tabs, semicolons or commas: the first of these that is in it.  Commas that do not separate
    are decimal. ``holds(name, words, unit)`` gives what a column holds, from the words of its name
    and the unit in brackets behind them, and the factor to its unit; None leaves it out.  What has
    one of `names` must be there, under such a name.
    """
    rows = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.startswith("#")
    ]
    number, header = rows[0] if rows else (1, "")
    separator = next((one for one in "\t;," if one in header), ",")
    cells = [cell.strip(' "') for cell in header.split(separator)]
    columns: list[tuple[str, int, float]] = []
    for at, name in enumerate(cells):
        text, _, unit = name.replace("[", "(").partition("(")
        if held := holds(name, {*re.split(r"[\s_\-]+", text.strip().lower())}, unit.strip(" )]")):
            columns.append((held[0], at, held[1]))
    found = [what for what, *_ in columns]
    for what in (*names, *found):
        if (count := found.count(what)) != 1:
            example = ", ".join(names.values())
            raise InputError(
                f"{path}: line {number}: {count} columns of {what}: must be one, as in {example}"
            )

    def chosen(line: str) -> list[str]:
        texts = [text.replace(",", ".").strip() or "nan" for text in line.split(separator)]
        if len(texts) != len(cells):
            raise ValueError
        return [texts[at] for _, at, _ in columns]

    rule = f"{len(cells)} cells, and a number, or nothing, for {', '.join(found)}"
    table = _numbers(rows[1:], chosen, rule, f"{path}: ").reshape(-1, len(columns))
    return {
        what: factor * values for (what, _, factor), values in zip(columns, table.T, strict=True)
    }
