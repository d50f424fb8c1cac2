"""What the model's numbers are worth: ``python -m benchmarks.model_trends``.

Writes experiments.md, the paper's two experiments under every choice of inputs that an engineer
has; sensitivity.md, how far each input moves them; and model_trends.md, how often the displacement
of a lined slope goes against what a block is expected to do.  ``.ci/include-report`` puts them into
README.md and docs/trust.md. Nothing is timed.
"""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import slipsweep
from benchmarks.machine import arguments, table
from slipsweep import SlidingMode, Validity
from slipsweep.model.variables import CAUTIONS

#: The paper's Tables 1 and 2: the table moved with the frequency and the amplitude, and what was
#: identified.
STICK_SLIP = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "frequency": 1.8}
CONTINUOUS = {"theta": 6.0, "mu_s": 0.38, "amplitude": 5.10, "frequency": 3.5}
MEASURED_YIELD = (0.59, 0.08)
PRINTED_DECAY = (2.70, 2.30)
PRINTED_DELTA_MU = (0.09, 0.11)
CYCLES = 5

#: Inputs, and what is given of each experiment under them.
_YIELD = {"yield_acceleration": MEASURED_YIELD}
_DECAY = {**_YIELD, "decay_rate": PRINTED_DECAY}
INPUTS: dict[str, tuple[dict[str, tuple[float, float]], Any]] = {
    "all estimated": ({}, "mendez"),
    "Üy measured, the others estimated": (_YIELD, "mendez"),
    "the same, recoupling by integration": (_YIELD, slipsweep.Mendez(recoupling="integrate")),
    "Üy measured, λ as printed": (_DECAY, "mendez"),
    "Üy measured, λ and Δμ as printed": ({**_DECAY, "delta_mu": PRINTED_DELTA_MU}, "mendez"),
    "Newmark's block, Üy measured": (_YIELD, "newmark"),
    "Newmark's block, Üy estimated": ({}, "newmark"),
}

#: A lined slope: inclinations in degrees, friction coefficients, amplitudes in m/s².
SLOPE: dict[str, NDArray[np.float64]] = {
    "theta": np.linspace(8, 14, 13),
    "mu_s": np.linspace(0.25, 0.45, 21),
    "amplitude": np.linspace(0.05, 1.2, 116) * slipsweep.Mendez().g,
}

#: Which way the displacement of a block is expected to go along each axis.
EXPECTED = {"amplitude": 1, "mu_s": -1, "theta": 1}

#: Models of the lined slope.
MODELS: dict[str, dict[str, Any]] = {
    "all estimated": {},
    "λ = 2.7": {"decay_rate": 2.7},
    "recoupling by integration": {"model": slipsweep.Mendez(recoupling="integrate")},
    "Newmark's block": {"model": "newmark"},
}

#: Differences of two results that are rounding.
_ROUNDING = 1e-9


def experiments() -> str:
    """Permanent displacement of both experiments under every choice of inputs, in millimetres."""
    rows: list[list[object]] = [["the published figures end at", "150", "200"]]
    for text, (values_of, model) in INPUTS.items():
        row: list[object] = [text]
        for which, cell in enumerate((STICK_SLIP, CONTINUOUS)):
            inputs = cell | {name: values[which] for name, values in values_of.items()}
            shaking = slipsweep.Sine(cycles=CYCLES)
            options: Any = inputs | {"excitation": shaking, "model": model}
            result = slipsweep.sweep(**options)
            about = []
            if (
                model != "newmark"
                and result.sliding_mode != (SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS)[which]
            ):
                about.append(
                    f"as {SlidingMode(result.sliding_mode.item()).name.lower().replace('_', '–')}"
                )
            if result.validity & Validity.NOT_RECOUPLED:
                about.append("still slides at the next pulse")
            value = f"{result.permanent_displacement.item() * 1000:.0f}"
            row.append(f"{value} ({', '.join(about)})" if about else value)
        rows.append(row)
    return table(["inputs", "stick–slip, mm", "continuous, mm"], rows)


def sensitivity() -> str:
    """Change of both experiments' permanent displacement as an input grows or falls by a tenth."""
    shaking = slipsweep.Sine(cycles=CYCLES)
    rows: list[list[object]] = []
    names = {"yield_acceleration": "Üy", "decay_rate": "λ", "delta_mu": "Δμ"}
    names |= {"mu_s": "μs", "theta": "θ", "amplitude": "A", "frequency": "f"}
    printed = {**_DECAY, "delta_mu": PRINTED_DELTA_MU}
    cells = [
        cell | {name: values[which] for name, values in printed.items()}
        for which, cell in enumerate((STICK_SLIP, CONTINUOUS))
    ]

    def displacement(cell: dict[str, float]) -> float:
        result = slipsweep.sweep(**cell, excitation=shaking)  # type: ignore[arg-type]
        return float(result.permanent_displacement)

    for name, symbol in names.items():
        row: list[object] = [symbol]
        for cell in cells:
            base = displacement(cell)
            row += [
                f"{displacement(cell | {name: cell[name] * by}) / base - 1:+.0%}"
                for by in (0.9, 1.1)
            ]
        rows.append(row)
    return table(["input", "stick–slip, −10 %", "+10 %", "continuous, −10 %", "+10 %"], rows)


def against(
    result: xr.Dataset, axis: str
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Steps along an axis: those between displacements, against the trend, and under a caution."""
    low = result.isel({axis: slice(None, -1)})
    high = result.isel({axis: slice(1, None)})
    before = low.permanent_displacement.values
    after = high.permanent_displacement.values
    there = np.isfinite(before) & np.isfinite(after) & ((before != 0) | (after != 0))
    with np.errstate(invalid="ignore"):
        change = EXPECTED[axis] * (after - before)
        wrong = there & (change < -_ROUNDING * np.maximum(np.abs(before), np.abs(after)))
    return there, wrong, ((low.validity.values | high.validity.values) & CAUTIONS) != 0


def trends(tiny: bool) -> str:
    """How often the displacement goes against what is expected, by model, axis and sliding mode."""
    grid: dict[str, Any] = {name: values[:: 8 if tiny else 1] for name, values in SLOPE.items()}
    rows: list[list[object]] = []
    for text, options in MODELS.items():
        result = slipsweep.sweep(
            **grid, frequency=1.0, excitation=slipsweep.Sine(cycles=15), **options
        )
        for mode in (SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS):
            row: list[object] = [text, mode.name.lower().replace("_", "–")]
            warned = total = 0
            for axis in EXPECTED:
                there, wrong, caution = against(result, axis)
                codes = result.sliding_mode
                both = [
                    codes.isel({axis: part}).values == mode
                    for part in (slice(None, -1), slice(1, None))
                ]
                inside = there & both[0] & both[1]
                row.append(f"{(wrong & inside).sum() / inside.sum():.0%}" if inside.any() else "")
                warned += int((wrong & inside & caution).sum())
                total += int((wrong & inside).sum())
            if any(row[2:]):
                rows.append([*row, f"{warned / total:.0%}" if total else ""])
    header = [
        "inputs",
        "mode",
        "falls with PGA",
        "rises with μs",
        "falls with θ",
        "of these, under a caution",
    ]
    return table(header, rows)


def main() -> None:
    """Solve, and write the tables."""
    options = arguments(__doc__)
    by = "Written by `python -m benchmarks.model_trends`.\n"
    (options.folder / "experiments.md").write_text(
        f"{experiments()}\nA sine of the printed amplitude, {CYCLES} cycles. "
        "Üy is the yield acceleration, at which sliding begins; λ and Δμ describe how friction "
        f"decays with stronger shaking. {by}",
        encoding="utf-8",
    )
    (options.folder / "sensitivity.md").write_text(
        f"{sensitivity()}\nWith Üy measured, λ and Δμ as printed, {CYCLES} cycles. {by}",
        encoding="utf-8",
    )
    cells = " × ".join(str(values.size) for values in SLOPE.values())
    (options.folder / "model_trends.md").write_text(
        f"{trends(options.tiny)}\nθ 8 to 14°, μs 0.25 to 0.45, PGA 0.05 to 1.2 g, 1 Hz, 15 cycles, "
        f"{cells} cells; shares of the steps from one point of the grid to the next. {by}",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
