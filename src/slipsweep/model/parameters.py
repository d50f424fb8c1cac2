"""What a caller gives, checked: one clear message for the first thing that cannot be.

`sweep`, `friction_parameters`, `simulate` and the sweep-file schema share these bounds.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError


@dataclass(frozen=True)
class Bound:
    """An interval, and how to say it."""

    low: float
    includes_low: bool
    high: float
    text: str

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which values lie in the interval (NaN and infinity never do)."""
        above = values >= self.low if self.includes_low else values > self.low
        return np.asarray(above & (values < self.high))


_POSITIVE = Bound(0.0, False, math.inf, "a finite number > 0")
_NOT_NEGATIVE = Bound(0.0, True, math.inf, "a finite number >= 0")

#: What each parameter may be (MODEL: what no physics allows is an error, not a NaN).
BOUNDS: dict[str, Bound] = {
    "theta": Bound(0.0, True, 90.0, "0 <= theta < 90 degrees"),
    "mu_s": _POSITIVE,
    "amplitude": _NOT_NEGATIVE,
    "displacement_amplitude": _NOT_NEGATIVE,
    "frequency": _POSITIVE,
    "displacement": _POSITIVE,
    "maximum_amplitude": _POSITIVE,
    "yield_acceleration": Bound(-math.inf, False, math.inf, "a finite number"),
    "decay_rate": _NOT_NEGATIVE,
    "delta_mu": _NOT_NEGATIVE,
    "minimum_friction": _POSITIVE,
    "structure_frequency": _POSITIVE,
    "scale": _POSITIVE,
    "time_scale": _POSITIVE,
    "g": _POSITIVE,
    "quantile": Bound(0.0, False, 1.0, "a number between 0 and 1"),
    "threshold": _NOT_NEGATIVE,
}

MODELS = ("mendez", "newmark")
RISES = ("monotone", "literal")
RECOUPLINGS = ("eq12", "integrate")
WAVEFORMS = ("sine", "cosine", "triangle", "square", "harmonics")
SOLVERS = ("auto", "step", "cycle")
RULES = ("rectangle", "trapezoid", "simpson")

#: Steps a cycle when none are asked for: the trapezoid's median error is then 1e-5 (docs/speed.md).
STEPS_PER_CYCLE = 1024

#: More than any shaking has, or any accuracy needs; the kernels count in 64 bits.
MOST_CYCLES = 1_000_000_000
MOST_STEPS = 16_777_216


def number_text(value: float) -> str:
    """A number as people write it, and as precise as it is."""
    return repr(value).removesuffix(".0")


def check_values(name: str, values: Any, key: str | None = None) -> NDArray[np.float64]:
    """Return `values` as float64 if all are in the bounds of parameter `name`, called `key` in errors.

    Raises
    ------
    InputError
        Naming the parameter, the first value that is not allowed, and what is.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "iufb":
            raise TypeError
        array = array.astype(np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{key or name} = {values!r}: must be a number, or an array of numbers") from None
    bound = BOUNDS[name]
    wrong = ~bound.holds(array)
    if wrong.any():
        raise InputError(f"{key or name} = {number_text(float(array[wrong].flat[0]))}: must be {bound.text}")
    return array


def check_choice(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of `allowed`; InputError otherwise."""
    if value not in allowed:
        raise InputError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}")
    return str(value)


def check_whole(name: str, value: Any, least: int, most: int | None = None, multiple_of: int = 1) -> int:
    """Return `value` as an int if it is a whole number from `least` to `most`, and a multiple of `multiple_of`."""
    kind = "a whole number" if multiple_of == 1 else f"a multiple of {multiple_of}"
    try:
        if isinstance(value, (bool, str)) or float(value) != math.floor(float(value)):
            raise ValueError
        whole = int(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} = {value!r}: must be {kind} >= {least}") from None
    if whole < least or whole % multiple_of:
        raise InputError(f"{name} = {value!r}: must be {kind} >= {least}")
    if most is not None and whole > most:
        raise InputError(f"{name} = {value!r}: must be {kind} <= {most}")
    return whole
