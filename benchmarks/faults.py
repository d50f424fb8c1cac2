"""What a user meets, many times over: ``python -m benchmarks.faults`` writes results/faults.md.

The rounds are those of tests/support/fault_rounds.py; the first fault that is not survived ends it.
"""

import random
import tempfile
from pathlib import Path

from benchmarks import machine
from tests.support.fault_rounds import FAULTS, OUTPUTS, prepared

ROUNDS = 50


def main() -> None:
    """Do the rounds, and write the table."""
    options = machine.arguments(__doc__)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = prepared(folder)
        for number in range(1 if options.tiny else ROUNDS):
            for fault, tried in FAULTS.items():
                tried(folder, OUTPUTS[number % 2], whole, random.Random(number))
                print(number + 1, fault, flush=True)
            done = number + 1
            texts = {
                fault: getattr(tried, "func", tried).__doc__ or ""
                for fault, tried in FAULTS.items()
            }
            rows = [[fault, " ".join(text.split()), done, done] for fault, text in texts.items()]
            text = f"{machine.measured_on(('netCDF4', 'zarr', 'distributed'))}\n\n"
            text += machine.table(["fault", "what it is", "tried", "survived"], rows)
            (options.folder / "faults.md").write_text(text)


if __name__ == "__main__":
    main()
