"""`slipsweep run`: a sweep computed and written."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slipsweep.cli.common import Overwrite, Quiet, Watch, echo_tally, examples, progress_bar, typed_command
from slipsweep.errors import InputError
from slipsweep.model.options import SOLVERS

if TYPE_CHECKING:
    from slipsweep.files.spec import SweepSpec

EXAMPLE = examples(
    "slipsweep run sweeps/design_chart.toml",
    "slipsweep run sweeps/paper.toml -o paper.nc --overwrite",
    "slipsweep run design_chart.nc -o again.nc --quiet",
)


def run(
    sweep: Annotated[
        Path,
        typer.Argument(
            metavar="SWEEP.toml|OUT.nc", help="A sweep file (- for standard input), or an earlier result to make again."
        ),
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
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", help="Solve on N processes of this machine (needs the extra [cluster])."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Solve on the workers of the dask scheduler at HOST:PORT."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compute a sweep and write it to a netCDF file."""
    from slipsweep.files import spec
    from slipsweep.grid.resources import parse_size, size_text
    from slipsweep.runs import solving, store

    if resume and overwrite:
        raise InputError("--resume, --overwrite: either goes on with an interrupted run or starts anew; give one")
    checked = spec.load(sweep)
    if solver is not None and checked.record is not None:
        raise InputError(f"--solver {solver}: not allowed with excitation.record, to which the response is exact")
    if solver is not None:
        same = solver == checked.solver.name  # with the options that the sweep file gives it
        checked = checked if same else checked.with_solver(SOLVERS.of(solver))
    if output is None and checked.output.path is None and spec.is_stream(sweep):
        raise InputError(f"{sweep}: a sweep from a pipe has no name; give the output's with -o or output.path")
    path = output or Path(checked.output.path or f"{sweep.stem}.nc")
    if split and output is None:
        path = path.with_suffix("")
    if checked.sampling is not None:
        refused = {
            "--resume": resume,
            "--split": split,
            "--memory": memory is not None,
            "--workers": workers is not None,
            "--scheduler": scheduler is not None,
        }
        for option, given in refused.items():
            if given:
                raise InputError(f"{option}: not with [uncertainty], whose statistics are one small file")
        _run_samples(checked, path, overwrite, quiet)
        return
    cells = None if memory is None else solving.cells_within(parse_size("--memory", memory), checked, workers or 0)
    watch = Watch()
    with ExitStack() as stack:
        solved: solving.Solved = solving.solve_here
        shared = None
        if workers is not None or scheduler is not None:
            from slipsweep.runs.cluster import cluster

            solved = stack.enter_context(cluster(workers=workers, scheduler=scheduler))
            shared = solving.cells_shared(checked, workers)
        progress = stack.enter_context(progress_bar(checked.cells, quiet))
        report = store.run(
            checked,
            path,
            command=typed_command(),
            overwrite=overwrite,
            resume=resume,
            split=split,
            block_cells=cells,
            shared_cells=shared,
            progress=progress,
            solved=solved,
        )
    if quiet:
        return
    grid = " x ".join(f"{length} {dim}" for dim, length in report.shape.items())
    typer.echo(f"{report.tally.cells} cells ({grid}) in {watch.text(report.tally.cells, 'cells', report.seconds)}")
    echo_tally(report.tally)
    typer.echo(f"{report.path}  {size_text(report.nbytes)}")


def _run_samples(sweep: "SweepSpec", path: Path, overwrite: bool, quiet: bool) -> None:
    """Sample the uncertain inputs of a sweep, and write the statistics."""
    from slipsweep.files import netcdf, outputs
    from slipsweep.grid.resources import size_text
    from slipsweep.studies.uncertainty import plan_samples, tally

    assert sweep.sampling is not None
    outputs.check_outputs([path], overwrite, reads=sweep.files)
    watch = Watch()
    try:
        given = {name: value for name, value in sweep.arguments().items() if name != "variables"}
        plan = plan_samples(sweep.sampling, **given)
        with progress_bar(plan.cells, quiet, "samples") as progress:
            table = plan.solve(progress)
    except InputError as error:
        raise InputError(f"{sweep.source}: {error}") from None
    netcdf.write_statistics(sweep, table, path, command=typed_command(), overwrite=overwrite)
    if quiet:
        return
    grid = " x ".join(f"{length} {dim}" for dim, length in sweep.shape.items()) or "no axes"
    typer.echo(f"{sweep.cells} grid points ({grid}), {sweep.sampling.samples} samples each")
    typer.echo(f"{plan.cells} samples solved in {watch.text(plan.cells, 'samples')}")
    echo_tally(tally(table, sweep.sampling.samples))
    typer.echo(f"{path}  {size_text(path.stat().st_size)}")
