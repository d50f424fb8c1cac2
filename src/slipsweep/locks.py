"""File locks between processes, also on file systems that have none."""

import contextlib
import errno
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

#: Error numbers of locks on file systems without locks, as some network folders are.
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}


@contextlib.contextmanager
def lock_held(path: Path, timeout: float) -> Iterator[bool]:
    """Hold the lock of a file; yield False where the file system has no locks.

    TimeoutError: another process holds it, after so many seconds.  OSError: the file cannot be
    written.
    """
    from filelock import FileLock  # takes as long as half of `slipsweep --help`

    lock = FileLock(path, timeout=timeout)
    with warnings.catch_warnings():
        # where there is no `flock` at all the file itself is the lock
        warnings.filterwarnings("ignore", "flock not supported")
        try:
            lock.acquire()
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
    try:
        yield lock.is_locked
    finally:
        lock.release()


def has_locks(path: Path) -> bool:
    """Return False if the file system of a file or folder has no locks."""
    try:
        import fcntl  # Windows has none

        # folders may have locks where files have none
        with tempfile.TemporaryFile(dir=path) if path.is_dir() else path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except ImportError:
        return True
    except OSError as error:
        return error.errno not in _NO_LOCKS
    return True
