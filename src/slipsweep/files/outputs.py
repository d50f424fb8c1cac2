"""Outputs of commands, which are complete or not there, and never replace what a command reads.

An output has a temporary name until it is complete and on the disk itself.
"""

import itertools
import os
import secrets
import shutil
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from slipsweep.errors import InputError, RunError
from slipsweep.grid.resources import size_text
from slipsweep.locks import has_locks

#: Message for an output that exists already.
EXISTS = "{path}: exists already; give --overwrite to replace it, or another name with -o"

#: Advice if the netCDF library cannot lock a file.
NO_LOCKS = "the file system has no locks; set HDF5_USE_FILE_LOCKING=FALSE to go without"


def check_endings(paths: Iterable[Path | str], endings: Collection[str]) -> None:
    """Raise InputError if an output has an ending that the command does not write."""
    for path in paths:
        if Path(path).suffix not in endings:
            one_of = "one of " if len(endings) > 1 else ""
            raise InputError(f"{path}: the name must end in {one_of}{', '.join(endings)}")


def check_outputs(
    output: Iterable[Path] | None,
    overwrite: bool,
    *,
    reads: Sequence[Path | int],
    endings: Collection[str] = (),
) -> list[Path]:
    """Return the outputs of a command; every command calls this before it computes anything.

    `reads` are files that the command reads, or 0 for standard input.  Links are followed, so that
    files are compared, not names.  InputError: an output cannot be written, may not be replaced, or
    is a file that the command reads.
    """
    paths = list(output or ())
    if endings:
        check_endings(paths, endings)
    for path in paths:
        try:
            for read in reads:
                if (
                    os.path.exists(path)
                    and os.path.exists(read)
                    and os.path.samestat(os.stat(path), os.stat(read))
                ):
                    source = f"{read or 'standard input'}, which this command reads"
                    raise InputError(
                        f"{path}: writing it would replace {source}; give another name with -o"
                    )
            folder = real_path(path).parent
            if not folder.is_dir():
                raise InputError(f"{path}: the folder {folder} does not exist")
            if not os.access(folder, os.W_OK):
                raise InputError(f"{path}: the folder {folder} is not writable")
            if path.exists() and not path.is_file() and not (path / "zarr.json").is_file():
                raise InputError(f"{path}: exists and is neither a file nor a Zarr store")
            if os.path.lexists(path) and not overwrite:
                raise InputError(EXISTS.format(path=path))
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    for path, other in itertools.combinations(paths, 2):
        if path.absolute() == other.absolute():
            raise InputError(
                f"{other}: is given twice as an output of this command; give each another name"
            )
    return paths


@contextmanager
def complete_or_absent(path: Path, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary name beside `path`; what is written there becomes `path` on success.

    On an error or interruption `path` stays as it was.  A link stays a link, and the file that it
    points to is written.  RunError: the file cannot be written, or another process made it.
    """
    target = real_path(path)
    # without the output's name, which may be as long as the system allows
    temporary = target.with_name(f".slipsweep-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        with writing(path):
            yield temporary
            appear(temporary, target, overwrite)
    finally:
        temporary.unlink(missing_ok=True)


def real_path(path: Path) -> Path:
    """Return the file that a link points to; any other path is returned unchanged."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def appear(temporary: Path, path: Path, overwrite: bool) -> None:
    """Give a finished file or folder its name (RunError: it exists and may not be replaced)."""
    if os.path.lexists(path) and not overwrite:
        raise RunError(f"{path}: was made by another process during the run; it is left alone")
    if temporary.is_dir():
        if path.is_dir():
            shutil.rmtree(path)
    else:
        with temporary.open("r+b") as file:  # to the disk itself, in case of a power cut
            os.fsync(file.fileno())
    os.replace(temporary, path)


@contextmanager
def writing(path: Path | str) -> Iterator[None]:
    """Turn errors of the system and the netCDF library into a RunError of one line."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if isinstance(error, RunError):
            raise
        reason = error.strerror if isinstance(error, OSError) else None
        message = f"{path}: writing failed: {reason or error}"
        folder = Path(path).parent
        if str(path).endswith(".nc") and not has_locks(folder):
            raise RunError(f"{message}: {NO_LOCKS}") from error
        # on a full disk the netCDF library says no more than "HDF error"
        with suppress(OSError):  # the folder itself may be gone
            usage = shutil.disk_usage(folder)
            if usage.total:  # some file systems have no size, and are never full
                message += f" ({size_text(usage.free)} free on the disk)"
        raise RunError(message) from error
