"""One test as it was measured: its channels, the noise of its sensors, the motion of its table.

An observation also holds what the fit has estimated of these so far (`likelihood`): the noise and
its colour, the errors of the table's motion, and the samples that are left out because they lie
beside jumps or in a slip upslope.
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
from slipsweep.studies.calibration.measured_friction import Floats, check_contact, noise_of
from slipsweep.studies.calibration.noise import LEAST_NOISE, OF_MEDIAN, converter_noise
from slipsweep.studies.calibration.shaking_test import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies.calibration.table_motion import table_motion

#: Function of Üy, λ, Δμ and times that returns the series of `HISTORY`.
Forward = Callable[[Floats, Floats], Mapping[str, Floats]]

#: Parameters that are estimated, in the order of all vectors.
SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")

#: Standard deviation of an offset, drift or step, in parts of a channel's largest value: so large
#: that it sets no bound.
_LARGE = 3.0

#: Fewest samples at rest that show the noise of a sensor.
_AT_REST = 20

#: Samples nearer to a jump than so many intervals of sampling are left out.
_BESIDE_A_JUMP = 1.6

#: A block slips upslope where so many consecutive samples of its velocity lie below zero by more
#: than so many standard deviations of the noise.
_UPSLOPE_SAMPLES = 4
_UPSLOPE_NOISE = 5.0


class Line(NamedTuple):
    """An offset, a drift or a step of a channel's sensor.

    `deviation` is its standard deviation, and `values` what that adds to the samples.
    """

    name: str
    channel: str
    deviation: float
    values: Floats


class Observation:
    """A test, checked, with what is known of its sensors and what the fit has estimated of them.

    Functions that take `parameters` take Üy, λ, Δμ and then the sizes of `table_lines`: an offset
    and a drift of the table's sensor.  These two are searched with the parameters, because the
    motion of the block does not depend on them linearly.

    Attributes
    ----------
    channels
        Channels of the block that were measured.
    sensor_noise, noise, colour
        Of each channel: the noise by neighbouring samples or by samples at rest, or as given by the
        caller; the noise that the fit estimates; the correlation of neighbouring residuals.
    drifts
        Channels that may drift.
    lines, table_lines
        Offsets, drifts and steps of the block's channels, and those of the table's sensor.
    motion, table_errors, table_factor
        The table's motion; its most likely errors so far, in standard deviations; and how many
        times as large as the noise of its record these errors are taken to be.
    upslope
        Times (s) at which slips upslope begin, whose samples are left out.
    used, beside_jumps
        Samples, one row for each channel, that were measured and are not left out, and those next
        to jumps of the computed acceleration.
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
                f"{test.name}: nothing of the block was measured: must have one at least of "
                f"{', '.join(RESPONSES)}"
            )
        check_channels("noise", list(noise), test.responses)
        check_contact(test, theta, model.g)
        if not float(test.channels[TABLE].max()) > 0.0:
            raise InputError(
                f"{test.name}: {TABLE}: never positive: the table does not drive the block "
                "downslope"
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
        self.used = np.isfinite(measured) & (np.arange(test.times.size) < test.times.size - 1)
        self.beside_jumps = np.zeros_like(self.used)
        self.weights = np.array([_weights_of(values) for values in measured])
        self.largest = np.nanmax(np.abs(measured), axis=1)
        converters = [max(converter_noise(values), 1e-15) for values in measured]
        self.least_noise = np.maximum(LEAST_NOISE * self.largest, converters)
        self.stated_noise = np.array([noise.get(name, np.nan) for name in self.channels])
        scatter = np.maximum([noise_of(values) for values in measured], self.least_noise)
        self.motion = table_motion(test.times, test.channels[TABLE])
        self.noise = np.where(np.isnan(self.stated_noise), scatter, self.stated_noise)
        at_rest = measured[:, test.times < self.motion.begins]
        if at_rest.shape[1] >= _AT_REST:  # slow noise is not seen in neighbouring samples
            scatter = np.fmax(scatter, np.nanstd(at_rest, axis=1))
        self.sensor_noise = np.where(np.isnan(self.stated_noise), scatter, self.stated_noise)
        self.colour = np.zeros(len(self.channels))
        lines = _lines_of(test, offsets, self.drifts)
        self.lines = [line for line in lines if line.channel != TABLE]
        self.table_lines = [line for line in lines if line.channel == TABLE]
        columns = [
            np.interp(self.motion.times, test.times, line.values) for line in self.table_lines
        ]
        self._table_lines = np.reshape(columns, (len(columns), self.motion.times.size)).T
        # of a table that begins and ends at rest the mean acceleration is 0
        mean = float(np.mean(test.channels[TABLE]))
        self.first_sizes = np.array([mean, 0.0])[: len(self.table_lines)]
        self.table_errors = np.zeros(self.motion.errors.shape[1])
        self.table_factor = 1.0
        self.added_by_lines = {name: np.zeros(test.times.size) for name in self.channels}
        self.peak = self.peak_of(self.first_sizes)
        self.upslope: list[float] = []

    def table_acceleration(self, sizes: Floats) -> Floats:
        """Return the table's acceleration at the points of `motion`.

        It is less offset and drift of these sizes.
        """
        return np.asarray(self.motion.with_errors(self.table_errors) - self._table_lines @ sizes)

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

    def forward(self, table_errors: Floats | None = None) -> Forward:
        """Return the model's block on the table's motion.

        `table_errors` are the errors of that motion, in standard deviations; by default the most
        likely ones so far.
        """
        errors = self.table_errors if table_errors is None else table_errors
        motion = self.motion.with_errors(errors)

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

    def without_lines(self, name: str) -> Floats:
        """Return a channel of the block less what its offset, drift and steps add."""
        return np.asarray(self.test.channels[name] - self.added_by_lines[name])

    def look_at_jumps(self, solutions: Sequence[Floats]) -> None:
        """Find the samples beside jumps of the block's acceleration in computed solutions."""
        if "block_acceleration" in self.channels:
            row = self.channels.index("block_acceleration")
            beside = [self._next_to_jumps(each, self.noise[row]) for each in solutions]
            self.beside_jumps[row] = np.any(beside, axis=0)

    def _next_to_jumps(self, parameters: Floats, noise: float) -> NDArray[np.bool_]:
        """Return which samples are next to a jump of the block's computed acceleration."""
        times = self.test.times
        fine = np.interp(np.arange(0, times.size - 1, 0.125), np.arange(times.size), times)
        history = self.forward()(parameters, fine)
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
            velocity = self.without_lines("relative_velocity")
        elif "relative_displacement" in self.channels:
            velocity = np.gradient(self.without_lines("relative_displacement"), times)
        else:
            return
        off = np.abs(velocity - self.forward()(parameters, times)["relative_velocity"])
        largest = float(np.nanmax(np.abs(velocity)))
        noise = max(noise_of(velocity), OF_MEDIAN * float(np.nanmedian(off)), 2e-3 * largest)
        upslope = np.nan_to_num(velocity) < -_UPSLOPE_NOISE * noise
        several = ndimage.binary_opening(upslope, np.ones(_UPSLOPE_SAMPLES))
        slips = ndimage.binary_dilation(several, iterations=3)
        self.used = self.used & ~slips
        for slip in runs_of(slips):
            self.upslope.append(float(times[slip.start]))
            if "relative_displacement" in self.channels:
                displacement = self.test.channels["relative_displacement"]
                size = _LARGE * float(np.nanmax(np.abs(displacement)))
                name = f"upslope slip at {times[slip.start]:.4g} s"
                step = size * (times > times[slip.stop - 1])
                self.lines.append(Line(name, "relative_displacement", size, step))


def _lines_of(test: ShakingTest, offsets: Sequence[str], drifts: Sequence[str]) -> list[Line]:
    """Return offsets and drifts of channels; a channel that drifts has an offset, too."""
    lines = []
    since = (test.times - test.times[0]) / (test.times[-1] - test.times[0])
    for name, values in test.channels.items():
        size = 1.0 if name == TABLE else _LARGE * float(np.nanmax(np.abs(values)))
        if name in offsets or name in drifts:
            lines.append(Line("offset", name, size, np.full(since.size, size)))
        if name in drifts:
            lines.append(Line("drift", name, size, size * since))
    return lines


def _weights_of(values: Floats) -> Floats:
    """Return square roots of the samples' weights.

    Samples that repeat a level of the converter have one error, and together the weight of one.
    """
    repeated = np.diff(values) == 0.0
    runs = np.append(repeated, False) | np.append(False, repeated)
    weights = np.ones(values.size)
    _, level, counts = np.unique(values[runs], return_inverse=True, return_counts=True)
    weights[runs] = 1.0 / np.sqrt(counts[level])
    return weights


def runs_of(holds: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of samples at which `holds` is True."""
    return [part for (part,) in ndimage.find_objects(ndimage.label(holds)[0])]
