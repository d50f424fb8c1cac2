"""Files of columns that have names and units in their first line: tests on a shaking table, hazard curves."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown


@dataclass(frozen=True)
class Columns:
    """What such a file holds.

    Attributes
    ----------
    path : Path
    number : int
        Of the line of names.
    names : list of str
    body : list of (int, str)
        The other lines and their numbers.
    separator : str
    """

    path: Path
    number: int
    names: list[str]
    body: list[tuple[int, str]]
    separator: str

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The number and the cells of each line (InputError: not as many as there are names)."""
        for number, line in self.body:
            cells = [cell.strip() for cell in line.split(self.separator)]
            if len(cells) != len(self.names):
                raise InputError(
                    f"{self.path}: line {number}: {len(cells)} cells, where {len(self.names)} columns are named"
                )
            yield number, cells

    def value(self, number: int, cell: str, what: str) -> float:
        """A cell of a line as a number, with a decimal point or comma (InputError: it is none)."""
        try:
            return float(cell if self.separator == "," else cell.replace(",", "."))
        except ValueError:
            raise InputError(f"{self.path}: line {number}: {what} = {shown(cell)}: must be a number") from None


def columns_of(path: Path, lines: Sequence[str], without: str) -> Columns:
    """Take lines apart: the first that is not blank and does not begin with ``#`` names the columns.

    Separators are tabs, semicolons or commas: the first of these that is in the line of names.

    Raises
    ------
    InputError
        There is no line of names: `without` says so.
    """
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not rows:
        raise InputError(f"{path}: {without}")
    (number, header), *body = rows
    separator = next((one for one in ("\t", ";", ",") if one in header), ",")
    return Columns(path, number, [cell.strip() for cell in header.split(separator)], body, separator)


def words_and_unit(name: str) -> tuple[set[str], str]:
    """The words of a column's name, and the unit in brackets behind them, if there is one."""
    matched = re.fullmatch(r"(.*?)\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*", name.strip('"'))
    text, unit = (matched[1], matched[2]) if matched else (name.strip('"'), "")
    return {*re.split(r"[\s_\-]+", text.lower())}, unit
