"""Results on disk: a sweep computed and written block by block, netCDF files made and read.

A file appears under its name only when it is complete (`complete_or_absent`).  Floating-point
results are stored contiguous and uncompressed, the two flag variables in chunks with zlib level 1:
on a grid of 20 million cells that wrote 1.7 GB/s and saved 16 % of the bytes, where compressing
everything wrote 0.1 GB/s and saved 58 %, and compressing nothing wrote 2.1 GB/s.
"""

import itertools
import math
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from slipsweep.blocks import Solved, block_lengths, chunk_lengths, grid_blocks, solve_here
from slipsweep.errors import InputError, RunError
from slipsweep.resources import available_memory, size_text
from slipsweep.spec import SweepSpec
from slipsweep.tables import Table
from slipsweep.variables import SlidingMode, Validity

#: Cells solved and written at a time: 80 MB of results, yet enough to keep the kernels busy.
BLOCK_CELLS = 4_000_000

# ------------------------------------------------------------------- complete or not there


def check_output(path: Path, overwrite: bool) -> None:
    """Refuse an output that cannot be written, or that exists and may not be replaced.

    Raises
    ------
    InputError
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir() or (path.exists() and not path.is_file()):
        raise InputError(f"{path}: exists and is not a file")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; give --overwrite to replace it, or another name with -o")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: the folder {path.parent} is not writable")


@contextmanager
def complete_or_absent(path: Path, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary name beside `path`; what is written there becomes `path` on success.

    On any error or interruption the temporary file is removed and `path` stays as it was.

    Raises
    ------
    RunError
        The file cannot be written, or another process made `path` in the meantime.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        with _writing(path):
            _sync(temporary, os.O_RDWR)
            if overwrite:
                temporary.replace(path)
            else:
                _rename_to_new(temporary, path)
            if os.name == "posix":  # elsewhere a folder cannot be opened
                _sync(path.parent, os.O_RDONLY)
    finally:
        temporary.unlink(missing_ok=True)


def _sync(path: Path, mode: int) -> None:
    """Have a file or folder on the disk itself, so that a power cut does not take it back."""
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename, but never over a file that has appeared since `check_output`."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise RunError(f"{path}: was made by another process during the run; it is left alone") from None
    except OSError:  # a file system without hard links
        temporary.replace(path)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn what the system and the netCDF library raise into one message."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if isinstance(error, RunError):
            raise
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        # all that the netCDF library says of a full disk is "HDF error"
        free = size_text(shutil.disk_usage(path.parent).free)
        raise RunError(f"{path}: writing failed: {reason}; is the disk full? ({free} free)") from error


# ------------------------------------------------------------------------- running a sweep


@dataclass
class Tally:
    """Counts of cells, and among them of each sliding mode and each flag (None: not stored)."""

    cells: int = 0
    modes: dict[SlidingMode, int] | None = None
    flags: dict[Validity, int] | None = None

    def add(self, results: Mapping[str, NDArray[Any]]) -> None:
        """Count one block; `results` holds its arrays by variable name."""
        if "sliding_mode" in results:
            self.modes = self.modes or dict.fromkeys(SlidingMode, 0)
            for mode in SlidingMode:
                # int(): numpy would take a member of an enumeration for 64 bits, and all cells with it
                self.modes[mode] += int(np.count_nonzero(results["sliding_mode"] == int(mode)))
        if "validity" in results:
            self.flags = self.flags or dict.fromkeys(Validity, 0)
            seen = int(np.bitwise_or.reduce(results["validity"], axis=None))
            for flag in Validity(seen & 255):
                self.flags[flag] += int(np.count_nonzero(results["validity"] & int(flag)))


@dataclass
class Report:
    """What `run` did."""

    path: Path
    shape: dict[str, int]
    seconds: float
    nbytes: int
    tally: Tally


def run(
    spec: SweepSpec,
    path: Path,
    *,
    command: str,
    overwrite: bool = False,
    block_cells: int = BLOCK_CELLS,
    progress: Callable[[int], None] | None = None,
    solved: Solved = solve_here,
) -> Report:
    """Compute a sweep and write it as netCDF, complete or not at all.

    Parameters
    ----------
    spec : SweepSpec
    path : Path
        The file to write.
    command : str
        The command as typed, for the file's `history`.
    overwrite : bool
        Replace `path` if it exists.
    block_cells : int
        Cells solved and written at a time, hence in memory.
    progress : callable
        Called with a number of cells just solved, from any thread.
    solved : callable
        What solves the blocks, in any order (`blocks.Solved`).

    Returns
    -------
    Report

    Raises
    ------
    InputError
        The output exists or cannot be written, or the grid is too large for disk or memory.
    RunError
        Writing failed, or memory ran out.
    """
    check_output(path, overwrite)
    _check_size(spec, path, block_cells)
    started = time.perf_counter()
    tally = Tally(spec.cells)
    with complete_or_absent(path, overwrite) as temporary:
        with _netcdf(temporary, path) as file:
            cut = dict(enumerate(grid_blocks(spec.shape, block_cells)))
            found = solved(spec, cut, progress)
            while True:
                try:
                    number, results = next(found)
                except StopIteration:
                    break
                except MemoryError:
                    raise RunError(f"{path}: out of memory at a block of {_block_text(spec, block_cells)}") from None
                block = cut[number]
                with _writing(path):
                    if not file.dimensions and not file.variables:  # the first to come
                        chunks = chunk_lengths(spec.shape, block_cells)
                        _define(file, spec.shape, chunks, results, spec.dtype)
                        _label_cases(file, spec.labels)
                        _describe(file, {**results.attrs, "title": spec.output.title, **_provenance(command)})
                        _describe(file, {"sweep": spec.text})
                    _fill(file, results, block)
                arrays = {name: results[name].values for name in ("sliding_mode", "validity") if name in results}
                tally.add(arrays)
        nbytes = temporary.stat().st_size
    return Report(path, spec.shape, time.perf_counter() - started, nbytes, tally)


def write_table(table: Table, path: Path, *, title: str, command: str, overwrite: bool = False) -> None:
    """Write a table that is in memory (a time history) by the rules that sweeps are written by."""
    check_output(path, overwrite)
    with (
        complete_or_absent(path, overwrite) as temporary,
        _netcdf(temporary, path) as file,
        _writing(path),
    ):
        shape = table.sizes
        _define(file, shape, chunk_lengths(shape), table, lambda name: table[name].values.dtype)
        _describe(file, {**table.attrs, "title": title, **_provenance(command)})
        _fill(file, table, {})


def _check_size(spec: SweepSpec, path: Path, block_cells: int) -> None:
    """Refuse a grid whose file cannot fit on the disk, or whose blocks cannot fit in memory."""
    free = shutil.disk_usage(path.parent).free
    if spec.nbytes > free:
        raise InputError(
            f"{spec.source}: a grid of {spec.cells:.3g} cells makes {size_text(spec.nbytes)}, but {path.parent} has "
            f"{size_text(free)} free: take coarser axes, fewer output.variables, "
            'output.dtype = "float32" or another disk'
        )
    memory = available_memory()
    # a block's results, and as much again for work
    needed = 2 * math.prod(block_lengths(spec.shape, block_cells).values()) * spec.nbytes // spec.cells
    if memory is not None and needed > memory:
        raise InputError(
            f"{spec.source}: a block of {_block_text(spec, block_cells)} needs {size_text(needed)} of memory, "
            f"but {size_text(memory)} is free: close other programs or take fewer output.variables"
        )


def _block_text(spec: SweepSpec, block_cells: int) -> str:
    lengths = block_lengths(spec.shape, block_cells)
    return f"{math.prod(lengths.values())} cells ({' x '.join(f'{n} {dim}' for dim, n in lengths.items())})"


# ------------------------------------------------------------------------------ netCDF files


@contextmanager
def _netcdf(temporary: Path, path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a new netCDF file, and close it whatever happens."""
    with _writing(path):
        file = netCDF4.Dataset(temporary, "w", format="NETCDF4")
    file.set_fill_off()  # every value is written: filling the file first would write it twice
    try:
        yield file
    except BaseException:
        with suppress(RuntimeError, OSError):  # the first error is the one to report
            file.close()
        raise
    with _writing(path):
        file.close()


def _define(
    file: netCDF4.Dataset,
    shape: Mapping[str, int],
    chunks: Mapping[str, int],
    table: Table,
    dtype: Callable[[str], np.dtype[Any]],
) -> None:
    """Define dimensions and variables for `table` or, where it is a block, for the grid of `shape`."""
    for dim, length in shape.items():
        file.createDimension(dim, length)
    for name, coordinate in table.coords.items():
        variable = file.createVariable(name, coordinate.values.dtype, coordinate.dims)
        _describe(variable, coordinate.attrs)
    for name, result in table.data_vars.items():
        dims, kind = result.dims, dtype(name)
        options: dict[str, Any] = {"contiguous": True}
        if kind.kind != "f" and dims:
            options = {"chunksizes": [chunks[dim] for dim in dims], "zlib": True, "complevel": 1, "shuffle": True}
        fill = np.nan if kind.kind == "f" else SlidingMode.MISSING if name == "sliding_mode" else None
        variable = file.createVariable(name, kind, dims, fill_value=fill, **options)
        attributes = dict(result.attrs)
        if attributes.get("ancillary_variables") not in table:
            attributes.pop("ancillary_variables", None)
        auxiliary = [c for c in table.coords if c not in shape and {*table[c].dims} <= {*dims}]
        if auxiliary:
            attributes["coordinates"] = " ".join(auxiliary)
        _describe(variable, attributes)


def _label_cases(file: netCDF4.Dataset, labels: tuple[str, ...]) -> None:
    """Write the names of the rows of [[cases]]: as characters, since few programs read netCDF strings."""
    if not labels:
        return
    text = np.array([label.encode() for label in labels])
    file.createDimension("label_length", text.dtype.itemsize)
    variable = file.createVariable("label", "S1", ("case", "label_length"))
    variable.set_auto_chartostring(False)
    _describe(variable, {"long_name": "name of the case", "_Encoding": "utf-8"})
    variable[:] = text.view("S1").reshape(len(labels), -1)
    for other in file.variables.values():
        if "case" in other.dimensions and "coordinates" in other.ncattrs():
            _describe(other, {"coordinates": f"{other.getncattr('coordinates')} label"})


def _describe(target: netCDF4.Dataset | netCDF4.Variable, attributes: Mapping[str, Any]) -> None:
    """Set attributes: text as characters in UTF-8, flag values in the type of their variable."""
    for name, value in attributes.items():
        if isinstance(value, str):
            # as bytes: the library would write text beyond ASCII as a netCDF string
            target.setncattr(name, value.encode())
        elif name in ("flag_values", "flag_masks"):
            target.setncattr(name, np.asarray(value, target.dtype))
        elif isinstance(value, int):
            target.setncattr(name, np.int32(value))  # not every program reads 64-bit attributes
        else:
            target.setncattr(name, value)


def _provenance(command: str) -> dict[str, str]:
    return {
        "Conventions": "CF-1.11",
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}",
    }


def _fill(file: netCDF4.Dataset, table: Table, block: Mapping[str, slice]) -> None:
    """Write the values of a block; dimensions that `block` does not name are whole."""
    for name, array in {**table.coords, **table.data_vars}.items():
        variable = file[name]
        variable.set_auto_maskandscale(False)
        where = tuple(block.get(dim, slice(None)) for dim in array.dims)
        variable[where or ...] = array.values.astype(variable.dtype, copy=False)


# --------------------------------------------------------------------------- reading a file


@dataclass
class Contents:
    """What a file of slipsweep holds and how it was made; coordinates and variables in words."""

    path: Path
    nbytes: int
    attributes: dict[str, str]
    coordinates: dict[str, str]
    variables: dict[str, str]
    tally: Tally


def read_contents(path: Path) -> Contents:
    """Describe a file of slipsweep; memory stays small whatever its size.

    Raises
    ------
    InputError
        It cannot be read, is not netCDF, or was not written by slipsweep.
    """
    try:
        nbytes = path.stat().st_size
        with netCDF4.Dataset(path) as file:
            attributes = {name: str(file.getncattr(name)) for name in file.ncattrs()}
            if not attributes.get("source", "").startswith("slipsweep "):
                raise InputError(f"{path}: not written by slipsweep")
            named = (
                variable.coordinates.split()
                for variable in file.variables.values()
                if "coordinates" in variable.ncattrs()
            )
            coordinates = {*file.dimensions, *itertools.chain.from_iterable(named)}
            return Contents(
                path,
                nbytes,
                attributes,
                {name: _values_text(file[name]) for name in file.variables if name in coordinates},
                {name: _variable_text(file[name]) for name in file.variables if name not in coordinates},
                _count(file),
            )
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path}: not a netCDF file, or a damaged one ({error})") from None


def _count(file: netCDF4.Dataset) -> Tally:
    tally = Tally()
    for name in ("sliding_mode", "validity"):
        if name in file.variables:
            variable = file[name]
            variable.set_auto_mask(False)
            tally.cells = variable.size
            for block in grid_blocks(dict(zip(variable.dimensions, variable.shape, strict=True)), BLOCK_CELLS):
                tally.add({name: variable[tuple(block.values())]})
    return tally


def _values_text(variable: netCDF4.Variable) -> str:
    values = variable[...]
    if variable.dtype == "S1":
        return ", ".join(values)
    units = "" if variable.units == "1" else f" {variable.units}"
    if values.size == 1:
        return f"{values.item():.6g}{units}"
    return f"{values.size} values, {values.min():.6g} to {values.max():.6g}{units}"


def _variable_text(variable: netCDF4.Variable) -> str:
    units = f", {variable.units}" if "units" in variable.ncattrs() and variable.units != "1" else ""
    return f"{variable.long_name}{units} ({variable.dtype})"
