"""`slipsweep limit`: the amplitude at which a tolerable displacement is reached."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slipsweep.cli.common import Overwrite, progress_bar, typed_command
from slipsweep.errors import InputError
from slipsweep.model.variables import LIMIT_STATUS_TEXT, LimitStatus

if TYPE_CHECKING:
    from slipsweep.files.spec import SweepSpec
    from slipsweep.grid.tables import Table

EXAMPLE = "Example: slipsweep limit design_chart.nc --displacement 50mm -o limit.nc -o limit.png"

_TITLE = "Amplitudes at which a tolerable displacement is reached"


def limit(
    sweep: Annotated[
        Path,
        typer.Argument(metavar="OUT.nc|SWEEP.toml", help="A result, or a sweep file: its model and all axes but A's."),
    ],
    displacement: Annotated[
        list[str],
        typer.Option("--displacement", "-d", metavar="LENGTH", help="What is tolerable: 50mm, 2in, 0.05 (m). Repeat."),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write .nc, .png, .svg or .pdf; may be repeated."),
    ] = None,
    maximum_amplitude: Annotated[
        str | None, typer.Option(metavar="ACCELERATION", help="End of the search: 2g, 15 (m/s²).  [default: 5g]")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
) -> None:
    """Find the smallest amplitude that reaches a tolerable displacement, over all other axes of a sweep.

    Solved anew, to the last digit, not interpolated from the result.
    """
    writers: dict[str, Callable[[Table, Path, bool, tuple[str, ...]], None]] = {
        ".nc": _write_netcdf,
        **dict.fromkeys((".png", ".svg", ".pdf"), _write_figure),
    }
    paths = output or []
    for path in paths:
        if path.suffix not in writers:
            raise InputError(f"{path}: the name must end in one of {', '.join(writers)}")

    from slipsweep.files import outputs, spec

    checked = spec.load(sweep)
    if checked.record is not None:
        raise InputError(
            f"{sweep}: excitation.record: limit looks for the amplitude of a harmonic motion; "
            "of a record sweep the scale"
        )
    outputs.check_outputs(paths, overwrite, reads=checked.files)
    given = _arguments(checked, displacement, maximum_amplitude)

    from slipsweep.studies.limits import limit_table

    cells = checked.cells // checked.shape.get("amplitude", checked.shape.get("displacement_amplitude", 1))
    with progress_bar(cells * len(displacement), quiet) as progress:
        table = limit_table(**given, progress=progress)
    labels = checked.labels if "case" in table.sizes else ()
    for path in paths:
        writers[path.suffix](table, path, overwrite, labels)
    if not quiet:
        _summarize(table)
        for path in paths:
            typer.echo(path)


def _arguments(sweep: "SweepSpec", displacement: list[str], maximum_amplitude: str | None) -> dict[str, Any]:
    """Arguments of `limit_table`: those of the sweep but for the amplitude and the time stepping."""
    from slipsweep.model.units import quantity

    if sweep.sampling is not None:
        raise InputError(f"{sweep.source}: has uncertain inputs; limits are those of a sweep without [uncertainty]")
    skipped = ("amplitude", "displacement_amplitude", "solver", "variables")
    given = {name: value for name, value in sweep.arguments().items() if name not in skipped}
    g = sweep.model.g
    lengths = [quantity("--displacement", text, "displacement_amplitude", g) for text in displacement]
    # one is one number; several are a dimension, in order and without repetition
    given["displacement"] = lengths[0] if len(lengths) == 1 else sorted(set(lengths))
    if maximum_amplitude is not None:
        given["maximum_amplitude"] = quantity("--maximum-amplitude", maximum_amplitude, "amplitude", g)
    return given


def _summarize(table: "Table") -> None:
    import numpy as np

    limits, status = table["limit_amplitude"], table["limit_status"].values
    grid = " x ".join(f"{size} {dim}" for dim, size in limits.sizes.items()) or "one cell"
    typer.echo(f"{limits.values.size} limits ({grid})")
    g = float(table.attrs["g"])
    found = limits.values[~np.isnan(limits.values)]
    if found.size:
        for text, value in (("smallest", found.min()), ("median", np.median(found)), ("largest", found.max())):
            typer.echo(f"  {text:<24}{value:.6g} m/s2 ({value / g:.4g} g)")
    typer.echo("status (limit_status):")
    for one in LimitStatus:
        share = np.count_nonzero(status == one) / status.size
        if share:
            typer.echo(f"  {one.name.lower():<24}{share:7.2%}  {LIMIT_STATUS_TEXT[one]}")


def _write_netcdf(table: "Table", path: Path, overwrite: bool, labels: tuple[str, ...]) -> None:
    from slipsweep.files import netcdf

    netcdf.write_table(table, path, title=_TITLE, command=typed_command(), overwrite=overwrite, labels=labels)


def _write_figure(table: "Table", path: Path, overwrite: bool, labels: tuple[str, ...]) -> None:
    from slipsweep.charts import limit_figures
    from slipsweep.files import outputs

    figure = limit_figures.limit_chart(table, labels)
    with outputs.complete_or_absent(path, overwrite) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=150)
