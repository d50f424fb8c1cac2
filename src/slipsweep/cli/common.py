"""What several commands share: options, progress, the shares of modes and flags, the command as typed."""

import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.model.variables import VALIDITY_TEXT

if TYPE_CHECKING:
    from slipsweep.grid.tally import Tally

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
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        Task,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    from slipsweep.jit import compiling

    before = compiling.seconds()

    class Speed(ProgressColumn):
        def render(self, task: Task) -> str:
            seconds = (task.elapsed or 0.0) - (compiling.seconds() - before)
            if not task.completed or seconds <= 0.0 or task.description:
                return ""
            return f"{task.completed / seconds:.3g} {unit}/s"

    def compiled(kernels: tuple[int, int] | None) -> None:
        text = f"compiling for this processor, once: {kernels[0]} of {kernels[1]}" if kernels else ""
        bar.update(task, description=text)

    columns = (BarColumn(), TaskProgressColumn(), Speed(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar, compiling.watched(compiled):
        task = bar.add_task("", total=cells)
        yield lambda done: bar.advance(task, done)


class Watch:
    """Wall-clock time, and how much of it kernels took to be compiled."""

    def __init__(self) -> None:
        from slipsweep.jit import compiling

        self._compiling = compiling.seconds
        self._started, self._before = time.perf_counter(), compiling.seconds()

    def text(self, count: int, unit: str, seconds: float | None = None) -> str:
        """The time, `seconds` if given, and what was solved in it a second, compilation apart."""
        total = time.perf_counter() - self._started if seconds is None else seconds
        compiling = min(self._compiling() - self._before, total)
        apart = f" ({compiling:.2f} s to compile, once)" if compiling > 0.0 else ""
        return f"{total:.2f} s{apart}, {count / max(total - compiling, 1e-9):.3g} {unit}/s"


def typed_command() -> str:
    return shlex.join(["slipsweep", *sys.argv[1:]])
