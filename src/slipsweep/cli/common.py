"""Functions that commands share: write outputs, run jobs, print summaries."""

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slipsweep.cli.options import Large, displacements
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.model import variables

if TYPE_CHECKING:
    import xarray as xr

    from slipsweep.files.jobs import Job
    from slipsweep.files.running import Report
    from slipsweep.files.storing import Place
    from slipsweep.motion.records import Record
    from slipsweep.studies.result_counts import Tally

#: Attribute of a file: reasons why no design must rest on it, a line each.
UNSOUND = "unsound"

#: Endings of figures.
FIGURES = (".png", ".svg", ".pdf")


def write_outputs(
    paths: list[Path],
    overwrite: bool,
    table: "xr.Dataset",
    recorded: "Record | None" = None,
    look: Mapping[str, Any] | None = None,
    **texts: Callable[[], str],
) -> None:
    """Write each output: the text of its ending, a netCDF file, or the chart.

    `recorded`, the record that was the input, is stored in the netCDF file; `look` has options of
    the chart.
    """
    from slipsweep.files import netcdf

    figure = None
    for path in paths:
        with outputs.complete_or_absent(path, overwrite) as temporary:
            if text := texts.get(path.suffix[1:]):
                temporary.write_text(text(), encoding="utf-8")
            elif path.suffix == ".nc":
                plain = netcdf.without_time_axis(table)
                title = table.attrs["title"]
                described = netcdf.described(
                    plain, title=title, command=typed_command(), recorded=recorded
                )
                netcdf.write_table(described, temporary)
            else:
                from slipsweep.charts import kinds

                figure = figure or kinds.figure_of(table, **(look or {}))  # drawn once
                kinds.save(figure, temporary, path.suffix)


def run_job(
    job: "Job",
    path: "Place",
    large: Large,
    unit: str = "cells",
    remarks: "Callable[[xr.Dataset], Mapping[str, str]]" = lambda results: {},
) -> "Report":
    """Solve a job and write its results, in chunks if need be.

    `remarks` makes attributes from the results, which are stored in the file.
    """
    from slipsweep.files import running
    from slipsweep.grid.resources import parse_size

    if large.resume and large.overwrite:
        raise InputError(
            "--resume, --overwrite: the first continues an interrupted run, the second starts it "
            "again"
        )
    settings = {name: value for name, value in vars(large).items() if name != "quiet"}
    settings["memory"] = None if large.memory is None else parse_size("--memory", large.memory)
    with progress_bar(job.plan.cells, large.quiet, unit) as progress:
        settings |= {"progress": progress, "remarks": remarks}
        report = running.run(job, path, command=typed_command(), **settings)
    if report.was_complete and not large.quiet:
        echo(f"{path}: complete already, by the same sweep; nothing was computed")
    return report


def typed_command() -> str:
    """Return the command as typed, for the history of a file."""
    return shlex.join(["slipsweep", *sys.argv[1:]])


@contextmanager
def progress_bar(
    cells: int, quiet: bool, unit: str = "cells"
) -> Iterator[Callable[[int], None] | None]:
    """Yield a function of a number of finished cells, which moves a progress bar.

    Without a terminal, or if `quiet`, there is no bar, and None is yielded.
    """
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    from slipsweep.jit import compiling

    columns = (
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=cells)
        before = compiling.seconds
        compiling.announce = lambda kernel: bar.update(
            task, description=f"compiling {kernel}, once"
        )

        def advance(more: int) -> None:
            bar.advance(task, more)
            solving = (bar.tasks[task].elapsed or 0.0) - (compiling.seconds - before)
            bar.update(
                task, description=f"{bar.tasks[task].completed / max(solving, 1e-9):.3g} {unit}/s"
            )

        yield advance


def echo(*texts: object, err: bool = False) -> None:
    """Print lines, without control sequences that the text of a file may have."""
    for text in map(str, texts):
        shown = (
            c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
        )
        # typer's would write UTF-8 to a terminal that has ASCII only
        print("".join(shown), file=sys.stderr if err else sys.stdout, flush=True)


def range_text(name: str, ends: Sequence[float], g: float) -> str:
    """Return values of a parameter with their unit; accelerations are also in g.

    An example is ``1 to 4 m/s2 (0.1019 to 0.4077 g)``.
    """
    units = variables.PARAMETERS[name]["units"].replace("m s-2", "m/s2")
    in_g = f" ({' to '.join(f'{end / g:.4g}' for end in ends)} g)" if units == "m/s2" else ""
    return f"{' to '.join(f'{end:.6g}' for end in ends)}{'' if units == '1' else f' {units}'}{in_g}"


def echo_unsound(table: "xr.Dataset") -> None:
    """Print the reasons, from the file of a result, why no design must rest on it."""
    echo(*(f"{UNSOUND}: {text}" for text in str(table.attrs.get(UNSOUND, "")).splitlines()))


def echo_tally(tally: "Tally") -> None:
    """Print the shares of sliding modes and of flags, ratios to Newmark's, and Sobol indices."""
    if tally.modes is not None:
        echo("sliding modes:")
        echo(
            *(
                f"  {mode.name.lower():<24}{tally.share(count):7.2%}"
                for mode, count in tally.modes.items()
            )
        )
    if tally.flags is not None:
        seen = variables.Validity(sum(flag for flag, count in tally.flags.items() if count))
        echo("flags (validity):" if seen or tally.unflagged else "flags (validity): none")
        if tally.unflagged:
            share = f"{tally.share(tally.unflagged):9.2%}"
            echo(f"  not known              {share}  {variables.UNFLAGGED_TEXT}")
        for kind in variables.FlagKind:
            flags = seen & variables.flags_of(kind)
            echo(*([f"  {kind}: {variables.FLAG_KIND_TEXT[kind]}"] if flags else ()))
            for flag in flags:
                share = f"{tally.share(tally.flags[flag]):7.2%}"
                echo(f"    {(flag.name or '').lower():<22}{share}  {flag.text}")
    if tally.ratios is not None and tally.ratios.number:
        low, median, high = (f"{tally.ratios.quantile(share):.3g}" for share in (0.05, 0.5, 0.95))
        echo(
            f"displacement over Newmark's, where both slide: median {median}, "
            f"5 to 95 % {low} to {high}"
        )
    if (indices := tally.indices) is None:
        return
    import pandas as pd

    points = sum(indices.status.values())
    there = indices.status[variables.SensitivityStatus.COMPUTED]
    echo(
        f"Sobol indices of the permanent displacement, at {there} of {points} grid points, and "
        "their means:"
    )
    if there:
        columns = {
            "first order": indices.first,
            "total": indices.total,
            "largest total at": indices.largest,
        }
        rows = pd.DataFrame(columns).sort_values("total", ascending=False)
        echo(rows.to_string(float_format="{:.3f}".format))
    for status, count in indices.status.items():
        if count and status is not variables.SensitivityStatus.COMPUTED:
            echo(f"  none at {count} ({status.name.lower()}): {status.text}")


def echo_suite(table: "xr.Dataset", most: int, typed: Sequence[str] | None = None) -> None:
    """Print the statistics of a suite or of samples at `most` grid points.

    P(u > d) is that of the displacements `typed`.
    """
    stored = {"permanent_displacement", "validity"} <= {
        *table.data_vars
    } and "limit_amplitude" not in table
    sampled = "displacement_quantile" in table and (typed or "suite" in table.attrs)
    if sampled or (stored and table["permanent_displacement"].sizes.get("motion", 1) > 1):
        from slipsweep.studies.suite_statistics import summary_lines

        lengths = displacements(typed, float(table.attrs["g"])) if typed else None
        echo(*summary_lines(table, lengths, most))
