"""What compiling the kernels takes: each first use in a process of its own, with an empty cache.

``python -m benchmarks.compiling`` writes compiling.md and prints it.  Times are processor time, and
counted in those of `import numba, xarray` in the same process, so that they can be compared from
machine to machine.
"""

import json
import os
import subprocess
import sys
import tempfile

from benchmarks.machine import ROOT, arguments, measured_on, number, table

#: First uses, each after those before it in the same row.
USES: dict[str, list[str]] = {
    "Eqs. 7–11": ["parameters"],
    "a sine": ["sine"],
    "`slipsweep run` of the design chart": ["chart"],
    "another waveform": ["triangle"],
    "a record": ["record"],
    "a time history": ["history"],
    "a record, then its time history": ["record", "history of a record"],
    "a record, then a waveform, then a time history": ["record", "triangle", "history"],
    "Newmark's block under a record": ["newmark"],
    "Newmark's block both ways under a record": ["both ways"],
    "a sine by steps": ["steps"],
}

#: Is run in a process of its own; prints seconds of the import, of the uses, and counts.
_PROGRAM = """
import json, os, sys, tempfile, time
started = time.process_time()
import numba, xarray
imported = time.process_time() - started
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, found):
        compiled.append(found.data["dispatcher"])
    def on_end(self, found):
        pass
event.register("numba:compile", Listener())
import slipsweep
record = slipsweep.Record.sampled([0.0, 4.0, -4.0, 0.0], 0.1)
block = {"theta": 5.0, "mu_s": 0.38, "yield_acceleration": 0.59}
wave = {"amplitude": 3.55, "frequency": 1.8}
def run_chart():
    from slipsweep.cli import main
    sys.stdout = open(os.devnull, "w")
    sys.argv = ["slipsweep", "run", "sweeps/design_chart.toml", "-o", tempfile.mktemp(".nc")]
    try:
        main()
    except SystemExit:
        pass
    os.remove(sys.argv[-1])
    sys.stdout = sys.__stdout__
uses = {
    "chart": run_chart,
    "parameters": lambda: slipsweep.friction_parameters(5.0, 0.38, 3.55),
    "sine": lambda: slipsweep.sweep(**block, **wave),
    "triangle": lambda: slipsweep.sweep(**block, **wave, excitation="triangle"),
    "record": lambda: slipsweep.sweep(**block, excitation=record),
    "history": lambda: slipsweep.simulate(**block, **wave),
    "history of a record": lambda: slipsweep.simulate(**block, excitation=record),
    "newmark": lambda: slipsweep.sweep(**block, excitation=record, model="newmark"),
    "both ways": lambda: slipsweep.sweep(
        **block, excitation=record, model=slipsweep.Newmark(sliding="both")
    ),
    "steps": lambda: slipsweep.sweep(**block, **wave, solver="step"),
}
started = time.process_time()
for name in json.loads(sys.argv[1]):
    uses[name]()
used = time.process_time() - started
print(json.dumps([imported, used, len(set(compiled)), len(compiled)]))
"""


def first_use(names: list[str]) -> tuple[float, float, int, int]:
    """Return seconds of the import and of the uses, numbers of functions and compilations."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        words = [sys.executable, "-c", _PROGRAM, json.dumps(names)]
        process = subprocess.run(
            words, check=True, capture_output=True, text=True, env=environment, cwd=ROOT
        )
    imported, used, functions, compilations = json.loads(process.stdout)
    return imported, used, functions, compilations


def main() -> None:
    """Measure every first use, write and print compiling.md."""
    options = arguments(__doc__)
    rows = []
    for name, uses in list(USES.items())[: 1 if options.tiny else None]:
        imported, used, functions, compilations = first_use(uses)
        rows.append([name, number(used), number(used / imported, 2), functions, compilations])
    header = [
        "first use, empty cache",
        "s of processor time",
        "over `import numba, xarray`",
        "functions",
        "compilations",
    ]
    text = f"# Compiling\n\n{measured_on()}\n\n{table(header, rows)}"
    (options.folder / "compiling.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
