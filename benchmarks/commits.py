"""What solvers took from commit to commit: ``python -m benchmarks.commits`` writes commits.csv and commits.png.

The sources of some commits since `BASE` are laid out in a folder and run by this Python, a process for each, of one
thread.  In every round each does a task once, one after the other within a second: what slows the machine slows all.
A figure is the median over the rounds of the time over that of `BASE`, and says something on any machine.  A commit
that does not know what is asked for has no figure for it.
"""

import csv
import io
import math
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.machine import ROOT, arguments, measured_on

#: The version that goals of speed are stated against.
BASE = "0c4c6a1"

#: What is timed, by the names that `CHILD` knows.
TASKS = (
    "sine, displacement", "sine, all results", "cosine", "triangle", "square", "triangle with ramps", "three harmonics",
    "64 steps, rectangle", "64 steps, Simpson", "1024 steps, rectangle", "1024 steps, Simpson",
    "4096 steps, rectangle", "4096 steps, Simpson", "record, friction law", "record, Newmark", "limits",
)  # fmt: skip

#: Solves the tasks it is told, with the slipsweep that it finds, by whichever of its interfaces there is.
CHILD = """
import sys, time
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

def ramped():
    ramps = {"ramp_in": 2, "ramp_out": 2}
    return {"excitation": slipsweep.Triangle(**ramps)} if new else {"waveform": "triangle"} | ramps

def step(rule, count):
    if not new:
        return {"solver": "step", "rule": rule, "steps_per_cycle": count}
    return {"solver": slipsweep.Step(rule, count)}

def recorded(**options):
    given = grid(4000)
    given.pop("frequency")
    if new:
        return slipsweep.sweep(excitation=slipsweep.read_record(record), **given, **one, **options)
    scale = given.pop("amplitude") / 3.0
    return slipsweep.sweep_record(slipsweep.read_record(record), scale=scale, **given, **one, **options)

def limits():
    given = grid(200_000)
    given.pop("amplitude")
    return slipsweep.limit_amplitude(0.05, **given | {"frequency": np.geomspace(0.5, 10.0, 30)})

one = {"variables": ["permanent_displacement"]}
terms = {"amplitudes": (1.0, 0.6, 0.35), "multiples": (1, 2, 5), "phases": (0.0, 40.0, 100.0)}
tasks = {
    "sine, displacement": lambda: slipsweep.sweep(**grid(1_500_000), **one),
    "sine, all results": lambda: slipsweep.sweep(**grid(1_500_000)),
    "cosine": lambda: slipsweep.sweep(**grid(60_000), **wave("cosine"), **one),
    "triangle": lambda: slipsweep.sweep(**grid(60_000), **wave("triangle"), **one),
    "square": lambda: slipsweep.sweep(**grid(60_000), **wave("square"), **one),
    "triangle with ramps": lambda: slipsweep.sweep(**grid(20_000), **ramped(), **one),
    "three harmonics": lambda: slipsweep.sweep(**grid(10_000), **wave("harmonics", terms), **one),
    "64 steps, rectangle": lambda: slipsweep.sweep(**grid(60_000), **step("rectangle", 64), **one),
    "64 steps, Simpson": lambda: slipsweep.sweep(**grid(60_000), **step("simpson", 64), **one),
    "1024 steps, rectangle": lambda: slipsweep.sweep(**grid(20_000), **step("rectangle", 1024), **one),
    "1024 steps, Simpson": lambda: slipsweep.sweep(**grid(20_000), **step("simpson", 1024), **one),
    "4096 steps, rectangle": lambda: slipsweep.sweep(**grid(5_000), **step("rectangle", 4096), **one),
    "4096 steps, Simpson": lambda: slipsweep.sweep(**grid(5_000), **step("simpson", 4096), **one),
    "record, friction law": recorded,
    "record, Newmark": lambda: recorded(model="newmark"),
    "limits": limits,
}
for line in sys.stdin:
    start = time.process_time()
    try:
        tasks[line.strip()]()
        print(time.process_time() - start, flush=True)
    except Exception:
        print("nan", flush=True)
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


@contextmanager
def running(commits: list[str], many: float, code: str = CHILD) -> Iterator[dict[str, subprocess.Popen[str]]]:
    """A process for each of some commits that solves with its sources."""
    record = ROOT / "sweeps" / "data" / "synthetic.csv"
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        children = {}
        for commit in commits:
            folder = Path(name) / commit
            lay_out(commit, folder)
            # a folder of its own for compiled code: in a common one only that of the latest four versions is kept
            own = {"PYTHONPATH": f"{folder}/src", "NUMBA_CACHE_DIR": f"{folder}/cache", "NUMBA_NUM_THREADS": "1"}
            child = subprocess.Popen(
                [sys.executable, "-c", code, str(record), str(many)],
                cwd=folder, env=os.environ | own, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            children[commit] = stack.enter_context(child)
        yield children  # each ends when its input does


def ask(child: subprocess.Popen[str], task: str) -> None:
    """Have a task done."""
    assert child.stdin
    child.stdin.write(f"{task}\n")
    child.stdin.flush()


def answer(child: subprocess.Popen[str]) -> float:
    """What it took; NaN where it cannot be done."""
    assert child.stdout
    return float(child.stdout.readline())


def measured(commits: list[str], rounds: int, many: float) -> dict[str, dict[str, list[float]]]:
    """Seconds of every round by task and commit; a round before the others compiles, all commits at the same time."""
    found: dict[str, dict[str, list[float]]] = {task: {} for task in TASKS}
    with running(commits, many) as children:
        for task, taken in found.items():
            for child in children.values():
                ask(child, task)
            taken |= {commit: [] for commit, child in children.items() if math.isfinite(answer(child))}
            for _ in range(rounds):
                for commit, seconds in taken.items():
                    ask(children[commit], task)
                    seconds.append(answer(children[commit]))
    return found


def drawn(ratios: dict[str, dict[str, float]], commits: list[str], path: Path) -> None:
    """Time over that of `BASE` by task and commit, a panel a task: nothing to tell apart by colour."""
    figure, panels = plt.subplots(4, 4, figsize=(10.0, 9.0), sharex=True, sharey=True, layout="constrained")
    for panel, (task, found) in zip(panels.flat, ratios.items(), strict=True):
        places = [place for place, commit in enumerate(commits) if commit in found]
        values = [found[commit] for commit in commits if commit in found]
        panel.plot(places, values, "o-", color="black", markersize=3, linewidth=1)
        panel.axhline(1.0, color="0.6", linewidth=0.8, zorder=0)
        panel.set_yscale("log", base=2)
        panel.yaxis.set_major_formatter("{x:.3g}")
        panel.set_title(f"{task}: {values[-1]:.2f}" if values else task, fontsize=9, loc="left")
        panel.set_xticks(range(len(commits)), [commit[:7] for commit in commits], rotation=90, fontsize=7)
    figure.supylabel(f"processor time over that of {BASE}", fontsize=9)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Measure, write the table and draw it."""
    given = arguments(__doc__, counts={"commits": 10, "rounds": 15})
    commits = [git("rev-parse", "HEAD")] if given.tiny else some_commits(given.commits)
    found = measured(commits, 1, 1e-3) if given.tiny else measured(commits, given.rounds, 1.0)
    ratios = {
        task: {
            commit: statistics.median(a / b for a, b in zip(seconds, taken[commits[0]], strict=True))
            for commit, seconds in taken.items()
        }
        for task, taken in found.items()
    }
    with (given.folder / "commits.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {measured_on()}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["commit", "date", "task", "least_seconds", f"over_{BASE}"])
        for commit in commits:
            date = git("show", "-s", "--format=%cI", commit)
            for task, taken in found.items():
                if commit in taken:
                    rows.writerow([commit[:10], date, task, f"{min(taken[commit]):.4g}", f"{ratios[task][commit]:.3f}"])
    drawn(ratios, commits, given.folder / "commits.png")


if __name__ == "__main__":
    main()
