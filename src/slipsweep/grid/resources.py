"""What the machine has left, and how to say sizes."""

import re
from collections.abc import Mapping
from pathlib import Path

from slipsweep.errors import InputError


def check_memory(what: str, needed: int, advice: str) -> None:
    """Refuse what memory cannot hold, before any of it is taken; InputError: what takes how much, and the advice."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return
    free = (
        int(next((line.split()[1] for line in lines if line.startswith("MemAvailable:")), needed))
        * 1024
    )
    if needed > free:
        raise InputError(
            f"{what}: takes {size_text(needed)}, but {size_text(free)} of memory is free; {advice}"
        )


def grid_text(sizes: Mapping[str, int]) -> str:
    """A grid in words, such as "2 theta x 10 amplitude"; nothing of one without dimensions."""
    return " x ".join(f"{size} {dim}" for dim, size in sizes.items())


def size_text(size: float) -> str:
    """Bytes as people write them."""
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size < 1000.0 or unit == "TB":
            return f"{size:.0f} {unit}" if unit == "bytes" else f"{size:.3g} {unit}"
        size /= 1000.0
    raise AssertionError


def parse_size(name: str, text: str) -> int:
    """Return the bytes that a text like "512MiB" or "1.5 GB" means (InputError: none); users know it by its `name`."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kKMGT])(i?)B?\s*", text)
    if match is None:
        raise InputError(f"{name} = {text}: must be a number with a unit, like 512MiB or 2GB")
    number, prefix, binary = match.groups()
    return int(
        float(number)
        * (1024 if binary else 1000) ** ("kMGT".index("k" if prefix in "kK" else prefix) + 1)
    )
