"""What happens to results on their way: edits by other programs, and damage; strategies of hypothesis and more.

`edited` passes a result through one to three edits, as xarray, NCO, CDO or Octave would make them; `damaged`
changes its bytes.  Both draw a number alone, from which the accidents follow: many times faster than
hypothesis' own draws.
"""

import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from hypothesis import strategies as st

seeds = st.integers(0, 2**64 - 1)

Edit = Callable[[random.Random, xr.Dataset], xr.Dataset]


def _some_dim(rng: random.Random, data: xr.Dataset) -> str | None:
    return rng.choice(sorted(map(str, data.dims))) if data.dims else None


def mean(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    numbers = data.drop_vars([name for name in data.variables if data[name].dtype.kind not in "iuf"])
    dim = _some_dim(rng, numbers)
    return numbers.mean(dim, keep_attrs=rng.random() < 0.7)


def isel(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    dim = "case" if "case" in data.dims and rng.random() < 0.5 else _some_dim(rng, data)
    if dim is None:
        return data
    n = data.sizes[dim]
    slices = [slice(None, None, -1), slice(1, None), slice(None, None, 2)]
    where = rng.choice([0, n - 1, [0], [], [n - 1, 0], [0, 0], *slices])
    return data.isel({dim: where}, drop=rng.random() < 0.3)


def one_cell(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    return data.isel({dim: rng.choice([0, -1, [0]]) for dim in data.dims if dim != "record_sample" and data.sizes[dim]})


def shuffle(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    dim = _some_dim(rng, data)
    return data if dim is None else data.isel({dim: rng.sample(range(data.sizes[dim]), data.sizes[dim])})


def transpose(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    for name in list(data.data_vars):
        dims = list(data[name].dims)
        rng.shuffle(dims)
        data = data.assign({name: data[name].transpose(*dims)})
    return data


def drop_variable(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    return data.drop_vars(rng.choice(sorted(map(str, data.variables)))) if data.variables else data


def drop_attributes(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    data = data.copy()
    target: Any = rng.choice([data, *data.variables.values()])
    names = [*target.attrs]
    for name in rng.sample(names, rng.randint(0, len(names))):
        del target.attrs[name]
    return data


def change_attribute(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    data = data.copy()
    target: Any = rng.choice([data, data, *data.variables.values()])
    if target.attrs:
        name = rng.choice([*target.attrs])
        target.attrs[name] = rng.choice(["", "x", "mm", 0, -1, 2.5, np.nan, np.arange(3), "θ", 10**9, "slipsweep 0.1"])
    return data


def rename(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    name = rng.choice(sorted(map(str, {*data.variables, *data.dims})))
    new = rng.choice(["slope", "time", "x y", "theta", "label", "quantile", "é"])
    if new in data.variables or new in data.dims:
        return data
    if name in data.dims and rng.random() < 0.5:
        return data.rename_dims({name: new})
    return data.rename({name: new})


def add_variable(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    name, dim = rng.choice(["bounds", "note", "time", "wanted", "q/r"]), _some_dim(rng, data)
    size = data.sizes[dim] if dim else 1
    values = rng.choice([
        ((), 7), ((dim,) if dim else (), np.arange(size) if dim else 1), (("bnds",), [1.0, 2.0]), ((), "a text"),
        ((dim or "n", "bnds"), np.zeros((size, 2))), (("when",), np.array(["2000-01-01"], "datetime64[ns]")),
    ])  # fmt: skip
    return data if name in data else data.assign({name.replace("/", "_"): values})


def narrow(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    kinds = {"f": ["f4", "f4", "f8"], "i": ["i2", "i4", "f4"]}
    names = [name for name in data.variables if data[name].dtype.kind in kinds]
    for name in rng.sample(names, rng.randint(0, len(names))):
        kind = rng.choice(kinds[data[name].dtype.kind])
        assign = data.assign_coords if name in data.coords else data.assign
        data = assign({name: data[name].astype(kind, keep_attrs=True)})
    return data


def flatten(rng: random.Random, data: xr.Dataset) -> xr.Dataset:
    """Put a constant in the place of a result."""
    names = [name for name in data.data_vars if data[name].dtype.kind == "f"]
    if not names:
        return data
    name = rng.choice(names)
    constant = rng.choice([0.0, np.nan, -1.0, 1e-320, 1e300, 0.05, np.inf])
    flat = (data[name] * 0.0).fillna(0.0) + constant
    return data.assign({name: flat if rng.random() < 0.8 else data[name].where(False)})


EDITS: dict[str, Edit] = {
    edit.__name__: edit
    for edit in (
        mean, isel, one_cell, shuffle, transpose, drop_variable, drop_attributes, change_attribute, rename,
        add_variable, narrow, flatten,
    )
}  # fmt: skip


def encoding(rng: random.Random, data: xr.Dataset) -> dict[str, dict[str, object]]:
    """How a program might store a result: packed, in chunks, with other numbers for what is missing."""
    found: dict[str, dict[str, object]] = {}
    for name, variable in data.variables.items():
        if variable.dtype.kind != "f" or rng.random() < 0.6:
            continue
        kind = rng.choice(["packed", "fill", "endian", "chunks"])
        if kind == "packed":
            largest = float(np.nanmax(np.abs(variable.values), initial=1e-3, where=np.isfinite(variable.values)))
            found[str(name)] = {"dtype": "i4", "scale_factor": largest / 2e9, "add_offset": 0.0, "_FillValue": -(2**31)}
        elif kind == "fill":
            found[str(name)] = {"_FillValue": -999.0}
        elif kind == "endian":
            found[str(name)] = {"dtype": ">f8"}
        elif variable.dims and variable.size:
            found[str(name)] = {"zlib": True, "chunksizes": tuple(min(2, n) for n in variable.shape)}
    return found


def edited(seed: int, sources: list[Path], path: Path) -> list[str]:
    """Pass one of some results through one to three edits and write it anew; return what was done."""
    rng = random.Random(seed)
    source = rng.choice(sources)
    names = rng.sample([*EDITS], rng.choice([1, 1, 2, 3]))
    raw = rng.random() < 0.4  # codes stay codes
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with xr.open_dataset(source, mask_and_scale=not raw, decode_times=False) as opened:
            data = opened.load()
        for name in names:
            data = EDITS[name](rng, data)
        for variable in data.variables.values():
            if rng.random() < 0.5:  # as a computation leaves it
                variable.encoding = {}
        form: Any = rng.choice(["NETCDF4", "NETCDF4", "NETCDF4", "NETCDF4_CLASSIC", "NETCDF3_CLASSIC", "NETCDF3_64BIT"])
        how = encoding(rng, data) if form == "NETCDF4" and not raw else {}
        for name in how:
            data[name].encoding = {}
        try:
            data.to_netcdf(path, format=form, engine="netcdf4", encoding=how)
        except (ValueError, TypeError, RuntimeError, OverflowError, AttributeError):  # not for files
            data = data.drop_encoding()
            for variable in data.variables.values():
                variable.attrs.pop("_FillValue", None)  # which may be another type than the values by now
            data.to_netcdf(path, engine="netcdf4")
    stored = {"packed" if "scale_factor" in encoded else "encoded" for encoded in how.values()}
    return [source.stem, *names, form, *sorted(stored)]


def damaged(seed: int, sources: list[bytes]) -> tuple[str, bytes]:
    """Change bytes of one of some files; return what was done, and them."""
    rng = random.Random(seed)
    content = bytearray(rng.choice(sources))
    kind = rng.choice(["byte", "byte", "bit", "zeros", "noise", "cut", "moved"])
    at = rng.randrange(len(content))
    length = 2 ** rng.randrange(1, 12)
    if kind == "byte":
        content[at] = rng.choice([0, 255, rng.randrange(256)])
    elif kind == "bit":
        content[at] ^= 1 << rng.randrange(8)
    elif kind == "zeros":
        content[at : at + length] = bytes(len(content[at : at + length]))
    elif kind == "noise":
        content[at : at + length] = rng.randbytes(len(content[at : at + length]))
    elif kind == "cut":
        del content[at:]
    else:
        content[at:at] = content[at : at + length]
    return kind, bytes(content)
