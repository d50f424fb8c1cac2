"""Options for reading recorded motions; without NumPy, which the help of commands need not load."""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

from slipsweep.model.choices import Choice, option

#: Standard gravity, m/s²: the unit "g" of a record, whatever gravity a sweep has.
STANDARD_GRAVITY = 9.80665

#: Units of a recorded acceleration, in m/s².
UNITS: dict[str, float] = {"m/s2": 1.0, "g": STANDARD_GRAVITY, "cm/s2": 0.01, "gal": 0.01}

Unit: TypeAlias = Literal["m/s2", "g", "cm/s2", "gal"]
Baseline: TypeAlias = Literal["none", "mean", "linear"]
Gaps: TypeAlias = Literal["refuse", "linear"]
Implausible: TypeAlias = Literal["refuse", "accept"]
Format: TypeAlias = Literal[
    "auto", "csv", "columns", "values", "at2", "esm", "cosmos", "knet", "asa"
]
Vertical: TypeAlias = Literal["leave_out", "accept"]


@dataclass(frozen=True)
class Reading(Choice):
    """Options for reading the file of a record."""

    name: ClassVar[str] = "reading"
    units: Unit | None = option("unit of the file's accelerations, if it does not name it", None)
    interval: float | None = option("sampling interval of a file without times, s", None)
    baseline: Baseline = option("what is subtracted from the accelerations", "none")
    gaps: Gaps = option("missing samples and fill values: refused, or interpolated", "refuse")
    implausible: Implausible = option(
        "peak above 3 g or below 0.001 g, drift of metres: refused or accepted", "refuse"
    )
    format: Format = option("format of the file", "auto")
    channel: int | None = option(
        "channel of acceleration in a file that holds several, from 1", None, least=1
    )
