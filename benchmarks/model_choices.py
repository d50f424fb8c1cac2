"""How far the model's own choices move the answer: ``python -m benchmarks.model_choices``.

Writes model_choices.png and model_choices.md: permanent displacement under each rise and
recoupling option, and of Newmark's block, over that of the default, on the grid of the
design chart.
"""

from typing import Any

import numpy as np

import slipsweep
from benchmarks.grids import design_grid
from benchmarks.machine import arguments, number, table
from slipsweep import SlidingMode, Validity

CHOICES: dict[str, dict[str, Any]] = {
    "literal rise": {"model": slipsweep.Mendez(rise="literal")},
    "recoupling by integration": {"model": slipsweep.Mendez(recoupling="integrate")},
    "literal rise and integration": {"model": slipsweep.Mendez(rise="literal", recoupling="integrate")},
    "Newmark's block": {"model": "newmark"},
}
COLOURS = {SlidingMode.STICK_SLIP: "#1f77b4", SlidingMode.CONTINUOUS: "#d62728"}


def main() -> None:
    """Solve the grid under every choice, write the figure and the table."""
    given = arguments(__doc__)
    grid = design_grid(*((4, 4, 8) if given.tiny else (21, 15, 136)))
    default = slipsweep.sweep(
        **grid, variables=["permanent_displacement", "sliding_mode", "validity", "yield_acceleration"]
    )
    mode = default.sliding_mode.values
    over_yield = (default.amplitude / default.yield_acceleration).transpose(*default.sliding_mode.dims).values
    base = default.permanent_displacement.values

    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10, 7), sharex=True, sharey=True, layout="constrained")
    rows = []
    ratios = {}
    for (name, options), axis in zip(CHOICES.items(), axes.flat, strict=True):
        found = slipsweep.sweep(**grid, **options, variables=["permanent_displacement"]).permanent_displacement.values
        ratios[name] = found / np.where(base > 0, base, np.nan)
        for sliding, colour in COLOURS.items():
            inside = (mode == sliding) & (base > 0)
            ratio = ratios[name][inside]
            lost = np.isnan(ratio)
            label = sliding.name.lower().replace("_", "–")
            axis.plot(
                over_yield[inside], np.clip(ratio, 1e-3, 1e3), ".", ms=1.5, color=colour, label=label, rasterized=True
            )
            low, middle, high = np.percentile(ratio[~lost], (5, 50, 95)) if (~lost).any() else (np.nan,) * 3
            same = np.mean(np.abs(ratio[~lost] - 1) < 1e-12) if (~lost).any() else np.nan
            rows.append([name, label, number(low), number(middle), number(high), f"{same:.0%}", f"{lost.mean():.0%}"])
        axis.axhline(1.0, color="black", lw=0.7)
        axis.set(xscale="log", yscale="log", title=name)
    for axis in axes[1]:
        axis.set_xlabel("peak ground over yield acceleration")
    for axis in axes[:, 0]:
        axis.set_ylabel("displacement over the default's")
    axes[0, 0].legend(markerscale=8, frameon=False)
    figure.savefig(given.folder / "model_choices.png", dpi=150)
    plt.close(figure)

    slides = mode == SlidingMode.STICK_SLIP
    governed = slides & (default.validity.values & Validity.YIELD_GOVERNS > 0)
    carried = slides & (default.validity.values & Validity.NOT_RECOUPLED > 0)

    newmark, integrated = "Newmark's block", "recoupling by integration"

    def spread(name: str, inside: np.ndarray, share: float) -> str:
        low, high = np.nanpercentile(ratios[name][inside], (share, 100 - share)) if inside.any() else (np.nan, np.nan)
        return f"between {number(low)} and {number(high)} of the default"

    header = ["choice", "mode of the default", "5 %", "median", "95 %", "unchanged", "no value"]
    (given.folder / "model_choices.md").write_text(
        f"# Choices of the model\n\nPermanent displacement over that of the default (monotone rise, Eq. 12), over "
        f"{base.size:,} cells of the design chart, ten cycles. Written by `python -m benchmarks.model_choices`.\n\n"
        f"{table(header, rows)}\nIn {governed.sum() / slides.sum():.0%} of the stick–slip cells Eq. 4 is below the "
        f"yield acceleration over the whole rise: there 90 % of Newmark's blocks move "
        f"{spread(newmark, governed, 5)}, elsewhere {spread(newmark, slides & ~governed, 5)}. "
        f"{carried.sum() / slides.sum():.1%} do not re-stick before the next pulse: recoupling by integration moves "
        f"them {spread(integrated, carried, 0)}, the others "
        f"{spread(integrated, slides & ~carried, 0)}.\n"
    )


if __name__ == "__main__":
    main()
