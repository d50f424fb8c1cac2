"""Cases of every waveform in every regime, solved by `wave_reference`: data/waveforms.csv.

``python tests/support/wave_cases.py`` writes the file anew (ten minutes); the tests solve a part of it again.
"""

import csv
import math
import random
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from mpmath import nstr

from tests.support import wave_reference

PATH = Path(__file__).parents[1] / "data" / "waveforms.csv"
G = 9.81

#: Sums of harmonics: several maxima in a pulse, no symmetry, a peak below zero, a wave that starts above zero.
HARMONICS = (
    "1:1:0,0.6:5:0",
    "1:1:0,0.6:2:40,0.35:5:100",
    "1:1:0,0.7:2:270",
    "0.3:1:10,1:3:200,0.8:4:77",
    "1:1:90,0.4:3:90",
)
FAST = "1:1:0,0.15:50:13"
REGIMES = ("coulomb", "measured", "continuous", "newmark", "just_above_yield", "sharp_decay", "carried")


@dataclass(frozen=True)
class WaveCase:
    """One line of waveforms.csv, at 1 Hz; None stands for "by default"."""

    case: int
    regime: str
    waveform: str
    harmonics: str
    ramp_in: float
    ramp_out: float
    cycles: int
    model: str
    rise: str
    recoupling: str
    theta: float
    mu_s: float
    amplitude: float
    yield_acceleration: float | None
    decay_rate: float | None
    delta_mu: float | None
    permanent_displacement: str = ""
    peak_relative_velocity: str = ""
    sliding_mode: int = -1
    validity: int = 0

    def __str__(self) -> str:
        return f"{self.case}-{self.waveform}-{self.regime}"

    @property
    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of `slipsweep.sweep`."""
        given = {f.name: getattr(self, f.name) for f in fields(self)[2:16]}
        given = {name: value for name, value in given.items() if value not in (None, "")}
        return {**given, "frequency": 1.0}

    @property
    def displacement_scale(self) -> float:
        """A / omega**2, m."""
        return self.amplitude / (2 * math.pi) ** 2


def terms(harmonics: str) -> dict[str, list[float]] | None:
    """The columns of ``a:m:p,...``."""
    if not harmonics:
        return None
    rows = [[float(x) for x in term.split(":")] for term in harmonics.split(",")]
    return dict(zip(("amplitudes", "multiples", "phases"), map(list, zip(*rows, strict=True)), strict=True))


def solve(case: WaveCase) -> wave_reference.Solution:
    """The reference's answer."""
    return wave_reference.solve(**{**case.arguments, "harmonics": terms(case.harmonics)})


def drawn() -> Iterator[WaveCase]:
    """The cases, without their results."""
    number = 0
    waves = [("sine", ""), ("cosine", ""), ("triangle", ""), ("square", ""), *(("harmonics", h) for h in HARMONICS)]
    for seed in range(5):
        for waveform, harmonics in waves:
            for regime in REGIMES:
                number += 1
                yield _case(number, regime, waveform, harmonics, random.Random(1000 * seed + number), seed)
    for regime in REGIMES:
        number += 1
        yield _case(number, regime, "harmonics", FAST, random.Random(number), 0)


def _case(number: int, regime: str, waveform: str, harmonics: str, draw: random.Random, seed: int) -> WaveCase:
    ramps = (0.0, 0.0) if seed < 3 else (draw.choice([0.0, 0.5, 1.0, 1.3]), draw.choice([0.0, 0.25, 0.5, 1.7]))
    while True:
        theta, mu_s = draw.uniform(0, 25), draw.uniform(0.15, 0.9)
        tan = math.tan(math.radians(theta))
        onset = G * (mu_s - tan) / (1 + mu_s * tan)
        if onset <= 0.1:
            continue
        given: dict[str, Any] = {"yield_acceleration": None, "decay_rate": None, "delta_mu": None}
        if regime in ("measured", "sharp_decay", "carried"):
            onset *= draw.uniform(0.02 if regime == "carried" else 0.1, 0.9 if regime != "carried" else 0.2)
            given["yield_acceleration"] = onset
        limit = (onset + G * mu_s) / (1 - tan * (mu_s - tan))
        high = min(limit, 0.98 * G / max(tan, 1e-9), 0.98 * limit / math.sqrt(mu_s))
        amplitude = onset + draw.uniform(0.05, 0.95) * (high - onset)
        if regime == "continuous":
            amplitude = limit * draw.uniform(1.02, 2.0)
        if regime == "newmark":
            amplitude = onset * draw.uniform(1.1, 6.0)
        if regime == "just_above_yield":
            given["yield_acceleration"] = onset
            amplitude = onset * (1 + 10 ** draw.uniform(-9, -2))
        if regime == "sharp_decay":
            given["decay_rate"] = 10 ** draw.uniform(1, 4) * G / amplitude
            given["delta_mu"] = draw.uniform(0, 0.3)
            amplitude = draw.uniform(onset * 1.05, 1.5 * limit)
        if high <= onset or (regime != "newmark" and amplitude * tan >= G):
            continue
        return WaveCase(
            number, regime, waveform, harmonics, *ramps, draw.choice([3, 4]),
            "newmark" if regime == "newmark" else "mendez",
            "monotone" if regime == "newmark" else draw.choice(["monotone", "monotone", "literal"]),
            "eq12" if regime == "newmark" else draw.choice(["eq12", "eq12", "integrate"]),
            round(theta, 6), round(mu_s, 6), amplitude, **given,
        )  # fmt: skip


def read_wave_cases() -> list[WaveCase]:
    """All cases of waveforms.csv."""
    kinds: dict[str, Any] = {"case": int, "cycles": int, "sliding_mode": int, "validity": int}
    texts = {"regime", "waveform", "harmonics", "model", "rise", "recoupling"}
    texts |= {"permanent_displacement", "peak_relative_velocity"}
    with PATH.open(newline="") as file:
        rows = list(csv.DictReader(file))
    cases = []
    for row in rows:
        given: dict[str, Any] = {
            name: value if name in texts else None if value == "" else kinds.get(name, float)(value)
            for name, value in row.items()
        }
        cases.append(WaveCase(**given))
    return cases


def main() -> None:
    """Write waveforms.csv."""
    names = [f.name for f in fields(WaveCase)]
    with PATH.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        for case in drawn():
            found = solve(case)
            results = {
                "permanent_displacement": nstr(found.permanent_displacement, 20),
                "peak_relative_velocity": nstr(found.peak_relative_velocity, 20),
                "sliding_mode": found.sliding_mode,
                "validity": found.validity,
            }
            row = {**asdict(case), **results}
            writer.writerow({name: "" if value is None else value for name, value in row.items()})
            file.flush()


if __name__ == "__main__":
    main()
