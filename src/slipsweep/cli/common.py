"""What several commands share: the program, options, outputs, progress, and what is printed of results."""

import functools
import io
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slipsweep.errors import InputError
from slipsweep.model.variables import FLAG_KIND_TEXT, PARAMETERS, FlagKind, SensitivityStatus, Validity, flags_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from slipsweep.files.jobs import Job
    from slipsweep.files.running import Report
    from slipsweep.files.storing import Place
    from slipsweep.grid.tally import Indices, Tally
    from slipsweep.motion.records import Record

#: The largest displacement that a number without a unit is taken for, m: more is likely to be meant in millimetres.
_MOST_WITHOUT_UNIT = 2.0

#: Endings of figures.
FIGURES = (".png", ".svg", ".pdf")

#: The program, to which each command adds itself.
app = typer.Typer(context_settings={"help_option_names": ["-h", "--help"]}, pretty_exceptions_enable=False)


def command(task: str, *examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a command to the program, by what it is for; its examples stand below its help."""
    return app.command(rich_help_panel=task, epilog="\n\n".join(("Examples:", *examples)))


class Panel(str):
    """The name of a group of options in a command's help; called, it declares one of them."""

    def __call__(self, about: str, *names: str, **more: Any) -> Any:
        """An option of the group; names where its parameter does not give it, and what else typer takes."""
        return typer.Option(*names, help=about.replace("[", r"\["), rich_help_panel=self, **more)

    def value(self, about: str) -> Any:
        """An option of the group that takes a number with a unit."""
        return self(about, metavar="VALUE")


SHAKING, BLOCK, OUTPUT, LARGE = Panel("Shaking"), Panel("Block"), Panel("Output"), Panel("Large runs")

#: The group of options that few cases need.
RARE = Panel("Rare options")


def written(about: str, metavar: str = "FILE") -> Any:
    """The option that names what a command writes."""
    return OUTPUT(about, "--output", "-o", metavar=metavar)


Theta = Annotated[str, BLOCK.value("Inclination of the base: 5 (degrees), 0.1rad.")]
MuS = Annotated[float | None, BLOCK("Static friction coefficient.")]
Phi = Annotated[str | None, BLOCK.value("Friction angle instead of --mu-s: 21 (degrees).")]
Overwrite = Annotated[bool, OUTPUT("Replace an output that exists.", "--overwrite")]
Quiet = Annotated[bool, OUTPUT("No progress and no summary.", "--quiet", "-q")]

#: What ``-d`` declares.
LENGTH = Panel("Displacement")(
    "Tolerable, or to be exceeded: 50mm, 0.05 (m); may be repeated.", "--displacement", "-d", metavar="LENGTH"
)
Displacements = Annotated[list[str], LENGTH]
At = Annotated[
    list[str] | None,
    Panel("Selection")(
        "Values of an axis: theta=12, amplitude=0.1g,0.2g, case=LABEL (default: all); may be repeated.",
        metavar="NAME=VALUE",
    ),
]


@dataclass(frozen=True)
class Large:
    """Options of commands that may run for hours."""

    resume: Annotated[bool, LARGE("Continue an interrupted run from its finished chunks.", "--resume")] = False
    memory: Annotated[str | None, LARGE("Memory limit: 512MiB, 2GB (default: 500 to 600 MB).", metavar="SIZE")] = None
    workers: Annotated[int | None, LARGE("Solve on N processes of this machine (extra [cluster]).", metavar="N")] = None
    scheduler: Annotated[
        str | None, LARGE("Solve on the workers of the dask scheduler at HOST:PORT.", metavar="ADDRESS")
    ] = None


def cuts(given: Sequence[str] | None) -> dict[str, str]:
    """Take apart what was typed with ``--at``: names and values."""
    found: dict[str, str] = {}
    for text in given or ():
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value):
            raise InputError(f"--at {text}: must be NAME=VALUE, as in --at theta=12")
        if name in found:
            raise InputError(f"--at {text}: {name} is given twice")
        found[name] = value
    return found


def displacements(texts: Sequence[str], g: float) -> list[float]:
    """Return the displacements given with ``-d``, in m, in order and each once (InputError: its unit is in doubt)."""
    from slipsweep.model.parameters import check_values
    from slipsweep.model.units import quantity

    found = set()
    for text in map(str.strip, texts):
        length = quantity("--displacement", text, "m", g)
        if length > _MOST_WITHOUT_UNIT and not text[-1].isalpha():
            units = f"give the unit: -d {text}mm or -d {text}m"
            raise InputError(f"--displacement = {text}: without a unit that is {length:g} m; {units}")
        found.add(length)
    return [float(one) for one in check_values("displacement", sorted(found), "--displacement")]


def typed_command() -> str:
    """The command as typed, for the history of a file."""
    return shlex.join(["slipsweep", *sys.argv[1:]])


def check_outputs(
    output: Sequence[Path] | None, endings: Sequence[str], overwrite: bool, reads: Sequence[Path | int]
) -> list[Path]:
    """Refuse outputs that cannot be written, before anything is computed; return those that there are."""
    from slipsweep.files import outputs

    paths = list(output or ())
    for path in paths:
        check_ending(path, endings)
    outputs.check_outputs(paths, overwrite, reads=reads)
    return paths


def check_ending(path: Path, endings: Sequence[str]) -> None:
    """Refuse an output whose name ends in what the command cannot write."""
    if path.suffix not in endings:
        raise InputError(f"{path}: the name must end in {'one of ' if len(endings) > 1 else ''}{', '.join(endings)}")


def figure_of(table: "xr.Dataset") -> "Figure":
    """The chart of a result that has one kind."""
    from slipsweep.charts import kinds

    return kinds.figure_of(table)


def write_outputs(
    paths: Sequence[Path],
    overwrite: bool,
    figure: "Callable[[], Figure]",
    writers: Mapping[str, Callable[[Path], object]] | None = None,
) -> None:
    """Write each output, complete or not at all: by the writer of its ending, or the figure, which is drawn once."""
    from slipsweep.files.outputs import complete_or_absent

    drawn = functools.cache(figure)
    for path in paths:
        with complete_or_absent(path, overwrite) as temporary:
            if path.suffix in FIGURES:
                content = io.BytesIO()  # matplotlib's writers leave a traceback on a full disk
                drawn().savefig(content, format=path.suffix[1:], dpi=150)
                temporary.write_bytes(content.getvalue())
            else:
                (writers or {})[path.suffix](temporary)


def write_netcdf(table: "xr.Dataset", path: Path, title: str, recorded: "Record | None" = None) -> None:
    """Write a time history, and the `recorded` motion that it is the response to."""
    from slipsweep.files import netcdf

    plain = netcdf.without_time_axis(table)
    netcdf.write_table(netcdf.described(plain, title=title, command=typed_command(), recorded=recorded), path)


def write_fragility(table: "xr.Dataset", path: Path, lengths: Sequence[float] | None = None) -> None:
    """Write P(u > d) along the axis amplitude as an .xml file of OpenQuake, for displacements in m."""
    from slipsweep.studies.hazard import fragility, openquake_fragility

    path.write_text(openquake_fragility(fragility(table, lengths)), encoding="utf-8")


def run_job(job: "Job", path: "Place", large: Large, *, overwrite: bool, quiet: bool, unit: str = "cells") -> "Report":
    """Solve and write what a command computes, in chunks if need be."""
    from slipsweep.files import running
    from slipsweep.grid.resources import parse_size

    if large.resume and overwrite:
        raise InputError("--resume, --overwrite: the first continues an interrupted run, the second starts it again")
    nbytes = None if large.memory is None else parse_size("--memory", large.memory)
    with progress_bar(job.plan.cells, quiet, unit) as progress:
        report = running.run(
            job, path, command=typed_command(), overwrite=overwrite, resume=large.resume, memory=nbytes,
            workers=large.workers, scheduler=large.scheduler, progress=progress,
        )  # fmt: skip
    if report.found and not quiet:
        echo(f"{path}: complete already, by the same sweep; nothing was computed")
    return report


def echo(*texts: object, err: bool = False) -> None:
    """Print lines; text that comes from a file sends no control sequences to the terminal."""
    for text in map(str, texts):
        shown = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
        typer.echo("".join(shown), err=err)


def taken_as(values: Mapping[str, float], g: float) -> str:
    """Inputs in the units that they were taken in: ``amplitude 3.55 m/s2 (0.3619 g), frequency 1.8 Hz``."""
    return ", ".join(f"{name.replace('_', ' ')} {range_text(name, (value,), g)}" for name, value in values.items())


def range_text(name: str, ends: Sequence[float], g: float) -> str:
    """Values of a parameter with their unit, accelerations also in g: ``1 to 4 m/s2 (0.1019 to 0.4077 g)``."""
    units = PARAMETERS[name]["units"].replace("m s-2", "m/s2")
    in_g = f" ({' to '.join(f'{end / g:.4g}' for end in ends)} g)" if units == "m/s2" else ""
    return f"{' to '.join(f'{end:.6g}' for end in ends)}{'' if units == '1' else f' {units}'}{in_g}"


def echo_tally(tally: "Tally") -> None:
    """Print the shares of sliding modes and of flags, flags that no cell has left out."""
    if tally.modes is not None:
        echo("sliding modes:")
        echo(*(f"  {mode.name.lower():<24}{tally.share(count):7.2%}" for mode, count in tally.modes.items()))
    if tally.flags is not None:
        seen = Validity(sum(flag for flag, count in tally.flags.items() if count))
        echo("flags (validity):" if seen else "flags (validity): none")
        for kind, flags in ((kind, seen & flags_of(kind)) for kind in FlagKind):
            echo(*([f"  {kind}: {FLAG_KIND_TEXT[kind]}"] if flags else ()))
            shares = {flag: tally.share(tally.flags[flag]) for flag in flags}
            echo(*(f"    {(flag.name or '').lower():<22}{share:7.2%}  {flag.text}" for flag, share in shares.items()))
    if tally.ratios is not None and tally.ratios.number:
        low, median, high = (f"{tally.ratios.quantile(share):.3g}" for share in (0.05, 0.5, 0.95))
        echo(f"displacement over Newmark's, where both slide: median {median}, 5 to 95 % {low} to {high}")
    if tally.indices is not None:
        _echo_indices(tally.indices)


def _echo_indices(indices: "Indices") -> None:
    """Print what moves the displacement, and why there are grid points that do not say."""
    points, there = sum(indices.status.values()), indices.status[SensitivityStatus.COMPUTED]
    echo(f"Sobol indices of the permanent displacement, at {there} of {points} grid points:")
    if there:
        width = max(24, *map(len, indices.total))
        echo(f"  {'input (means)':<{width}}  first order   total   largest total at")
        for name in sorted(indices.total, key=lambda name: -indices.total[name]):
            first, total = (indices.mean(sums, name) for sums in (indices.first, indices.total))
            echo(f"  {name:<{width}}  {first:11.3f} {total:7.3f}   {indices.largest[name]:16d}")
    for status, count in indices.status.items():
        if count and status is not SensitivityStatus.COMPUTED:
            echo(f"  none at {count} ({status.name.lower()}): {status.text}")


def echo_suite(table: "xr.Dataset", most: int, typed: Sequence[str] | None = None) -> None:
    """Print the statistics of a suite or of samples, at each of `most` grid points, with P(u > d) of those typed."""
    stored = {"permanent_displacement", "validity"} <= {*table.data_vars} and "limit_amplitude" not in table
    sampled = "displacement_quantile" in table and (typed or "suite" in table.attrs)
    if sampled or (stored and table["permanent_displacement"].sizes.get("motion", 1) > 1):
        from slipsweep.studies.suite_statistics import summary_lines

        lengths = displacements(typed, float(table.attrs["g"])) if typed else None
        echo(*summary_lines(table, lengths, most))


@contextmanager
def progress_bar(cells: int, quiet: bool, unit: str = "cells") -> Iterator[Callable[[int], None] | None]:
    """Yield what to call with a number of cells done: a progress bar, if there is a terminal to see it."""
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    from slipsweep.jit import compiling

    watch = Watch()

    def advance(more: int) -> None:
        done = bar.tasks[task].completed + more
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

    def speed(self, count: float) -> float:
        """What was solved in a second, compilation apart."""
        return count / max(time.perf_counter() - self._started - (self._compiling() - self._before), 1e-9)

    def text(self, count: int, unit: str) -> str:
        """The time, and the speed."""
        once = self._compiling() - self._before
        apart = f" ({once:.2f} s to compile, once)" if once > 0.0 else ""
        return f"{time.perf_counter() - self._started:.2f} s{apart}, {self.speed(count):.3g} {unit}/s"
