"""Arrays in, arrays out: the sweep without labels.

Knows numpy and the kernels; no xarray, no files.  Every input is an array that broadcasts
to the shape of the result; a dimension along which only the frequency varies is served
by the scaling law and costs no kernel call.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import RunError
from slipsweep.grid import threads
from slipsweep.grid.chunks import slabs
from slipsweep.grid.problem import Problem
from slipsweep.grid.served import UNBOUNDED, check_served, is_ordinary
from slipsweep.grid.solvers import ROWS, options_of, solver_of
from slipsweep.jit.decorators import of_arrays
from slipsweep.kernels.block import UNSOLVED, Cell
from slipsweep.kernels.grid import Cells, find_parameters
from slipsweep.model import equations as eq
from slipsweep.model.variables import FRICTION_PARAMETERS, RESULT_DTYPES, STRENGTHS, Validity
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Waveform, peak_acceleration

#: Cells that a kernel solves in a call: their arrays stay in the cache, and Ctrl-C is heard between two calls.
_TILE = 16384

#: Amplitudes that are computed from peak displacements at a time (2 MB).
_AMPLITUDES = 262144

#: Results in which `mark_flexible_blocks` sets flags together.
_FLAGS = 65536

#: Inputs that Newmark's block does not know.
_NOT_NEWMARKS = ("decay_rate", "delta_mu", "minimum_friction", "structure_frequency")

#: Results of a motion that come out of a kernel.
MOTION_RESULTS = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")

Array = NDArray[np.float64]

#: Results by their names.
Arrays: TypeAlias = dict[str, NDArray[Any]]


def cell_inputs(arrays: Mapping[str, Array], dimensions: int, g: float) -> list[Array]:
    """The seven fields of `Cell` as arrays of `dimensions` dimensions; what is not given is NaN.

    The amplitude may be given as a peak displacement with its frequency, the yield acceleration over g.
    """
    if "displacement_amplitude" in arrays:
        amplitude = peak_acceleration(arrays["displacement_amplitude"], arrays["frequency"])
        arrays = {**arrays, "amplitude": amplitude}
    if "yield_coefficient" in arrays:
        arrays = {**arrays, "yield_acceleration": arrays["yield_coefficient"] * g}
    inputs = []
    for name in Cell._fields:
        source = arrays.get("theta" if name == "tan_theta" else name)
        values = np.full((1,) * dimensions, math.nan) if source is None else np.asarray(source, np.float64)
        inputs.append(np.tan(np.radians(values)) if name == "tan_theta" else values)
    return inputs


def scaled_dimension(shape: tuple[int, ...], inputs: list[Array], frequency: Array) -> int | None:
    """The longest dimension along which the frequency varies and no other input does."""
    only = [
        axis
        for axis in range(len(shape))
        if frequency.shape[axis] > 1 and all(values.shape[axis] == 1 for values in inputs)
    ]
    return max(only, key=lambda axis: shape[axis]) if only else None


def cells_to_solve(shape: tuple[int, ...], inputs: list[Array], frequency: Array) -> int:
    """Number of cells a kernel solves for a grid: all, but for the dimension that the scaling law serves."""
    scaled = scaled_dimension(shape, inputs, frequency)
    return math.prod(size for axis, size in enumerate(shape) if axis != scaled)


@dataclass(frozen=True)
class Request:
    """What is asked of a grid: its inputs, and the results wanted of it.

    Attributes
    ----------
    problem : Problem
        What all cells share.
    shape : tuple of int
        Shape of the results.
    arrays : mapping of str to array
        `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of the shaking: under a
        waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz); under records one of
        `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the place of the `motion` in it, and of
        pairs `azimuth`.  Each has as many dimensions as `shape`, of length 1 where it does not vary.
    wanted : tuple of str
        Names of results; nothing else is computed.
    progress : callable, optional
        Called with a number of result cells as they are finished, from any thread.
    """

    problem: Problem
    shape: tuple[int, ...]
    arrays: Mapping[str, Array]
    wanted: tuple[str, ...]
    progress: Callable[[int], None] | None = None

    def results(self) -> Arrays:
        """Arrays for what is wanted, not filled in: of `shape`, float64 but for codes (`variables.RESULT_DTYPES`)."""
        return {name: np.empty(self.shape, RESULT_DTYPES.get(name, "float64")) for name in self.wanted}

    def tell(self, cells: int) -> None:
        """Tell of progress, if anybody wants to know."""
        if self.progress is not None:
            self.progress(cells)

    def part(self, where: tuple[slice, ...]) -> "Request":
        """The same of a part of the grid."""
        shape = tuple(len(range(*cut.indices(size))) for cut, size in zip(where, self.shape, strict=True))
        return replace(self, shape=shape, arrays=cut(self.arrays, where))


def solve(asked: Request) -> Arrays:
    """Solve a grid for `MOTION_RESULTS` or, under records, `variables.RECORD_RESULTS`.

    Raises
    ------
    InputError
        A result that has a value is beyond double precision.
    RunError
        An event of the motion was not found.
    """
    results = asked.results()
    for where, part in _parts(asked):
        # the dots keep an array without dimensions an array
        view: Any = (*where, ...)
        _solve_into({name: values[view] for name, values in results.items()}, part)
    return results


def newmark(asked: Request) -> Arrays:
    """The permanent displacement as `newmark_displacement`: the model is Newmark's; errors as of `solve`."""
    arrays = {name: values for name, values in asked.arrays.items() if name not in _NOT_NEWMARKS}
    # along a dimension of the friction law alone its cells are the same
    shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
    same = shape == asked.shape
    own = replace(
        asked,
        shape=shape,
        arrays=arrays,
        wanted=("permanent_displacement",),
        progress=asked.progress if same else None,
    )
    moved = solve(own)["permanent_displacement"]
    if same:
        return dict.fromkeys(asked.wanted, moved)
    results = asked.results()
    for values in results.values():
        np.copyto(values, moved)
    asked.tell(math.prod(asked.shape))
    return results


def _parts(asked: Request) -> Iterator[tuple[tuple[slice, ...], Request]]:
    """Parts that are solved one after the other: those of one motion, and those whose amplitudes memory holds."""
    if isinstance(asked.problem.excitation, (Record, Suite)):
        yield from motions(asked)
    elif _amplitudes(asked.arrays) <= _AMPLITUDES:
        yield (slice(None),) * len(asked.shape), asked
    else:
        # A = ω²d where d and ω span a grid: as large as a result, and there for a slab at a time only
        for slab in slabs(asked.shape, _AMPLITUDES):
            yield slab, asked.part(slab)


#: Inputs that make another motion of the plane, hence another table of pieces.
_MOTIONS = ("motion", "azimuth", "polarity")


def motions(asked: Request) -> Iterator[tuple[tuple[slice, ...], Request]]:
    """The parts of a grid of records that one motion shakes, and where in the grid they lie; all of a waveform's.

    Of a suite each is under a record of its own, with which a solver goes on as if there were no other.
    """
    own = [asked.arrays[name].shape for name in _MOTIONS if name in asked.arrays]
    varying = np.broadcast_shapes((1,) * len(asked.shape), *own)
    for side in np.ndindex(varying):
        where = tuple(slice(at, at + 1) if n > 1 else slice(None) for at, n in zip(side, varying, strict=True))
        yield where, _under_one(asked.part(where))


def _under_one(part: Request) -> Request:
    """A part that one motion of a suite shakes, under the record of that motion."""
    suite = part.problem.excitation
    if not isinstance(suite, Suite):
        return part
    arrays = dict(part.arrays)
    motion, azimuth = arrays.pop("motion"), arrays.pop("azimuth", np.zeros(1))
    record = suite.record(int(motion.item()), float(azimuth.item()))
    return replace(part, problem=replace(part.problem, excitation=record), arrays=arrays)


def narrowed(problem: Problem, inputs: Mapping[str, Array]) -> tuple[Problem, dict[str, Array]]:
    """A problem with no more motions than its inputs name, which goes to another process with as many samples."""
    suite = problem.excitation
    if not isinstance(suite, Suite):
        return problem, dict(inputs)
    used, places = np.unique(inputs["motion"].astype(np.int64), return_inverse=True)
    if used.size == len(suite):
        return problem, dict(inputs)
    part = suite.only([suite.labels[at] for at in used])
    return replace(problem, excitation=part), {
        **inputs,
        "motion": places.reshape(inputs["motion"].shape).astype(np.float64),
    }


def factors(asked: Request) -> Arrays:
    """The factor on the acceleration of every motion, whatever says how strong it is."""
    results = asked.results()
    for where, part in motions(asked):
        record = part.problem.excitation
        assert isinstance(record, Record)
        for values in results.values():
            values[where] = strength_factor(record, part.arrays)
        asked.tell(math.prod(part.shape))
    return results


def _amplitudes(arrays: Mapping[str, Array]) -> int:
    """How many amplitudes the peak displacements of a grid make."""
    if "displacement_amplitude" not in arrays:
        return 0
    return math.prod(np.broadcast_shapes(arrays["displacement_amplitude"].shape, arrays["frequency"].shape))


def _solve_into(results: Arrays, asked: Request) -> None:
    """Solve a part of a grid that one motion shakes, into views of the results."""
    problem, shape, arrays = asked.problem, asked.shape, asked.arrays
    extremes = extremes_of(problem.excitation)
    inputs, periods = kernel_inputs(asked)
    # what is out of the ordinary is looked at, for which flags are needed in any case
    looked_at = (np.array(problem.model.g), *inputs[1:], periods, *extremes.values())
    ordinary = all(map(is_ordinary, looked_at))
    filled = results if ordinary else {"validity": np.empty(shape, RESULT_DTYPES["validity"]), **results}
    unsolved = _fill(filled, asked, inputs, periods)
    if not ordinary:
        check_served(problem.model.g, {**arrays, **extremes}, results, filled["validity"])
    _refuse_unsolved(unsolved, shape, arrays)
    if "structure_frequency" in arrays and "validity" in results:
        mark_flexible_blocks(results["validity"], arrays["frequency"], arrays["structure_frequency"])


def extremes_of(motion: Waveform | Record | Suite) -> dict[str, Array]:
    """The largest numbers of a motion itself, or of each of a suite, by what they are called in errors."""
    if isinstance(motion, Waveform):
        return {}
    records = motion.components if isinstance(motion, Suite) else (motion,)
    peaks, times = [one.peak for one in records], [np.abs(one.times).max() for one in records]
    return {
        "acceleration of the record": np.array(peaks if len(peaks) > 1 else peaks[0]),
        "time of the record": np.array(times if len(times) > 1 else times[0]),
    }


def are_ordinary(problem: Problem, given: Mapping[str, Array]) -> bool:
    """Whether no result can be too large for double precision, whatever the given values are combined to."""
    values = {name: values for name, values in given.items() if name not in UNBOUNDED}
    looked_at = [np.array(problem.model.g), *values.values(), *extremes_of(problem.excitation).values()]
    if isinstance(problem.excitation, (Record, Suite)):
        looked_at += _extreme_factors(problem.excitation, values)
    if {"displacement_amplitude", "frequency"} <= values.keys():
        # A = ω²d grows with both: of the extremes of both, it has its own
        d, f = (
            np.array([own[own > 0.0].min(initial=1.0), own.max()])
            for own in (values["displacement_amplitude"], values["frequency"])
        )
        with np.errstate(all="ignore"):
            looked_at.append(peak_acceleration(d[:, None], f))
    return all(map(is_ordinary, looked_at))


def _extreme_factors(motion: Record | Suite, values: Mapping[str, Array]) -> list[Array]:
    """The least and the largest factors on records, whatever the strengths are combined with."""
    extremes = {name: np.array([values[name].min(), values[name].max()]) for name in STRENGTHS if name in values}
    time_scale = values.get("time_scale", np.ones(1))
    found = []
    for record in motion.components if isinstance(motion, Suite) else (motion,):
        if record.peak > 0.0:
            for stretch in (time_scale.min(), time_scale.max()):
                given = {**extremes, "time_scale": np.array(stretch)}
                found.append(strength_factor(record, given if extremes else {"scale": np.ones(1)}))
    return found


def kernel_inputs(asked: Request) -> tuple[list[Array], Array]:
    """What kernels take: the fields of `Cell`, and 1/ω or the factor on time."""
    motion, arrays, dimensions, g = asked.problem.excitation, asked.arrays, len(asked.shape), asked.problem.model.g
    if isinstance(motion, Waveform):
        return cell_inputs(arrays, dimensions, g), 1.0 / (2.0 * math.pi * arrays["frequency"])
    assert isinstance(motion, Record)  # `motions` has made a suite into its parts
    own = {**arrays, "amplitude": strength_factor(motion, arrays)}
    return cell_inputs(own, dimensions, g), arrays["time_scale"]


def amplitudes(asked: Request) -> Arrays:
    """The amplitude A = ω²d of every cell."""
    results = asked.results()
    for values in results.values():
        np.copyto(values, peak_acceleration(asked.arrays["displacement_amplitude"], asked.arrays["frequency"]))
    asked.tell(math.prod(asked.shape))
    return results


def coulomb_yield_acceleration(theta: Array, mu_s: Array, g: float) -> Array:
    """Üy of Coulomb interfaces, m/s²; shapes as they broadcast."""
    with np.errstate(all="ignore"):  # infinite where a surface is overhanging
        return np.asarray(of_arrays(eq.coulomb_yield_acceleration)(mu_s, np.tan(np.radians(theta)), g))


def _cells_of(inputs: list[Array], slab: tuple[slice, ...], shape: tuple[int, ...]) -> Cells:
    """The cells of a slab of a grid, (cells,) each."""
    parts = (cut({"values": values}, slab)["values"] for values in inputs)
    return Cells(*(np.ascontiguousarray(np.broadcast_to(part, shape)).reshape(-1) for part in parts))


def _fill(results: Arrays, asked: Request, inputs: list[Array], periods: Array) -> tuple[int, ...] | None:
    """Fill in results, tile by tile; u and v go as the squares of `periods` and as `periods` (the scaling law).

    Returns a cell that was not solved, if there is one.
    """
    shape, scaled = asked.shape, scaled_dimension(asked.shape, inputs, periods)
    cell_shape = tuple(1 if axis == scaled else size for axis, size in enumerate(shape))
    polarity = float(asked.arrays["polarity"].item()) if "polarity" in asked.arrays else 1.0
    wants_peak = "peak_relative_velocity" in results
    solve_cells, cost = solver_of(asked.problem, wants_peak, polarity)
    tile = max(_TILE // cost, 1)
    tiles = list(slabs(cell_shape, tile))
    unsolved: list[tuple[int, ...]] = []

    def work(first: int, last: int) -> None:
        if first == last:  # what a first call compiles, seconds long, is compiled on the thread that hears Ctrl-C
            solve_cells(Cells(*(np.empty(0) for _ in Cells._fields)), np.empty((len(ROWS), 0)))
        for slab in tiles[first:last]:
            _fill_tile(results, slab, scaled)

    def _fill_tile(results: Arrays, slab: tuple[slice, ...], scaled: int | None) -> None:
        lengths = tuple(len(range(*one.indices(size))) for one, size in zip(slab, cell_shape, strict=True))
        cells = _cells_of(inputs, slab, lengths)
        found = np.empty((len(ROWS), cells.mu_s.size))
        solve_cells(cells, found)
        where = tuple(slice(None) if axis == scaled else one for axis, one in enumerate(slab))
        seconds = cut({"periods": periods}, where)["periods"]
        for name, values in results.items():
            view: Any = (*where, ...)
            target, own = values[view], found[ROWS[name]].reshape(lengths)
            with np.errstate(
                over="ignore", under="ignore", invalid="ignore"
            ):  # what is no finite number is refused by name
                if name == "permanent_displacement":
                    np.multiply(own, seconds * seconds, out=target)
                elif name == "peak_relative_velocity":
                    np.multiply(own, seconds, out=target)
                else:
                    np.copyto(target, own, casting="unsafe")
        wrong = np.flatnonzero(found[ROWS["validity"]].astype(np.int64) & UNSOLVED)
        if wrong.size:
            at = np.unravel_index(int(wrong[0]), lengths)
            unsolved.append(tuple(int(i) + (one.start or 0) for i, one in zip(at, slab, strict=True)))
        asked.tell(cells.mu_s.size * (shape[scaled] if scaled is not None else 1))

    if math.prod(shape):
        threads.spread(len(tiles), work, tile * cost)
    return unsolved[0] if unsolved else None


def _refuse_unsolved(cell: tuple[int, ...] | None, shape: tuple[int, ...], arrays: Mapping[str, Array]) -> None:
    """Say which cell a kernel could not solve."""
    if cell is None:
        return
    parameters = ", ".join(f"{name} = {float(np.broadcast_to(values, shape)[cell])}" for name, values in arrays.items())
    raise RunError(
        f"{parameters}: an event of the motion was not found; please report this cell, with the options of the run"
    )


def friction_parameters(asked: Request) -> Arrays:
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion; no frequency.

    Errors as of `solve`.
    """
    return estimates(asked, checked=True)


def estimates(asked: Request, checked: bool = False) -> Arrays:
    """As `friction_parameters`; unless `checked`, an estimate that is no finite number is given as it is."""
    results, options = asked.results(), options_of(asked.problem, wants_peak=False)
    parts = list(slabs(asked.shape, _TILE))
    inputs = cell_inputs(asked.arrays, len(asked.shape), asked.problem.model.g)

    def solve_slab(slab: tuple[slice, ...]) -> None:
        shape = tuple(len(range(*one.indices(size))) for one, size in zip(slab, asked.shape, strict=True))
        cells = _cells_of(inputs, slab, shape)
        rows = np.empty((len(FRICTION_PARAMETERS) + 2, cells.mu_s.size))
        find_parameters(cells, options, rows)
        found = dict(zip((*FRICTION_PARAMETERS, "sliding_mode", "validity"), rows, strict=True))
        shaped = {name: found[name].reshape(shape).astype(results[name].dtype) for name in asked.wanted}
        if checked:
            validity = found["validity"].reshape(shape).astype(np.int16)
            check_served(asked.problem.model.g, cut(asked.arrays, slab), shaped, validity)
        for name, values in shaped.items():
            if checked and values.dtype.kind == "f":
                values[np.isinf(values)] = math.nan  # of a cell without a value
            results[name][slab] = values
        asked.tell(cells.mu_s.size)

    def work(first: int, last: int) -> None:
        for slab in parts[first:last]:
            solve_slab(slab)

    threads.spread(len(parts), work, _TILE)
    return results


def mark_flexible_blocks(validity: NDArray[np.int16], frequency: Array, structure_frequency: Array) -> None:
    """Set the validity bit of blocks that are not rigid, 0.2 ≤ f/fs ≤ 1.3."""
    varying = np.broadcast_shapes(frequency.shape, structure_frequency.shape)
    # in slabs: temporaries stay small even where the two vary along every dimension
    for slab in slabs(varying, _FLAGS):
        part = cut({"f": frequency, "fs": structure_frequency}, slab)
        ratio = part["f"] / part["fs"]
        flags = ((ratio >= 0.2) & (ratio <= 1.3)) * np.int16(Validity.FLEXIBLE_BLOCK)
        where: Any = (one if size > 1 else slice(None) for one, size in zip(slab, varying, strict=True))
        validity[(*where, ...)] |= flags


def cut(arrays: Mapping[str, Array], slices: tuple[slice, ...]) -> dict[str, Array]:
    """A part of a grid: `arrays` cut along the dimensions in which they vary."""
    parts: dict[str, Array] = {}
    for name, values in arrays.items():
        where: Any = (part if size > 1 else slice(None) for part, size in zip(slices, values.shape, strict=True))
        parts[name] = values[(*where, ...)]  # the dots keep an array without dimensions an array
    return parts
