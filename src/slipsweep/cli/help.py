"""What every command's help has: options in groups, and examples."""

from typing import Any

import typer


class Panel(str):
    """The name of a group of options in a command's help; called, it declares one of them."""

    def __call__(self, about: str, *names: str, **more: Any) -> Any:
        """An option of the group; names where its parameter does not give it, and what else typer takes."""
        return typer.Option(*names, help=about.replace("[", r"\["), rich_help_panel=self, **more)


#: The group of options that few cases need.
RARE = Panel("Rare options")


def examples(*lines: str) -> str:
    """Commands that stand below a command's help, one line each."""
    heading = "Example:" if len(lines) == 1 else "Examples:"
    return "\n\n".join((heading, *(line.replace("[", r"\[") for line in lines)))


def printable(text: str) -> str:
    """The text with control characters escaped, whatever a name or a label of a file has in it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
