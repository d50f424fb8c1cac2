"""What solvers took from commit to commit: ``python -m benchmarks.commits`` writes commits.csv and commits.png.

The sources of some commits since `BASE` are laid out in a folder and run in turn by this Python: one process a commit
and round, one thread, the least of three calls, and the least of all rounds.  Figures are over those of `BASE`, and say
something on any machine.  A commit that does not know what is asked for has no figure for it.
"""

import csv
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.machine import ROOT, arguments, measured_on

#: The version that goals of speed are stated against.
BASE = "0c4c6a1"

#: Solves every task with the slipsweep that it finds, by whichever of its interfaces there is.
CHILD = """
import json, sys, time
import numpy as np
import slipsweep

new, record, many = hasattr(slipsweep, "Sine"), sys.argv[1], float(sys.argv[2])

def grid(cells):
    side = max(2, round((many * cells / 8) ** (1 / 3)))
    return {"theta": np.linspace(0.0, 20.0, side), "mu_s": np.linspace(0.2, 0.9, side),
            "amplitude": 9.81 * np.linspace(0.05, 1.4, 8 * side), "frequency": 1.0}

def wave(name, harmonics=None):
    if not new:
        return {"waveform": name} | ({"harmonics": harmonics} if harmonics else {})
    return {"excitation": slipsweep.Harmonics(*harmonics.values()) if harmonics else name}

def step(rule):
    if not new:
        return {"solver": "step", "rule": rule, "steps_per_cycle": 1024}
    return {"solver": slipsweep.Step(rule, 1024)}

def recorded(**options):
    given = grid(4000)
    given.pop("frequency")
    if new:
        return slipsweep.sweep(excitation=slipsweep.read_record(record), **given, **one, **options)
    scale = given.pop("amplitude") / 3.0
    return slipsweep.sweep_record(slipsweep.read_record(record), scale=scale, **given, **one, **options)

one = {"variables": ["permanent_displacement"]}
terms = {"amplitudes": (1.0, 0.6, 0.35), "multiples": (1, 2, 5), "phases": (0.0, 40.0, 100.0)}
tasks = {
    "sine, displacement": lambda: slipsweep.sweep(**grid(1_500_000), **one),
    "sine, all results": lambda: slipsweep.sweep(**grid(1_500_000)),
    "cosine": lambda: slipsweep.sweep(**grid(60_000), **wave("cosine"), **one),
    "triangle": lambda: slipsweep.sweep(**grid(60_000), **wave("triangle"), **one),
    "three harmonics": lambda: slipsweep.sweep(**grid(10_000), **wave("harmonics", terms), **one),
    "step, rectangle": lambda: slipsweep.sweep(**grid(20_000), **step("rectangle"), **one),
    "step, Simpson": lambda: slipsweep.sweep(**grid(20_000), **step("simpson"), **one),
    "record, friction law": recorded,
    "record, Newmark": lambda: recorded(model="newmark"),
}
seconds = {}
for name, task in tasks.items():
    try:
        task()
    except Exception:
        continue
    taken = []
    for _ in range(3):
        start = time.process_time()
        task()
        taken.append(time.process_time() - start)
    seconds[name] = min(taken)
print(json.dumps(seconds))
"""


def git(*words: str) -> str:
    """What git says."""
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def some_commits(count: int) -> list[str]:
    """`BASE`, the newest commit, and others between them, as far apart from each other."""
    after = git("rev-list", "--reverse", f"{BASE}..HEAD").split()
    places = {round((k + 1) * len(after) / (count - 1)) - 1 for k in range(count - 1)}
    return [git("rev-parse", BASE), *(after[place] for place in sorted(places))]


def lay_out(commit: str, folder: Path) -> None:
    """The sources of a commit."""
    archive = subprocess.run(["git", "archive", commit, "src"], cwd=ROOT, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(folder, filter="data")


def seconds_of(folder: Path, many: float) -> dict[str, float]:
    """What every task takes with the sources in a folder."""
    record = ROOT / "sweeps" / "data" / "synthetic.csv"
    # a folder of its own for compiled code: in a common one only that of the latest four versions is kept
    own = {"PYTHONPATH": str(folder / "src"), "NUMBA_CACHE_DIR": str(folder / "cache"), "NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(record), str(many)],
        cwd=folder, env=os.environ | own, check=True, capture_output=True, text=True,
    )  # fmt: skip
    found: dict[str, float] = json.loads(done.stdout)
    return found


def measured(commits: list[str], rounds: int, many: float) -> dict[str, dict[str, float]]:
    """Seconds by commit and task; a round before the others compiles."""
    least: dict[str, dict[str, float]] = {commit: {} for commit in commits}
    with tempfile.TemporaryDirectory() as name:
        folders = {commit: Path(name) / commit for commit in commits}
        for commit, folder in folders.items():
            lay_out(commit, folder)
            seconds_of(folder, 1e-3)
        for _ in range(rounds):
            for commit, folder in folders.items():
                for task, seconds in seconds_of(folder, many).items():
                    least[commit][task] = min(seconds, least[commit].get(task, seconds))
    return least


def drawn(ratios: dict[str, dict[str, float]], path: Path) -> None:
    """Time over that of `BASE`, a panel a task: nothing to tell apart by colour."""
    tasks = list(dict.fromkeys(task for found in ratios.values() for task in found))
    figure, panels = plt.subplots(3, 3, figsize=(9.0, 6.5), sharex=True, sharey=True, layout="constrained")
    for panel, task in zip(panels.flat, tasks, strict=False):
        places = [place for place, found in enumerate(ratios.values()) if task in found]
        values = [found[task] for found in ratios.values() if task in found]
        panel.plot(places, values, "o-", color="black", markersize=3, linewidth=1)
        panel.axhline(1.0, color="0.6", linewidth=0.8, zorder=0)
        panel.set_yscale("log", base=2)
        panel.yaxis.set_major_formatter("{x:.3g}")
        panel.set_title(f"{task}: {values[-1]:.2f}" if values else task, fontsize=9, loc="left")
        panel.set_xticks(range(len(ratios)), [commit[:7] for commit in ratios], rotation=90, fontsize=7)
    for panel in list(panels.flat)[len(tasks) :]:
        panel.set_visible(False)
    figure.supylabel(f"processor time over that of {BASE}", fontsize=9)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Measure, write the table and draw it."""
    given = arguments(__doc__, counts={"commits": 10, "rounds": 3})
    commits = [git("rev-parse", "HEAD")] if given.tiny else some_commits(given.commits)
    found = measured(commits, 1, 1e-3) if given.tiny else measured(commits, given.rounds, 1.0)
    base = next(iter(found.values()))
    ratios = {
        commit: {task: value / base[task] for task, value in taken.items() if task in base}
        for commit, taken in found.items()
    }
    with (given.folder / "commits.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {measured_on()}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["commit", "date", "task", "seconds", f"over_{BASE}"])
        for commit, taken in found.items():
            date = git("show", "-s", "--format=%cI", commit)
            rows.writerows([commit[:10], date, task, f"{s:.4g}", f"{s / base[task]:.3f}"] for task, s in taken.items())
    drawn(ratios, given.folder / "commits.png")


if __name__ == "__main__":
    main()
