"""Options of commands made from what is declared once (`slipsweep.model.choices`)."""

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

from slipsweep.cli.common import BLOCK, RARE, SHAKING
from slipsweep.errors import InputError
from slipsweep.model.choices import Family, Option, declared
from slipsweep.motion.reading import Reading

#: The group of the options of a choice, by what names it on the command line.
PANELS = {"waveform": SHAKING, "model": BLOCK}


def option_name(text: str) -> str:
    """An option as it is typed: ``--ramp-in`` for ``ramp_in``, also in a sum of several; what follows stays."""
    words = text.split(" ")
    for at in range(0, len(words), 2):
        words[at] = "--" + words[at].replace("_", "-")
        if words[at + 1 : at + 2] != ["+"]:
            break
    return " ".join(words)


def chooses(**families: Family[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of families, and hand it the choices made, by the names of its parameters.

    Of a family whose parameter has a default there may be none: the command is handed the default then.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        def made(given: dict[str, Any], parameter: str) -> Any:
            family = families[parameter]
            name = given.pop(family.attribute)
            options = _given(given, family.options)
            if name is None and not options:
                return None
            return family.made(
                name or family.default, options, lambda text: option_name(text.replace(family.key, family.attribute, 1))
            )

        parameters = {}
        for name, family in families.items():
            needed = inspect.signature(command).parameters[name].default is inspect.Parameter.empty
            parameters[name] = _family_parameters(family, family.default if needed else None)
        return _replaced(command, parameters, made)

    return decorate


def reads_record(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `Reading` in the place of its parameter `reading`, and hand it those typed."""
    options = {one.name: one for one in declared(Reading)}

    def made(given: dict[str, Any], parameter: str) -> Any:
        typed = _given(given, options)
        try:
            Reading(**typed)
        except InputError as error:
            raise InputError(option_name(str(error))) from None
        return typed

    return _replaced(command, {"reading": [_parameter(one) for one in options.values()]}, made)


def _given(given: dict[str, Any], options: Mapping[str, Option]) -> dict[str, Any]:
    """Take the options that were typed, lists as lists."""
    typed = {name: given.pop(name) for name in options}
    return {
        name: [_number(name, part) for part in value.split(",")] if options[name].is_list else value
        for name, value in typed.items()
        if value is not None
    }


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option_name(name)} {text}: must be numbers with commas between") from None


def _replaced(
    command: Callable[..., None],
    parameters: Mapping[str, list[inspect.Parameter]],
    made: Callable[[dict[str, Any], str], Any],
) -> Callable[..., None]:
    """A command whose parameters of some names are replaced by others, from which theirs are made."""
    signature = inspect.signature(command)

    @functools.wraps(command)
    def wrapped(**given: Any) -> None:
        command(**{name: made(given, name) for name in parameters}, **given)

    taken = [new for old in signature.parameters.values() for new in parameters.get(old.name, [old])]
    wrapped.__signature__ = signature.replace(parameters=taken)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {one.name: one.annotation for one in taken} | {"return": None}
    del wrapped.__wrapped__
    return wrapped


def _family_parameters(family: Family[Any], default: str | None) -> list[inspect.Parameter]:
    """Which choice, and the options of all."""
    names = Literal[tuple(family.names)]  # type: ignore[valid-type]
    note = "" if default else f" (default: {family.default})"
    words = ", ".join(family.names)
    about = PANELS[family.attribute](
        f"{family.keyword.capitalize()}: {words}{note}.", f"--{family.attribute}", metavar="NAME"
    )
    kind: Any = Annotated[names if default else names | None, about]
    first = inspect.Parameter(family.attribute, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
    return [first, *(_parameter(one, family) for one in family.options.values())]


def _parameter(one: Option, family: Family[Any] | None = None) -> inspect.Parameter:
    """An option of a command; None where it is not typed.  Those that some choices only have are rare ones."""
    kind: Any = Literal[one.words] if one.words else str if one.is_list else one.kind
    notes = []
    panel = RARE
    if family is not None:
        of = [choice.name for choice in family.choices if one.name in {o.name for o in declared(choice)}]
        if len(of) == len(family.choices):
            panel = PANELS[family.attribute]
        else:
            notes.append(f"with {', '.join(of)}")
    if one.default is not None and not one.is_list:
        notes.append(f"default: {one.default}")
    noted = f" ({'; '.join(notes)})" if notes else ""
    text = f"{one.about[0].upper()}{one.about[1:]}{noted}."
    about = panel(text, option_name(one.name), metavar="A,B,..." if one.is_list else None)
    return inspect.Parameter(
        one.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[kind | None, about]
    )
