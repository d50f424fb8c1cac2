"""Tests on a shaking table: measurements over time, with names and units from the header.

Offsets and drifts are subtracted from a channel only on request (`ShakingTest.corrected`).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.model.parameters import check_choice, check_finite, check_list, check_numbers, shown
from slipsweep.model.units import conversion
from slipsweep.model.variables import HISTORY
from slipsweep.motion.intensity import Floats
from slipsweep.motion.lines import read_columns, read_lines
from slipsweep.motion.reading import STANDARD_GRAVITY, UNITS
from slipsweep.motion.records import check_samples, missing_samples

#: Channels of the table and of the block.
TABLE = "ground_acceleration"
RESPONSES = ("block_acceleration", "relative_velocity", "relative_displacement")
CHANNELS = (TABLE, *RESPONSES)

#: Words in the name of a column that identify a channel: one word of each set.
_NAMES: dict[str, tuple[set[str], ...]] = {
    "time": ({"time", "t"},),
    TABLE: (
        {"table", "ground", "plane", "base", "input"},
        {"acceleration", "accelerations", "acc"},
    ),
    "block_acceleration": ({"block", "mass"}, {"acceleration", "accelerations", "acc"}),
    "relative_velocity": ({"relative", "rel", "sliding"}, {"velocity", "vel"}),
    "relative_displacement": ({"relative", "rel", "sliding"}, {"displacement", "disp"}),
}


@dataclass(frozen=True, eq=False)
class ShakingTest:
    """Measurements of a test on a shaking table.

    `times` (s) increase, at intervals that need not be equal.  `channels` are `ground_acceleration`
    (m/s², of the table), without a gap, and any of `block_acceleration` (m/s²), `relative_velocity`
    (m/s) and `relative_displacement` (m, downslope positive), NaN where there is no sample.
    `attrs` say how it was read.  InputError: fewer than 16 samples, times that do not increase, a
    channel that is not known, or a table's acceleration that is not finite.
    """

    times: Floats
    channels: Mapping[str, Floats]
    name: str = "test"
    attrs: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for channel in self.channels:
            check_choice(f"{self.name}: channel", channel, CHANNELS)
        if TABLE not in self.channels:
            raise InputError(
                f"{self.name}: {TABLE}: missing: the acceleration of the table must be measured"
            )
        times = check_numbers(f"{self.name}: time", self.times)
        kept = {
            name: check_numbers(f"{self.name}: {name}", self.channels[name])
            for name in (TABLE, *self.responses)
        }
        filled = {
            name: np.where(np.isnan(values) & (name != TABLE), 0.0, values)
            for name, values in kept.items()
        }
        # fewer samples do not determine three parameters and their noise
        check_samples(self.name, times, filled, least=16)
        for name, values in kept.items():
            if np.isnan(values).all():
                raise InputError(f"{self.name}: {name}: no sample")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "channels", kept)

    @property
    def responses(self) -> tuple[str, ...]:
        """Channels of the block that were measured."""
        return tuple(name for name in RESPONSES if name in self.channels)

    def corrected(
        self, offset: Any = (), drift: Any = (), rest: Sequence[float] | None = None
    ) -> tuple["ShakingTest", list[str]]:
        """Return the test less a constant (`offset`) or a line (`drift`) in channels, or "all".

        Constants and lines are fitted to the samples between the two times of `rest` (s), when the
        table and the block were at rest.  Without it they are fitted to all samples, which is right
        for accelerations of a motion that begins and ends at rest.  The second value has a text for
        each channel: the constant, at the first sample, and the slope.
        """
        offset = check_channels("offset", offset, self.channels)
        drift = check_channels("drift", drift, self.channels)
        chosen = np.ones(self.times.size, dtype=bool)
        within = ""
        if rest is not None:
            bounds = [check_finite("rest", time) for time in check_list("rest", rest, "two times")]
            if len(bounds) != 2:
                raise InputError(f"rest = {shown(rest)}: must be two times, s")
            chosen = (self.times >= bounds[0]) & (self.times <= bounds[1])
            within = f"rest = {shown(rest)}: "
        channels = dict(self.channels)
        removed = []
        since = self.times - self.times[0]
        for name in CHANNELS:
            if name not in (*offset, *drift):
                continue
            use = chosen & np.isfinite(channels[name])
            if use.sum() < 3:
                raise InputError(
                    f"{within}{name}: {use.sum()} samples to fit to: must be at least 3"
                )
            line = np.polynomial.Polynomial.fit(
                since[use], channels[name][use], 1 if name in drift else 0
            )
            channels[name] = channels[name] - line(since)
            constant = float(line(0.0))
            slope = float(line.deriv()(0.0))
            unit = HISTORY[name]["units"]
            removed.append(
                f"{name}: {constant:.4g} {unit}"
                + (f" and {slope:.4g} {unit} a second" if slope else "")
            )
        return replace(self, channels=channels), removed


def check_channels(key: str, channels: Any, measured: Collection[str]) -> tuple[str, ...]:
    """Return the channels that an option names: "all", one, or a list of them."""
    if isinstance(channels, str):
        channels = tuple(measured) if channels == "all" else (channels,)
    names = check_list(key, channels, "channels")
    for name in names:
        if not isinstance(name, str) or name not in measured:
            raise InputError(
                f"{key} = {shown(name)}: must be 'all', or of the channels measured: "
                f"{', '.join(measured)}"
            )
    return tuple(names)


def read_test(path: str | Path) -> ShakingTest:
    """Read a test from a CSV file whose header names columns and units (`read_columns`).

    An example is ``time (s), table acceleration (g), relative displacement (mm)``.  The unit "g" is
    standard gravity.  Columns of other names are left out.  InputError: the file cannot be read, a
    column has no unit, or a line holds no numbers.
    """
    path = Path(path)

    def channel_of(column: str, words: set[str], unit: str) -> tuple[str, float] | None:
        channel = next(
            (
                channel_name
                for channel_name, names in _NAMES.items()
                if all(words & either for either in names)
            ),
            None,
        )
        if channel and not unit:
            raise InputError(
                f"{path}: column {shown(column)}: must give its unit in brackets, such as (m/s2)"
            )
        return (
            (channel, unit_factor(f"{path}: column {column}: unit", channel, unit))
            if channel
            else None
        )

    digest, lines = read_lines(path)
    values = read_columns(
        path, lines, channel_of, {"time": "time (s)", TABLE: "table acceleration (m/s2)"}
    )
    if missing := "; ".join(missing_samples(values["time"], values[TABLE])):
        raise InputError(
            f"{path}: {TABLE}: {missing}: samples are missing; take the part of the test that has "
            "all"
        )
    attrs = {"test": path.name.encode(errors="backslashreplace").decode(), "test_sha256": digest}
    return ShakingTest(values.pop("time"), values, str(path), attrs)


def unit_factor(key: str, channel: str, unit: str) -> float:
    """Return the factor from a unit of a channel to the SI unit."""
    si_unit = "s" if channel == "time" else HISTORY[channel]["units"]
    return conversion(
        key, si_unit, unit.lower() if unit.lower() in UNITS else unit, STANDARD_GRAVITY
    )
