"""Outputs that are complete, or not there, and never what a command reads.

What is being written has another name until it is finished and on the disk itself.
"""

import errno
import itertools
import os
import re
import secrets
import shutil
import stat
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from slipsweep.errors import InputError, RunError
from slipsweep.files.names import check_name
from slipsweep.files.zarr_store import is_nothing_else
from slipsweep.grid.resources import size_text

#: Names of files that are being written begin so.
_PREFIX = ".slipsweep-"

#: Name of a chunk's file in a folder that `slipsweep.runs.store.run` made.
_CHUNK_FILE = re.compile(r"chunk-\d{6,}\.nc")


#: What a command reads: a file, or the number of an open one (0: standard input).
Read = Path | int


@dataclass(frozen=True)
class Kind:
    """What an output is: in words, and whether a path that exists is one."""

    text: str
    fits: Callable[[Path], bool]


def check_outputs(
    paths: Sequence[Path],
    overwrite: bool,
    *,
    reads: Iterable[Read],
    kind: Kind | None = None,
    work: Path | None = None,
) -> None:
    """Refuse outputs of a command that cannot be written, may not be replaced, or are what it reads.

    Every command that writes comes here before it computes anything.

    Parameters
    ----------
    paths : sequence of Path
        All outputs of the command.
    overwrite : bool
        Whether they may replace what exists.
    reads : iterable of Path or int
        All that the command reads.  Files are compared, not their names: links, relative paths and
        names in other letters are the same file.
    kind : Kind, optional
        What the outputs are, if not files.
    work : Path, optional
        A folder that is emptied for the outputs.

    Raises
    ------
    InputError
    """
    inputs = {found: read for read in reads if (found := _identity(read)) is not None}
    for path in paths:
        try:
            check_name(path)
            chunks = [path] if kind is CHUNKS and _is_folder_of_chunks(path) else []
            for file in (path, *_below(*chunks, *([work, work / "data"] if work else []))):
                if (found := _identity(file)) in inputs:
                    name = inputs[found] or "standard input"
                    raise InputError(
                        f"{path}: writing it would replace {name}, which this command reads; give another name with -o"
                    )
            _check_output(path, overwrite, kind or FILE)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from None
        except UnicodeEncodeError as error:  # a name from a sweep file
            raise InputError(f"{path}: no file can have this name where names are {error.encoding}") from None
    for path, other in itertools.combinations(paths, 2):
        if path.parent.samefile(other.parent) and _same_name(path, other):
            raise InputError(f"{other}: is given twice as an output of this command; give each another name")


def _check_output(path: Path, overwrite: bool, kind: Kind) -> None:
    """Refuse an output that cannot be written, or exists and may not be replaced."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: the folder {path.parent} is not writable")
    try:
        found = path.lstat()
    except FileNotFoundError:
        return
    link = stat.S_ISLNK(found.st_mode)
    if link and not path.exists():
        found_text = f"is a symbolic link to {os.readlink(path)}, which does not exist"
    elif not kind.fits(path):
        raise InputError(f"{path}: exists and is not a {kind.text}")
    else:
        found_text = "exists already"
    if not overwrite:
        raise InputError(f"{path}: {found_text}; give --overwrite to replace it, or another name with -o")


def _is_folder_of_chunks(path: Path) -> bool:
    """Whether a folder, no link to one and neither "." nor "..", holds files of chunks and nothing else."""
    named = path.name not in ("", "..") and not path.is_symlink()
    return named and path.is_dir() and all(map(_CHUNK_FILE.fullmatch, os.listdir(path)))


FILE = Kind("file", Path.is_file)
CHUNKS = Kind("folder of chunks", _is_folder_of_chunks)
ZARR = Kind("Zarr store", is_nothing_else)


def _identity(file: Read) -> tuple[int, int] | None:
    """Device and number of a file, which all its names share."""
    with suppress(OSError):  # it is not there (any more): nothing can be lost
        found = os.stat(file)
        return found.st_dev, found.st_ino
    return None


def _below(*folders: Path) -> Iterator[Path]:
    """What is in folders, as far as they exist."""
    for folder in folders:
        if folder.is_dir():
            yield from folder.iterdir()


def _same_name(path: Path, other: Path) -> bool:
    """Whether two names in one folder would be those of one file, as its file system compares letters."""
    if path.name == other.name:
        return True
    one, two = (unicodedata.normalize("NFKC", name.name).casefold() for name in (path, other))
    if one != two:
        return False
    probe, twin = (path.with_name(f"{_PREFIX}{os.getpid()}-{name.name}") for name in (path, other))
    with suppress(OSError):  # no room for so long a name: such a file cannot be written anyway
        probe.touch(exist_ok=False)
        try:
            return os.path.lexists(twin)
        finally:
            probe.unlink()
    return False


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
    # not made of the output's name, which may be as long as the system allows, or odd
    temporary = path.with_name(f"{_PREFIX}{os.getpid()}-{secrets.token_hex(4)}.tmp")
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
    """Rename, but never over a file that has appeared since `check_outputs`."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise RunError(f"{path}: was made by another process during the run; it is left alone") from None
    except OSError:  # a file system without hard links
        if os.path.lexists(path):
            raise RunError(f"{path}: was made by another process during the run; it is left alone") from None
        temporary.replace(path)


#: What the system says that has nothing to do with room on the disk.  (Of the netCDF library "permission denied"
#: has: it says so of any file that it could not make.)
_NO_MATTER_OF_ROOM = (
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EEXIST,
    errno.ENOTEMPTY,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.EROFS,
    errno.EXDEV,
)


@contextmanager
def writing(path: Path | str) -> Iterator[None]:
    """Turn what the system and the netCDF library raise into one message."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if isinstance(error, RunError):
            raise
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        message = f"{path}: writing failed: {reason}"
        if isinstance(error, OSError) and error.errno in _NO_MATTER_OF_ROOM:
            raise RunError(message) from error
        # all that the netCDF library says of a full disk is "HDF error"
        with suppress(OSError):  # the folder itself may be gone
            message += f"; is the disk full? ({size_text(shutil.disk_usage(Path(path).parent).free)} free)"
        raise RunError(message) from error
