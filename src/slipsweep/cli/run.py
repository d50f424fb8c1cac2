"""`slipsweep run`: a sweep computed and written."""

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from slipsweep.cli.common import (
    OUTPUT,
    Chunks,
    Memory,
    Overwrite,
    Quiet,
    Resume,
    Scheduler,
    Watch,
    Workers,
    echo_found,
    echo_tally,
    place_of,
)
from slipsweep.cli.help import Panel, examples
from slipsweep.errors import InputError
from slipsweep.model.options import SOLVERS

#: The group of options that only this command has.
SOLVER = Panel("Solver")

EXAMPLE = examples(
    "slipsweep run sweeps/design_chart.toml",
    "slipsweep run sweeps/paper.toml -o paper.nc --overwrite",
    "slipsweep run design_chart.nc -o again.nc --quiet",
)

#: Endings of what other commands write, and of formats that a table or a chart is often wanted in.
_OTHER_FORMATS = (
    ".png", ".svg", ".pdf", ".jpg", ".jpeg", ".gif", ".csv", ".tsv", ".txt", ".parquet", ".xls", ".xlsx", ".json",
    ".html", ".htm", ".mat", ".npy", ".npz", ".zip",
)  # fmt: skip


def run(
    sweep: Annotated[
        Path, typer.Argument(metavar="SWEEP.toml|OUT.nc", help="Sweep file (-: standard input), or a result to repeat.")
    ],
    solver: Annotated[Literal["auto", "step", "cycle"] | None, SOLVER("Solver, instead of solver.method.")] = None,
    output: Annotated[
        str | None,
        OUTPUT(
            "File or store to write (default: output.path, else SWEEP.nc).", "--output", "-o", metavar="OUT.nc|OUT.zarr"
        ),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    resume: Resume = False,
    memory: Memory = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Compute a sweep and write it to a netCDF file or a Zarr store."""
    from slipsweep.files import spec
    from slipsweep.grid.resources import grid_text, size_text

    chunks = Chunks(overwrite, resume, memory, workers, scheduler)
    checked = spec.load(sweep)
    if solver is not None and checked.recorded is not None:
        raise InputError(f"--solver {solver}: not allowed with recorded motions, to which the response is exact")
    if solver is not None:
        same = solver == checked.solver.name  # with the options that the sweep file gives it
        checked = checked if same else checked.with_solver(SOLVERS.of(solver))
    if output is None and checked.output.path is None and spec.is_stream(sweep):
        raise InputError(f"{sweep}: a sweep from a pipe has no name; name the output with -o or output.path")
    path = place_of(checked.output.path or f"{sweep.stem}.nc" if output is None else output)
    if isinstance(path, str) and not path.rstrip("/").endswith(".zarr"):
        raise InputError(f"{path}: the name of a store at an address must end in .zarr")
    if isinstance(path, Path) and path.suffix.lower() in _OTHER_FORMATS:
        raise InputError(f"{path}: the name must end in .nc or .zarr, the formats that are written")
    from slipsweep.files.jobs import sweep_job

    job = sweep_job(checked)
    watch = Watch()
    unit = "cells" if checked.sampling is None else "samples"
    report = chunks.run(job, path, quiet, unit)
    if quiet:
        return
    grid = grid_text(job.plan.sizes) or "no axes"
    about = job.plan.template().attrs
    if report.found:
        echo_found(report.path)
    else:
        took = watch.text(report.tally.cells, unit)
        if checked.sampling is None:
            typer.echo(f"{report.tally.cells} cells ({grid}) in {took}")
        else:
            points = math.prod(job.plan.sizes.values())
            runs = checked.sampling.sensitivity_runs
            beside = f", and {runs} runs each for Sobol indices" if runs else ""
            pooled = f"{about['pooled']} x " if "pooled" in about else ""
            typer.echo(f"{points} grid points ({grid}), {pooled}{checked.sampling.samples} samples each{beside}")
            typer.echo(f"{report.tally.cells} samples solved in {took}")
    typer.echo(f"inputs: {about['friction_inputs']}")
    if checked.recorded is not None:
        typer.echo(checked.recorded.summary())
    if "duplicate_motions" in about:
        typer.echo(f"the same motion under several labels: {about['duplicate_motions']}")
    echo_tally(report.tally)
    typer.echo(f"{report.path}  {size_text(report.nbytes)}")
