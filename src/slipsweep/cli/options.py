"""The program, and options of its commands: shared ones, and those made from declarations.

Options of parameters come from `model/parameter_table.py`, options of models, excitations and
solvers from the classes of these choices.
"""

import functools
import inspect
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, Option, declared
from slipsweep.model.parameter_table import PARAMETER_TABLE, Parameter
from slipsweep.model.parameters import check_values
from slipsweep.model.units import quantity

#: Largest displacement, m, that is accepted without a unit: a larger number is probably meant in
#: millimetres.
_MOST_WITHOUT_UNIT = 2.0

#: The program, to which each command adds itself.
app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]}, pretty_exceptions_enable=False
)


class Panel(str):
    """Name of a group of options in the help of a command; a call declares an option."""

    def __call__(self, about: str, metavar: str | None = None, *names: str, **more: Any) -> Any:
        """Return an option of the group; `names` and `more` are further arguments of typer."""
        return typer.Option(
            *names, help=about.replace("[", r"\["), metavar=metavar, rich_help_panel=self, **more
        )


SHAKING = Panel("Shaking")
BLOCK = Panel("Block")
OUTPUT = Panel("Output")
LARGE = Panel("Large runs")
RARE = Panel("Rare options")


def read(metavar: str, about: str) -> Any:
    """Return the argument for the file that a command reads."""
    return typer.Argument(metavar=metavar, help=about.replace("[", r"\["))


def written(about: str, metavar: str = "FILE") -> Any:
    """Return the option for the file that a command writes."""
    return OUTPUT(about, metavar, "--output", "-o")


Text = str | None
Texts = list[str] | None
File = Path | None
Paths = list[Path] | None


def parameter_option(row: Parameter) -> Any:
    """Return the option of a parameter of the table; one with a unit is typed as text."""
    return Panel(row.panel)(row.option or "", None if row.units == "1" else "VALUE")


def _parameter_type(row: Parameter) -> Any:
    """Return the type of the option of a parameter, None if it is not typed."""
    if row.units != "1":
        return Text
    return float | None if row.single_type == "float" else int | None


_ROWS = {row.name: row for row in PARAMETER_TABLE if row.option}

#: Options of all parameters of the table, as a dataclass that `command` takes apart.
ParameterOptions = make_dataclass(
    "ParameterOptions",
    [
        (row.name, Annotated[_parameter_type(row), parameter_option(row)], None)
        for row in _ROWS.values()
    ],
    frozen=True,
)

THETA = parameter_option(_ROWS["theta"])
MuS = Annotated[float | None, parameter_option(_ROWS["mu_s"])]
Phi = Annotated[Text, parameter_option(_ROWS["phi"])]
Overwrite = Annotated[bool, OUTPUT("Replace an output that exists.", None, "--overwrite")]
Quiet = Annotated[bool, OUTPUT("No progress and no summary.", None, "--quiet", "-q")]
Swept = Annotated[Path, read("OUT.nc", 'A result of "slipsweep run".')]
Result = Annotated[str, read("OUT.nc|OUT.zarr", "A file that slipsweep wrote.")]

#: The option ``-d``.
LENGTH = Panel("Displacement")(
    "Tolerable, or to be exceeded: 50mm, 0.05 (m); may be repeated.",
    "LENGTH",
    "--displacement",
    "-d",
)
PUBLISHED = Panel("Published equations")
_BESIDE = "Published equations beside: jibson-2007,bray-travasarou-2007 (docs/published.md)."
Equations = Annotated[Text, PUBLISHED(_BESIDE, "NAME,...")]
Magnitude = Annotated[
    float | None, PUBLISHED("Moment magnitude, for the equations that need it.", "M")
]
_AT = (
    "Values of an axis: theta=12, amplitude=0.1g,0.2g, case=LABEL (default: all); may be repeated."
)
At = Annotated[Texts, Panel("Selection")(_AT, "NAME=VALUE")]


@dataclass(frozen=True)
class Large:
    """Options of commands that may run for hours."""

    overwrite: Overwrite = False
    quiet: Quiet = False
    resume: Annotated[
        bool, LARGE("Continue an interrupted run from its finished chunks.", None, "--resume")
    ] = False
    memory: Annotated[
        Text, LARGE("Memory limit: 512MiB, 2GB (default: 500 to 600 MB).", "SIZE")
    ] = None
    workers: Annotated[
        int | None, LARGE("Solve on N processes of this machine (extra [cluster]).", "N")
    ] = None
    scheduler: Annotated[
        Text, LARGE("Solve on the workers of the dask scheduler at HOST:PORT.", "ADDRESS")
    ] = None


def cuts(texts: Sequence[str] | None) -> dict[str, str]:
    """Return the names and values that were typed with ``--at``."""
    values: dict[str, str] = {}
    for text in texts or ():
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value):
            raise InputError(f"--at {text}: must be NAME=VALUE, as in --at theta=12")
        if name in values:
            raise InputError(f"--at {text}: {name} is given twice")
        values[name] = value
    return values


def displacements(texts: Sequence[str], g: float) -> list[float]:
    """Return the displacements of ``-d``, m, increasing and each once.

    InputError: a number has no unit, and is too large to be in m.
    """
    lengths = set()
    for text in map(str.strip, texts):
        length = quantity("--displacement", text, "m", g)
        if length > _MOST_WITHOUT_UNIT and not text[-1].isalpha():
            units = f"give the unit: -d {text}mm or -d {text}m"
            raise InputError(
                f"--displacement = {text}: without a unit that is {length:g} m; {units}"
            )
        lengths.add(length)
    values = check_values("displacement", sorted(lengths), "--displacement")
    return [float(value) for value in values]


def compared(equations: str | None, magnitude: float | None) -> tuple[str, ...]:
    """Return the published equations that were typed (InputError: an unknown one, or none)."""
    if magnitude is not None and equations is None:
        raise InputError(f"--magnitude {magnitude:g}: only with --equations")
    if equations is None:
        return ()
    from slipsweep.published import check_equations  # needs NumPy, which `--help` does not load

    return check_equations(equations)


def in_own_units(typed: Mapping[str, Any], g: float) -> dict[str, Any]:
    """Return the parameters that were typed as text, as numbers in their own units."""
    return {
        row.name: quantity(option_name(row.name), text, row.units, g)
        for row in PARAMETER_TABLE
        if isinstance(text := typed.get(row.name), str)
    }


def option_name(text: str) -> str:
    """Return a text that begins with the name of an option as it is typed.

    ``ramp_in + ramp_out = 3: …`` becomes ``--ramp-in + --ramp-out = 3: …``.
    """
    names = re.compile(r"\w+( \+ \w+)*")
    return names.sub(
        lambda match: "--" + match[0].replace("_", "-").replace("+ ", "+ --"), text, count=1
    )


def command(task: str, *examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a function: add it to the program as a command of the group `task`.

    The examples stand below the help.  A parameter that is annotated with a family, a choice or
    another dataclass stands for the options that these declare.  The function gets

    - for a family the choice, or None if the default is None and no option was typed;
    - for a choice (`Reading`) the options that were typed, by name;
    - for another dataclass, whose annotations are options of typer, an object of it.
    """

    def add(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function, assigned=("__module__", "__name__", "__doc__"))
        def run(**typed: Any) -> None:
            _check_named(typed.get("output"))
            function(**{name: _made(typed, choice) for name, choice in choices.items()}, **typed)

        parameters = inspect.signature(function).parameters
        kinds = {
            name: (get_args(parameter.annotation) or (parameter.annotation,))[-1]
            for name, parameter in parameters.items()
        }
        choices = {name: kind for name, kind in kinds.items() if isinstance(kind, Family | type)}
        expanded = (
            _options(choices[name], parameter.default) if name in choices else [parameter]
            for name, parameter in parameters.items()
        )
        signature = inspect.Signature([*itertools.chain(*expanded)])
        run.__signature__ = signature  # type: ignore[attr-defined]
        app.command(rich_help_panel=task, epilog="\n\n".join(("Examples:", *examples)))(run)
        return function

    return add


def _check_named(output: Any) -> None:
    """Raise InputError if an output has no name."""
    for path in output if isinstance(output, list) else [output]:
        if path is not None and str(path) in ("", "."):
            raise InputError("--output: must be the name of a file; is empty or the current folder")


def _made(typed: dict[str, Any], choice: Family[Any] | type[Any]) -> Any:
    """Return the argument of a command for a choice, and take its options out of `typed`."""
    if isinstance(choice, Family):
        name = typed.pop(choice.attribute)
        chosen_options = _typed(typed, choice.options)
        if name is None and not chosen_options:
            return None
        return choice.made(
            name or choice.default,
            chosen_options,
            lambda text: option_name(text.replace(choice.key, choice.attribute, 1)),
        )
    if not issubclass(choice, Choice):
        return choice(**{name: typed.pop(name) for name in inspect.signature(choice).parameters})
    chosen_options = _typed(typed, {option.name: option for option in declared(choice)})
    try:
        choice(**chosen_options)
    except InputError as error:
        raise InputError(option_name(str(error))) from None
    return chosen_options


def _typed(typed: dict[str, Any], options: Mapping[str, Option]) -> dict[str, Any]:
    """Return the options that were typed, lists as lists, and take them out of `typed`."""
    values = {name: value for name in options if (value := typed.pop(name)) is not None}
    for name in (name for name in values if options[name].is_list):
        try:
            values[name] = [float(number) for number in values[name].split(",")]
        except ValueError:
            raise InputError(
                f"{option_name(name)} {values[name]}: must be numbers with commas between"
            ) from None
    return values


def _options(choice: Family[Any] | type[Any], default: Any) -> list[inspect.Parameter]:
    """Return the options of a choice; a family has first the option that names one."""
    if not isinstance(choice, Family):
        if issubclass(choice, Choice):
            return [_declared(option, RARE) for option in declared(choice)]
        return [
            option.replace(kind=option.KEYWORD_ONLY)
            for option in inspect.signature(choice).parameters.values()
        ]
    panel = SHAKING if choice.attribute == "waveform" else BLOCK
    names: Any = Literal[tuple(choice.names)]
    note = f" (default: {choice.default})" if default is None else ""
    first = None if default is None else choice.default
    about = panel(
        f"{choice.keyword.capitalize()}: {', '.join(choice.names)}{note}.",
        "NAME",
        f"--{choice.attribute}",
    )
    options = [
        _parameter(choice.attribute, annotation=Annotated[names | None, about], default=first)
    ]
    for name, option in choice.options.items():
        of = choice.having(name)
        every = len(of) == len(choice.choices)
        options.append(
            _declared(option, panel) if every else _declared(option, RARE, f"with {', '.join(of)}")
        )
    return options


def _declared(option: Option, panel: Panel, *notes: str) -> inspect.Parameter:
    """Return the option of the command line for an option of a choice; None if it is not typed."""
    kind: Any = Literal[option.words] if option.words else str if option.is_list else option.kind
    if option.default is not None and not option.is_list:
        notes += (f"default: {option.default}",)
    noted = f" ({'; '.join(notes)})" if notes else ""
    text = f"{option.about[0].upper()}{option.about[1:]}{noted}."
    typed = panel(text, "A,B,..." if option.is_list else None, option_name(option.name))
    return _parameter(option.name, annotation=Annotated[kind | None, typed], default=None)


_parameter = functools.partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY)
