"""`slipsweep simulate`: one time history."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import Overwrite, Quiet, examples, typed_command
from slipsweep.cli.options import chooses
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Model
from slipsweep.model.variables import HISTORY, VALIDITY_TEXT, FlagKind, SlidingMode, Validity, flags_of
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

if TYPE_CHECKING:
    from slipsweep.grid.tables import Table

EXAMPLE = examples(
    "slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8",
    "slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8 -o history.png -o history.csv",
    "slipsweep simulate --theta 10 --mu-s 0.5 --displacement-amplitude 0.05 --frequency 2 --model newmark",
    "slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8 --waveform triangle --ramp-in 2",
)


@chooses(excitation=WAVEFORMS, model=MODELS)
def simulate(
    *,
    theta: Annotated[float, typer.Option(help="Plane inclination, degrees.")],
    mu_s: Annotated[float, typer.Option(help="Static friction coefficient.")],
    frequency: Annotated[float, typer.Option(help="Excitation frequency, Hz.")],
    amplitude: Annotated[float | None, typer.Option(help="Peak ground acceleration, m/s².")] = None,
    displacement_amplitude: Annotated[
        float | None, typer.Option(help="Peak ground displacement, m, instead of the acceleration.")
    ] = None,
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write .nc, .csv, .png, .svg or .pdf; may be repeated."),
    ] = None,
    overwrite: Overwrite = False,
    excitation: Waveform,
    yield_acceleration: Annotated[
        float | None, typer.Option(help="Yield acceleration, m/s² (default: Coulomb's).")
    ] = None,
    decay_rate: Annotated[float | None, typer.Option(help="Friction decay λ (default: Eq. 6 at the peak).")] = None,
    delta_mu: Annotated[float | None, typer.Option(help="Friction above static Δμ (default: Eqs. 10, 11).")] = None,
    minimum_friction: Annotated[float | None, typer.Option(help="Minimum friction μmin (default: Eq. 9).")] = None,
    structure_frequency: Annotated[
        float | None, typer.Option(help="Natural frequency of the structure, Hz, for the flexible_block flag.")
    ] = None,
    model: Model,
    points: Annotated[int, typer.Option(min=4, help="Points in time per cycle.")] = 512,
    quiet: Quiet = False,
) -> None:
    """Compute the time history of one case, as files and a figure."""
    writers: dict[str, Callable[[Table, Path, bool], None]] = {
        ".nc": _write_netcdf,
        ".csv": _write_csv,
        **dict.fromkeys((".png", ".svg", ".pdf"), _write_figure),
    }
    paths = output or []
    for path in paths:
        if path.suffix not in writers:
            raise InputError(f"{path}: the name must end in one of {', '.join(writers)}")

    from slipsweep.files import outputs
    from slipsweep.studies.history import history_table

    outputs.check_outputs(paths, overwrite, reads=())
    table = history_table(
        theta=theta,
        mu_s=mu_s,
        amplitude=amplitude,
        displacement_amplitude=displacement_amplitude,
        frequency=frequency,
        excitation=excitation,
        yield_acceleration=yield_acceleration,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        structure_frequency=structure_frequency,
        model=model,
        points_per_cycle=points,
    )
    for path in paths:
        writers[path.suffix](table, path, overwrite)
    if quiet:
        return
    typer.echo(f"permanent displacement  {table['permanent_displacement'].item():.6g} m")
    typer.echo(f"peak relative velocity  {table['peak_relative_velocity'].item():.6g} m/s")
    typer.echo(f"sliding mode            {SlidingMode(table['sliding_mode'].item()).name.lower()}")
    for kind in FlagKind:
        for flag in Validity(table["validity"].item()) & flags_of(kind):
            typer.echo(f"{kind:<24}{(flag.name or '').lower()}: {VALIDITY_TEXT[flag]}")
    for path in paths:
        typer.echo(path)


def _write_netcdf(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep.files import netcdf

    netcdf.write_table(
        netcdf.without_time_axis(table),
        path,
        title="Time history of a sliding block",
        command=typed_command(),
        overwrite=overwrite,
    )


def _write_csv(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep.files import outputs

    columns = {name: table[name] for name in ("time", *HISTORY)}
    with (
        outputs.complete_or_absent(path, overwrite) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(f"{name} ({array.attrs['units']})" for name, array in columns.items())
        writer.writerows(zip(*(array.values.tolist() for array in columns.values()), strict=True))


def _write_figure(table: "Table", path: Path, overwrite: bool) -> None:
    from slipsweep.charts import figures
    from slipsweep.files import outputs

    figure = figures.history(table)
    with outputs.complete_or_absent(path, overwrite) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=150)
