"""What several commands share: options, progress, the shares of modes and flags, the command as typed."""

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.model.variables import VALIDITY_TEXT

if TYPE_CHECKING:
    from slipsweep.files.netcdf import Tally

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")]


def examples(*lines: str) -> str:
    """Put commands under a command's `--help`, a line each."""
    return "\n\n".join(("Examples:", *lines))


def echo_tally(tally: "Tally") -> None:
    """Print the shares of sliding modes and of flags, flags that no cell has left out."""
    if tally.modes is not None:
        typer.echo("sliding modes:")
        for mode, count in tally.modes.items():
            typer.echo(f"  {mode.name.lower():<24}{count / tally.cells:7.2%}")
    if tally.flags is not None:
        typer.echo("flags (validity):")
        for flag, count in tally.flags.items():
            if count:
                name = (flag.name or "").lower()
                typer.echo(f"  {name:<24}{count / tally.cells:7.2%}  {VALIDITY_TEXT[flag]}")
        if not any(tally.flags.values()):
            typer.echo("  none")


@contextmanager
def progress_bar(cells: int, quiet: bool, unit: str = "cells") -> Iterator[Callable[[int], None] | None]:
    """Yield what to call with a number of cells done: a progress bar, if there is a terminal to see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TimeRemainingColumn

    class Speed(ProgressColumn):
        def render(self, task: Task) -> str:
            return f"{task.completed / task.elapsed:.3g} {unit}/s" if task.completed and task.elapsed else ""

    columns = (BarColumn(), TaskProgressColumn(), Speed(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=cells)
        yield lambda done: bar.advance(task, done)


def typed_command() -> str:
    return shlex.join(["slipsweep", *sys.argv[1:]])
