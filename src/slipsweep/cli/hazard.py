"""`slipsweep hazard`: the mean annual rate at which a displacement is exceeded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import FIGURES, OUTPUT, Overwrite, Quiet, check_ending, cuts, write_figure
from slipsweep.cli.help import Panel
from slipsweep.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: The group of options that only this command has.
HAZARD = Panel("Hazard")

EXAMPLE = "Example: slipsweep hazard suite.nc --curve hazard.csv -d 50mm -d 0.3 -o hazard.png"


def hazard(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help="A result under a suite, with an axis amplitude.")],
    curve: Annotated[Path, HAZARD('Columns "PGA (g)" and "annual rate", from low to high.', metavar="HAZARD.csv")],
    displacement: Annotated[
        list[str], HAZARD("To exceed: 50mm, 0.05 (m); may be repeated.", "--displacement", "-d", metavar="LENGTH")
    ],
    at: Annotated[
        list[str] | None, HAZARD("One value of another axis: mu_s=0.4 (default: all).", metavar="NAME=VALUE")
    ] = None,
    output: Annotated[
        list[Path] | None, OUTPUT("Write .png, .svg or .pdf; may be repeated.", "--output", "-o", metavar="FILE")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Compute the mean annual rate of exceeding a displacement.

    From a hazard curve and the fragility under a suite of recorded motions.
    """
    paths = output or []
    for path in paths:
        check_ending(path, FIGURES)
    from slipsweep.files import outputs
    from slipsweep.files.opening import read_result
    from slipsweep.files.selection import places_at

    outputs.check_outputs(paths, overwrite, reads=[file, curve])
    from slipsweep.model.parameters import check_values
    from slipsweep.model.units import quantity
    from slipsweep.studies.hazard import hazard_table, read_hazard_curve

    table = read_result(file)
    names = ["permanent_displacement", "validity"]
    for name in names:
        if name not in table.data_vars:
            raise InputError(f"{file}: {name}: not in this file, which has {', '.join(map(str, table.data_vars))}")
    table = table[names].load()
    axes = [str(dim) for dim in table["permanent_displacement"].dims if dim not in ("amplitude", "motion")]
    places = places_at(table, file, cuts(at), axes)
    for name, found in places.items():
        if found.size > 1:
            raise InputError(f"{file}: --at {name}: {found.size} values; must be one")
    if "g" not in table.attrs:
        raise InputError(f"{file}: attribute g is missing: must be there, m/s2")
    g = float(table.attrs["g"])
    lengths = sorted({quantity("--displacement", text, "displacement_amplitude", g) for text in displacement})
    check_values("displacement", lengths, "--displacement")
    given = read_hazard_curve(curve, g)
    table = table.isel({name: int(found[0]) for name, found in places.items()}, missing_dims="ignore")
    rates = hazard_table(table, given, thresholds=lengths)
    if paths:
        from slipsweep.charts import hazard_figures

        marked = rates["threshold"].values
        drawn = hazard_table(table, given, thresholds=hazard_figures.drawn_thresholds(table, marked))
        figure = hazard_figures.hazard_chart(drawn, marked=marked)
        for path in paths:
            write_figure(figure, path, overwrite)
    if not quiet:
        _summarize(rates, g)
        for path in paths:
            typer.echo(path)


def _summarize(rates: "xr.Dataset", g: float) -> None:
    import numpy as np

    from slipsweep.studies.suite_statistics import point_names

    attrs = rates.attrs
    typer.echo(f"P(u > d | PGA): share over {attrs['suite_dimensions'].replace(' ', ' and ')}")
    for text, name in (("amplitudes of the result", "amplitude_range"), ("hazard curve", "hazard_curve_range")):
        low, high = attrs[name]
        typer.echo(f"{text:<25}{low:.6g} to {high:.6g} m/s2 ({low / g:.4g} to {high / g:.4g} g)")
    typer.echo(
        "above these amplitudes P is held constant; below them it is taken as 0; "
        "below the hazard curve no rate is counted"
    )
    thresholds = rates["threshold"].values
    columns = [rates[name].values.reshape(-1, thresholds.size) for name in ("annual_rate", "held_rate", "omitted_rate")]
    shares = rates["valueless_share"].values.reshape(-1)
    for number, point in enumerate(point_names(rates, rates["valueless_share"].sizes)):
        if point:
            typer.echo(point)
        if shares[number] > 0.0:
            typer.echo(f"  no value: up to {shares[number]:.1%} of the motions at an amplitude; they are not counted")
        if np.isnan(columns[0][number]).any():
            typer.echo("  no annual rate: fewer than two amplitudes have a value")
            continue
        typer.echo(f"  {'d (m)':<12}{'annual rate':>12}{'period (years)':>16}{'held above':>12}{'left out below':>16}")
        for d, rate, held, omitted in zip(thresholds, *(one[number] for one in columns), strict=True):
            if rate > 0.0:
                left = "not known" if np.isnan(omitted) else f"<= {omitted / rate:.2%}"
                typer.echo(f"  {d:<12.6g}{rate:>12.4g}{1.0 / rate:>16.4g}{held / rate:>12.2%}{left:>16}")
            else:
                typer.echo(f"  {d:<12.6g}{0:>12}  exceeded by no motion at any amplitude of the result")
