"""Zarr stores of results (version 3): folders, or addresses such as ``s3://bucket/OUT.zarr`` by way of fsspec.

Groups and arrays are zarr-python's; what they hold is what a netCDF file holds (`slipsweep.files.contents`).
"""

import base64
import json
import struct
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import xxhash
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files.contents import (
    CHECKSUM_ATTRIBUTES,
    CHECKSUM_BYTES,
    CHECKSUM_DIMS,
    CHECKSUM_GROUP,
    CHECKSUMS,
    RUN,
    Contents,
    Stored,
    storable,
)

if TYPE_CHECKING:
    import zarr

#: A folder, or an address.
Place: TypeAlias = Path | str

#: What the ending of a store's name is.
ENDING = ".zarr"

#: Most bytes of an inner chunk, which is read as a whole; a shard, an object of the store, is a chunk of the run.
_INNER_BYTES = 2**20


def is_address(text: str) -> bool:
    """Whether an output is named by an address, not by a path."""
    return "://" in text


def names_store(place: Place) -> bool:
    """Whether what is named is a store: an address, or by its ending."""
    return isinstance(place, str) or place.suffix == ENDING


def is_nothing_else(path: Path) -> bool:
    """Whether a folder holds a Zarr store, complete or not, and nothing else."""
    if path.is_symlink() or not path.is_dir():
        return False
    return all(one.name == "zarr.json" or (one / "zarr.json").is_file() for one in path.iterdir())


def check_package(name: str) -> None:
    """Refuse a store where zarr is not installed, or an address that fsspec cannot go to."""
    import importlib.util

    if importlib.util.find_spec("zarr") is None:
        raise InputError(f"{name}: needs the package zarr: pip install 'slipsweep[zarr]'")
    if is_address(name):
        with _named(name):
            file_system(name)


def file_system(address: str) -> tuple[Any, str]:
    """The file system of an address, and the path in it.

    Raises
    ------
    InputError
        fsspec does not know it, or a package for it is not installed.
    """
    import fsspec

    try:
        system, path = fsspec.core.url_to_fs(address)
    except (ValueError, ImportError) as error:
        raise InputError(f"{address}: {error}") from None
    system.invalidate_cache()  # it keeps what was there when it last looked
    return system, str(path)


@lru_cache(maxsize=64)
def _opened(place: Place, name: str = "") -> Any:
    """The store at a place, or of one of its arrays; kept, as each process opens one many times."""
    from zarr.storage import FsspecStore, LocalStore

    if isinstance(place, Path):
        return LocalStore(place / name)
    return FsspecStore.from_url(f"{place.rstrip('/')}/{name}".rstrip("/"))


@lru_cache(maxsize=64)
def _array(place: Place, name: str, key: str) -> Any:
    """An array of a store, opened once for each run (`key`): at an address it takes several messages."""
    import zarr

    return zarr.open_array(_opened(place, name), mode="r+", zarr_format=3)


@contextmanager
def _named(place: Place) -> Iterator[None]:
    """Say in one line what a store or its network refuses."""
    try:
        yield
    except (InputError, RunError):
        raise
    except Exception as error:  # each protocol of fsspec has its own
        raise RunError(f"{place}: cannot be reached: {type(error).__name__}: {error}") from error


# ------------------------------------------------------------------------------------- writing


def create(place: Place, contents: Contents, lengths: Mapping[str, int], compression: int) -> None:
    """Make all arrays of a store, and write those that have values.

    There is no group before `complete`: until then no reader takes it for a result.

    Parameters
    ----------
    place : Path or str
    contents : Contents
    lengths : dict of str to int
        The chunks of the run along its dimensions: each is one shard of a result.
    compression : int
        Level of zstd; 0 for none.
    """
    import zarr
    from zarr.codecs import ZstdCodec

    compressors = [ZstdCodec(level=compression)] if compression else None
    if contents.chunks:
        zarr.create_array(
            _opened(place, CHECKSUMS),
            shape=(contents.chunks, CHECKSUM_BYTES),
            dtype=np.uint8,
            dimension_names=CHECKSUM_DIMS,
            attributes=dict[str, Any](CHECKSUM_ATTRIBUTES),
            overwrite=True,
        )
    for name, stored in contents.variables.items():
        shape = contents.shape(name)
        shard = tuple(min(lengths.get(dim, size), size) for dim, size in zip(stored.dims, shape, strict=True))
        is_result = stored.values is None
        with warnings.catch_warnings():
            # of texts, which only labels of cases are
            warnings.simplefilter("ignore", category=UserWarning)
            # as a store of its own: zarr-python would make the group of one that it is put into
            array = zarr.create_array(
                _opened(place, name),
                shape=shape,
                dtype="str" if stored.is_text else stored.dtype,
                chunks=_inner(shard, stored.dtype.itemsize) if is_result and shard else shape or "auto",
                shards=shard if is_result and shard else None,
                compressors=compressors,
                fill_value=None if stored.fill is None else stored.fill,
                dimension_names=stored.dims,
                attributes=_attributes(stored),
                overwrite=True,
            )
            if stored.values is not None:
                array[...] = stored.values if stored.is_text is False else stored.values.astype(str)


def _inner(shard: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Inner chunks of a shard: whole along the last dimensions, of about a megabyte, and without a remnant."""
    inner, nbytes = [], itemsize
    for length in reversed(shard):
        most = max(1, _INNER_BYTES // nbytes)
        own = length if length <= most else max(one for one in range(1, most + 1) if length % one == 0)
        inner.append(own)
        nbytes *= own
    return tuple(reversed(inner))


def _attributes(stored: Stored) -> dict[str, Any]:
    attributes = {name: _plain(value) for name, value in stored.attrs.items()}
    if stored.fill is not None:
        # as xarray stores it in version 3: JSON has no NaN
        is_float = stored.dtype.kind == "f"
        coded = base64.standard_b64encode(struct.pack("<d", stored.fill)).decode() if is_float else int(stored.fill)
        attributes["_FillValue"] = coded
    return attributes


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return storable(value)
    return np.asarray(value).tolist()


def head_checksum(place: Place, results: Collection[str], names: Collection[str]) -> str:
    """Checksum of what the arrays of a store say of themselves, and of the values of those that are no results."""
    import zarr

    digest = xxhash.xxh3_128()
    for name in sorted(names):
        array = zarr.open_array(_opened(place, name), mode="r", zarr_format=3)
        digest.update(json.dumps(array.metadata.to_dict(), sort_keys=True, default=str).encode())
        if name not in results:
            digest.update(str(np.asarray(array[...]).tolist()).encode())
    return digest.hexdigest()


def write(place: Place, key: str, arrays: Mapping[str, tuple[tuple[slice, ...], NDArray[Any]]]) -> None:
    """Write values to where they lie in the arrays of a store; `key` is that of the run."""
    for name, (where, values) in arrays.items():
        array = _array(place, name, key)
        try:
            array[where or ...] = values
        except OSError:
            raise
        except Exception:  # a shard that is there is read before it is replaced; this one is damaged
            lengths = array.shards or array.chunks
            _discard(place, name, [(part.start or 0) // length for part, length in zip(where, lengths, strict=True)])
            array[where or ...] = values


def _discard(place: Place, name: str, index: Sequence[int]) -> None:
    """Remove a shard of an array."""
    parts = [name, "c", *map(str, index)]
    if isinstance(place, Path):
        place.joinpath(*parts).unlink(missing_ok=True)
    else:
        system, path = file_system(place)
        system.rm("/".join([path, *parts]))


def complete(place: Place, contents: Contents) -> None:
    """Make the group of a store, and gather what all its arrays say of themselves in it."""
    import zarr

    store = _opened(place)
    # a run that was killed here may have made them before
    zarr.open_group(_opened(place, CHECKSUM_GROUP), mode="a", zarr_format=3)
    zarr.open_group(
        store, mode="a", zarr_format=3, attributes={name: _plain(value) for name, value in contents.attrs.items()}
    )
    with warnings.catch_warnings():
        # version 3 has no word on consolidated metadata yet; xarray and zarr-python read them
        warnings.simplefilter("ignore", category=UserWarning)
        zarr.consolidate_metadata(store, zarr_format=3)


# ------------------------------------------------------------------------------------- reading


def open_group(place: Place) -> "zarr.Group":
    """Open a store that is complete.

    Raises
    ------
    InputError
        There is none.
    """
    import zarr

    try:
        return zarr.open_group(_opened(place), mode="r", zarr_format=3)
    except FileNotFoundError:
        raise InputError(f"{place}: no such store, or one that is not complete") from None


def read(place: Place, key: str, name: str, where: tuple[slice, ...]) -> NDArray[Any]:
    """Read values of an array, also of a store that is not complete."""
    return np.asarray(_array(place, name, key)[where or ...])


def exists(place: Place) -> bool:
    """Whether there is something at a place."""
    if isinstance(place, Path):
        return place.exists()
    system, path = file_system(place)
    with _named(place):
        return bool(system.exists(path))


def is_finished(place: Place) -> bool:
    """Whether a store has its group."""
    if isinstance(place, Path):
        return (place / "zarr.json").exists()
    system, path = file_system(place)
    with _named(place):
        return bool(system.exists(f"{path}/zarr.json"))


def nbytes(place: Place) -> int:
    """Bytes that a store takes so far."""
    if isinstance(place, Path):
        return sum(one.stat().st_size for one in place.rglob("*") if one.is_file())
    system, path = file_system(place)
    return int(system.du(path)) if system.exists(path) else 0


def _told_order(attributes: Mapping[str, Any]) -> list[str]:
    """The order of the variables by what tells of the run."""
    try:
        return list(json.loads(attributes[RUN])["order"])
    except (KeyError, TypeError, ValueError):
        return []


class StoreArray:
    """An array of a store with the names that the netCDF library has for what `slipsweep.files.results` asks."""

    def __init__(self, name: str, array: Any) -> None:
        self.name, self._array = name, array
        self.dimensions: tuple[str, ...] = tuple(map(str, array.metadata.dimension_names or ()))
        self.shape: tuple[int, ...] = array.shape
        self.dtype: Any = str if array.dtype.kind in "TOU" else array.dtype

    def ncattrs(self) -> list[str]:
        """Names of its attributes."""
        return list(self._array.attrs)

    def getncattr(self, name: str) -> Any:
        """An attribute; what stands for no value as a number of the array's type."""
        value = self._array.attrs[name]
        if name == "_FillValue" and isinstance(value, str):
            (value,) = struct.unpack("<d", base64.standard_b64decode(value))
        if name in ("_FillValue", "flag_values", "flag_masks"):
            return np.asarray(value, self.dtype)
        return np.asarray(value) if isinstance(value, list) else value

    def chunking(self) -> list[int]:
        """Its values lie in chunks."""
        return list(self._array.chunks)

    def set_auto_maskandscale(self, on: bool) -> None:
        """Values are always as they are stored."""

    def set_auto_chartostring(self, on: bool) -> None:
        """Texts are always texts."""

    def __getitem__(self, where: Any) -> NDArray[Any]:
        if isinstance(where, tuple):
            values = self._array.oindex[tuple(np.asarray(one) if isinstance(one, list) else one for one in where)]
        else:
            values = self._array[where]
        return np.asarray(values, object) if self.dtype is str else np.asarray(values)


class StoreFile:
    """A store that is complete, likewise."""

    def __init__(self, place: Place) -> None:
        check_package(str(place))
        self._group = open_group(place)
        arrays = {name: StoreArray(name, array) for name, array in self._group.arrays()}
        # a store has no order; the run that made it tells that of a file
        self.variables = {name: arrays[name] for name in (*_told_order(self._group.attrs), *arrays) if name in arrays}
        self.dimensions = {
            dim: range(size)
            # in the order of the results, as in a netCDF file
            for one in sorted(self.variables.values(), key=lambda one: -len(one.dimensions))
            for dim, size in zip(one.dimensions, one.shape, strict=True)
        }

    def __getitem__(self, path: str) -> StoreArray:
        return StoreArray(path, self._group[path])

    def ncattrs(self) -> list[str]:
        """Names of its attributes."""
        return list(self._group.attrs)

    def getncattr(self, name: str) -> Any:
        """An attribute."""
        return self._group.attrs[name]

    def close(self) -> None:
        """Nothing stays open."""
