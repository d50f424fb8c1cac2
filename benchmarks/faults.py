"""Faults tried and survived: ``python -m benchmarks.faults`` writes faults.md.

Does rounds of every kind in tests/support/fault_rounds.py; the first fault that is not survived ends it with
an error.  ``.ci/include-report`` puts the table into docs/large-sweeps.md.  Nothing is timed.
"""

import random
import tempfile
from pathlib import Path

from benchmarks.machine import arguments, measured_on, table
from tests.support.fault_rounds import FAULTS, OUTPUTS, can_be_done, damaged, rounds

#: Rounds of each kind; those in this process are cheap.
ROUNDS, CHEAP_ROUNDS = 10, 200


def main() -> None:
    """Do all rounds, write faults.md."""
    given = arguments(__doc__, counts={"rounds": ROUNDS})
    seed = 1 if given.tiny else random.randrange(2**31)
    print(f"seed {seed}", flush=True)
    names = [name for name in FAULTS if FAULTS[name] is damaged or not given.tiny]
    rows, total = [], dict.fromkeys(OUTPUTS, 0)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)  # for the faults done as another user
        for name in names:
            count = given.rounds if FAULTS[name] is not damaged else 1 if given.tiny else CHEAP_ROUNDS
            row, reason = [name], can_be_done(name)
            for kind, output in OUTPUTS.items():
                done = 0 if reason else rounds(name, Path(folder), seed, count, output)
                total[kind] += done
                row += [str(done), str(done)]
            rows.append([*row, reason or "–"])
            print(*rows[-1], flush=True)
    rows.append(["all", *(str(total[kind]) for kind in OUTPUTS for _ in range(2)), ""])
    header = ["fault", *(f"{kind}: {word}" for kind in OUTPUTS for word in ("tried", "survived")), "why not here"]
    head = (
        f"{measured_on(('numpy', 'numba', 'netCDF4', 'zarr', 'distributed'))} Written by `python -m benchmarks.faults`."
    )
    (given.folder / "faults.md").write_text(f"{head}\n\n{table(header, rows)}")


if __name__ == "__main__":
    main()
