"""`slipsweep limit`: the amplitude at which a tolerable displacement is reached."""

from collections.abc import Hashable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import Large, Text, Texts, read, written
from slipsweep.errors import InputError
from slipsweep.model.units import quantity
from slipsweep.model.variables import LimitStatus

if TYPE_CHECKING:
    import xarray as xr

#: Most grid points whose quantiles under a suite are printed, and limits that are printed one by one.
_MOST_POINTS, _MOST_MOTIONS = 12, 60


@options.command("Compute", "slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png")
def limit(
    *,
    sweep: Annotated[Path, read("OUT.nc|SWEEP.toml", "A result or sweep file: its model and axes but amplitude.")],
    displacement: Annotated[list[str], options.LENGTH],
    output: Annotated[Texts, written("Write .nc, .zarr, .png, .svg or .pdf; may be repeated.", "FILE|URL")] = None,
    maximum_amplitude: Annotated[
        Text, options.Panel("Limit")("End of the search: 2g, 15 (m/s²).  [default: 5g]", "ACCELERATION")
    ] = None,
    large: Large,
) -> None:
    """Find the limiting PGA for a tolerable displacement.

    Over all other axes of a sweep; solved again to rounding, not interpolated from the result.
    """
    from slipsweep.files import jobs, opening, spec
    from slipsweep.grid.resources import grid_text

    results = [one for one in output or () if Path(one).suffix in (".nc", ".zarr")]
    if len(results) > 1:
        raise InputError(f"{results[1]}: a second result, beside {results[0]}; give one")
    for name in () if results else ("resume", "memory", "workers", "scheduler"):
        if getattr(large, name):
            raise InputError(f"--{name}: needs -o OUT.nc, whose chunks are solved and written one after the other")
    checked = spec.load(sweep)
    named = [Path(one) for one in output or () if one not in results]
    figures = common.check_outputs(named, (*FIGURES, ".nc", ".zarr"), large.overwrite, checked.files)
    g = checked.model.g
    lengths = options.displacements(displacement, g)
    highest = None if maximum_amplitude is None else quantity("--maximum-amplitude", maximum_amplitude, "m s-2", g)
    # one is one number; several are a dimension, in order and without repetition
    job = jobs.limit_job(checked, lengths if len(displacement) > 1 else lengths[0], highest)
    if results:
        table = opening.read_result(common.run_job(job, opening.place_of(results[0]), large).path)
    else:
        with spec.named(checked.source), common.progress_bar(job.plan.cells, large.quiet) as progress:
            table = job.plan.solve(progress)
    labelled = table.assign_coords(label=("case", list(job.labels))) if job.labels else table
    common.write_outputs(figures, large.overwrite, labelled)
    if large.quiet:
        return
    limits, status = table["limit_amplitude"], table["limit_status"]
    echo(f"{limits.size} limits ({grid_text({str(dim): size for dim, size in limits.sizes.items()}) or 'one cell'})")
    if limits.notnull().any():
        values = {"smallest": limits.min(), "median": limits.median(), "largest": limits.max()}
        echo(*(f"  {text:<24}{common.range_text('amplitude', [value.item()], g)}" for text, value in values.items()))
    wanted = ", ".join(f"{one:.6g}" for one in table["displacement"].values.flat)
    end = common.range_text("amplitude", [float(table.attrs["maximum_amplitude"])], g)
    echo(f"displacement {wanted} m, searched up to {end}", f"inputs: {table.attrs['friction_inputs']}")
    if limits.sizes.get("motion", 1) > 1:
        _summarize_suite(table, g)
    shares = {one: float((status == one).mean()) for one in LimitStatus}
    rows = (f"  {one.name.lower():<24}{share:7.2%}  {one.text}" for one, share in shares.items() if share)
    echo("status (limit_status):", *rows, *(output or ()))


def _summarize_suite(table: "xr.Dataset", g: float) -> None:
    """Print the limit of each motion, and the suite's quantiles, at every grid point."""
    from slipsweep.studies.suite_statistics import limit_quantiles, point_names, suite_dims

    def text(value: float) -> str:
        return f"{value:.6g} ({value / g:.4g})" if abs(value) < float("inf") else "none"

    limits, found = table["limit_amplitude"], limit_quantiles(table)
    grid = found["value_count"].sizes
    suite: dict[Hashable, int] = {dim: limits.sizes[dim] for dim in suite_dims(limits)}
    points, names = point_names(table, grid), point_names(table, suite)
    each = limits.transpose(*grid, *suite).values.reshape(len(points), -1)
    quantiles = found["limit_quantile"].values.reshape(len(points), -1)
    counts, beyond = (found[name].values.ravel() for name in ("value_count", "not_reached_count"))
    width = max(24, *map(len, names))
    echo("16 %, median and 84 % of the suite, m/s2 (g); a limit not reached is larger than all others:")
    for at, point in enumerate(points[:_MOST_POINTS]):
        of = f"of {counts[at]}" + (f", {beyond[at]} of them not reached" if beyond[at] else "")
        echo(f"  {point + ': ' if point else ''}{', '.join(map(text, quantiles[at]))} {of}")
        for name, value in zip(names, each[at], strict=True) if each.size <= _MOST_MOTIONS else ():
            echo(f"    {name.removeprefix('motion = '):<{width}}{text(value)}")
    if len(points) > _MOST_POINTS:
        echo(f"  and {len(points) - _MOST_POINTS} grid points more")
