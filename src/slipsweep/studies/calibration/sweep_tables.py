"""Tables of a sweep file from a calibration: [model], and [uncertainty] from standard errors."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from slipsweep.model import equations
from slipsweep.studies.calibration.estimate import Estimate
from slipsweep.studies.calibration.measured_friction import QUANTILE
from slipsweep.studies.calibration.observation import SOUGHT, Observation

#: Symbols and units of the parameters that are estimated.
SYMBOLS = ("Üy", "λ", "Δμ")
UNITS = (" m/s2", "", "")

#: Largest correlation in a table.  With rounding to four digits a matrix of correlations stays
#: positive.
_MOST_CORRELATION = 0.9998


def model_table(estimated: Estimate) -> str:
    """Return the [model] table, with intervals in comments."""
    model = estimated.solutions[0].observation.model
    lines = [
        "[model]",
        'friction = "mendez"',
        f'rise = "{model.rise}"',
        f'recoupling = "{model.recoupling}"',
    ]
    for at, name in enumerate(SOUGHT):
        low, high = estimated.intervals[at]
        about = "not determined"
        if estimated.determined[at]:
            about = f"95 %: {low:.4g} to {high:.4g}{UNITS[at]}"
        lines.append(f"{name} = {_number(estimated.parameters[at])}  # {about}")
    return "\n".join([*lines, f"g = {model.g:g}"]) + "\n"


def commented_out(estimated: Estimate, reasons: Sequence[str]) -> str:
    """Return the [model] table in comments, after the reasons why it is not ready for use."""
    lines = ["WARNING: not ready for use.", *reasons, "", *model_table(estimated).splitlines()]
    return "".join(f"# {line}".rstrip() + "\n" for line in lines)


def uncertainty_table(estimated: Estimate) -> str:
    """Return [uncertainty] tables from the covariance; "" if an error is not known.

    Distributions are normal, and cut off where no value is physical.
    """
    if not np.isfinite(estimated.errors).all():
        return ""
    lines = ["[uncertainty]"]
    most = _MOST_CORRELATION
    rounded = np.round(np.clip(estimated.correlation, -most, most), 4)
    if np.linalg.eigvalsh(rounded + np.diag([1.0 - most] * 3)).min() > 1e-6:
        pairs = [
            f'["{SOUGHT[i]}", "{SOUGHT[j]}", {rounded[i, j]:.4f}]'
            for i, j in ((0, 1), (0, 2), (1, 2))
        ]
        lines.append(f"correlation = [{', '.join(pairs)}]")
    for name, value, error in zip(SOUGHT, estimated.parameters, estimated.errors, strict=True):
        lines += _normal_distribution(name, value, error)
    return "\n".join(lines) + "\n"


def newmark_tables(observation: Observation, coefficients: xr.Dataset) -> tuple[str, str]:
    """Return both tables for a block of constant friction, which is Newmark's."""
    kinetic = coefficients["kinetic_friction"].item()
    lower, upper = coefficients["kinetic_friction_interval"].values
    g = observation.model.g
    tan_theta = math.tan(math.radians(observation.theta))
    low, value, high = (
        equations.coulomb_yield_acceleration(friction, tan_theta, g)
        for friction in (lower, kinetic, upper)
    )
    model = (
        "# A block of constant friction: Newmark's model, with the kinetic coefficient "
        f"{kinetic:.4g} at {observation.theta:g} deg.\n"
        '[model]\nfriction = "newmark"\n'
        f"yield_acceleration = {_number(value)}  # 95 %: {low:.4g} to {high:.4g} m/s2\n"
        f"g = {g:g}\n"
    )
    error = max((high - low) / (2.0 * QUANTILE), 1e-6 * value)
    lines = _normal_distribution("yield_acceleration", value, error)
    return model, "\n".join(["[uncertainty]", *lines]) + "\n"


def sweep_file_text(model: str, uncertainty: str) -> str:
    """Return both tables for one file: what [uncertainty] draws is a comment in [model]."""
    if not uncertainty:
        return model
    drawn = tuple(f"{name} = " for name in SOUGHT if f"[uncertainty.{name}]" in uncertainty)
    lines = [
        f"# {line}; without [uncertainty]" if line.startswith(drawn) else line
        for line in model.splitlines()
    ]
    return "\n".join(lines) + "\n\n" + uncertainty


def _normal_distribution(name: str, value: float, error: float) -> list[str]:
    """Return the lines of a normal distribution, cut off at 0 if 0 is within 6 standard errors."""
    low = math.ceil(-1e4 * value / error) / 1e4
    kind = ['distribution = "norm"']
    if low > -6.0:
        kind = ['distribution = "truncnorm"', f"a = {low + 0.0:.4f}", "b = 8.0"]
    return ["", f"[uncertainty.{name}]", *kind, f"loc = {_number(value)}", f"scale = {error:.4g}"]


def _number(value: float) -> str:
    """Return a number as TOML reads a float."""
    text = f"{value:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"
