"""A recorded motion over a grid of blocks: parameters in, a plan, a table out.

A sweep over θ × μs × (given parameters) × scale goes through one kernel for each polarity;
the factor on time needs none: everything depends on time only through t / time_scale, so that
v ∝ time_scale and u ∝ time_scale², exactly.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.plans import Plan, Task, about, aligned, check_inputs, check_problem, checked, cost_of, grid_sizes
from slipsweep.grid.tables import Variable
from slipsweep.model.options import Newmark
from slipsweep.model.parameters import check_choices, check_given, check_numbers, shown
from slipsweep.model.variables import PARAMETERS, RECORD_INPUTS, RECORD_RESULTS
from slipsweep.motion.records import Record


def plan_record(
    *, excitation: Record, model: Any = "mendez", solver: Any = "auto", variables: Any = None, **given: Any
) -> Plan:
    """Plan of a sweep under a record; as `plans.plan_sweep`."""
    problem = check_problem(excitation, model, solver)
    given = {name: values for name, values in given.items() if values is not None}
    check_inputs(given, RECORD_INPUTS, "a Record")
    check_given(given, ("theta", "mu_s"))
    if "amplitude" in given and "scale" in given:
        raise InputError("amplitude, scale: must not both be given; either is the strength of the record")
    if isinstance(problem.model, Newmark):
        for name in ("decay_rate", "delta_mu", "minimum_friction"):
            if name in given:
                raise InputError(f"{name}: not allowed with model = 'newmark', which has no friction law")
    wanted = tuple(RECORD_RESULTS) if variables is None else check_choices("variables", variables, RECORD_RESULTS)
    polarity = _polarity(given.pop("polarity", 1))
    defaults = {"time_scale": 1.0} if "amplitude" in given else {"scale": 1.0, "time_scale": 1.0}
    coords = checked(_ordered(defaults | given)) | {"polarity": polarity}
    inputs = dict(coords)
    if "amplitude" in coords:
        inputs["scale"] = _scale(inputs.pop("amplitude"), excitation)
    sizes = grid_sizes(coords)
    task = Task(engine.solve_record, problem, wanted, sizes, aligned(inputs, sizes))
    attrs = about("Response of a rigid block to a recorded motion", problem)
    return Plan(sizes, coords, (task,), wanted, attrs, cost_of(problem))


def _ordered(given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: given[name] for name in PARAMETERS if name in given}


def _scale(amplitude: Variable, record: Record) -> Variable:
    """The factors that scale a record to peak accelerations."""
    peak = float(np.abs(record.acceleration).max())
    if not peak > 0.0:
        raise InputError(f"amplitude: {record.name} has no acceleration to scale; give scale")
    return Variable(amplitude.dims, amplitude.values / peak)


def _polarity(given: Any) -> Variable:
    """The signs asked for: 1, -1, both."""
    both = isinstance(given, str) and given == "both"
    try:
        values = check_numbers("polarity", (1, -1) if both else given)
    except InputError:
        values = np.empty(0)
    if values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(f"polarity = {shown(given)}: must be 1, -1, a list of these, or 'both'")
    dims = ("polarity",) if values.ndim else ()
    return Variable(dims, values.astype(np.int8), PARAMETERS["polarity"])
