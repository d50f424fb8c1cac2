"""Names of files as the netCDF library takes them: any name that the system has, and no address on a network."""

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from slipsweep.errors import InputError

if TYPE_CHECKING:
    import netCDF4


def open_netcdf(path: Path, mode: Literal["r", "w"] = "r") -> "netCDF4.Dataset":
    """Open a netCDF-4 file by its very name.

    By itself the library leaves blanks in front away, and so opens another file; it takes ``http:`` and
    ``[mode=...]`` in front for an address; and it refuses bytes that are no UTF-8.

    Raises
    ------
    InputError
        `path` has a backslash, which the library makes a slash of, or is no file (a folder, a pipe, a device).
    OSError, RuntimeError
        The library cannot open it.
    """
    import netCDF4

    check_name(path)
    if mode == "r" and not stat.S_ISREG(path.stat().st_mode):
        raise InputError(f"{path}: is not a file: a netCDF file cannot be read from a folder, a pipe or a device")
    name = path.as_posix() if path.is_absolute() or path.drive else f"./{path.as_posix()}"
    # the bytes of the name, one character each
    return netCDF4.Dataset(os.fsencode(name).decode("latin-1"), mode, format="NETCDF4", encoding="latin-1")


def check_name(path: Path) -> None:
    """Refuse a name that the netCDF library does not take, and that was most likely meant otherwise.

    Raises
    ------
    InputError
        It has a backslash that does not separate folders.
    """
    if "\\" in path.as_posix():
        raise InputError(f"{path}: a backslash separates no folders here, and no file may have one: write / instead")
