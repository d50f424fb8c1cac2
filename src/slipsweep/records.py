"""Recorded motions: files of acceleration against time, read with their units, baseline and polarity explicit.

Three formats, told apart by what stands in the file (or by `file_format`):

* **CSV**: a column of times (s) and one of accelerations; separators comma, semicolon, tab or blanks;
  a first line of names, and lines that begin with ``#``, may stand before the numbers.  The
  unit comes from `units` or from the name of the column, in brackets: ``acceleration (m/s2)``.
* **PEER AT2**: four lines of header, the fourth with NPTS and DT, then accelerations in g.
* **ESM / ITACA ASCII** (the European and Italian databases' text format): lines ``KEY: VALUE``
  (``SAMPLING_INTERVAL_S``, ``NDATA``, ``UNITS``), then accelerations, one a line.
"""

import hashlib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipsweep.errors import InputError
from slipsweep.parameters import check_choice

Floats = NDArray[np.float64]

#: Standard gravity, m/s²: what "g" means in a record, whatever gravity a sweep takes.
STANDARD_GRAVITY = 9.80665

#: Units of a recorded acceleration, in m/s².
UNITS: dict[str, float] = {"m/s2": 1.0, "g": STANDARD_GRAVITY, "cm/s2": 0.01, "gal": 0.01}

#: A day of acceleration at 100 samples a second; what is larger is no record.
_MOST_BYTES = 200_000_000

BASELINES = ("none", "mean", "linear")
FORMATS = ("auto", "csv", "at2", "esm")


@dataclass(frozen=True, eq=False)
class Record:
    """A recorded acceleration, taken as straight between its samples.

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
    """

    times: Floats
    acceleration: Floats
    name: str = "record"
    attrs: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        try:
            times, acceleration = (np.array(values, np.float64) for values in (self.times, self.acceleration))
        except (TypeError, ValueError):
            raise InputError(f"{self.name}: times and acceleration must be two rows of numbers") from None
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "acceleration", acceleration)
        if times.ndim != 1 or times.shape != acceleration.shape:
            raise InputError(
                f"{self.name}: times {times.shape} and acceleration {acceleration.shape}: must be rows of equal length"
            )
        if times.size < 2:
            raise InputError(f"{self.name}: {times.size} samples: must be at least 2")
        for what, values in (("time", times), ("acceleration", acceleration)):
            for at in np.flatnonzero(~np.isfinite(values))[:1]:
                raise InputError(f"{self.name}: {what} of sample {at + 1} = {values[at]}: must be a finite number")
        for at in np.flatnonzero(np.diff(times) <= 0.0)[:1]:
            raise InputError(
                f"{self.name}: time of sample {at + 2} = {times[at + 1]:.15g}: must be greater than {times[at]:.15g}, "
                "the time before it"
            )

    @classmethod
    def sampled(cls, acceleration: ArrayLike, interval: float, name: str = "record") -> "Record":
        """Samples of acceleration (m/s²) at a constant interval (s) from t = 0 on."""
        if not (math.isfinite(interval) and interval > 0.0):
            raise InputError(f"interval = {interval!r}: must be a finite number > 0")
        values = np.array(acceleration, np.float64)
        return cls(_even(values.size, interval), values, name)

    def corrected(self, baseline: str) -> "Record":
        """The record less a constant ("mean") or a straight line ("linear", least squares); "none" leaves it."""
        check_choice("baseline", baseline, BASELINES)
        shape = {"none": self.acceleration, "mean": self.acceleration - self.acceleration.mean()}.get(baseline)
        if shape is None:
            line = np.polynomial.Polynomial.fit(self.times, self.acceleration, 1)
            shape = self.acceleration - line(self.times)
        return replace(self, acceleration=shape, attrs=self.attrs | {"baseline": baseline})


def read_record(
    path: str | Path, *, units: str | None = None, baseline: str = "none", file_format: str = "auto"
) -> Record:
    """Read a recorded acceleration from a file.

    Parameters
    ----------
    path : str or Path
    units : {"m/s2", "g", "cm/s2", "gal"}, optional
        Unit of the file's accelerations.  Needed for CSV unless its header names one; a unit
        that contradicts the file's own is refused.  "g" is standard gravity, 9.80665 m/s².
    baseline : {"none", "mean", "linear"}
        What is taken off the accelerations.
    file_format : {"auto", "csv", "at2", "esm"}
        "auto" looks into the file.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        The file cannot be read, or something in it is no record: with the number of the line.
    """
    path = Path(path)
    check_choice("baseline", baseline, BASELINES)
    check_choice("file_format", file_format, FORMATS)
    if units is not None:
        check_choice("units", units, UNITS)
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path}: {path.stat().st_size} bytes: a record must have {_MOST_BYTES} at most")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    # some editors put a byte-order mark in front; headers of old files are in whatever alphabet
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    kind = _format_of(lines) if file_format == "auto" else file_format
    times, values, own = {"csv": _read_csv, "at2": _read_at2, "esm": _read_esm}[kind](path, lines)
    if own is not None and units is not None and UNITS[own] != UNITS[units]:
        raise InputError(f"{path}: units = {units!r}: the file itself says {own!r}; leave units out, or give that")
    unit = own or units
    if unit is None:
        raise InputError(
            f"{path}: units: must be given, one of {', '.join(map(repr, UNITS))}: the file does not name the unit"
        )
    attrs = {
        "record": path.name,
        "record_format": kind,
        "record_units": unit,
        "record_sha256": hashlib.sha256(content).hexdigest(),
    }
    return Record(times, values * UNITS[unit], str(path), attrs).corrected(baseline)


def _format_of(lines: list[str]) -> str:
    """The format of a file, from its header."""
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
    points = re.search(r"NPTS\s*=\s*(\d+)", lines[at], re.IGNORECASE)
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
    if not keys["NDATA"].isdigit() or not _is_number(keys["SAMPLING_INTERVAL_S"]):
        raise InputError(f"{path}: NDATA = {keys['NDATA']!r}, SAMPLING_INTERVAL_S: must be numbers")
    values = _numbers(path, enumerate(lines[body:], body + 1))
    return _sampled(path, values, int(keys["NDATA"]), float(keys["SAMPLING_INTERVAL_S"])), values, unit


def _sampled(path: Path, values: Floats, points: int, interval: float) -> Floats:
    """Times of evenly sampled values, whose header says how many they are."""
    if values.size != points:
        raise InputError(f"{path}: {values.size} accelerations, where its header says {points}: cut off, or damaged")
    if not (math.isfinite(interval) and interval > 0.0):
        raise InputError(f"{path}: sampling interval {interval}: must be > 0")
    return _even(points, interval)


def _even(points: int, interval: float) -> Floats:
    return np.arange(points, dtype=np.float64) * interval


def _shown(line: str) -> str:
    return repr(line if len(line) <= 60 else f"{line[:57]}...")
