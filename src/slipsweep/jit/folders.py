"""Where compiled kernels are kept on disk, and who writes there."""

import contextlib
import functools
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import filelock  # here: imported in the middle of a fork, its own fork handlers would fail
import platformdirs

#: Seconds to wait for another process that compiles: four times what a slow machine takes.
_PATIENCE = 120.0


@functools.cache
def base() -> Path | None:
    """The folder for all that is kept, or None where none can be written; `NUMBA_CACHE_DIR`, if that is set."""
    import numba  # here: to begin a run, whose identity asks for sources, takes no numba

    given = numba.config.CACHE_DIR
    for folder in [Path(given)] if given else [platformdirs.user_cache_path("slipsweep"), _temporary_folder()]:
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
    return None


def _temporary_folder() -> Path:
    """A folder of this user's in the system's temporary one, where others may write, too."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.gettempdir()) / "slipsweep"
    folder = Path(tempfile.gettempdir()) / f"slipsweep-{os.getuid()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        # files are unpickled: none that another user could have put there
        if status.st_uid == os.getuid() and not status.st_mode & 0o022:
            return folder
    return Path(os.devnull)


def has(folder: Path, function: Callable[..., object]) -> bool:
    """Whether a folder holds a kernel of this function's name."""
    return any(path.suffix != ".lock" for path in folder.glob(f"**/*{function.__name__.strip('_')}*"))


def write(path: Path, content: bytes) -> None:
    """Write a file that appears whole: other processes read it at the same time."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        try:
            file.write(content)
            file.close()
            Path(file.name).replace(path)
        finally:
            Path(file.name).unlink(missing_ok=True)


def keep_latest(count: int, pattern: str, latest: Path) -> None:
    """Remove what `pattern` matches beside `latest`, but for it and the latest others."""
    with contextlib.suppress(OSError):
        others = [other for other in latest.parent.glob(pattern) if other != latest]
        others.sort(key=lambda other: other.stat().st_mtime, reverse=True)
        for other in others[count - 1 :]:
            if other.is_dir():
                shutil.rmtree(other, ignore_errors=True)
            else:
                other.unlink(missing_ok=True)


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """Hold a file's lock against other processes, where locks can be had."""
    lock = filelock.FileLock(f"{path}.lock")
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, NotImplementedError, filelock.Timeout):
            lock.acquire(timeout=_PATIENCE)
            stack.callback(lock.release)
        yield
