"""Results checked against the checksums that are kept in them."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.files.checksums import checksum, contents_checksum
from slipsweep.files.contents import CHECKSUMS, RUN
from slipsweep.files.netcdf import read_head
from slipsweep.files.results import result_file
from slipsweep.files.zarr_store import Place, names_store
from slipsweep.grid.chunks import Chunk, cut, places
from slipsweep.runs.stored import global_attributes, opened
from slipsweep.runs.targets.splitfiles import chunk_name


@dataclass
class Verified:
    """What was found: how many chunks there are, and what is not as it was written, in words."""

    chunks: int
    damaged: list[str] = field(default_factory=list)


def verify(path: Place) -> Verified:
    """Check a result against the checksums in it.

    Parameters
    ----------
    path : Path or str
        A netCDF file, a folder of them (``--split``), a Zarr store, or the address of one.

    Returns
    -------
    Verified

    Raises
    ------
    InputError
        There is none, it cannot be opened, or it was not made by `slipsweep run` or `limit`.
    """
    if not names_store(path) and Path(path).is_dir():
        return _verify_folder(Path(path))
    if not names_store(path):
        with result_file(Path(path)):  # that it is no file which keeps the library from ending
            pass
    with opened(path) as file:
        told = _told(path, global_attributes(file))
        found = Verified(0, list(_head_damage(file, told)))
        sums = _read(file, CHECKSUMS)
        cells = _sizes(file, told["results"])
        for number, chunk in enumerate(cut(told["sizes"], told["lengths"])):
            found.chunks += 1
            if sums is None or number >= len(sums) or _checksum(file, cells, chunk) != sums[number].tobytes().hex():
                found.damaged.append(f"chunk {number} ({_where(chunk)})")
        return found


def _verify_folder(folder: Path) -> Verified:
    names = sorted(one.name for one in folder.iterdir())
    if not names:
        raise InputError(f"{folder}: has no files")
    with opened(folder / names[0]) as file:
        told = _told(folder / names[0], global_attributes(file))
    found = Verified(0)
    for number, chunk in enumerate(cut(told["sizes"], told["lengths"])):
        found.chunks += 1
        path = folder / chunk_name(number)
        try:
            with result_file(path), opened(path) as file:
                own = _told(path, global_attributes(file))
                damage = list(_head_damage(file, own))
                if own.get("chunk") != number or _checksum(file, _sizes(file, own["results"]), {}) != own["checksum"]:
                    damage.append(f"chunk {number} ({_where(chunk)})")
        except InputError as error:
            damage = [str(error).removeprefix(f"{path}: ")]
        found.damaged += [f"{path.name}: {text}" for text in damage]
    return found


def _told(path: Place, attributes: dict[str, Any]) -> dict[str, Any]:
    """What a file tells of the run that made it."""
    try:
        told = json.loads(attributes[RUN])
        kinds = {"results": list, "sizes": dict, "lengths": dict}
        return {**told, **{name: kind(told[name]) for name, kind in kinds.items()}}
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{path}: has no checksums: it was not made by slipsweep run or limit, or the attribute {RUN} is lost"
        ) from None


def _head_damage(file: Any, told: dict[str, Any]) -> Iterator[str]:
    try:
        if contents_checksum(read_head(file, told["results"])) != told.get("contents"):
            yield "coordinates or attributes"
    except Exception as error:  # whatever a library says of what it did not write
        yield f"coordinates or attributes ({type(error).__name__})"


def _read(file: Any, name: str) -> Any:
    try:
        return np.asarray(file[name][...])
    except Exception:  # as above
        return None


def _sizes(file: Any, results: list[str]) -> dict[str, dict[str, int]]:
    """Dimensions of the results that are there, and their lengths."""
    there = {name: file[name] for name in results if name in file.variables}
    return {name: dict(zip(one.dimensions, one.shape, strict=True)) for name, one in there.items()}


def _checksum(file: Any, sizes: dict[str, dict[str, int]], chunk: Chunk) -> str | None:
    try:
        return checksum(
            {name: np.asarray(file[name][tuple(places(chunk, own).values()) or ...]) for name, own in sizes.items()}
        )
    except Exception:  # a sector that cannot be read, bytes that are no such codec's
        return None


def _where(chunk: Chunk) -> str:
    return ", ".join(f"{dim} {part.start} to {part.stop - 1}" for dim, part in chunk.items()) or "all"
