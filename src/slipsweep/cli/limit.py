"""`slipsweep limit`: the amplitude at which a tolerable displacement is reached."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import Large, Text, Texts, read, written
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.model.units import quantity
from slipsweep.model.variables import LimitStatus

if TYPE_CHECKING:
    import xarray as xr

#: Most grid points whose quantiles under a suite are printed, and limits that are printed one by
#: one.
_MOST_POINTS = 12
_MOST_MOTIONS = 60


@options.command(
    "Compute", "slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png"
)
def limit(
    *,
    sweep: Annotated[
        Path, read("OUT.nc|SWEEP.toml", "A result or sweep file: its model and axes but amplitude.")
    ],
    displacement: Annotated[list[str], options.LENGTH],
    output: Annotated[
        Texts, written("Write .nc, .zarr, .png, .svg or .pdf; may be repeated.", "FILE|URL")
    ] = None,
    maximum_amplitude: Annotated[
        Text,
        options.Panel("Limit")("End of the search: 2g, 15 (m/s²).  [default: 5g]", "ACCELERATION"),
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
            raise InputError(
                f"--{name}: needs -o OUT.nc, whose chunks are solved and written one after the other"
            )
    checked = spec.load(sweep)
    named = [Path(one) for one in output or () if one not in results]
    figures = outputs.check_outputs(
        named, large.overwrite, reads=checked.files, endings=(*FIGURES, ".nc", ".zarr")
    )
    g = checked.model.g
    lengths = options.displacements(displacement, g)
    highest = (
        None
        if maximum_amplitude is None
        else quantity("--maximum-amplitude", maximum_amplitude, "m s-2", g)
    )
    # one is one number; several are a dimension, in order and without repetition
    job = jobs.limit_job(checked, lengths if len(displacement) > 1 else lengths[0], highest)
    if results:
        table = opening.read_result(common.run_job(job, opening.place_of(results[0]), large).path)
    else:
        with (
            spec.named(checked.source),
            common.progress_bar(job.plan.cells, large.quiet) as progress,
        ):
            table = job.plan.solve(progress)
    labelled = table.assign_coords(label=("case", list(job.labels))) if job.labels else table
    common.write_outputs(figures, large.overwrite, labelled)
    if large.quiet:
        return
    limits = table["limit_amplitude"]
    status = table["limit_status"]
    echo(
        f"{limits.size} limits ({grid_text({str(dim): size for dim, size in limits.sizes.items()}) or 'one cell'})"
    )
    if limits.notnull().any():
        values = {"smallest": limits.min(), "median": limits.median(), "largest": limits.max()}
        echo(
            *(
                f"  {text:<24}{common.range_text('amplitude', [value.item()], g)}"
                for text, value in values.items()
            )
        )
    wanted = ", ".join(f"{one:.6g}" for one in table["displacement"].values.flat)
    end = common.range_text("amplitude", [float(table.attrs["maximum_amplitude"])], g)
    echo(
        f"displacement {wanted} m, searched up to {end}",
        f"inputs: {table.attrs['friction_inputs']}",
    )
    if limits.sizes.get("motion", 1) > 1:
        _summarize_suite(table, g)
    shares = {one: float((status == one).mean()) for one in LimitStatus}
    rows = (
        f"  {one.name.lower():<24}{share:7.2%}  {one.text}"
        for one, share in shares.items()
        if share
    )
    echo("status (limit_status):", *rows, *(output or ()))


def _summarize_suite(table: "xr.Dataset", g: float) -> None:
    """Print the suite's quantiles at every grid point, and the limit of each motion."""
    import numpy as np
    import pandas as pd

    from slipsweep.studies.suite_statistics import limit_quantiles, point_names, suite_dims

    limits = table["limit_amplitude"] / g
    found = limit_quantiles(table)
    grid = found["value_count"].sizes
    suite = {dim: limits.sizes[dim] for dim in suite_dims(limits)}
    points = point_names(table, grid)
    quantiles = found["limit_quantile"].transpose(*grid, ...).values.reshape(len(points), -1) / g
    rows = pd.DataFrame(quantiles, points, ["16 %", "median", "84 %"]).replace(np.inf, np.nan)
    rows["motions"], rows["not reached"] = (
        found[f"{name}_count"].values.ravel() for name in ("value", "not_reached")
    )
    echo("limits of the suite, g; one that is not reached is larger than all others:")
    echo(rows.head(_MOST_POINTS).to_string(float_format="{:.4g}".format, na_rep="none"))
    if len(points) > _MOST_POINTS:
        echo(f"and {len(points) - _MOST_POINTS} grid points more")
    if limits.size <= _MOST_MOTIONS:
        each = pd.DataFrame(
            limits.transpose(*suite, *grid).values.reshape(-1, len(points)),
            point_names(table, suite),
        )
        echo("limits of the motions, g, at each grid point:")
        echo(each.to_string(header=False, float_format="{:.4g}".format, na_rep="none"))
