"""The likelihood of one test: measured less computed channels, with all errors that add to them.

Beside Üy, λ and Δμ stand nuisance parameters with known standard deviations: errors of the table's
motion (`table_motion`), offsets and drifts of sensors.  What is computed depends on them linearly,
near enough, so that they need no search.  Scaled residuals have the covariance 1 + E Eᵀ, where a
column of E is the effect of one standard deviation of an error; this makes them independent.
docs/calibration.md says which samples count less, and why the table's motion is a spline.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from slipsweep.studies.calibration.measured_friction import Floats
from slipsweep.studies.calibration.noise import (
    OF_MEDIAN,
    colour_of,
    distances,
    is_first_order,
    whitened,
)
from slipsweep.studies.calibration.observation import Observation

#: Combinations of errors with a smaller effect, in standard deviations, are left out.
_NO_EFFECT = 0.01

#: Errors of the table's motion are multiplied if their sum of squares exceeds the expected one by
#: more than so many standard deviations; and factors that are tried.
_WIDER = 3.0
_TIMES = np.geomspace(1.0, 20.0, 100)

#: Standard deviations of the noise, and parts of a channel's largest value, beyond which a sample
#: contradicts the solution.
_NO_NOISE = 7.0
_NO_MISFIT = 0.01

#: Step of the derivatives by errors of the table's motion, in standard deviations.
_STEP = 0.3


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
        self.determined = self.sizes**2 / (1.0 + self.sizes**2)
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
        spread = 1.0 - np.sum(self.right**2 * self.determined[:, None], axis=0)
        return np.asarray(values), np.sqrt(np.maximum(spread, 0.0))


class Likelihood:
    """The likelihood of a test, linear in the errors of the table's motion near one solution.

    The noise, its colour, the errors of the table's motion and the samples that count are those
    that the observation has when this is made.

    Attributes
    ----------
    forward
        The model's block on the table's motion.
    counted, scale, links
        Samples that count, one row for each channel; and for each of these one over its standard
        deviation, and the correlation of its noise with that of the sample before.
    effects
        Effects of one standard deviation of each error of the table's motion, then of each of the
        observation's `lines`, in standard deviations of the samples; one column for each.
    linear
        The same for independent residuals.
    """

    def __init__(self, observation: Observation, parameters: Floats, rough: float = 0.0) -> None:
        self.observation = observation
        self.forward = observation.forward()
        test = observation.test
        self.counted = observation.used & ~observation.beside_jumps
        noise = np.maximum(observation.noise, rough * observation.largest)
        self.scale = (observation.weights / noise[:, None])[self.counted]
        apart = [distances(test.times[counted]) for counted in self.counted]
        colours = [0.0 if rough else colour for colour in observation.colour]
        self.links = np.concatenate(
            [colour**gaps for colour, gaps in zip(colours, apart, strict=True)]
        )
        errors = observation.table_errors
        without_errors = self._scaled(self.forward(parameters, test.times))
        self.effects = np.zeros((without_errors.size, errors.size + len(observation.lines)))
        for at in range(errors.size if rough else 0, errors.size):
            moved = errors.copy()
            moved[at] += _STEP
            history = observation.forward(moved)(parameters, test.times)
            self.effects[:, at] = np.nan_to_num(self._scaled(history) - without_errors) / _STEP
        for at, line in enumerate(observation.lines, errors.size):
            self.effects[:, at] = self._scaled({line.channel: line.values})
        self._measured = self._scaled(test.channels) + self.effects[:, : errors.size] @ errors
        self.linear = Linear(whitened(self.effects, self.links))

    def _scaled(self, series: Mapping[str, Floats]) -> Floats:
        """Return the samples that count, channel by channel, in standard deviations.

        They are 0 of a channel that is not there.
        """
        none = np.zeros(self.observation.test.times.size)
        values = np.array([series.get(name, none) for name in self.observation.channels])
        weighted: Floats = values[self.counted] * self.scale
        return weighted

    def by_channel(self, values: Floats) -> list[Floats]:
        """Return values of samples that count (the first axis), an array for each channel."""
        return np.split(values, np.cumsum(self.counted.sum(axis=1))[:-1])

    def rest(self, parameters: Floats) -> Floats:
        """Return measured less computed samples that count, in standard deviations."""
        history = self.forward(parameters, self.observation.test.times)
        rest = self._measured - self._scaled(history)
        return np.nan_to_num(rest, nan=1e3, posinf=1e3, neginf=1e3)

    def residuals(self, parameters: Floats) -> Floats:
        """Return independent residuals of unit variance, if the model and the noise are right."""
        return self.linear.independent(whitened(self.rest(parameters), self.links))

    def nuisances(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return the most likely errors of the table's motion and sizes of the block's `lines`.

        The second array has their standard deviations.
        """
        return self.linear.most_likely(whitened(self.rest(parameters), self.links))

    def likely_motion(self, parameters: Floats) -> Floats:
        """Return the most likely errors of the table's motion, in standard deviations."""
        return self.nuisances(parameters)[0][: self.observation.table_errors.size]

    def unexplained(self, parameters: Floats) -> list[Floats]:
        """Return what nothing explains of the samples of each channel, in standard deviations."""
        rest = self.rest(parameters)
        sizes = self.linear.most_likely(whitened(rest, self.links))[0]
        return self.by_channel(rest - self.effects @ sizes)

    def misfits(self, parameters: Floats) -> list[float]:
        """Return the root mean square of what nothing explains of each channel."""
        rests = zip(self.unexplained(parameters), self.by_channel(self.scale), strict=True)
        return [float(np.sqrt(np.mean((rest / scale) ** 2))) for rest, scale in rests]

    def contradicting(self, parameters: Floats) -> dict[str, tuple[Floats, float]]:
        """Return the times of samples that noise cannot explain, and how far off the farthest is.

        The noise is measured by the median, so that these samples have no part in it.
        """
        rests = zip(self.unexplained(parameters), self.by_channel(self.scale), strict=True)
        beyond = {}
        for at, (rest, scale) in enumerate(rests):
            times = self.observation.test.times[self.counted[at]]
            off = np.abs(rest / scale)
            noise = OF_MEDIAN * float(np.median(off))
            contradicts = off > max(_NO_NOISE * noise, _NO_MISFIT * self.observation.largest[at])
            if contradicts.any():
                beyond[self.observation.channels[at]] = times[contradicts], float(off.max())
        return beyond

    def noise_seen(self, parameters: Floats) -> list[float]:
        """Return the noise of each channel that does not rest on the model.

        It is `sensor_noise`; or, if the residuals are noise of first order, their size.
        """
        observation = self.observation
        rests = self.unexplained(parameters)
        links = self.by_channel(self.links)
        seen = []
        for at, (rest, link) in enumerate(zip(rests, links, strict=True)):
            coloured = observation.colour[at] > 0.0 and is_first_order(whitened(rest, link))
            size = max(observation.sensor_noise[at], observation.noise[at] * coloured)
            is_estimated = np.isnan(observation.stated_noise[at])
            seen.append(float(size if is_estimated else observation.sensor_noise[at]))
        return seen

    def cycle(
        self, begin: float, end: float, speed: float, parameters: Floats, table_errors: Floats
    ) -> Callable[[Floats], Floats]:
        """Return the independent residuals of the samples between two times, near `parameters`.

        The motion at the beginning is unknown, velocities of the order of `speed`; offset and drift
        of the table have the standard errors `table_errors`.
        """
        times = self.observation.test.times
        rows = (self.counted & (times >= begin) & (times < end))[self.counted]
        still = np.full(times.size, speed)
        moved = speed * (times - begin)
        place = self._scaled({"relative_displacement": still})
        velocity = self._scaled({"relative_displacement": moved, "relative_velocity": still})
        shifts = []
        for at, error in enumerate(table_errors, 3):
            shifted = parameters.copy()
            shifted[at] += _STEP * error
            shifts.append((self.rest(parameters) - self.rest(shifted)) / _STEP)
        effects = np.column_stack([self.effects, place, velocity, *shifts])
        linear = Linear(whitened(effects, self.links)[rows])
        return lambda parameters: linear.independent(
            whitened(self.rest(parameters), self.links)[rows]
        )

    def settle(self, parameters: Floats, others: Sequence[Floats] = ()) -> float:
        """Set the observation's noise that is not given, its colour, and the table's motion.

        Return the largest change of a noise, in parts of it, or of a correlation.
        `others` are further parameters that may be right: samples beside jumps of the computed
        acceleration count as such for all.
        """
        observation = self.observation
        leverage = self.by_channel(self.linear.left**2 @ self.linear.determined)
        weights = self.by_channel(self.scale)
        rests = self.unexplained(parameters)
        links = self.by_channel(self.links)
        sizes = self.nuisances(parameters)[0]
        noise = observation.noise.copy()
        colour = observation.colour.copy()
        for at, (rest, part) in enumerate(zip(rests, leverage, strict=True)):
            weight = weights[at] * observation.noise[at]
            freedom = float(np.sum(weight**2)) - float(np.sum(part)) - 1.0
            square = float(np.sum(whitened(rest, links[at]) ** 2))
            if np.isnan(observation.stated_noise[at]) and freedom > 0.0:
                observation.noise[at] = max(
                    observation.noise[at] * np.sqrt(square / freedom), observation.least_noise[at]
                )
        self._estimate_colour(parameters)
        observation.table_errors = sizes[: observation.table_errors.size]
        self._widen_table_errors(parameters)
        observation.added_by_lines = {
            name: np.zeros(observation.test.times.size) for name in observation.channels
        }
        for line, size in zip(
            observation.lines, sizes[observation.table_errors.size :], strict=True
        ):
            observation.added_by_lines[line.channel] += size * line.values
        observation.look_at_jumps([parameters, *others])
        return float(
            max(
                np.abs(observation.noise / noise - 1.0).max(),
                np.abs(observation.colour - colour).max(),
            )
        )

    def _estimate_colour(self, parameters: Floats) -> None:
        """Set the colour of the noise; it cannot be seen in the least noise a channel can have."""
        observation = self.observation
        rests = self.by_channel(self.rest(parameters))
        effects = self.by_channel(self.effects)
        for at, counted in enumerate(self.counted):
            if observation.noise[at] > observation.least_noise[at]:
                apart = distances(observation.test.times[counted])
                observation.colour[at] = colour_of(rests[at], effects[at], apart)

    def _widen_table_errors(self, parameters: Floats) -> None:
        """Multiply the errors of the table's motion by how much larger the block shows them to be.

        They are too small if the noise of the table's record is slower than it seems to be.
        """
        observation = self.observation
        number = observation.table_errors.size
        rest = whitened(self.rest(parameters), self.links)
        values, deviations = self.linear.most_likely(rest)
        determined = float(np.sum(1.0 - deviations[:number] ** 2))
        expected = determined + _WIDER * (2.0 * determined) ** 0.5
        if observation.table_factor == 1.0 and np.sum(values[:number] ** 2) < expected:
            return
        effects = whitened(self.effects, self.links)
        of_sensors = np.linalg.qr(effects[:, number:])[0]
        of_table = effects[:, :number] - of_sensors @ (of_sensors.T @ effects[:, :number])
        left, sizes, _ = np.linalg.svd(of_table, full_matrices=False)
        squares = (left.T @ rest) ** 2
        # they may be too large if they were first estimated before the noise had settled
        factors = _TIMES / observation.table_factor
        variances = 1.0 + np.outer(factors**2, sizes**2)
        factor = factors[np.argmin(np.sum(np.log(variances) + squares / variances, axis=1))]
        observation.table_factor *= float(factor)
        observation.motion = observation.motion._replace(errors=factor * observation.motion.errors)
        observation.table_errors = observation.table_errors / factor
