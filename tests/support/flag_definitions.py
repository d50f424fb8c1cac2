"""The flags of `validity` by their definitions (docs/model.md), in plain Python: no kernel, nothing of the package."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

STATICALLY_UNSTABLE = 1
UPLIFT = 2
LIMIT_UNDEFINED = 4
FRICTION_NOT_DECAYING = 8
YIELD_GOVERNS = 16
KD_NOT_POSITIVE = 32
NOT_RECOUPLED = 64
FLEXIBLE_BLOCK = 128
UPSLOPE = 256
NEAR_MODE_LIMIT = 512
FRICTION_ESTIMATED = 1024

NO_VALUE = STATICALLY_UNSTABLE | UPLIFT | LIMIT_UNDEFINED | FRICTION_NOT_DECAYING | KD_NOT_POSITIVE


def remarks(
    ratio: Any, displacement: Any, *, decay_rate: Any, delta_mu: Any, newmark: bool = False, yield_governs: bool = False
) -> int:
    """Upslope, near the mode limit, friction estimated: of a block that slides and has a value.

    Parameters
    ----------
    ratio, displacement
        ξ and u, numbers of any kind.
    decay_rate, delta_mu
        As given; None or NaN by default.
    """
    estimated = any(given is None or given != given for given in (decay_rate, delta_mu))
    return (
        UPSLOPE * bool(displacement < 0)
        | NEAR_MODE_LIMIT * bool(not newmark and 0.9 <= ratio <= 1.1)
        | FRICTION_ESTIMATED * bool(not newmark and not yield_governs and estimated)
    )


def acceleration_ratio(theta: float, mu_s: float, amplitude: float, yield_acceleration: float, g: float) -> float:
    """ξ of Eqs. 7 and 8."""
    tan_theta = math.tan(math.radians(theta))
    return amplitude / ((yield_acceleration + g * mu_s) / (1.0 - tan_theta * (mu_s - tan_theta)))


def coulomb(theta: float, mu_s: float, g: float) -> float:
    """Üy = g tan(φs − θ)."""
    return g * math.tan(math.atan(mu_s) - math.radians(theta))


# ------------------------------------------------------------------ many cells under a sine, and records

Floats = NDArray[np.float64]

#: Steps in a cycle of the plain time stepping, and what is within it of a border is not decided.
_STEPS = 720
_NEARLY = 0.02


@dataclass(frozen=True)
class Interface:
    """Eqs. 6-11 for cells side by side; what is not given of `yield_acceleration` and the others is NaN."""

    tan_theta: Floats
    mu_s: Floats
    amplitude: Floats
    given_yield: Floats
    given_decay: Floats
    given_delta: Floats
    given_minimum: Floats
    g: float = 9.81

    @cached_property
    def yield_acceleration(self) -> Floats:
        return np.where(
            np.isnan(self.given_yield),
            self.g * np.tan(np.arctan(self.mu_s) - np.arctan(self.tan_theta)),
            self.given_yield,
        )

    @cached_property
    def denominator(self) -> Floats:
        return 1.0 - self.tan_theta * (self.mu_s - self.tan_theta)

    @cached_property
    def ratio(self) -> Floats:
        return self.amplitude * self.denominator / (self.yield_acceleration + self.g * self.mu_s)

    @cached_property
    def minimum(self) -> Floats:
        estimate = np.where(self.ratio <= 1.0, self.mu_s**2 * self.ratio, 0.01)
        return np.where(np.isnan(self.given_minimum), estimate, self.given_minimum)

    @cached_property
    def delta(self) -> Floats:
        estimate = self.mu_s * (np.where(self.ratio <= 1.0, 1.0 / self.ratio, self.ratio) - 1.0)
        return np.where(np.isnan(self.given_delta), estimate, self.given_delta)

    @cached_property
    def decay(self) -> Floats:
        with np.errstate(invalid="ignore", divide="ignore"):
            estimate = self.g / self.amplitude * np.log((self.mu_s + self.delta) / self.minimum)
        return np.where(np.isnan(self.given_decay), estimate, self.given_decay)

    def eq4(self, x: Floats) -> Floats:
        """The block's acceleration at the plane's acceleration x (Eqs. 2, 4 and 6)."""
        with np.errstate(over="ignore", invalid="ignore"):
            mu = (self.mu_s + self.delta) * np.exp(-self.decay * np.abs(x) / self.g)
            n = self.g + x * self.tan_theta
            asked = np.abs(x) - n * (self.mu_s - self.tan_theta - mu) - self.g * self.tan_theta
        return np.sign(x) * asked

    def highest_eq4(self) -> Floats:
        """The largest Eq. 4 on the rise from Üy to the peak."""
        shares = np.linspace(0.0, 1.0, 1001)[:, np.newaxis]
        x = self.yield_acceleration + shares * (self.amplitude - self.yield_acceleration)
        return np.asarray(np.fmax.reduce(self.eq4(x), initial=-np.inf))


def flags_of_sine(
    interface: Interface, cycles: int, model: str, rise: str, recoupling: str
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The flags of cells under a sine, and which bits of them are decided: what is near a border is not."""
    one, newmark = interface, model == "newmark"
    onset, amplitude = one.yield_acceleration, one.amplitude
    flags = STATICALLY_UNSTABLE * (onset <= 0.0)
    if not newmark:
        flags = flags | UPLIFT * (amplitude * one.tan_theta >= one.g) | LIMIT_UNDEFINED * (one.denominator <= 0.0)
        rises = np.isnan(one.given_decay) & (one.mu_s + one.delta <= one.minimum)
        flags = flags | FRICTION_NOT_DECAYING * (rises & (flags & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED) == 0))
    slides = (flags == 0) & (amplitude > onset)
    continuous = slides & (one.ratio > 1.0) & (not newmark)
    sticks = slides & ~continuous
    highest, peak = one.highest_eq4(), one.eq4(amplitude)
    governs = sticks & (highest <= onset) & (not newmark)
    flags = flags | YIELD_GOVERNS * governs
    unstoppable = sticks & (rise == "literal") & (not newmark) & (peak <= 0.0)
    flags = flags | KD_NOT_POSITIVE * unstoppable
    valued = slides & ~unstoppable

    carries, sure_carries = _carries(one, sticks & ~unstoppable, cycles, newmark, rise, recoupling)
    moved, far = _continuous(one, continuous, cycles)
    flags = flags | NOT_RECOUPLED * carries | UPSLOPE * (moved < 0.0)
    near = (one.ratio >= 0.9) & (one.ratio <= 1.1)
    estimated = np.isnan(one.given_decay) | np.isnan(one.given_delta)
    flags = flags | NEAR_MODE_LIMIT * (valued & near & (not newmark))
    flags = flags | FRICTION_ESTIMATED * (valued & estimated & ~governs & (not newmark))

    decided = np.full(flags.shape, 2047)
    close = np.abs(highest - onset) <= 1e-4 * amplitude
    decided &= ~np.where(close & sticks, YIELD_GOVERNS | FRICTION_ESTIMATED, 0)
    decided &= ~np.where(sure_carries, 0, NOT_RECOUPLED)
    decided &= ~np.where(far, 0, UPSLOPE)
    return flags.astype(np.int64), decided


def _carries(
    one: Interface, there: NDArray[np.bool_], cycles: int, newmark: bool, rise: str, recoupling: str
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether a block in stick-slip still slides when a later pulse begins, and whether that is decided."""
    size, onset, amplitude = there.shape, one.yield_acceleration, one.amplitude
    v, b, slides, pulsing = np.zeros(size), np.zeros(size), np.zeros(size, bool), np.zeros(size, bool)
    carries, rested = np.zeros(size, bool), np.full(size, -np.inf)
    decided, lag_before, x_before = np.ones(size, bool), np.zeros(size), np.zeros(size)
    step = 2.0 * np.pi / _STEPS
    for k in range(cycles * _STEPS):
        phi = (k + 0.5) * step
        x, rising = amplitude * np.sin(phi), np.cos(phi) >= 0.0
        pulsing &= x > 0.0
        asked = onset if newmark else one.eq4(x)
        begun = there & ~pulsing & (x >= onset) & rising
        carries |= begun & (v > 0.0)
        decided &= ~begun | (v > _NEARLY * amplitude) | ((v == 0.0) & (phi - rested > 4.0 * step))
        c = np.maximum(onset, asked) if rise == "monotone" or newmark else asked
        b = np.where(begun, c, b)
        slides |= begun & (v > 0.0)
        pulsing |= begun
        if rising:
            starts = there & pulsing & (v == 0.0) & (x >= onset) & (c < x)
            # t1 between two steps: the block stays with the plane up to c = x, and holds that value
            passed = np.where(lag_before > 0.0, lag_before / np.where(starts, lag_before + x - c, 1.0), 0.0)
            level = np.where(lag_before > 0.0, x_before + passed * (x - x_before), c)
            b = np.where(starts & ~slides, level, b)
            slides |= starts
            if not newmark:
                follows = slides & (x > 0.0) & pulsing
                b = np.where(follows, asked if rise == "literal" else np.maximum(b, asked), b)
        lag_before, x_before = np.where(pulsing & (x_before >= 0.0), c - x, 0.0), x
        rate = np.where(pulsing | newmark | (recoupling == "integrate"), x - b, -b)
        after = np.where(slides, v + rate * step, 0.0)
        stopped = slides & (after <= 0.0)
        rested = np.where(stopped, phi, rested)
        slides &= ~stopped
        v = np.maximum(after, 0.0)
    return carries, decided


def _continuous(one: Interface, there: NDArray[np.bool_], cycles: int) -> tuple[Floats, NDArray[np.bool_]]:
    """The displacement of blocks in continuous sliding, 0 for others, and whether its sign is decided."""
    v, u, most = (np.zeros(there.shape) for _ in range(3))
    slides, step = np.zeros(there.shape, bool), 2.0 * np.pi / _STEPS
    for k in range(cycles * _STEPS):
        x = one.amplitude * np.sin((k + 0.5) * step)
        slides |= there & (x >= one.yield_acceleration)
        with np.errstate(invalid="ignore"):
            gain = np.where(slides, (x - one.eq4(x)) * step, 0.0)
        u += (v + 0.5 * gain) * step
        v += gain
        most += np.abs(v) * step
    return u, ~there | (np.abs(u) > _NEARLY * most)


def flags_of_record(
    theta: float, mu_s: float, samples: Floats, displacement: float, given: dict[str, float], g: float = 9.81
) -> tuple[int, int]:
    """Bits 16, 256, 512 and 1024 of a block that a record shakes and that has a value; and which are decided.

    The record is straight between its samples; a pulse is a stretch above zero whose peak exceeds Üy.
    """
    pulses, peak = [], 0.0
    for value in [*samples.tolist(), 0.0]:
        if value > 0.0:
            peak = max(peak, value)
        elif peak > 0.0:
            pulses.append(peak)
            peak = 0.0
    names = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")
    own = [np.array([value]) for value in (math.tan(math.radians(theta)), mu_s)]
    optional = [np.array([given.get(name, math.nan)]) for name in names]
    flags, decided = UPSLOPE * (displacement < 0.0), 2047
    for peak in pulses:
        one = Interface(own[0], own[1], np.array([peak]), optional[0], optional[1], optional[2], optional[3], g)
        onset, ratio = float(one.yield_acceleration[0]), float(one.ratio[0])
        if peak <= onset:
            continue
        highest = float(one.highest_eq4()[0])
        governs = ratio <= 1.0 and highest <= onset
        flags |= YIELD_GOVERNS * governs | remarks(
            ratio, 0.0, decay_rate=given.get("decay_rate"), delta_mu=given.get("delta_mu"), yield_governs=governs
        )
        if ratio <= 1.0 and abs(highest - onset) <= 1e-4 * peak:
            decided &= ~(YIELD_GOVERNS | FRICTION_ESTIMATED)
    return flags, decided
