"""Results of every command, and what becomes of them after other programs, and after damage.

`made` writes them; `edited` and `damaged` each pass one through the accidents of a seed (`edits`) and read it again.
"""

from pathlib import Path
from typing import Any, cast
from unittest import mock

import netCDF4
import numpy as np
import pandas as pd
import xarray as xr

from slipsweep.charts.slices import Result
from slipsweep.errors import InputError
from slipsweep.explore.page import read_excerpt
from slipsweep.files import guard, spec
from tests.support import edits
from tests.support.commands import is_served

GRID = """
[axes.theta]
values = [0, 5, 12]
[axes.mu_s]
values = [0.3, 0.5]
[axes.amplitude]
start = 1
stop = 8
num = 6
[axes.frequency]
values = [0.5, 1, 2, 4]
[excitation]
cycles = 3
"""
CASES = """
[[cases]]
label = "mild ± slope, wet"
theta = 5
mu_s = 0.38
[[cases]]
theta = 12
mu_s = 0.5
[axes.amplitude]
values = [1, 3, 6]
[axes.frequency]
values = [1, 2, 4]
[output]
dtype = "float32"
"""
CELL = """
[[cases]]
theta = 5
mu_s = 0.4
amplitude = 4
frequency = 1
"""
STATISTICS = """
[axes.theta]
values = [0, 5]
[axes.amplitude]
values = [2, 4, 6, 8]
[axes.frequency]
values = [1]
[uncertainty]
samples = 16
sensitivity = true
[uncertainty.mu_s]
distribution = "norm"
loc = 0.4
scale = 0.03
"""
RECORD = """
[excitation]
record = "motion.csv"
units = "m/s2"
[axes.theta]
values = [5]
[axes.mu_s]
values = [0.4]
[axes.scale]
values = [1, 2]
"""


def made(folder: Path) -> list[Path]:
    """Write a result of every command that writes them; the first is that of `GRID`."""
    paths = []
    motion(folder)
    for name, text in (("grid", GRID), ("cases", CASES), ("cell", CELL), ("statistics", STATISTICS)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        paths.append(folder / f"{name}.nc")
        assert is_served("run", folder / f"{name}.toml", "-o", paths[-1], "-q")
    block = ["--theta", "5", "--mu-s", "0.4"]
    (folder / "record.toml").write_text(RECORD, encoding="utf-8")
    commands: dict[str, list[object]] = {
        "limit": ["limit", paths[0], "--displacement", "50mm", "-q"],
        "history": ["simulate", *block, "--frequency", "1", "--amplitude", "4", "--points", "8", "--cycles", "2", "-q"],
        "record": ["run", folder / "record.toml", "-q"],
        "recorded": ["simulate", *block, "--record", folder / "motion.csv", "--units", "m/s2", "-q"],
    }
    for name, command in commands.items():
        paths.append(folder / f"{name}.nc")
        assert is_served(*command, "-o", paths[-1])
    return paths


def motion(folder: Path) -> Path:
    """Write a recorded motion."""
    path = folder / "motion.csv"
    times = np.arange(0.0, 2.0, 0.1)
    path.write_text("".join(f"{t:.1f},{4 * np.sin(5 * t):.4f}\n" for t in times))
    return path


def contents(paths: list[Path]) -> list[bytes]:
    """Results as bytes, the first in all formats."""
    found = [path.read_bytes() for path in paths[:4]]
    with xr.open_dataset(paths[0]) as data:
        for form, chunks in (("NETCDF3_CLASSIC", None), ("NETCDF3_64BIT", None), ("NETCDF4", (2, 2, 2, 2))):
            path = paths[0].with_name("form.nc")
            encoding = {"permanent_displacement": {"chunksizes": chunks}} if chunks else {}
            data.load().drop_encoding().to_netcdf(path, format=cast(Any, form), encoding=encoding)
            found.append(path.read_bytes())
    return found


# ------------------------------------------------------------------------------------- reading


def same_table(table: Path, source: Path) -> None:
    """Compare an exported table with what xarray reads."""
    frame = pd.read_csv(table, keep_default_na=False, na_values=[""], dtype={"label": str})
    frame = frame.rename(columns=lambda header: header.partition(" (")[0])
    with netCDF4.Dataset(source) as file:
        order = list(file.dimensions)
    with xr.open_dataset(source, decode_times=False, decode_timedelta=False) as data:
        dims = {dim for name in frame for dim in data[name].dims}
        shape = {dim: data.sizes[dim] for dim in order if dim in dims}
        for name in frame:
            ours, theirs = frame[name], data[name].variable.set_dims(shape).values.ravel()
            assert len(ours) == len(theirs)
            if theirs.dtype.kind in "OSU":
                texts = [text.decode() if isinstance(text, bytes) else str(text) for text in theirs]
                assert [*ours.fillna("").astype(str)] == [text.rstrip() for text in texts]
            else:
                np.testing.assert_allclose(ours.to_numpy(float), theirs.astype(float), rtol=1e-6)


def same_slice(source: Path) -> bool:
    """Compare what charts and the page read with what xarray reads; tell whether there was something to read."""
    name = "permanent_displacement"
    try:
        with Result(source) as result, xr.open_dataset(source, decode_timedelta=False) as data:
            if name not in result.variables:
                return False
            dims = data[name].dims
            expected = data[name].sortby([d for d in dims if d in data.indexes and data[d].dtype.kind in "iuf"])
            middle = {d: 0 if d == "case" else (data.sizes[d] - 1) // 2 for d in dims if d not in result.wide}
            table = result.select([name], {dim: slice(None) for dim in result.wide}, {})
            np.testing.assert_allclose(table[name].values, expected.isel(middle).values, rtol=1e-6)
            excerpt = read_excerpt(source, 10**6)
            # the page has single precision
            np.testing.assert_allclose(excerpt.table[name].values, expected.values, rtol=1e-6, atol=1e-37)
    except InputError:
        return False
    return True


KINDS = ["contours", "modes", "families", "dimensionless", "newmark", "fragility", "quantiles"]


def edited(paths: list[Path], seed: int) -> bool:
    """Edit one of some results; commands read it right, or refuse it in one line; tell whether all served it."""
    source, table, figure = (paths[0].with_name(f"edited.{suffix}") for suffix in ("nc", "csv", "png"))
    edits.edited(seed, paths, source)
    served = is_served("info", source)
    words = ["--words"] if seed % 2 else []
    exported = is_served("export", source, "-o", table, "-q", "--overwrite", *words)
    if exported and not words:
        same_table(table, source)
    served &= exported & same_slice(source)
    if seed % 3 == 0:
        kind = KINDS[seed % len(KINDS)]
        served &= is_served("chart", source, "--kind", kind, "-o", figure, "--overwrite")
    try:
        spec.load(source)
    except InputError:
        return False
    return served


def damaged(folder: Path, sources: list[bytes], seed: int) -> bool:
    """Damage one of some files; commands read it, or refuse it in one line; tell whether they read it."""
    path, table = folder / "damaged.nc", folder / "damaged.csv"
    path.write_bytes(edits.damaged(seed, sources)[1])
    with mock.patch.object(guard, "STEP_SECONDS", 0):
        return is_served("info", path) and is_served("export", path, "-o", table, "-q", "--overwrite")
