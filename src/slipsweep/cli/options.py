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

#: The largest displacement that a number without a unit is taken for, m: more is likely to be meant
#: in millimetres.
_MOST_WITHOUT_UNIT = 2.0

#: The program, to which each command adds itself.
app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]}, pretty_exceptions_enable=False
)


class Panel(str):
    """The name of a group of options in a command's help; called, it declares one of them."""

    def __call__(self, about: str, metavar: str | None = None, *names: str, **more: Any) -> Any:
        """An option of the group; names where its parameter does not give it, and what else typer takes."""
        return typer.Option(
            *names, help=about.replace("[", r"\["), metavar=metavar, rich_help_panel=self, **more
        )


SHAKING = Panel("Shaking")
BLOCK = Panel("Block")
OUTPUT = Panel("Output")
LARGE = Panel("Large runs")
RARE = Panel("Rare options")  # that few cases need


def read(metavar: str, about: str) -> Any:
    """The argument that names what a command reads."""
    return typer.Argument(metavar=metavar, help=about.replace("[", r"\["))


def written(about: str, metavar: str = "FILE") -> Any:
    """The option that names what a command writes."""
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

#: What ``-d`` declares.
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


def cuts(given: Sequence[str] | None) -> dict[str, str]:
    """Take apart what was typed with ``--at``: names and values."""
    found: dict[str, str] = {}
    for text in given or ():
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value):
            raise InputError(f"--at {text}: must be NAME=VALUE, as in --at theta=12")
        if name in found:
            raise InputError(f"--at {text}: {name} is given twice")
        found[name] = value
    return found


def displacements(texts: Sequence[str], g: float) -> list[float]:
    """Return the displacements given with ``-d``, in m, in order and each once (InputError: its unit is in doubt)."""
    found = set()
    for text in map(str.strip, texts):
        length = quantity("--displacement", text, "m", g)
        if length > _MOST_WITHOUT_UNIT and not text[-1].isalpha():
            units = f"give the unit: -d {text}mm or -d {text}m"
            raise InputError(
                f"--displacement = {text}: without a unit that is {length:g} m; {units}"
            )
        found.add(length)
    values = check_values("displacement", sorted(found), "--displacement")
    return [float(value) for value in values]


def compared(equations: str | None, magnitude: float | None) -> tuple[str, ...]:
    """Return the published equations that were typed (InputError: none such, a magnitude alone)."""
    if magnitude is not None and equations is None:
        raise InputError(f"--magnitude {magnitude:g}: only with --equations")
    if equations is None:
        return ()
    from slipsweep.published import check_equations  # here: it needs NumPy, and `--help` does not

    return check_equations(equations)


def in_own_units(typed: Mapping[str, Any], g: float) -> dict[str, Any]:
    """Return the parameters that were typed as text, as numbers in their own units."""
    return {
        row.name: quantity(option_name(row.name), text, row.units, g)
        for row in PARAMETER_TABLE
        if isinstance(text := typed.get(row.name), str)
    }


def option_name(text: str) -> str:
    """An option as it is typed: ``--ramp-in`` for ``ramp_in``, also in a sum of several; what follows stays."""
    names = re.compile(r"\w+( \+ \w+)*")
    return names.sub(
        lambda found: "--" + found[0].replace("_", "-").replace("+ ", "+ --"), text, count=1
    )


def command(task: str, *examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a command to the program, by what it is for; its examples stand below its help.

    In place of parameters annotated with a family or a dataclass it has the options that these
    declare.  It gets the choice made of a family, or None if its default is None and none of the
    options was typed; of a single choice (`Reading`) the options typed, by name; of another
    dataclass, whose annotations are options of typer, an object.
    """

    def add(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function, assigned=("__module__", "__name__", "__doc__"))
        def run(**typed: Any) -> None:
            _check_named(typed.get("output"))
            function(**{name: _made(typed, choice) for name, choice in choices.items()}, **typed)

        given = inspect.signature(function).parameters
        kinds = {
            name: (get_args(one.annotation) or (one.annotation,))[-1] for name, one in given.items()
        }
        choices = {name: kind for name, kind in kinds.items() if isinstance(kind, Family | type)}
        expanded = (
            _options(choices[name], one.default) if name in choices else [one]
            for name, one in given.items()
        )
        run.__signature__ = inspect.Signature([*itertools.chain(*expanded)])  # type: ignore[attr-defined]
        app.command(rich_help_panel=task, epilog="\n\n".join(("Examples:", *examples)))(run)
        return function

    return add


def _check_named(output: Any) -> None:
    """Refuse outputs without a name."""
    for path in output if isinstance(output, list) else [output]:
        if path is not None and str(path) in ("", "."):
            raise InputError("--output: must be the name of a file; is empty or the current folder")


def _made(given: dict[str, Any], choice: Family[Any] | type[Any]) -> Any:
    """What a command gets for a choice; its options are taken from those given."""
    if isinstance(choice, Family):
        name = given.pop(choice.attribute)
        typed = _typed(given, choice.options)
        if name is None and not typed:
            return None
        return choice.made(
            name or choice.default,
            typed,
            lambda text: option_name(text.replace(choice.key, choice.attribute, 1)),
        )
    if not issubclass(choice, Choice):
        return choice(**{name: given.pop(name) for name in inspect.signature(choice).parameters})
    typed = _typed(given, {one.name: one for one in declared(choice)})
    try:
        choice(**typed)
    except InputError as error:
        raise InputError(option_name(str(error))) from None
    return typed


def _typed(given: dict[str, Any], options: Mapping[str, Option]) -> dict[str, Any]:
    """Take the options that were typed, lists as lists."""
    found = {name: value for name in options if (value := given.pop(name)) is not None}
    for name in (name for name in found if options[name].is_list):
        try:
            found[name] = [float(one) for one in found[name].split(",")]
        except ValueError:
            raise InputError(
                f"{option_name(name)} {found[name]}: must be numbers with commas between"
            ) from None
    return found


def _options(choice: Family[Any] | type[Any], default: Any) -> list[inspect.Parameter]:
    """The options of a choice, of a family first which one."""
    if not isinstance(choice, Family):
        if issubclass(choice, Choice):
            return [_declared(one, RARE) for one in declared(choice)]
        return [
            one.replace(kind=one.KEYWORD_ONLY)
            for one in inspect.signature(choice).parameters.values()
        ]
    panel = SHAKING if choice.attribute == "waveform" else BLOCK
    names: Any = Literal[tuple(choice.names)]
    note, first = (
        (f" (default: {choice.default})", None) if default is None else ("", choice.default)
    )
    about = panel(
        f"{choice.keyword.capitalize()}: {', '.join(choice.names)}{note}.",
        "NAME",
        f"--{choice.attribute}",
    )
    found = [_parameter(choice.attribute, annotation=Annotated[names | None, about], default=first)]
    for name, one in choice.options.items():
        of = choice.having(name)
        every = len(of) == len(choice.choices)
        found.append(
            _declared(one, panel) if every else _declared(one, RARE, f"with {', '.join(of)}")
        )
    return found


def _declared(one: Option, panel: Panel, *notes: str) -> inspect.Parameter:
    """An option of a choice, in a group; None where it is not typed."""
    kind: Any = Literal[one.words] if one.words else str if one.is_list else one.kind
    if one.default is not None and not one.is_list:
        notes += (f"default: {one.default}",)
    noted = f" ({'; '.join(notes)})" if notes else ""
    text = f"{one.about[0].upper()}{one.about[1:]}{noted}."
    typed = panel(text, "A,B,..." if one.is_list else None, option_name(one.name))
    return _parameter(one.name, annotation=Annotated[kind | None, typed], default=None)


_parameter = functools.partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY)
