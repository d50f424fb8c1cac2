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
from slipsweep.model.variables import SlidingMode, Validity

if TYPE_CHECKING:
    from slipsweep.motion.records import Record, read_record
    from slipsweep.studies.datasets import friction_parameters, limit_amplitude, sample, simulate, sweep, sweep_record
    from slipsweep.studies.decoding import flags

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
    "Record": "slipsweep.motion.records",
    "flags": "slipsweep.studies.decoding",
    "friction_parameters": "slipsweep.studies.datasets",
    "limit_amplitude": "slipsweep.studies.datasets",
    "read_record": "slipsweep.motion.records",
    "sample": "slipsweep.studies.datasets",
    "simulate": "slipsweep.studies.datasets",
    "sweep": "slipsweep.studies.datasets",
    "sweep_record": "slipsweep.studies.datasets",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_LAZY[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
