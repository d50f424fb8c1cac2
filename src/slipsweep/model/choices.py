"""Choices of a user (models, waveforms, solvers): a class for each, with a field for each option.

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
    """Declare a field of a `Choice`, with one line of text about it.

    A whole number is from `least` to `most`.  Another number is within the bounds of its name in
    `parameters.BOUNDS`.
    """
    return dataclasses.field(
        default=default, metadata={"about": about, "least": least, "most": most}
    )


@dataclass(frozen=True)
class Option:
    """An option, as the class of its choice declares it."""

    name: str
    default: Any  # dataclasses.MISSING if it must be given
    kind: type  # str, int or float; of a list the type of its entries
    words: tuple[str, ...]  # the words that are allowed; empty for numbers
    is_list: bool
    about: str
    least: int
    most: int | None

    def checked(self, value: Any) -> Any:
        """Return the value in the type of the option (InputError: it is not allowed)."""
        if value is None and self.default is None:
            return None
        if not self.is_list:
            return self._single(self.name, value)
        numbers = parameters.check_list(self.name, value, "numbers")
        return tuple(
            self._single(f"{self.name}[{at}]", number) for at, number in enumerate(numbers)
        )

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
    """A model, an excitation or a solver, with its options; frozen, and checked when it is made."""

    #: Name of the choice in strings, sweep files, commands and attributes.
    name: ClassVar[str]

    def __post_init__(self) -> None:
        for declaration in declared(type(self)):
            value = declaration.checked(getattr(self, declaration.name))
            object.__setattr__(self, declaration.name, value)
        self.check()

    def check(self) -> None:
        """Raise InputError if options do not go together, or one needs a further check."""

    @property
    def options(self) -> dict[str, Any]:
        """The options by name, but for those that are None."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: value for name, value in values.items() if value is not None}


def _declared(choice: Any) -> tuple[Option, ...]:
    options = []
    hints = get_type_hints(choice)
    for field in dataclasses.fields(choice):
        hint = hints[field.name]
        if get_origin(hint) in (Union, types.UnionType):
            hint = next(part for part in get_args(hint) if part is not type(None))
        is_list = get_origin(hint) is Sequence
        kind = get_args(hint)[0] if is_list else hint
        words = get_args(kind) if get_origin(kind) is Literal else ()
        options.append(
            Option(
                field.name, field.default, str if words else kind, words, is_list, **field.metadata
            )
        )
    return tuple(options)


#: The options of a class of choices, in the order of its fields.  Cached: every new object needs
#: them, and `get_type_hints` is slow.
declared: Callable[[Any], tuple[Option, ...]] = functools.cache(_declared)

ChoiceType = TypeVar("ChoiceType", bound=Choice)


@dataclass(frozen=True)
class Family(Generic[ChoiceType]):
    """The choices for one argument, such as all models."""

    keyword: str  # the argument in Python, and the table of a sweep file
    key: str  # the key that names the choice in that table
    choices: tuple[type[ChoiceType], ...]
    default: str
    attribute: str  # the attribute of a result, and the option of the command line, that name it
    aliases: Mapping[str, str] = dataclasses.field(default_factory=dict)  # other names of choices

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the choices, aliases first."""
        return (*self.aliases, *(choice.name for choice in self.choices))

    @property
    def options(self) -> dict[str, Option]:
        """The options of all choices, by name."""
        return {option.name: option for choice in self.choices for option in declared(choice)}

    def called(self, name: str) -> type[ChoiceType]:
        """Return the class of a choice, by name."""
        return {choice.name: choice for choice in self.choices}[self.aliases.get(name, name)]

    def having(self, name: str) -> list[str]:
        """Return the names of the choices that have the option `name`."""
        return [
            choice.name
            for choice in self.choices
            if name in {option.name for option in declared(choice)}
        ]

    def of(self, choice: Any) -> ChoiceType:
        """Return a choice from an object, or from a name: then with the default options."""
        if isinstance(choice, self.choices):
            return choice
        if isinstance(choice, str) and choice in self.names:
            return self.made(choice, {})
        names = map(repr, self.names)
        objects = (f"{class_.__name__}(...)" for class_ in self.choices)
        allowed = f"{', '.join(names)}, or {', '.join(objects)}"
        raise InputError(f"{self.keyword} = {shown(choice)}: must be one of {allowed}")

    def made(
        self, name: Any, options: Mapping[str, Any], key: Callable[[str], str] = str
    ) -> ChoiceType:
        """Return the choice of a name, with options from a sweep file's table or a command.

        `key` turns the name of an option into the name that errors use.
        """
        choice = self.called(check_choice(key(self.key), name, self.names))
        allowed_options = {option.name: option for option in declared(choice)}
        for option_name in options:
            if option_name in allowed_options:
                continue
            if option_name not in self.options:
                hint = did_you_mean(option_name, tuple(allowed_options))
                raise InputError(f"{key(option_name)}: unknown; {hint}")
            others = ", ".join(map(repr, self.having(option_name)))
            raise InputError(
                f"{key(option_name)}: not allowed with {key(self.key)} = {name!r}, "
                f"only with {others}"
            )
        for option_name, option in allowed_options.items():
            if option.default is dataclasses.MISSING and option_name not in options:
                raise InputError(
                    f"{key(option_name)}: must be given with {key(self.key)} = {name!r}"
                )
        try:
            return choice(**options)
        except InputError as error:
            text = str(error)  # it begins with the name of the option
            is_of_option = text.startswith(tuple(allowed_options))
            raise InputError(key(text) if is_of_option else text) from None

    def attributes(self, choice: ChoiceType) -> dict[str, Any]:
        """Return the attributes of results for a choice; `from_attributes` is the inverse."""
        return {self.attribute: choice.name} | choice.options

    def from_attributes(self, attributes: Mapping[str, Any]) -> ChoiceType:
        """Return the choice that the attributes of a result name (InputError: they name none)."""
        if self.attribute not in attributes:
            raise InputError(f"attribute {self.attribute!r}: missing")
        choice = self.called(
            check_choice(f"attribute {self.attribute}", attributes[self.attribute], self.names)
        )
        options = {
            option.name: attributes[option.name]
            for option in declared(choice)
            if option.name in attributes
        }
        for name in options:  # files store a list of one number as a number
            if self.options[name].is_list and not isinstance(options[name], Sequence):
                options[name] = getattr(options[name], "flat", [options[name]])
        return self.made(choice.name, options, lambda text: f"attribute {text}")
