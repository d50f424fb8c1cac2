"""`slipsweep run`: a sweep computed and written."""

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

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
from slipsweep.cli.suite import echo_suite
from slipsweep.errors import InputError
from slipsweep.model.options import SOLVERS
from slipsweep.model.variables import PARAMETERS, SlidingMode

if TYPE_CHECKING:
    import xarray as xr

    from slipsweep.grid.tally import Tally

#: The group of options that only this command has.
SOLVER = Panel("Solver")

EXAMPLE = examples(
    "slipsweep run sweeps/design_chart.toml",
    "slipsweep run sweeps/paper.toml -o paper.nc --overwrite",
    "slipsweep run design_chart.nc -o again.nc --quiet",
)


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
    from slipsweep.files.opening import read_result
    from slipsweep.grid.resources import grid_text, size_text

    chunks = Chunks(overwrite, resume, memory, workers, scheduler)
    checked = spec.load(sweep)
    if solver is not None and checked.recorded is not None:
        raise InputError(f"--solver {solver}: not allowed with recorded motions, to which the response is exact")
    if solver is not None:
        same = solver == checked.solver.name  # with the options that the sweep file gives it
        checked = checked if same else replace(checked, solver=SOLVERS.of(solver))
    if output is None and checked.output.path is None and spec.is_stream(sweep):
        raise InputError(f"{sweep}: a sweep from a pipe has no name; name the output with -o or output.path")
    path = place_of(checked.output.path or f"{sweep.stem}.nc" if output is None else output)
    if isinstance(path, str) and not path.rstrip("/").endswith(".zarr"):
        raise InputError(f"{path}: the name of a store at an address must end in .zarr")
    if isinstance(path, Path) and path.suffix not in (".nc", ".zarr"):
        raise InputError(f"{path}: the name must end in .nc or .zarr, the formats that are written")
    from slipsweep.files.jobs import sweep_job
    from slipsweep.files.storing import nbytes_of

    job = sweep_job(checked)
    watch = Watch()
    unit = "cells" if checked.sampling is None else "samples"
    report = chunks.run(job, path, quiet, unit)
    if quiet:
        return
    grid = grid_text(job.plan.sizes) or "no axes"
    template = job.plan.template()
    about = template.attrs
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
    _echo_inputs(template)
    if checked.recorded is not None:
        typer.echo(checked.recorded.summary())
    if "duplicate_motions" in about:
        typer.echo(f"the same motion under several labels: {about['duplicate_motions']}")
    echo_tally(report.tally)
    if why := _why_nothing_slides(template, report.tally):
        typer.echo(why)
    echo_suite(read_result(report.path), most=20)
    typer.echo(f"{report.path}  {size_text(nbytes_of(report.path))}")


def _echo_inputs(table: "xr.Dataset") -> None:
    """Print the ranges of the parameters, with their units, accelerations also in g."""
    g = float(table.attrs["g"])
    for name, one in table.coords.items():
        if name not in PARAMETERS:
            continue
        ends = [float(one.min()), float(one.max())][: 2 if one.size > 1 else 1]
        units = PARAMETERS[str(name)]["units"]
        text = f"{' to '.join(f'{end:.6g}' for end in ends)}{'' if units == '1' else f' {units}'}"
        in_g = f" ({' to '.join(f'{end / g:.4g}' for end in ends)} g)" if units == "m s-2" else ""
        typer.echo(f"  {name:<24}{text}{in_g}")


def _why_nothing_slides(table: "xr.Dataset", tally: "Tally") -> str:
    """The likely reason why every cell is stuck or has no value; empty where one slides."""
    import numpy as np

    modes = tally.modes or {}
    still = modes.get(SlidingMode.STUCK, 0) + modes.get(SlidingMode.MISSING, 0)
    if not modes or still < sum(modes.values()):
        return ""
    g, coords = float(table.attrs["g"]), table.coords
    if modes[SlidingMode.MISSING] == still:
        return (
            "no cell has a value: the flags above say why; statically_unstable: theta reaches the friction angle, "
            "atan(mu_s)"
        )
    if "amplitude" not in coords or not {"theta", "mu_s"} <= {*coords}:
        return "no cell slides"
    if "yield_acceleration" in coords:
        least = float(coords["yield_acceleration"].min())
    else:
        slope = np.arctan(float(coords["mu_s"].min())) - np.radians(float(coords["theta"].max()))
        least = g * float(np.tan(slope))
    largest = float(coords["amplitude"].max())
    hint = '; did you mean units = "g"?' if largest <= 3.0 and largest * g > least else ""
    return (
        f"no cell slides: largest amplitude {largest:.4g} m/s2 = {largest / g:.3g} g, smallest yield acceleration "
        f"{least:.4g} m/s2 = {least / g:.3g} g{hint}"
    )
