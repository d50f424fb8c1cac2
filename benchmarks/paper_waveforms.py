"""How far the shape of the shaking moves the paper's two experiments: ``python -m benchmarks.paper_waveforms``.

The paper gives the recorded peaks of its table's motion, not the motion.  Writes paper_waveforms.md and
paper_waveforms.png: displacement and peak velocity after five cycles of waves of those peaks, beside
what the axes of the paper's Figs. 8 and 9 hold.
"""

from typing import Any, NamedTuple

import numpy as np

import slipsweep
from benchmarks.machine import arguments, table
from slipsweep.motion.waveforms import Waveform


class Experiment(NamedTuple):
    """An experiment of the paper, and the ends of its figure's axes, mm and m/s."""

    name: str
    given: dict[str, Any]
    displacement: float
    velocity: float


#: Tables 1 and 2, λ and Δμ as printed; Figs. 9 and 8.
EXPERIMENTS = (
    Experiment(
        "stick–slip",
        {
            "theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "frequency": 1.8, "yield_acceleration": 0.59,
            "decay_rate": 2.70, "delta_mu": 0.09,
        },
        150.0, 0.20,
    ),
    Experiment(
        "continuous",
        {
            "theta": 6.0, "mu_s": 0.38, "amplitude": 5.10, "frequency": 3.5, "yield_acceleration": 0.08,
            "decay_rate": 2.30, "delta_mu": 0.11,
        },
        200.0, 0.40,
    ),
)  # fmt: skip

CYCLES = 5

#: Waves of the table, and their markers in the figure.
WAVES: dict[str, tuple[Waveform, str]] = {
    "sine": (slipsweep.Sine(CYCLES), "o"),
    "triangle": (slipsweep.Triangle(CYCLES), "^"),
    "square": (slipsweep.Square(CYCLES), "s"),
    "sine, ramps of 1 cycle": (slipsweep.Sine(CYCLES, ramp_in=1, ramp_out=1), "<"),
    "sine, ramps of 2 cycles": (slipsweep.Sine(CYCLES, ramp_in=2, ramp_out=2), ">"),
}

#: Third harmonic over the fundamental: above 0 it flattens the peaks, below it sharpens them.
SHARES = (-0.3, -0.2, -0.1, 0.1, 0.2, 0.3)


def with_third(share: float) -> Waveform:
    """A fundamental with a third harmonic in phase (`share` > 0) or in opposite phase."""
    if share == 0.0:
        return slipsweep.Sine(CYCLES)
    return slipsweep.Harmonics((1.0, abs(share)), (1, 3), (0.0, 0.0 if share > 0 else 180.0), cycles=CYCLES)


def response(experiment: Experiment, wave: Waveform) -> tuple[float, float]:
    """Permanent displacement, mm, and peak relative velocity, m/s."""
    result = slipsweep.sweep(**experiment.given, excitation=wave)
    return 1000.0 * result.permanent_displacement.item(), result.peak_relative_velocity.item()


def rows() -> list[list[str]]:
    """The table: a wave, then displacement (mm) and velocity (m/s) of both experiments."""
    waves = {name: wave for name, (wave, _) in WAVES.items()}
    waves |= {
        f"sine {'+' if share > 0 else '−'} {abs(share)} of the third harmonic": with_third(share) for share in SHARES
    }
    found = []
    for name, wave in waves.items():
        cells = [name]
        for experiment in EXPERIMENTS:
            displacement, velocity = response(experiment, wave)
            cells += [f"{displacement:.0f}".replace("-", "−"), f"{velocity:.3f}"]
        found.append(cells)
    limits = [text for e in EXPERIMENTS for text in (f"under {e.displacement:.0f}", f"under {e.velocity:.2f}")]
    return [*found, ["**the paper's axes**", *limits]]


HEADER = ["wave", "stick–slip, mm", "m/s", "continuous, mm", "m/s"]


def main() -> None:
    """Solve both experiments under every wave; write the table and the figure."""
    given = arguments(__doc__)

    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Rectangle

    figure, panels = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained", sharex=True, sharey=True)
    shares = np.linspace(-0.3, 0.3, 5 if given.tiny else 61)
    for axes, experiment in zip(panels, EXPERIMENTS, strict=True):
        room = Rectangle((0, 0), experiment.displacement, experiment.velocity, facecolor="0.88")
        room.set_label("within the axes of the paper's figure")
        axes.add_patch(room)
        curve = np.array([response(experiment, with_third(float(s))) for s in shares])
        axes.plot(*curve[shares <= 0].T, color="#0072b2", label="third harmonic, opposite phase, to 0.3")
        axes.plot(*curve[shares >= 0].T, color="#d55e00", label="third harmonic, in phase, to 0.3")
        for wave, marker in WAVES.values():
            point = response(experiment, wave)
            if point[0] > 0:  # the axes are logarithmic; the table has the others
                axes.plot(*point, marker, color="black", markerfacecolor="none")
        p = experiment.given
        title = f"{experiment.name}: {p['amplitude']:.2f} m/s², {p['frequency']} Hz, {CYCLES} cycles"
        axes.set(xscale="log", yscale="log", xlim=(40, 3000), ylim=(0.1, 2), title=title)
        axes.set(xlabel="permanent displacement (mm)", ylabel="peak relative velocity (m/s)")
        axes.label_outer()
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:.0e}"[0] in "25" else "")
    for name, (_, marker) in WAVES.items():
        panels[0].plot([], [], marker, color="black", markerfacecolor="none", label=name)
    panels[0].legend(frameon=False, fontsize="small", loc="upper left")
    figure.savefig(given.folder / "paper_waveforms.png", dpi=150)
    plt.close(figure)
    (given.folder / "paper_waveforms.md").write_text(
        "# The paper's experiments under other waves of the same peak\n\n"
        f"Permanent displacement and peak relative velocity after {CYCLES} cycles, with the λ and Δμ that the paper "
        "prints. Written by `python -m benchmarks.paper_waveforms`.\n\n" + table(HEADER, rows())
    )


if __name__ == "__main__":
    main()
