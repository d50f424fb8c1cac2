"""Recorded motions in files of results: written with them, and read back to repeat a run when their files are gone.

A record lies along a dimension of its own, its samples; of a suite the samples of one record follow
those of the other, and what is said of each, the number of its samples among that, lies along a
second dimension.
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

#: What is written of each record of a suite, beside how it was read.
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

#: The attribute of a record that each variable holds: of the same name but for two.
_ATTRIBUTES = {name: name for name in _ABOUT} | {
    "record_file": "record",
    "record_baseline": "baseline",
}


def embedded(motion: Record | Suite) -> dict[str, xr.Variable]:
    """The variables that hold a record or a suite."""
    records = motion.components if isinstance(motion, Suite) else (motion,)
    samples = np.concatenate([(one.times, one.acceleration) for one in records], axis=1)
    described = zip(RECORD_SAMPLES.items(), samples, strict=True)
    found = {name: xr.Variable((RECORD_DIM,), values, about) for (name, about), values in described}
    if isinstance(motion, Record):
        return found
    each = 2 if motion.has_pairs else 1
    columns: dict[str, NDArray[Any]] = {
        _LABEL: np.repeat(np.array(motion.labels, dtype=object), each),
        _COUNT: np.array([one.times.size for one in records], np.int32),
    }
    if motion.has_pairs:
        columns[_COMPONENT] = np.tile(np.array([1, 2], np.int8), len(motion))
    for name, key in _ATTRIBUTES.items():
        texts = [one.attrs.get(key, "") for one in records]
        if name not in columns and any(texts):
            columns[name] = np.array(texts, dtype=object)
    return found | {
        name: xr.Variable((SUITE_DIM,), values, _ABOUT[name]) for name, values in columns.items()
    }


def read_embedded(file: xr.Dataset, path: Path) -> Record | Suite | None:
    """The motion that a result holds, if it holds one (InputError: it is none, another program has changed it)."""
    if any(name not in file for name in RECORD_SAMPLES):
        return None
    times, acceleration = (file[name].values.astype(np.float64) for name in RECORD_SAMPLES)
    about = {
        key: str(text)
        for key, text in file.attrs.items()
        if key == "baseline" or key.startswith("record")
    }
    name = about.get("record", str(path))
    try:
        return (
            _suite(file, times, acceleration)
            if _COUNT in file
            else Record(times, acceleration, name, about)
        )
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
    for at, own in enumerate(
        zip(np.split(times, ends[:-1]), np.split(acceleration, ends[:-1]), strict=True)
    ):
        attrs = {key: texts[at] for key, texts in columns.items() if texts[at]}
        records.append(Record(*own, attrs.get("record", labels[at]), attrs))
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
    """Digest of the samples and labels of motions, by which a run to be resumed knows them."""
    found = embedded(motion)
    values = [
        found[name].values
        for name in (*RECORD_SAMPLES, _COUNT, _COMPONENT, _LABEL)
        if name in found
    ]
    parts = [one.tobytes() if one.dtype != object else "\0".join(one).encode() for one in values]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()
