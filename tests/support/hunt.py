"""All odd and damaged input that is tried, by kind: what is drawn, and what becomes of it.

Each trial gives True where the input was served and False where it was refused with one clear message; anything
else fails.  The tests of the parts draw some of each kind, ``python -m benchmarks.hunt`` many.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from tests.support import edits, odd_arguments, odd_commands, odd_names, results, sweep_files


class Sources:
    """A folder with one result of each command, and room for trials."""

    def __init__(self, folder: Path) -> None:
        made = folder / "made"
        made.mkdir()
        self.folder = folder
        self.paths = results.made(made)
        self.contents = results.contents(self.paths)


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    `count` is how many a long run draws; `part` says which line of its table an input belongs to.
    """

    count: int
    drawn: st.SearchStrategy[Any]
    trial: Callable[[Sources, Any], bool]
    part: Callable[[Any], str] | None = None


def _read(sources: Sources, text: str) -> bool:
    return sweep_files.check(text) is not None


def _run(sources: Sources, text: str) -> bool:
    return sweep_files.run(sources.folder, text)


KINDS: dict[str, Kind] = {
    "arguments of": Kind(
        4000, odd_arguments.calls(), lambda _, call: odd_arguments.is_served(call), lambda call: f"`{call.function}`"
    ),
    "sweep files, damaged: read": Kind(8000, sweep_files.mutated(), _read),
    "sweep files, damaged: run": Kind(300, sweep_files.mutated(), _run),
    "sweep files, tables of any content": Kind(2000, sweep_files.random_tables, _read),
    "command line of": Kind(
        1500,
        odd_commands.command_lines(),
        lambda made, words: odd_commands.is_served(made.folder, made.paths, words),
        lambda words: f"`{words[0]}`" if words[0] in odd_commands.OPTIONS else "no command",
    ),
    "names of files written": Kind(
        150, odd_names.names(), lambda made, name: odd_names.written(made.folder, made.paths, name)
    ),
    "names of files read": Kind(
        100, odd_names.names(), lambda made, name: odd_names.read(made.folder, made.paths, name)
    ),
    "results edited by other programs": Kind(200, edits.seeds, lambda made, seed: results.edited(made.paths, seed)),
    "results damaged": Kind(400, edits.seeds, lambda made, seed: results.damaged(made.folder, made.contents, seed)),
}


@dataclass(frozen=True)
class Found:
    """An input that failed once: of which kind, the input itself, and what was wrong."""

    kind: str
    value: Any
    wrong: str


#: Faults found by long runs, and mended; each is tried again by the tests.
FOUND = [
    Found(
        "arguments of",
        odd_arguments.called("simulate", points_per_cycle=10**400),
        "`points_per_cycle` of 400 digits: OverflowError",
    ),
    Found("arguments of", odd_arguments.called("simulate", times=()), "`times` without an entry: IndexError"),
    Found(
        "command line of",
        ["export", "x" * 300, "-o", "new.csv"],
        "a name longer than the system takes: exit status 1 and an error number",
    ),
    Found(
        "command line of",
        ["run", "grid.toml", "1" * 5000],
        "an argument of 5000 letters: repeated in full by the error",
    ),
]
