"""Outputs that are complete, or not there, and never what a command reads.

What is being written has another name until it is finished and on the disk itself.
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

#: How an output that is there is refused.
EXISTS = "{path}: exists already; give --overwrite to replace it, or another name with -o"

#: What to do where the netCDF library cannot lock a file.
NO_LOCKS = "the file system has no locks; set HDF5_USE_FILE_LOCKING=FALSE to go without"


def check_endings(paths: Iterable[Path | str], endings: Collection[str]) -> None:
    """Refuse outputs whose names end in what the command cannot write (InputError)."""
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
    """The outputs of a command, none that cannot be written, may not be replaced, or is what it `reads` (InputError).

    Every command that writes comes here before it computes anything.  What it reads are files, or
    0, standard input. Files are compared, not their names: a link is what it points to.
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
                    own = f"{read or 'standard input'}, which this command reads"
                    raise InputError(
                        f"{path}: writing it would replace {own}; give another name with -o"
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

    On any error or interruption `path` stays as it was.  A link stays, and the file that it points
    to is written.  RunError: it cannot be written, or another process made it.
    """
    target = real_path(path)
    # not made of the output's name, which may be as long as the system allows
    temporary = target.with_name(f".slipsweep-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        with writing(path):
            yield temporary
            appear(temporary, target, overwrite)
    finally:
        temporary.unlink(missing_ok=True)


def real_path(path: Path) -> Path:
    """Return the file that a link points to; of another path, itself."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def appear(temporary: Path, path: Path, overwrite: bool) -> None:
    """Give a finished file, or folder of files, its name (RunError: it exists, and may not be replaced)."""
    if os.path.lexists(path) and not overwrite:
        raise RunError(f"{path}: was made by another process during the run; it is left alone")
    if temporary.is_dir():
        if path.is_dir():
            shutil.rmtree(path)
    else:
        with temporary.open("r+b") as file:  # on the disk itself: a power cut does not take it back
            os.fsync(file.fileno())
    os.replace(temporary, path)


@contextmanager
def writing(path: Path | str) -> Iterator[None]:
    """Turn what the system and the netCDF library raise while an output is written into one line (RunError)."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if isinstance(error, RunError):
            raise
        message = f"{path}: writing failed: {(error.strerror if isinstance(error, OSError) else None) or error}"
        folder = Path(path).parent
        if str(path).endswith(".nc") and not has_locks(folder):
            raise RunError(f"{message}: {NO_LOCKS}") from error
        # all that the netCDF library says of a full disk is "HDF error"
        with suppress(OSError):  # the folder itself may be gone
            usage = shutil.disk_usage(folder)
            if usage.total:  # some file systems have no size, and are never full
                message += f" ({size_text(usage.free)} free on the disk)"
        raise RunError(message) from error
