"""The reference cases of tests/data, and how to ask `slipsweep.sweep` for many of them at once."""

import csv
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from decimal import Decimal, localcontext
from itertools import groupby
from pathlib import Path
from typing import Any

import xarray as xr

import slipsweep
from slipsweep.model.choices import declared
from slipsweep.model.options import MODELS, SOLVERS
from slipsweep.motion.waveforms import WAVEFORMS

DATA = Path(__file__).parents[1] / "data"
OPTIONAL_INPUTS = ("yield_acceleration", "decay_rate", "delta_mu")
PARAMETERS = ("theta", "mu_s", "amplitude", "frequency")
OPTIONS = (
    "waveform",
    "harmonics",
    "ramp_in",
    "ramp_out",
    "cycles",
    "model",
    "rise",
    "recoupling",
    "g",
)

#: Displacement, peak velocity, mode and validity.
Found = tuple[float, float, int, int]


@dataclass(frozen=True, kw_only=True)
class Case:
    """Line of a table of tests/data.

    Results are text as printed, empty if there is no value; an input is None if it is not given.
    The bounds are of hard cases: how far the answer moves, in m and m/s, and the (mode, validity)
    within one ulp of it.
    """

    case: int
    category: str
    theta: float
    mu_s: float
    amplitude: float
    frequency: float = 1.0
    cycles: int
    yield_acceleration: float | None = None
    decay_rate: float | None = None
    delta_mu: float | None = None
    model: str
    rise: str
    recoupling: str
    g: float = 9.81
    waveform: str = "sine"
    harmonics: str = ""
    ramp_in: float = 0.0
    ramp_out: float = 0.0
    permanent_displacement: str = ""
    peak_relative_velocity: str = ""
    sliding_mode: int
    validity: int = 0
    recoupled: int = 0
    eq4_below_yield: int = 0
    displacement_bound: str = ""
    velocity_bound: str = ""
    outcomes: str = ""

    def __str__(self) -> str:
        return f"{self.case}-{self.category}-{self.waveform}-{self.model}"

    @property
    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of `reference.solve`; `choices` makes those of `sweep` of them."""
        inputs = {name: getattr(self, name) for name in PARAMETERS + OPTIONAL_INPUTS + OPTIONS}
        return {name: value for name, value in inputs.items() if value is not None}

    @property
    def displacement_scale(self) -> float:
        """A / omega**2, m."""
        return self.amplitude / (2 * math.pi * self.frequency) ** 2

    @property
    def velocity_scale(self) -> float:
        """A / omega, m/s."""
        return self.amplitude / (2 * math.pi * self.frequency)

    @property
    def uplift(self) -> bool:
        """True if A tan(theta) >= g: the model gives no value (cases.csv has one such line)."""
        return (
            self.model == "mendez" and self.amplitude * math.tan(math.radians(self.theta)) >= self.g
        )

    def missed(self, answer: Found, relative: float, absolute: float = 1e-12) -> str:
        """Return a message if u differs by more than relative |u| + absolute A/omega**2, else "".

        Likewise v, with A/omega.
        """
        for value, exact, scale in zip(
            answer,
            (self.permanent_displacement, self.peak_relative_velocity),
            (self.displacement_scale, self.velocity_scale),
            strict=False,
        ):
            if not abs(value - float(exact)) <= relative * abs(float(exact)) + absolute * scale:
                return f"case {self}: {value!r}, not {exact}"
        return ""

    def times_bounds(self, answer: Found) -> tuple[float, float]:
        """Errors of displacement and peak velocity in units of the conditioning bounds."""
        exact = (self.permanent_displacement, self.peak_relative_velocity)
        bounds = (self.displacement_bound, self.velocity_bound)
        one, other = (_times(*each) for each in zip(answer, exact, bounds, strict=False))
        return one, other


def _times(answer: float, exact: str, bound: str) -> float:
    """|answer − exact| / bound, infinite for NaN; in decimals, as each may be subnormal."""
    if not math.isfinite(answer):
        return math.inf
    with localcontext(prec=60):
        error = abs(Decimal(answer) - Decimal(exact))
        return float(error / Decimal(bound)) if error else 0.0


def read_cases(table: str = "cases") -> list[Case]:
    """All cases of cases.csv, hard_cases.csv or waveforms.csv."""
    types = {field.name: field.type for field in fields(Case)}
    with (DATA / f"{table}.csv").open(newline="") as file:
        return [
            Case(**{name: _value(types[name], text) for name, text in row.items() if text})
            for row in csv.DictReader(file)
        ]


def _value(kind: Any, text: str) -> Any:
    return int(text) if kind is int else text if kind is str else float(text)


def choices(**columns: Any) -> dict[str, Any]:
    """Arguments of `slipsweep.sweep` from options in the columns of a table of cases.
    A column that does not go with a row's model, waveform or solver is left out; where a row has
    no option of a model, a waveform or a solver, the function's own default stays.
    """
    harmonics = columns.pop("harmonics", None)
    if isinstance(harmonics, str) and harmonics:
        terms = [(*map(float, term.split(":")), 0.0) for term in harmonics.split(",")]
        harmonics = {"amplitudes": [t[0] for t in terms], "multiples": [t[1] for t in terms]}
        harmonics["phases"] = [t[2] for t in terms]
    columns |= dict(harmonics or {})
    for family in (MODELS, WAVEFORMS, SOLVERS):
        if not columns.keys() & {family.attribute, *family.options}:
            continue
        name = columns.pop(family.attribute, family.default)
        options = {option: columns.pop(option) for option in family.options if option in columns}
        if name in family.names:
            declared_names = {each.name for each in declared(family.called(name))}
            name = family.made(
                name, {key: value for key, value in options.items() if key in declared_names}
            )
        columns.setdefault(family.keyword, name)  # a name of none is refused where it arrives
    return columns


def solve(cases: Iterable[Case], **options: Any) -> dict[int, Found]:
    """The package's answer to each case, by its number; few calls of `sweep`."""

    def key(case: Case) -> tuple[Any, ...]:
        return (
            *(getattr(case, name) for name in OPTIONS),
            *(getattr(case, name) is None for name in OPTIONAL_INPUTS),
        )

    answers: dict[int, Found] = {}
    for _, alike in groupby(sorted(cases, key=key), key):
        group = list(alike)
        columns: dict[str, Any] = {
            name: xr.DataArray([getattr(case, name) for case in group], dims="case")
            for name in group[0].arguments.keys() - {*OPTIONS}
        }
        shared = {name: getattr(group[0], name) for name in OPTIONS}
        result = slipsweep.sweep(**choices(**columns, **shared | options))
        names = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")
        rows = zip(*(result[name].values.tolist() for name in names), strict=True)
        answers |= {case.case: row for case, row in zip(group, rows, strict=True)}
    return answers
