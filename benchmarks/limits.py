"""Limit amplitudes held to dense scans: ``python -m benchmarks.limits`` writes limits.md.

Draws blocks and tolerable displacements, and compares each limit with the first of many amplitudes,
in equal ratios from Üy on, at which a sweep gives as much.  A limit that lies higher was missed;
one that lies lower is a peak between two of the many.  ``.ci/include-report`` puts the table into
docs/limit.md.  Nothing is timed; it ends with an error where a sweep gives less than the
displacement at a limit, or as much just below.
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

import slipsweep
from benchmarks.machine import ROOT, arguments, measured_on, number, table
from tests.support.cases import choices
from tests.support.strategies import G

#: Blocks drawn of each kind, blocks compared together, and amplitudes of the dense scan.
BLOCKS = 1500
TOGETHER = 50
AMPLITUDES = 16_384

#: Where the search ends, and between which values a measured Üy is drawn, m/s².
HIGHEST = 5.0 * G
_MEASURED = (0.05, 3.0)

#: Limits that differ by less than this part are the same.
_SAME = 1e-9


@dataclass(frozen=True)
class Group:
    """Blocks of one kind that are compared together, along `block`, and what they share."""

    blocks: dict[str, xr.DataArray]
    displacement: xr.DataArray
    options: dict[str, Any]

    def text(self, block: int) -> str:
        """One of the blocks."""
        inputs = {**self.blocks, "displacement": self.displacement}
        return (
            ", ".join(f"{name}={float(values[block])!r}" for name, values in inputs.items())
            + f", {self.options}"
        )


def _along_blocks(values: np.ndarray) -> xr.DataArray:
    return xr.DataArray(values, dims="block")


def _group(
    rng: np.random.Generator,
    count: int,
    options: dict[str, Any],
    yields: tuple[float, float] | None,
) -> Group:
    blocks = {"theta": rng.uniform(0.0, 25.0, count), "mu_s": rng.uniform(0.1, 1.3, count)}
    if yields is not None:
        blocks["yield_acceleration"] = np.exp(
            rng.uniform(np.log(yields[0]), np.log(yields[1]), count)
        )
    displacement = 10.0 ** rng.uniform(-4.0, np.log10(30.0), count)
    return Group(
        {name: _along_blocks(values) for name, values in blocks.items()},
        _along_blocks(displacement),
        options,
    )


def _rules(rng: np.random.Generator) -> dict[str, Any]:
    rise = rng.choice(["monotone", "literal"])
    recoupling = rng.choice(["eq12", "integrate"])
    return {"rise": str(rise), "recoupling": str(recoupling)}


def any_wave(rng: np.random.Generator, count: int) -> Group:
    """Any rise, recoupling and waveform; a measured Üy in half of the groups."""
    waves = (
        slipsweep.Sine(),
        slipsweep.Cosine(),
        slipsweep.Square(),
        slipsweep.Triangle(),
        slipsweep.Harmonics((1.0, 0.6, 0.35), (1, 2, 5), (0.0, 40.0, 100.0)),
    )
    options = _rules(rng) | {"excitation": waves[rng.integers(len(waves))]}
    return _group(rng, count, options, _MEASURED if rng.random() < 0.5 else None)


def motion(rng: np.random.Generator, count: int) -> Group:
    """Motions of the sample suite, one for each group; up to 1 m."""
    files = sorted((ROOT / "sweeps" / "data" / "suite").glob("*.AT2"))
    record = slipsweep.read_record(files[rng.integers(len(files))])
    group = _group(
        rng, count, _rules(rng) | {"excitation": record}, _MEASURED if rng.random() < 0.5 else None
    )
    return replace(group, displacement=group.displacement / 30.0)


KINDS = {
    "sine, Üy by Coulomb": lambda rng, count: _group(rng, count, {}, None),
    # with these blocks often do not re-stick
    "sine, Üy between 0.05 and 3 m/s²": lambda rng, count: _group(rng, count, {}, _MEASURED),
    "any rise, recoupling and waveform": any_wave,
    "motions of the sample suite, any rise and recoupling": motion,
}


def ratios(group: Group, amplitudes: int) -> Iterator[float]:
    """Each limit over that of the dense scan; NaN if neither has one, ∞ or 0 if one has none.
    Raises
    ------
    RuntimeError
        A sweep gives less than the displacement at a limit, or as much just below.
    """
    shaking = (
        {} if isinstance(group.options.get("excitation"), slipsweep.Record) else {"frequency": 1.0}
    )
    inputs = {**group.blocks, **shaking, **choices(**group.options)}
    limits = slipsweep.limit_amplitude(
        group.displacement, **inputs, maximum_amplitude=HIGHEST
    ).limit_amplitude.values

    def reaches(amplitude: np.ndarray) -> np.ndarray:
        axis = xr.DataArray(amplitude, dims=("block", "step")[: amplitude.ndim])
        moved = slipsweep.sweep(
            **inputs, amplitude=axis, variables=["permanent_displacement"]
        ).permanent_displacement
        return np.asarray((moved >= group.displacement).transpose(*axis.dims).values)

    has = np.isfinite(limits)
    at = np.where(has, limits, HIGHEST)
    below = np.where(has, np.nextafter(limits, 0.0), HIGHEST)
    if not (reaches(at)[has].all() and not reaches(below)[has].any()):
        raise RuntimeError("a sweep does not give the displacement from the limit on")
    options: dict[str, Any] = {**group.blocks, "variables": ["yield_acceleration"]}
    start = slipsweep.sweep(**options, amplitude=HIGHEST, frequency=1.0).yield_acceleration.values
    start = np.where(start > 0.0, np.minimum(start, HIGHEST), HIGHEST)
    dense = start[:, None] * (HIGHEST / start[:, None]) ** np.linspace(0.0, 1.0, amplitudes)
    dense[:, -1] = HIGHEST
    reached = reaches(dense)
    first = reached.argmax(axis=1)
    for block in range(limits.size):
        if not reached[block].any():
            yield 0.0 if has[block] else np.nan
        elif not has[block]:
            yield np.inf
        else:
            low = dense[block, max(first[block] - 1, 0)]
            high = dense[block, first[block]]
            # the dense scan tells the limit to one of its steps only
            yield (
                1.0
                if low * (1.0 - _SAME) <= limits[block] <= high * (1.0 + _SAME)
                else float(limits[block] / high)
            )


HEADER = [
    "blocks",
    "limits",
    "the same",
    "lower, where the dense scan misses a peak",
    "higher",
    "worst ratio",
]


def main() -> None:
    """Draw, compare, write limits.md."""
    options = arguments(__doc__, counts={"blocks": BLOCKS, "seed": -1})
    seed = options.seed if options.seed >= 0 else random.randrange(2**31)
    blocks, amplitudes = (4, 64) if options.tiny else (options.blocks, AMPLITUDES)
    rows: list[list[object]] = []
    for place, (kind, drawn) in enumerate(KINDS.items()):
        rng = np.random.default_rng([seed, place])
        values: list[float] = []
        while len(values) < blocks:
            group = drawn(rng, min(TOGETHER, blocks - len(values)))
            for block, ratio in enumerate(ratios(group, amplitudes)):
                values.append(ratio)
                if ratio > 1.0:
                    print(f"{kind}: {ratio:.6g} times, {group.text(block)}", flush=True)
        limits = [ratio for ratio in values if not np.isnan(ratio)]
        above = [ratio for ratio in limits if ratio > 1.0]
        rows.append(
            [
                kind,
                len(limits),
                sum(ratio == 1.0 for ratio in limits),
                sum(ratio < 1.0 for ratio in limits),
                len(above),
                number(max(above, default=1.0)),
            ]
        )
        print(*rows[-1], sep=", ", flush=True)
    (options.folder / "limits.md").write_text(
        f"{table(HEADER, rows)}\n"
        f"{blocks:,} blocks of each kind, most with a limit, against {amplitudes:,} amplitudes; "
        f"the worst ratio is that of a higher limit. {measured_on(('numpy', 'numba'))} "
        f"Written by `python -m benchmarks.limits --blocks {blocks} --seed {seed}`.\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
