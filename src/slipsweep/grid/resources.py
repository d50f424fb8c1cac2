"""Free memory of the machine, and sizes in words."""

import re
from collections.abc import Mapping
from pathlib import Path

from slipsweep.errors import InputError


def check_memory(what: str, needed: int, advice: str) -> None:
    """Raise InputError, with the advice, if memory cannot hold the `needed` bytes of `what`."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return
    available = (line.split()[1] for line in lines if line.startswith("MemAvailable:"))
    free = int(next(available, needed)) * 1024
    if needed > free:
        raise InputError(
            f"{what}: takes {size_text(needed)}, but {size_text(free)} of memory is free; {advice}"
        )


def grid_text(sizes: Mapping[str, int]) -> str:
    """Return a grid in words, such as "2 theta x 10 amplitude"; without dimensions ""."""
    return " x ".join(f"{size} {dim}" for dim, size in sizes.items())


def size_text(size: float) -> str:
    """Return a number of bytes in words, such as "83 MB"."""
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size < 1000.0 or unit == "TB":
            return f"{size:.0f} {unit}" if unit == "bytes" else f"{size:.3g} {unit}"
        size /= 1000.0
    raise AssertionError


def parse_size(name: str, text: str) -> int:
    """Return the bytes of a text such as "512MiB" or "1.5 GB".

    InputError: it is not such a text; the message calls it `name`.
    """
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kKMGT])(i?)B?\s*", text)
    if match is None:
        raise InputError(f"{name} = {text}: must be a number with a unit, like 512MiB or 2GB")
    number, prefix, binary = match.groups()
    power = "KMGT".index(prefix.upper()) + 1
    return int(float(number) * (1024 if binary else 1000) ** power)
