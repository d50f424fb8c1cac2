"""What several commands share: options, progress, the shares of modes and flags, the command as typed."""

import io
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.help import Panel, printable
from slipsweep.cli.options import BLOCK
from slipsweep.errors import InputError
from slipsweep.model.variables import (
    FLAG_KIND_TEXT,
    PARAMETERS,
    FlagKind,
    SensitivityStatus,
    Validity,
    flags_of,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from slipsweep.files.jobs import Job
    from slipsweep.files.storing import Place, Report
    from slipsweep.grid.tally import Indices, Tally

#: The largest displacement that a number without a unit is taken for, m: more is likely to be meant in millimetres.
_MOST_WITHOUT_UNIT = 2.0

#: Endings of figures.
FIGURES = (".png", ".svg", ".pdf")

Theta = Annotated[str, BLOCK("Inclination of the base: 5 (degrees), 0.1rad.", metavar="VALUE")]
MuS = Annotated[float, BLOCK("Static friction coefficient.")]
#: Groups of options that several commands have.
OUTPUT, LARGE = Panel("Output"), Panel("Large runs")

Overwrite = Annotated[bool, OUTPUT("Replace an output that exists.", "--overwrite")]
Quiet = Annotated[bool, OUTPUT("No progress and no summary.", "--quiet", "-q")]

Resume = Annotated[bool, LARGE("Continue an interrupted run from its finished chunks.", "--resume")]
Memory = Annotated[str | None, LARGE("Memory limit: 512MiB, 2GB (default: 500 to 600 MB).", metavar="SIZE")]
Workers = Annotated[int | None, LARGE("Solve on N processes of this machine (extra [cluster]).", metavar="N")]
Scheduler = Annotated[str | None, LARGE("Solve on the workers of the dask scheduler at HOST:PORT.", metavar="ADDRESS")]


def echo(text: object = "") -> None:
    """Print a line; text that comes from a file sends no control sequences to the terminal."""
    typer.echo("\n".join(map(printable, str(text).split("\n"))))


def echo_tally(tally: "Tally") -> None:
    """Print the shares of sliding modes and of flags, flags that no cell has left out."""
    if tally.modes is not None:
        typer.echo("sliding modes:")
        for mode, count in tally.modes.items():
            typer.echo(f"  {mode.name.lower():<24}{tally.share(count):7.2%}")
    if tally.flags is not None:
        seen = Validity(sum(flag for flag, count in tally.flags.items() if count))
        typer.echo("flags (validity):" if seen else "flags (validity): none")
        for kind in FlagKind:
            if seen & flags_of(kind):
                typer.echo(f"  {kind}: {FLAG_KIND_TEXT[kind]}")
            for flag in seen & flags_of(kind):
                name = (flag.name or "").lower()
                typer.echo(f"    {name:<22}{tally.share(tally.flags[flag]):7.2%}  {flag.text}")
    if tally.ratios is not None and tally.ratios.number:
        low, median, high = (f"{tally.ratios.quantile(share):.3g}" for share in (0.05, 0.5, 0.95))
        typer.echo(f"displacement over Newmark's, where both slide: median {median}, 5 to 95 % {low} to {high}")
    if tally.indices is not None:
        _echo_indices(tally.indices)


def _echo_indices(indices: "Indices") -> None:
    """Print what moves the displacement, and why there are grid points that do not say."""
    points, there = sum(indices.status.values()), indices.status[SensitivityStatus.COMPUTED]
    typer.echo(f"Sobol indices of the permanent displacement, at {there} of {points} grid points:")
    if there:
        width = max(24, *map(len, indices.total))
        typer.echo(f"  {'input (means)':<{width}}  first order   total   largest total at")
        for name in sorted(indices.total, key=lambda name: -indices.total[name]):
            first, total = (indices.mean(sums, name) for sums in (indices.first, indices.total))
            typer.echo(f"  {name:<{width}}  {first:11.3f} {total:7.3f}   {indices.largest[name]:16d}")
    for status, count in indices.status.items():
        if count and status is not SensitivityStatus.COMPUTED:
            text = status.text
            typer.echo(f"  none at {count} ({status.name.lower()}): {text}")


def place_of(text: str) -> "Place":
    """An output as typed: a path, or the address of a store."""
    from slipsweep.files.opening import is_address

    return text if is_address(text) else Path(text)


def echo_found(path: Path | str) -> None:
    """Say that there was nothing to go on with."""
    typer.echo(f"{path}: complete already, by the same sweep; nothing was computed")


def write_figure(figure: "Figure", path: Path, overwrite: bool) -> None:
    """Write a figure in the format that the name ends in."""
    from slipsweep.files import outputs

    drawn = io.BytesIO()  # matplotlib's writers leave a traceback on a full disk
    figure.savefig(drawn, format=path.suffix[1:], dpi=150)
    with outputs.complete_or_absent(path, overwrite) as temporary:
        temporary.write_bytes(drawn.getvalue())


def check_ending(path: Path, endings: Sequence[str]) -> None:
    """Refuse an output whose name ends in what the command cannot write."""
    if path.suffix not in endings:
        raise InputError(f"{path}: the name must end in {'one of ' if len(endings) > 1 else ''}{', '.join(endings)}")


def cuts(given: Sequence[str] | None) -> dict[str, str]:
    """Take apart what was typed with ``--at``: names and values."""
    found: dict[str, str] = {}
    for text in given or ():
        name, separator, value = text.partition("=")
        if not (separator and name and value):
            raise InputError(f"--at {text}: must be NAME=VALUE, as in --at theta=12")
        if name.strip() in found:
            raise InputError(f"--at {text}: {name.strip()} is given twice")
        found[name.strip()] = value.strip()
    return found


def displacements(texts: Sequence[str], g: float) -> list[float]:
    """Return the displacements given with ``-d``, in m, in order and each once.

    Raises
    ------
    InputError
        One is no length, not > 0, or a number so large that its unit is in doubt.
    """
    from slipsweep.model.parameters import check_values
    from slipsweep.model.units import quantity

    found = set()
    for text in texts:
        length = quantity("--displacement", text, "m", g)
        if length > _MOST_WITHOUT_UNIT and not text.strip()[-1].isalpha():
            raise InputError(
                f"--displacement = {text}: without a unit that is {length:g} m; give the unit: -d {text.strip()}mm or "
                f"-d {text.strip()}m"
            )
        found.add(length)
    return [float(one) for one in check_values("displacement", sorted(found), "--displacement")]


def taken_as(values: Mapping[str, float], g: float) -> str:
    """Inputs in the units that they were taken in: ``amplitude 3.55 m/s2 (0.3619 g), frequency 1.8 Hz``."""
    texts = []
    for name, value in values.items():
        unit = PARAMETERS[name]["units"].replace("m s-2", "m/s2")
        in_g = f" ({value / g:.4g} g)" if unit == "m/s2" else ""
        texts.append(f"{name.replace('_', ' ')} {value:.6g} {unit}{in_g}")
    return ", ".join(texts)


@contextmanager
def progress_bar(cells: int, quiet: bool, unit: str = "cells") -> Iterator[Callable[[int], None] | None]:
    """Yield what to call with a number of cells done: a progress bar, if there is a terminal to see it."""
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    from slipsweep.jit import compiling

    watch, done = Watch(), 0

    def advance(more: int) -> None:
        nonlocal done
        done += more
        bar.update(task, completed=done, description=f"{watch.speed(done):.3g} {unit}/s")

    def compiled(kernel: str | None) -> None:
        bar.update(task, description=f"compiling for this processor, once: {kernel}" if kernel else "")

    columns = (BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar, compiling.watched(compiled):
        task = bar.add_task("", total=cells)
        yield advance


class Watch:
    """Wall-clock time, and how much of it kernels took to be compiled."""

    def __init__(self) -> None:
        from slipsweep.jit import compiling

        self._compiling = compiling.seconds
        self._started, self._before = time.perf_counter(), compiling.seconds()

    def speed(self, count: int) -> float:
        """What was solved in a second, compilation apart."""
        seconds = time.perf_counter() - self._started - (self._compiling() - self._before)
        return count / max(seconds, 1e-9)

    def text(self, count: int, unit: str) -> str:
        """The time, and the speed."""
        compiling = self._compiling() - self._before
        apart = f" ({compiling:.2f} s to compile, once)" if compiling > 0.0 else ""
        return f"{time.perf_counter() - self._started:.2f} s{apart}, {self.speed(count):.3g} {unit}/s"


def typed_command() -> str:
    return shlex.join(["slipsweep", *sys.argv[1:]])


@dataclass(frozen=True)
class Chunks:
    """How a run is carried out in chunks: the options of that name."""

    overwrite: bool
    resume: bool
    memory: str | None
    workers: int | None
    scheduler: str | None

    def __post_init__(self) -> None:
        if self.resume and self.overwrite:
            raise InputError(
                "--resume, --overwrite: --resume continues an interrupted run, --overwrite starts it again; give one"
            )

    def given(self) -> list[str]:
        """Options that only make sense with an output in chunks."""
        others = {**asdict(self), "overwrite": None}
        return [f"--{name}" for name, value in others.items() if value not in (None, False)]

    def run(self, job: "Job", path: "Place", quiet: bool, unit: str = "cells") -> "Report":
        """Solve and write what a command asks for."""
        from slipsweep.files import storing
        from slipsweep.grid.resources import parse_size

        memory = None if self.memory is None else parse_size("--memory", self.memory)
        with progress_bar(job.plan.cells, quiet, unit) as progress:
            return storing.run(
                job,
                path,
                command=typed_command(),
                overwrite=self.overwrite,
                resume=self.resume,
                memory=memory,
                workers=self.workers,
                scheduler=self.scheduler,
                progress=progress,
            )
