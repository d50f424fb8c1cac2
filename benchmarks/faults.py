"""Faults tried and survived: ``python -m benchmarks.faults`` writes faults.md.

Does rounds of every kind in tests/support/fault_rounds.py; the first fault that is not survived ends it with
an error.  ``.ci/include-report`` puts the table into docs/large-sweeps.md.  Nothing is timed.
"""

import random
import tempfile
from pathlib import Path

from benchmarks.machine import arguments, measured_on, table
from tests.support.fault_rounds import FAULTS, can_be_done, damaged, damaged_store, rounds, run, values

#: Rounds of each kind; those in this process are cheap.
ROUNDS, CHEAP_ROUNDS = 10, 200


def main() -> None:
    """Do all rounds, write faults.md."""
    given = arguments(__doc__)
    seed = 1 if given.tiny else random.randrange(2**31)
    print(f"seed {seed}", flush=True)
    names = [name for name in FAULTS if FAULTS[name] in (damaged, damaged_store) or not given.tiny]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        place.chmod(0o755)  # for the faults done as another user
        run(place / "undisturbed.nc", chunk_cells=10**9)
        expected = values(place / "undisturbed.nc")
        for name in names:
            reason = can_be_done(name)
            count = (3 if given.tiny else CHEAP_ROUNDS) if FAULTS[name] in (damaged, damaged_store) else ROUNDS
            done = 0 if reason else rounds([name], place, seed, count, expected)[name]
            rows.append([name, str(done), str(done), reason or "–"])
            print(*rows[-1][:2], flush=True)
    total = sum(int(row[1]) for row in rows)
    rows.append(["all", str(total), str(total), ""])
    text = table(["fault", "tried", "survived", "why not here"], rows)
    head = f"{measured_on(('numpy', 'numba', 'netCDF4', 'distributed'))} Written by `python -m benchmarks.faults`.\n"
    (given.folder / "faults.md").write_text(f"{head}\n{text}")


if __name__ == "__main__":
    main()
