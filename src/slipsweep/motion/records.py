"""Recorded motions: acceleration against time, read with units, baseline and polarity explicit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameter_table import LARGEST
from slipsweep.model.parameters import check_choice, check_numbers, check_single, shown
from slipsweep.motion import formats
from slipsweep.motion.headings import vertical_mark
from slipsweep.motion.intensity import Floats, peak_displacement, peak_velocity
from slipsweep.motion.lines import read_lines
from slipsweep.motion.reading import (
    STANDARD_GRAVITY,
    UNITS,
    Baseline,
    Format,
    Gaps,
    Implausible,
    Reading,
    Unit,
)

#: An interval of more than so many medians is a gap.
_GAP = 5.0

#: Shorter records are typed by hand, and checked for impossible values only.
_FEWEST = 16

#: Magnitudes that programs write for missing values.
_FILL = np.array(
    [999.0, 9999.0, 99999.0, 999999.0, 999.9, 999.99, 9999.9, 9999.99, 32767.0, 32768.0, 1e20, 1e30]
)

#: A sensor is stuck if it holds a value for so long (s, and samples) while the ground shakes.
_HELD = 0.5
_HELD_SAMPLES = 20

#: Range of peaks that are plausible, g: the largest ever recorded are 2.7 horizontally and 4
#: vertically.
_WEAKEST = 0.001
_STRONGEST = 3.0

#: A record looks clipped if so many samples in a row have its largest or smallest value, the sample
#: before or after differs by more than so many of the smallest steps, and the value is more than
#: this share of the peak.
_FLAT_SAMPLES = 3
_FLAT_STEPS = 2.0
_FLAT_SHARE = 0.1

#: Share of samples that are exactly 0 from which on a record has a caution.
_ZEROS = 0.4

#: Displacement of the ground (m) that is a drift if the velocity at the end is more than a share of
#: the peak velocity, and displacement that is always a drift: the largest along a fault are 9 m.
_DRIFT = 2.0
_DRIFT_VELOCITY = 0.05
_LARGEST_DISPLACEMENT = 10.0


@dataclass(frozen=True, eq=False)
class Record:
    """A recorded acceleration, interpolated linearly between samples.

    Attributes
    ----------
    times : ndarray
        Times of the samples, s, increasing.
    acceleration : ndarray
        Horizontal acceleration of the base, m/s².
    name : str
        Name of the record in results.
    attrs : dict
        Attributes for results, such as the format and the unit of its file.

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
        for name in ("times", "acceleration"):
            object.__setattr__(
                self, name, check_numbers(f"{self.name}: {name}", getattr(self, name))
            )
        check_samples(self.name, self.times, {"acceleration": self.acceleration}, least=2)
        object.__setattr__(self, "attrs", dict(self.attrs))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Record)
            and (self.name, self.attrs) == (other.name, other.attrs)
            and np.array_equal(self.times, other.times)
            and np.array_equal(self.acceleration, other.acceleration)
        )

    def __hash__(self) -> int:
        return hash(
            (self.name, self.times.size, float(self.times[-1]), float(self.acceleration[-1]))
        )

    def __repr__(self) -> str:
        samples = f"{self.times.size} samples, {np.ptp(self.times):.6g} s"
        return f"Record({self.name!r}: {samples}, peak {self.peak:.4g} m/s2)"

    @property
    def peak(self) -> float:
        """Peak ground acceleration: the largest magnitude of the samples, m/s²."""
        return float(np.abs(self.acceleration).max())

    @classmethod
    def sampled(cls, acceleration: ArrayLike, interval: float, name: str = "record") -> "Record":
        """Return a record of acceleration (m/s²) at a constant interval (s) from t = 0 on."""
        values = check_numbers("acceleration", acceleration)
        step = check_single("interval", interval)
        return cls(step * np.arange(values.size, dtype=np.float64), values, name)

    @classmethod
    def from_obspy(
        cls,
        trace: Any,
        units: Unit,
        *,
        name: str | None = None,
        baseline: Baseline = "none",
        gaps: Gaps = "refuse",
        implausible: Implausible = "refuse",
    ) -> "Record":
        """Return the record in a trace of ObsPy, which reads miniSEED, SAC and other formats.

        `units` is the unit of the trace's data, which must be accelerations, not counts; masked
        samples are missing.  The name is by default the trace's `id`.  The other arguments, and
        InputError, are those of `read_record`.

        Examples
        --------
        >>> import types
        >>> import slipsweep
        >>> stats = types.SimpleNamespace(delta=0.1)
        >>> trace = types.SimpleNamespace(id="XX.A..HNE", data=[0.0, 2.0, 0.0], stats=stats)
        >>> slipsweep.Record.from_obspy(trace, "m/s2")
        Record('XX.A..HNE': 3 samples, 0.2 s, peak 2 m/s2)
        """
        try:
            data = trace.data
            interval = check_single("interval", trace.stats.delta)
            record_name = name or str(trace.id)
        except AttributeError:
            raise InputError(
                f"trace = {shown(trace)}: must be a Trace of ObsPy, one of those in a Stream"
            ) from None
        check_choice("units", units, tuple(UNITS))
        if np.asarray(data).dtype.kind in "iu":
            counts = f"{record_name}: its data are whole numbers, counts of a digitizer"
            raise InputError(
                f"{counts}: must be accelerations, such as trace.remove_response(output='ACC') "
                "leaves"
            )
        values = check_numbers("trace.data", np.ma.filled(data, np.nan))
        times = interval * np.arange(values.size, dtype=np.float64)
        reading = Reading(baseline=baseline, gaps=gaps, implausible=implausible)
        attrs = {"record_format": "obspy"}
        if vertical := vertical_mark(str(trace.id).rpartition(".")[2]):  # the channel's code
            attrs["record_vertical"] = vertical
        return _inspected(record_name, times, values, units, reading, attrs)

    def corrected(self, baseline: Baseline) -> "Record":
        """Return the record less its mean, or less a straight line fitted by least squares.

        `baseline` is "mean" or "linear"; "none" changes nothing.
        """
        degrees = {"none": None, "mean": 0, "linear": 1}
        values = self.acceleration
        if (degree := degrees[check_choice("baseline", baseline, degrees)]) is not None:
            values = values - np.polynomial.Polynomial.fit(self.times, values, degree)(self.times)
        return replace(self, acceleration=values, attrs=self.attrs | {"baseline": baseline})

    def summary(self) -> str:
        """Return a line: duration, interval, peak acceleration and velocity, unit, cautions.

        Examples
        --------
        >>> import slipsweep
        >>> slipsweep.read_record("sweeps/data/synthetic.csv").summary()
        'sweeps/data/synthetic.csv: 20 s at 0.01 s, PGA 0.35 g, PGV 0.412 m/s, read in g'
        """
        notes = {
            ", read in ": "record_units",
            "; accepted: ": "record_accepted",
            "; caution: ": "record_caution",
        }
        read = "".join(
            text + self.attrs[name] for text, name in notes.items() if name in self.attrs
        )
        sampled = f"{np.ptp(self.times):.4g} s at {np.median(np.diff(self.times)):.4g} s"
        velocity = peak_velocity(self.times, self.acceleration)
        peaks = f"PGA {self.peak / STANDARD_GRAVITY:.4g} g, PGV {velocity:.4g} m/s"
        return f"{self.name}: {sampled}, {peaks}{read}"


def check_samples(name: str, times: Floats, columns: Mapping[str, Floats], least: int) -> None:
    """Raise InputError for fewer samples than `least`, or for times or values that are not valid.

    Times must increase, all numbers must be finite, and all columns as long as the times.
    """
    for what, values in {"time": times, **columns}.items():
        if values.ndim != 1 or values.shape != times.shape:
            raise InputError(
                f"{name}: {what}: {values.shape} samples, where time has {times.shape}: must be "
                "rows"
            )
        for at in np.flatnonzero(~(np.abs(values) <= LARGEST))[:1]:
            raise InputError(
                f"{name}: {what} of sample {at + 1} = {values[at]}: must be finite, at most "
                f"{LARGEST:g}"
            )
    if times.size < least:
        raise InputError(f"{name}: {times.size} samples: must be at least {least}")
    for at in np.flatnonzero(np.diff(times) <= 0.0)[:1]:
        now = times[at + 1]
        before = times[at]
        raise InputError(
            f"{name}: time of sample {at + 2} = {now:.15g}: must be greater than {before:.15g} "
            "before it"
        )


def read_record(
    path: str | Path,
    *,
    units: Unit | None = None,
    interval: float | None = None,
    baseline: Baseline = "none",
    gaps: Gaps = "refuse",
    implausible: Implausible = "refuse",
    format: Format = "auto",
    channel: int | None = None,
) -> Record:
    """Read a recorded acceleration from a file.

    Parameters
    ----------
    path : str or Path
        The file.
    units : {"m/s2", "g", "cm/s2", "gal"}, optional
        Unit of the file's accelerations.  Needed unless the file names it; a unit that contradicts
        the file's own is refused.  "g" is standard gravity, 9.80665 m/s².
    interval : float, optional
        Sampling interval of a file that holds accelerations without times, s.
    baseline : {"none", "mean", "linear"}
        What is subtracted from the accelerations.
    gaps : {"refuse", "linear"}
        Missing samples: an interval of more than five times the median, blank cells, fill values
        such as -999 and 9999, a value that is held for half a second and longer.  "linear"
        interpolates between the others.
    implausible : {"refuse", "accept"}
        A peak above 3 g or below 0.001 g, which is often that of a wrong unit, and ground that
        drifts by metres.
    format : {"auto", "csv", "columns", "values", "at2", "esm", "cosmos", "knet", "asa"}
        "auto" looks into the file.  Plain text: "csv" has a column of times, "columns" are
        components side by side without times, "values" is one component, line after line.
        "cosmos" is the Strong Motion Data Format 1.20 of the Consortium of Organizations for
        Strong-Motion Observation Systems (2001), "asa" the Archivo Estándar de Aceleración 2.0 of
        the Mexican networks.
    channel : int, optional
        Number of the acceleration in a file that holds several, from 1 in the order of the file;
        needed there.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        The file cannot be read, or it is not a record: the message has the number of the line, or
        the time.

    Notes
    -----
    A record that looks clipped, that has many samples of 0, or that is a vertical component is
    read; `Record.summary` has a caution (attribute `record_caution`).

    See Also
    --------
    read_suite : several files
    Record, Record.from_obspy : a record from arrays, or from ObsPy

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.read_record("sweeps/data/synthetic.csv")
    Record('sweeps/data/synthetic.csv': 2001 samples, 20 s, peak 3.432 m/s2)
    """
    reading = Reading(units, interval, baseline, gaps, implausible, format, channel)
    path = Path(path)
    digest, lines = read_lines(path)
    kind, samples, unit = formats.read_samples(path, lines, reading)
    attrs = {"record": path.name, "record_format": kind, "record_sha256": digest}
    if reading.channel is not None:
        attrs["record_channel"] = str(reading.channel)
    if vertical := vertical_mark(samples.component, path):
        attrs["record_vertical"] = vertical
    return _inspected(str(path), samples.times, samples.values, unit, reading, attrs)


def _inspected(
    name: str, times: Floats, values: Floats, unit: str, reading: Reading, attrs: dict[str, str]
) -> Record:
    """Return the record of values in a unit.

    InputError: samples are missing or implausible, and `reading` does not accept that.
    """
    kept = ~_is_fill(values)
    missing = "; ".join((*missing_samples(times, values), *_held(times[kept], values[kept])))
    if missing and reading.gaps == "refuse":
        raise InputError(
            f"{name}: {missing}: samples are missing; gaps = 'linear' interpolates between the "
            "others"
        )
    record = Record(times[kept], values[kept] * UNITS[unit], name, attrs | {"record_units": unit})
    record = record.corrected(reading.baseline)
    odd = "; ".join(_implausible(record, unit))
    if odd and reading.implausible == "refuse":
        raise InputError(f"{name}: {odd}; or implausible = 'accept' takes the record as it is")
    cautions = [f"vertical component ({mark})"] if (mark := attrs.get("record_vertical")) else []
    notes = {
        "record_accepted": "; ".join(filter(None, (missing, odd))),
        "record_caution": "; ".join((*cautions, *_cautions(times[kept], values[kept], unit))),
    }
    return replace(
        record, attrs=record.attrs | {name: text for name, text in notes.items() if text}
    )


def missing_samples(times: Floats, values: Floats) -> Iterator[str]:
    """Yield texts on fill values, in any unit, and on intervals without samples."""
    if (fill := _is_fill(values)).any():
        kinds = ", ".join(
            "blank" if np.isnan(value) else f"{value:g}" for value in np.unique(values[fill])[:3]
        )
        number = f"{fill.sum()} fill value{'s' if fill.sum() > 1 else ''}"
        yield f"{number} ({kinds}), first at t = {times[fill][0]:.6g} s"
    intervals = np.diff(times)
    if intervals.size < _FEWEST or not (intervals > 0.0).all():
        return
    median = np.median(intervals)
    wide = np.flatnonzero(intervals > _GAP * median)
    for at in wide[:1]:
        ratio = f"{intervals[at] / median:.0f} times the median interval of {median:.4g} s"
        more = f", and {wide.size - 1} more" if wide.size > 1 else ""
        yield f"no samples from t = {times[at]:.6g} to {times[at + 1]:.6g} s ({ratio}){more}"


def _is_fill(values: Floats) -> NDArray[np.bool_]:
    """Return True where values stand for missing samples."""
    missing = np.isnan(values)
    magnitude = np.abs(np.nan_to_num(values))
    looks_like_fill = np.isin(magnitude, _FILL)
    others = np.flatnonzero(~looks_like_fill & ~missing)
    if looks_like_fill.any() and others.size:
        # 999 gal may be a peak: then the values beside it are not far from it
        between = np.interp(np.arange(values.size), others, values[others])
        missing |= looks_like_fill & (np.abs(values - between) > 0.5 * magnitude)
    # the same number again and again, far above all others
    largest = magnitude == magnitude.max(initial=0.0)
    rest = magnitude[~largest].max(initial=0.0)
    is_alone = (
        largest.sum() > 1
        and magnitude.max(initial=0.0) > 20.0 * rest > 0.0
        and values.size > _FEWEST
    )
    fill: NDArray[np.bool_] = missing | (largest & is_alone)
    return fill


def _held(times: Floats, values: Floats) -> Iterator[str]:
    """Yield a text on the first value that does not change while the ground shakes."""
    steps = np.abs(np.diff(values, prepend=np.nan, append=np.nan))
    changes = np.flatnonzero(steps != 0.0)
    starts = changes[:-1]
    lasts = changes[1:] - 1
    jumps = np.minimum(steps[changes[:-1]], steps[changes[1:]])
    held = values[starts]
    peak = np.abs(values).max(initial=0.0)
    shakes = (np.abs(held) > 0.01 * peak) | (jumps > 0.05 * peak)  # else the ground is at rest
    long = (lasts - starts >= _HELD_SAMPLES) & (times[lasts] - times[starts] >= _HELD)
    for at in np.flatnonzero(shakes & long)[:1]:
        interval = f"from t = {times[starts[at]]:.6g} to {times[lasts[at]]:.6g} s"
        yield f"the value {held[at]:.6g} is held {interval}"


def _implausible(record: Record, unit: str) -> Iterator[str]:
    """Yield texts on a peak that is implausible in `unit`, and on ground that moves away."""
    times = record.times
    acceleration = record.acceleration
    at = int(np.abs(acceleration).argmax())
    is_short = times.size <= _FEWEST
    peak = acceleration[at] / STANDARD_GRAVITY
    if abs(peak) > _STRONGEST or (abs(peak) < _WEAKEST and not is_short):
        in_unit = {other: abs(peak) * factor / UNITS[unit] for other, factor in UNITS.items()}
        likely = min(in_unit, key=lambda other: abs(np.log(max(in_unit[other], 1e-300) / 0.3)))
        explains = 0.02 <= in_unit[likely] <= 1.5
        hint = (
            f" (read in {unit}; in {likely} it would be {in_unit[likely]:.3g} g)"
            if explains
            else ""
        )
        limit = f"above {_STRONGEST:g} g" if abs(peak) > 1.0 else f"below {_WEAKEST:g} g"
        where = f"peak acceleration {peak:.4g} g at t = {times[at]:.6g} s"
        yield f"{where}{hint}: {limit}, check units and header"
    if is_short:
        return
    displacement = peak_displacement(times, acceleration)
    end = float(np.trapezoid(acceleration, times))
    moves_on = displacement > _DRIFT and abs(end) > _DRIFT_VELOCITY * peak_velocity(
        times, acceleration
    )
    if moves_on or displacement > _LARGEST_DISPLACEMENT:  # as the integral of an offset does
        drift = (
            "an offset or a drift; baseline = 'linear' takes a straight line off the acceleration"
        )
        at_end = f"a velocity of {end:.3g} m/s at t = {times[-1]:.6g} s"
        yield f"the ground moves {displacement:.3g} m and has {at_end}: {drift}"


def _cautions(times: Floats, values: Floats, unit: str) -> Iterator[str]:
    """Yield cautions on a record that looks clipped, or of which half may be missing."""
    if values.size <= _FEWEST:
        return
    zeros = float((values == 0.0).mean())
    if zeros >= _ZEROS:
        yield f"{zeros:.0%} of its samples are 0"
    steps = np.abs(np.diff(values))
    least = steps[steps > 0.0].min(initial=np.inf)
    peak = np.abs(values).max()
    for level in (values.max(), values.min()):
        at_level = np.concatenate([[False], values == level, [False]])
        starts, ends = np.flatnonzero(np.diff(at_level)).reshape(-1, 2).T
        # the steps onto the level and off it; there is none at the ends of the record
        step = np.concatenate([[0.0], steps, [0.0]])
        sharp = np.maximum(step[starts], step[ends]) > _FLAT_STEPS * least
        flat = np.flatnonzero((ends - starts >= _FLAT_SAMPLES) & sharp)
        if flat.size and abs(level) > _FLAT_SHARE * peak:
            samples = int((ends - starts)[flat].sum())
            where = f"first at t = {times[starts[flat[0]]]:.6g} s"
            extreme = "largest" if level > 0.0 else "smallest"
            at = f"flat at its {extreme} value {level:.4g} {unit}"
            yield f"{at} ({samples} samples, {where}): it may be clipped"
