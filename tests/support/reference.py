"""Motion rules in multiple precision, for all waveforms and records, without code of the solvers.

The shaking is cut into sections on which Üg is smooth, monotone and of one sign.  Every event
(onset, switch between Eq. 4 and the held value, stop) is a bracketed root of its own condition,
every integral a Gauss-Legendre rule over parts that are short against the waves and against the
decay of the friction.  Time is the phase φ = ωt under a waveform, where V = ωv and W = ω²u, and the
time itself under a record.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import gmpy2
from gmpy2 import mpfr

from tests.support.block import Block, Interface, NoValueError
from tests.support.digits import workdps
from tests.support.sections import Section, Waveform, sections_of_record

Number: TypeAlias = float | int | str | mpfr

MISSING = -1
STUCK = 0
STICK_SLIP = 1
CONTINUOUS = 2

# the bits of `validity` (docs/model.md)
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

#: Digits beyond those requested: just above yield u grows with (A - Uy)**2.
GUARD_DIGITS = 30


@dataclass(frozen=True)
class FrictionParameters:
    """Eqs. 7-11 of one cell; NaN where a formula has no value."""

    yield_acceleration: mpfr
    limiting_acceleration: mpfr
    acceleration_ratio: mpfr
    minimum_friction: mpfr
    delta_mu: mpfr
    decay_rate: mpfr
    sliding_mode: int
    validity: int

    def interface(self, g: mpfr, tan_theta: mpfr, mu_s: mpfr) -> Interface:
        return Interface(
            g, tan_theta, mu_s, self.delta_mu, self.decay_rate, self.yield_acceleration
        )


@dataclass(frozen=True)
class Solution:
    """Response to a waveform.

    ``recoupled`` is true where every pulse of stick-slip (or stuck) comes to rest before the
    next onset; it is false in continuous mode.  ``eq4_below_yield`` is bit 16 of ``validity``,
    but for the literal rise, whose b follows Eq. 4 below Uy, and for Newmark's block, where it is
    true: they have no such bit.
    """

    permanent_displacement: mpfr
    peak_relative_velocity: mpfr
    sliding_mode: int
    validity: int
    recoupled: bool = False
    eq4_below_yield: bool = False


@dataclass(frozen=True)
class RecordSolution:
    """Response to a record; the counts are -1 where there is no value."""

    permanent_displacement: mpfr
    peak_relative_velocity: mpfr
    number_of_slips: int
    stick_slip_pulses: int
    continuous_pulses: int
    validity: int


def friction_parameters(
    theta: Number,
    mu_s: Number,
    amplitude: Number,
    *,
    yield_acceleration: Number | None = None,
    decay_rate: Number | None = None,
    delta_mu: Number | None = None,
    minimum_friction: Number | None = None,
    model: str = "mendez",
    g: Number = 9.81,
    dps: int = 30,
) -> FrictionParameters:
    """Friction parameters of one cell (Eqs. 7-11), `theta` in degrees, the rest in SI units."""
    with workdps(dps + GUARD_DIGITS):
        tan_theta = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        static = mpfr(mu_s)
        peak = mpfr(amplitude)
        gravity = mpfr(g)
        onset = gravity * (static - tan_theta) / (1 + static * tan_theta)
        onset = onset if yield_acceleration is None else mpfr(yield_acceleration)
        validity = STATICALLY_UNSTABLE * (onset <= 0)
        denominator = 1 - tan_theta * (static - tan_theta)
        limit = (onset + gravity * static) / denominator if denominator > 0 else gmpy2.nan()
        ratio = peak / limit
        continuous = ratio > 1
        least = mpfr("0.01") if continuous else static**2 * ratio
        least = least if minimum_friction is None else mpfr(minimum_friction)
        inverse = 1 / ratio if ratio != 0 else gmpy2.inf()
        excess = (
            static * ((ratio if continuous else inverse) - 1)
            if delta_mu is None
            else mpfr(delta_mu)
        )
        decays = (static + excess) / least if least != 0 else gmpy2.inf()
        if model != "newmark":
            validity |= UPLIFT * (peak * tan_theta >= gravity) | LIMIT_UNDEFINED * (
                denominator <= 0
            )
            if decay_rate is None and not validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED):
                validity |= FRICTION_NOT_DECAYING * (decays <= 1)
        rate = gmpy2.nan() if decay_rate is None else mpfr(decay_rate)
        if decay_rate is None and peak > 0 and decays > 0:  # false for NaN
            rate = gravity / peak * gmpy2.log(decays)
        mode = CONTINUOUS if continuous and model != "newmark" else STICK_SLIP
        mode = MISSING if validity else STUCK if peak <= onset else mode
        return FrictionParameters(onset, limit, ratio, least, excess, rate, mode, validity)


def _remarks(ratio: mpfr, upslope: bool, governs: bool, model: str, given: dict[str, Any]) -> int:
    """Bits of a block that slides and has a value: upslope, near mode limit, friction estimated."""
    if model == "newmark":
        return UPSLOPE * upslope
    estimated = given.get("decay_rate") is None or given.get("delta_mu") is None
    near = bool(0.9 <= ratio <= 1.1)
    return (
        UPSLOPE * upslope
        | NEAR_MODE_LIMIT * near
        | FRICTION_ESTIMATED * (estimated and not governs)
    )


def _eq4_below_yield(block: Block, rises: Iterable[tuple[mpfr, mpfr]]) -> bool:
    """Whether Üg exceeds Uy, and Eq. 4 stays below it at all that the base rises through."""
    interface = block.interface
    values = [
        x
        for low, high in rises
        if high > block.onset
        for x in interface.monotone_pieces(
            lambda x: 1 - interface.slope(x), max(low, block.onset), high
        )
    ]
    limit = block.onset * (1 + mpfr(10) ** -25)
    return bool(values) and (block.newmark or all(interface.eq4(x) <= limit for x in values))


def _rises(shaking: Iterable[Section], rounding: mpfr) -> Iterator[tuple[mpfr, mpfr]]:
    """From where to where the base's acceleration rises, or jumps up."""
    before = mpfr(0)
    for section in shaking:
        if section.last > section.first:
            yield section.first, section.last
        elif section.first > before + rounding or section.first == section.last:
            yield section.first, section.first
        before = section.last


def _cycles(block: Block, wave: Waveform, amplitude: mpfr, is_continuous: bool) -> list[Section]:
    """Move through all cycles but those alike; return the sections of the cycles that differ."""
    shaking: list[Section] = []
    seen: list[tuple[tuple[Any, ...], int, mpfr]] = []
    n = 0
    highest = mpfr(0)
    while n < wave.cycles:
        sections = list(wave.sections(n, amplitude))
        alike = wave.alike(n) - 1
        if not alike or not seen:
            shaking += sections
        before = block.state()
        start = n
        u = block.u
        block.peak = block.lowest = block.v
        for section in sections:
            if not is_continuous:
                block.take(section)
            elif block.sliding:
                block.follow(section)
            elif max(section.first, section.last) >= block.onset:
                block.sliding = True
                block.follow(section.cut(block.onset) if section.first < block.onset else section)
        n += 1
        if alike:
            gain = block.v - before[0]
            if block.same(before[1:], block.state()[1:]) and (is_continuous or block.lowest > 0):
                # the next ones differ by a velocity that is added
                if gain < 0 and not is_continuous:
                    alike = min(alike, max(0, int(gmpy2.floor(-block.lowest / gain)) - 1))
                block.u += (
                    alike * (block.u - u) + 2 * gmpy2.const_pi() * gain * alike * (alike + 1) / 2
                )
                block.peak += max(gain, 0) * alike
                block.v += gain * alike
                n += alike
            seen.append((before, start, u))
            for then, n_then, u_then in seen:
                if block.same(then, block.state()):
                    repeats = (wave.alike(n - 1) - 1) // (n - n_then)
                    block.u += repeats * (block.u - u_then)
                    n += repeats * (n - n_then)
                    break
        highest = max(highest, block.peak)
    block.peak = highest
    return shaking


def solve(
    theta: Number,
    mu_s: Number,
    amplitude: Number,
    frequency: Number,
    *,
    cycles: int = 10,
    waveform: str = "sine",
    harmonics: str = "",
    ramp_in: float = 0.0,
    ramp_out: float = 0.0,
    structure_frequency: Number | None = None,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    g: Number = 9.81,
    dps: int = 30,
    **given: Number | None,
) -> Solution:
    """Response of a cell to a waveform, to `dps` digits; floats have their exact binary value.
    Arguments are those of `slipsweep.sweep`; `harmonics` are "amplitude:multiple:phase in degrees,
    ...", `given` as in `friction_parameters`.  Displacement is in m, velocity in m/s; NaN where
    `validity` says that there is no value.
    """
    with workdps(dps + GUARD_DIGITS):
        parameters = friction_parameters(theta, mu_s, amplitude, model=model, g=g, dps=dps, **given)
        validity = parameters.validity
        mode = parameters.sliding_mode
        peak = mpfr(amplitude)
        if structure_frequency is not None:
            in_band = (
                0.2 <= float(frequency) / float(structure_frequency) <= 1.3
            )  # in doubles: 1/5 is 0.2
            validity |= FLEXIBLE_BLOCK * in_band
        if mode == MISSING:
            return Solution(gmpy2.nan(), gmpy2.nan(), MISSING, validity)
        if mode == STUCK:
            return Solution(mpfr(0), mpfr(0), STUCK, validity, recoupled=True)
        block = Block(model, rise, recoupling)
        interface = parameters.interface(mpfr(g), gmpy2.tan(gmpy2.radians(mpfr(theta))), mpfr(mu_s))
        block.meet_interface(interface, peak, dps + 10)
        wave = Waveform(waveform, harmonics, cycles, ramp_in, ramp_out)
        below = False
        try:
            shaking = _cycles(block, wave, peak, mode == CONTINUOUS)
            if mode == STICK_SLIP:
                below = _eq4_below_yield(block, _rises(shaking, block.rounding))
                block.run_out()
        except NoValueError:
            shaking = [section for n in range(cycles) for section in wave.sections(n, peak)]
            below = _eq4_below_yield(block, _rises(shaking, block.rounding))
            return Solution(
                gmpy2.nan(), gmpy2.nan(), MISSING, validity | KD_NOT_POSITIVE, False, below
            )
        governs = below and not block.newmark and not block.literal
        validity |= YIELD_GOVERNS * governs
        validity |= NOT_RECOUPLED * (block.recoupled_late and not block.newmark)
        if any(max(section.first, section.last) > block.onset for section in shaking):
            # ramps may keep the shaking below its peak, and the block from sliding
            validity |= _remarks(
                parameters.acceleration_ratio, block.u < -block.rounding, governs, model, given
            )
        omega = 2 * gmpy2.const_pi() * mpfr(frequency)
        recoupled = mode == STICK_SLIP and not block.recoupled_late
        return Solution(block.u / omega**2, block.peak / omega, mode, validity, recoupled, below)


# ---------------------------------------------------------------------------------------------
# records


def _half_waves(sections: Sequence[Section]) -> Iterator[tuple[int, int, mpfr]]:
    """First and last (exclusive) sections and peaks of the parts above zero."""
    start = None
    for i in range(len(sections) + 1):
        above = i < len(sections) and sections[i].side > 0
        if start is not None and not (
            above and sections[i].first > 0
        ):  # to touch zero ends a half wave
            yield start, i, max(max(section.first, section.last) for section in sections[start:i])
            start = None
        if above and start is None:
            start = i


def _cut_at_onsets(
    sections: list[Section], onset: mpfr
) -> tuple[list[Section], list[tuple[int, int, mpfr]]]:
    """Sections cut at the first onset of each half wave; first, end and peak of these pulses."""
    cut: list[Section] = []
    pulses = []
    done = 0
    for start, end, peak in _half_waves(sections):
        if peak <= onset:
            continue
        i = next(i for i in range(start, end) if max(sections[i].first, sections[i].last) > onset)
        i = next((k for k in range(start, i) if sections[k].first >= onset), i)
        cut += sections[done:i]
        if sections[i].first < onset:
            second = sections[i].cut(onset)
            cut.append(replace(sections[i], end=second.start, last=onset))
            sections[i] = second
        pulses.append((len(cut), len(cut) + end - i, peak))
        cut = cut + sections[i:end]
        done = end
    return cut + sections[done:], pulses


def solve_record(
    times: Any,
    acceleration: Any,
    theta: Number,
    mu_s: Number,
    *,
    scale: float = 1.0,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    g: Number = 9.81,
    dps: int = 20,
    **given: Number | None,
) -> RecordSolution:
    """Response of a block to a record, straight between its samples; `given` as in `solve`."""
    with workdps(dps + GUARD_DIGITS):
        values = [mpfr(scale) * mpfr(float(a)) for a in acceleration]
        sections = sections_of_record(times, values)
        block = Block(model, rise, recoupling)
        tan_theta = gmpy2.tan(gmpy2.radians(mpfr(theta)))

        def friction(peak: mpfr) -> FrictionParameters:
            return friction_parameters(theta, mu_s, peak, model=model, g=g, dps=dps, **given)

        onset = friction(mpfr(1)).yield_acceleration
        sections, pulses = _cut_at_onsets(sections, onset)
        validity = STATICALLY_UNSTABLE * (onset <= 0)
        if model != "newmark":
            validity |= UPLIFT * (min(mpfr(g) + value * tan_theta for value in values) <= 0)
        modes: list[int] = []
        ends = [*(begin for begin, _, _ in pulses[1:]), len(sections)]
        for (begin, end, peak), following in zip(pulses, ends, strict=False):
            parameters = friction(peak)
            mode = (
                CONTINUOUS
                if parameters.acceleration_ratio > 1 and not block.newmark
                else STICK_SLIP
            )
            validity |= parameters.validity & ~UPLIFT  # which the record itself tells
            validity |= NOT_RECOUPLED * bool(
                block.v > 0 and not block.newmark and modes and modes[-1] == STICK_SLIP
            )
            if validity & (STATICALLY_UNSTABLE | UPLIFT | LIMIT_UNDEFINED | FRICTION_NOT_DECAYING):
                return RecordSolution(gmpy2.nan(), gmpy2.nan(), -1, -1, -1, validity)
            block.meet_interface(
                parameters.interface(mpfr(g), tan_theta, mpfr(mu_s)), peak, dps + 10
            )
            modes.append(mode)
            pulse = sections[begin:end]
            after = sections[end:following]
            monotone = mode == STICK_SLIP and not block.literal and not block.newmark
            governs = monotone and _eq4_below_yield(block, [(onset, peak)])
            validity |= YIELD_GOVERNS * governs
            validity |= _remarks(parameters.acceleration_ratio, False, governs, model, given)
            if mode == CONTINUOUS:
                _slide(block, pulse, after, following < len(sections), peak)
                continue
            _stick_and_slip(block, pulse)
            if block.sliding and block.b <= 0:
                return RecordSolution(
                    gmpy2.nan(), gmpy2.nan(), -1, -1, -1, validity | KD_NOT_POSITIVE
                )
            for section in after:
                block.take(section)
        if block.v != 0:
            block.brake(gmpy2.inf())
        validity |= UPSLOPE * bool(pulses and block.u < -block.rounding)
        counts = (modes.count(STICK_SLIP), modes.count(CONTINUOUS))
        return RecordSolution(block.u, block.peak, block.slips, *counts, validity)


def _stick_and_slip(block: Block, pulse: list[Section]) -> None:
    block.v = max(block.v, mpfr(0))
    block.sliding = block.v > 0
    block.reset = True
    for section in pulse:
        block.take(section)
    block.reset = True  # also where Üg only touches zero


def _slide(
    block: Block, pulse: list[Section], after: list[Section], another: bool, peak: mpfr
) -> None:
    """Slide through a continuous pulse and the negative half wave; `another` pulse may follow."""
    block.slips += block.v == 0
    bottom = 0
    while bottom < len(after) and after[bottom].side < 0:
        bottom += 1
    way_up = after[bottom:]
    at_once = another and all(
        half_wave.first >= 0 and half_wave.last > 0 and (i == 0 or half_wave.first > 0)
        for i, half_wave in enumerate(way_up)
    )
    for section in [*pulse, *after[: len(after) if at_once else bottom]]:
        block.follow(section)
    if not at_once:
        block.b = block.interface.eq4(peak)
        for section in way_up:
            block.brake(section.end - section.start)
    block.ground = (after or pulse)[-1].last
