"""A run's work folder: which chunks are finished, so that an interrupted run can go on.

Beside an output ``OUT.nc`` lies, while it is being made, the folder ``OUT.nc.parts``:

``lock``
    Held by the run that writes, so that a second is refused.
``manifest.json``
    What the chunks belong to: the sweep file's text, the solver, the versions of all that
    computes, the size of the chunks; under a checksum.
``journal``
    One line for each finished chunk: its number and a checksum.  A line
    is written after the chunk itself, so that a run that is killed has all that its journal
    promises.  Both are brought to the disk itself some time later: after a power cut the
    journal may promise more than there is, which is why it holds checksums.
``data.nc``, with --split the folder ``data``, of a Zarr store the folder ``data.zarr``
    The chunks.  (Those of a store on a network are in the store itself.)

The data are renamed to the output when all chunks are there; then the folder is removed.
"""

import hashlib
import json
import math
import os
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import filelock
import numpy as np
from numpy.typing import NDArray

from slipsweep._version import __version__
from slipsweep.errors import InputError, RunError
from slipsweep.files.checksums import contents_checksum, text_checksum
from slipsweep.files.contents import CHECKSUM_BYTES, RUN, Contents
from slipsweep.files.outputs import sync
from slipsweep.jit import sources
from slipsweep.runs.placed import Layout

_COMPLETE = "complete"

#: The file of a chunk with --split, and what it is called until it is whole.
_CHUNK = re.compile(r"chunk-\d{6,}\.(nc|tmp)")

#: A line of the journal, which a run that was killed may have left without its end.
_LINE = re.compile(r"(\d+) ([0-9a-f]+)\n")


def identity(asked: Mapping[str, Any], target: Mapping[str, Any]) -> dict[str, Any]:
    """What two runs must have in common for one to go on with the chunks of the other.

    `asked` is that of `jobs.Job`, `target` that of `targets.Target`.
    """
    return {
        **asked,
        **target,
        "checksums": "XXH3-128",
        **installation(),
    }


def installation() -> dict[str, str]:
    """What two processes must have in common to compute the same."""
    import numba
    import scipy

    return {
        "slipsweep version": __version__,
        "slipsweep sources": sources.keys().results,
        "numpy version": np.__version__,
        "numba version": numba.__version__,
        "scipy version": scipy.__version__,  # which draws uncertain inputs
    }


@dataclass
class Manifest:
    """What the chunks in a work folder belong to.

    Attributes
    ----------
    identity : dict
        See `identity`.
    chunk_cells : int
        Largest number of cells of a chunk.
    overwrite : bool
        Whether the run may replace an output that exists.
    history : str
        The `history` of the files.
    sizes, lengths : dict of str to int
        The grid, and its chunks but for the last along each dimension.
    layout : Layout, optional
        Where the results lie in the file that has all chunks (None: each has its own).
    head : str
        Checksum of what is no result in it.
    """

    identity: dict[str, Any]
    chunk_cells: int
    overwrite: bool
    history: str
    sizes: dict[str, int]
    lengths: dict[str, int]
    layout: Layout | None = None
    head: str = ""

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return math.prod(math.ceil(size / self.lengths[dim]) for dim, size in self.sizes.items())

    def difference(self, other: Mapping[str, Any]) -> str | None:
        """Say in what another identity differs, or None."""
        for name in {**self.identity, **other}:
            value = self.identity.get(name)
            if other.get(name) == value:
                continue
            if name == "sweep file" and value is None:
                return "the sweep file differs"
            if name == "sweep file":
                return f"the sweep file differs: {_first_difference(str(value), other[name])}"
            return f"{name} was {_shown(value)}, is {_shown(other.get(name))}"
        return None


def stamp(manifest: Manifest, contents: Contents, results: Collection[str], **more: object) -> str:
    """What a file says of the run that made it.

    By it a run that would make the file again can tell, and `slipsweep.runs.verify` what it must hold: `contents` as
    they are without this, the `results` among them, and how their grid was cut.
    """
    # the sweep's text itself may be long, and most files have it
    identity = {**manifest.identity, "sweep file": text_checksum(manifest.identity["sweep file"])}
    told = {"chunk_cells": manifest.chunk_cells, "sizes": manifest.sizes, "lengths": manifest.lengths}
    return json.dumps(
        {"identity": identity, **told, "results": [*results], "contents": contents_checksum(contents), **more}
    )


def checksum_rows(finished: Mapping[int, str]) -> NDArray[np.uint8]:
    """Checksums of all chunks in their order, as a file holds them: a row of bytes each."""
    content = bytes.fromhex("".join(finished[number] for number in sorted(finished)))
    return np.frombuffer(content, np.uint8).reshape(-1, CHECKSUM_BYTES)


def read_stamp(attributes: Mapping[str, Any], identity: Mapping[str, Any]) -> Manifest | None:
    """The run that made a file, by its attributes, to be compared with an `identity`; None where they do not tell."""
    try:
        found = json.loads(attributes[RUN])
        same = found["identity"]["sweep file"] == text_checksum(identity["sweep file"])
        text = identity["sweep file"] if same else attributes.get("sweep")
        return Manifest(
            {**found["identity"], "sweep file": text},
            int(found["chunk_cells"]),
            False,
            "",
            dict(found["sizes"]),
            dict(found["lengths"]),
        )
    except (KeyError, TypeError, ValueError):
        return None


def _shown(value: object) -> str:
    return "none" if value is None else str(value)


def _first_difference(before: str, after: str) -> str:
    old, new = before.splitlines(), after.splitlines()
    number = next((i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new)))
    lines = [repr(text[number].strip()) if number < len(text) else "missing" for text in (old, new)]
    return f"line {number + 1} was {lines[0]}, is {lines[1]}"


class Folder:
    """The work folder of one output; see `opened`."""

    def __init__(self, path: Path) -> None:
        self.output = path
        self.path = path.parent / f"{path.name}.parts"
        self.manifest: Manifest | None = None
        self.finished: dict[int, str] = {}  # number of a chunk: checksum
        self.complete = False
        self.known = False  # whether `finished` and `complete` are what the folder holds
        self.done = False
        self._descriptor: int | None = None  # of the folder, while it is locked

    def read(self) -> None:
        """Read manifest and journal, as far as they are there.

        Raises
        ------
        InputError
            The manifest is damaged although there are finished chunks.
        """
        with suppress(FileNotFoundError):
            for line in (self.path / "journal").read_text(errors="replace").splitlines(keepends=True):
                if line == f"{_COMPLETE}\n":
                    self.complete = True
                elif match := _LINE.fullmatch(line):
                    self.finished[int(match[1])] = match[2]
        self.known = True
        try:
            head, _, content = (self.path / "manifest.json").read_text().partition("\n")
            if hashlib.sha256(content.encode()).hexdigest() != head:
                raise ValueError
            found = json.loads(content)
            self.manifest = Manifest(**found | {"layout": Layout(**found["layout"]) if found["layout"] else None})
        except (ValueError, TypeError, KeyError, FileNotFoundError):
            if self.finished:
                raise InputError(
                    f"{self.path / 'manifest.json'}: damaged or missing: what the {len(self.finished)} finished "
                    "chunks belong to cannot be told; start again with --overwrite"
                ) from None

    def hold(self) -> None:
        """Remember which folder is locked: another may get its name."""
        if os.name == "posix":  # elsewhere a folder cannot be opened, nor removed while a file in it is open
            self._descriptor = os.open(self.path, os.O_RDONLY)

    def let_go(self) -> None:
        """Forget it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def is_there(self) -> bool:
        """Whether the folder that was locked still has its name."""
        try:
            found = self.path.stat()
        except OSError:
            return False
        return self._descriptor is None or os.path.samestat(found, os.fstat(self._descriptor))

    def check(self) -> None:
        """Refuse to go on where the folder has been removed.

        Raises
        ------
        RunError
        """
        if not self.is_there():
            raise RunError(f"{self.path}: was removed during the run, and the finished chunks with it; start again")

    def clear(self) -> None:
        """Remove all that an earlier run left, and nothing else that may lie there."""
        # the journal first: without it nothing is promised of the others
        for name in ("journal", "journal.tmp", "manifest.json", "manifest.json.tmp", "data.nc"):
            (self.path / name).unlink(missing_ok=True)
        data = self.path / "data"
        if data.is_dir():
            for entry in data.iterdir():
                if _CHUNK.fullmatch(entry.name):
                    entry.unlink()
            data.rmdir()
        if (self.path / "data.zarr").is_dir():
            shutil.rmtree(self.path / "data.zarr")
        self.manifest, self.finished, self.complete, self.known = None, {}, False, True

    def remove(self) -> None:
        """Remove the folder, unless something else lies in it."""
        with suppress(OSError):
            self.clear()
            (self.path / "lock").unlink()
            self.path.rmdir()

    def begin(self, manifest: Manifest) -> None:
        """Write the manifest, after which chunks may be added."""
        self.manifest = manifest
        content = json.dumps(asdict(manifest), indent=1)
        self._write("manifest.json", f"{hashlib.sha256(content.encode()).hexdigest()}\n{content}")
        sync(self.path.parent)

    def keep(self, finished: Mapping[int, str]) -> None:
        """Set the journal to those chunks that were found to be as they were written."""
        self.finished = dict(finished)
        self._write("journal", "".join(f"{number} {digest}\n" for number, digest in finished.items()))

    def add(self, number: int, digest: str) -> None:
        """Put a chunk that is written on record."""
        self.check()
        self._append(f"{number} {digest}")
        self.finished[number] = digest

    def sync(self) -> None:
        """Have the journal on the disk itself."""
        sync(self.path / "journal")
        sync(self.path)

    def close(self) -> None:
        """Put on record that all chunks are there, hence that data which are missing have become the output."""
        self.check()
        self._append(_COMPLETE)
        self.sync()

    def _append(self, line: str) -> None:
        with (self.path / "journal").open("a") as journal:
            journal.write(f"{line}\n")

    def _write(self, name: str, text: str) -> None:
        """Replace a file in one step."""
        temporary = self.path / f"{name}.tmp"
        temporary.write_text(text)
        sync(temporary)
        temporary.replace(self.path / name)
        sync(self.path)


@contextmanager
def opened(path: Path) -> Iterator[Folder]:
    """Make or find the work folder of an output, and hold its lock.

    On the way out the folder is removed if the run is `done` or no chunk is finished.
    An exception that passes through gets a note of how many chunks are kept.

    Raises
    ------
    InputError
        Something else has its name.
    RunError
        Another run holds it, or it cannot be locked.
    """
    folder = Folder(path)
    if folder.path.is_symlink() or (folder.path.exists() and not folder.path.is_dir()):
        raise InputError(
            f"{path}: {folder.path.name} is no folder, and would have to be one while the run lasts; "
            "move it away, or give another name with -o"
        )
    lock = _lock(folder)
    try:
        folder.hold()
        yield folder
    finally:
        if folder.is_there() and (folder.done or (folder.known and not (folder.finished or folder.complete))):
            folder.remove()
        folder.let_go()
        lock.release()


def _lock(folder: Folder) -> filelock.BaseFileLock:
    lock = filelock.FileLock(folder.path / "lock", timeout=0)
    for _ in range(20):
        try:
            folder.path.mkdir(exist_ok=True)
            lock.acquire()
        except filelock.Timeout:
            raise RunError(f"{folder.output}: another run is writing it; wait for it, or give another name") from None
        except FileNotFoundError:  # the run that had it has just removed it
            continue
        except (OSError, NotImplementedError) as error:
            raise RunError(f"{folder.path}: cannot be made or locked: {error}") from error
        if (folder.path / "lock").exists():
            return lock
        lock.release()
    raise RunError(f"{folder.output}: another run is writing it; wait for it, or give another name")
