"""Permanent displacement of a rigid block on a shaken inclined base, over grids of parameters.

`sweep` solves a grid, `limit_amplitude` is its inverse, `sample` gives the statistics of one whose
inputs are uncertain, `friction_parameters` gives the paper's Eqs. 7-11, `simulate` one time history,
`flags` decodes the flags in `validity`.  `measured_friction` gives the paper's Eq. 1 on the accelerations
of a test on a shaking table, `calibrate` the parameters of the model from one.  `suite_statistics` gives
statistics of the displacements under a suite, `displacement_hazard` gives the annual rates of exceeding them.
`open_result` opens what the command `slipsweep run` has written.  The shaking is a waveform (`Sine`, `Cosine`,
`Triangle`, `Square`, `Harmonics`), a `Record` (`read_record`) or a `Suite` of records (`read_suite`); the model is
that of Mendez, Romo and Botero (2012), `Mendez`, or `Newmark`; the solver `Cycle` or `Step`.  `Validity` and
`SlidingMode` name the codes of the results.
"""

import importlib
import sys
from typing import TYPE_CHECKING, Any

from slipsweep._version import __version__
from slipsweep.errors import InputError, RunError
from slipsweep.model.variables import SlidingMode, Validity

if TYPE_CHECKING:
    from slipsweep.files.opening import open_result
    from slipsweep.model.options import Cycle, Mendez, Newmark, Step
    from slipsweep.motion.records import Record, read_record
    from slipsweep.motion.suites import Pair, Suite, read_suite
    from slipsweep.motion.waveforms import Cosine, Harmonics, Sine, Square, Triangle
    from slipsweep.studies.calibration import calibrate
    from slipsweep.studies.datasets import friction_parameters, sweep
    from slipsweep.studies.decoding import flags
    from slipsweep.studies.friction import measured_friction
    from slipsweep.studies.hazard import HazardCurve, displacement_hazard
    from slipsweep.studies.history import simulate
    from slipsweep.studies.limits import limit_amplitude
    from slipsweep.studies.suite_statistics import suite_statistics
    from slipsweep.studies.uncertainty import sample

__all__ = [
    "Cosine",
    "Cycle",
    "Harmonics",
    "HazardCurve",
    "InputError",
    "Mendez",
    "Newmark",
    "Pair",
    "Record",
    "RunError",
    "Sine",
    "SlidingMode",
    "Square",
    "Step",
    "Suite",
    "Triangle",
    "Validity",
    "__version__",
    "calibrate",
    "displacement_hazard",
    "flags",
    "friction_parameters",
    "limit_amplitude",
    "measured_friction",
    "open_result",
    "read_record",
    "read_suite",
    "sample",
    "simulate",
    "suite_statistics",
    "sweep",
]

#: Loaded when first used: numba and xarray take half a second to import, `--help` needs neither.
#: No submodule may have one of these names: importing it would put the module in the function's place.
_LAZY = {
    **dict.fromkeys(("Mendez", "Newmark", "Cycle", "Step"), "slipsweep.model.options"),
    **dict.fromkeys(("Sine", "Cosine", "Triangle", "Square", "Harmonics"), "slipsweep.motion.waveforms"),
    **dict.fromkeys(("Record", "read_record"), "slipsweep.motion.records"),
    **dict.fromkeys(("Pair", "Suite", "read_suite"), "slipsweep.motion.suites"),
    **dict.fromkeys(("friction_parameters", "sweep"), "slipsweep.studies.datasets"),
    "limit_amplitude": "slipsweep.studies.limits",
    "sample": "slipsweep.studies.uncertainty",
    "simulate": "slipsweep.studies.history",
    "flags": "slipsweep.studies.decoding",
    "open_result": "slipsweep.files.opening",
    **dict.fromkeys(("HazardCurve", "displacement_hazard"), "slipsweep.studies.hazard"),
    "suite_statistics": "slipsweep.studies.suite_statistics",
    "calibrate": "slipsweep.studies.calibration",
    "measured_friction": "slipsweep.studies.friction",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_LAZY[name]), name)
    globals()[name] = value
    _register_accessor()
    return value


def _register_accessor() -> None:
    """Make `Dataset.slipsweep` known, wherever there are datasets: xarray is not imported for it."""
    if "xarray" in sys.modules:
        importlib.import_module("slipsweep.charts.accessor")


def __dir__() -> list[str]:
    return sorted(__all__)
