"""`slipsweep limit`: the amplitude at which a tolerable displacement is reached."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import (
    FIGURES,
    OUTPUT,
    Chunks,
    Memory,
    Overwrite,
    Quiet,
    Resume,
    Scheduler,
    Workers,
    check_ending,
    displacements,
    echo_found,
    place_of,
    progress_bar,
    taken_as,
    write_figure,
)
from slipsweep.cli.help import Panel
from slipsweep.errors import InputError
from slipsweep.model.variables import LimitStatus

if TYPE_CHECKING:
    import xarray as xr

    from slipsweep.files.spec import SweepSpec
    from slipsweep.files.storing import Place

#: The group of options that only this command has.
LIMIT = Panel("Limit")

EXAMPLE = "Example: slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png"

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
    chunks = Chunks(overwrite, resume, memory, workers, scheduler)
    results: list[Place] = []
    figures: list[Path] = []
    for text in output or []:
        path = Path(text)
        check_ending(path, (".nc", ".zarr", *FIGURES))
        if path.suffix in FIGURES:
            figures.append(path)
        else:
            results.append(place_of(text))
    for option in chunks.given() if not results else []:
        raise InputError(f"{option}: needs -o OUT.nc, whose chunks are solved and written one after the other")

    from slipsweep.files import outputs, spec
    from slipsweep.files.jobs import limit_job

    if len(results) > 1:
        files = [one for one in results if isinstance(one, Path)]
        outputs.check_outputs(files, overwrite, reads=())  # one name given twice is refused as such
        raise InputError(f"{results[1]}: a second result, beside {results[0]}; give one")
    checked = spec.load(sweep)
    outputs.check_outputs(figures, overwrite, reads=checked.files)
    job = limit_job(checked, *_asked(checked, displacement, maximum_amplitude))
    if results:
        from slipsweep.files.opening import read_result

        report = chunks.run(job, results[0], quiet)
        if report.found and not quiet:
            echo_found(report.path)
        table = read_result(report.path)
    else:
        with checked.named(), progress_bar(job.plan.cells, quiet) as progress:
            table = job.plan.solve(progress)
    if figures:
        from slipsweep.charts.limit_figures import limit_chart

        labelled = table.assign_coords(label=("case", list(job.labels))) if job.labels else table
        figure = limit_chart(labelled)
        for path in figures:
            write_figure(figure, path, overwrite)
    if not quiet:
        _summarize(table)
        for text in output or []:
            typer.echo(text)


def _asked(
    sweep: "SweepSpec", displacement: list[str], maximum_amplitude: str | None
) -> tuple[float | list[float], float | None]:
    """Tolerable displacements and the end of the search, in SI units."""
    from slipsweep.model.units import quantity

    g = sweep.model.g
    lengths = displacements(displacement, g)
    highest = None if maximum_amplitude is None else quantity("--maximum-amplitude", maximum_amplitude, "m s-2", g)
    # one is one number; several are a dimension, in order and without repetition
    return (lengths if len(displacement) > 1 else lengths[0]), highest


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
    grid, suite = found["value_count"].sizes, [dim for dim in ("motion", "polarity") if dim in limits.dims]
    order = [limits.dims.index(dim) for dim in (*grid, *suite)]
    each = limits.values.transpose(order).reshape(found["value_count"].values.size, -1)
    names = point_names(table, {dim: limits.sizes[dim] for dim in suite})
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
