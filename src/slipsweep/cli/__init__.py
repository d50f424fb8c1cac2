"""The command line: the program, which runs the commands of the other modules.

Exit status 0: done; 1: the run failed; 2: a bad command or sweep file; 130: Ctrl-C.  A mistake of a
user gives one line, never a traceback.  Commands import their modules when they run, so that
`slipsweep --help` is fast.
"""

import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperGroup

from slipsweep._version import __version__
from slipsweep.cli import calibrate, chart, export, hazard, info, limit, run, simulate
from slipsweep.cli.common import echo
from slipsweep.cli.letters import SPELL
from slipsweep.cli.options import app
from slipsweep.errors import InputError, RunError, RunWarning


class _Commands(TyperGroup):
    """The program; an error of a command becomes a line and an exit status."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            super().invoke(ctx)
            sys.stdout.flush()  # a full disk or a closed pipe is an error here, not at the exit
        except BrokenPipeError:
            raise  # typer ends quietly
        except KeyboardInterrupt as error:
            kept = getattr(error, "__notes__", ["nothing written"])
            echo(f"slipsweep: interrupted; {'; '.join(kept)}", err=True)
            raise typer.Exit(130) from None
        except (InputError, RunError, OSError, MemoryError) as error:
            is_input = isinstance(error, InputError)
            # bad input may have several notes, for example one for each file of a suite
            lines = ("\n  " if is_input else "; ").join(
                (_message(error), *getattr(error, "__notes__", ()))
            )
            echo(f"slipsweep: error: {lines}", err=True)
            raise typer.Exit(2 if is_input else 1) from None


def _message(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return f"out of memory{f': {error}' if str(error) else ''}"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'what is printed'}: {error.strerror}"
    return str(error)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of the program in one line, and a warning of a library as Python does."""
    if issubclass(category, RunWarning):
        echo(f"slipsweep: warning: {message}", err=True)
    else:
        sys.stderr.write(warnings.formatwarning(message, category, filename, lineno, line))


def _show_version(requested: bool) -> None:
    if requested:
        echo(f"slipsweep {__version__}")
        raise typer.Exit


def _show_versions(requested: bool) -> None:
    if requested:
        from slipsweep.cli import versions

        echo(*versions.lines())
        raise typer.Exit


@app.callback(
    cls=_Commands,
    help="Permanent displacement of a rigid block on a shaken inclined base, over grids of "
    "parameters.",
)
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
    versions: Annotated[
        bool,
        typer.Option(
            "--versions",
            callback=_show_versions,
            is_eager=True,
            help="Show all versions, for a report of a fault, and exit.",
        ),
    ] = False,
) -> None:
    """Declare the options of the program itself; they act through their callbacks."""


#: Modules of the commands, in the order of the help.
_MODULES = [
    module.__name__ for module in (run, simulate, limit, hazard, chart, info, export, calibrate)
]
app.registered_commands.sort(
    key=lambda command: _MODULES.index(command.callback.__module__ if command.callback else "")
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    os.environ["MPLBACKEND"] = "agg"  # figures go to files only
    try:
        Path.home()
    except RuntimeError:  # no HOME and no account: libraries then find no settings
        os.environ["HOME"] = os.devnull
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=SPELL)  # λ is spelled out where the encoding has none
    words = list(sys.argv[1:] if arguments is None else arguments)
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            app(words or ["--help"], prog_name="slipsweep")
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 0
    return 0
