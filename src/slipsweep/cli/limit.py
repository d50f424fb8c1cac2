"""`slipsweep limit`: the amplitude, or the strength, for a tolerable displacement."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import Large, Text, Texts, read, written
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.model.parameters import check_choice
from slipsweep.model.units import quantity
from slipsweep.model.variables import REQUIRED_STRENGTHS, LimitStatus, StrengthStatus

if TYPE_CHECKING:
    import xarray as xr

#: Most grid points whose quantiles under a suite are printed, and most limits that are printed
#: individually.
_MOST_POINTS = 12
_MOST_MOTIONS = 60


LIMIT = options.Panel("Limit")


@options.command(
    "Compute",
    "slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png",
    "slipsweep limit suite.toml -d 50mm --of yield_coefficient -o strength.nc -o strength.png",
)
def limit(
    *,
    sweep: Annotated[
        Path,
        read(
            "OUT.nc|SWEEP.toml",
            "A result or sweep file: its model, and its axes but the one that is solved for.",
        ),
    ],
    displacement: Annotated[list[str], options.LENGTH],
    of: Annotated[
        Text,
        LIMIT(
            "What to solve for: amplitude, or the strength of Newmark's block: yield_coefficient, "
            "mu_s, phi.  [default: amplitude]",
            "NAME",
        ),
    ] = None,
    output: Annotated[
        Texts, written("Write .nc, .zarr, .png, .svg or .pdf; may be repeated.", "FILE|URL")
    ] = None,
    maximum_amplitude: Annotated[
        Text,
        LIMIT("End of the search: 2g, 15 (m/s²).  [default: 5g]", "ACCELERATION"),
    ] = None,
    equations: options.Equations = None,
    magnitude: options.Magnitude = None,
    large: Large,
) -> None:
    """Find the limiting PGA, or the required strength, for a tolerable displacement.

    Over all other axes of a sweep; solved again to rounding, not interpolated from the result.
    """
    from slipsweep.files import jobs, opening, spec

    results = [path for path in output or () if Path(path).suffix in (".nc", ".zarr")]
    if len(results) > 1:
        raise InputError(f"{results[1]}: a second result, beside {results[0]}; give one")
    for name in () if results else ("resume", "memory", "workers", "scheduler"):
        if getattr(large, name):
            raise InputError(
                f"--{name}: needs -o OUT.nc, whose chunks are solved and written one after the "
                "other"
            )
    solved_for = check_choice("--of", of or "amplitude", ("amplitude", *REQUIRED_STRENGTHS))
    if solved_for != "amplitude" and maximum_amplitude is not None:
        raise InputError(f"--maximum-amplitude: not with --of {solved_for}")
    beside = options.compared(equations, magnitude)
    if beside and solved_for != "yield_coefficient":
        raise InputError("--equations: only with --of yield_coefficient")
    checked = spec.load(sweep)
    named = [Path(path) for path in output or () if path not in results]
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
    # a single displacement is a number; several are a dimension, increasing and each once
    targets = lengths if len(displacement) > 1 else lengths[0]
    if solved_for == "amplitude":
        job = jobs.limit_job(checked, targets, highest)
    else:
        job = jobs.strength_job(checked, targets, solved_for)
    if results:
        table = opening.read_result(common.run_job(job, opening.place_of(results[0]), large).path)
    else:
        with (
            spec.named(checked.source),
            common.progress_bar(job.plan.cells, large.quiet) as progress,
        ):
            table = job.plan.solve(progress)
    labelled = table.assign_coords(label=("case", list(job.labels))) if job.labels else table
    look = {"equations": beside, "magnitude": magnitude}
    common.write_outputs(figures, large.overwrite, labelled, look=look)
    if large.quiet:
        return
    if solved_for == "amplitude":
        _print_limits(table, g)
    else:
        _print_strengths(table, solved_for)
        if beside:
            from slipsweep.studies.published_strength import strength_lines

            echo(*strength_lines(table, beside, magnitude))
    echo(*(output or ()))


def _print_limits(table: "xr.Dataset", g: float) -> None:
    """Print the limit amplitudes: their range, quantiles under a suite, how they were found."""
    from slipsweep.grid.resources import grid_text

    limits = table["limit_amplitude"]
    status = table["limit_status"]
    sizes = {str(dim): size for dim, size in limits.sizes.items()}
    echo(f"{limits.size} limits ({grid_text(sizes) or 'one cell'})")
    if limits.notnull().any():
        values = {"smallest": limits.min(), "median": limits.median(), "largest": limits.max()}
        echo(
            *(
                f"  {text:<24}{common.range_text('amplitude', [value.item()], g)}"
                for text, value in values.items()
            )
        )
    lengths = ", ".join(f"{length:.6g}" for length in table["displacement"].values.flat)
    end = common.range_text("amplitude", [float(table.attrs["maximum_amplitude"])], g)
    echo(
        f"displacement {lengths} m, searched up to {end}",
        f"inputs: {table.attrs['friction_inputs']}",
    )
    if limits.sizes.get("motion", 1) > 1:
        _summarize_suite(table, g)
    _print_status(status, LimitStatus)


def _print_status(status: "xr.DataArray", codes: type[LimitStatus | StrengthStatus]) -> None:
    """Print the shares of the codes of a status."""
    echo(f"status ({status.name}):")
    for code in codes:
        share = float((status == code).mean())
        if share:
            echo(f"  {code.name.lower():<24}{share:7.2%}  {code.text}")


def _summarize_suite(table: "xr.Dataset", g: float) -> None:
    """Print the suite's quantiles at every grid point, and the limit of each motion."""
    import numpy as np
    import pandas as pd

    from slipsweep.studies.suite_statistics import limit_quantiles, point_names, suite_dims

    limits = table["limit_amplitude"] / g
    limit_statistics = limit_quantiles(table)
    grid = limit_statistics["value_count"].sizes
    suite = {dim: limits.sizes[dim] for dim in suite_dims(limits)}
    points = point_names(table, grid)
    quantiles = (
        limit_statistics["limit_quantile"].transpose(*grid, ...).values.reshape(len(points), -1) / g
    )
    rows = pd.DataFrame(quantiles, points, ["16 %", "median", "84 %"]).replace(np.inf, np.nan)
    rows["motions"], rows["not reached"] = (
        limit_statistics[f"{name}_count"].values.ravel() for name in ("value", "not_reached")
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


def _print_strengths(table: "xr.Dataset", of: str) -> None:
    """Print the required strengths: their range, quantiles of a suite or of samples, how found."""
    from slipsweep.grid.resources import grid_text

    name = f"required_{of}"
    units = REQUIRED_STRENGTHS[of]["units"].removeprefix("1")
    if name in table:
        strengths = table[name]
        sizes = {str(dim): size for dim, size in strengths.sizes.items()}
        echo(f"{strengths.size} required strengths ({grid_text(sizes) or 'one cell'})")
        if strengths.notnull().any():
            for text, value in (
                ("smallest", strengths.min()),
                ("median", strengths.median()),
                ("largest", strengths.max()),
            ):
                echo(f"  {text:<24}{of} {value.item():.6g} {units}".rstrip())
    lengths = ", ".join(f"{length:.6g}" for length in table["displacement"].values.flat)
    echo(f"displacement {lengths} m")
    if "criterion" in table.attrs:
        echo(f"by the {table.attrs['criterion']}")
    echo(f"inputs: {table.attrs['friction_inputs']}")
    if "always_within_count" in table:
        _summarize_strengths(table, name)
    if name in table:
        _print_status(table["required_status"], StrengthStatus)


def _summarize_strengths(table: "xr.Dataset", name: str) -> None:
    """Print quantiles of a suite or of samples at every grid point, and each motion's strength."""
    import numpy as np
    import pandas as pd

    from slipsweep.studies.suite_statistics import point_names, suite_dims

    quantiles = table[f"{name}_quantile"]
    grid = {dim: size for dim, size in quantiles.sizes.items() if dim != "quantile"}
    factors = {"amplitude": 1.0 / float(table.attrs["g"])}
    points = point_names(table, grid, factors)
    shares = [
        "median" if share == 0.5 else f"{100.0 * share:.3g} %" for share in table["quantile"].values
    ]
    values = quantiles.transpose(*grid, "quantile").values.reshape(len(points), -1)
    rows = pd.DataFrame(values, points, shares).replace(np.inf, np.nan)
    rows["always"] = table["always_within_count"].transpose(*grid).values.ravel()
    rows["never"] = table["never_within_count"].transpose(*grid).values.ravel()
    runs = str(table.attrs.get("pooled", ""))
    if "samples" in table.attrs:
        runs = f"{runs} x {table.attrs['samples']} samples".removeprefix(" x ")
    echo(f"quantiles of {name} over {runs} (PGA in g):")
    echo(rows.head(_MOST_POINTS).to_string(float_format="{:.4g}".format, na_rep="none"))
    if len(points) > _MOST_POINTS:
        echo(f"and {len(points) - _MOST_POINTS} grid points more")
    if name in table and table[name].size <= _MOST_MOTIONS:
        suite = {dim: table.sizes[dim] for dim in suite_dims(table[name])}
        each = table[name].transpose(*suite, *grid).values.reshape(-1, len(points))
        echo(f"{name} of the motions, at each grid point:")
        motions = pd.DataFrame(each, point_names(table, suite))
        echo(motions.to_string(header=False, float_format="{:.4g}".format, na_rep="none"))
