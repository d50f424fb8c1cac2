"""Text files as lines: numbers in them, fields of a header, columns that have names."""

import hashlib
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slipsweep.errors import InputError
from slipsweep.model.parameter_table import LARGEST
from slipsweep.model.parameters import shown
from slipsweep.motion.foreign import binary_refusal
from slipsweep.motion.intensity import Floats

NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
COUNT = r"(\d{1,9})\b"


class Samples(NamedTuple):
    """Contents of the file of a record."""

    times: Floats  # s
    values: Floats  # accelerations in the file's own unit, NaN where blank
    unit: str | None  # None: the file does not name it
    component: str = ""  # the direction, as the file names it


def read_lines(path: Path) -> tuple[str, list[str]]:
    """Return the SHA-256 of a file, and its lines (InputError: it is not readable as text)."""
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a name that no system has
        raise InputError(
            f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    if refusal := binary_refusal(content):
        raise InputError(f"{path}: {refusal}")
    try:
        text = content.decode("utf-8-sig")  # some editors put a byte-order mark in front
    except UnicodeDecodeError:
        text = content.decode("latin-1")  # old files, for example with m/s²
    return hashlib.sha256(content).hexdigest(), text.splitlines()


def fields_in(header: str, patterns: Mapping[str, str], where: str = "its header") -> list[str]:
    """Return the groups that patterns match in a header.

    InputError: one does not match; the message has its name.
    """
    fields: list[str] = []
    for name, pattern in patterns.items():
        match = re.search(pattern, header, re.MULTILINE | re.IGNORECASE | re.ASCII)
        if match is None:
            raise InputError(
                f"no {name} in {where}, or none that can be read: another format, or damaged"
            )
        fields += match.groups()
    return fields


def numbers_in(
    rows: Iterable[tuple[int, str]],
    cells: Callable[[str], Iterable[str]] = str.split,
    what: str = "numbers",
    where: str = "",
) -> Floats:
    """Return all numbers in the cells of numbered lines, in their order."""
    values: list[float] = []
    for number, line in rows:
        try:
            values.extend(map(float, cells(line)))
        except ValueError:
            raise InputError(f"{where}line {number}: {shown(line)}: must be {what}") from None
    return np.array(values)


def even_times(count: int, interval: float) -> Floats:
    """Return the times of samples at a constant interval, s (InputError: it is not positive)."""
    if not 0.0 < interval <= LARGEST:
        raise InputError(f"sampling interval {interval:g}: must be a finite number > 0")
    return np.arange(count, dtype=np.float64) * interval


def check_count(values: Floats, announced: int) -> None:
    """Raise InputError if there are more or fewer values than a header announces."""
    if values.size != announced:
        raise InputError(
            f"{values.size} accelerations, where its header says {announced}: cut off, or damaged"
        )


def read_columns(
    path: Path,
    lines: list[str],
    holds: Callable[[str, set[str], str], tuple[str, float] | None],
    names: dict[str, str],
) -> dict[str, Floats]:
    """Return columns of numbers, by the quantity that each holds; a blank cell is NaN.

    The first line that is not blank and does not begin with ``#`` names the columns.  The separator
    is the first of tab, semicolon and comma that is in it.  Commas that do not separate are
    decimal.  ``holds(name, words, unit)`` returns the quantity in a column, and the factor to its
    SI unit, from the words of its name and the unit in brackets; None leaves the column out.  The
    quantities in `names` must be there; errors show these names as examples.  InputError: the line,
    and the reason.
    """
    rows = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.startswith("#")
    ]
    number, header = rows[0] if rows else (1, "")
    separator = next((character for character in "\t;," if character in header), ",")
    cells = [cell.strip(' "') for cell in header.split(separator)]
    columns: list[tuple[str, int, float]] = []
    for at, name in enumerate(cells):
        text, _, unit = name.replace("[", "(").partition("(")
        if held := holds(name, {*re.split(r"[\s_\-]+", text.strip().lower())}, unit.strip(" )]")):
            columns.append((held[0], at, held[1]))
    held_names = [what for what, *_ in columns]
    for what in (*names, *held_names):
        if (count := held_names.count(what)) != 1:
            example = ", ".join(names.values())
            raise InputError(
                f"{path}: line {number}: {count} columns of {what}: must be one, as in {example}"
            )

    def chosen(line: str) -> list[str]:
        texts = [text.replace(",", ".").strip() or "nan" for text in line.split(separator)]
        if len(texts) != len(cells):
            raise ValueError
        return [texts[at] for _, at, _ in columns]

    rule = f"{len(cells)} cells, and a number, or nothing, for {', '.join(held_names)}"
    table = numbers_in(rows[1:], chosen, rule, f"{path}: ").reshape(-1, len(columns))
    return {
        what: factor * values for (what, _, factor), values in zip(columns, table.T, strict=True)
    }
