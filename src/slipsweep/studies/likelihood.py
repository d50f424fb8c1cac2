"""One test as a likelihood: measured less computed channels, with the errors of the table's motion and of sensors.

Beside Üy, λ and Δμ stand nuisance parameters with known standard deviations: errors of the table's motion
(`table_motion`), offsets and drifts of sensors.  What is computed depends on them linearly, near enough, so that they
need no search: scaled residuals have the covariance 1 + E Eᵀ, E being the effects of one standard deviation of each,
and are made independent by it.

Two kinds of samples count less.  The block's acceleration jumps where the block stops, and a sample beside a jump
tells only on which side of it the jump lies: it is left out.  Readings of a converter that repeat are one
reading: n of them have the weight of one.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.inputs import Problem
from slipsweep.grid.solvers import options_of
from slipsweep.kernels.block import Cell
from slipsweep.kernels.exact import workspace_of
from slipsweep.kernels.history import History, record_history
from slipsweep.model.options import Cycle, Mendez
from slipsweep.model.variables import HISTORY
from slipsweep.motion.cutting import wave_of_record
from slipsweep.motion.records import Record
from slipsweep.motion.shaking import TABLE, ShakingTest
from slipsweep.studies.table_motion import TableMotion, converter_noise, noise_of, table_motion

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: What is sought, in the order of all vectors.
SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")

#: The least noise that a channel is taken to have, in parts of its largest value.
_LEAST_NOISE = 1e-5

#: Intervals of sampling to either side of a jump that are left out.
_BESIDE_A_JUMP = 1.6

#: Standard deviation of an offset or drift, in parts of a channel's largest value: no bound, in effect.
_LARGE = 3.0

#: Noise of the channels, in parts of their largest values, of a rough likelihood.
_ROUGH_NOISE = 0.1

#: Steps of the derivatives by errors of the table's motion and by its offset, in standard deviations.
_SHAPE_STEP, _LINE_STEP = 0.3, 1e-3


#: Columns of a history.
COLUMN = {name: at for at, name in enumerate(HISTORY)}


class Forward:
    """A block of known inclination and static friction on one motion, for parameters that are tried."""

    def __init__(self, theta: float, mu_s: float, model: Mendez, record: Record) -> None:
        self.theta, self.mu_s, self.model = theta, mu_s, model
        self._options = options_of(Problem(model, record, Cycle()), wants_peak=True)
        self._wave = wave_of_record.__wrapped__(record, 1.0)  # tried once: not kept in its cache
        self._workspace = workspace_of(self._wave, keeps_log=True)

    def __call__(self, parameters: Floats, times: Floats) -> Floats:
        """Columns of `HISTORY` at the times, for Üy, λ and Δμ."""
        onset, decay, drop = (float(one) for one in parameters)
        cell = Cell(math.tan(math.radians(self.theta)), self.mu_s, 1.0, onset, decay, drop, math.nan)
        table = np.empty((len(COLUMN), times.size))
        record_history(cell, self._options, self._wave, self._workspace, times, History(*table))
        return table.T


@dataclass(frozen=True)
class Line:
    """An offset, a drift or a step of a sensor: what one standard deviation of it adds to channels."""

    name: str
    parts: Mapping[str, Floats]
    deviation: float


@dataclass(frozen=True, eq=False)
class Linear:
    """A test near one solution: independent residuals for any parameters, and the nuisance parameters.

    Attributes
    ----------
    forward : Forward
    times : ndarray
    weights : dict of str to (ndarray, ndarray)
        Of each channel the samples that count, and what they are multiplied by to have unit variance.
    measured : ndarray
        The samples of all channels, so multiplied.
    left, sizes, right : ndarray
        Singular values of the effects of one standard deviation of each nuisance parameter on them.
    """

    forward: Forward
    times: Floats
    weights: dict[str, tuple[Mask, Floats]]
    measured: Floats
    left: Floats
    sizes: Floats
    right: Floats

    def __call__(self, parameters: Floats) -> Floats:
        """Independent residuals of unit variance, if the model and the noise are right."""
        rest = self.raw(parameters)
        return np.asarray(rest - self._shrunk @ (self.left.T @ rest))

    @functools.cached_property
    def _shrunk(self) -> Floats:
        return self.left * (1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2))

    def raw(self, parameters: Floats) -> Floats:
        """Measured less computed, in standard deviations, if the table's motion had no error."""
        history = self.forward(parameters, self.times)
        computed = np.concatenate([history[use, COLUMN[name]] * weight for name, (use, weight) in self.weights.items()])
        return np.where(np.isfinite(computed), self.measured - computed, 1e3)

    def nuisances(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Most likely values of the nuisance parameters and their standard deviations, in those of their priors."""
        along = self.left.T @ self.raw(parameters)
        values = self.right.T @ (self.sizes / (1.0 + self.sizes**2) * along)
        spread = 1.0 - np.sum(self.right**2 * (self.sizes**2 / (1.0 + self.sizes**2))[:, None], axis=0)
        return np.asarray(values), np.sqrt(np.maximum(spread, 0.0))

    def by_channel(self, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """What belongs to each channel."""
        ends = np.cumsum([weight.size for _, weight in self.weights.values()])[:-1]
        return dict(zip(self.weights, np.split(values, ends), strict=True))

    def unexplained(self, parameters: Floats) -> dict[str, Floats]:
        """What the most likely nuisance parameters leave of each channel, in its own unit."""
        rest = self.raw(parameters) - (self.left * self.sizes) @ (self.right @ self.nuisances(parameters)[0])
        return {name: part / self.weights[name][1] for name, part in self.by_channel(rest).items()}

    def between(self, begin: float, end: float, speed: float) -> "Linear":
        """The samples between two times; the motion at the beginning is unknown, velocities of the order of `speed`."""
        inside = (self.times >= begin) & (self.times < end)
        rows = np.concatenate([inside[use] for use, _ in self.weights.values()])
        weights = {name: (use & inside, weight[inside[use]]) for name, (use, weight) in self.weights.items()}
        starts = []
        for name, (use, weight) in weights.items():
            moved = np.column_stack([np.ones(weight.size), self.times[use] - begin])
            still = np.column_stack([np.zeros(weight.size), np.ones(weight.size)])
            shape = {"relative_displacement": moved, "relative_velocity": still}.get(name, 0.0 * still)
            starts.append(speed * shape * weight[:, np.newaxis])
        effects = np.column_stack([((self.left * self.sizes) @ self.right)[rows], np.concatenate(starts)])
        return Linear(
            self.forward, self.times, weights, self.measured[rows], *np.linalg.svd(effects, full_matrices=False)
        )


@dataclass(eq=False)
class Observation:
    """A test and what is known of its sensors.

    Attributes
    ----------
    test : ShakingTest
    theta, mu_s : float
    model : Mendez
    offsets, drifts : sequence of str
        Channels whose sensor has an offset, or an offset and a drift.
    given_noise : mapping of str to float
        Standard deviation of channels; what is not given is estimated from the residuals (`take_noise`).
    use, noise : dict of str to ndarray and to float
        Samples that count and the standard deviation, of each channel of the block.
    lines, table_lines : list of Line
        Offsets, drifts and steps of the block's sensors and of the table's.
    """

    test: ShakingTest
    theta: float
    mu_s: float
    model: Mendez
    offsets: Sequence[str] = ()
    drifts: Sequence[str] = ()
    given_noise: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        test = self.test
        # the last sample is that at which a record ends
        inside = np.arange(test.times.size) < test.times.size - 1
        self.use: dict[str, Mask] = {name: inside & np.isfinite(test.channels[name]) for name in test.responses}
        self.weights = {name: weights_of(test.channels[name]) for name in test.responses}
        self.least_noise = {
            name: max(_LEAST_NOISE * float(np.nanmax(np.abs(values))), converter_noise(values), 1e-15)
            for name, values in test.channels.items()
            if name != TABLE
        }
        self.noise = {
            name: self.given_noise.get(name, max(noise_of(test.channels[name]), least))
            for name, least in self.least_noise.items()
        }
        self.motion: TableMotion = table_motion(test.times, test.channels[TABLE])
        self.lines = self._lines(test.responses)
        self.table_lines = self._lines((TABLE,))
        on_motion = [np.interp(self.motion.times, test.times, one.parts[TABLE]) for one in self.table_lines]
        self.shapes = np.column_stack([self.motion.shapes, *(-line for line in on_motion)])
        self.wrong = np.zeros(self.shapes.shape[1])
        self.jumps_left_out = np.zeros(test.times.size, dtype=bool)

    def _lines(self, names: Sequence[str]) -> list[Line]:
        since = (self.test.times - self.test.times[0]) / (self.test.times[-1] - self.test.times[0])
        lines = []
        for name in names:
            size = _LARGE * float(np.nanmax(np.abs(self.test.channels[name])))
            if name in self.offsets or name in self.drifts:
                lines.append(Line(f"offset of {name}", {name: np.full(since.size, size)}, size))
            if name in self.drifts:
                lines.append(Line(f"drift of {name}", {name: size * since}, size))
        return lines

    @property
    def peak(self) -> float:
        """Largest acceleration of the table, m/s²."""
        return float(self.motion.acceleration.max())

    def record(self, wrong: Floats) -> Record:
        """The table's motion with so many standard deviations of each of its errors."""
        return Record(self.motion.times, self.motion.acceleration + self.shapes @ wrong)

    def forward(self, wrong: Floats | None = None) -> Forward:
        """The block on the table's motion as last estimated, or with other errors of it."""
        return Forward(self.theta, self.mu_s, self.model, self.record(self.wrong if wrong is None else wrong))

    def linear(self, parameters: Floats, rough: bool = False) -> Linear:
        """The likelihood near a solution; `rough` as if the table's record had no noise, and the channels had much."""
        test, forward = self.test, self.forward()
        weights = {}
        for name, use in self.use.items():
            counted = use & ~self.jumps_left_out if name == "block_acceleration" else use
            noise = max(self.noise[name], _ROUGH_NOISE * float(np.nanmax(np.abs(test.channels[name]))) * rough)
            weights[name] = counted, self.weights[name][counted] / noise

        def weighted(parts: Mapping[str, Floats]) -> Floats:
            none = np.zeros(test.times.size)
            return np.concatenate([parts.get(name, none)[use] * weight for name, (use, weight) in weights.items()])

        def computed(by: Forward) -> Floats:
            history = by(parameters, test.times)
            return weighted({name: history[:, COLUMN[name]] for name in weights})

        measured = weighted(test.channels)
        effects = np.zeros((measured.size, self.wrong.size + len(self.lines)))
        kinds = self.wrong.size - len(self.table_lines)
        base = computed(forward)
        for at in range(kinds if rough else 0, self.wrong.size):
            moved = self.wrong.copy()
            moved[at] += _SHAPE_STEP if at < kinds else _LINE_STEP
            change = computed(self.forward(moved)) - base
            effects[:, at] = np.nan_to_num(change) / (moved[at] - self.wrong[at])
        for at, line in enumerate(self.lines, self.wrong.size):
            effects[:, at] = weighted(line.parts)
        measured = measured + effects[:, : self.wrong.size] @ self.wrong
        return Linear(forward, test.times, weights, measured, *np.linalg.svd(effects, full_matrices=False))

    def take_noise(self, linear: Linear, parameters: Floats) -> None:
        """Estimate the noise of each channel from the residuals, where it is not given."""
        leverage = linear.by_channel(linear.left**2 @ (linear.sizes**2 / (1.0 + linear.sizes**2)))
        for name, rest in linear.unexplained(parameters).items():
            weight = linear.weights[name][1] * self.noise[name]
            freedom = float(np.sum(weight**2)) - float(np.sum(leverage[name])) - 1.0
            if name not in self.given_noise and freedom > 0.0:
                noise = float(np.sqrt(np.sum((rest * weight) ** 2) / freedom))
                self.noise[name] = max(noise, self.least_noise[name])

    def move(self, linear: Linear, parameters: Floats) -> None:
        """Take the table's motion as it most likely was, and leave out the samples beside jumps."""
        self.wrong = linear.nuisances(parameters)[0][: self.wrong.size]
        if "block_acceleration" in self.use:
            self.jumps_left_out = self._beside_jumps(parameters)

    def _beside_jumps(self, parameters: Floats) -> Mask:
        """Samples next to a time at which the block's computed acceleration jumps by more than the noise."""
        times = self.test.times
        fine = np.interp(np.arange(0, times.size - 1, 0.125), np.arange(times.size), times)
        history = self.forward()(parameters, fine)
        block, table = history[:, COLUMN["block_acceleration"]], history[:, COLUMN[TABLE]]
        # either is smooth where the block holds its acceleration or sticks to the table
        change = np.minimum(np.abs(np.diff(block)), np.abs(np.diff(block - table)))
        least = max(self.noise["block_acceleration"], 0.02 * float(np.abs(table).max()))
        before = np.diff(times, prepend=2 * times[0] - times[1])
        after = np.append(before[1:], before[-1])
        found = np.zeros(times.size, dtype=bool)
        for jump in fine[np.flatnonzero(change > least)]:
            found |= (times > jump - _BESIDE_A_JUMP * after) & (times < jump + _BESIDE_A_JUMP * before)
        return found


def weights_of(values: Floats) -> Floats:
    """Square roots of the samples' weights: readings at one level, several in turn, have the weight of one.

    A converter's error is the same in all of them, also where the block holds one acceleration in each cycle.
    """
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    lengths = np.diff(np.append(begins, values.size))
    runs = np.repeat(lengths, lengths) > 1
    weights = np.ones(values.size)
    _, level, counts = np.unique(values[runs], return_inverse=True, return_counts=True)
    weights[runs] = 1.0 / np.sqrt(counts[level])
    return weights
