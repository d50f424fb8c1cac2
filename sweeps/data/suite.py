"""Make the files in suite/, a made-up suite of accelerograms: run ``python sweeps/data/suite.py``.

Four motions of two horizontal components each, as sums of cosines with random phases whose power
spectrum is that of Kanai and Tajimi (as ``synthetic.py`` beside this file), under an envelope that
rises as t², stays and decays.  Ground frequency, damping, duration, interval and peak differ from
motion to motion; the third has a velocity pulse, as motions near a fault have.  A straight line
under the envelope is taken off, so that each ends at rest, where it began. Nobody recorded them:
they are here to try the program with, not to design by.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SEED = 2012

#: Peak of the second component, in parts of the first one's.
SECOND = 0.8


@dataclass(frozen=True)
class Motion:
    """One motion: frequencies in Hz, times in s, accelerations in g."""

    name: str
    ground_frequency: float
    damping: float
    strong: float  # when the envelope begins to decay
    duration: float
    interval: float
    peak: float
    pulse: float = 0.0  # period of a velocity pulse


MOTIONS = (
    Motion("rock-near", 5.0, 0.5, 4.0, 8.0, 0.005, 0.45),
    Motion("rock-far", 3.5, 0.6, 8.0, 16.0, 0.01, 0.20),
    Motion("stiff-pulse", 2.5, 0.6, 6.0, 12.0, 0.01, 0.40, pulse=1.5),
    Motion("soft-far", 1.2, 0.4, 12.0, 24.0, 0.02, 0.25),
)

HEADER = """\
A synthetic accelerogram, made by suite.py beside this folder; in the public domain (CC0 1.0)
{name}, component {component}: nobody recorded it
ACCELERATION TIME HISTORY IN UNITS OF G
NPTS= {points:6d}, DT= {interval:7.4f} SEC
"""


def acceleration(motion: Motion, component: int) -> NDArray[np.float64]:
    """Return the accelerations of a component (0 or 1), g."""
    times = np.arange(round(motion.duration / motion.interval) + 1) * motion.interval
    frequencies = np.arange(1, 401) * 0.05 + 0.1
    ratio = (frequencies / motion.ground_frequency) ** 2
    soil = (1 + 4 * motion.damping**2 * ratio) / ((1 - ratio) ** 2 + 4 * motion.damping**2 * ratio)
    low = (frequencies / 0.25) ** 4 / (
        (1 - (frequencies / 0.25) ** 2) ** 2 + 4 * 0.6**2 * (frequencies / 0.25) ** 2
    )
    random = np.random.default_rng([SEED, MOTIONS.index(motion), component])
    angles = 2.0 * np.pi * frequencies[:, None] * times + random.uniform(
        0.0, 2.0 * np.pi, (frequencies.size, 1)
    )
    noise = (np.sqrt(soil * low)[:, None] * np.cos(angles)).sum(axis=0)
    decay = 3.0 / (motion.duration - motion.strong)
    envelope = np.minimum(times / 2.0, 1.0) ** 2 * np.exp(
        -decay * np.maximum(times - motion.strong, 0.0)
    )
    values = noise * envelope / np.abs(noise * envelope).max()
    if motion.pulse and component == 0:
        phase = np.clip((times - 0.5 * motion.strong) / motion.pulse, -1.0, 1.0)
        values = 0.6 * values + np.sin(np.pi * phase) * (1 + np.cos(np.pi * phase)) / 1.3
    # velocity and displacement at the end, by the trapezoidal rule and its integral, are those of
    # two such terms
    terms = np.array([envelope, envelope * (times / motion.duration - 0.5)])
    ends = np.array([_end(row, motion.interval) for row in (values, *terms)])
    values = values - np.linalg.solve(ends[1:].T, ends[0]) @ terms
    return values * motion.peak * (1.0, SECOND)[component] / np.abs(values).max()


def _end(values: NDArray[np.float64], interval: float) -> tuple[float, float]:
    """Velocity and displacement at the end of straight lines."""
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * interval)])
    moved = (velocity[:-1] + (values[:-1] / 3.0 + values[1:] / 6.0) * interval) * interval
    return float(velocity[-1]), float(moved.sum())


def texts() -> dict[str, str]:
    """Return the files, by their names."""
    found = {}
    for motion in MOTIONS:
        for component in (0, 1):
            values = acceleration(motion, component)
            header = HEADER.format(
                name=motion.name,
                component=component + 1,
                points=values.size,
                interval=motion.interval,
            )
            numbers = [f"{value:10.5f}".replace("-0.00000", " 0.00000") for value in values]
            rows = ("".join(numbers[at : at + 8]) + "\n" for at in range(0, values.size, 8))
            found[f"{motion.name}_H{component + 1}.AT2"] = header + "".join(rows)
    return found


if __name__ == "__main__":
    for name, text in texts().items():
        path = Path(__file__).with_name("suite") / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
