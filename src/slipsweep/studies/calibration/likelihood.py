"""One test as a likelihood: measured less computed channels, with the errors of the table's motion and of sensors.

Beside Üy, λ and Δμ stand nuisance parameters with known standard deviations: errors of the table's
motion (`table_motion`), offsets and drifts of sensors.  What is computed depends on them linearly,
near enough, so that they need no search: scaled residuals have the covariance 1 + E Eᵀ, E being the
effects of one standard deviation of each, and are made independent by it.  Which samples count
less, and why the table's motion is a spline: docs/calibration.md.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slipsweep.errors import InputError
from slipsweep.grid.inputs import Problem
from slipsweep.grid.solvers import options_of
from slipsweep.kernels.block import Cell
from slipsweep.kernels.history import History, fill_history
from slipsweep.model.options import Cycle, Mendez
from slipsweep.model.variables import HISTORY
from slipsweep.motion.cutting import path_of_record
from slipsweep.motion.records import Record
from slipsweep.motion.shaking import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies.calibration.measured_friction import Floats, check_contact, noise_of
from slipsweep.studies.calibration.noise import (
    LEAST_NOISE,
    colour_of,
    converter_noise,
    distances,
    is_first_order,
    whitened,
)
from slipsweep.studies.calibration.table_motion import table_motion

#: The series of `HISTORY` at some times, for Üy, λ and Δμ.
Forward = Callable[[Floats, Floats], Mapping[str, Floats]]

#: What is sought, in the order of all vectors.
SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")

#: Standard deviation of an offset, drift or step, in parts of a channel's largest value: no bound,
#: in effect.
_LARGE = 3.0

#: Combinations of errors with a smaller effect, in standard deviations, are left out.
_NO_EFFECT = 0.01

#: Standard deviations by which the sum of squares of errors of the table's motion exceeds what is
#: expected where they are taken to be larger, and how many times as large they may be.
_WIDER = 3.0
_TIMES = np.geomspace(1.0, 20.0, 100)

#: Samples at rest at least that show the noise of a sensor.
_AT_REST = 20

#: Standard deviation of normal noise over its median; standard deviations, and parts of a channel's
#: largest value, beyond which a sample contradicts the solution.
_OF_MEDIAN = 1.4826
_NO_NOISE = 7.0
_NO_MISFIT = 0.01

#: Steps of the derivatives by errors of the table's motion, in standard deviations.
_STEP = 0.3

#: Intervals of sampling to either side of a jump that are left out; consecutive samples, and
#: standard deviations of the noise, by which a block slips upslope.
_BESIDE_A_JUMP = 1.6
_UPSLOPE_SAMPLES = 4
_UPSLOPE_NOISE = 5.0


class Line(NamedTuple):
    """An offset, a drift or a step of a channel's sensor: its standard deviation, and what that adds at the samples."""

    name: str
    channel: str
    deviation: float
    values: Floats


class Linear:
    """Errors that residuals depend on linearly.

    `effects` are those of one standard deviation of each.  Residuals are in standard deviations,
    one a row of `effects`.
    """

    def __init__(self, effects: Floats) -> None:
        left, sizes, right = np.linalg.svd(effects, full_matrices=False)
        matter = sizes > _NO_EFFECT
        self.left = np.asarray(left[:, matter], order="F")
        self.sizes = sizes[matter]
        self.right = right[matter]
        self.known = self.sizes**2 / (1.0 + self.sizes**2)
        self._shrunk = self.left * (1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2))

    def independent(self, residuals: Floats) -> Floats:
        """Return residuals made independent, of unit variance if model and noise are right."""
        return np.asarray(residuals - self._shrunk @ (self.left.T @ residuals))

    def most_likely(self, residuals: Floats) -> tuple[Floats, Floats]:
        """Return the most likely values of the errors and their standard deviations.

        Both are in standard deviations of their priors.
        """
        along = self.left.T @ residuals
        values = self.right.T @ (self.sizes / (1.0 + self.sizes**2) * along)
        spread = 1.0 - np.sum(self.right**2 * self.known[:, None], axis=0)
        return np.asarray(values), np.sqrt(np.maximum(spread, 0.0))


class Observation:
    """A test and what is known of its sensors, checked, and the likelihood that it gives.

    All functions take as `parameters` Üy, λ, Δμ and then the sizes of `table_lines`, an offset and
    a drift of the table's sensor.  These are sought with the parameters: the block's motion does
    not depend on them linearly.

    `channels` of the block have the noise `sensor_noise` as neighbouring samples, or those at rest,
    scatter, or as given; the fit estimates `noise`, and the correlations `colour` of neighbouring
    residuals.  `drifts` may drift: those given and `drifting`.  `lines` are offsets, drifts and
    steps of the block's channels. `table_factor` is how many times the noise of the table's record
    its errors are.  `upslope` are the times at which slips begin that are left out.  `forward` and
    `linear` are the model and the likelihood near the last solution.
    """

    def __init__(
        self,
        test: ShakingTest,
        theta: float,
        mu_s: float,
        model: Mendez,
        offset: Any,
        drift: Any,
        noise: Mapping[str, float],
        drifting: Sequence[str] = (),
    ) -> None:
        if not test.responses:
            raise InputError(
                f"{test.name}: nothing of the block was measured: must have one at least of {', '.join(RESPONSES)}"
            )
        check_channels("noise", list(noise), test.responses)
        check_contact(test, theta, model.g)
        if not float(test.channels[TABLE].max()) > 0.0:
            raise InputError(
                f"{test.name}: {TABLE}: never positive: the table does not drive the block downslope"
            )
        offsets = check_channels("offset", offset, test.channels)
        self.drifts = (*check_channels("drift", drift, test.channels), *drifting)
        self.test = test
        self.theta = theta
        self.mu_s = mu_s
        self.model = model
        self.channels = test.responses
        measured = np.array([test.channels[name] for name in self.channels])
        # the last sample is that at which a record ends
        self._use = np.isfinite(measured) & (np.arange(test.times.size) < test.times.size - 1)
        self._beside_jumps = np.zeros_like(self._use)
        self._weights = np.array([_weights_of(values) for values in measured])
        self.largest = np.nanmax(np.abs(measured), axis=1)
        converters = [max(converter_noise(values), 1e-15) for values in measured]
        self._least_noise = np.maximum(LEAST_NOISE * self.largest, converters)
        self._given_noise = np.array([noise.get(name, np.nan) for name in self.channels])
        scatter = np.maximum([noise_of(values) for values in measured], self._least_noise)
        self.motion = table_motion(test.times, test.channels[TABLE])
        self.noise = np.where(np.isnan(self._given_noise), scatter, self._given_noise)
        at_rest = measured[:, test.times < self.motion.begins]
        if at_rest.shape[1] >= _AT_REST:  # slow noise is not seen in neighbouring samples
            scatter = np.fmax(scatter, np.nanstd(at_rest, axis=1))
        self.sensor_noise = np.where(np.isnan(self._given_noise), scatter, self._given_noise)
        self.colour = np.zeros(len(self.channels))
        self.lines: list[Line] = []
        self.table_lines: list[Line] = []
        since = (test.times - test.times[0]) / (test.times[-1] - test.times[0])
        for name, values in test.channels.items():
            size = 1.0 if name == TABLE else _LARGE * float(np.nanmax(np.abs(values)))
            lines = self.table_lines if name == TABLE else self.lines
            if name in offsets or name in self.drifts:
                lines.append(Line("offset", name, size, np.full(since.size, size)))
            if name in self.drifts:
                lines.append(Line("drift", name, size, size * since))
        columns = [
            np.interp(self.motion.times, test.times, line.values) for line in self.table_lines
        ]
        self._table_lines = np.reshape(columns, (len(columns), self.motion.times.size)).T
        # of a table that begins and ends at rest the mean acceleration is 0
        mean = float(np.mean(test.channels[TABLE]))
        self.first_sizes = np.array([mean, 0.0])[: len(self.table_lines)]
        self.wrong = np.zeros(self.motion.errors.shape[1])
        self.table_factor = 1.0
        self._of_sensors = {name: np.zeros(test.times.size) for name in self.channels}
        self.peak = self.peak_of(self.first_sizes)
        self.upslope: list[float] = []

    def table_acceleration(self, sizes: Floats) -> Floats:
        """Return the table's acceleration at the points of `motion`.

        It is less offset and drift of these sizes.
        """
        return np.asarray(self.motion.with_errors(self.wrong) - self._table_lines @ sizes)

    def recorded_acceleration(self, sizes: Floats) -> Floats:
        """Return the table's acceleration at the points of `motion` by its own record alone.

        It is less offset and drift of these sizes, and does not depend on the model.
        """
        return np.asarray(self.motion.acceleration - self._table_lines @ sizes)

    def peak_of(self, sizes: Floats) -> float:
        """Return the largest acceleration of the table, less offset and drift of these sizes."""
        return float(np.max(self.recorded_acceleration(sizes)))

    def record(self, sizes: Floats) -> Record:
        """Return the table's motion, less offset and drift of these sizes."""
        return Record(self.motion.times, self.table_acceleration(sizes))

    def _forward(self, wrong: Floats | None = None) -> Forward:
        """Return the model's block on the table's motion.

        `wrong` are the standard deviations of each error of that motion.
        """
        motion = self.motion.with_errors(self.wrong if wrong is None else wrong)

        @functools.lru_cache(maxsize=4)
        def shaking_of(sizes: tuple[float, ...]) -> tuple[Any, Any]:
            record = Record(self.motion.times, motion - self._table_lines @ np.array(sizes))
            options = options_of(Problem(self.model, record, Cycle()), wants_peak=True)
            return options, path_of_record.__wrapped__(record, 1.0)  # kept here, not in its cache

        def histories(parameters: Floats, times: Floats) -> dict[str, Floats]:
            onset, decay, drop, *sizes = map(float, parameters)
            cell = Cell(
                math.tan(math.radians(self.theta)), self.mu_s, 1.0, onset, decay, drop, math.nan
            )
            table = np.empty((len(HISTORY), times.size))
            fill_history(cell, *shaking_of(tuple(sizes)), times, History(*table))
            return dict(zip(HISTORY, table, strict=True))

        return histories

    def _scaled(self, series: Mapping[str, Floats]) -> Floats:
        """Return the samples that count, channel by channel, in standard deviations.

        They are 0 of a channel that is not there.
        """
        none = np.zeros(self.test.times.size)
        weighted: Floats = (
            np.array([series.get(name, none) for name in self.channels])[self._counted]
            * self._scale
        )
        return weighted

    def _by_channel(self, values: Floats) -> list[Floats]:
        return np.split(values, np.cumsum(self._counted.sum(axis=1))[:-1])

    def linearize(self, parameters: Floats, rough: float = 0.0) -> None:
        """Set `linear` near a solution.

        If `rough`, the noise of each channel is at least this part of its largest value, and the
        table's record has none.
        """
        self.forward = self._forward()
        self._counted = self._use & ~self._beside_jumps
        noise = np.maximum(self.noise, rough * self.largest)
        self._scale = (self._weights / noise[:, None])[self._counted]
        apart = [distances(self.test.times[counted]) for counted in self._counted]
        colours = [0.0 if rough else colour for colour in self.colour]
        self._links = np.concatenate(
            [colour**gaps for colour, gaps in zip(colours, apart, strict=True)]
        )
        at_rest = self._scaled(self.forward(parameters, self.test.times))
        number = self.wrong.size
        self._effects = np.zeros((at_rest.size, number + len(self.lines)))
        for at in range(number if rough else 0, number):
            moved = self.wrong.copy()
            moved[at] += _STEP
            history = self._forward(moved)(parameters, self.test.times)
            self._effects[:, at] = np.nan_to_num(self._scaled(history) - at_rest) / _STEP
        for at, line in enumerate(self.lines, number):
            self._effects[:, at] = self._scaled({line.channel: line.values})
        self._measured = self._scaled(self.test.channels) + self._effects[:, :number] @ self.wrong
        self.linear = Linear(whitened(self._effects, self._links))

    def residuals(self, parameters: Floats) -> Floats:
        """Return independent residuals of unit variance, if the model and the noise are right."""
        rest = self._rest(self.forward(parameters, self.test.times))
        return self.linear.independent(whitened(rest, self._links))

    def _rest(self, history: Mapping[str, Floats]) -> Floats:
        """Return measured less computed samples that count, in standard deviations."""
        rest = self._measured - self._scaled(history)
        return np.nan_to_num(rest, nan=1e3, posinf=1e3, neginf=1e3)

    def _without_lines(self, name: str) -> Floats:
        """Return a channel of the block less what its offset, drift and steps add."""
        return np.asarray(self.test.channels[name] - self._of_sensors[name])

    def nuisances(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return the most likely errors of the table's motion and sizes of `lines`.

        The second array has their standard deviations.
        """
        rest = self._rest(self.forward(parameters, self.test.times))
        return self.linear.most_likely(whitened(rest, self._links))

    def likely_motion(self, parameters: Floats) -> Floats:
        """Return the most likely errors of the table's motion, in standard deviations."""
        return self.nuisances(parameters)[0][: self.wrong.size]

    def _unexplained(self, parameters: Floats) -> list[Floats]:
        """Return what nothing explains of the samples of each channel, in standard deviations."""
        rest = self._rest(self.forward(parameters, self.test.times))
        sizes = self.linear.most_likely(whitened(rest, self._links))[0]
        return self._by_channel(rest - self._effects @ sizes)

    def misfits(self, parameters: Floats) -> list[float]:
        """Return the root mean square of what nothing explains of each channel."""
        rests = zip(self._unexplained(parameters), self._by_channel(self._scale), strict=True)
        return [float(np.sqrt(np.mean((rest / scale) ** 2))) for rest, scale in rests]

    def contradicting(self, parameters: Floats) -> dict[str, tuple[Floats, float]]:
        """Return the times of samples that noise cannot explain, and how far off the farthest is.

        The noise is measured by the median, so that these samples have no part in it.
        """
        rests = zip(self._unexplained(parameters), self._by_channel(self._scale), strict=True)
        beyond = {}
        for at, (rest, scale) in enumerate(rests):
            times = self.test.times[self._counted[at]]
            off = np.abs(rest / scale)
            noise = _OF_MEDIAN * float(np.median(off))
            contradicts = off > max(_NO_NOISE * noise, _NO_MISFIT * self.largest[at])
            if contradicts.any():
                beyond[self.channels[at]] = (times[contradicts], float(off.max()))
        return beyond

    def noise_seen(self, parameters: Floats) -> list[float]:
        """Return the noise of each channel that does not rest on the model.

        It is `sensor_noise`; or, if the residuals are noise of first order, their size.
        """
        rests = self._unexplained(parameters)
        links = self._by_channel(self._links)
        seen = []
        for at, (rest, link) in enumerate(zip(rests, links, strict=True)):
            coloured = self.colour[at] > 0.0 and is_first_order(whitened(rest, link))
            size = max(self.sensor_noise[at], self.noise[at] * coloured)
            seen.append(float(size if np.isnan(self._given_noise[at]) else self.sensor_noise[at]))
        return seen

    def cycle(
        self, begin: float, end: float, speed: float, parameters: Floats, table_errors: Floats
    ) -> Callable[[Floats], Floats]:
        """Return the independent residuals of the samples between two times, near `parameters`.

        The motion at the beginning is unknown, velocities of the order of `speed`; offset and drift
        of the table have the standard errors `table_errors`.
        """
        times = self.test.times
        rows = (self._counted & (times >= begin) & (times < end))[self._counted]
        still = np.full(times.size, speed)
        moved = speed * (times - begin)
        place = self._scaled({"relative_displacement": still})
        velocity = self._scaled({"relative_displacement": moved, "relative_velocity": still})

        def rest(parameters: Floats) -> Floats:
            return self._rest(self.forward(parameters, times))

        shifts = []
        for at, error in enumerate(table_errors, 3):
            shifted = parameters.copy()
            shifted[at] += _STEP * error
            shifts.append((rest(parameters) - rest(shifted)) / _STEP)
        effects = np.column_stack([self._effects, place, velocity, *shifts])
        linear = Linear(whitened(effects, self._links)[rows])
        return lambda parameters: linear.independent(whitened(rest(parameters), self._links)[rows])

    def settle(self, parameters: Floats, others: Sequence[Floats] = ()) -> float:
        """Estimate noise that is not given and its colour, and the table's motion.

        Return the largest change of a noise, in parts of it, or of a correlation.
        `others` are further parameters that may be right: samples beside jumps of the computed
        acceleration count as such for all.
        """
        leverage = self._by_channel(self.linear.left**2 @ self.linear.known)
        weights = self._by_channel(self._scale)
        rests = self._unexplained(parameters)
        links = self._by_channel(self._links)
        sizes = self.nuisances(parameters)[0]
        noise = self.noise.copy()
        colour = self.colour.copy()
        for at, (rest, part) in enumerate(zip(rests, leverage, strict=True)):
            weight = weights[at] * self.noise[at]
            freedom = float(np.sum(weight**2)) - float(np.sum(part)) - 1.0
            square = float(np.sum(whitened(rest, links[at]) ** 2))
            if np.isnan(self._given_noise[at]) and freedom > 0.0:
                self.noise[at] = max(
                    self.noise[at] * np.sqrt(square / freedom), self._least_noise[at]
                )
        self._estimate_colour(parameters)
        self.wrong = sizes[: self.wrong.size]
        self._widen_table_errors(parameters)
        self._of_sensors = {name: np.zeros(self.test.times.size) for name in self.channels}
        for line, size in zip(self.lines, sizes[self.wrong.size :], strict=True):
            self._of_sensors[line.channel] += size * line.values
        self.look_at_jumps([parameters, *others])
        return float(
            max(np.abs(self.noise / noise - 1.0).max(), np.abs(self.colour - colour).max())
        )

    def _estimate_colour(self, parameters: Floats) -> None:
        """Set the colour of the noise; of one that is the least a channel can have it is not seen."""
        rests = self._by_channel(self._rest(self.forward(parameters, self.test.times)))
        effects = self._by_channel(self._effects)
        for at, counted in enumerate(self._counted):
            if self.noise[at] > self._least_noise[at]:
                apart = distances(self.test.times[counted])
                self.colour[at] = colour_of(rests[at], effects[at], apart)

    def _widen_table_errors(self, parameters: Floats) -> None:
        """Multiply the errors of the table's motion by how much larger the block shows them to be.

        They are too small if the noise of the table's record is slower than it seems to be.
        """
        number = self.wrong.size
        rest = whitened(self._rest(self.forward(parameters, self.test.times)), self._links)
        values, deviations = self.linear.most_likely(rest)
        known = float(np.sum(1.0 - deviations[:number] ** 2))
        expected = known + _WIDER * (2.0 * known) ** 0.5
        if self.table_factor == 1.0 and np.sum(values[:number] ** 2) < expected:
            return
        effects = whitened(self._effects, self._links)
        of_sensors = np.linalg.qr(effects[:, number:])[0]
        of_table = effects[:, :number] - of_sensors @ (of_sensors.T @ effects[:, :number])
        left, sizes, _ = np.linalg.svd(of_table, full_matrices=False)
        squares = (left.T @ rest) ** 2
        # as first estimated, with noise that had not settled, they may be too large
        factors = _TIMES / self.table_factor
        variances = 1.0 + np.outer(factors**2, sizes**2)
        factor = factors[np.argmin(np.sum(np.log(variances) + squares / variances, axis=1))]
        self.table_factor *= float(factor)
        self.motion = self.motion._replace(errors=factor * self.motion.errors)
        self.wrong = self.wrong / factor

    def look_at_jumps(self, solutions: Sequence[Floats]) -> None:
        """Find the samples beside jumps of the block's acceleration, as computed for some parameters."""
        if "block_acceleration" in self.channels:
            row = self.channels.index("block_acceleration")
            beside = [self._next_to_jumps(each, self.noise[row]) for each in solutions]
            self._beside_jumps[row] = np.any(beside, axis=0)

    def _next_to_jumps(self, parameters: Floats, noise: float) -> NDArray[np.bool_]:
        """Return which samples are next to a jump of the block's computed acceleration."""
        times = self.test.times
        fine = np.interp(np.arange(0, times.size - 1, 0.125), np.arange(times.size), times)
        history = self._forward()(parameters, fine)
        block = history["block_acceleration"]
        table = history[TABLE]
        # either is smooth where the block holds its acceleration or sticks to the table
        change = np.minimum(np.abs(np.diff(block)), np.abs(np.diff(block - table)))
        least = max(noise, 0.02 * float(np.abs(table).max()))
        before = np.diff(times, prepend=2 * times[0] - times[1])
        after = np.append(before[1:], before[-1])
        beside = np.zeros(times.size, dtype=bool)
        for jump in fine[np.flatnonzero(change > least)]:
            beside |= (times > jump - _BESIDE_A_JUMP * after) & (
                times < jump + _BESIDE_A_JUMP * before
            )
        return beside

    def leave_out_upslope_slips(self, parameters: Floats) -> None:
        """Leave out the samples of slips upslope, after each of which the displacement may step."""
        times = self.test.times
        if "relative_velocity" in self.channels:
            velocity = self._without_lines("relative_velocity")
        elif "relative_displacement" in self.channels:
            velocity = np.gradient(self._without_lines("relative_displacement"), times)
        else:
            return
        off = np.abs(velocity - self.forward(parameters, times)["relative_velocity"])
        largest = float(np.nanmax(np.abs(velocity)))
        noise = max(noise_of(velocity), _OF_MEDIAN * float(np.nanmedian(off)), 2e-3 * largest)
        upslope = np.nan_to_num(velocity) < -_UPSLOPE_NOISE * noise
        several = ndimage.binary_opening(upslope, np.ones(_UPSLOPE_SAMPLES))
        slips = ndimage.binary_dilation(several, iterations=3)
        self._use = self._use & ~slips
        for slip in runs_of(slips):
            self.upslope.append(float(times[slip.start]))
            if "relative_displacement" in self.channels:
                displacement = self.test.channels["relative_displacement"]
                size = _LARGE * float(np.nanmax(np.abs(displacement)))
                name = f"upslope slip at {times[slip.start]:.4g} s"
                step = size * (times > times[slip.stop - 1])
                self.lines.append(Line(name, "relative_displacement", size, step))


def _weights_of(values: Floats) -> Floats:
    """Square roots of the samples' weights: readings of a level that repeats have one error and the weight of one."""
    repeated = np.diff(values) == 0.0
    runs = np.append(repeated, False) | np.append(False, repeated)
    weights = np.ones(values.size)
    _, level, counts = np.unique(values[runs], return_inverse=True, return_counts=True)
    weights[runs] = 1.0 / np.sqrt(counts[level])
    return weights


def runs_of(holds: NDArray[np.bool_]) -> list[slice]:
    """The runs of samples at which something holds."""
    return [part for (part,) in ndimage.find_objects(ndimage.label(holds)[0])]
