"""What each waveform costs: ``python -m benchmarks.waveforms`` writes results/waveforms.md.

The cycle solver on one grid under every waveform, in turns; seconds of processor, since all cores work.
``.ci/include-report`` puts the table into docs/waveforms.md.
"""

import time
from typing import Any

import numpy as np

import slipsweep
from benchmarks.machine import arguments, measured_on, number, table
from slipsweep.model.variables import DEFAULT_RESULTS
from slipsweep.motion.waveforms import Waveform

WAVES: dict[str, Waveform] = {
    "sine": slipsweep.Sine(),
    "cosine": slipsweep.Cosine(),
    "square": slipsweep.Square(),
    "triangle": slipsweep.Triangle(),
    "triangle, ramps of 2 cycles at both ends": slipsweep.Triangle(ramp_in=2, ramp_out=2),
    "harmonics, one of multiple 1": slipsweep.Harmonics((1.0,), (1,)),
    "harmonics, multiples 1, 2 and 5": slipsweep.Harmonics((1.0, 0.6, 0.35), (1, 2, 5), (0.0, 40.0, 100.0)),
    "harmonics, multiples 1 and 50": slipsweep.Harmonics((1.0, 0.15), (1, 50)),
}

#: What is asked for: the displacement alone, and all that a sweep gives by default.
ASKED = {"displacement alone": ["permanent_displacement"], "all four results": list(DEFAULT_RESULTS)}


def seconds(**given: Any) -> float:
    """Processor time of a sweep."""
    started = time.process_time()
    slipsweep.sweep(**given)
    return time.process_time() - started


def main() -> None:
    """Write the table."""
    given = arguments(__doc__)
    size, repeats = ((3, 4, 5), 1) if given.tiny else ((40, 40, 160), 3)
    grid: dict[str, Any] = {
        "theta": np.linspace(0, 20, size[0]),
        "mu_s": np.linspace(0.2, 0.8, size[1]),
        "amplitude": np.linspace(0.5, 12, size[2]),
        "frequency": 1.0,
    }
    least: dict[tuple[str, str], float] = {}
    for repeat in range(repeats + 1):  # the first compiles
        for wave, excitation in WAVES.items():
            for asked, variables in ASKED.items():
                # the first of two finds caches full of another kernel
                taken = min(seconds(excitation=excitation, variables=variables, **grid) for _ in range(2))
                if repeat:
                    least[wave, asked] = min(taken, least.get((wave, asked), np.inf))
    cells = np.prod(size)

    def cell(wave: str, asked: str) -> str:
        return f"{number(1e6 * least[wave, asked] / cells)} ({number(least[wave, asked] / least['sine', asked], 2)})"

    rows = [[wave, *(cell(wave, asked) for asked in ASKED)] for wave in WAVES]
    (given.folder / "waveforms.md").write_text(
        f"{table(['waveform', *(f'{asked}, µs' for asked in ASKED)], rows)}\n"
        f"Processor time a cell of the cycle solver, in brackets over the sine's: ten cycles, a grid of {size[0]} θ × "
        f"{size[1]} μs × {size[2]} amplitudes with stuck, stick–slip and continuous cells, one frequency (more are "
        f"free), the least of {repeats} turns of two. {measured_on()} Written by `python -m benchmarks.waveforms`.\n"
    )


if __name__ == "__main__":
    main()
