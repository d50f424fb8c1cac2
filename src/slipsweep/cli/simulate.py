"""`slipsweep simulate`: one time history."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from slipsweep.cli import common, options
from slipsweep.cli.common import echo
from slipsweep.cli.options import OUTPUT, SHAKING, File
from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs
from slipsweep.model import variables
from slipsweep.model.options import MODELS, Model
from slipsweep.motion.reading import Reading
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

if TYPE_CHECKING:
    import xarray as xr


@options.command(
    "Compute",
    "slipsweep simulate --theta 5 --mu-s 0.38 --amplitude 3.55 --frequency 1.8 -o a.png -o a.csv",
    "slipsweep simulate --theta 5 --mu-s 0.38 --record motion.AT2 --scale 2 -o history.nc",
)
def simulate(
    *,
    typed: Annotated[Any, options.ParameterOptions],
    model: Annotated[Model, MODELS],
    excitation: Annotated[Waveform | None, WAVEFORMS] = None,
    record: Annotated[
        File, SHAKING("A recorded motion: CSV, PEER AT2, K-NET, UNAM, COSMOS or ESM text.", "FILE")
    ] = None,
    reading: Annotated[Mapping[str, Any], Reading],
    output: Annotated[
        options.Paths, options.written("Write .nc, .csv, .png, .svg or .pdf; may be repeated.")
    ] = None,
    overwrite: options.Overwrite = False,
    points: Annotated[
        int | None, OUTPUT("Points in time per cycle of a waveform (default: 512).", min=4)
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Compute the time history of one case, as files and a figure."""
    paths = outputs.check_outputs(
        output,
        overwrite,
        reads=[record] if record else [],
        endings=(".nc", ".csv", *common.FIGURES),
    )
    with_unit = options.in_own_units(vars(typed), model.g)
    for name in reading if record is None else ():
        raise InputError(
            f"{options.option_name(name)}: only with --record, the file of a recorded motion"
        )
    if record is not None and excitation is not None:
        raise InputError(
            f"--waveform {excitation.name}: not allowed with --record, which is the shaking itself"
        )
    from slipsweep.motion.records import read_record
    from slipsweep.studies.cautions import slides_back_text
    from slipsweep.studies.history import simulate as simulated

    try:
        recorded = None if record is None else read_record(record, **reading)
    except InputError as error:  # options as they are typed: --gaps linear for gaps = 'linear'
        raise InputError(re.sub(r"\b(\w+) = '([^']*)'", r"--\1 \2", str(error))) from None
    arguments: dict[str, Any] = {
        **vars(typed),
        **with_unit,
        "excitation": recorded or excitation or WAVEFORMS.default,
    }
    table = simulated(**arguments, model=model, points_per_cycle=points)
    taken_as = _taken_as(table, model.g)
    validity = variables.Validity(table["validity"].item())
    if flags := validity & variables.VALUELESS:
        why = "; ".join(f"{(flag.name or '').lower()}: {flag.text}" for flag in flags)
        raise RunError(f"the model gives no value: {why} ({taken_as})")

    table.attrs["title"] = "Time history of a sliding block"
    continuous = table.get("sliding_mode", 0) == variables.SlidingMode.CONTINUOUS
    if continuous and validity & variables.Validity.FRICTION_ESTIMATED:
        unsound = "continuous sliding with estimated friction: not for design"
        table.attrs[common.UNSOUND] = unsound
    titles = {
        name: f"{name} ({table[name].attrs['units']})"
        for name in ("time", *variables.HISTORY)
        if name in table
    }
    frame = table[[*titles][1:]].to_dataframe().reset_index()[[*titles]].rename(columns=titles)
    common.write_outputs(
        paths,
        overwrite,
        table,
        recorded,
        csv=lambda: frame.to_csv(index=False, lineterminator="\n"),
    )
    if quiet:
        return
    if recorded is not None:
        echo(f"record                  {recorded.summary()}")
    for name in variables.SIGNED:
        if name in table:
            echo(f"{name.replace('_', ' '):<23} {table[name].item():.6g} m")
    if {*variables.EXTREMES} <= {*table}:
        extent = table["largest_displacement"] - table["smallest_displacement"]
        echo(f"{'clearance':<23} {extent.item():.6g} m")
    echo(f"peak relative velocity  {table['peak_relative_velocity'].item():.6g} m/s")
    if "sliding_mode" in table:
        mode = variables.SlidingMode(table["sliding_mode"].item())
        echo(f"sliding mode            {mode.name.lower()}")
    counts = (name for name in variables.RECORD_COUNTS if name in table)
    echo(*(f"{name.replace('_', ' '):<24}{table[name].item()}" for name in counts))
    echo(f"inputs                  {table.attrs['friction_inputs']}")
    if slides_back := slides_back_text(table):
        echo(f"{'caution':<24}{slides_back}")
    for kind in variables.FlagKind:
        flags = validity & variables.flags_of(kind)
        echo(*(f"{kind:<24}{(flag.name or '').lower()}: {flag.text}" for flag in flags))
    if common.UNSOUND in table.attrs:
        echo(f"{common.UNSOUND:<24}{table.attrs[common.UNSOUND]}")
    echo(f"taken as                {taken_as}", *paths)


def _taken_as(table: "xr.Dataset", g: float) -> str:
    """Return the parameters of a time history with their units, also those not typed."""
    texts = (
        f"{name if name == 'mu_s' else name.replace('_', ' ')} "
        f"{common.range_text(name, [table[name].item()], g)}"
        for name in variables.PARAMETERS
        if name in table.coords and table[name].ndim == 0
    )
    return ", ".join(texts)
