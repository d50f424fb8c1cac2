"""Waveforms and records cut into the pieces that the solvers follow (`pieces.Wave`).

The shaking is cut where w jumps, bends, turns and passes 0, so that w is monotone, smooth and of
one sign on each piece (and further where a smooth one would be too long for its polynomial).  From
the end of a piece to the beginning of the next w may jump; before the first piece and after the
last the base is at rest.
"""

import bisect
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.motion.intensity import spacing_of
from slipsweep.motion.paths import TERMS, Path, path_of
from slipsweep.motion.pieces import Wave, pieces_of, wave_of_pieces
from slipsweep.motion.records import Record
from slipsweep.motion.samples import Samples, samples_of
from slipsweep.motion.waveforms import Harmonics, Waveform

#: Longest piece of a smooth wave, in radians of its fastest harmonic: the first term of its Taylor
#: series that is left out is 1.3e-18 (docs/numerics.md#pieces-of-a-wave).
_LONGEST = 0.5 * math.pi

#: Distance below which two points of a cycle are one, as a part of the cycle, and difference below
#: which two values of w are one.
_SAME = 1e-12
_ROUNDING = 1e-15

#: Intervals that are searched in each period of the fastest harmonic, and the order of the highest
#: derivative whose zeros divide them.
_INTERVALS = 12
_HIGHEST = 4

# 80-bit numbers where the machine has them: then the last digit of the coefficients is right
_Extended = np.longdouble
_TWO_PI = _Extended("6.283185307179586476925286766559005768")

Exact = NDArray[Any]
Derivative = Callable[[Exact, int], Exact]


@functools.lru_cache
def _period(waveform: Waveform) -> tuple[Sequence[float], Sequence[Derivative], int, bool]:
    """Return a cycle without ramps: its breaks, derivatives, fastest multiple, and if it is a sine.

    Breaks are parts of the cycle.  There is a function for the derivatives of w behind each break,
    by phase in radians.  The multiple of the fastest harmonic is 0 where w is straight.  The pieces
    of a sine, of any phase, have closed forms.
    """
    quarters = (0.0, 0.25, 0.5, 0.75, 1.0)
    if waveform.name == "triangle":
        return quarters, [*map(_line, quarters, (0, 1, 0, -1), (4, -4, -4, 4))], 0, False
    if waveform.name == "square":
        return (0.0, 0.5, 1.0), [_line(0.0, 1.0, 0.0), _line(0.5, -1.0, 0.0)], 0, False
    if not isinstance(waveform, Harmonics):
        return (
            quarters,
            [_sum_of_sines([1.0], [1], [{"sine": 0.0, "cosine": 90.0}[waveform.name]])] * 4,
            1,
            True,
        )
    assert waveform.phases is not None
    fastest = max(waveform.multiples)
    wave = _sum_of_sines(waveform.amplitudes, waveform.multiples, waveform.phases)
    turns, *_ = _sign_changes(wave, 1, _edges(0.0, 1.0, fastest))
    peak = np.abs(wave(np.array([0.0, *turns]), 0)).max()
    present = [m for a, m in zip(waveform.amplitudes, waveform.multiples, strict=True) if a]
    return (0.0, 1.0), [lambda u, order: wave(u, order) / peak], fastest, present == [1]


def _line(start: float, first: float, slope: float) -> Derivative:
    """Return a straight line that starts at a place; its slope is by cycle."""
    line = np.polynomial.Polynomial(np.array([first, slope], _Extended))
    return lambda u, order: (
        line.deriv(max(order, 0))(u - _Extended(start)) / _TWO_PI ** max(order, 0)
    )


def _sum_of_sines(
    amplitudes: Sequence[float], multiples: Sequence[int], phases: Sequence[float]
) -> Derivative:
    """Return Σ aₖ sin(mₖφ + pₖ), divided by the largest aₖ."""
    a, m, p = (
        np.array(column, _Extended)[:, np.newaxis] for column in (amplitudes, multiples, phases)
    )
    a /= np.abs(a).max()

    def derivative(u: Exact, order: int) -> Exact:
        turns = m * np.asarray(u, _Extended) + p / 360 + _Extended(order) / 4
        halves = np.rint(2 * turns)  # sin 2πt is exact at every quarter
        sines = (1 - 2 * np.mod(halves, 2)) * np.sin((turns - halves / 2) * _TWO_PI)
        return np.asarray((a * m**order * sines).sum(axis=0))

    return derivative


def _edges(low: float, high: float, fastest: int) -> Exact:
    """Return the edges of the intervals to search; no simple wave has a zero at the inner ones."""
    count = max(2, math.ceil(_INTERVALS * max(fastest, 1) * (high - low)))
    return np.concatenate(
        [[low], low + (high - low) * (np.arange(count) + 0.381966) / count, [high]]
    )


def _sign_changes(derivative: Derivative, lowest: int, edges: Exact) -> list[Exact]:
    """Return the places at which derivatives change sign, for each order from the lowest on.

    The highest order is searched first.  Between two sign changes of the next derivative this one
    is monotone, so that it has one zero at most; its bracket is then narrowed by Newton's
    iteration, guarded as in `kernels.roots`.
    """
    zeros_by_order: list[Exact] = []
    for order in range(_HIGHEST, lowest - 1, -1):
        below = derivative(edges, order) < 0
        at = np.flatnonzero(below[:-1] != below[1:])
        low = edges[at]
        high = edges[at + 1]
        zero = 0.5 * (low + high)
        last = high - low
        before = high - low
        while (moves := last > np.finfo(float).eps).any():
            value, slope = (derivative(zero, n).astype(float) for n in (order, order + 1))
            same = (value < 0) == below[at]
            low = np.where(same, zero, low)
            high = np.where(same, high, zero)
            new = zero - np.divide(
                value, 2.0 * math.pi * slope, out=np.full_like(value, np.inf), where=slope != 0
            )
            safe = (low <= new) & (new <= high) & (2 * np.abs(new - zero) <= before)
            new = np.where(safe, new, 0.5 * (low + high))
            before = last
            last = moves * np.abs(new - zero)
            zero = np.where(moves, new, zero)
        zeros_by_order.insert(0, zero)
        edges = np.sort(np.concatenate([edges, zero]))
    return zeros_by_order


def _pieces(waveform: Waveform, n: int) -> tuple[Exact, ...]:
    """Return the pieces of cycle n, as `_monotone_pieces` does."""
    breaks, derivatives, fastest, _ = _period(waveform.plain)
    rise = _Extended(waveform.ramp_in)
    fall = _Extended(waveform.ramp_out)
    left = waveform.cycles - n
    places = [*breaks]
    for place in (float(rise - n), float(left - fall)):
        if 0.0 < place < 1.0 and min(abs(place - other) for other in places) > _SAME:
            places.append(place)
    rows = []
    for low, high in itertools.pairwise(sorted(places)):
        wave = derivatives[bisect.bisect(breaks, low) - 1]
        if n + 0.5 * (low + high) < rise:
            wave = _ramped(wave, low, (n + _Extended(low)) / rise, 1 / (rise * _TWO_PI))
        elif left - 0.5 * (low + high) < fall:
            wave = _ramped(wave, low, (left - _Extended(low)) / fall, -1 / (fall * _TWO_PI))
        rows.append(_monotone_pieces(wave, fastest, low, high))
    return tuple(map(np.concatenate, zip(*rows, strict=True)))


def _ramped(plain: Derivative, low: float, scale: Any, rate: Any) -> Derivative:
    """Return a wave times its ramp, a line with the value `scale` at `low` and the slope `rate`."""
    return lambda u, order: (
        (scale + rate * (u - _Extended(low)) * _TWO_PI) * plain(u, order)
        + order * rate * plain(u, order - 1)
    )


def _monotone_pieces(
    derivative: Derivative, fastest: int, low: float, high: float
) -> tuple[Exact, ...]:
    """Return the pieces between two places of a smooth wave.

    They are arrays of start and end, in cycles, of first and last value, and of coefficients.
    """
    zeros, turns, *_ = _sign_changes(derivative, 0, _edges(low, high, fastest))
    points = [low]
    for b in [*sorted(u for u in (*zeros, *turns) if u - low > _SAME and high - u > _SAME), high]:
        a = points[-1]
        if b - a > _SAME:
            parts = max(1, math.ceil(fastest * (b - a) * 2.0 * math.pi / _LONGEST - 1e-9))
            points += [a + (b - a) * part / parts for part in range(1, parts)] + [b]

    places = np.array(points)
    series = np.array(
        [derivative(places, order) / math.factorial(order) for order in range(TERMS + 1)]
    )
    for row, exact in zip(series, (zeros, turns), strict=False):
        row[(np.abs(places[:, np.newaxis] - exact) <= _SAME).any(axis=1)] = 0
    values = series[0].astype(np.float64)
    values[np.abs(values) < _ROUNDING] = 0.0
    at_end = np.abs(values[1:]) > np.abs(values[:-1])
    coefficients = np.where(at_end, series[1:, 1:], series[1:, :-1]).T.astype(np.float64)
    return places[:-1], places[1:], values[:-1], values[1:], coefficients


@functools.lru_cache(maxsize=32)
def wave_of(waveform: Waveform) -> Wave:
    """Return the table of pieces of a waveform."""
    cycles = waveform.cycles
    (*_, is_sine) = _period(waveform.plain)
    _, _, first, last, _ = plain = _pieces(waveform.plain, 0)
    wraps = int(first[0] > 0.0 and last[-1] > 0.0)
    # an interval that runs over from one cycle to the next makes the first cycle differ from the
    # others
    lead = min(math.ceil(waveform.ramp_in) + wraps, cycles)
    # the last plain cycle stands apart, as another does not follow; where intervals run over, so
    # does the one before
    tail = min(math.ceil(waveform.ramp_out) + 1 + wraps, cycles - lead)
    repeats = cycles - lead - tail
    numbers = [*range(lead), *([lead] if repeats else []), *range(cycles - tail, cycles)]
    ramped = [n < waveform.ramp_in or n + 1 > cycles - waveform.ramp_out for n in numbers]
    rows = [
        _pieces(waveform, n) if is_ramped else plain
        for n, is_ramped in zip(numbers, ramped, strict=True)
    ]

    counts = [len(row[0]) for row in rows]
    start, end, first, last, coefficients = map(np.concatenate, zip(*rows, strict=True))
    before = np.concatenate([[0.0], last[:-1]])
    cycle = 2.0 * math.pi * np.repeat(np.arange(len(rows)), counts)
    table = pieces_of(
        start=cycle + 2.0 * math.pi * start,
        end=cycle + 2.0 * math.pi * end,
        length=2.0 * math.pi * (end - start),
        # a difference by rounding between two cycles is no jump
        first=np.where(np.abs(first - before) < _ROUNDING, before, first),
        last=last,
        coefficients=coefficients,
        arc=np.repeat([is_sine and not is_ramped for is_ramped in ramped], counts),
    )
    shape = [1 + n if is_ramped else 0 for n, is_ramped in enumerate(ramped)]
    return wave_of_pieces(table, np.cumsum([0, *counts]), shape, lead, repeats)


@functools.lru_cache(maxsize=32)
def path_of_waveform(waveform: Waveform) -> Path:
    """Return the path of a waveform."""
    return path_of(wave_of(waveform), recorded=False)


#: Tables of pieces that are kept, and approximate bytes of a sample in a table and its path: a line
#: through zero is two pieces.
MOST_TABLES = 16
TABLE_BYTES = 280


@functools.lru_cache(maxsize=MOST_TABLES)
def wave_of_record(record: Record, polarity: float) -> Wave:
    """Return the table of pieces of a record, which are straight lines.

    w is in m/s², and time stands in place of the phase.
    """
    times = record.times
    values = polarity * record.acceleration
    spacing = spacing_of(times)
    change = np.diff(values)
    crosses = values[:-1] * np.sign(values[1:]) < 0.0
    interval = np.repeat(np.arange(spacing.size), 1 + crosses)  # a line through zero is two pieces
    after = np.concatenate([[False], interval[1:] == interval[:-1]])
    before = crosses[interval] & ~after
    first = np.where(after, 0.0, values[interval])
    last = np.where(before, 0.0, values[interval + 1])
    part = np.divide(
        last - first, change[interval], out=np.ones(interval.size), where=crosses[interval]
    )
    length = spacing[interval] * np.abs(part)
    pieces = pieces_of(
        start=np.where(after, times[interval + 1] - length, times[interval]),
        end=np.where(before, times[interval] + length, times[interval + 1]),
        length=length,
        first=first,
        last=last,
        coefficients=np.where(first == last, 0.0, (change / spacing)[interval])[:, np.newaxis],
    )
    return wave_of_pieces(pieces, cycle=[0, interval.size], shape=[0])


@functools.lru_cache(maxsize=MOST_TABLES)
def path_of_record(record: Record, polarity: float) -> Path:
    """Return the path of a record: w in m/s², and time in place of the phase."""
    return path_of(wave_of_record.__wrapped__(record, polarity), recorded=True)


@functools.lru_cache(maxsize=MOST_TABLES)
def samples_of_record(record: Record, polarity: float) -> Samples:
    """Return the samples of a record as the kernel of Newmark's block takes them."""
    return samples_of(record.times, polarity * record.acceleration)
