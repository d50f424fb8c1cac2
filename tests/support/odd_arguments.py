"""Arguments that a function of numbers, names and arrays may be given by accident: hypothesis strategies.

`odd` draws values of every kind that Python, numpy, pandas, dask and xarray have; `calls` a call of a public
function in which one or two arguments are odd, those of the others good.
"""

import datetime
import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import dask.array
import numpy as np
import pandas as pd
import xarray as xr
from hypothesis import strategies as st
from scipy import stats

import slipsweep
from slipsweep import InputError
from slipsweep.model.choices import Choice
from tests.support.commands import one_line

# ------------------------------------------------------------------------------- values

_SCALARS: list[Any] = [
    None, True, False, 0, 1, 2, 3, -1, 8, 0.0, -0.0, 0.25, 0.5, 2.5, 8.0, float("nan"), float("inf"), -float("inf"),
    10**30, 10**400, 2**63, -(2**70), 1j, 2 + 0j, "", "1", "0.5", "both", "auto", "sine", "harmonics", "1:1", "5mm",
    "mendez", "validity", "θ", "a\nb", "\0", b"1", bytearray(b"x"), memoryview(b"abc"),
    Decimal("0.5"), Decimal("NaN"), Decimal("sNaN"), Decimal("Infinity"), Decimal("1e400"),
    Fraction(1, 2), Fraction(2), Fraction(10**400), object, object(), len, ..., NotImplemented,
    range(1, 3), range(0), slice(1, 2), {0.25, 0.5}, frozenset({"validity"}), Path("none.csv"),
    np.ma.masked, pd.NA, pd.NaT, pd.Timestamp("2012-01-01"), pd.Timedelta("2s"),
    datetime.datetime(2012, 1, 1), datetime.date(2012, 1, 1), datetime.timedelta(seconds=2),
    stats.norm, stats.beta, stats.norm(0.4, 0.01), stats.poisson(3), stats.norm([0.1, 0.2], 1.0),
]  # fmt: skip

_DTYPES = "?bhilqpBHILQPefdgFDGSUVOMm"


@st.composite
def numpy_values(draw: st.DrawFn) -> Any:
    """Numpy scalars and arrays of any dtype, of none to three dimensions, some empty."""
    dtype = draw(st.sampled_from(_DTYPES))
    shape = draw(st.sampled_from([(), (), (1,), (2,), (3,), (0,), (2, 2), (1, 1), (0, 2), (2, 1, 2)]))
    values = np.array(draw(st.sampled_from([0, 1, 2, 3]))).astype("m8[s]" if dtype in "Mm" else dtype)
    values = values.astype("M8[s]") if dtype == "M" else values
    array = np.broadcast_to(values, shape).copy()
    if dtype in "efdg" and array.size and draw(st.booleans()):
        array.flat[-1] = draw(st.sampled_from([np.nan, np.inf, -np.inf, 0.25, 0.5, 7.0]))
    return array[()] if not shape and draw(st.booleans()) else array


@st.composite
def wrapped(draw: st.DrawFn) -> Any:
    """Arrays of other libraries, and arrays with masks, names and coordinates."""
    values: Any = draw(
        numpy_values() | st.sampled_from([np.array([0.25, 0.5]), np.array([1.0, 2.0, 3.0]), np.array(0.5)])
    )
    array: np.ndarray = np.asarray(values)
    kind = draw(st.integers(0, 9))
    first = draw(st.sampled_from(["case", "theta", "validity", "quantile", "frequency", 0, "time"]))
    dims: tuple[Any, ...] = (first, "x", "y")[: array.ndim]
    if kind == 0:
        return np.ma.masked_array(array, mask=np.arange(array.size).reshape(array.shape) % 2 == draw(st.integers(0, 1)))
    if kind == 1:
        return dask.array.from_array(array, chunks=-1)
    if kind == 2 and array.ndim == 1:
        return pd.Series(array.tolist())
    if kind == 3:
        return pd.DataFrame({"a": [0.25, 0.5]})
    if kind == 4:
        return xr.Dataset({"a": (dims, array)})
    if kind == 5:
        return xr.Variable(dims, array)
    if kind == 6 and array.ndim == 1:
        label = draw(st.sampled_from([*map(str, dims), "label", "mu_s", "validity", "mode", "displacement_quantile"]))
        return xr.DataArray(array, dims=dims, coords={label: (dims, np.arange(array.size))})
    if kind == 7:
        return xr.DataArray(dask.array.from_array(array, chunks=-1), dims=dims)
    if kind == 8:
        stacked = xr.DataArray([[0.25, 0.5]], coords={"a": [1], "b": [1, 2]}, dims=("a", "b"))
        return stacked.stack(case=("a", "b"))
    return xr.DataArray(array, dims=dims)


_LISTS: list[list[Any]] = [[], [0.25, 0.5], ["validity"]]
_GENERATORS = st.sampled_from(_LISTS).map(lambda values: (one for one in values))
_SINGLE = st.sampled_from(_SCALARS) | numpy_values() | wrapped() | _GENERATORS
#: Any value, and lists, tuples and mappings of such.
odd = st.one_of(
    _SINGLE,
    _SINGLE,
    st.lists(_SINGLE, max_size=3),
    st.lists(_SINGLE, max_size=3).map(tuple),
    st.dictionaries(
        st.sampled_from(
            ["amplitudes", "multiples", "phases", "theta", "mu_s", "distribution", "case", "frequency", ""]
        ),
        _SINGLE | st.lists(_SINGLE, max_size=2),
        max_size=3,
    ),
)

# ------------------------------------------------------------------------------- calls

RECORD = slipsweep.Record(np.arange(5) / 10, np.array([0.0, 4.0, -4.0, 2.0, 0.0]))
SUITE = slipsweep.Suite((RECORD, RECORD), ("a", "b"))
PAIRS = slipsweep.Suite((slipsweep.Pair(RECORD, RECORD),))
BLOCK: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38}
CELL: dict[str, Any] = {**BLOCK, "amplitude": 3.0, "frequency": 1.0}
UNCERTAIN = {"mu_s": {"distribution": "lognorm", "s": 0.1, "kind": "factor"}}

#: Every public function of parameters, with arguments that are good.
FUNCTIONS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "sweep": (slipsweep.sweep, CELL),
    "friction_parameters": (slipsweep.friction_parameters, {**BLOCK, "amplitude": 3.0}),
    "simulate": (slipsweep.simulate, {**CELL, "points_per_cycle": 8}),
    "sweep under a record": (slipsweep.sweep, {**BLOCK, "excitation": RECORD}),
    "sweep under a suite": (slipsweep.sweep, {**BLOCK, "excitation": SUITE}),
    "sweep under pairs": (slipsweep.sweep, {**BLOCK, "excitation": PAIRS, "azimuth": 30.0}),
    "limit_amplitude": (
        slipsweep.limit_amplitude,
        {"displacement": 0.1, **BLOCK, "frequency": 1.0, "amplitude_steps": 4},
    ),
    "sample": (slipsweep.sample, {**CELL, "uncertain": UNCERTAIN, "samples": 8}),
    "Mendez": (slipsweep.Mendez, {}),
    "Step": (slipsweep.Step, {}),
    "Triangle": (slipsweep.Triangle, {}),
    "Harmonics": (slipsweep.Harmonics, {"amplitudes": [1.0, 0.5], "multiples": [1, 3]}),
    "Record": (slipsweep.Record, {"times": [0.0, 0.1, 0.2], "acceleration": [0.0, 1.0, -1.0]}),
    "Record.sampled": (slipsweep.Record.sampled, {"acceleration": [0.0, 1.0, -1.0], "interval": 0.1}),
    "Record.corrected": (RECORD.corrected, {"baseline": "mean"}),
    "read_record": (slipsweep.read_record, {"path": "none.csv"}),
    "read_suite": (slipsweep.read_suite, {"paths": ["none.csv"]}),
    "Suite": (slipsweep.Suite, {"motions": (RECORD,)}),
    "Pair": (slipsweep.Pair, {"first": RECORD, "second": RECORD}),
    "Pair.rotated": (PAIRS[0].rotated, {"azimuth": 30.0}),
    "flags": (slipsweep.flags, {"data": xr.DataArray(np.int16(3))}),
}

#: What errors name where they name no argument: a file, a record, what a bit mask lacks, a name in a DataArray.
WORDS = ("cannot be read", "record: ", "no bit mask", "the name of a result", "is a dimension of another parameter")

#: What goes with an argument that means something only beside others.
_BESIDE: dict[str, dict[str, Any]] = {
    "displacement_amplitude": {"amplitude": None},
    **{
        key: {"excitation": RECORD, "amplitude": None, "frequency": None}
        for key in ("scale", "pgv", "arias_intensity", "time_scale", "polarity")
    },
    "azimuth": {"excitation": PAIRS, "amplitude": None, "frequency": None},
}


@dataclass
class Call:
    """A call of a public function."""

    function: str
    odd: dict[str, Any]
    arguments: dict[str, Any]

    def __call__(self) -> Any:
        return FUNCTIONS[self.function][0](**self.arguments)


def called(function: str, **changed: Any) -> Call:
    """A call of a function in which these arguments are odd, those of the others good."""
    called, good = FUNCTIONS[function]
    known = inspect.signature(called).parameters
    beside = {other: value for name in changed for other, value in _BESIDE.get(name, {}).items() if other in known}
    return Call(function, changed, {**good, **beside, **changed})


@st.composite
def calls(draw: st.DrawFn) -> Call:
    """A call in which one argument, or two, are odd."""
    function = draw(st.sampled_from(list(FUNCTIONS)))
    known = list(inspect.signature(FUNCTIONS[function][0]).parameters)
    names = draw(st.lists(st.sampled_from(known), min_size=1, max_size=2, unique=True))
    # what a function that is called raises is the caller's
    uncalled = odd.filter(lambda value: not callable(value))
    return called(function, **{name: draw(uncalled if name == "progress" else odd) for name in names})


def is_served(call: Call) -> bool:
    """Call: a result comes, or one clear message that names what is wrong, and nothing else; tell which."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = call()
            if isinstance(found, xr.Dataset):
                found.load()
        except InputError as error:
            message = one_line(str(error), 500)
        else:
            kinds = (xr.Dataset, slipsweep.Record, slipsweep.Pair, slipsweep.Suite, Choice)
            assert isinstance(found, kinds), found
            return True
    assert any(name in message for name in (*call.arguments, *WORDS)), message
    return False
