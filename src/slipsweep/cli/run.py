"""`slipsweep example`, which writes sweep files of slipsweep, and `slipsweep run`."""

import math
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from slipsweep.cli import common, options
from slipsweep.cli.common import echo, range_text
from slipsweep.cli.options import Large
from slipsweep.errors import InputError, did_you_mean
from slipsweep.files import outputs
from slipsweep.model import variables
from slipsweep.model.options import solver_for

if TYPE_CHECKING:
    import xarray as xr

    from slipsweep.files.spec import SweepSpec

#: Factor on a recorded acceleration above which there is a caution.
_LARGE_FACTOR = 4.0


@options.command("Start", "slipsweep example", "slipsweep example paper")
def example(
    name: Annotated[
        options.Text, options.read("NAME", "Sweep file to write (default: list their names).")
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """List the sweep files that come with slipsweep, or write one with its data."""
    # in the installed package, or at the top of the clone that is installed as it stands
    package = Path(__file__).parents[1]
    folder = next(
        path for path in (package / "sweeps", package.parents[1] / "sweeps") if path.is_dir()
    )
    sweeps = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if name is None:
        titles = {
            stem: tomllib.loads(path.read_text("utf-8"))["output"]["title"]
            for stem, path in sweeps.items()
        }
        echo(*(f"{stem:<14}{title}" for stem, title in titles.items()))
        return
    if name not in sweeps:
        raise InputError(f"NAME = {name}: no such sweep file; {did_you_mean(name, list(sweeps))}")
    from slipsweep.files import spec

    # the sweep file is among the files that are read for it
    sources = {
        path.relative_to(folder): path
        for path in spec.load(sweeps[name]).files
        if isinstance(path, Path)
    }
    present = [path for path in sources if path.parent.is_dir()]
    outputs.check_outputs(present, overwrite, reads=list(sources.values()))
    for path, source in sources.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with outputs.complete_or_absent(path, overwrite) as temporary:
            temporary.write_bytes(source.read_bytes())
        echo(path)


@options.command(
    "Compute",
    "slipsweep run sweeps/design_chart.toml",
    "slipsweep run sweeps/paper.toml -o paper.nc --overwrite",
    "slipsweep run design_chart.nc -o again.nc --quiet",
)
def run(
    *,
    sweep: Annotated[
        Path,
        options.read("SWEEP.toml|OUT.nc", "Sweep file (-: standard input), or a result to repeat."),
    ],
    solver: Annotated[
        Literal["auto", "step", "cycle"] | None,
        options.Panel("Solver")("Solver, instead of solver.method."),
    ] = None,
    output: Annotated[
        str | None,
        options.written(
            "File or store to write (default: output.path, else SWEEP.nc).", "OUT.nc|OUT.zarr"
        ),
    ] = None,
    large: Large,
) -> None:
    """Compute a sweep and write it to a netCDF file or a Zarr store."""
    from slipsweep.files import jobs, opening, spec, storing
    from slipsweep.grid.resources import grid_text, size_text
    from slipsweep.jit import compiling
    from slipsweep.studies.cautions import slides_back_text, unsound_texts, why_nothing_slides

    checked = spec.load(sweep)
    # the solver of the sweep file keeps its options
    if solver is not None and solver != checked.solver.name:
        checked = replace(checked, solver=solver_for(checked.model, solver))
    name = output or checked.output.path
    if name is None and spec.is_stream(sweep):
        raise InputError(
            f"{sweep}: a sweep from a pipe has no name; name the output with -o or output.path"
        )
    path = opening.place_of(name or f"{sweep.stem}.nc")
    outputs.check_endings([path], (".nc", ".zarr") if isinstance(path, Path) else (".zarr",))
    started = time.perf_counter()
    compiled_before = compiling.seconds
    sampling = checked.sampling
    job = jobs.sweep_job(checked)
    unit = "cells" if sampling is None else "samples"
    judged = 0.0  # seconds

    def remarks(results: "xr.Dataset") -> dict[str, str]:
        nonlocal judged
        before = time.perf_counter()
        texts = unsound_texts(results)
        judged += time.perf_counter() - before
        return {common.UNSOUND: "\n".join(texts)} if texts else {}

    report = common.run_job(job, path, large, unit, remarks)
    if large.quiet:
        return
    template = job.plan.template()
    if not report.was_complete:
        cells = job.plan.cells
        grid = grid_text(job.plan.sizes) or "no axes"
        passed = time.perf_counter() - started - judged
        once = compiling.seconds - compiled_before
        compiled = f" ({once:.2f} s to compile, once)" if once > 0.0 else ""
        took = f"in {passed:.2f} s{compiled}, {cells / max(passed - once, 1e-9):.3g} {unit}/s"
        if sampling is None:
            echo(f"{cells} cells ({grid}) {took}")
        else:
            points = math.prod(job.plan.sizes.values())
            more = (
                f", among {sampling.runs} runs each for Sobol indices"
                if sampling.sensitivity
                else ""
            )
            pooled = f"{template.attrs['pooled']} x " if "pooled" in template.attrs else ""
            echo(f"{points} grid points ({grid}), {pooled}{sampling.samples} samples each{more}")
            echo(f"{cells} samples solved {took}")
    echo(f"inputs: {template.attrs['friction_inputs']}")
    for parameter, coordinate in template.coords.items():
        if parameter in variables.PARAMETERS:
            ends = [coordinate.min().item(), coordinate.max().item()][
                : 2 if coordinate.size > 1 else 1
            ]
            echo(f"  {parameter:<24}{range_text(str(parameter), ends, checked.model.g)}")
    if checked.recorded is not None:
        echo(checked.recorded.summary())
        echo(*filter(None, [_scaling_caution(checked)]))
    if "duplicate_motions" in template.attrs:
        echo(f"the same motion under several labels: {template.attrs['duplicate_motions']}")
    common.echo_tally(report.tally)
    result = opening.read_result(report.path)
    echo(*filter(None, [why_nothing_slides(template, report.tally)]))
    common.echo_unsound(result)
    if slides_back := slides_back_text(result, checked.recorded):
        echo(f"caution: {slides_back}")
    common.echo_suite(result, most=20)
    echo(f"{report.path}  {size_text(storing.nbytes_of(report.path))}")


def _scaling_caution(spec: "SweepSpec") -> str | None:
    """Return a line on recorded motions that are scaled by large factors, or None."""
    from slipsweep.grid.plans import plan_sweep

    # the factor depends on these alone; the plan also needs a block, and any will do
    needed = (*variables.STRENGTHS, "time_scale", "azimuth")
    inputs = {name: values for name, values in spec.inputs.items() if name in needed}
    inputs |= {"theta": 0.0, "mu_s": 1.0}
    plan = plan_sweep(inputs, excitation=spec.excitation, variables=["motion_factor"])
    factors = plan.solve()["motion_factor"]
    largest = factors.max(set(factors.dims) - {"motion"})
    if not (largest > _LARGE_FACTOR).any():
        return None
    scaled = f"scale factors above {_LARGE_FACTOR:g}, up to {largest.max().item():.3g}"
    if "motion" in largest.dims:
        labels = largest["motion"].values[largest.values > _LARGE_FACTOR]
        scaled = f"{scaled}: {', '.join(labels)}"
    return f"{scaled}; such motions have the frequencies and the duration of weaker earthquakes"
