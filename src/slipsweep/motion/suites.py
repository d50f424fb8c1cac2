"""Suites of recorded motions of any length and sampling, each with a label."""

import glob
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model.parameters import check_choice, check_list, check_single, shown
from slipsweep.model.variables import INTENSITY_MEASURES
from slipsweep.motion.headings import vertical_mark
from slipsweep.motion.intensity import Floats, intensity_measures
from slipsweep.motion.reading import (
    Baseline,
    Format,
    Gaps,
    Implausible,
    Reading,
    Unit,
    Vertical,
)
from slipsweep.motion.records import Record, read_record


@dataclass(frozen=True)
class Pair:
    """Two horizontal components of one motion, at right angles.

    A component that ends before the other is continued with zeros: its ground is at rest then.

    Attributes
    ----------
    first, second : Record
        The components at azimuths 0 and 90 degrees, on the same samples.

    Raises
    ------
    InputError
        They are not sampled at the same times.

    See Also
    --------
    read_suite : pairs from files

    Examples
    --------
    >>> import slipsweep
    >>> first = slipsweep.Record.sampled([0, 3, 0], 0.1, "NS")
    >>> second = slipsweep.Record.sampled([0, 4, 0], 0.1, "EW")
    >>> slipsweep.Pair(first, second).rotated(90)
    Record('NS, EW at 90 degrees': 3 samples, 0.2 s, peak 4 m/s2)
    """

    first: Record
    second: Record

    def __post_init__(self) -> None:
        components = {"first": self.first, "second": self.second}
        for name, component in components.items():
            if not isinstance(component, Record):
                raise InputError(
                    f"{name} = {shown(component)}: must be a Record, one component of a motion"
                )
        times, other = sorted((self.first.times, self.second.times), key=np.size, reverse=True)
        # files round times; those that differ by a millionth of an interval are the same
        if np.abs(times[: other.size] - other).max() > 1e-6 * np.diff(other).min():
            raise InputError(
                f"{self.name}: the components of a pair must be sampled at the same times"
            )
        for name, component in components.items():
            filled = np.append(component.acceleration, np.zeros(times.size - component.times.size))
            object.__setattr__(self, name, replace(component, times=times, acceleration=filled))

    @property
    def name(self) -> str:
        """Name of the pair in messages."""
        return f"{self.first.name}, {self.second.name}"

    @property
    def times(self) -> Floats:
        """Times of the samples, s."""
        return self.first.times

    @property
    def attrs(self) -> dict[str, str]:
        """Attributes of the components; where they differ, that of the second after the first."""
        first = self.first.attrs
        second = self.second.attrs
        return {
            name: " ".join(dict.fromkeys((first.get(name, ""), second.get(name, ""))))
            for name in {**first, **second}
        }

    def rotated(self, azimuth: float) -> Record:
        """Return the component at an azimuth, degrees from the first towards the second.

        It is exact at the samples and between them.
        """
        from scipy.special import cosdg, sindg  # exact at the quarters of a turn

        degrees = check_single("azimuth", azimuth)
        acceleration = (
            cosdg(degrees) * self.first.acceleration + sindg(degrees) * self.second.acceleration
        )
        return Record(self.times, acceleration, f"{self.name} at {degrees:g} degrees", self.attrs)


Motion: TypeAlias = Record | Pair

#: Files or Records of a motion: one, or the two components of a pair.
_Source: TypeAlias = tuple[Path | Record, ...]


@dataclass(frozen=True, repr=False)
class Suite:
    """Recorded motions that shake the same blocks: the dimension `motion` of results.

    ``suite["label"]`` and ``suite[0]`` are motions, ``suite[2:5]`` and ``suite[["a", "b"]]`` are
    suites of some motions.

    Attributes
    ----------
    motions : tuple of Record or of Pair
        Of any length and sampling.  A suite of pairs needs an `azimuth`.
    labels : tuple of str
        Labels in results, all different; by default the stems of the records' names (of the first
        components').
    name : str
        Name of the suite in results.
    left_out : tuple of str
        Files of vertical components that `read_suite` found and left out.

    Raises
    ------
    InputError
        No motion, records among pairs, or labels that are not as many and all different.

    See Also
    --------
    read_suite : a suite from files
    suite_statistics : displacements over its motions

    Examples
    --------
    >>> import slipsweep
    >>> record = slipsweep.read_record("sweeps/data/synthetic.csv")
    >>> slipsweep.Suite((record,), ("synthetic",))
    Suite('suite': 1 motion: synthetic)
    """

    motions: tuple[Motion, ...]
    labels: tuple[str, ...] = ()
    name: str = "suite"
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        motions = tuple(self.motions)
        for at, motion in enumerate(motions, 1):
            if not isinstance(motion, (Record, Pair)):
                raise InputError(f"motions[{at}] = {shown(motion)}: must be a Record or a Pair")
        if len({type(motion) for motion in motions}) != 1:
            raise InputError(
                f"motions: {len(motions)}: must be one at least, all Records or all Pairs"
            )
        labels = tuple(check_list("labels", self.labels, "texts"))
        labels = labels or tuple(_labels([Path(_components(motion)[0].name) for motion in motions]))
        texts = {
            label
            for label in labels
            if isinstance(label, str) and label.strip() and label.isprintable()
        }
        if not len(motions) == len(labels) == len(texts):
            raise InputError(
                f"labels = {shown(labels)}: must be {len(motions)} different texts that can be "
                "printed"
            )
        object.__setattr__(self, "motions", motions)
        object.__setattr__(self, "labels", labels)

    def __repr__(self) -> str:
        labels = self.labels if len(self) <= 6 else (*self.labels[:3], "...", *self.labels[-2:])
        what = f"{'pair' if self.has_pairs else 'motion'}{'s' if len(self) > 1 else ''}"
        left_out = f"; left out: {', '.join(self.left_out)}" if self.left_out else ""
        return f"Suite({self.name!r}: {len(self)} {what}: {', '.join(labels)}{left_out})"

    def __len__(self) -> int:
        return len(self.motions)

    def __iter__(self) -> Iterator[Motion]:
        return iter(self.motions)

    def __getitem__(self, which: Any) -> Any:
        if not isinstance(which, (slice, list, tuple)):
            return self.motions[self.index(which)]
        places = [
            self.index(label)
            for label in (self.labels[which] if isinstance(which, slice) else which)
        ]
        return Suite(
            tuple(self.motions[at] for at in places),
            tuple(self.labels[at] for at in places),
            self.name,
            self.left_out,
        )

    def index(self, which: str | int) -> int:
        """Return the index of a motion (InputError: none has that label)."""
        if isinstance(which, str) and which not in self.labels:
            raise InputError(
                f"motion = {shown(which)}: not in the suite; {did_you_mean(which, self.labels)}"
            )
        return self.labels.index(which) if isinstance(which, str) else which

    @property
    def has_pairs(self) -> bool:
        """Return True if the motions are pairs of components."""
        return isinstance(self.motions[0], Pair)

    @property
    def components(self) -> tuple[Record, ...]:
        """All records: the motions, or the components of all pairs, pair after pair."""
        return tuple(chain.from_iterable(map(_components, self)))

    @cached_property
    def measures(self) -> dict[str, NDArray[Any]]:
        """`variables.MOTION_COORDINATES` of all motions.

        Pairs have no intensities here, as these depend on the azimuth.
        """
        measures: dict[str, NDArray[Any]] = {
            "motion_file": np.array([motion.attrs.get("record", "") for motion in self]),
            "motion_sha256": np.array([motion.attrs.get("record_sha256", "") for motion in self]),
            "motion_samples": np.array([motion.times.size for motion in self], np.int32),
            "motion_interval": np.array(
                [np.ptp(motion.times) / (motion.times.size - 1) for motion in self]
            ),
        }
        if self.has_pairs:
            return measures
        return measures | self.intensities(np.arange(len(self)), np.zeros(len(self)))

    def intensities(self, places: NDArray[np.int64], azimuths: Floats) -> dict[str, Floats]:
        """Return the intensity measures of motions at their azimuths, in the shape of `places`.

        `places` are indices of motions; `azimuths` (degrees) have the same shape.
        """
        motions = [
            self.record(int(at), float(azimuth))
            for at, azimuth in zip(places.flat, azimuths.flat, strict=True)
        ]
        measures = [intensity_measures(motion.times, motion.acceleration) for motion in motions]
        return {
            f"motion_{m}": np.reshape([motion[m] for motion in measures], azimuths.shape)
            for m in INTENSITY_MEASURES
        }

    def record(self, at: int, azimuth: float) -> Record:
        """Return the motion at an index; of a pair, its component at an azimuth."""
        motion = self.motions[at]
        return motion.rotated(azimuth) if isinstance(motion, Pair) else motion

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes for results: the number of motions, duplicates, and how all were read."""
        about: dict[str, Any] = {"suite": self.name, "motions": len(self)}
        if self.left_out:
            about["left_out_vertical"] = ", ".join(self.left_out)
        for name in ("record_format", "record_units", "baseline"):
            values = {record.attrs.get(name) for record in self.components}
            if len(values) == 1 and None not in values:
                about[name] = values.pop()
        alike = defaultdict[bytes, list[str]](list)  # such as one file under two names
        for label, motion in zip(self.labels, self, strict=True):
            samples = (
                record.times.tobytes() + record.acceleration.tobytes()
                for record in _components(motion)
            )
            alike[b"".join(samples)].append(label)
        if twice := [", ".join(labels) for labels in alike.values() if len(labels) > 1]:
            about["duplicate_motions"] = "; ".join(twice)
        return about

    def summary(self) -> str:
        """Return a line for each record, as `Record.summary`, and one on files left out."""
        lines = [record.summary() for record in self.components]
        if self.left_out:
            lines.append(
                f"left out, vertical components: {', '.join(self.left_out)}; "
                "vertical = 'accept' takes them"
            )
        return "\n".join(lines)

    def cautions(self) -> list[str]:
        """Return a line for each record in which something may be wrong."""
        texts = {record.name: record.attrs.get("record_caution") for record in self.components}
        return [f"caution: {name}: {text}" for name, text in texts.items() if text]


def read_suite(
    paths: Any,
    *,
    pairs: Sequence[str] | None = None,
    units: Unit | None = None,
    interval: float | None = None,
    baseline: Baseline = "none",
    gaps: Gaps = "refuse",
    implausible: Implausible = "refuse",
    format: Format = "auto",
    channel: int | None = None,
    vertical: Vertical = "leave_out",
) -> Suite:
    """Read a suite of recorded motions.

    Parameters
    ----------
    paths : str, Path, Record, Pair, or list of these
        A folder (all files in it, but for hidden ones; folders in it are not looked into), a
        pattern such as ``"motions/*.AT2"`` (``**`` is any folder), or a list of files, folders,
        patterns, Records and pairs.  An entry that is itself a list of two files (or Records) is a
        pair of horizontal components.  Files of a folder or a pattern are in the order of their
        names; one that several entries name is one motion.
    pairs : (str, str), optional
        Two endings of the files' stems, such as ``("_NS", "_EW")``: files that differ in these
        alone are the two components of one motion, the first ending's at azimuth 0 and the second's
        at 90 degrees.
    units, interval, baseline, gaps, implausible, format, channel
        As `read_record`, for every file.
    vertical : {"leave_out", "accept"}
        Files of vertical components, known by their headers and names (UP, UD, DWN, V, VERT, Z,
        HNZ): left out, and named in `Suite.left_out`, or taken as motions.

    Returns
    -------
    Suite
        Labelled by the stems of the files, and by more of their paths where stems are alike.

    Raises
    ------
    InputError
        Any file cannot be read, or is no record: all of them are named.  A pattern that fits no
        file, a folder without one, a component without the other, or vertical components only.

    See Also
    --------
    read_record : one file

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.read_suite("sweeps/data/suite/*_H1.AT2").labels
    ('rock-far_H1', 'rock-near_H1', 'soft-far_H1', 'stiff-pulse_H1')
    >>> slipsweep.read_suite("sweeps/data/suite", pairs=("_H1", "_H2"))
    Suite('sweeps/data/suite': 4 pairs: rock-far, rock-near, soft-far, stiff-pulse)
    """
    reading = Reading(units, interval, baseline, gaps, implausible, format, channel)
    return suite_in(Path(), paths, pairs, reading, vertical)


def suite_in(
    folder: Path,
    paths: Any,
    pairs: Sequence[str] | None,
    reading: Reading,
    vertical: Vertical = "leave_out",
) -> Suite:
    """Return the suite of `read_suite` from paths that are relative to a folder.

    The name of the folder itself is not read as a pattern.
    """
    check_choice("vertical", vertical, get_args(Vertical))
    sources = _sources(paths, folder)
    files = [part for part in dict.fromkeys(chain.from_iterable(sources)) if isinstance(part, Path)]
    # files that are vertical by their names need not be read
    marks = {file: vertical_mark("", file) for file in files} if vertical == "leave_out" else {}
    records = _read([file for file in files if not marks.get(file)], reading)
    if vertical == "leave_out":
        marks |= {file: record.attrs.get("record_vertical") for file, record in records.items()}
    left_out = {file: f"{file.name} ({mark})" for file, mark in marks.items() if mark}
    sources = _horizontal(sources, left_out)
    sources, labels = (sources, ()) if pairs is None else _paired(sources, pairs)
    parts_of_motions = [
        [part if isinstance(part, Record) else records[part] for part in source]
        for source in sources
    ]
    motions = tuple(Pair(*parts) if len(parts) == 2 else parts[0] for parts in parts_of_motions)
    entry = paths[0] if isinstance(paths, (list, tuple)) and len(paths) == 1 else paths
    name = str(entry) if isinstance(entry, (str, Path)) else "suite"
    return Suite(motions, labels, name, tuple(left_out.values()))


def _read(files: Sequence[Path], reading: Reading) -> dict[Path, Record]:
    """Return the records in files (InputError: all files that hold none, with the reasons)."""
    records = dict[Path, Record]()
    reasons = dict[Path, str]()
    for file in files:
        try:
            records[file] = read_record(file, **reading.options)
        except InputError as error:
            reasons[file] = str(error)
    if reasons:
        names = ", ".join(file.name for file in reasons)
        refused = InputError(
            f"{len(reasons)} of {len(reasons) + len(records)} files cannot be read: {names}"
        )
        for reason in reasons.values():
            refused.add_note(reason)
        raise refused
    return records


def _horizontal(sources: list[_Source], vertical: Mapping[Path, str]) -> list[_Source]:
    """Return sources without vertical components (InputError: a pair has one; none is left)."""
    kept = [source for source in sources if not any(part in vertical for part in source)]
    names = ", ".join(vertical.values())
    advice = "vertical = 'accept' takes them"
    if any(len(source) == 2 and source not in kept for source in sources):
        raise InputError(f"paths: vertical components in pairs: {names}; {advice}")
    if not kept:
        raise InputError(f"paths: vertical components only: {names}; {advice}")
    return kept


def _components(motion: Motion) -> tuple[Record, ...]:
    """Return the two components of a pair, or the record alone."""
    return (motion.first, motion.second) if isinstance(motion, Pair) else (motion,)


def _sources(paths: Any, folder: Path) -> list[_Source]:
    """Return the files and Records that entries name, each once."""
    what = "files, folders, patterns, pairs of files or Records"
    parts = (str, Path, Record)
    sources = list[_Source]()
    for entry in (
        [paths]
        if isinstance(paths, (str, Path, Record, Pair))
        else check_list("paths", paths, what)
    ):
        if isinstance(entry, (Record, Pair)):
            sources.append(_components(entry))
        elif isinstance(entry, (str, Path)):
            sources += [(file,) for file in _matching(folder, entry) if (file,) not in sources]
        elif (
            isinstance(entry, (list, tuple))
            and len(entry) == sum(isinstance(part, parts) for part in entry) == 2
        ):
            sources.append(
                tuple(part if isinstance(part, Record) else folder / part for part in entry)
            )
        else:
            raise InputError(f"paths: {shown(entry)}: must be one of {what}")
    if not sources:
        raise InputError("paths = []: must name one motion at least")
    return sources


def _matching(folder: Path, entry: str | Path) -> list[Path]:
    path = folder / entry
    pattern = str(entry)
    if path.is_dir():
        pattern = f"{glob.escape(pattern)}/*"
    elif path.exists() or not glob.has_magic(pattern):
        return [path]
    names = glob.iglob(pattern, root_dir=folder, recursive=True)
    if not (files := sorted(file for name in names if (file := folder / name).is_file())):
        what = "a folder without files" if path.is_dir() else "no file fits this pattern"
        raise InputError(f"paths: {entry}: {what}")
    return files


def _paired(
    sources: Sequence[_Source], endings: Sequence[str]
) -> tuple[list[_Source], tuple[str, ...]]:
    """Return pairs of files, and their labels: the common beginnings of their names."""
    entries = check_list("pairs", endings, "two endings of names")
    texts = [entry for entry in entries if isinstance(entry, str) and entry]
    if len(texts) != len(endings) or len({*texts}) != 2:
        raise InputError(
            f"pairs = {shown(endings)}: must be two different endings of names, such as "
            "('_NS', '_EW')"
        )
    first, second = texts
    parts = list(chain.from_iterable(sources))
    stems = {
        part: part.stem.removesuffix(first)
        for part in parts
        if isinstance(part, Path) and part.stem.endswith(first)
    }
    pairs: list[_Source] = [
        (file, file.with_name(stem + second + file.suffix)) for file, stem in stems.items()
    ]
    paired = {part for pair in pairs if {*pair} <= {*parts} for part in pair}
    if incomplete := ", ".join(part.name for part in parts if part not in paired):
        raise InputError(f"pairs = {shown(endings)}: without the other component: {incomplete}")
    names = [file.with_name(stem.rstrip("_-. ") or file.stem) for file, stem in stems.items()]
    return pairs, tuple(_labels(names))


def _labels(paths: Sequence[Path]) -> Iterator[str]:
    """Yield labels of files: stems; where stems are equal folder and name; a number if need be."""
    stems = Counter(path.stem for path in paths)
    seen = Counter[str]()
    for path in paths:
        label = "/".join(path.parts[-2:]) if stems[path.stem] > 1 else path.stem.strip() or "motion"
        seen[label] += 1
        yield f"{label} ({seen[label]})" if seen[label] > 1 else label
