"""Make synthetic.csv, a made-up accelerogram: run ``python sweeps/data/synthetic.py``.

A sum of cosines with random phases (Shinozuka and Deodatis 1991, Appl. Mech. Rev. 44, 191-204)
whose power spectrum is that of Kanai and Tajimi, ground frequency 2.5 Hz and damping 0.6, less the
lowest frequencies as Clough and Penzien take them off; under an envelope that rises as t², stays
and decays (Jennings, Housner and Tsai 1968); scaled to a peak of 0.35 g.  No one recorded it: it is
here to try the program with, not to design by.
"""

from pathlib import Path

import numpy as np

INTERVAL = 0.01
DURATION = 20.0
PEAK = 0.35
GROUND_FREQUENCY = 2.5
DAMPING = 0.6
RISE = 2.0
STRONG = 8.0
SEED = 2012

HEADER = (
    "# A synthetic accelerogram, made by synthetic.py beside this file. Nobody recorded it.\n"
    "# Kanai-Tajimi spectrum (2.5 Hz, damping 0.6), random phases, "
    "20 s at 100 samples a second, peak 0.35 g.\n"
    "# In the public domain (CC0 1.0).\n"
    "time (s),acceleration (g)\n"
)


def acceleration() -> tuple[np.ndarray, np.ndarray]:
    """Return times, s, and accelerations, g."""
    times = np.arange(round(DURATION / INTERVAL) + 1) * INTERVAL
    frequencies = np.arange(1, 401) * 0.05 + 0.1
    ratio = (frequencies / GROUND_FREQUENCY) ** 2
    soil = (1 + 4 * DAMPING**2 * ratio) / ((1 - ratio) ** 2 + 4 * DAMPING**2 * ratio)
    low = (frequencies / 0.25) ** 4 / (
        (1 - (frequencies / 0.25) ** 2) ** 2 + 4 * 0.6**2 * (frequencies / 0.25) ** 2
    )
    phases = np.random.default_rng(SEED).uniform(0.0, 2.0 * np.pi, frequencies.size)
    angles = 2.0 * np.pi * frequencies[:, None] * times + phases[:, None]
    noise = (np.sqrt(soil * low)[:, None] * np.cos(angles)).sum(axis=0)
    envelope = np.minimum((times / RISE) ** 2, 1.0) * np.exp(
        -0.35 * np.maximum(times - STRONG, 0.0)
    )
    motion = noise * envelope
    return times, PEAK * motion / np.abs(motion).max()


def text() -> str:
    """Return the file."""
    rows = (
        f"{time:.2f},{round(value, 6) + 0.0:.6f}\n"
        for time, value in zip(*acceleration(), strict=True)
    )
    return HEADER + "".join(rows)


if __name__ == "__main__":
    Path(__file__).with_name("synthetic.csv").write_text(text(), encoding="utf-8")
