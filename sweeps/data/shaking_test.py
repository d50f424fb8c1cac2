"""Make shaking_test.csv, a made-up test on a shaking table.

Run ``python sweeps/data/shaking_test.py``.

A block on a plane of 5 degrees (static friction 0.38) in stick-slip: what `slipsweep.simulate`
gives for Üy = 1.8 m/s², λ = 2 and Δμ = 0.1 under eight cycles of 2 Hz and 5 m/s², between rests of
half a second, 200 times a second; with white noise of 2 % of each channel's peak, and as a
converter of 12 bits gives it.  Nobody measured it: it is here to try calibration with.
"""

from pathlib import Path

import numpy as np

import slipsweep

RATE = 200
REST = 0.5
CYCLES = 8
FREQUENCY = 2.0
NOISE = 0.02
BITS = 12
SEED = 2012
COLUMNS = {
    "ground_acceleration": ("table acceleration (g)", 9.80665),
    "block_acceleration": ("block acceleration (g)", 9.80665),
    "relative_velocity": ("relative velocity (m/s)", 1.0),
    "relative_displacement": ("relative displacement (mm)", 0.001),
}

HEADER = """\
# A synthetic test on a shaking table, made by shaking_test.py beside this file. Nobody measured it.
# In the public domain (CC0 1.0).
"""


def text() -> str:
    """Return the file."""
    times = np.arange(round((2 * REST + CYCLES / FREQUENCY) * RATE) + 1) / RATE
    moving = times >= REST
    history = slipsweep.simulate(
        5.0,
        0.38,
        5.0,
        FREQUENCY,
        yield_acceleration=1.8,
        decay_rate=2.0,
        delta_mu=0.1,
        excitation=slipsweep.Sine(cycles=CYCLES),
        times=times[moving] - REST,
    )
    generator = np.random.default_rng(SEED)
    columns = [times]
    for name in COLUMNS:
        values = np.zeros(times.size)
        values[moving] = history[name].values
        peak = np.abs(values).max()
        step = 2.5 * peak / 2**BITS
        columns.append(
            np.round((values + NOISE * peak * generator.standard_normal(times.size)) / step) * step
        )
    scales = [1.0, *(scale for _, scale in COLUMNS.values())]
    names = ",".join(["time (s)", *(name for name, _ in COLUMNS.values())])
    rows = zip(
        *(values / scale for values, scale in zip(columns, scales, strict=True)), strict=True
    )
    lines = (
        ",".join([f"{row[0]:.3f}", *(f"{value + 0.0:.5g}" for value in row[1:])]) + "\n"
        for row in rows
    )
    return f"{HEADER}{names}\n" + "".join(lines)


if __name__ == "__main__":
    Path(__file__).with_name("shaking_test.csv").write_text(text(), encoding="utf-8")
