"""Help on one screen: commands and options in groups by task; rare options by name, described by ``--help-all``."""

import re
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup


class Panel(str):
    """The name of a group of options in a command's help; called, it declares one of them."""

    def __call__(self, about: str, *names: str, **more: Any) -> Any:
        """An option of the group; names where its parameter does not give it, and what else typer takes."""
        return typer.Option(*names, help=about, rich_help_panel=self, **more)


#: The group of options that are described only by --help-all.
RARE = Panel("Rare options")

#: Columns that a help takes at most.
WIDTH = 100


def _grouped(parameters: list[Any], ctx: Any, default: str) -> dict[str, list[tuple[str, str]]]:
    """Options and what is said of them, by the group that each is declared with."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for one in parameters:
        record = one.get_help_record(ctx)
        if record is not None:
            groups.setdefault(one.rich_help_panel or default, []).append(record)
    return groups


def _write(formatter: Any, heading: str, rows: list[tuple[str, str]]) -> None:
    """Write a group under its heading."""
    formatter.write(f"{heading}:\n")
    formatter.indent()
    formatter.write_dl(rows)
    formatter.dedent()


class Command(TyperCommand):
    """A command whose options are in groups."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take --help-all for --help with the rare options."""
        if "--help-all" in args:
            ctx.meta[RARE], args = True, ["--help"]
        return super().parse_args(ctx, args)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, groups of options, and rare options last."""
        parameters = self.get_params(ctx)
        arguments = [one for one in parameters if one.param_type_name == "argument"]
        groups = _grouped([one for one in parameters if one not in arguments], ctx, "Help")
        rare = groups.pop(RARE, [])
        formatter.write_paragraph()
        for heading, rows in (_grouped(arguments, ctx, "Arguments") | groups).items():
            _write(formatter, heading, rows)
        if rare and ctx.meta.get(RARE):
            _write(formatter, RARE, rare)
        elif rare:
            formatter.write(f"{RARE} (--help-all describes them):\n")
            formatter.indent()
            formatter.write_text(", ".join(name.split(" ")[0] for name, _ in rare))
            formatter.dedent()

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples, a line each."""
        heading, *lines = re.split(r"\s+(?=slipsweep )", self.epilog or "")
        formatter.write(f"{heading}\n" + "".join(f"  {line}\n" for line in lines))


class Group(TyperGroup):
    """The program, with its commands in groups."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands, a line each."""
        groups: dict[str, list[tuple[str, str]]] = {}
        most = formatter.width - 4 - max(map(len, self.commands))
        for name, command in self.commands.items():
            panel: Any = command
            groups.setdefault(panel.rich_help_panel, []).append((name, command.get_short_help_str(most)))
        for heading, rows in groups.items():
            _write(formatter, heading, rows)
