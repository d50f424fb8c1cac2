"""Odd and damaged input tried out: ``python -m benchmarks.hunt`` writes hunt.md.

Draws input of all kinds that tests/support/hunt.py knows and counts how it ends: accepted, or refused with one clear
message.  ``.ci/include-report`` puts the table into docs/files.md.  Nothing is timed; it ends with an error where
an input ends otherwise.
"""

import faulthandler
import random
import tempfile
import traceback
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as seeded
from hypothesis.errors import HypothesisException

from benchmarks.machine import arguments, measured_on, table
from tests.support.hunt import FOUND, KINDS, Kind, Sources

#: Inputs of a kind that are drawn together.
BATCH = 500

#: Seconds after which an input is taken to have no end.
LONGEST = 300

HEADER = ["input", "tried", "passed", "accepted", "refused"]


class Endings:
    """How the inputs of one kind ended, by part."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.counts: dict[str, Counter[str]] = {}
        self.faults: list[str] = []

    def try_out(self, kind: Kind, sources: Sources, value: object) -> None:
        """Try one input and count it."""
        part = f"{self.name} {kind.part(value)}" if kind.part else self.name
        faulthandler.dump_traceback_later(LONGEST, exit=True)
        try:
            ended = "accepted" if kind.trial(sources, value) else "refused"
        except HypothesisException:  # not one to be tried
            raise
        except Exception as error:
            ended = "fault"
            self.faults.append(f"{part}: {value!r}: {''.join(traceback.format_exception_only(error)).strip()}")
            print(self.faults[-1], flush=True)
            traceback.print_tb(error.__traceback__, limit=-3)
        finally:
            faulthandler.cancel_dump_traceback_later()
        self.counts.setdefault(part, Counter())[ended] += 1

    def rows(self) -> list[list[object]]:
        """A line a part."""
        rows: list[list[object]] = []
        for part, ended in sorted(self.counts.items()):
            passed = ended["accepted"] + ended["refused"]
            rows.append([part, ended.total(), passed, ended["accepted"], ended["refused"]])
        return rows


def draw(name: str, kind: Kind, sources: Sources, count: int, seed: int) -> Endings:
    """Draw inputs of a kind and try them out."""
    endings = Endings(name)
    for start in range(0, count, BATCH):

        @seeded(seed + start)
        @settings(
            max_examples=min(BATCH, count - start), deadline=None, database=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        @given(kind.drawn)
        def batch(value: object) -> None:
            endings.try_out(kind, sources, value)

        batch()
    print(
        f"{name}: {sum(ended.total() for ended in endings.counts.values())}, {len(endings.faults)} faults", flush=True
    )
    return endings


def main() -> None:
    """Draw, try out, write hunt.md."""
    wanted = arguments(__doc__, counts={"percent": 100, "seed": -1})
    seed = wanted.seed if wanted.seed >= 0 else random.randrange(2**31)
    print(f"seed {seed}", flush=True)
    rows: list[list[object]] = []
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        sources = Sources(Path(folder))
        for name, kind in KINDS.items():
            count = 2 if wanted.tiny else max(5, kind.count * wanted.percent // 100)
            endings = draw(name, kind, sources, count, seed)
            rows += endings.rows()
            faults += len(endings.faults)
    columns = list(zip(*rows, strict=True))
    rows.append(["all", *(sum(column) for column in columns[1:])])
    counted = table(HEADER, rows)
    print(counted)
    head = (
        f"{measured_on(('numpy', 'xarray', 'netCDF4', 'hypothesis'))} Written by `python -m benchmarks.hunt "
        f"--percent {wanted.percent} --seed {seed}`."
    )
    since = table(["input", "what was wrong"], [[found.kind.removesuffix(" of"), found.wrong] for found in FOUND])
    since = since.replace("---:", "---")
    text = f"{head}\n\n{counted}\nFound by such runs, corrected, and tried again by the tests:\n\n{since}"
    (wanted.folder / "hunt.md").write_text(text, encoding="utf-8")
    if faults:
        raise SystemExit(f"{faults} faults")


if __name__ == "__main__":
    main()
