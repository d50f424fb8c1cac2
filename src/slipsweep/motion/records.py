"""Recorded motions: files of acceleration against time, read with their units, baseline and polarity explicit.

Four formats, told apart by what stands in the file (or by `file_format`):

* **CSV**: a column of times (s) and one of accelerations; separators comma, semicolon, tab or blanks;
  a first line of names, and lines that begin with ``#``, may stand before the numbers.  The
  unit comes from `units` or from the name of the column, in brackets: ``acceleration (m/s2)``.
* **PEER AT2**: four lines of header, the fourth with NPTS and DT, then accelerations in g.
* **ESM / ITACA ASCII** (the European and Italian databases' text format): lines ``KEY: VALUE``
  (``SAMPLING_INTERVAL_S``, ``NDATA``, ``UNITS``), then accelerations, one a line.
* **COSMOS V1, V2** (Consortium of Organizations for Strong-Motion Observation Systems, Strong Motion
  Data Format 1.20, 2001): lines of text, 100 integers, 100 reals, comments, then values in a Fortran
  format; a file may hold several channels.  Integers 2 and 3 are the physical parameter (1:
  acceleration) and the code of the unit, real 62 the sampling interval in milliseconds.

The readers are our own: ObsPy reads none of the four, and gmprocess, which reads COSMOS, brings some
hundred packages along.  Values in COSMOS files need no blanks between them: they are read by columns.
"""

import hashlib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameters import check_finite, check_numbers, shown
from slipsweep.motion.reading import Reading

Floats = NDArray[np.float64]

#: Standard gravity, m/s²: what "g" means in a record, whatever gravity a sweep takes.
STANDARD_GRAVITY = 9.80665

#: Units of a recorded acceleration, in m/s².
UNITS: dict[str, float] = {"m/s2": 1.0, "g": STANDARD_GRAVITY, "cm/s2": 0.01, "gal": 0.01}

#: A day of acceleration at 100 samples a second; what is larger is no record.
MOST_BYTES = 200_000_000

#: Codes of units in COSMOS files that are accelerations (Table 2 of the format).
_COSMOS_UNITS = {2: "g", 4: "cm/s2", 10: "gal"}


@dataclass(frozen=True, eq=False)
class Record:
    """A recorded acceleration, interpolated linearly between samples.

    Attributes
    ----------
    times : ndarray
        Times of the samples, s, increasing.
    acceleration : ndarray
        Horizontal acceleration of the plane, m/s².
    name : str
        What the record is called in results.
    attrs : dict
        How it was read, for the attributes of results.

    Raises
    ------
    InputError
        Fewer than two samples, times that do not increase, a number that is not finite.

    See Also
    --------
    read_record : a record from a file
    Suite : several records

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Record.sampled([0.0, 1.0, -2.0, 0.5, 0.0], interval=0.1, name="short")
    Record('short': 5 samples, 0.4 s, peak 2 m/s2)
    """

    times: Floats
    acceleration: Floats
    name: str = "record"
    attrs: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.attrs, Mapping):
            raise InputError(f"name = {shown(self.name)}, attrs = {shown(self.attrs)}: must be a text and a mapping")
        name = self.name if self.name.isprintable() else repr(self.name)
        times, acceleration = (
            check_numbers(f"{name}: {what}", values)
            for what, values in (("times", self.times), ("acceleration", self.acceleration))
        )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "acceleration", acceleration)
        object.__setattr__(self, "attrs", dict(self.attrs))
        if times.ndim != 1 or times.shape != acceleration.shape:
            raise InputError(
                f"{name}: times {times.shape} and acceleration {acceleration.shape}: must be rows of equal length"
            )
        if times.size < 2:
            raise InputError(f"{name}: {times.size} samples: must be at least 2")
        for what, values in (("time", times), ("acceleration", acceleration)):
            for at in np.flatnonzero(~np.isfinite(values))[:1]:
                raise InputError(f"{name}: {what} of sample {at + 1} = {values[at]}: must be a finite number")
        for at in np.flatnonzero(np.diff(times) <= 0.0)[:1]:
            raise InputError(
                f"{name}: time of sample {at + 2} = {times[at + 1]:.15g}: must be greater than {times[at]:.15g}, "
                "the time before it"
            )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return (
            (self.name, self.attrs) == (other.name, other.attrs)
            and np.array_equal(self.times, other.times)
            and np.array_equal(self.acceleration, other.acceleration)
        )

    def __hash__(self) -> int:
        return hash((self.name, self.times.size, float(self.times[-1]), float(self.acceleration[-1])))

    def __repr__(self) -> str:
        lasts = self.times[-1] - self.times[0]
        return f"Record({self.name!r}: {self.times.size} samples, {lasts:.6g} s, peak {self.peak:.4g} m/s2)"

    @property
    def peak(self) -> float:
        """Peak ground acceleration: the largest magnitude of the samples, m/s²."""
        return float(np.abs(self.acceleration).max())

    @classmethod
    def sampled(cls, acceleration: ArrayLike, interval: float, name: str = "record") -> "Record":
        """Samples of acceleration (m/s²) at a constant interval (s) from t = 0 on."""
        step = check_finite("interval", interval)
        if step <= 0.0:
            raise InputError(f"interval = {shown(interval)}: must be a finite number > 0")
        values = check_numbers("acceleration", acceleration)
        return cls(_even(values.size, step), values, name)

    def corrected(self, baseline: str) -> "Record":
        """The record less a constant ("mean") or a straight line ("linear", least squares); "none" leaves it."""
        Reading(baseline=baseline)  # type: ignore[arg-type]
        shape = self.acceleration
        with np.errstate(all="ignore"):  # what is not finite then is refused
            if baseline == "mean":
                shape = shape - shape.mean()
            elif baseline == "linear":
                shape = shape - np.polynomial.Polynomial.fit(self.times, shape, 1)(self.times)
        return replace(self, acceleration=shape, attrs=self.attrs | {"baseline": baseline})


def read_lines(path: Path, what: str) -> tuple[bytes, list[str]]:
    """The content of a file that is to hold a record or a test, and its lines."""
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a name that no system has
        raise InputError(f"path = {shown(str(path))}: cannot be read: {error}") from None
    if len(content) > MOST_BYTES:
        raise InputError(f"{path}: more than {MOST_BYTES} bytes: a {what} must have that many at most")
    # some editors put a byte-order mark in front; headers of old files are in whatever alphabet
    return content, content.decode("utf-8-sig", errors="replace").splitlines()


def read_record(
    path: str | Path,
    *,
    units: str | None = None,
    baseline: str = "none",
    format: str = "auto",
    channel: int | None = None,
) -> Record:
    """Read a recorded acceleration from a file.

    Parameters
    ----------
    path : str or Path
        The file.
    units : {"m/s2", "g", "cm/s2", "gal"}, optional
        Unit of the file's accelerations.  Needed for CSV unless its header names one; a unit
        that contradicts the file's own is refused.  "g" is standard gravity, 9.80665 m/s².
    baseline : {"none", "mean", "linear"}
        What is subtracted from the accelerations.
    format : {"auto", "csv", "at2", "esm", "cosmos"}
        "auto" looks into the file; "cosmos" is the format of [1]_.
    channel : int, optional
        Which channel of acceleration in a COSMOS file, from 1; needed where it holds several.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        The file cannot be read, or something in it is no record: with the number of the line.

    See Also
    --------
    read_suite : several files
    Record : a record from arrays

    References
    ----------
    .. [1] Consortium of Organizations for Strong-Motion Observation Systems (2001), "COSMOS Strong Motion Data Format",
       version 1.20.

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.read_record("sweeps/data/synthetic.csv")
    Record('sweeps/data/synthetic.csv': 2001 samples, 20 s, peak 3.432 m/s2)
    """
    try:
        path = Path(path)
    except TypeError:
        raise InputError(f"path = {shown(path)}: must be a path") from None
    channel = Reading(units, baseline, format, channel).channel  # type: ignore[arg-type]
    content, lines = read_lines(path, "record")
    kind = _format_of(lines) if format == "auto" else format
    if kind == "cosmos":
        times, values, own = _read_cosmos(path, lines, channel)
    elif channel is not None:
        raise InputError(f"{path}: channel = {channel}: only COSMOS files hold several; this one is read as {kind}")
    else:
        times, values, own = {"csv": _read_csv, "at2": _read_at2, "esm": _read_esm}[kind](path, lines)
    if own is not None and units is not None and UNITS[own] != UNITS[units]:
        raise InputError(f"{path}: units = {units!r}: the file itself says {own!r}; leave units out, or give that")
    unit = own or units
    if unit is None:
        raise InputError(
            f"{path}: units: must be given, one of {', '.join(map(repr, UNITS))}: the file does not name the unit"
        )
    attrs = {
        "record": path.name.encode(errors="backslashreplace").decode(),
        "record_format": kind,
        "record_units": unit,
        **({} if channel is None else {"record_channel": str(channel)}),
        "record_sha256": hashlib.sha256(content).hexdigest(),
    }
    with np.errstate(over="ignore"):  # what is not finite then is refused
        return Record(times, values * UNITS[unit], str(path), attrs).corrected(baseline)


def _format_of(lines: list[str]) -> str:
    """The format of a file, from its header."""
    if lines and _COSMOS_HEAD.search(lines[0]):
        return "cosmos"
    if any(re.search(r"NPTS\s*=", line, re.IGNORECASE) for line in lines[:6]):
        return "at2"
    if any(line.startswith("SAMPLING_INTERVAL_S:") for line in lines[:100]):
        return "esm"
    return "csv"


def _numbers(path: Path, lines: Iterable[tuple[int, str]]) -> Floats:
    """All numbers of the lines, in their order."""
    values: list[float] = []
    for number, line in lines:
        try:
            values.extend(map(float, line.split()))
        except ValueError:
            raise InputError(f"{path}: line {number}: {_shown(line)}: must be numbers") from None
    return np.array(values)


def _read_csv(path: Path, lines: list[str]) -> tuple[Floats, Floats, str | None]:
    rows: list[tuple[float, float]] = []
    own: str | None = None
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text:
            continue
        if text.startswith("#"):
            own = own if rows else _unit_named(text) or own
            continue
        cells = [cell.strip() for cell in re.split(r"[,;\t]" if re.search(r"[,;\t]", text) else r"\s+", text)]
        try:
            time, value = map(float, cells)
        except ValueError:
            if not rows and not any(_is_number(cell) for cell in cells):
                own = _unit_named(text) or own
                continue
            raise InputError(f"{path}: line {number}: {_shown(line)}: must be a time and an acceleration") from None
        if not (math.isfinite(time) and math.isfinite(value)):
            raise InputError(f"{path}: line {number}: {_shown(line)}: must be finite numbers")
        if rows and time <= rows[-1][0]:
            raise InputError(
                f"{path}: line {number}: time {time:.15g}: must be greater than {rows[-1][0]:.15g}, the time before it"
            )
        rows.append((time, value))
    if not rows:
        raise InputError(f"{path}: no line of a time and an acceleration")
    columns = np.array(rows)
    return columns[:, 0], columns[:, 1], own


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unit_named(header: str) -> str | None:
    """The unit of acceleration that a header gives in brackets."""
    for text in re.findall(r"[(\[]\s*([^)\]]+?)\s*[)\]]", header):
        unit = re.sub(r"\s+|\^|\*\*", "", text.lower()).replace("²", "2").replace("s-2", "/s2")
        unit = {"g's": "g", "gals": "gal", "cm/s/s": "cm/s2", "m/s/s": "m/s2", "m/sec2": "m/s2"}.get(unit, unit)
        if unit in UNITS:
            return unit
    return None


def _read_at2(path: Path, lines: list[str]) -> tuple[Floats, Floats, str | None]:
    at = next((i for i, line in enumerate(lines[:6]) if re.search(r"NPTS\s*=", line, re.IGNORECASE)), None)
    if at is None:
        raise InputError(f"{path}: no NPTS= and DT= in its first lines: not a PEER AT2 file")
    points = re.search(r"NPTS\s*=\s*(\d{1,9})\b", lines[at], re.IGNORECASE)
    interval = re.search(r"DT\s*=\s*([0-9.eE+-]+)", lines[at], re.IGNORECASE)
    if points is None or interval is None or not _is_number(interval[1]):
        raise InputError(f"{path}: line {at + 1}: {_shown(lines[at])}: must give NPTS= and DT=")
    header = " ".join(lines[:at]).upper()
    if "VELOCITY" in header or "DISPLACEMENT" in header:
        raise InputError(f"{path}: its header speaks of velocity or displacement: must be an acceleration (.AT2)")
    values = _numbers(path, enumerate(lines[at + 1 :], at + 2))
    return _sampled(path, values, int(points[1]), float(interval[1])), values, "g"


def _read_esm(path: Path, lines: list[str]) -> tuple[Floats, Floats, str | None]:
    keys: dict[str, str] = {}
    body = 0
    for at, line in enumerate(lines):
        name, colon, value = line.partition(":")
        if not colon:
            body = at
            break
        keys[name.strip()] = value.strip()
    for name in ("SAMPLING_INTERVAL_S", "NDATA", "UNITS"):
        if name not in keys:
            raise InputError(f"{path}: no {name} in its header: not an ESM file")
    unit = keys["UNITS"].lower().replace("^", "")
    if unit not in UNITS:
        raise InputError(f"{path}: UNITS = {keys['UNITS']!r}: must be one of {', '.join(map(repr, UNITS))}")
    if not re.fullmatch(r"[0-9]{1,9}", keys["NDATA"]) or not _is_number(keys["SAMPLING_INTERVAL_S"]):
        raise InputError(f"{path}: NDATA = {keys['NDATA']!r}, SAMPLING_INTERVAL_S: must be numbers")
    values = _numbers(path, enumerate(lines[body:], body + 1))
    return _sampled(path, values, int(keys["NDATA"]), float(keys["SAMPLING_INTERVAL_S"])), values, unit


_COSMOS_HEAD = re.compile(r"\(Format v\s*[\d.]+ with\s+(\d{1,4})\s+text lines\)", re.IGNORECASE)
# of each section's first line: how many numbers (or lines) follow, and how many columns each of them has
_COSMOS_HEADER = r"\s*(\d{1,9})\s+%s-header values follow on\s+\d+\s+lines\s*,\s*Format\s*=?\s*\(\d*[IFEG](\d{1,3})"
_COSMOS_COMMENTS = r"\s*(\d{1,9})\s+Comment line"
_COSMOS_DATA = r"\s*(\d{1,9})\s+\w+.*?\bpts?\b.*Format\s*=?\s*\(\d*[IFEG](\d{1,3})"


def _read_cosmos(path: Path, lines: list[str], channel: int | None) -> tuple[Floats, Floats, str | None]:
    channels = list(_cosmos_channels(path, lines))
    if channel is None and len(channels) > 1:
        raise InputError(f"{path}: holds {len(channels)} channels of acceleration: give channel, from 1 on")
    if not channels or not 1 <= (channel or 1) <= len(channels):
        raise InputError(f"{path}: channel = {channel or 1}: it holds {len(channels)} channels of acceleration")
    interval, values, unit = channels[(channel or 1) - 1]
    return _sampled(path, values, values.size, interval), values, unit


def _cosmos_channels(path: Path, lines: list[str]) -> Iterator[tuple[float, Floats, str]]:
    """Channels of acceleration in a file: sampling interval (s), values, unit."""
    at = 0
    while at < len(lines):
        head = _COSMOS_HEAD.search(lines[at])
        if head is None:
            if lines[at].strip():
                raise InputError(f"{path}: line {at + 1}: {_shown(lines[at])}: must begin a channel of COSMOS format")
            at += 1
            continue
        start = at
        at, whole = _cosmos_values(path, lines, at + int(head[1]), _COSMOS_HEADER % "Integer")
        at, reals = _cosmos_values(path, lines, at, _COSMOS_HEADER % "Real")
        if whole.size < 3 or reals.size < 62:
            raise InputError(f"{path}: line {start + 1}: {whole.size} integers and {reals.size} reals: not enough")
        at += 1 + int(_cosmos_line(path, lines, at, _COSMOS_COMMENTS)[1])
        at, values = _cosmos_values(path, lines, at, _COSMOS_DATA)
        # what a V2 file may have behind the acceleration is its velocity and displacement
        while at < len(lines) and not lines[at].lstrip().lower().startswith("end-of-data"):
            at += 1
        if at == len(lines):
            raise InputError(f"{path}: no line End-of-data after the values: cut off, or damaged")
        at += 1
        if whole[1] != 1:
            continue
        if whole[2] not in _COSMOS_UNITS:
            known = ", ".join(f"{code} ({unit})" for code, unit in _COSMOS_UNITS.items())
            raise InputError(f"{path}: code {whole[2]:.0f} for the unit of its values: must be one of {known}")
        yield reals[61] / 1000.0, values, _COSMOS_UNITS[int(whole[2])]


def _cosmos_line(path: Path, lines: list[str], at: int, pattern: str) -> re.Match[str]:
    found = re.match(pattern, lines[at], re.IGNORECASE) if at < len(lines) else None
    if found is None:
        shown = _shown(lines[at]) if at < len(lines) else "the end of the file"
        raise InputError(f"{path}: line {at + 1}: {shown}: not what the COSMOS format has here: damaged?")
    return found


def _cosmos_values(path: Path, lines: list[str], at: int, pattern: str) -> tuple[int, Floats]:
    """A section: a line that says how many values follow and in what columns, then these; and the line after it."""
    head = _cosmos_line(path, lines, at, pattern)
    count, width = int(head[1]), int(head[2])
    values: list[float] = []
    while len(values) < count:
        at += 1
        line = lines[at].rstrip() if at < len(lines) else ""
        if not line or line.lower().startswith("end-of-data"):
            raise InputError(f"{path}: line {at + 1}: {len(values)} values, where {count} are announced")
        try:
            values.extend(float(line[i : i + width]) for i in range(0, len(line), width))
        except ValueError:
            raise InputError(f"{path}: line {at + 1}: {_shown(line)}: must be numbers, {width} columns each") from None
    if len(values) > count:
        raise InputError(f"{path}: line {at + 1}: {len(values)} values, where {count} are announced")
    return at + 1, np.array(values)


def _sampled(path: Path, values: Floats, points: int, interval: float) -> Floats:
    """Times of evenly sampled values, whose header says how many they are."""
    if values.size != points:
        raise InputError(f"{path}: {values.size} accelerations, where its header says {points}: cut off, or damaged")
    if not (math.isfinite(interval) and interval > 0.0):
        raise InputError(f"{path}: sampling interval {interval}: must be > 0")
    return _even(points, interval)


def _even(points: int, interval: float) -> Floats:
    with np.errstate(over="ignore"):
        return np.arange(points, dtype=np.float64) * interval


def _shown(line: str) -> str:
    return repr(line if len(line) <= 60 else f"{line[:57]}...")
