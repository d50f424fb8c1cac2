"""Files of columns that have names and units in their first line: tests on a shaking table, hazard curves."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown


def read_columns(
    path: Path,
    lines: Sequence[str],
    holds: Callable[[str, set[str], str], tuple[str, float] | None],
    needed: Sequence[str],
    example: str,
) -> dict[str, NDArray[np.float64]]:
    """Columns of numbers, by what they hold and in its unit; a blank cell is NaN.

    The first line that is not blank and does not begin with ``#`` names the columns.  Separators are tabs, semicolons
    or commas: the first of these that is in it.  Commas that do not separate are decimal.

    Parameters
    ----------
    path : Path
        What the file is called in errors.
    lines : sequence of str
    holds : callable
        ``holds(name, words, unit)``: what the column of a name holds, from its words and the unit in brackets behind
        them, and the factor to its unit; None where the column is left out.
    needed : sequence of str
        What there must be.
    example : str
        A line of names, for errors.

    Raises
    ------
    InputError
        A column is missing or there twice, or a cell holds no number: with the number of the line.
    """
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    number, header = rows[0] if rows else (1, "")
    separator = next((one for one in "\t;," if one in header), ",")
    names = [cell.strip(' "') for cell in header.split(separator)]
    columns: dict[str, tuple[int, float]] = {}
    for at, name in enumerate(names):
        text, _, unit = name.replace("[", "(").partition("(")
        found = holds(name, {*re.split(r"[\s_\-]+", text.strip().lower())}, unit.strip(" )]"))
        if found is None:
            continue
        if found[0] in columns:
            raise InputError(f"{path}: line {number}: two columns are {found[0]}: must be one")
        columns[found[0]] = at, found[1]
    for what in needed:
        if what not in columns:
            raise InputError(f"{path}: line {number}: no column {what}: must name its columns, such as {example}")

    values = {what: np.empty(len(rows) - 1) for what in columns}
    for row, (number, line) in enumerate(rows[1:]):
        cells = [(cell if separator == "," else cell.replace(",", ".")).strip() for cell in line.split(separator)]
        if len(cells) != len(names):
            raise InputError(f"{path}: line {number}: {len(cells)} cells, where {len(names)} columns are named")
        for what, (at, factor) in columns.items():
            try:
                values[what][row] = factor * float(cells[at] or "nan")
            except ValueError:
                raise InputError(f"{path}: line {number}: {what} = {shown(cells[at])}: must be a number") from None
    return values
