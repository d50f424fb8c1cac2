"""Labelled sweeps: parameters as scalars, axes or DataArrays in, an xarray.Dataset out.

A thin translation over `slipsweep.engine`: it checks the parameters, finds the dimensions
of the grid and puts names, units and attributes on the results.
"""

import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep import engine
from slipsweep._version import __version__
from slipsweep.engine import MOTION_RESULTS, Problem
from slipsweep.errors import InputError
from slipsweep.parameters import (
    MODELS,
    RECOUPLINGS,
    RISES,
    RULES,
    SOLVERS,
    STEPS_PER_CYCLE,
    WAVEFORMS,
    check_choice,
    check_values,
    check_whole,
)
from slipsweep.resources import available_memory, size_text
from slipsweep.variables import (
    DEFAULT_RESULTS,
    DIMENSION_ORDER,
    FRICTION_PARAMETERS,
    PARAMETERS,
    REFERENCE,
    RESULT_DTYPES,
    RESULTS,
)

_FRICTION_INPUTS = (
    "theta", "mu_s", "amplitude", "yield_acceleration", "decay_rate", "delta_mu", "minimum_friction",
)  # fmt: skip

#: What a caller may give for a parameter.
Values = float | Sequence[float] | np.ndarray | xr.DataArray


def sweep(
    theta: Values,
    mu_s: Values,
    amplitude: Values | None = None,
    frequency: Values | None = None,
    *,
    displacement_amplitude: Values | None = None,
    cycles: int = 10,
    yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    structure_frequency: Values | None = None,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    waveform: str = "sine",
    solver: str = "auto",
    steps_per_cycle: int = STEPS_PER_CYCLE,
    rule: str = "trapezoid",
    g: float = 9.81,
    variables: Sequence[str] | None = None,
    chunks: Any = None,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Response of a sliding block over a grid of parameters.

    A scalar becomes a scalar coordinate, a 1-D array a dimension of the parameter's own
    name; the grid is the outer product of all of them.  A DataArray keeps its dimensions,
    so that several on one shared dimension are taken together instead of crossed.

    Parameters
    ----------
    theta : float, array or DataArray
        Plane inclination, degrees, 0 ≤ θ < 90.
    mu_s : float, array or DataArray
        Static friction coefficient, > 0.
    amplitude : float, array or DataArray
        Peak ground acceleration A, m/s², ≥ 0.
    frequency : float, array or DataArray
        Excitation frequency, Hz, > 0.
    displacement_amplitude : float, array or DataArray
        Peak ground displacement d, m, instead of `amplitude`: A = (2πf)² d.
    cycles : int
        Whole cycles of shaking, from rest.
    yield_acceleration : float, array or DataArray, optional
        Üy, m/s²; by default Coulomb's, g tan(φs − θ).
    decay_rate, delta_mu, minimum_friction : float, array or DataArray, optional
        λ, Δμ and μmin where they are known; each replaces its estimate (Eqs. 6, 9-11).
    structure_frequency : float, array or DataArray, optional
        Natural frequency of the sliding structure, Hz, for the `flexible_block` flag.
    model : {"mendez", "newmark"}
        The paper's friction law, or the classical rigid block.
    rise : {"monotone", "literal"}
        Stick-slip rise of the block's acceleration: not below the yield value and never
        falling, or Eq. 4 as printed.
    recoupling : {"eq12", "integrate"}
        After the plane's acceleration has reversed: Eq. 12, or integration until the stop.
    waveform : {"sine"}
        Shape of the ground acceleration.
    solver : {"auto", "cycle", "step"}
        Event by event, or time stepping.  "auto" takes "cycle".
    steps_per_cycle : int
        Steps of the "step" solver, a multiple of 4, at least 8.
    rule : {"trapezoid", "rectangle", "simpson"}
        Rule of the "step" solver; orders 2, 1 and 4.
    g : float
        Gravity, m/s².
    variables : sequence of str, optional
        Results to compute: `permanent_displacement`, `peak_relative_velocity`,
        `sliding_mode`, `validity` (these by default) and the parameters of Eqs. 7-11.
    chunks : int, tuple, dict or "auto", optional
        Chunks as dask takes them; the result is then lazy.  Frequency is best left whole.
    progress : callable, optional
        Called with the number of cells just finished, from any thread; not with `chunks`.

    Returns
    -------
    Dataset
        Dimensions theta, mu_s, amplitude, frequency, then others.  The parameters of
        Eqs. 7-11 do not vary with frequency and have no such dimension.

    Raises
    ------
    InputError
        A value that no physics allows, an unknown option, a grid that memory cannot hold.
    """
    given = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": amplitude,
        "displacement_amplitude": displacement_amplitude,
        "frequency": frequency,
        "yield_acceleration": yield_acceleration,
        "decay_rate": decay_rate,
        "delta_mu": delta_mu,
        "minimum_friction": minimum_friction,
        "structure_frequency": structure_frequency,
    }
    if (amplitude is None) == (displacement_amplitude is None):
        raise InputError("amplitude, displacement_amplitude: exactly one of them must be given")
    if frequency is None:
        raise InputError("frequency: must be given")
    problem = check_options(model, rise, recoupling, waveform, cycles, solver, steps_per_cycle, rule, g)
    wanted = check_variables(variables)
    arrays = _labelled(given)
    coordinates = _coordinates(arrays)
    if displacement_amplitude is not None:
        omega = 2.0 * math.pi * arrays["frequency"]
        arrays["amplitude"] = omega * omega * arrays.pop("displacement_amplitude")
        coordinates["amplitude"] = arrays["amplitude"].variable.copy()
        coordinates["amplitude"].attrs = dict(PARAMETERS["amplitude"])
    sizes = _sizes(arrays)

    motion = tuple(name for name in MOTION_RESULTS if name in wanted)
    variables_of: dict[str, xr.Variable] = {}
    if motion:
        plain = _aligned(arrays, tuple(sizes))
        if chunks is None:
            _check_memory(sizes, motion)
            values = _solve(problem, motion, tuple(sizes.values()), plain, progress)
        else:
            values = _solve_lazily(problem, motion, sizes, plain, chunks)
        variables_of |= {name: xr.Variable(tuple(sizes), values[name], RESULTS[name]) for name in motion}
    asked = [name for name in FRICTION_PARAMETERS if name in wanted and name not in arrays]
    if asked:
        found = _friction_parameters(problem, arrays)
        variables_of |= {name: found[name] for name in asked}
    dataset = xr.Dataset({name: variables_of[name] for name in wanted if name in variables_of}, coordinates)
    return dataset.assign_attrs(_attributes(problem, waveform, "Permanent displacement of a rigid block, swept"))


def friction_parameters(
    theta: Values,
    mu_s: Values,
    amplitude: Values,
    *,
    yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    g: float = 9.81,
) -> xr.Dataset:
    """Friction parameters of the paper's Eqs. 7-11, and λ, over a grid.

    Parameters are those of `sweep`.

    Returns
    -------
    Dataset
        `yield_acceleration`, `limiting_acceleration` (m/s²), `acceleration_ratio`,
        `minimum_friction`, `delta_mu`, `decay_rate`, `sliding_mode`, and the part of
        `validity` that is known before the motion.  A parameter that was given is a coordinate.

    Raises
    ------
    InputError
        A value that no physics allows.
    """
    given = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": amplitude,
        "yield_acceleration": yield_acceleration,
        "decay_rate": decay_rate,
        "delta_mu": delta_mu,
        "minimum_friction": minimum_friction,
    }
    problem = check_options(g=g)
    arrays = _labelled(given)
    found = _friction_parameters(problem, arrays)
    dataset = xr.Dataset(
        {name: variable for name, variable in found.items() if name not in arrays}, _coordinates(arrays)
    )
    return dataset.assign_attrs(_attributes(problem, None, "Friction parameters"))


def check_options(
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    waveform: str = "sine",
    cycles: int = 10,
    solver: str = "auto",
    steps_per_cycle: int = STEPS_PER_CYCLE,
    rule: str = "trapezoid",
    g: float = 9.81,
) -> Problem:
    """The options of `sweep`, checked (InputError names the one that is not allowed)."""
    check_choice("waveform", waveform, WAVEFORMS)
    return Problem(
        model=check_choice("model", model, MODELS),
        rise=check_choice("rise", rise, RISES),
        recoupling=check_choice("recoupling", recoupling, RECOUPLINGS),
        cycles=check_whole("cycles", cycles, 1),
        solver=check_choice("solver", solver, SOLVERS),
        rule=check_choice("rule", rule, RULES),
        steps_per_cycle=check_whole("steps_per_cycle", steps_per_cycle, 8, multiple_of=4),
        g=float(check_values("g", g)),
    )


def check_variables(variables: Sequence[str] | None) -> tuple[str, ...]:
    """The names of the results wanted, in the order of `variables.RESULTS`."""
    if variables is None:
        return DEFAULT_RESULTS
    if isinstance(variables, str):
        raise InputError(f"variables = {variables!r}: must be a list of names")
    for name in variables:
        check_choice("variables", name, RESULTS)
    if not len(variables):
        raise InputError(f"variables = {variables!r}: must name one of {', '.join(map(repr, RESULTS))} at least")
    return tuple(name for name in RESULTS if name in variables)


def _labelled(given: Mapping[str, Values | None]) -> dict[str, xr.DataArray]:
    """Every parameter that is given, checked, as a float64 DataArray."""
    arrays = {}
    for name, values in given.items():
        if values is None:
            continue
        if isinstance(values, xr.DataArray):
            # computes a lazy input: parameters are axes, small beside the grid
            array = values.copy(data=check_values(name, values.values))
        else:
            checked = check_values(name, values)
            if checked.ndim > 1:
                raise InputError(
                    f"{name}: an array of {checked.ndim} dimensions; must be a scalar, a 1-D array, or a DataArray "
                    "that names its dimensions"
                )
            array = xr.DataArray(checked, dims=(name,) if checked.ndim else ())
        if array.size == 0:
            raise InputError(f"{name} = []: must hold at least one value")
        arrays[name] = array.assign_attrs(PARAMETERS[name]).rename(name)
    return arrays


def _coordinates(arrays: Mapping[str, xr.DataArray]) -> dict[str, Any]:
    """The parameters as coordinates, with those that the DataArrays among them brought along."""
    coordinates: dict[str, Any] = {}
    for array in arrays.values():
        for name, coordinate in array.coords.items():
            known = coordinates.get(str(name))
            if known is not None and not known.variable.equals(coordinate.variable):
                raise InputError(f"{array.name}: its coordinate {name!r} differs from that of another parameter")
            coordinates[str(name)] = coordinate
    for name, array in arrays.items():
        coordinates[name] = array.variable
    return coordinates


def _sizes(arrays: Mapping[str, xr.DataArray]) -> dict[str, int]:
    """Dimensions of the grid in the order of the results, and their lengths."""
    sizes: dict[str, int] = {}
    for array in arrays.values():
        for dim, size in array.sizes.items():
            if sizes.setdefault(str(dim), size) != size:
                raise InputError(
                    f"{array.name}: {size} values along {dim!r}, where another parameter has {sizes[str(dim)]}"
                )
    ordered = [dim for dim in DIMENSION_ORDER if dim in sizes] + [dim for dim in sizes if dim not in DIMENSION_ORDER]
    return {dim: sizes[dim] for dim in ordered}


def _aligned(arrays: Mapping[str, xr.DataArray], dims: Sequence[str]) -> dict[str, np.ndarray]:
    """Plain arrays with all of `dims`, of length 1 where they do not vary."""
    aligned = {}
    for name, array in arrays.items():
        own = array.transpose(*(dim for dim in dims if dim in array.dims)).values
        aligned[name] = own.reshape([array.sizes.get(dim, 1) for dim in dims])
    return aligned


def _check_memory(sizes: Mapping[str, int], wanted: Sequence[str]) -> None:
    """Refuse what memory cannot hold, before any of it is taken."""
    needed = math.prod(sizes.values()) * sum(np.dtype(RESULT_DTYPES.get(name, "f8")).itemsize for name in wanted)
    free = available_memory()
    if free is not None and needed > free:
        grid = " x ".join(f"{size} {dim}" for dim, size in sizes.items())
        raise InputError(
            f"grid of {grid}: {math.prod(sizes.values()):.4g} cells take {size_text(needed)}, but {size_text(free)} "
            "of memory is free; ask for fewer variables or cells, or give chunks= for a lazy result"
        )


def _solve(
    problem: Problem,
    wanted: tuple[str, ...],
    shape: tuple[int, ...],
    arrays: Mapping[str, np.ndarray],
    progress: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Solve a grid, or a chunk of one: `engine.solve` and the flag that depends on the structure."""
    results = engine.solve(problem, shape, arrays, arrays["frequency"], wanted, progress)
    if "structure_frequency" in arrays and "validity" in results:
        flexible = engine.flexible_block(arrays["frequency"], arrays["structure_frequency"])
        np.bitwise_or(results["validity"], flexible, out=results["validity"])
    return results


def _solve_lazily(
    problem: Problem,
    wanted: tuple[str, ...],
    sizes: Mapping[str, int],
    arrays: Mapping[str, np.ndarray],
    chunks: Any,
) -> dict[str, Any]:
    """The same as dask arrays: a task a chunk solves all variables, another picks each out."""
    from dask.array import Array
    from dask.base import tokenize
    from dask.highlevelgraph import HighLevelGraph

    blocks = _blocks(chunks, sizes)
    starts = [list(itertools.accumulate(lengths, initial=0)) for lengths in blocks]
    token = tokenize(problem, wanted, tuple(sizes.items()), arrays)
    solver = f"slipsweep-{token}"
    tasks: dict[str, dict[Any, Any]] = {solver: {}} | {f"{name}-{token}": {} for name in wanted}
    for index in itertools.product(*(range(len(lengths)) for lengths in blocks)):
        part = tuple(slice(begin[at], begin[at + 1]) for begin, at in zip(starts, index, strict=True))
        own = {
            name: array[tuple(cut if size > 1 else slice(None) for cut, size in zip(part, array.shape, strict=True))]
            for name, array in arrays.items()
        }
        shape = tuple(cut.stop - cut.start for cut in part)
        tasks[solver][solver, *index] = (_solve, problem, wanted, shape, own)
        for name in wanted:
            tasks[f"{name}-{token}"][f"{name}-{token}", *index] = (operator.getitem, (solver, *index), name)
    results = {}
    for name in wanted:
        layer = f"{name}-{token}"
        graph = HighLevelGraph({solver: tasks[solver], layer: tasks[layer]}, {solver: set(), layer: {solver}})
        results[name] = Array(graph, layer, blocks, dtype=RESULT_DTYPES.get(name, "float64"))
    return results


def _blocks(chunks: Any, sizes: Mapping[str, int]) -> tuple[tuple[int, ...], ...]:
    """Chunk lengths along every dimension; "auto" leaves frequency, which costs next to nothing, whole."""
    from dask.array.core import normalize_chunks

    asked = dict.fromkeys(sizes, "auto") | {"frequency": -1} if isinstance(chunks, str) and chunks == "auto" else chunks
    if isinstance(asked, Mapping):
        unknown = [dim for dim in asked if dim not in sizes and dim != "frequency"]
        if unknown:
            raise InputError(f"chunks = {chunks!r}: {unknown[0]!r} is not a dimension; they are {', '.join(sizes)}")
        asked = tuple(asked.get(dim, -1) for dim in sizes)
    try:
        normal: tuple[tuple[int, ...], ...] = normalize_chunks(asked, tuple(sizes.values()), dtype=np.dtype("f8"))
    except (TypeError, ValueError) as error:
        raise InputError(f"chunks = {chunks!r}: {error}") from None
    return normal


def _friction_parameters(problem: Problem, arrays: Mapping[str, xr.DataArray]) -> dict[str, xr.Variable]:
    """Eqs. 7-11 on the dimensions they depend on."""
    own = {name: arrays[name] for name in arrays if name in _FRICTION_INPUTS}
    sizes = _sizes(own)
    values = engine.friction_parameters(problem, tuple(sizes.values()), _aligned(own, tuple(sizes)))
    return {name: xr.Variable(tuple(sizes), array, RESULTS[name]) for name, array in values.items()}


def _attributes(problem: Problem, waveform: str | None, title: str) -> dict[str, Any]:
    """What a dataset says of itself."""
    attributes: dict[str, Any] = {
        "title": title,
        "source": f"slipsweep {__version__}",
        "references": REFERENCE,
        "g": problem.g,
    }
    if waveform is None:
        return attributes
    attributes |= {"model": problem.model, "waveform": waveform, "cycles": problem.cycles}
    if problem.model == "mendez":
        attributes |= {"rise": problem.rise, "recoupling": problem.recoupling}
    attributes["solver"] = engine.solver_of(problem)
    if attributes["solver"] == "step":
        attributes |= {"rule": problem.rule, "steps_per_cycle": problem.steps_per_cycle}
    return attributes
