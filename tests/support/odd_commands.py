"""Command lines with accidents: options of other commands, values of any kind, words too many, too few or in disorder.

`command_lines` draws them; `is_served` runs one in a folder that has one input of every kind.
"""

import random
import shutil
from pathlib import Path
from typing import Any

import typer
from hypothesis import assume
from hypothesis import strategies as st

from slipsweep import cli
from tests.support import commands
from tests.support.commands import working_folder

_COMMANDS: dict[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]

#: What may not be drawn at random: processes, and an address that is waited for.
_LEFT_OUT = {"--workers", "--scheduler"}

#: Options of each command, and whether they are flags; that of all, too.
OPTIONS: dict[str, dict[str, bool]] = {
    name: {
        opt: bool(getattr(parameter, "is_flag", False))
        for parameter in command.params
        for opt in parameter.opts
        if opt.startswith("-") and opt not in _LEFT_OUT
    }
    | {"--help": True, "-h": True}
    for name, command in _COMMANDS.items()
}

_BLOCK = "--theta 5 --mu-s 0.4"
_CASE = f"simulate {_BLOCK} --amplitude 4"
#: Good command lines; what they read is in the folder.
GOOD = [
    "run grid.toml -o new.nc", "run grid.toml -q", "run statistics.toml -o new.nc", "run grid.nc -o new.nc --overwrite",
    "run grid.toml -o new.nc --memory 600MB --solver step", "run cases.toml --resume -o new.nc",
    "run cell.toml --split -o new",
    "info grid.nc", "info history.nc", "info statistics.nc",
    "export grid.nc -o new.csv --words", "export cases.nc -o new.csv --variable permanent_displacement -q",
    "export grid.nc -o new.csv --at theta=5 --at amplitude=0.1g,4 --columns frequency --variable validity",
    "export cases.nc -o new.xlsx --rows case --columns frequency --words", "export limit.nc -o new.csv --at theta=5",
    "example", "example records",
    "limit grid.nc -d 50mm -o new.nc", "limit grid.toml -d 1in -d 5cm --maximum-amplitude 2g -o new.png",
    f"{_CASE} --frequency 1 --points 8 -o new.csv",
    f"simulate {_BLOCK} --displacement-amplitude 1 --frequency 2 --waveform cosine --cycles 3",
    f"{_CASE} --frequency 1 --waveform harmonics --amplitudes 1,0.5 --multiples 1,3 --phases 0,45",
    f"{_CASE} --frequency 1 --waveform triangle --ramp-in 1 --ramp-out 2 --cycles 5 -o new.nc",
    f"{_CASE} --frequency 1 --yield-acceleration 1 --decay-rate 2 --delta-mu 0.1 --model mendez",
    "chart grid.nc --kind contours --at theta=5 --at mu_s=0.3 -o new.png",
    "chart statistics.nc -k fragility -o new.svg",
    "chart grid.nc --kind families --x frequency --y amplitude --variable peak_relative_velocity -o new.pdf",
    f"simulate --record motion.csv {_BLOCK} --scale 2 --units m/s2 -o new.nc",
    f"simulate --record motion.csv {_BLOCK} --amplitude 2 --time-scale 2 --polarity -1 --units g --format csv",
    "explore grid.nc -o new.html --size 1MB", "explore statistics.nc -o new.html",
]  # fmt: skip

VALUES = [
    "", " ", "0", "-0", "1", "-1", "2", "0.5", "1e-320", "1e308", "-1e308", "1e400", "nan", "inf", "-inf", "1_000", "٣",
    "0x10", "1,2", "1,,2", ",", "1:2", "1:2:3", "0:1:1e9", "0:1:-3", "2:1:3", ":::", "5mm", "2g", "1 mile", "3 kg", "g",
    "50 % ", "1KB", "600MB", "1e9GB", "-5MB", "theta=5", "theta=", "=5", "theta", "mu_s=nan", "amplitude=2g", "case=1",
    "theta=5mm", "x=y=z", "permanent_displacement", "validity", "label", "quantile", "contours", "families", "both",
    "sine", "harmonics", "newmark", "step", "auto", "true", "none", "θ", "\u202e", "a\nb", "\x1b[31m", "--", "-", "-q",
    "@file", "$HOME", "*", ".", "..", "/", "sub", "none/new.nc", "new.nc", "new.csv", "new.png", "new.xyz", "new",
    "grid.nc", "grid.toml", "motion.csv", "cases.nc", "history.nc", "limit.nc", "/dev/null", "x" * 300,
    "1" * 30, "1" * 5000,
]  # fmt: skip


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A good command line after one to three accidents."""
    # a number from which all is drawn: many times faster than hypothesis' own draws
    rng = random.Random(draw(st.integers(0, 2**64 - 1)))
    words = rng.choice(GOOD).split(" ")
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        at, kind = rng.randrange(len(words)), rng.randrange(9)
        known = OPTIONS[rng.choice(list(OPTIONS))] if rng.random() < 0.2 else OPTIONS.get(words[0], OPTIONS["run"])
        if kind == 0 and len(words) > 1:
            del words[at]
        elif kind == 1:
            words.insert(at, words[rng.randrange(len(words))])
        elif kind == 2:
            other = rng.randrange(len(words))
            words[at], words[other] = words[other], words[at]
        elif kind in (3, 4):
            values = [i for i, word in enumerate(words) if i and not word.startswith("-")]
            if values:
                words[rng.choice(values)] = rng.choice(VALUES)
        elif kind == 5:
            option = rng.choice(list(known))
            words[at + 1 : at + 1] = [option] if known[option] else [option, rng.choice(VALUES)]
        elif kind == 6:
            option = rng.choice(list(known))
            words.append(f"{option}={rng.choice(VALUES)}" if rng.random() < 0.3 else option)
        elif kind == 7 and words[at]:  # a letter wrong
            i = rng.randrange(len(words[at]))
            words[at] = words[at][:i] + rng.choice(["", "x", "-", words[at][i] * 2]) + words[at][i + 1 :]
        else:
            words.append(rng.choice(VALUES))
        words = words or ["run"]
    assume(not any(word.startswith(tuple(_LEFT_OUT)) for word in words))
    return words


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def is_served(folder: Path, sources: list[Path], words: list[str]) -> bool:
    """Run a command line: it is served, or refused in one line and nothing is written; tell which."""
    place = folder / "place"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(sources[0].parent, place, ignore=lambda _, names: [n for n in names if n not in _NEEDED])
    (place / "sub").mkdir()
    before = _contents(place)
    with working_folder(place):
        served = commands.is_served(*words)
    after = _contents(place)
    replaced = {"--overwrite"} & {*words}
    lost = {name for name, content in before.items() if after.get(name) != content}
    assert not lost or (served and replaced), lost
    assert served or not after.keys() - before.keys(), after.keys() - before.keys()
    assert not [name for name in after if Path(name).name.startswith(".") and name not in before], after.keys()
    return served


_NEEDED = {
    "grid.toml", "grid.nc", "cases.toml", "cases.nc", "cell.toml", "statistics.toml", "statistics.nc", "limit.nc",
    "history.nc", "motion.csv",
}  # fmt: skip
