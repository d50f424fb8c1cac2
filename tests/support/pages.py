"""Pages of `slipsweep explore`: results to make them from, and their contents."""

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.commands import command

#: Stuck, stick-slip, continuous, flagged and statically unstable cells.
SWEEP = """
axes.theta.values = [0, 5, 20]
axes.mu_s.values = [0.3, 0.5]
axes.amplitude = {start = 1, stop = 12, num = 23}
axes.frequency = {start = 0.2, stop = 10, num = 18, spacing = "log"}
excitation.cycles = 4
output.variables = ["permanent_displacement", "newmark_displacement", "sliding_mode", "validity"]
"""

SUITE = Path(__file__).parents[2] / "sweeps" / "data" / "suite"


def make(folder: Path, text: str) -> Path:
    """Run a sweep in `folder`."""
    (folder / "sweep.toml").write_text(text)
    done = command(folder, "run", "sweep.toml", "-o", "small.nc", "--quiet")
    assert done.returncode == 0, done.stderr
    return folder / "small.nc"


def contents(page: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the JSON of a page, and its arrays."""
    text = page.read_text(encoding="utf-8")
    element = re.search(r'<script type="application/json" id="meta">(.*?)</script>', text)
    assert element
    meta = json.loads(element[1])
    arrays = {}
    for name, packed in meta["arrays"].items():
        data = zlib.decompress(base64.b64decode(packed["data"]))
        values = np.frombuffer(data, "<" + packed["dtype"]).reshape(packed["shape"])
        # displacements at 1 of a dimension give all others
        law = packed.get("law")
        arrays[name] = values * _factors(meta, **law) if law else values
    return meta, arrays


def _factors(meta: dict[str, Any], dim: str, power: float) -> np.ndarray:
    """Powers of the values along a dimension, which broadcast over all."""
    factors = np.array(axes_of(meta)[dim]) ** power
    return factors.reshape([-1 if other == dim else 1 for other in axes_of(meta)])


def axes_of(meta: dict[str, Any]) -> dict[str, list[float]]:
    """Values along the dimensions of a page."""
    return {dim["name"]: dim["values"] for dim in meta["dims"]}


AXES: list[Any] = [[0, 5, 20], [0.3, 0.5], np.linspace(1, 12, 23), np.geomspace(0.2, 10, 18)]
