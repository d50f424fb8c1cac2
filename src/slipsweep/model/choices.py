"""What a user may choose, declared once: a class a choice, a field an option.

From these declarations come Python's arguments (`model=Mendez(rise="literal")`), the keys of a
sweep file's table (`rise = "literal"`), the options of the command line (`--rise literal`), and the
attributes of a result's file.
"""

import dataclasses
import functools
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import (
    Any,
    ClassVar,
    Generic,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model import parameters
from slipsweep.model.parameters import check_choice, shown


def option(
    about: str, default: Any = dataclasses.MISSING, *, least: int = 0, most: int | None = None
) -> Any:
    """A field of a `Choice`, with one line on what it is about.

    A whole number is `least` to `most`; another is within the bounds of the parameter of its name.
    """
    return dataclasses.field(
        default=default, metadata={"about": about, "least": least, "most": most}
    )


@dataclass(frozen=True)
class Option:
    """An option as its class declares it."""

    name: str
    default: Any  # dataclasses.MISSING where it must be given
    kind: type  # str, int or float; of one entry, where it is a list
    words: tuple[str, ...]  # what a word may be; empty for numbers
    is_list: bool
    about: str
    least: int
    most: int | None

    def checked(self, value: Any) -> Any:
        """The value, in the option's own type (InputError: what is allowed)."""
        if value is None and self.default is None:
            return None
        if not self.is_list:
            return self._single(self.name, value)
        numbers = parameters.check_list(self.name, value, "numbers")
        return tuple(self._single(f"{self.name}[{at}]", one) for at, one in enumerate(numbers))

    def _single(self, name: str, value: Any) -> Any:
        if self.words:
            return check_choice(name, value, self.words)
        if self.kind is int:
            return parameters.check_whole(name, value, self.least, self.most)
        if self.name in parameters.BOUNDS:
            return parameters.check_single(self.name, value, name)
        return parameters.check_finite(name, value)


@dataclass(frozen=True)
class Choice:
    """One of several ways, with its options; frozen, comparable, and checked when it is made."""

    #: What names the choice where no object can: in strings, sweep files, commands, attributes.
    name: ClassVar[str]

    def __post_init__(self) -> None:
        for one in declared(type(self)):
            object.__setattr__(self, one.name, one.checked(getattr(self, one.name)))
        self.check()

    def check(self) -> None:
        """Refuse what one option cannot know of another."""

    @property
    def options(self) -> dict[str, Any]:
        """The options by name, but for those that are None."""
        values = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        return {name: value for name, value in values.items() if value is not None}


def _declared(choice: Any) -> tuple[Option, ...]:
    found = []
    hints = get_type_hints(choice)
    for field in dataclasses.fields(choice):
        hint = hints[field.name]
        if get_origin(hint) in (Union, types.UnionType):
            hint = next(part for part in get_args(hint) if part is not type(None))
        is_list = get_origin(hint) is Sequence
        kind = get_args(hint)[0] if is_list else hint
        words = get_args(kind) if get_origin(kind) is Literal else ()
        found.append(
            Option(
                field.name, field.default, str if words else kind, words, is_list, **field.metadata
            )
        )
    return tuple(found)


#: The options of a class of choices, in the order of its fields; every object made asks for them,
#: and hints take long.
declared: Callable[[Any], tuple[Option, ...]] = functools.cache(_declared)

Some = TypeVar("Some", bound=Choice)


@dataclass(frozen=True)
class Family(Generic[Some]):
    """Choices of which one is taken."""

    keyword: str  # Python's argument, and the table of a sweep file
    key: str  # what names the choice in that table
    choices: tuple[type[Some], ...]
    default: str
    attribute: str  # what names the choice in the attributes of a result, and on the command line
    aliases: Mapping[str, str] = dataclasses.field(default_factory=dict)  # other names of choices

    @property
    def names(self) -> tuple[str, ...]:
        """All names that a choice may be called by."""
        return (*self.aliases, *(choice.name for choice in self.choices))

    @property
    def options(self) -> dict[str, Option]:
        """The options of all choices, by name."""
        return {one.name: one for choice in self.choices for one in declared(choice)}

    def called(self, name: str) -> type[Some]:
        """The class of a choice, by name."""
        return {choice.name: choice for choice in self.choices}[self.aliases.get(name, name)]

    def having(self, name: str) -> list[str]:
        """Names of the choices that have an option."""
        return [
            choice.name for choice in self.choices if name in {one.name for one in declared(choice)}
        ]

    def of(self, given: Any) -> Some:
        """The choice that a caller gives: an object, or the name of one with its defaults."""
        if isinstance(given, self.choices):
            return given
        if isinstance(given, str) and given in self.names:
            return self.made(given, {})
        names = map(repr, self.names)
        objects = (f"{choice.__name__}(...)" for choice in self.choices)
        allowed = f"{', '.join(names)}, or {', '.join(objects)}"
        raise InputError(f"{self.keyword} = {shown(given)}: must be one of {allowed}")

    def made(self, name: Any, options: Mapping[str, Any], key: Callable[[str], str] = str) -> Some:
        """The choice of a name, with options as a table or a command gives them.

        `key` is what an option's name is called there, in errors.
        """
        choice = self.called(check_choice(key(self.key), name, self.names))
        known = {one.name: one for one in declared(choice)}
        for unknown in (one for one in options if one not in known):
            if unknown not in self.options:
                raise InputError(f"{key(unknown)}: unknown; {did_you_mean(unknown, tuple(known))}")
            allowed = ", ".join(map(repr, self.having(unknown)))
            raise InputError(
                f"{key(unknown)}: not allowed with {key(self.key)} = {name!r}, only with {allowed}"
            )
        for one in known.values():
            if one.default is dataclasses.MISSING and one.name not in options:
                raise InputError(f"{key(one.name)}: must be given with {key(self.key)} = {name!r}")
        try:
            return choice(**options)
        except InputError as error:
            text = str(error)  # it begins with the option's name
            raise InputError(key(text) if text.startswith(tuple(known)) else text) from None

    def attributes(self, choice: Some) -> dict[str, Any]:
        """What results say of a choice; `from_attributes` gives it again."""
        return {self.attribute: choice.name} | choice.options

    def from_attributes(self, attributes: Mapping[str, Any]) -> Some:
        """The choice that the attributes of a result tell of (InputError: they tell of none)."""
        if self.attribute not in attributes:
            raise InputError(f"attribute {self.attribute!r}: missing")
        choice = self.called(
            check_choice(f"attribute {self.attribute}", attributes[self.attribute], self.names)
        )
        options = {
            one.name: attributes[one.name] for one in declared(choice) if one.name in attributes
        }
        for name in options:  # files give a list of one number as a number
            if self.options[name].is_list and not isinstance(options[name], Sequence):
                options[name] = getattr(options[name], "flat", [options[name]])
        return self.made(choice.name, options, lambda text: f"attribute {text}")
