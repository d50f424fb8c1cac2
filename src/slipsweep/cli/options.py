"""Options of commands made from what is declared once: choices (`slipsweep.model.choices`) and dataclasses."""

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal

from slipsweep.cli.common import BLOCK, RARE, SHAKING, Panel
from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, Option, declared

#: The group of the options of a choice, by what names it on the command line.
_PANELS = {"waveform": SHAKING, "model": BLOCK}


def option_name(text: str) -> str:
    """An option as it is typed: ``--ramp-in`` for ``ramp_in``, also in a sum of several; what follows stays."""
    names = re.compile(r"\w+( \+ \w+)*")
    return names.sub(lambda found: "--" + found[0].replace("_", "-").replace("+ ", "+ --"), text, count=1)


def as_typed(text: str) -> str:
    """A message with options as they are typed: ``--gaps linear`` for ``gaps = 'linear'``."""
    return re.sub(r"\b(\w+) = '([^']*)'", r"--\1 \2", text)


def chooses(**choices: Family[Any] | type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace parameters of a command by the options that are declared for them.

    The command gets the choice made of a family, or None if its parameter may be and none of the options was typed; of
    a single choice (`Reading`) the options typed, by name; of another dataclass, whose annotations are options of
    typer, an object.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        kinds: dict[str, tuple[Any, Any]] = {}
        for name, old in inspect.signature(command).parameters.items():
            kinds |= _options(choices[name], old.default) if name in choices else {name: (old.annotation, old.default)}

        @functools.wraps(command)
        def wrapped(**given: Any) -> None:
            command(**{name: _made(given, choice) for name, choice in choices.items()}, **given)

        wrapped.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [
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
    for name in (name for name in found if options[name].is_list):
        try:
            found[name] = [float(one) for one in found[name].split(",")]
        except ValueError:
            raise InputError(f"{option_name(name)} {found[name]}: must be numbers with commas between") from None
    return found


def _options(choice: Family[Any] | type[Any], default: Any) -> dict[str, tuple[Any, Any]]:
    """The options of a choice, of a family first which one: annotations and defaults."""
    if not isinstance(choice, Family):
        if issubclass(choice, Choice):
            return {one.name: (_annotation(one, RARE), None) for one in declared(choice)}
        return {one.name: (one.type, one.default) for one in fields(choice)}
    panel, may_be_none = _PANELS[choice.attribute], default is None
    note = f" (default: {choice.default})" if may_be_none else ""
    text = f"{choice.keyword.capitalize()}: {', '.join(choice.names)}{note}."
    names: Any = Literal[tuple(choice.names)]
    kind: Any = names | None if may_be_none else names
    which = Annotated[kind, panel(text, f"--{choice.attribute}", metavar="NAME")]
    found: dict[str, tuple[Any, Any]] = {choice.attribute: (which, None if may_be_none else choice.default)}
    for name, one in choice.options.items():
        of = [kind.name for kind in choice.choices if name in {other.name for other in declared(kind)}]
        every = len(of) == len(choice.choices)
        found[name] = _annotation(one, *([panel] if every else [RARE, f"with {', '.join(of)}"])), None
    return found


def _annotation(one: Option, panel: Panel, *notes: str) -> Any:
    """An option of a command in a group; None where it is not typed."""
    kind: Any = Literal[one.words] if one.words else str if one.is_list else one.kind
    if one.default is not None and not one.is_list:
        notes += (f"default: {one.default}",)
    noted = f" ({'; '.join(notes)})" if notes else ""
    text = f"{one.about[0].upper()}{one.about[1:]}{noted}."
    return Annotated[kind | None, panel(text, option_name(one.name), metavar="A,B,..." if one.is_list else None)]
