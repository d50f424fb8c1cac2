"""Text of shared parameters, inserted into the docstrings of the functions that take them."""

import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

from slipsweep.model.parameter_table import PARAMETER_TABLE

Function = TypeVar("Function", bound=Callable[..., Any])

#: Width of the text in a docstring, at its indentation.
_WIDTH = 92

_HEADING = "Parameters\n----------\n"
_NEXT_HEADING = "Returns\n-------\n"


class Argument(NamedTuple):
    """An argument that is no parameter of the table: its type and its text."""

    type: str
    text: str


#: Arguments that several functions take with the same meaning.
SHARED_ARGUMENTS = {
    "excitation": Argument(
        "Sine, Cosine, Triangle, Square, Harmonics, Record, Suite or str",
        'Motion of the base; "sine", "cosine", "triangle" and "square" are ten cycles without '
        "ramps.  All that is written about a record holds for each motion of a suite.",
    ),
    "model": Argument(
        "Mendez, Newmark or str",
        'The paper\'s friction law, or the classical rigid block; "mendez", "newmark".',
    ),
    "solver": Argument(
        "Cycle, Step or str",
        'Event by event, exact to rounding, or time stepping; "auto" takes "cycle", but for a '
        'block whose strength changes ``Step("simpson", 512)``.',
    ),
}

_ROWS = {row.name: row for row in PARAMETER_TABLE}


def with_parameters(function: Function) -> Function:
    """Decorate a function: complete the section "Parameters" of its numpydoc docstring.

    The docstring in the source describes only what this function alone takes.  The text of
    parameters in `PARAMETER_TABLE`, and of `SHARED_ARGUMENTS` that the docstring does not describe
    itself, is inserted.  The section then has all parameters in the order of the signature.  The
    docstring must have a section "Returns".
    """
    docstring = inspect.cleandoc(function.__doc__ or "")
    before, _, after = docstring.partition(_NEXT_HEADING)
    summary, _, section = before.partition(_HEADING)
    described = dict(_entries(section))
    entries = []
    for parameter in inspect.signature(function).parameters.values():
        if parameter.name in _ROWS:
            entries.append(_entry_of_row(parameter))
        elif parameter.name in described:
            entries.append(described[parameter.name])
        elif parameter.name in SHARED_ARGUMENTS:
            argument = SHARED_ARGUMENTS[parameter.name]
            entries.append(_entry(parameter.name, argument.type, argument.text))
    function.__doc__ = f"{summary}{_HEADING}{''.join(entries)}\n{_NEXT_HEADING}{after}\n"
    return function


def _entries(section: str) -> Iterator[tuple[str, str]]:
    """Yield the first name of each entry of a section, and the lines of the entry."""
    for lines in re.split(r"^(?=\S)", section.strip("\n"), flags=re.MULTILINE):
        if lines:
            yield re.split(r"[ ,]", lines, maxsplit=1)[0], lines.rstrip("\n") + "\n"


def _entry_of_row(parameter: inspect.Parameter) -> str:
    """Return the entry of a parameter of the table, whose type depends on its annotation."""
    row = _ROWS[parameter.name]
    is_single = parameter.annotation in (float, int, float | None, int | None)
    type_text = row.single_type if is_single else row.type
    optional = ", optional" if parameter.default is None else ""
    return _entry(row.name, f"{type_text}{optional}", row.text)


def _entry(name: str, type_text: str, text: str) -> str:
    """Return the lines of an entry."""
    filled = textwrap.fill(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return f"{name} : {type_text}\n{textwrap.indent(filled, '    ')}\n"
