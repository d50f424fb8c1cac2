"""Errors of two kinds, bad input and failed runs, a warning, and what to say of what is missing."""

import difflib
import importlib.util
from collections.abc import Sequence


class InputError(ValueError):
    """Bad input: the message names the parameter or key, its value and what is allowed.

    See Also
    --------
    RunError : a failure for another reason than the input

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.sweep(theta=95, mu_s=0.4, amplitude=3.0, frequency=1.0)
    Traceback (most recent call last):
    slipsweep.errors.InputError: theta = 95: must be 0 <= theta < 90 degrees
    """


class RunError(RuntimeError):
    """A run that failed for a reason outside its input (disk, memory, another process).

    See Also
    --------
    InputError : the input is at fault

    Examples
    --------
    The model has no value on a slope that is steeper than the friction angle:

    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/rock*_H1.AT2")
    >>> result = slipsweep.sweep(theta=30, mu_s=0.3, amplitude=[2.0, 4.0], excitation=suite)
    >>> curve = slipsweep.HazardCurve(amplitude=[1.0, 5.0], rate=[1e-2, 1e-4])
    >>> slipsweep.displacement_hazard(result, curve)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    slipsweep.errors.RunError: no annual rate: the model gives no value under any motion ...
    """


class RunWarning(UserWarning):
    """A circumstance outside the input that costs time or safety, and no result (disk, locks)."""


def check_extra(what: str, extra: str, *packages: str, otherwise: str = "") -> None:
    """Refuse what needs packages of an extra that are not installed (InputError).

    `otherwise` says what can be done instead.
    """
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"{what} needs {' and '.join(missing)}; "
            f"in the cloned repository: pip install '.[{extra}]'{otherwise}"
        )


def did_you_mean(word: str, names: Sequence[str]) -> str:
    """Suggest the nearest of some names, or tell all of them."""
    near = [name for name in names if len(word) > 3 and word in name]
    near = near or difflib.get_close_matches(word, names, n=1)
    quoted = " or ".join(f'"{name}"' for name in near)
    return f"did you mean {quoted}?" if near else f"known here: {', '.join(names)}"
