"""The command line: one file a command, put together and run here.

Exit status 0: done; 1: the run failed; 2: a bad command or sweep file; 128 + n: stopped by signal n
(130 for Ctrl-C).  What a user can mend is told in one line, never a traceback.
What a command needs is imported inside it, so that `slipsweep --help` is there at once.
"""

import atexit
import gc
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from slipsweep._version import __version__
from slipsweep.cli import (
    calibrate,
    chart,
    example,
    explore,
    export,
    hazard,
    info,
    limit,
    report,
    run,
    simulate,
    streams,
)
from slipsweep.cli.help import WIDTH, Command, Group
from slipsweep.cli.signals import Interrupted, interrupting
from slipsweep.errors import InputError, RunError

app = typer.Typer(
    cls=Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDTH},
    rich_markup_mode=None,  # its boxes take the lines that keep a help from one screen
    pretty_exceptions_enable=False,
)


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"slipsweep {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Permanent displacement of a rigid block on a shaken inclined base, over grids of parameters."""


#: Commands by task: what they are called with, and their examples.
_COMMANDS: dict[str, list[tuple[Callable[..., None], str]]] = {
    "Start": [(example.example, example.EXAMPLE)],
    "Compute": [
        (run.run, run.EXAMPLE),
        (simulate.simulate, simulate.EXAMPLE),
        (limit.limit, limit.EXAMPLE),
        (hazard.hazard, hazard.EXAMPLE),
    ],
    "Draw": [(chart.chart, chart.EXAMPLE), (report.report, report.EXAMPLE), (explore.explore, explore.EXAMPLE)],
    "Read results": [
        (info.info, info.EXAMPLE),
        (export.export, export.EXAMPLE),
    ],
    "Tests on a shaking table": [
        (calibrate.friction, calibrate.FRICTION_EXAMPLE),
        (calibrate.calibrate, calibrate.EXAMPLE),
    ],
}
for _task, _commands in _COMMANDS.items():
    for _command, _example in _commands:
        app.command(cls=Command, rich_help_panel=_task, epilog=_example)(_command)

# typer names only one of its usage errors; the class above it covers unknown options and missing arguments
_UsageError: Any = typer.BadParameter.__mro__[1]


#: Letters of an error; longer ones are cut in the middle.
_LONGEST = 1000


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    with streams.guarded() as output:
        status = _run(sys.argv[1:] if arguments is None else list(arguments))
        output.flush()
        if output.failure is not None and status == 0:
            status = _fail(f"what is printed could not be written: {output.failure.strerror}", 1)
    return status


def _run(arguments: list[str]) -> int:
    """Run a command; what it raises becomes a message and an exit status."""
    _spare_time()
    try:
        with interrupting():
            # without standalone mode errors come back here instead of being boxed in several lines
            status: Any = app(arguments or ["--help"], prog_name="slipsweep", standalone_mode=False)
    except _UsageError as error:
        return _fail(_words(error), 2)
    except InputError as error:
        return _fail(str(error), 2, getattr(error, "__notes__", ()))
    except MemoryError:
        return _fail("out of memory", 1)
    except (RunError, OSError) as error:
        return _fail("; ".join([str(error), *getattr(error, "__notes__", [])]), 1)
    except Interrupted as error:
        kept = "; ".join(getattr(error, "__notes__", ["nothing written"]))
        print(f"slipsweep: interrupted; {kept}", file=sys.stderr)
        return 128 + error.signum
    return status if isinstance(status, int) else 0


def _spare_time() -> None:
    """Leave out what a short run would spend on garbage, on threads for linear algebra and on plugins."""
    # imports make objects by the hundred thousand, none of them garbage, and it is looked for after every 700; with
    # 100,000 in its place a run takes 8 % longer
    gc.set_threshold(1_000_000, 20, 100)
    # all ends with the process: 0.25 s of looking for it at the exit
    atexit.register(gc.freeze)
    # numpy and scipy each start a thread a core for linear algebra, of which there is none: they spin, then wait
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # pydantic looks for plugins of its own in all that is installed: 2 % of the time of a small run
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


def _words(error: Any) -> str:
    """Put a usage error of typer, or of pydantic behind it, in our words."""
    near = getattr(error, "possibilities", None)
    if near:
        return f"{error.message}; did you mean {near[0]}?"
    message = error.format_message().replace("Value error, ", "")
    if hasattr(error.__cause__, "errors"):
        given: Any = error.__cause__.errors()
        message = message.replace("Input should", f"{given[0]['input']!r} should").partition(", unable to parse")[0]
    return message


def _fail(message: str, status: int, notes: Sequence[str] = ()) -> int:
    # one line, whatever a name or a library has in it
    line, *more = (
        "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
        for text in (message, *notes)
    )
    if len(line) > _LONGEST:  # a page of what was given hides what is wrong with it
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
    print(f"slipsweep: error: {line}", file=sys.stderr)
    for note in more:  # of the files of a suite, say: one each
        print(f"  {note}", file=sys.stderr)
    return status
