"""Waveforms that the user may choose for the base; `cutting` makes the pieces that solvers follow.

A waveform w(φ) has the period 2π and the peak max|w| = 1, so that the amplitude A stays the peak
ground acceleration; φ = ωt counts from the beginning of the shaking.  A ramp multiplies it by an
envelope that grows linearly from 0 over the first `ramp_in` cycles, and falls to 0 over the last
`ramp_out`; A is the peak without it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, option
from slipsweep.model.parameters import MOST_CYCLES, number_text


@dataclass(frozen=True)
class Waveform(Choice):
    """A waveform that is repeated for some cycles, with ramps; `Sine` describes the parameters."""

    cycles: int = option("cycles of shaking", 10, least=1, most=MOST_CYCLES)
    ramp_in: float = option("cycles over which the shaking grows", 0.0)
    ramp_out: float = option("cycles over which the shaking decreases", 0.0)

    def check(self) -> None:
        """Raise InputError if the ramps are longer than the shaking."""
        if self.ramp_in + self.ramp_out > self.cycles:
            ramps = number_text(self.ramp_in + self.ramp_out)
            raise InputError(
                f"ramp_in + ramp_out = {ramps}: must not exceed the {self.cycles} cycles of the "
                "shaking"
            )

    @property
    def plain(self) -> Self:
        """One cycle without ramps."""
        return replace(self, cycles=1, ramp_in=0.0, ramp_out=0.0)

    def __str__(self) -> str:
        """Return the words of captions: ``10 cycles of a triangle wave, ramp in 2 cycles``."""
        ramps_at = (("in", self.ramp_in), ("out", self.ramp_out))
        ramps = "".join(
            f", ramp {word} {number_text(ramp)} cycles" for word, ramp in ramps_at if ramp
        )
        return f"{self.cycles} cycle{'s' if self.cycles > 1 else ''} of a {self._words()}{ramps}"

    def _words(self) -> str:
        return f"{self.name} wave" if self.name in ("triangle", "square") else self.name


@dataclass(frozen=True)
class Sine(Waveform):
    """sin φ.

    Parameters
    ----------
    cycles : int
        Whole cycles of shaking, from rest; 10 by default.
    ramp_in, ramp_out : float
        Cycles at the beginning and at the end over which the shaking grows and fades linearly.

    Raises
    ------
    InputError
        A value that is not allowed; ramps longer than the shaking.

    See Also
    --------
    Cosine, Triangle, Square, Harmonics : the other waveforms
    Record, Suite : recorded motions

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Sine(cycles=5)
    Sine(cycles=5, ramp_in=0.0, ramp_out=0.0)
    """

    name: ClassVar[str] = "sine"


@dataclass(frozen=True)
class Cosine(Waveform):
    """cos φ: it starts at its peak, to which the base's acceleration jumps at t = 0.

    See Also
    --------
    Sine : the same parameters; starts at zero

    Examples
    --------
    >>> import slipsweep
    >>> print(slipsweep.Cosine(cycles=3))
    3 cycles of a cosine
    """

    name: ClassVar[str] = "cosine"


@dataclass(frozen=True)
class Triangle(Waveform):
    """Straight lines through 0, 1 at π/2, −1 at 3π/2, 0.

    See Also
    --------
    Sine : the same parameters; rounder

    Examples
    --------
    >>> import slipsweep
    >>> print(slipsweep.Triangle(ramp_in=2, ramp_out=2))
    10 cycles of a triangle wave, ramp in 2 cycles, ramp out 2 cycles
    """

    name: ClassVar[str] = "triangle"


@dataclass(frozen=True)
class Square(Waveform):
    """1 on (0, π), −1 on (π, 2π).

    See Also
    --------
    Sine : the same parameters; no jumps

    Examples
    --------
    >>> import slipsweep
    >>> print(slipsweep.Square(cycles=4))
    4 cycles of a square wave
    """

    name: ClassVar[str] = "square"


@dataclass(frozen=True)
class _Terms:  # a base class, as fields without a default must come first
    amplitudes: Sequence[float] = option("relative amplitudes of the harmonics")
    multiples: Sequence[int] = option(
        "multiples of the frequency of the harmonics", least=1, most=100
    )
    phases: Sequence[float] | None = option("phases of the harmonics, degrees", None)


@dataclass(frozen=True)
class Harmonics(Waveform, _Terms):
    """Σ aₖ sin(mₖφ + pₖ) over its own largest magnitude.

    Parameters
    ----------
    amplitudes : sequence of float
        aₖ; their scale does not matter.
    multiples : sequence of int
        mₖ, different from one another.
    phases : sequence of float, optional
        pₖ, degrees; 0 by default.
    cycles, ramp_in, ramp_out
        As those of `Sine`.

    Raises
    ------
    InputError
        A value that is not allowed; a sum that is 0.

    See Also
    --------
    Sine : a single term

    Examples
    --------
    >>> import slipsweep
    >>> print(slipsweep.Harmonics([1, 0.3], [1, 3]))
    10 cycles of a wave of harmonics 1:1:0, 0.3:3:0
    """

    name: ClassVar[str] = "harmonics"

    def check(self) -> None:
        """Raise InputError for lists of different lengths, repeated multiples, or a sum of 0."""
        super().check()
        count = len(self.amplitudes)
        if self.phases is None:
            object.__setattr__(self, "phases", (0.0,) * count)
        for key in ("multiples", "phases"):
            if len(getattr(self, key)) != count:
                raise InputError(
                    f"{key}: {len(getattr(self, key))} numbers; must be as many as amplitudes, "
                    f"{count}"
                )
        if len(set(self.multiples)) < count:
            raise InputError(f"multiples = {list(self.multiples)}: must not be repeated")
        # terms of different multiples cannot cancel: their sum is 0 only where all are
        if not any(self.amplitudes):
            raise InputError(
                f"amplitudes = {list(self.amplitudes)}: must not all be 0, and one at least"
            )

    def _words(self) -> str:
        assert self.phases is not None
        terms = zip(self.amplitudes, self.multiples, self.phases, strict=True)
        return f"wave of harmonics {', '.join(':'.join(map(number_text, term)) for term in terms)}"


#: The waveforms that a user may choose.
WAVEFORMS = Family[Waveform](
    "excitation", "waveform", (Sine, Cosine, Triangle, Square, Harmonics), "sine", "waveform"
)


def peak_acceleration(displacement_amplitude: Any, frequency: Any) -> Any:
    """Peak acceleration A = (2πf)² d, m/s², of a peak displacement d (m); numbers or arrays."""
    omega = 2.0 * math.pi * frequency
    return omega * omega * displacement_amplitude
