"""slipsweep as users start it: a process of its own."""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

SLIPSWEEP = (sys.executable, "-m", "slipsweep")

#: Long enough for kernels to be compiled on a busy machine.
TIMEOUT = 300


def slipsweep(
    folder: Path,
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    preexec_fn: Callable[[], object] | None = None,
) -> "subprocess.CompletedProcess[str]":
    """Run a command in `folder`, with `environment` on top of this process's own but for colours, and wait for it."""
    clean = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")}
    return subprocess.run(
        [*SLIPSWEEP, *map(str, arguments)],
        cwd=folder,
        env={**clean, **(environment or {})},
        capture_output=True,
        encoding="utf-8",
        timeout=TIMEOUT,
        check=False,
        preexec_fn=preexec_fn,
    )
