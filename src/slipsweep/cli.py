"""The command line: `slipsweep run`, `info` and `simulate`.

Exit status 0: done; 1: the run failed; 2: a bad command or sweep file; 128 + n: stopped by signal n
(130 for Ctrl-C).  What a user can mend is told in one line, never a traceback.
What a command needs is imported inside it, so that `slipsweep --help` is there at once.
"""

import csv
import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from slipsweep.errors import InputError, RunError
from slipsweep.variables import HISTORY, VALIDITY_TEXT, SlidingMode, Validity

if TYPE_CHECKING:
    from slipsweep.store import Tally
    from slipsweep.tables import Table

app = typer.Typer(
    help="Permanent displacement of a rigid block on a shaken inclined plane, over grids of parameters.",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)

# typer names only one of its usage errors; the class above it covers unknown options and missing arguments
_UsageError: Any = typer.BadParameter.__mro__[1]

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]


@app.command(epilog="Example: slipsweep run sweeps/design_chart.toml -o design_chart.nc")
def run(
    sweep: Annotated[
        Path,
        typer.Argument(metavar="SWEEP.toml|OUT.nc", help="A sweep file, or an earlier result to make again."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT.nc",
            help="File to write (default: output.path, else the sweep's name with .nc).",
        ),
    ] = None,
    overwrite: Overwrite = False,
    solver: Annotated[
        Literal["auto", "step", "cycle"] | None, typer.Option(help="Solver, over the sweep file's solver.method.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
) -> None:
    """Compute a sweep and write it to a netCDF file."""
    from slipsweep import spec, store
    from slipsweep.resources import size_text

    checked = spec.load(sweep)
    if solver is not None:
        checked = checked.with_solver(solver)
    path = output or Path(checked.output.path or f"{sweep.stem}.nc")
    if path.exists() and sweep.suffix != ".nc" and path.samefile(sweep):
        raise InputError(f"{path}: is the sweep file itself; give another name with -o")
    with _progress(checked.cells, quiet) as progress:
        report = store.run(checked, path, command=_command(), overwrite=overwrite, progress=progress)
    if quiet:
        return
    rate = report.tally.cells / max(report.seconds, 1e-9)
    grid = " x ".join(f"{length} {dim}" for dim, length in report.shape.items())
    typer.echo(f"{report.tally.cells} cells ({grid}) in {report.seconds:.2f} s, {rate:.3g} cells/s")
    _echo_tally(report.tally)
    typer.echo(f"{report.path}  {size_text(report.nbytes)}")


@app.command(epilog="Example: slipsweep info design_chart.nc")
def info(file: Annotated[Path, typer.Argument(metavar="OUT.nc", help="A file that slipsweep wrote.")]) -> None:
    """Tell what is in a result, how it was made, and the shares of its modes and flags."""
    from slipsweep import store
    from slipsweep.resources import size_text

    contents = store.read_contents(file)
    typer.echo(f"{contents.path}  {size_text(contents.nbytes)}")
    for title, entries in (("coordinates", contents.coordinates), ("variables", contents.variables)):
        typer.echo(f"{title}:")
        for name, text in entries.items():
            typer.echo(f"  {name:<24}{text}")
    _echo_tally(contents.tally)
    for name, text in contents.attributes.items():
        if "\n" in text:
            typer.echo(f"{name}:")
            typer.echo("".join(f"  {line}\n" for line in text.splitlines()), nl=False)
        else:
            typer.echo(f"{name}: {text}")


@app.command(epilog="Example: slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8 -o history.png")
def simulate(
    theta: Annotated[float, typer.Option(help="Plane inclination, degrees.")],
    mu_s: Annotated[float, typer.Option(help="Static friction coefficient.")],
    amplitude: Annotated[float, typer.Option(help="Peak ground acceleration, m/s².")],
    frequency: Annotated[float, typer.Option(help="Excitation frequency, Hz.")],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write .nc, .csv, .png, .svg or .pdf; may be repeated."),
    ] = None,
    overwrite: Overwrite = False,
    cycles: Annotated[int, typer.Option(help="Cycles of shaking.")] = 10,
    yield_acceleration: Annotated[
        float | None, typer.Option(help="Yield acceleration, m/s² (default: Coulomb's).")
    ] = None,
    decay_rate: Annotated[float | None, typer.Option(help="Friction decay λ (default: Eq. 6 at the peak).")] = None,
    delta_mu: Annotated[float | None, typer.Option(help="Friction above static Δμ (default: Eqs. 10, 11).")] = None,
    minimum_friction: Annotated[float | None, typer.Option(help="Minimum friction μmin (default: Eq. 9).")] = None,
    model: Annotated[Literal["mendez", "newmark"], typer.Option(help="Model of the interface.")] = "mendez",
    rise: Annotated[Literal["monotone", "literal"], typer.Option(help="Block acceleration on the rise.")] = "monotone",
    recoupling: Annotated[Literal["eq12", "integrate"], typer.Option(help="How sliding ends.")] = "eq12",
    g: Annotated[float, typer.Option(help="Gravity, m/s².")] = 9.81,
    points: Annotated[int, typer.Option(min=4, help="Points in time per cycle.")] = 512,
) -> None:
    """Compute the time history of one case, as files and a figure."""
    writers: dict[str, Callable[[Table, Path, bool], None]] = {
        ".nc": _write_netcdf,
        ".csv": _write_csv,
        **dict.fromkeys((".png", ".svg", ".pdf"), _write_figure),
    }
    outputs = output or []
    for path in outputs:
        if path.suffix not in writers:
            raise InputError(f"{path}: the name must end in one of {', '.join(writers)}")

    from slipsweep import store
    from slipsweep.history import history_table

    for path in outputs:
        store.check_output(path, overwrite)
    table = history_table(
        theta=theta,
        mu_s=mu_s,
        amplitude=amplitude,
        frequency=frequency,
        cycles=cycles,
        yield_acceleration=yield_acceleration,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        model=model,
        rise=rise,
        recoupling=recoupling,
        g=g,
        points_per_cycle=points,
    )
    for path in outputs:
        writers[path.suffix](table, path, overwrite)
    typer.echo(f"permanent displacement  {table['permanent_displacement'].item():.6g} m")
    typer.echo(f"peak relative velocity  {table['peak_relative_velocity'].item():.6g} m/s")
    typer.echo(f"sliding mode            {SlidingMode(table['sliding_mode'].item()).name.lower()}")
    for flag in Validity(table["validity"].item()):
        typer.echo(f"flag                    {(flag.name or '').lower()}: {VALIDITY_TEXT[flag]}")
    for path in outputs:
        typer.echo(path)


def _write_netcdf(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep import store

    store.write_table(table, path, title="Time history of a sliding block", command=_command(), overwrite=overwrite)


def _write_csv(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep import store

    columns = {name: table[name] for name in ("time", *HISTORY)}
    with store.complete_or_absent(path, overwrite) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(f"{name} ({array.attrs['units']})" for name, array in columns.items())
        writer.writerows(zip(*(array.values.tolist() for array in columns.values()), strict=True))


def _write_figure(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep import figures, store

    figure = figures.history(table)
    with store.complete_or_absent(path, overwrite) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=150)


def _echo_tally(tally: "Tally") -> None:
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
def _progress(cells: int, quiet: bool) -> Iterator[Callable[[int], None] | None]:
    """Yield what to call with a number of cells done: a progress bar, if there is a terminal to see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TimeRemainingColumn

    class Speed(ProgressColumn):
        def render(self, task: Task) -> str:
            return f"{task.completed / task.elapsed:.3g} cells/s" if task.completed and task.elapsed else ""

    columns = (BarColumn(), TaskProgressColumn(), Speed(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=cells)
        yield lambda done: bar.advance(task, done)


def _command() -> str:
    return shlex.join(["slipsweep", *sys.argv[1:]])


class Interrupted(BaseException):
    """Ctrl-C or SIGTERM; no `except Exception` stops it."""

    def __init__(self, signum: int) -> None:
        self.signum = signum


@contextmanager
def _signals() -> Iterator[None]:
    """Make Ctrl-C and SIGTERM raise `Interrupted`, once: cleaning up is not interrupted again."""
    # a signal that the caller ignores (nohup, a shell's background job) stays ignored
    watched = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) is not signal.SIG_IGN]

    def interrupt(signum: int, frame: FrameType | None) -> None:
        for number in watched:
            signal.signal(number, signal.SIG_IGN)
        raise Interrupted(signum)

    before = {number: signal.signal(number, interrupt) for number in watched}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        with _signals():
            # without standalone mode errors come back here instead of being boxed in several lines
            status: Any = app(arguments or ["--help"], prog_name="slipsweep", standalone_mode=False)
    except _UsageError as error:
        return _fail(error.format_message(), 2)
    except InputError as error:
        return _fail(str(error), 2)
    except MemoryError:
        return _fail("out of memory", 1)
    except (RunError, OSError) as error:
        return _fail(str(error), 1)
    except Interrupted as error:
        print("slipsweep: interrupted; nothing written", file=sys.stderr)
        return 128 + error.signum
    return status if isinstance(status, int) else 0


def _fail(message: str, status: int) -> int:
    print(f"slipsweep: error: {' '.join(message.split())}", file=sys.stderr)
    return status
