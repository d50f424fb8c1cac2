"""Waveforms: what they are, their exact peaks, and the pieces they are cut into."""

from math import pi
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from slipsweep import InputError
from slipsweep.motion.pieces import BEGIN, COEFFICIENTS, END, FINISH, FIRST, JUMPS, LAST, START, TERMS, TOP
from slipsweep.motion.waveforms import MOST_RAMP, Waveform, check_waveform, text_of, wave_of

RICH = {"amplitudes": [1.0, 0.6, 0.35, 0.2], "multiples": [1, 2, 5, 50], "phases": [0.0, 40.0, 100.0, 7.0]}
EVERY = {
    "sine": Waveform(),
    "cosine": Waveform("cosine"),
    "triangle": Waveform("triangle"),
    "square": Waveform("square"),
    "harmonics": check_waveform("harmonics", RICH),
    "ramped harmonics": check_waveform("harmonics", RICH, 1.3, 0.4),
    "ramped cosine": check_waveform("cosine", None, 0.25, 2.0),
    "ramped triangle": check_waveform("triangle", None, 1.5, 1.25),
    "ramped square": check_waveform("square", None, 1.5, 1.25),
}
CYCLES = 4
each = pytest.mark.parametrize("name", EVERY)


def defined(waveform: Waveform, phase: np.ndarray, cycles: int) -> np.ndarray:
    """w by its definition; harmonics not normalised."""
    turns = phase / (2 * pi)
    if waveform.name == "sine":
        w = np.sin(phase)
    elif waveform.name == "cosine":
        w = np.cos(phase)
    elif waveform.name == "triangle":
        w = 2 / pi * np.arcsin(np.sin(phase))
    elif waveform.name == "square":
        w = np.where(turns % 1 < 0.5, 1.0, -1.0)
    else:
        terms = zip(waveform.amplitudes, waveform.multiples, waveform.phases, strict=True)
        w = sum((a * np.sin(m * phase + np.radians(p)) for a, m, p in terms), np.zeros(phase.shape))
    envelope = np.ones(phase.shape)
    if waveform.ramp_in:
        envelope = np.minimum(envelope, turns / waveform.ramp_in)
    if waveform.ramp_out:
        envelope = np.minimum(envelope, (cycles - turns) / waveform.ramp_out)
    return w * envelope


def exact_peak(waveform: Waveform) -> float:
    """The largest magnitude of the sum of harmonics: mpmath's root of its derivative beside a fine grid's best."""
    terms = list(zip(waveform.amplitudes, waveform.multiples, waveform.phases, strict=True))

    def total(phase: mpf) -> mpf:
        return mp.fsum(mpf(a) * mp.sin(m * phase + mp.radians(p)) for a, m, p in terms)

    def slope(phase: mpf) -> mpf:
        return mp.fsum(mpf(a) * m * mp.cos(m * phase + mp.radians(p)) for a, m, p in terms)

    grid = np.linspace(0, 2 * pi, 200_001)
    values = sum(a * np.sin(m * grid + np.radians(p)) for a, m, p in terms)
    return float(abs(total(mp.findroot(slope, grid[np.abs(values).argmax()]))))


@each
def test_pieces_are_the_wave(name: str) -> None:
    """1e-14 and the rounding of mφ, monotone and of one sign; harmonics of fifty times the frequency included."""
    waveform = EVERY[name]
    wave = wave_of(waveform, CYCLES)
    scale = exact_peak(waveform) if waveform.multiples else 1.0
    for p in range(len(wave.pieces)):
        tau = wave.pieces[p, BEGIN] + np.linspace(0.01, 0.99, 23) * (wave.pieces[p, FINISH] - wave.pieces[p, BEGIN])
        phase = wave.pieces[p, START] + (tau - wave.pieces[p, BEGIN])
        if wave.repeats and p >= wave.cycle[wave.lead + 1]:
            phase += 2 * pi * (wave.repeats - 1)  # the table has the plain cycle once
        found = wave.pieces[p, TOP] + sum(
            c * tau ** (k + 1) for k, c in enumerate(wave.pieces[p, COEFFICIENTS : COEFFICIENTS + TERMS])
        )
        error = np.abs(found - defined(waveform, phase, CYCLES) / scale).max()
        assert error < 1e-14 + 4e-16 * max(waveform.multiples, default=1) * 8 * pi, f"piece {p}: off by {error:.1e}"
        assert np.all(np.diff(found) * (wave.pieces[p, LAST] - wave.pieces[p, FIRST]) >= 0), f"piece {p}: not monotone"
        assert np.all(found * (wave.pieces[p, FIRST] + wave.pieces[p, LAST]) > 0), f"piece {p}: changes its sign"


@each
def test_pieces_join(name: str) -> None:
    """No phase is left out, and w jumps only where it is said to, upwards, or down."""
    wave = wave_of(EVERY[name], CYCLES)
    assert wave.pieces[0, START] == 0.0
    np.testing.assert_array_equal(wave.pieces[1:, START], wave.pieces[:-1, END])
    assert wave.pieces[-1, END] == pytest.approx(2 * pi * (wave.cycle.size - 1), rel=1e-15)
    leaps = wave.pieces[:, FIRST] - np.concatenate([[0.0], wave.pieces[:-1, LAST]])
    if EVERY[name].name != "square":
        assert not leaps[1:].any(), "a jump in a continuous wave"
    np.testing.assert_array_equal(
        wave.pieces[:, JUMPS] > 0.0, leaps > np.maximum(0.0, -np.concatenate([[0.0], wave.pieces[:-1, LAST]]))
    )


@pytest.mark.parametrize("seed", range(12))
def test_peak_is_exact(seed: int) -> None:
    """However close the multiples and phases bring two maxima, the larger one is 1."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(2, 7))
    multiples = draw.choice(np.arange(1, 51), count, replace=False)
    waveform = check_waveform(
        "harmonics",
        {"amplitudes": draw.normal(size=count), "multiples": multiples, "phases": draw.uniform(0, 360, count)},
    )
    wave = wave_of(waveform, 1)
    assert np.abs(wave.pieces[:, TOP]).max() == 1.0
    # scaled by the peak, the coefficients give it back
    p = int(np.abs(wave.pieces[:, TOP]).argmax())
    phase = wave.pieces[p, START] if wave.pieces[p, BEGIN] == 0.0 else wave.pieces[p, END]
    assert abs(defined(waveform, np.array([phase]), 1)[0]) == pytest.approx(exact_peak(waveform), rel=1e-13)


def test_stretches_of_several_maxima() -> None:
    """sin φ + 0.6 sin 5φ is above zero in one run with three maxima, and its mirror image below."""
    wave = wave_of(check_waveform("harmonics", {"amplitudes": [1, 0.6], "multiples": [1, 5]}), 1)
    ((a, b),) = wave.stretch[:1]
    tops = [p for p in range(a, b - 1) if wave.pieces[p, FIRST] < wave.pieces[p, LAST] > wave.pieces[p + 1, LAST]]
    assert len(wave.stretch) == 3 or len(tops) == 3
    assert wave.height.max() == 1.0


def test_one_plain_cycle_stands_for_all() -> None:
    """Tables do not grow with the cycles, but for ramps."""
    assert len(wave_of(Waveform("square"), 10**9).pieces) == 4
    long = wave_of(EVERY["ramped triangle"], 10**9)
    assert long.repeats == 10**9 - long.lead - 3
    assert len(long.pieces) == 4 * (long.lead + 4)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"waveform": "saw"}, "waveform = 'saw'"),
        ({"waveform": "harmonics"}, "harmonics: must be given"),
        ({"harmonics": RICH}, "only with 'harmonics'"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [1.0]}}, "must have amplitudes, multiples"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [1.0, 2.0], "multiples": [1]}}, "harmonics.multiples"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [1.0], "multiples": [0]}}, "harmonics.multiples[0] = 0"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [1.0], "multiples": [1.5]}}, "= 1.5"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [0.0], "multiples": [1]}}, "must not all be 0"),
        ({"waveform": "harmonics", "harmonics": {"amplitudes": [1, 1], "multiples": [2, 2]}}, "not be repeated"),
        ({"waveform": "harmonics", "harmonics": "1:1:0;2"}, "amplitude:multiple:phase"),
        ({"ramp_in": -1}, "ramp_in = -1"),
        ({"ramp_out": MOST_RAMP + 1}, f"ramp_out = {MOST_RAMP + 1}"),
        ({"ramp_in": float("nan")}, "ramp_in = nan"),
        ({"ramp_in": 6, "ramp_out": 5}, "must not exceed the 10 cycles"),
    ],
)
def test_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        check_waveform(**given)
    assert message in str(error.value)


def test_attributes_give_the_waveform_again() -> None:
    for waveform in EVERY.values():
        assert check_waveform(**waveform.attributes) == waveform
    assert text_of(EVERY["ramped square"].attributes) == "square wave, ramp in 1.5 cycles, ramp out 1.25 cycles"
