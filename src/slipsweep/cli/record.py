"""`slipsweep record`: a recorded motion over a grid of blocks."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from slipsweep.cli.common import Overwrite, Quiet, echo_tally, progress_bar, typed_command
from slipsweep.cli.options import chooses, reads_record
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Model

EXAMPLE = "Example: slipsweep record motion.AT2 --theta 5 --mu-s 0.3:0.6:4 --scale 0.5,1,2 -o motion.nc"

#: More points than any axis of a record needs: a typing error, rather.
_MOST_POINTS = 1_000_000


@reads_record
@chooses(model=MODELS)
def record(
    *,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV (time, acceleration), PEER AT2, COSMOS or ESM text.")
    ],
    theta: Annotated[str, typer.Option(metavar="VALUES", help="Plane inclinations, degrees: 5 or 0,5,10 or 0:20:41.")],
    mu_s: Annotated[str, typer.Option(metavar="VALUES", help="Static friction coefficients.")],
    scale: Annotated[str, typer.Option(metavar="VALUES", help="Factors on the acceleration.")] = "1",
    time_scale: Annotated[str, typer.Option(metavar="VALUES", help="Factors on the time.")] = "1",
    polarity: Annotated[Literal["1", "-1", "both"], typer.Option(help="Sign of the record, or both.")] = "1",
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="OUT.nc", help="File to write.")] = None,
    overwrite: Overwrite = False,
    reading: Mapping[str, Any],
    yield_acceleration: Annotated[
        str | None, typer.Option(metavar="VALUES", help="Yield accelerations, m/s² (default: Coulomb's).")
    ] = None,
    decay_rate: Annotated[
        str | None, typer.Option(metavar="VALUES", help="Friction decay λ (default: Eq. 6 at each pulse's peak).")
    ] = None,
    delta_mu: Annotated[
        str | None, typer.Option(metavar="VALUES", help="Friction above static Δμ (default: Eqs. 10, 11).")
    ] = None,
    minimum_friction: Annotated[
        str | None, typer.Option(metavar="VALUES", help="Minimum friction μmin (default: Eq. 9).")
    ] = None,
    model: Model,
    quiet: Quiet = False,
) -> None:
    """Compute the response to a recorded motion, over a grid of blocks and scales."""
    texts = {
        "theta": theta,
        "mu_s": mu_s,
        "scale": scale,
        "time_scale": time_scale,
        "yield_acceleration": yield_acceleration,
        "decay_rate": decay_rate,
        "delta_mu": delta_mu,
        "minimum_friction": minimum_friction,
    }
    given: dict[str, Any] = {name: numbers(name, text) for name, text in texts.items() if text is not None}

    from slipsweep.files import netcdf, outputs
    from slipsweep.grid.resources import size_text
    from slipsweep.grid.tally import Tally
    from slipsweep.motion.records import read_record

    motion = read_record(file, **reading)
    if output is not None:
        outputs.check_outputs([output], overwrite, reads=[file])

    import numpy as np

    from slipsweep.grid.plans import plan_sweep

    plan = plan_sweep(
        excitation=motion,
        model=model,
        polarity=polarity if polarity == "both" else int(polarity),
        **given,
    )
    with progress_bar(math.prod(plan.sizes.values()), quiet) as progress:
        table = plan.solve(progress)
    if output is not None:
        netcdf.write_table(
            table, output, title=table.attrs["title"], command=typed_command(), overwrite=overwrite, record=motion
        )
    if quiet:
        return
    peak = float(np.abs(motion.acceleration).max())
    typer.echo(
        f"{file}: {motion.times.size} samples over {motion.times[-1] - motion.times[0]:.6g} s, "
        f"largest acceleration {peak:.6g} m/s2"
    )
    displacement, validity = table["permanent_displacement"].values, table["validity"].values
    count = displacement.size
    if count == 1:
        typer.echo(f"permanent displacement  {displacement.item():.6g} m")
        typer.echo(f"peak relative velocity  {table['peak_relative_velocity'].item():.6g} m/s")
    else:
        grid = " x ".join(f"{size} {dim}" for dim, size in table.sizes.items())
        typer.echo(f"{count} cells ({grid})")
        if np.isfinite(displacement).any():
            low, high = np.nanmin(displacement), np.nanmax(displacement)
            typer.echo(f"permanent displacement  {low:.6g} to {high:.6g} m")
            typer.echo(f"peak relative velocity  up to {np.nanmax(table['peak_relative_velocity'].values):.6g} m/s")
    for name in ("number_of_slips", "stick_slip_pulses", "continuous_pulses"):
        values = table[name].values
        if (values >= 0).any():
            low, high = values[values >= 0].min(), values.max()
            typer.echo(f"{name.replace('_', ' '):<24}{low}" + (f" to {high}" if high > low else ""))
    tally = Tally(count)
    tally.add({"validity": validity})
    echo_tally(tally)
    if output is not None:
        typer.echo(f"{output}  {size_text(output.stat().st_size)}")


def numbers(name: str, text: str) -> float | list[float]:
    """The values of an option: one number, a list ``a,b,c``, or ``start:stop:num``, evenly spaced."""
    option = f"--{name.replace('_', '-')}"
    try:
        if ":" in text:
            start, stop, num = text.split(":")
            count = int(num)
            if not 2 <= count <= _MOST_POINTS:
                raise ValueError
            low, high = float(start), float(stop)
            return [low + (high - low) * i / (count - 1) for i in range(count)]
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{option} {text}: must be a number, numbers with commas between, or start:stop:num "
            f"(num a whole number from 2 to {_MOST_POINTS})"
        ) from None
    return values if "," in text else values[0]
