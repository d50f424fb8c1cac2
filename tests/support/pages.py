"""Pages of `slipsweep explore`: results to make them from, and what they hold."""

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
    """What a page says of itself, and its arrays."""
    found = re.search(
        r'<script type="application/json" id="meta">(.*?)</script>',
        page.read_text(encoding="utf-8"),
    )
    assert found
    meta = json.loads(found[1])
    arrays = {}
    for name, about in meta["arrays"].items():
        data = zlib.decompress(base64.b64decode(about["data"]))
        arrays[name] = np.frombuffer(data, "<" + about["dtype"]).reshape(about["shape"])
        if law := about.get(
            "law"
        ):  # displacements at the first value of this dimension give all others
            dims = [dim["name"] for dim in meta["dims"]]
            values = np.array(meta["dims"][dims.index(law["dim"])]["values"]) ** law["power"]
            arrays[name] = arrays[name] * values.reshape(
                [-1 if dim == law["dim"] else 1 for dim in dims]
            )
    return meta, arrays


def axes_of(meta: dict[str, Any]) -> dict[str, list[float]]:
    return {dim["name"]: dim["values"] for dim in meta["dims"]}


AXES: list[Any] = [[0, 5, 20], [0.3, 0.5], np.linspace(1, 12, 23), np.geomspace(0.2, 10, 18)]
