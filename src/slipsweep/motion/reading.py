"""How a file of a recorded motion is read, as a user chooses it (`records` reads it)."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from slipsweep.model.choices import Choice, option


@dataclass(frozen=True)
class Reading(Choice):
    """How a file of a record is read."""

    name: ClassVar[str] = "reading"
    units: Literal["m/s2", "g", "cm/s2", "gal"] | None = option(
        "unit of the file's accelerations, if it does not name it", None
    )
    baseline: Literal["none", "mean", "linear"] = option("what is subtracted from the accelerations", "none")
    format: Literal["auto", "csv", "at2", "esm", "cosmos"] = option("format of the file", "auto")
    channel: int | None = option("channel of acceleration in a COSMOS file that holds several, from 1", None, least=1)
