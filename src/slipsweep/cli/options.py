"""Options of commands made from what is declared once (`slipsweep.model.choices`)."""

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

from slipsweep.cli.common import BLOCK, RARE, SHAKING
from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, Option, declared

#: The group of the options of a choice, by what names it on the command line.
_PANELS = {"waveform": SHAKING, "model": BLOCK}


def option_name(text: str) -> str:
    """An option as it is typed: ``--ramp-in`` for ``ramp_in``, also in a sum of several; what follows stays."""
    words = text.split(" ")
    for at in range(0, len(words), 2):
        words[at] = "--" + words[at].replace("_", "-")
        if words[at + 1 : at + 2] != ["+"]:
            break
    return " ".join(words)


def chooses(**choices: Family[Any] | type[Choice]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace parameters of a command by the options that are declared for them.

    The command gets the choice made of a family, or None if its parameter may be and none of the options was typed; of
    a single choice (`Reading`) the options typed, by name.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command)

        @functools.wraps(command)
        def wrapped(**given: Any) -> None:
            command(**{name: _made(given, choice) for name, choice in choices.items()}, **given)

        parameters: list[inspect.Parameter] = []
        for old in signature.parameters.values():
            choice = choices.get(old.name)
            if choice is None:
                parameters.append(old)
            elif isinstance(choice, Family):
                needed = old.default is inspect.Parameter.empty
                parameters += _family_parameters(choice, choice.default if needed else None)
            else:
                parameters += [_parameter(one) for one in declared(choice)]
        wrapped.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        wrapped.__annotations__ = {one.name: one.annotation for one in parameters} | {"return": None}
        del wrapped.__wrapped__
        return wrapped

    return decorate


def _made(given: dict[str, Any], choice: Family[Any] | type[Choice]) -> Any:
    """What a command gets for a choice; its options are taken from those given."""
    if not isinstance(choice, Family):
        typed = _typed(given, {one.name: one for one in declared(choice)})
        try:
            choice(**typed)
        except InputError as error:
            raise InputError(option_name(str(error))) from None
        return typed
    name = given.pop(choice.attribute)
    typed = _typed(given, choice.options)
    if name is None and not typed:
        return None
    return choice.made(
        name or choice.default, typed, lambda text: option_name(text.replace(choice.key, choice.attribute, 1))
    )


def _typed(given: dict[str, Any], options: Mapping[str, Option]) -> dict[str, Any]:
    """Take the options that were typed, lists as lists."""
    found = {name: value for name in options if (value := given.pop(name)) is not None}
    for name in found:
        if options[name].is_list:
            try:
                found[name] = [float(one) for one in found[name].split(",")]
            except ValueError:
                message = f"{option_name(name)} {found[name]}: must be numbers with commas between"
                raise InputError(message) from None
    return found


def _family_parameters(family: Family[Any], default: str | None) -> list[inspect.Parameter]:
    """Which choice, and the options of all."""
    names = Literal[tuple(family.names)]  # type: ignore[valid-type]
    note = "" if default else f" (default: {family.default})"
    about = _PANELS[family.attribute](
        f"{family.keyword.capitalize()}: {', '.join(family.names)}{note}.", f"--{family.attribute}", metavar="NAME"
    )
    kind: Any = Annotated[names if default else names | None, about]
    first = inspect.Parameter(family.attribute, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
    return [first, *(_parameter(one, family) for one in family.options.values())]


def _parameter(one: Option, family: Family[Any] | None = None) -> inspect.Parameter:
    """An option of a command; None where it is not typed.  Those that some choices only have are rare ones."""
    kind: Any = Literal[one.words] if one.words else str if one.is_list else one.kind
    notes, panel = [], RARE
    if family is not None:
        of = [choice.name for choice in family.choices if one.name in {other.name for other in declared(choice)}]
        if len(of) == len(family.choices):
            panel = _PANELS[family.attribute]
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
