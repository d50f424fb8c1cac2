"""Outputs that are complete, or not there.

What is being written has another name until it is finished and on the disk itself.
"""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slipsweep.errors import InputError, RunError
from slipsweep.grid.resources import size_text

#: Name of a block's file in a folder that `slipsweep.runs.store.run` made.
_BLOCK_FILE = re.compile(r"block-\d{6,}\.nc")


def check_output(path: Path, overwrite: bool, folder: bool = False) -> None:
    """Refuse an output (a file, or a `folder` of blocks) that cannot be written, or exists and may not be replaced.

    Raises
    ------
    InputError
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    if folder and path.exists() and not (path.is_dir() and all(map(_BLOCK_FILE.fullmatch, os.listdir(path)))):
        raise InputError(f"{path}: exists and is not a folder of blocks")
    if not folder and path.exists() and not path.is_file():
        raise InputError(f"{path}: exists and is not a file")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; give --overwrite to replace it, or another name with -o")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: the folder {path.parent} is not writable")


def sync(path: Path) -> None:
    """Have a file, or on POSIX a folder, on the disk itself, so that a power cut does not take it back."""
    if path.is_dir() and os.name != "posix":  # elsewhere a folder cannot be opened
        return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
        with writing(path):
            appear(temporary, path, overwrite)
    finally:
        temporary.unlink(missing_ok=True)


def appear(temporary: Path, path: Path, overwrite: bool) -> None:
    """Give a finished file, or folder of files, its name."""
    sync(temporary)
    if temporary.is_dir():
        if overwrite and path.is_dir():
            shutil.rmtree(path)
        elif path.exists():
            raise RunError(f"{path}: was made by another process during the run; it is left alone")
        temporary.replace(path)
    elif overwrite:
        temporary.replace(path)
    else:
        _rename_to_new(temporary, path)
    sync(path.parent)


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename, but never over a file that has appeared since `check_output`."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise RunError(f"{path}: was made by another process during the run; it is left alone") from None
    except OSError:  # a file system without hard links
        temporary.replace(path)


@contextmanager
def writing(path: Path) -> Iterator[None]:
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
