"""Decimal digits for gmpy2, which counts bits: MPFR is ten times as fast as mpmath."""

from collections.abc import Iterator
from contextlib import contextmanager

import gmpy2
import mpmath
from gmpy2 import mpfr

_BITS_A_DIGIT = 3.3219280948873626


@contextmanager
def workdps(digits: int) -> Iterator[None]:
    """Compute with so many digits."""
    with gmpy2.context(precision=round((digits + 1) * _BITS_A_DIGIT), trap_divzero=True):
        yield


def decimals() -> int:
    """The digits computed with."""
    bits: int = gmpy2.get_context().precision
    return round(bits / _BITS_A_DIGIT) - 1


def epsilon() -> mpfr:
    """From 1 to the next number."""
    return gmpy2.next_above(mpfr(1)) - 1


def shown(value: mpfr, digits: int) -> str:
    """A number in so many digits, as mpmath writes it."""
    with mpmath.workdps(2 * digits):
        return str(mpmath.nstr(mpmath.mpf(str(value)), digits))
