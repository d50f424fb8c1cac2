"""`slipsweep run`: a sweep computed and written."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from slipsweep.cli.common import Overwrite, Quiet, echo_tally, examples, progress_bar, typed_command
from slipsweep.errors import InputError

EXAMPLE = examples(
    "slipsweep run sweeps/design_chart.toml",
    "slipsweep run sweeps/paper.toml -o paper.nc --overwrite",
    "slipsweep run design_chart.nc -o again.nc --quiet",
)


def run(
    sweep: Annotated[
        Path,
        typer.Argument(metavar="SWEEP.toml|OUT.nc", help="A sweep file, or an earlier result to make again."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT.nc",
            help="File to write (default: output.path, else the sweep's name with .nc).",
        ),
    ] = None,
    overwrite: Overwrite = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with an interrupted run, from the blocks that it finished.")
    ] = False,
    split: Annotated[
        bool, typer.Option("--split", help="Write a folder with a netCDF file for each block, not one file.")
    ] = False,
    memory: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help="Most memory to take, like 512MiB or 2GB (default: 500 to 600 MB)."),
    ] = None,
    solver: Annotated[
        Literal["auto", "step", "cycle"] | None, typer.Option(help="Solver, over the sweep file's solver.method.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compute a sweep and write it to a netCDF file."""
    from slipsweep import blocks, spec, store
    from slipsweep.resources import parse_size, size_text

    if resume and overwrite:
        raise InputError("--resume, --overwrite: either goes on with an interrupted run or starts anew; give one")
    checked = spec.load(sweep)
    if solver is not None and checked.record is not None:
        raise InputError(f"--solver {solver}: not allowed with excitation.record, to which the response is exact")
    if solver is not None:
        checked = checked.with_solver(solver)
    path = output or Path(checked.output.path or f"{sweep.stem}.nc")
    if split and output is None:
        path = path.with_suffix("")
    cells = None if memory is None else blocks.cells_within(parse_size("--memory", memory), checked)
    if path.exists() and sweep.suffix != ".nc" and path.samefile(sweep):
        raise InputError(f"{path}: is the sweep file itself; give another name with -o")
    with progress_bar(checked.cells, quiet) as progress:
        report = store.run(
            checked,
            path,
            command=typed_command(),
            overwrite=overwrite,
            resume=resume,
            split=split,
            block_cells=cells,
            progress=progress,
        )
    if quiet:
        return
    rate = report.tally.cells / max(report.seconds, 1e-9)
    grid = " x ".join(f"{length} {dim}" for dim, length in report.shape.items())
    typer.echo(f"{report.tally.cells} cells ({grid}) in {report.seconds:.2f} s, {rate:.3g} cells/s")
    echo_tally(report.tally)
    typer.echo(f"{report.path}  {size_text(report.nbytes)}")
