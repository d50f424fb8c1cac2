"""Recorded motions in files of results, from which a run is repeated when their own files are gone.

The samples of a record lie along a dimension of their own.  In a suite the samples of one record
follow those of the one before.  The label of each record, the number of its samples and its other
attributes lie along a second dimension.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.variables import RECORD_SAMPLES
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Pair, Suite

#: Dimension of the samples of records, and of the records of a suite.
RECORD_DIM = "record_sample"
SUITE_DIM = "record"

#: Variables for each record of a suite, beside those that say how it was read.
_LABEL = "record_label"
_COUNT = "record_count"
_COMPONENT = "record_component"

_ABOUT: dict[str, dict[str, Any]] = {
    _LABEL: {"long_name": "label of the motion of a record"},
    _COUNT: {
        "units": "1",
        "long_name": f"number of samples of a record, which follow one another along {RECORD_DIM}",
    },
    _COMPONENT: {
        "units": "1",
        "long_name": "horizontal component of the motion, 1 at azimuth 0 and 2 at 90 degrees",
    },
    "record_file": {"long_name": "file of a record"},
    "record_format": {"long_name": "format of the file of a record"},
    "record_units": {"long_name": "unit of the file of a record"},
    "record_channel": {"long_name": "channel of the file of a record"},
    "record_sha256": {"long_name": "SHA-256 of the file of a record"},
    "record_accepted": {
        "long_name": "what is missing or implausible in a record, and was accepted"
    },
    "record_caution": {"long_name": "what may be wrong with a record"},
    "record_vertical": {"long_name": "what says that a record is a vertical component"},
    "record_baseline": {"long_name": "what was taken off a record"},
}

#: Attribute of a record that each variable holds; two names differ.
_ATTRIBUTES = {name: name for name in _ABOUT} | {
    "record_file": "record",
    "record_baseline": "baseline",
}


def embedded(motion: Record | Suite) -> dict[str, xr.Variable]:
    """Return the variables that hold a record or a suite."""
    records = motion.components if isinstance(motion, Suite) else (motion,)
    samples = np.concatenate([(record.times, record.acceleration) for record in records], axis=1)
    described = zip(RECORD_SAMPLES.items(), samples, strict=True)
    variables = {
        name: xr.Variable((RECORD_DIM,), values, about) for (name, about), values in described
    }
    if isinstance(motion, Record):
        return variables
    each = 2 if motion.has_pairs else 1
    columns: dict[str, NDArray[Any]] = {
        _LABEL: np.repeat(np.array(motion.labels, dtype=object), each),
        _COUNT: np.array([record.times.size for record in records], np.int32),
    }
    if motion.has_pairs:
        columns[_COMPONENT] = np.tile(np.array([1, 2], np.int8), len(motion))
    for name, key in _ATTRIBUTES.items():
        texts = [record.attrs.get(key, "") for record in records]
        if name not in columns and any(texts):
            columns[name] = np.array(texts, dtype=object)
    return variables | {
        name: xr.Variable((SUITE_DIM,), values, _ABOUT[name]) for name, values in columns.items()
    }


def read_embedded(file: xr.Dataset, path: Path) -> Record | Suite | None:
    """Return the motion in a result, or None (InputError: another program has changed it)."""
    if any(name not in file for name in RECORD_SAMPLES):
        return None
    times, acceleration = (file[name].values.astype(np.float64) for name in RECORD_SAMPLES)
    attributes = {
        key: str(text)
        for key, text in file.attrs.items()
        if key == "baseline" or key.startswith("record")
    }
    name = attributes.get("record", str(path))
    try:
        if _COUNT in file:
            return _suite(file, times, acceleration)
        return Record(times, acceleration, name, attributes)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix(f'{name}: ')}") from None


def _suite(file: xr.Dataset, times: NDArray[Any], acceleration: NDArray[Any]) -> Suite:
    counts = file[_COUNT].values.astype(np.int64)
    columns: dict[str, list[str]] = {
        key: [str(text) for text in file[name].values]
        for name, key in _ATTRIBUTES.items()
        if name in file and file[name].dtype.kind in "OU"
    }
    ends = np.cumsum(counts)
    whole = counts.ndim == 1 and counts.size and (counts > 0).all() and ends[-1] == times.size
    if (
        not whole
        or any(len(texts) != counts.size for texts in columns.values())
        or _LABEL not in columns
    ):
        raise InputError(
            f"{_COUNT}, {_LABEL}: are not those of the {times.size} samples of its records"
        )
    labels = columns.pop(_LABEL)
    records = []
    for at, samples in enumerate(
        zip(np.split(times, ends[:-1]), np.split(acceleration, ends[:-1]), strict=True)
    ):
        attrs = {key: texts[at] for key, texts in columns.items() if texts[at]}
        records.append(Record(*samples, attrs.get("record", labels[at]), attrs))
    name = str(file.attrs.get("suite", "suite"))
    text = str(file.attrs.get("left_out_vertical", ""))
    left_out = tuple(text.split(", ")) if text else ()
    if _COMPONENT not in file:
        return Suite(tuple(records), tuple(labels), name, left_out)
    if counts.size % 2:
        raise InputError(f"{_COMPONENT}: {counts.size} components: must be two of each motion")
    pairs = tuple(Pair(*records[at : at + 2]) for at in range(0, len(records), 2))
    return Suite(pairs, tuple(labels[::2]), name, left_out)


def digest_of(motion: Record | Suite) -> str:
    """Digest of the samples and labels of motions, which must agree for a run to be resumed."""
    variables = embedded(motion)
    values = [
        variables[name].values
        for name in (*RECORD_SAMPLES, _COUNT, _COMPONENT, _LABEL)
        if name in variables
    ]
    parts = [
        array.tobytes() if array.dtype != object else "\0".join(array).encode() for array in values
    ]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()
