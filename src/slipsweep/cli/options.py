"""Options of commands made from what is declared once: choices (`slipsweep.model.choices`) and dataclasses."""

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal

from slipsweep.cli.common import BLOCK, RARE, SHAKING
from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, Option, declared

#: The group of the options of a choice, by what names it on the command line.
_PANELS = {"waveform": SHAKING, "model": BLOCK}


def option_name(text: str) -> str:
    """An option as it is typed: ``--ramp-in`` for ``ramp_in``, also in a sum of several; what follows stays."""
    names = re.compile(r"\w+( \+ \w+)*")
    return names.sub(lambda found: "--" + found[0].replace("_", "-").replace("+ ", "+ --"), text, count=1)


def chooses(**choices: Family[Any] | type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace parameters of a command by the options that are declared for them.

    The command gets the choice made of a family, or None if its parameter may be and none of the options was typed; of
    a single choice (`Reading`) the options typed, by name; of another dataclass, whose annotations are options of
    typer, an object.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command)

        @functools.wraps(command)
        def wrapped(**given: Any) -> None:
            command(**{name: _made(given, choice) for name, choice in choices.items()}, **given)

        kinds: dict[str, tuple[Any, Any]] = {}
        for old in signature.parameters.values():
            choice = choices.get(old.name)
            if choice is None:
                kinds[old.name] = old.annotation, old.default
            elif isinstance(choice, Family):
                kinds |= _family_options(choice, choice.default if old.default is inspect.Parameter.empty else None)
            elif issubclass(choice, Choice):
                kinds |= {one.name: (_annotation(one), None) for one in declared(choice)}
            else:
                kinds |= {one.name: (one.type, one.default) for one in fields(choice)}
        wrapped.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
                for name, (kind, default) in kinds.items()
            ]
        )
        wrapped.__annotations__ = {name: kind for name, (kind, _) in kinds.items()} | {"return": None}
        del wrapped.__wrapped__
        return wrapped

    return decorate


def _made(given: dict[str, Any], choice: Family[Any] | type[Any]) -> Any:
    """What a command gets for a choice; its options are taken from those given."""
    if isinstance(choice, Family):
        name, typed = given.pop(choice.attribute), _typed(given, choice.options)
        if name is None and not typed:
            return None
        return choice.made(
            name or choice.default, typed, lambda text: option_name(text.replace(choice.key, choice.attribute, 1))
        )
    if not issubclass(choice, Choice):
        return choice(**{one.name: given.pop(one.name) for one in fields(choice)})
    typed = _typed(given, {one.name: one for one in declared(choice)})
    try:
        choice(**typed)
    except InputError as error:
        raise InputError(option_name(str(error))) from None
    return typed


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


def _family_options(family: Family[Any], default: str | None) -> dict[str, tuple[Any, Any]]:
    """Which choice, and the options of all: annotations and defaults."""
    names = Literal[tuple(family.names)]  # type: ignore[valid-type]
    note = "" if default else f" (default: {family.default})"
    text = f"{family.keyword.capitalize()}: {', '.join(family.names)}{note}."
    about = _PANELS[family.attribute](text, f"--{family.attribute}", metavar="NAME")
    first: Any = Annotated[names if default else names | None, about]
    return {family.attribute: (first, default)} | {
        name: (_annotation(one, family), None) for name, one in family.options.items()
    }


def _annotation(one: Option, family: Family[Any] | None = None) -> Any:
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
    return Annotated[kind | None, panel(text, option_name(one.name), metavar="A,B,..." if one.is_list else None)]
