"""The motion rules of the model in small steps, one after the other, from the text of docs/model.md alone.

Nothing of the solvers is in it: no pulses, no events, no scaling, no cycle that repeats another.  Its errors are
those of steps that are not cut where something begins or ends: of first order, a thousandth or so.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MENDEZ, LITERAL, NEWMARK = range(3)


class Motion(NamedTuple):
    """Displacement and peak velocity of a cell at 1 rad/s; whether it has a value, and whether it recouples."""

    displacement: float
    peak: float
    valued: bool
    recoupled: bool


def shaking(waveform: str, terms: Array, cycles: int, ramp_in: float, ramp_out: float, steps: int) -> Array:
    """The plane's acceleration over its peak in the middle of each step; `steps` a cycle, a multiple of four."""
    phase = 2.0 * np.pi * (np.arange(cycles * steps) + 0.5) / steps
    if waveform == "harmonics":

        def wave(at: Array) -> Array:
            return np.asarray(sum(a * np.sin(m * at + math.radians(p)) for a, m, p in terms))

        # between its points the largest is nearer than the square of their distance
        values = wave(phase) / np.abs(wave(np.linspace(0.0, 2.0 * np.pi, 2**16 * int(terms[:, 1].max())))).max()
    elif waveform == "cosine":
        values = np.cos(phase)
    elif waveform == "triangle":
        values = 2.0 / np.pi * np.arcsin(np.sin(phase))
    elif waveform == "square":
        values = np.sign(np.sin(phase))
    else:
        values = np.sin(phase)
    cycle = phase / (2.0 * np.pi)
    for ramp, from_end in ((ramp_in, cycle), (ramp_out, cycles - cycle)):
        if ramp > 0.0:
            values = values * np.minimum(1.0, from_end / ramp)
    return np.asarray(values)


class Block(NamedTuple):
    """What Eqs. 4 and 6 need of a cell."""

    amplitude: float
    tan_theta: float
    mu_s: float
    g: float
    onset: float
    at_rest: float
    decay: float


def block(cell: dict[str, float], model: str, g: float) -> tuple[Block, bool]:
    """Eqs. 6 to 11 with what is given; and whether the cell slides continuously."""
    tan_theta, mu_s, amplitude = math.tan(math.radians(cell["theta"])), cell["mu_s"], cell["amplitude"]
    onset = cell.get("yield_acceleration", g * (mu_s - tan_theta) / (1.0 + mu_s * tan_theta))
    limit = (onset + g * mu_s) / (1.0 - tan_theta * (mu_s - tan_theta))
    ratio = amplitude / limit
    is_continuous = ratio > 1.0 and model != "newmark"
    delta_mu = cell.get("delta_mu", mu_s * (ratio - 1.0 if is_continuous else 1.0 / ratio - 1.0))
    least = cell.get("minimum_friction", 0.01 if is_continuous else mu_s**2 * ratio)
    decay = cell["decay_rate"] / g if "decay_rate" in cell else 0.0
    if "decay_rate" not in cell and model != "newmark":
        decay = math.log((mu_s + delta_mu) / least) / amplitude
    return Block(amplitude, tan_theta, mu_s, g, onset, mu_s + delta_mu, decay), is_continuous


@numba.njit
def _eq4(one: Block, x: float) -> float:
    """Eq. 4 with Eq. 6."""
    friction = one.at_rest * math.exp(-one.decay * abs(x))
    size = abs(x) - (one.g + x * one.tan_theta) * (one.mu_s - one.tan_theta - friction) - one.g * one.tan_theta
    return size if x >= 0.0 else -size


@numba.njit
def continuous(one: Block, plane: Array, step: float, jumps: bool) -> tuple[float, float]:
    """From the first Üg >= Üy on Eq. 4 holds for good: displacement and largest velocity; `jumps` as below."""
    v = u = peak = 0.0
    going = False
    for i in range(plane.size):
        x, before = one.amplitude * plane[i], one.amplitude * plane[i - 1] if i else 0.0
        is_jump = jumps or i == 0
        rate = x - _eq4(one, x)
        gained = step * rate if going else 0.0
        # Eq. 4 turns with Üg: between the middles of two steps, not at the end of one
        if going and before * x < 0.0 and not is_jump:
            gained += step * (before / (before - x) - 0.5) * (before - _eq4(one, before) - rate)
        if not going and x >= one.onset:
            going, gained = True, step * rate * (1.0 if is_jump else 1.5 - (one.onset - before) / (x - before))
        u += step * (v + 0.5 * gained)
        v += gained
        peak = max(peak, v)
    return u, peak


@numba.njit
def _begin(one: Block, low: float, high: float, kind: int) -> float:
    """The plane's acceleration, on its rise from low to high, at which the block begins to slide."""
    if kind == NEWMARK or _eq4(one, low) < low:
        return low
    for _ in range(40):
        middle = 0.5 * (low + high)
        if _eq4(one, middle) < middle:
            high = middle
        else:
            low = middle
    return high


@numba.njit
def stick_slip(
    one: Block, plane: Array, step: float, kind: int, integrates: bool, jumps: bool
) -> tuple[float, float, bool, bool]:
    """Stick, slide, attenuate; a slide whose b is not positive after its rise leaves no value.

    With `jumps` every change of the plane's acceleration is one; that of its first step always is.
    """
    v = u = peak = b = 0.0
    slides, recoupled = False, True
    resets = True  # the next Üg = Üy on the rise resets b
    for i in range(plane.size):
        x, before = one.amplitude * plane[i], one.amplitude * plane[i - 1] if i else 0.0
        is_rising, is_jump = x >= before, jumps or i == 0
        braked = False  # by Eq. 12
        if x <= 0.0:
            resets, braked = True, not integrates
        elif is_rising:
            low = x if is_jump else max(before, one.onset)
            if resets and x > one.onset:
                recoupled = recoupled and v == 0.0
                resets, slides = False, v > 0.0
                b = _starting(one, low, kind)
            elif resets:
                braked = not integrates
            if not resets and not slides and x > one.onset and (kind == NEWMARK or _eq4(one, x) < x):
                slides, b = True, _starting(one, _begin(one, low, x, kind), kind)
            if not resets and kind != NEWMARK and slides:
                b = _eq4(one, x) if kind == LITERAL else max(b, _eq4(one, x))
        else:
            braked = resets and not integrates
        if slides:
            if b <= 0.0 and not (is_rising and x > 0.0):
                return math.nan, math.nan, False, recoupled
            gained = step * (-b if braked else x - b)
            if v + gained <= 0.0:
                u += 0.5 * v * step * v / -gained if gained < 0.0 else 0.0
                v, slides = 0.0, False
            else:
                u += step * (v + 0.5 * gained)
                v += gained
                peak = max(peak, v)
    if slides:
        if b <= 0.0:
            return math.nan, math.nan, False, recoupled
        u += v * v / (2.0 * b)
    return u, peak, True, recoupled


@numba.njit
def _starting(one: Block, x: float, kind: int) -> float:
    """c(Üg)."""
    if kind == NEWMARK:
        return one.onset
    return _eq4(one, x) if kind == LITERAL else max(one.onset, _eq4(one, x))


def moved(one: Block, is_continuous: bool, options: dict[str, Any], plane: Array, steps: int) -> Motion:
    """One cell under `shaking`; `options` are those of `agreement.Group`."""
    step, jumps = 2.0 * math.pi / steps, options["waveform"] == "square"
    if is_continuous:
        displacement, peak = continuous(one, plane, step, jumps)
        return Motion(displacement, peak, True, True)
    kind = NEWMARK if options["model"] == "newmark" else LITERAL if options["rise"] == "literal" else MENDEZ
    integrates = kind == NEWMARK or options["recoupling"] == "integrate"
    return Motion(*stick_slip(one, plane, step, kind, integrates, jumps))
