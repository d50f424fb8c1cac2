"""Waveforms: what they are, their exact peaks, and the pieces they are cut into."""

import itertools
from dataclasses import replace
from math import pi

import gmpy2
import numpy as np
import pytest
from gmpy2 import mpfr

from slipsweep import Cosine, Cycle, Harmonics, Sine, Square, Step, Triangle, sweep
from slipsweep.motion.cutting import wave_of
from slipsweep.motion.waveforms import Waveform
from tests.support import sections
from tests.support.digits import workdps

CYCLES = 4
RICH = Harmonics([1.0, 0.6, 0.35, 0.2], [1, 2, 5, 50], [0.0, 40.0, 100.0, 7.0], cycles=CYCLES)
EVERY: dict[str, Waveform] = {
    "sine": Sine(CYCLES),
    "cosine": Cosine(CYCLES),
    "triangle": Triangle(CYCLES),
    "square": Square(CYCLES),
    "harmonics": RICH,
    "ramped harmonics": replace(RICH, ramp_in=1.3, ramp_out=0.4),
    "ramped cosine": Cosine(CYCLES, ramp_in=0.25, ramp_out=2.0),
    "ramped triangle": Triangle(CYCLES, ramp_in=1.5, ramp_out=1.25),
    "ramped square": Square(CYCLES, ramp_in=1.5, ramp_out=1.25),
}
each = pytest.mark.parametrize("name", EVERY)


def exact(waveform: Waveform, phase: np.ndarray) -> np.ndarray:
    """w in multiple precision, by the reference's own sections of a cycle."""
    terms = ""
    if isinstance(waveform, Harmonics) and waveform.phases:
        columns = zip(waveform.amplitudes, waveform.multiples, waveform.phases, strict=True)
        terms = ",".join(f"{a!r}:{m}:{p!r}" for a, m, p in columns)
    reference = sections.Waveform(
        waveform.name, terms, waveform.cycles, waveform.ramp_in, waveform.ramp_out
    )
    with workdps(30):
        numbers = (phase // (2 * pi)).astype(int).tolist()
        values = []
        cycles = {n: list(reference.sections(n, mpfr(1))) for n in {*numbers}}
        for n, phi in zip(numbers, phase.tolist(), strict=True):
            in_cycle = phi - 2 * gmpy2.const_pi() * n
            values.append(
                float(
                    next(section for section in cycles[n] if in_cycle <= section.end).ground(
                        in_cycle
                    )
                )
            )
    return np.array(values)


@each
def test_pieces_are_the_wave(name: str) -> None:
    """To 1e-14 and the rounding of mφ, monotone and of one sign; harmonics up to the fiftieth."""
    waveform = EVERY[name]
    wave = wave_of(waveform)
    fastest = max(waveform.multiples) if isinstance(waveform, Harmonics) else 1
    for p, piece in enumerate(wave.pieces):
        tau = piece.begin + np.linspace(0.01, 0.99, 23) * (piece.finish - piece.begin)
        phase = piece.start + (tau - piece.begin)
        if wave.repeats and p >= wave.cycle[wave.lead + 1]:
            phase += 2 * pi * (wave.repeats - 1)  # the table has the plain cycle once
        values = np.polyval([*piece.coefficients[: piece.degree][::-1], piece.top], tau)
        error = np.abs(values - exact(waveform, phase)).max()
        assert error < 1e-14 + 4e-16 * fastest * 8 * pi, f"piece {p}: off by {error:.1e}"
        assert np.all(np.diff(values) * (piece.last - piece.first) >= 0), f"piece {p}: not monotone"
        assert np.all(values * (piece.first + piece.last) > 0), f"piece {p}: changes its sign"


@each
def test_no_phase_of_a_wave_is_left_out_of_its_pieces(name: str) -> None:
    """No phase is left out, and w jumps only where it is said to, upwards, or down."""
    wave = wave_of(EVERY[name])
    assert wave.pieces[0].start == 0.0
    np.testing.assert_array_equal(wave.pieces["start"][1:], wave.pieces["end"][:-1])
    assert wave.pieces[-1].end == pytest.approx(2 * pi * (wave.cycle.size - 1), rel=1e-15)
    before = np.concatenate([[0.0], wave.pieces["last"][:-1]])
    leaps = wave.pieces["first"] - before
    if EVERY[name].name != "square":
        assert not leaps[1:].any(), "a jump in a continuous wave"
    np.testing.assert_array_equal(wave.pieces["jumps"], leaps > np.maximum(0.0, -before))


@pytest.mark.parametrize("seed", range(6))
def test_peak_is_exact(seed: int) -> None:
    """However close the multiples and phases bring two maxima, the larger one is 1."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(2, 7))
    multiples = draw.choice(np.arange(1, 51), count, replace=False)
    amplitudes = draw.normal(size=count).tolist()
    phases = draw.uniform(0, 360, count).tolist()
    waveform = Harmonics(amplitudes, multiples.tolist(), phases, cycles=1)
    pieces = wave_of(waveform).pieces
    assert np.abs(pieces["top"]).max() == 1.0
    highest = pieces[np.abs(pieces["top"]).argmax()]
    phase = highest.start if highest.begin == 0.0 else highest.end
    assert np.abs(exact(waveform, np.array([phase]))) == pytest.approx(1.0, rel=1e-13)


#: sin 2φ and sin 3φ that nearly cancel about φ = π: three zeros within 0.026 rad, the wave below
#: 1e-5 between them.
THREE_ZEROS = Harmonics([0.2536777542789753, 0.1692128468453051], [2, 3], cycles=12)


@pytest.mark.parametrize("power", range(1, 6))
def test_zeros_that_lie_close_together_are_told_apart(power: int) -> None:
    """a sin 2φ + b sin 3φ = sin φ (2a cos φ + b (4 cos² φ − 1)), 10⁻¹ to 10⁻⁵ about π."""
    a = 1.0
    b = 2 / 3 * (1 + 10.0 ** (-2 * power))
    ends = wave_of(Harmonics([a, b], [2, 3], cycles=1)).pieces
    zeros = ends["start"][ends["first"] == 0.0]
    # 4b x² + 2a x − b = 0 in x = cos φ; the root near −1 as a distance from it
    top = (-2 * a - np.sqrt(4 * a * a + 16 * b * b)) / (8 * b)
    nearer = 2 * np.arcsin(np.sqrt((1 + top) / 2))
    for expected in (pi - nearer, pi, pi + nearer):
        assert np.abs(zeros - expected).min() < 1e-3 * nearer


def test_friction_turns_at_each_zero() -> None:
    """Continuous sliding over three close zeros, against Gauss's rule between them."""
    theta = 0.0
    mu_s = 0.33292316
    amplitude = 8.9043785
    frequency = 1.3944814
    onset = 1.8758496
    decay = 31.182287
    g = 9.81
    at_rest = mu_s * amplitude / (onset + g * mu_s)  # Eqs. 7, 8 and 10 on the level plane
    a, b = THREE_ZEROS.amplitudes
    scale = amplitude * exact(THREE_ZEROS, np.array([1.0]))[0] / (a * np.sin(2.0) + b * np.sin(3.0))

    def shaking(phase: np.ndarray) -> np.ndarray:
        ground: np.ndarray = scale * (a * np.sin(2 * phase) + b * np.sin(3 * phase))
        return ground

    def rate(phase: np.ndarray) -> np.ndarray:
        ground = shaking(phase)
        friction = at_rest * np.exp(-decay * np.abs(ground) / g)
        relative: np.ndarray = np.sign(ground) * g * (mu_s - friction)
        return relative

    low = 0.0
    high = 0.1
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if shaking(np.array(middle)) < onset else (low, middle)
    zeros = [
        0.0,
        *(pi + side * distance for side, distance in ((-1, 1.82356298072), (-1, 0.02586596335))),
        pi,
    ]
    zeros += [2 * pi - zero for zero in zeros[-2::-1]]
    assert np.abs(shaking(np.array(zeros))).max() < 1e-9
    points, weights = np.polynomial.legendre.leggauss(40)
    moved = 0.0
    for cycle in range(12):
        for start, end in itertools.pairwise(zeros):
            edges = np.linspace(max(start, high) if cycle == 0 else start, end, 41)
            half = np.diff(edges)[:, None] / 2
            centre = (edges[1:] + edges[:-1])[:, None] / 2
            phase = centre + half * points
            moved += float((half * weights * rate(phase) * (2 * pi * (12 - cycle) - phase)).sum())
    expected = moved / (2 * pi * frequency) ** 2
    for solver in (Cycle(), Step(rule="simpson", steps_per_cycle=1024)):
        result = sweep(
            theta,
            mu_s,
            amplitude,
            frequency,
            yield_acceleration=onset,
            decay_rate=decay,
            excitation=THREE_ZEROS,
            solver=solver,
        )
        assert float(result.permanent_displacement) == pytest.approx(expected, rel=1e-7)


def test_one_plain_cycle_stands_for_all() -> None:
    """Tables do not grow with the cycles, but for ramps."""
    assert len(wave_of(Square(10**9)).pieces) == 4
    long = wave_of(replace(EVERY["ramped triangle"], cycles=10**9))
    assert long.repeats == 10**9 - long.lead - 3
    assert len(long.pieces) == 4 * (long.lead + 4)


def test_a_wave_in_words_has_its_ramps_at_their_ends() -> None:
    words = "10 cycles of a triangle wave, ramp in 1 cycles, ramp out 2.5 cycles"
    assert str(Triangle(ramp_in=1, ramp_out=2.5)) == words
    assert str(Sine(cycles=1)) == "1 cycle of a sine"
    wave = Harmonics([1, 0.3], [1, 3], [0, 180], cycles=2)
    assert str(wave) == "2 cycles of a wave of harmonics 1:1:0, 0.3:3:180"
