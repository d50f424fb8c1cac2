"""`slipsweep simulate`: one time history."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from slipsweep.cli.common import (
    BLOCK,
    FIGURES,
    OUTPUT,
    RARE,
    SHAKING,
    Overwrite,
    Quiet,
    check_outputs,
    examples,
    netcdf_writer,
    taken_as,
    write_outputs,
)
from slipsweep.cli.options import chooses, option_name
from slipsweep.errors import InputError, RunError
from slipsweep.model.options import MODELS, Model
from slipsweep.model.units import quantity
from slipsweep.model.variables import (
    HISTORY,
    PARAMETERS,
    RECORD_COUNTS,
    VALUELESS,
    FlagKind,
    SlidingMode,
    Validity,
    flags_of,
)
from slipsweep.motion.reading import Reading
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from slipsweep.motion.records import Record

EXAMPLE = examples(
    "slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8 -o a.png -o a.csv",
    "slipsweep simulate --theta 5 --mu-s 0.38 --record motion.AT2 --scale 2 -o history.nc",
)


@chooses(excitation=WAVEFORMS, model=MODELS, reading=Reading)
def simulate(
    *,
    theta: Annotated[str | None, BLOCK("Inclination of the base: 5 (degrees), 0.1rad.", metavar="VALUE")] = None,
    mu_s: Annotated[float | None, BLOCK("Static friction coefficient.")] = None,
    phi: Annotated[str | None, BLOCK("Friction angle instead of --mu-s: 21 (degrees).", metavar="VALUE")] = None,
    yield_acceleration: Annotated[
        str | None, BLOCK("Yield acceleration: 0.1g, 0.98 (m/s²) (default: Coulomb's).", metavar="VALUE")
    ] = None,
    yield_coefficient: Annotated[float | None, RARE("Üy/g of Newmark's block, instead of --theta and --mu-s.")] = None,
    decay_rate: Annotated[float | None, BLOCK("Friction decay λ (default: Eq. 6 at the peak).")] = None,
    delta_mu: Annotated[float | None, BLOCK("Friction above static Δμ (default: Eqs. 10, 11).")] = None,
    minimum_friction: Annotated[float | None, BLOCK("Minimum friction μmin (default: Eq. 9).")] = None,
    structure_frequency: Annotated[
        str | None, RARE("Natural frequency of the structure, Hz: flag flexible_block.", metavar="VALUE")
    ] = None,
    model: Model,
    amplitude: Annotated[str | None, SHAKING("Peak ground acceleration: 0.36g, 3.5 (m/s²).", metavar="VALUE")] = None,
    displacement_amplitude: Annotated[
        str | None, SHAKING("Peak ground displacement instead: 30mm, 0.03 (m); not with a record.", metavar="VALUE")
    ] = None,
    frequency: Annotated[str | None, SHAKING("Excitation frequency, Hz; not with a record.", metavar="VALUE")] = None,
    excitation: Waveform | None = None,
    record: Annotated[
        Path | None, SHAKING("A recorded motion: CSV, PEER AT2, K-NET, COSMOS or ESM text.", metavar="FILE")
    ] = None,
    reading: Mapping[str, Any],
    scale: Annotated[float | None, SHAKING("Factor on a record's acceleration (default: 1).")] = None,
    pgv: Annotated[str | None, RARE("Peak ground velocity to scale a record to: 40cm/s.", metavar="VALUE")] = None,
    arias_intensity: Annotated[str | None, RARE("Arias intensity to scale a record to, m/s.", metavar="VALUE")] = None,
    time_scale: Annotated[float | None, RARE("Factor on a record's time (default: 1).")] = None,
    polarity: Annotated[
        Literal["1", "-1"] | None, SHAKING("Sign of a record; 1: positive drives downslope (default: 1).")
    ] = None,
    output: Annotated[
        list[Path] | None,
        OUTPUT("Write .nc, .csv, .png, .svg or .pdf; may be repeated.", "--output", "-o", metavar="FILE"),
    ] = None,
    overwrite: Overwrite = False,
    points: Annotated[int | None, OUTPUT("Points in time per cycle of a waveform (default: 512).", min=4)] = None,
    quiet: Quiet = False,
) -> None:
    """Compute the time history of one case, as files and a figure."""
    paths = check_outputs(output, (".nc", ".csv", *FIGURES), overwrite, [record] if record else [])
    typed = {
        "theta": theta,
        "phi": phi,
        "amplitude": amplitude,
        "displacement_amplitude": displacement_amplitude,
        "frequency": frequency,
        "pgv": pgv,
        "arias_intensity": arias_intensity,
        "yield_acceleration": yield_acceleration,
        "structure_frequency": structure_frequency,
    }
    given: dict[str, Any] = {
        name: quantity(option_name(name), text, PARAMETERS[name]["units"], model.g)
        for name, text in typed.items()
        if text is not None
    }
    motion = _motion(record, reading, excitation)

    from slipsweep.studies.history import simulate as simulated

    table = simulated(
        **given,
        mu_s=mu_s,
        scale=scale,
        time_scale=time_scale,
        polarity=None if polarity is None else int(polarity),
        yield_coefficient=yield_coefficient,
        decay_rate=decay_rate,
        delta_mu=delta_mu,
        minimum_friction=minimum_friction,
        excitation=motion,
        model=model,
        points_per_cycle=points,
    )
    flags = Validity(table["validity"].item())
    if flags & VALUELESS:
        why = "; ".join(f"{(flag.name or '').lower()}: {flag.text}" for flag in flags & VALUELESS)
        raise RunError(f"the model gives no value: {why} ({taken_as(given, model.g)})")

    def figure() -> "Figure":
        from slipsweep.charts.kinds import figure_of

        return figure_of(table)

    recorded = None if isinstance(motion, Waveform) else motion
    as_netcdf = netcdf_writer(table, "Time history of a sliding block", recorded)
    write_outputs(paths, overwrite, figure, {".nc": as_netcdf, ".csv": lambda path: _write_csv(table, path)})
    if quiet:
        return
    if recorded is not None:
        typer.echo(f"record                  {recorded.summary()}")
    _summarize(table)
    typer.echo(f"{'taken as':<24}{taken_as(given, model.g)}")
    for path in paths:
        typer.echo(path)


def _summarize(table: "xr.Dataset") -> None:
    typer.echo(f"permanent displacement  {table['permanent_displacement'].item():.6g} m")
    typer.echo(f"peak relative velocity  {table['peak_relative_velocity'].item():.6g} m/s")
    if "sliding_mode" in table:
        typer.echo(f"sliding mode            {SlidingMode(table['sliding_mode'].item()).name.lower()}")
    for name in RECORD_COUNTS:
        if name in table:
            typer.echo(f"{name.replace('_', ' '):<24}{table[name].item()}")
    typer.echo(f"inputs                  {table.attrs['friction_inputs']}")
    for kind in FlagKind:
        for flag in Validity(table["validity"].item()) & flags_of(kind):
            typer.echo(f"{kind:<24}{(flag.name or '').lower()}: {flag.text}")


def _motion(record: Path | None, reading: Mapping[str, Any], waveform: Waveform | None) -> "Waveform | Record":
    """The motion of the base that the options name."""
    if record is None:
        for name in reading:
            raise InputError(f"{option_name(name)}: only with --record, the file of a recorded motion")
        return waveform or WAVEFORMS.of(WAVEFORMS.default)
    if waveform is not None:
        raise InputError(f"--waveform {waveform.name}: not allowed with --record, which is the shaking itself")
    from slipsweep.motion.records import read_record

    return read_record(record, **reading)


def _write_csv(table: "xr.Dataset", path: Path) -> None:
    import pandas as pd

    columns = {name: table[name] for name in ("time", *HISTORY) if name in table}
    frame = pd.DataFrame({f"{name} ({one.attrs['units']})": one.values for name, one in columns.items()})
    frame.to_csv(path, index=False)
