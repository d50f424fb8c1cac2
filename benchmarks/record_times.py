"""Time of a million analyses of recorded motions: ``python -m benchmarks.record_times``.

(ky, motion, scale) analyses of the ground motions that pySLAMMER ships, by slipsweep in one run, of
a block that slides downslope only and of one that slides both ways; the paper's law, and
pySLAMMER's loop, on a share of them.  Writes record_times.md.
"""

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.machine import arguments, measured_on, number, table
from benchmarks.records import motions
from slipsweep import Newmark, Record, Suite, sweep

#: How many analyses were done, and the processor time that they took, s.
Timed = tuple[int, float]


def axes(analyses: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return yield coefficients and scales for so many analyses of some motions."""
    each = max(round((analyses / count) ** 0.5), 1)
    return np.geomspace(0.02, 0.4, each), np.geomspace(0.3, 3.0, each)


def timed(analyses: int, suite: Suite, model: Any, block: Callable[[Any], dict[str, Any]]) -> Timed:
    """Sweep (ky, motion, scale); `block` gives the inputs of the block for yield coefficients."""
    coefficients, scales = axes(analyses, len(suite))
    start = time.process_time()
    result = sweep(**block(coefficients), excitation=suite, scale=scales, model=model)
    return result.permanent_displacement.size, time.process_time() - start


def pyslammer_timed(motions_by_name: dict[str, Any], analyses: int, share: int) -> Timed:
    """Time pySLAMMER's loop on a share of the analyses, each motion in turn."""
    from pyslammer import RigidAnalysis

    coefficients, scales = axes(analyses, len(motions_by_name))
    random = np.random.default_rng(1)
    every = list(motions_by_name.values())
    start = time.process_time()
    for index in range(share):
        motion = every[index % len(every)]
        RigidAnalysis(random.choice(coefficients), motion, scale_factor=random.choice(scales))
    return share, time.process_time() - start


def timing(motions_by_name: dict[str, Any], g: float, analyses: int, share: int) -> str:
    """Return the table of times."""
    records = tuple(
        Record.sampled(motion.accel * g, motion.dt) for motion in motions_by_name.values()
    )
    suite = Suite(records, tuple(motions_by_name))
    samples = float(np.mean([motion.accel.size for motion in motions_by_name.values()]))

    def newmark(coefficients: Any) -> dict[str, Any]:
        return {"yield_coefficient": coefficients}

    def level(coefficients: Any) -> dict[str, Any]:
        return {"yield_coefficient": coefficients, "theta": 0.0}

    def law(coefficients: Any) -> dict[str, Any]:
        return {"theta": 0.0, "mu_s": 0.3, "yield_acceleration": coefficients * g}

    runs: dict[str, tuple[Any, Callable[[Any], dict[str, Any]], int]] = {
        "slipsweep, Newmark": (Newmark(g=g), newmark, analyses),
        "slipsweep, Newmark, both ways": (Newmark(sliding="both", g=g), level, analyses),
        "slipsweep, the paper's law": ("mendez", law, analyses // 10),
    }
    for model, block, _ in runs.values():
        timed(1, suite, model, block)  # compiled, or loaded, before the clock starts
    pyslammer_timed(motions_by_name, analyses, 1)
    times = {
        name: timed(count, suite, model, block) for name, (model, block, count) in runs.items()
    }
    peers = [pyslammer_timed(motions_by_name, analyses, share) for _ in range(3)]
    times["pySLAMMER's loop"] = min(peers, key=lambda run: run[1])
    done, seconds = times["pySLAMMER's loop"]
    peer = seconds / done
    rows = []
    for name, (done, seconds) in times.items():
        each = seconds / done
        figures = [seconds, each, each / samples, peer / each]
        rows.append([name, done, *map(number, figures)])
    header = [
        "",
        "analyses",
        "seconds",
        "seconds an analysis",
        "seconds a sample",
        "times pySLAMMER's speed",
    ]
    return table(header, rows)


def main() -> None:
    """Measure, and write the page."""
    options = arguments(__doc__)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pySLAMMER's own
        from pyslammer.constants import G_EARTH

        motions_by_name = motions()
        if options.tiny:
            motions_by_name = dict(list(motions_by_name.items())[-2:-1])
        share = 2 if options.tiny else 4 * len(motions_by_name)
        times = timing(motions_by_name, G_EARTH, 100 if options.tiny else 1_000_000, share)
    (options.folder / "record_times.md").write_text(
        "# Time of (ky, motion, scale) analyses\n\n"
        f"{measured_on(('numpy', 'numba', 'pyslammer'))} "
        "Made by `python -m benchmarks.record_times`.\n\n"
        "Processor time of all threads together: core for core. The 18 motions that pySLAMMER\n"
        "ships, yield coefficients (0.02 to 0.4) and scales (0.3 to 3) span the grid, solved in\n"
        "one run. Both ways: on a level base. Seconds a sample count those of the motion, slid\n"
        "over or not.\n\n"
        f"{times}"
    )


if __name__ == "__main__":
    main()
