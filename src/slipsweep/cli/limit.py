"""`slipsweep limit`: the amplitude at which a tolerable displacement is reached."""

from collections.abc import Hashable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import (
    FIGURES,
    OUTPUT,
    Memory,
    Overwrite,
    Panel,
    Quiet,
    Resume,
    Scheduler,
    Workers,
    check_outputs,
    displacements,
    examples,
    progress_bar,
    run_job,
    taken_as,
    write_outputs,
)
from slipsweep.errors import InputError
from slipsweep.model.variables import LimitStatus

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

LIMIT = Panel("Limit")

EXAMPLE = examples("slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png")

#: Most grid points whose quantiles under a suite are printed, and limits that are printed one by one.
_MOST_POINTS, _MOST_MOTIONS = 12, 60


def limit(
    sweep: Annotated[
        Path,
        typer.Argument(metavar="OUT.nc|SWEEP.toml", help="A result or sweep file: its model and axes but amplitude."),
    ],
    displacement: Annotated[
        list[str], LIMIT("Tolerable: 50mm, 0.05 (m); may be repeated.", "--displacement", "-d", metavar="LENGTH")
    ],
    output: Annotated[
        list[str] | None,
        OUTPUT("Write .nc, .zarr, .png, .svg or .pdf; may be repeated.", "--output", "-o", metavar="FILE|URL"),
    ] = None,
    maximum_amplitude: Annotated[
        str | None, LIMIT("End of the search: 2g, 15 (m/s²).  [default: 5g]", metavar="ACCELERATION")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    resume: Resume = False,
    memory: Memory = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Find the limiting PGA for a tolerable displacement.

    Over all other axes of a sweep; solved again to rounding, not interpolated from the result.
    """
    from slipsweep.files import spec
    from slipsweep.files.jobs import limit_job
    from slipsweep.files.opening import place_of, read_result
    from slipsweep.model.units import quantity

    results = [one for one in output or () if Path(one).suffix in (".nc", ".zarr")]
    if len(results) > 1:
        raise InputError(f"{results[1]}: a second result, beside {results[0]}; give one")
    large = {"--resume": resume, "--memory": memory, "--workers": workers, "--scheduler": scheduler}
    for option in [name for name, value in large.items() if value] if not results else ():
        raise InputError(f"{option}: needs -o OUT.nc, whose chunks are solved and written one after the other")
    checked = spec.load(sweep)
    named = [Path(one) for one in output or () if one not in results]
    figures = check_outputs(named, (*FIGURES, ".nc", ".zarr"), overwrite, checked.files)
    g = checked.model.g
    lengths = displacements(displacement, g)
    highest = None if maximum_amplitude is None else quantity("--maximum-amplitude", maximum_amplitude, "m s-2", g)
    # one is one number; several are a dimension, in order and without repetition
    job = limit_job(checked, lengths if len(displacement) > 1 else lengths[0], highest)
    if results:
        report = run_job(
            job,
            place_of(results[0]),
            quiet,
            overwrite=overwrite,
            resume=resume,
            memory=memory,
            workers=workers,
            scheduler=scheduler,
        )
        table = read_result(report.path)
    else:
        with checked.named(), progress_bar(job.plan.cells, quiet) as progress:
            table = job.plan.solve(progress)

    def figure() -> "Figure":
        from slipsweep.charts.kinds import figure_of

        return figure_of(table.assign_coords(label=("case", list(job.labels))) if job.labels else table)

    write_outputs(figures, overwrite, figure)
    if not quiet:
        _summarize(table)
        for text in output or ():
            typer.echo(text)


def _summarize(table: "xr.Dataset") -> None:
    import numpy as np

    from slipsweep.grid.resources import grid_text

    limits, status = table["limit_amplitude"], table["limit_status"].values
    grid = grid_text({str(dim): size for dim, size in limits.sizes.items()}) or "one cell"
    typer.echo(f"{limits.values.size} limits ({grid})")
    g = float(table.attrs["g"])
    found = limits.values[~np.isnan(limits.values)]
    if found.size:
        for text, value in (("smallest", found.min()), ("median", np.median(found)), ("largest", found.max())):
            typer.echo(f"  {text:<24}{value:.6g} m/s2 ({value / g:.4g} g)")
    wanted = ", ".join(f"{one:.6g}" for one in np.atleast_1d(table["displacement"].values))
    highest = taken_as({"amplitude": float(table.attrs["maximum_amplitude"])}, g).removeprefix("amplitude ")
    typer.echo(f"displacement {wanted} m, searched up to {highest}")
    typer.echo(f"inputs: {table.attrs['friction_inputs']}")
    if limits.sizes.get("motion", 1) > 1:
        _summarize_suite(table, g)
    typer.echo("status (limit_status):")
    for one in LimitStatus:
        share = np.count_nonzero(status == one) / status.size
        if share:
            typer.echo(f"  {one.name.lower():<24}{share:7.2%}  {one.text}")


def _summarize_suite(table: "xr.Dataset", g: float) -> None:
    """Print the limit of each motion, and the suite's quantiles, at every grid point."""
    from slipsweep.studies.suite_statistics import limit_quantiles, point_names

    limits = table["limit_amplitude"]
    found = limit_quantiles(table, (0.16, 0.5, 0.84))
    grid = found["value_count"].sizes
    suite: dict[Hashable, int] = {dim: limits.sizes[dim] for dim in ("motion", "polarity") if dim in limits.dims}
    each = limits.transpose(*grid, *suite).values.reshape(found["value_count"].size, -1)
    names = point_names(table, suite)
    width = max(24, *map(len, names))
    typer.echo("16 %, median and 84 % of the suite, m/s2 (g); a limit not reached is larger than all others:")
    for number, point in enumerate(point_names(table, grid)[:_MOST_POINTS]):
        quantiles = found["limit_quantile"].values.reshape(-1, 3)[number]
        count, beyond = (found[name].values.reshape(-1)[number] for name in ("value_count", "not_reached_count"))
        of = f"of {count}" + (f", {beyond} of them not reached" if beyond else "")
        typer.echo(f"  {point + ': ' if point else ''}{', '.join(_limit_text(one, g) for one in quantiles)} {of}")
        for name, value in zip(names, each[number], strict=True) if each.size <= _MOST_MOTIONS else ():
            typer.echo(f"    {name.removeprefix('motion = '):<{width}}{_limit_text(value, g)}")
    if each.shape[0] > _MOST_POINTS:
        typer.echo(f"  and {each.shape[0] - _MOST_POINTS} grid points more")


def _limit_text(value: float, g: float) -> str:
    return f"{value:.6g} ({value / g:.4g})" if abs(value) < float("inf") else "none"
