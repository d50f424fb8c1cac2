"""Records in plain text: with times, components side by side, or one component alone."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown
from slipsweep.motion.headings import is_sentence, is_unit, unit_said
from slipsweep.motion.intensity import Floats
from slipsweep.motion.lines import NUMBER, Samples, even_times
from slipsweep.motion.reading import Reading

#: In a header: the sampling interval, or its inverse, and a number, maybe with a decimal comma.
_STEP = r"(\d*[.,]?\d+(?:[eE][-+]?\d+)?)"
_INTERVAL = (
    r"(?i)\b(?:dt|delta[ _-]?t|(?:sampling[ _-]?|time[ _-]?)?interval|time[ _-]?step"
    rf"|sampling[ _-]?period|intervalo de muestreo)\b[^=:\n\d]*[=:]\s*{_STEP}"
)
_RATE = (
    r"(?i)\b(?:sampl\w*[ _-]?(?:rate|freq\w*)|(?:vel\w*|frec\w*)\.? de muestreo)\b"
    rf"[^=:\n\d]*[=:]?\s*{_STEP}"
)

#: Names of a first column: of times, and of other numbers that increase from line to line.
_TIME = r"(?:t|time|zeit|tiempo|temps|tempo|zaman)\b"
_NO_TIME = r"(?:period\w*|freq\w*|f|n|no|nr|num\w*|sample\w*|index|point\w*|step|count|i)\b"

_NO_SECONDS = r"(ms|msecs?|milliseconds?|min|minutes?)\b"

#: Least share of positive differences in a column of times, and largest share of negative ones:
#: some lines may be damaged.
_RISES = 0.5
_FALLS = 0.1


@dataclass(frozen=True)
class _Text:
    """A plain text, split into its parts."""

    header: str  # the lines before the numbers, but for the names
    names: list[str]  # of the columns; empty texts if there are none
    rows: list[tuple[int, str]]  # numbered lines of numbers
    cells: list[list[str]]  # of each

    @property
    def width(self) -> int:
        """The number of columns."""
        return len(self.names)

    @property
    def listed(self) -> str:
        """The columns, in words for messages."""
        names = f" ({', '.join(self.names)})" if any(self.names) else ""
        return f"{self.width} numbers on a line{names}"

    def rises(self) -> bool:
        """Return True if the first column increases from line to line, as times do."""
        steps = np.diff([float(row[0]) for row in self.cells if re.fullmatch(NUMBER, row[0])])
        return bool(
            steps.size and (steps > 0.0).mean() >= _RISES and (steps < 0.0).mean() <= _FALLS
        )

    def table(self, rule: str) -> Floats:
        """Return the numbers by line and column, NaN where blank (InputError: a line differs)."""
        values = []
        for (number, line), cells in zip(self.rows, self.cells, strict=True):
            try:
                values.append([float(cell or "nan") for cell in cells])
            except ValueError:
                values.append([])
            if len(values[-1]) != self.width:
                raise InputError(f"line {number}: {shown(line)}: must be {rule}")
        return np.array(values)

    def series(self) -> Floats:
        """Return the numbers one after the other."""
        values: list[float] = []
        for (number, line), cells in zip(self.rows, self.cells, strict=True):
            try:
                values.extend(float(cell) for cell in cells if cell)
            except ValueError:
                raise InputError(f"line {number}: {shown(line)}: must be numbers") from None
        return np.array(values)


def read_plain(lines: list[str], reading: Reading) -> tuple[str, Samples]:
    """Return the format of a plain text (csv, columns or values), and its samples.

    InputError: it is no record, or it holds several and no channel is chosen.
    """
    header, rows = _header_and_rows(lines)
    if not rows:
        raise InputError("no line of a time and an acceleration")
    interval = _interval_in(header)
    text = _taken_apart(header, rows, bool(reading.interval or interval))
    kind = _kind(text, reading) if reading.format == "auto" else reading.format
    if kind == "csv":
        return kind, _with_times(text, reading)
    step = reading.interval or interval
    is_table = all(len(row) == text.width for row in text.cells)
    if text.width > 1 and is_table and (kind == "columns" or text.width == 2) and text.rises():
        raise InputError(
            f"interval = {step or 0.0:g}: the first column is that of times; leave interval out"
        )
    if step is None:
        raise InputError(
            "interval: must be given, s: the file has accelerations alone, without times"
        )
    if interval and step != interval:
        raise InputError(
            f"interval = {step:g}: the file itself says {interval:g}; leave interval out"
        )
    name = text.names[0]
    if kind == "columns":
        channel = chosen_channel(reading.channel, text.names)
        name = text.names[channel]
        values = text.table(f"{text.width} numbers")[:, channel]
    else:
        _refuse_channel(reading)
        values = text.series()
    return kind, Samples(even_times(values.size, step), values, unit_said(text.header, name), name)


def chosen_channel(channel: int | None, names: Sequence[str]) -> int:
    """Return the index of a channel among those of a file (InputError: none is chosen)."""
    if channel is None and len(names) == 1:
        return 0
    if channel is None or not 1 <= channel <= len(names):
        allowed = ", ".join(f"{at} {name}".strip() for at, name in enumerate(names, 1))
        raise InputError(
            f"channel = {channel}: must be one of {allowed}: "
            f"the file holds {len(names)} components side by side"
        )
    return channel - 1


def _kind(text: _Text, reading: Reading) -> str:
    """Return the format of a text, by its columns (InputError: they may be several components)."""
    if text.width == 1 or len(text.rows) == 1:
        return "values"
    rises = text.rises()
    if rises and re.match(_NO_TIME, text.names[0], re.IGNORECASE):
        raise InputError(f"its first column is {text.names[0]!r}: must be time")
    if rises or re.match(_TIME, text.names[0], re.IGNORECASE):
        return "csv"
    if reading.channel is None:
        odd = next((at for at, row in enumerate(text.cells[:-1]) if len(row) != text.width), None)
        if odd is not None:
            raise InputError(
                f"line {text.rows[odd][0]}: {len(text.cells[odd])} numbers, where others have "
                f"{text.width}: format = 'values' takes all numbers one after the other"
            )
        raise InputError(
            f"{text.listed}: channel = 1 to {text.width} takes one of components side by side, "
            "format = 'values' a single one whose lines follow one another"
        )
    return "columns"


def _with_times(text: _Text, reading: Reading) -> Samples:
    """Return the column of times, and the chosen column of accelerations."""
    if reading.interval is not None:
        raise InputError(
            f"interval = {reading.interval:g}: the first column is that of times; "
            "leave interval out"
        )
    if unit := (
        re.search(rf"(?i)(?<![a-z]){_NO_SECONDS}", text.names[0])
        or re.search(rf"(?i)\b{_TIME}\s*[(\[]\s*{_NO_SECONDS}", text.header)
    ):
        raise InputError(f"time in {unit[1]}: must be in s")
    several = text.width > 2
    rule = f"a time and {text.width - 1} accelerations" if several else "a time and an acceleration"
    if text.width == 1:
        raise InputError(f"line {text.rows[0][0]}: {shown(text.rows[0][1])}: must be {rule}")
    if several:
        column = 1 + chosen_channel(reading.channel, text.names[1:])
    else:
        _refuse_channel(reading)
        column = 1
    table = text.table(rule)
    name = text.names[column]
    return Samples(table[:, 0], table[:, column], unit_said(text.header, name), name)


def _refuse_channel(reading: Reading) -> None:
    if reading.channel is not None:
        raise InputError(f"channel = {reading.channel}: only for a file that holds several")


def _taken_apart(header: str, rows: list[tuple[int, str]], has_interval: bool) -> _Text:
    """Split lines into cells, and find the names of the columns."""
    # in a single column of 0,123 commas are decimal, elsewhere as in any line
    if has_interval and all(
        re.fullmatch(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", line) for _, line in rows
    ):
        cells = [[line.replace(",", ".")] for _, line in rows]
    else:
        cells = [_cells(line) for _, line in rows]
    width = len(cells[0])
    while width > 1 and not any(row[width - 1] for row in cells if len(row) >= width):
        width -= 1  # columns that are blank throughout
    cells = [row[:width] if not any(row[width:]) else row for row in cells]
    header, names = _without_names(header, width)
    return _Text(header, names, rows, cells)


def _without_names(header: str, width: int) -> tuple[str, list[str]]:
    """Split the line that names so many columns off a header; empty names if there is none."""
    lines = header.splitlines()
    last = next((at for at in range(len(lines) - 1, -1, -1) if lines[at].strip(" \t#%")), -1)
    for at in range(last, max(last - 4, -1), -1):
        for names in _split_names(lines[at].strip(" \t#%"), at == last):
            while len(names) > width and not names[-1]:
                names.pop()
            if len(names) == width and all(names):
                above = "\n".join(lines[:at])
                upper = [""] * width
                if width > 1 and all(map(is_unit, names)):  # the names are above their units
                    above, upper = _without_names(above, width)
                names = [" ".join(filter(None, both)) for both in zip(upper, names, strict=True)]
                return "\n".join((above, *lines[at + 1 :])), names
        if width == 1:
            break
    return header, [""] * width


def _split_names(text: str, is_last: bool) -> Iterator[list[str]]:
    """Yield the names that a line may give, for each of its possible separators."""
    if not is_sentence(text):
        yield [text]
    for separator in (r"\t", ";", ",", r"\s{2,}"):
        cells = re.split(separator, text)
        if len(cells) > 1:
            yield [cell.strip(' "') for cell in cells]
    words = re.sub(r"\s+(?=[(\[])", "", text).split()  # acc (g) is one name
    if len(words) > 1 and is_last:
        yield words
    # Taiwan's: "DataSequence: Time U(+); N(+); E(+)"
    listed = re.split(r"[;,\s]+", text.rpartition(":")[2].strip())
    if re.match(_TIME, listed[0], re.IGNORECASE):
        yield listed


def _interval_in(header: str) -> float | None:
    """Return the sampling interval that a header gives, s."""
    if match := re.search(_INTERVAL, header):
        step = float(match[1].replace(",", "."))
        following = header[match.end() :].lstrip()
        is_milli = re.match(r"(?i)m(?:illi)?s", following) or re.search(r"(?i)\bms", match[0])
        return step / 1000.0 if is_milli else step
    if match := re.search(_RATE, header):
        return 1.0 / max(float(match[1].replace(",", ".")), 1e-30)
    return None


def _header_and_rows(lines: list[str]) -> tuple[str, list[tuple[int, str]]]:
    """Split a file before the first line that begins with a number; rows are numbered."""
    first = next(
        (at for at, line in enumerate(lines) if re.fullmatch(NUMBER, [*_cells(line), ""][0])),
        len(lines),
    )
    rows = enumerate(lines[first:], first + 1)
    return "\n".join(lines[:first]), [
        row for row in rows if row[1].strip() and not row[1].startswith("#")
    ]


def _cells(line: str) -> list[str]:
    """Split a line at semicolons, tabs, commas or blanks; decimal commas become points."""
    for separator in ";\t":
        if separator in line:
            return [cell.strip().replace(",", ".") for cell in line.split(separator)]
    words = line.split()
    if "," in line and (
        len(words) == 1 or any(word[0] == "," or word[-1] == "," for word in words)
    ):
        return [cell.strip() for cell in line.split(",")]
    return [word.replace(",", ".") for word in words]
