"""The reference cases of data/cases.csv, and how to ask `slipsweep.sweep` for many of them at once."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import pi, radians, tan
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


@dataclass(frozen=True)
class Case:
    """One line of cases.csv; the two results as printed, to 17 digits."""

    case: int
    category: str
    model: str
    rise: str
    recoupling: str
    theta: float
    mu_s: float
    amplitude: float
    frequency: float
    cycles: int
    given: tuple[tuple[str, float], ...]
    permanent_displacement: str
    peak_relative_velocity: str
    sliding_mode: int
    recoupled: bool
    eq4_below_yield: bool
    g: float = 9.81

    def __str__(self) -> str:
        return f"{self.case}-{self.category}-{self.model}"

    @property
    def options(self) -> dict[str, Any]:
        """Everything but the four parameters."""
        options = {"model": self.model, "rise": self.rise, "recoupling": self.recoupling}
        return {**options, "cycles": self.cycles, "g": self.g, **dict(self.given)}

    @property
    def displacement_scale(self) -> float:
        """A / omega**2, m."""
        return self.amplitude / (2 * pi * self.frequency) ** 2

    @property
    def velocity_scale(self) -> float:
        """A / omega, m/s."""
        return self.amplitude / (2 * pi * self.frequency)

    @property
    def uplift(self) -> bool:
        """Whether A tan(theta) >= g, where the model gives no value (cases.csv has one such line)."""
        return self.model == "mendez" and self.amplitude * tan(radians(self.theta)) >= self.g


def inputs_of(row: dict[str, str]) -> dict[str, Any]:
    """The fields of a `Case` that a line of a table of cases gives, but for the results."""
    return {
        "case": int(row["case"]),
        "category": row["category"],
        "model": row["model"],
        "rise": row["rise"],
        "recoupling": row["recoupling"],
        **{name: float(row[name]) for name in PARAMETERS},
        "cycles": int(row["cycles"]),
        "given": tuple((name, float(row[name])) for name in OPTIONAL_INPUTS if row[name]),
    }


def read_cases() -> list[Case]:
    """All cases of cases.csv."""
    with (DATA / "cases.csv").open(newline="") as file:
        return [
            Case(
                **inputs_of(row),
                permanent_displacement=row["permanent_displacement"],
                peak_relative_velocity=row["peak_relative_velocity"],
                sliding_mode=int(row["sliding_mode"]),
                recoupled=row["recoupled"] == "1",
                eq4_below_yield=row["eq4_below_yield"] == "1",
            )
            for row in csv.DictReader(file)
        ]


def choices(**given: Any) -> dict[str, Any]:
    """Arguments of `slipsweep.sweep` from options as tables of cases have them, each in a column of its own.

    A column that does not go with a row's model, waveform or solver is left out; where a row has
    no option of a model, a waveform or a solver, the function's own default stays.
    """
    harmonics = given.pop("harmonics", None)
    if isinstance(harmonics, str):
        terms = [(*map(float, term.split(":")), 0.0) for term in harmonics.split(",")]
        harmonics = {"amplitudes": [t[0] for t in terms], "multiples": [t[1] for t in terms]}
        harmonics["phases"] = [t[2] for t in terms]
    given |= harmonics or {}
    for family in (MODELS, WAVEFORMS, SOLVERS):
        if not given.keys() & {family.attribute, *family.options}:
            continue
        name = given.pop(family.attribute, family.default)
        options = {option: given.pop(option) for option in family.options if option in given}
        if name in family.names:
            known = {one.name for one in declared(family.called(name))}
            name = family.made(name, {key: value for key, value in options.items() if key in known})
        given.setdefault(family.keyword, name)  # a name of none is refused where it arrives
    return given


def groups(cases: Iterable[Case]) -> list[list[Case]]:
    """The cases in groups that one call of `sweep` can take: alike in options, cycles and inputs given."""

    def key(case: Case) -> tuple[object, ...]:
        return (case.model, case.rise, case.recoupling, case.cycles, case.g, tuple(name for name, _ in case.given))

    return [list(group) for _, group in groupby(sorted(cases, key=key), key)]


def solve(cases: Sequence[Case], **options: Any) -> dict[int, tuple[float, float, int, int]]:
    """Displacement, peak velocity, mode and validity of each case, by its number; few calls of `sweep`."""
    found: dict[int, tuple[float, float, int, int]] = {}
    for group in groups(cases):
        columns: dict[str, Any] = {
            name: xr.DataArray([getattr(case, name) for case in group], dims="case") for name in PARAMETERS
        }
        for name in OPTIONAL_INPUTS:
            if name in dict(group[0].given):
                columns[name] = xr.DataArray([dict(case.given)[name] for case in group], dims="case")
        first = group[0]
        result = slipsweep.sweep(
            **columns,
            **choices(
                cycles=first.cycles,
                model=first.model,
                rise=first.rise,
                recoupling=first.recoupling,
                g=first.g,
                **options,
            ),
        )
        names = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")
        rows = zip(*(result[name].values.tolist() for name in names), strict=True)
        found |= {case.case: row for case, row in zip(group, rows, strict=True)}
    return found
