"""`slipsweep --versions`: the machine and the installed packages, for a report of a fault."""

import importlib.metadata
import os
import platform
import re
import sys
from collections.abc import Iterator

from slipsweep._version import __version__

#: Extras that users install; the others are for those who change the program.
_EXTRAS = ("parquet", "xlsx", "zarr", "cluster", "explore")


def lines() -> Iterator[str]:
    """Yield lines on the program, Python, the system, the packages, and settings of numba."""
    yield f"slipsweep {__version__}"
    yield f"Python {platform.python_version()} ({platform.python_implementation()})"
    yield f"{platform.platform()}, {os.cpu_count()} processors"
    for name in _packages():
        yield f"{name} {_version_of(name)}"
    yield from _libraries()
    for name, value in sorted(os.environ.items()):
        if name.startswith(("NUMBA_", "SLIPSWEEP_")) or name.endswith("_NUM_THREADS"):
            yield f"{name}={value}"
    yield f"encoding {sys.stdout.encoding}, file names {sys.getfilesystemencoding()}"


def _packages() -> list[str]:
    """Return the names of the packages that the program and its extras use."""
    try:
        requirements = importlib.metadata.requires("slipsweep") or []
    except importlib.metadata.PackageNotFoundError:  # sources that are not installed
        requirements = []
    names = []
    for requirement in requirements:
        extra = re.search(r"extra == ['\"](\w+)['\"]", requirement)
        name = re.match(r"[\w.-]+", requirement)
        if name is not None and (extra is None or extra[1] in _EXTRAS):
            names.append(name[0])
    return list(dict.fromkeys([*names, "llvmlite", "pandas"]))


def _version_of(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "(not installed)"


def _libraries() -> Iterator[str]:
    """Yield lines on the libraries for files, and on the processor that kernels are made for."""
    try:
        import netCDF4

        yield f"netCDF library {netCDF4.__netcdf4libversion__}, HDF5 {netCDF4.__hdf5libversion__}"
    except ImportError as error:  # it may be the fault that is reported
        yield f"netCDF library: {error}"
    try:
        import llvmlite.binding

        yield f"processor {llvmlite.binding.get_host_cpu_name()}"
    except ImportError as error:
        yield f"processor: {error}"
