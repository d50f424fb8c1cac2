"""Permanent displacement of a rigid block on a shaken inclined base, over grids of parameters.

`sweep` solves a grid, `limit_amplitude` is its inverse in the amplitude and `required_strength` in
the strength, `sample` gives the statistics of one whose inputs are uncertain, `friction_parameters`
gives the paper's Eqs. 7-11, `simulate` one time history, `flags` decodes the flags in `validity`.
`measured_friction` gives the paper's Eq. 1 on the accelerations of a test on a shaking table,
`calibrate` the parameters of the model from one. `suite_statistics` gives statistics of the
displacements under a suite, `displacement_hazard` gives the annual rates of exceeding them.
`open_result` opens what the command `slipsweep run` has written. The shaking is a waveform (`Sine`,
`Cosine`, `Triangle`, `Square`, `Harmonics`), a `Record` (`read_record`) or a `Suite` of records
(`read_suite`); the model is that of Mendez, Romo and Botero (2012), `Mendez`, or `Newmark`; the
solver `Cycle` or `Step`. `Validity` and `SlidingMode` name the codes of the results.
"""

import importlib
import sys
from typing import Any

import lazy_loader

#: The names of `__init__.pyi`, loaded when first used: numba and xarray take half a second to
#: import, `--help` needs neither.  No submodule may have one of these names: importing it would put
#: the module in the function's place.
_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    value = _load(name)
    if "xarray" in sys.modules:  # make `Dataset.slipsweep` known, wherever there are datasets
        importlib.import_module("slipsweep.charts.accessor")
    return value
