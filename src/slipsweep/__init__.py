"""Permanent displacement of a rigid block on a shaken inclined plane, over grids of parameters.

`sweep` solves a grid, `limit_amplitude` is its inverse, `sample` gives the statistics of one whose
inputs are uncertain, `sweep_record` solves one under a recorded motion, `friction_parameters` gives the
paper's Eqs. 7-11, `simulate` one time history, `flags` takes a result's `validity` apart.  The model is
that of Mendez, Romo and Botero (2012); `Validity` and
`SlidingMode` name the codes of the results.
"""

import importlib
from typing import TYPE_CHECKING, Any

from slipsweep._version import __version__
from slipsweep.errors import InputError, RunError
from slipsweep.variables import SlidingMode, Validity

if TYPE_CHECKING:
    from slipsweep.datasets import friction_parameters, limit_amplitude, sample, simulate, sweep, sweep_record
    from slipsweep.decoding import flags
    from slipsweep.records import Record, read_record

__all__ = [
    "InputError",
    "Record",
    "RunError",
    "SlidingMode",
    "Validity",
    "__version__",
    "flags",
    "friction_parameters",
    "limit_amplitude",
    "read_record",
    "sample",
    "simulate",
    "sweep",
    "sweep_record",
]

#: Loaded when first used: numba and xarray take half a second to import, `--help` needs neither.
#: No submodule may have one of these names: importing it would put the module in the function's place.
_LAZY = {
    "Record": "slipsweep.records",
    "flags": "slipsweep.decoding",
    "friction_parameters": "slipsweep.datasets",
    "limit_amplitude": "slipsweep.datasets",
    "read_record": "slipsweep.records",
    "sample": "slipsweep.datasets",
    "simulate": "slipsweep.datasets",
    "sweep": "slipsweep.datasets",
    "sweep_record": "slipsweep.datasets",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_LAZY[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
