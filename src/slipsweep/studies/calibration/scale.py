"""Scaled parameters of the search, and the readings of the model that they stand for."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from slipsweep.model import equations
from slipsweep.studies.calibration.measured_friction import Floats
from slipsweep.studies.calibration.observation import Observation

#: Bounds of the search: Üy over the table's peak A, λA/g, ln(1 + Δμ/μs).
LEAST = np.array([1e-4, 0.0, 0.0])
MOST = np.array([1.0, 20.0, 3.0])

#: Largest distance of an offset of the table's sensor, and of its drift over the test, from where
#: the search begins, in parts of A.
_TABLE_LINE = 0.5

#: Accelerations of the table in a pulse, in parts of its peak, by which `Scale.reading` decides.
_TO_PEAK = np.linspace(0.0, 1.0, 65)[1:]


class Scale:
    """Conversion between points of the search and parameters of a test.

    A point has Üy over the largest peak A of the tests' tables, λA/g and ln(1 + Δμ/μs), and then,
    for each test that has them, the offset and the drift of the table's sensor in parts of A.
    """

    def __init__(self, observations: Sequence[Observation]) -> None:
        first_sizes = [observation.first_sizes for observation in observations]
        self.peak = max(observation.peak for observation in observations)
        self.mu_s = observations[0].mu_s
        self.g = observations[0].model.g
        self.tan_theta = math.tan(math.radians(observations[0].theta))
        self.first_lines = np.concatenate(first_sizes) / self.peak
        self.least = np.append(LEAST, self.first_lines - _TABLE_LINE)
        self.most = np.append(MOST, self.first_lines + _TABLE_LINE)
        ends = np.cumsum([3, *(sizes.size for sizes in first_sizes)])
        self._lines = [slice(begin, end) for begin, end in itertools.pairwise(ends)]

    def point(self, onset: float, decay: float, excess: float) -> Floats:
        """Return a point with offset and drift of the table where the search begins."""
        return np.asarray(np.clip([onset, decay, excess, *self.first_lines], self.least, self.most))

    def parameters(self, point: Floats) -> Floats:
        """Return Üy, λ and Δμ."""
        return np.array(
            [point[0] * self.peak, point[1] * self.g / self.peak, self.mu_s * math.expm1(point[2])]
        )

    def lines(self, number: int) -> slice:
        """Return which parts of a point are offset and drift of the table in a test."""
        return self._lines[number]

    def of_test(self, point: Floats, number: int) -> Floats:
        """Return Üy, λ and Δμ, and offset and drift of the table in a test."""
        return np.append(self.parameters(point), self.peak * point[self._lines[number]])

    def slopes(self, point: Floats) -> Floats:
        """Return the derivatives of all parameters by those of the point."""
        first = [self.peak, self.g / self.peak, self.mu_s * math.exp(point[2])]
        return np.append(first, np.full(self.first_lines.size, self.peak))

    def reading(self, point: Floats, peak: float) -> str:
        """Return what decides the block's acceleration in a test whose table has this peak.

        ============  ==============================================================================
        "continuous"  Eq. 4 throughout
        "all"         first Üy, later Eq. 4
        "crossing"    Eq. 4, from where it crosses the table's acceleration; Üy does not act
        "held"        Üy throughout
        "crossed"     one value throughout, that of Eq. 4 where it crosses
        ============  ==============================================================================
        """
        yield_acceleration = point[0] * self.peak
        limit = equations.limiting_acceleration(
            yield_acceleration, self.mu_s, self.tan_theta, self.g
        )
        if peak > limit:
            return "continuous"
        table = _TO_PEAK * peak
        response = self._block_acceleration(table, decay=point[1], excess=point[2])
        above = table > yield_acceleration
        slides = above & (response < table)
        first = int(np.argmax(slides))
        crosses = bool(above[:first].any()) or not slides.any()
        if not slides.any() or float(response[first:].max()) <= max(
            yield_acceleration, float(response[first])
        ):
            return "crossed" if crosses else "held"
        return "crossing" if crosses else "all"

    def _block_acceleration(self, table: Any, decay: float, excess: float) -> Floats:
        """Return Eq. 4 with the friction of Eq. 6, for positive accelerations of the table, m/s².

        Eq. 6 stands here for arrays: `equations.friction_coefficient` takes one number, and its
        exponential is compiled anew in each process that calls it from Python.
        """
        friction: Any = self.mu_s * np.exp(excess - decay * table / self.peak)
        return np.asarray(table - equations.lag(table, friction, self.mu_s, self.tan_theta, self.g))

    def excess(self, table: float, block: float, decay: float) -> float:
        """Return ln(1 + Δμ/μs) with which Eq. 4 gives the block's acceleration for the table's.

        Both are in parts of the peak.  The friction is that of Eq. 1.
        """
        friction = equations.mobilised_friction(
            table * self.peak, block * self.peak, self.mu_s, self.tan_theta, self.g
        )
        return math.log(max(friction, 1e-3) / self.mu_s) + decay * table
