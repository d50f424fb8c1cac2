"""Sweep files after accidents: hypothesis strategies, and what becomes of such files.

`mutated` damages good files, `random_tables` puts values of any kind into the tables of the schema; `check` parses
such a file, `run` runs it.
"""

import math
import random
import shutil
from pathlib import Path
from typing import Any

from hypothesis import reject
from hypothesis import strategies as st

from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.model.options import Step
from slipsweep.model.variables import PARAMETERS, RESULTS
from slipsweep.motion.waveforms import Waveform
from tests.support.commands import is_served, one_line

SWEEPS = Path(__file__).parents[2] / "sweeps"

GOOD = """
[axes.theta]
start = 0
stop = 20
num = 5
[axes.mu_s]
values = [0.3, 0.5]
[axes.amplitude]
start = 0.1
stop = 1
num = 4
units = "g"
[axes.frequency]
start = 0.1
stop = 10
num = 3
spacing = "log"
"""

CASES = """
[[cases]]
label = "first"
theta = 5
amplitude = 3
[[cases]]
theta = 6
amplitude = 5
[axes.mu_s]
values = [0.3, 0.5, 0.7]
[axes.frequency]
values = [1, 2]
"""

OPTIONS = """
[model]
friction = "mendez"
rise = "literal"
yield_acceleration = "coulomb"
delta_mu = 0.1
g = 9.81
[excitation]
waveform = "sine"
cycles = 3
[solver]
method = "step"
steps_per_cycle = 64
rule = "simpson"
[output]
path = "out.nc"
title = "θ and μ"
variables = ["permanent_displacement", "validity"]
dtype = "float32"
"""
FILES = [GOOD, GOOD + OPTIONS, CASES, CASES + OPTIONS]
FILES += [path.read_text(encoding="utf-8") for path in sorted(SWEEPS.glob("*.toml"))]

#: What a value may become: extremes, no numbers, other types, TOML's own curiosities.
VALUES = [
    "0", "-0.0", "-1", "1", "2", "89.9999", "90", "1e308", "-1e308", "1e-320", "1e400", "nan", "-inf", "inf", "true",
    "0x7f", "1" + "0" * 30, "9223372036854775808", "1" * 5000, '""', '"g"', '"coulomb"', '"nan"', '"\\u0000"',
    "'''a\nb'''", "[]", "[[]]", "[1, 1]", "[2, 1]", "[1, nan]", '["a"]', "{}", "{a = 1}", "1979-05-27T07:32:00Z",
    "07:32:00", '"m/s2"', '"percent"', '"1/g"', '"degree**9"', '"a**b"', '"' + "x" * 3000 + '"', "[" * 200 + "]" * 200,
    "", "=", "\u202e",
]  # fmt: skip

KEYS = [
    "values", "start", "stop", "num", "spacing", "units", "label", "g", "cycles", "variables", "a.b", '"a\\nb"', '""',
]  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """A good sweep file after a few accidents, as a decoder would pass it on."""
    # a number from which the accidents are drawn: many times faster than hypothesis' own draws
    rng = random.Random(draw(st.integers(0, 2**64 - 1)))
    text = rng.choice(FILES)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 6])):
        lines = text.split("\n")
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        key, equals, value = lines[at].partition("=")
        kind = rng.randrange(9)
        if kind == 0:  # flipped bits
            raw = bytearray(text.encode())
            for _ in range(rng.randint(1, 4)):
                if raw:
                    raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
            text = raw.decode(errors="replace" if rng.random() < 0.5 else "ignore")
            continue
        if kind == 1:
            del lines[at]
        elif kind == 2:
            lines.insert(other, lines[at])
        elif kind == 3:
            lines[at], lines[other] = lines[other], lines[at]
        elif kind == 4 and equals:
            lines[at] = f"{key}= {rng.choice(VALUES)}"
        elif kind == 5 and equals:
            lines[at] = f"{rng.choice([*KEYS, *PARAMETERS, *RESULTS])} ={value}"
        elif kind == 6:  # a number within a line
            words = lines[at].split(" ")
            words[rng.randrange(len(words))] = rng.choice(VALUES)
            lines[at] = " ".join(words)
        elif kind == 7:  # cut off
            lines = lines[: at + 1]
            lines[-1] = lines[-1][: rng.randrange(len(lines[-1]) + 1)]
        else:  # another table begins
            table = rng.choice(
                ["axes.theta", "axes.g", "model", "output", "solver", "excitation", "axes", "x", "a.b.c"]
            )
            lines.insert(at, rng.choice([f"[{table}]", f"[[{table}]]", "[[cases]]", "[cases]"]))
        text = "\n".join(lines)
    return text


NUMBERS = st.one_of(
    st.floats(), st.integers(-5, 200), st.integers(), st.sampled_from([0, 1, 1e-300, 1e300, 2**63, True, "1", None])
)
WORDS = st.sampled_from(["linear", "log", "mendez", "newmark", "sine", "step", "cycle", "g", "deg", "eq12", "coulomb"])
ANYTHING = st.recursive(
    NUMBERS | WORDS | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)


def table(*names: str) -> st.SearchStrategy[dict[str, Any]]:
    """Some of the keys of a table, most with values of about the right kind."""
    value = NUMBERS | WORDS | st.lists(NUMBERS, max_size=4) | ANYTHING
    return st.dictionaries(st.sampled_from(names), value, max_size=len(names))


AXIS = (
    st.fixed_dictionaries({"values": st.lists(st.floats(0.01, 80.0), min_size=1, max_size=4, unique=True).map(sorted)})
    | st.fixed_dictionaries({"start": NUMBERS, "stop": NUMBERS, "num": st.integers(1, 50)})
    | table(*spec.Axis.model_fields)
)
_BY_SCHEMA: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
    {"axes": st.fixed_dictionaries(dict.fromkeys(("theta", "mu_s", "amplitude", "frequency"), AXIS))},
    optional={
        "cases": st.lists(table(*spec.Case.model_fields), max_size=3) | ANYTHING,
        "model": table(*spec.ModelTable.model_fields),
        "excitation": table(*spec.ExcitationTable.model_fields),
        "solver": table(*spec.SolverTable.model_fields),
        "output": table(*spec.Output.model_fields),
    },
)


def toml(value: Any) -> str:
    """A value in TOML; None, which TOML has not, as nothing."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + "".join(c if c.isalnum() else f"\\U{ord(c):08x}" for c in value) + '"'
    return "" if value is None else repr(value)


def document(content: dict[str, Any]) -> str:
    return "\n".join(f"{key} = {toml(value)}" for key, value in content.items())


#: Sweep files of the schema's tables, with values of any kind.
random_tables = _BY_SCHEMA.map(document)


# -------------------------------------------------------------------------- what becomes of them


def check(text: str) -> spec.SweepSpec | None:
    """Parse a file, whose record lies where those of `sweeps` do; what is no sweep is refused in one line."""
    try:
        parsed = spec.parse(text, "a.toml", SWEEPS)
    except InputError as error:
        message = one_line(str(error))
    else:
        assert _cells(parsed) >= 1
        return parsed
    assert message.startswith("a.toml: ")
    assert len(message) > len("a.toml: ")
    return None


def _cells(parsed: spec.SweepSpec) -> int:
    """Cells of the grid, of samples as well."""
    grid = math.prod({one.dim: one.values.size for one in parsed.parameters.values()}.values())
    return grid * (parsed.sampling.samples if parsed.sampling else 1)


#: More cells than this, cycles and steps are not computed, here.
FEW, FEW_CYCLES, FEW_STEPS = 100_000, 20, 512


def run(folder: Path, text: str) -> bool:
    """Run a file: it is computed, or refused in one line and nothing is written; tell which."""
    parsed = check(text)
    if parsed:
        solver, shaking = parsed.solver, parsed.excitation
        many = _cells(parsed) > FEW or (isinstance(shaking, Waveform) and shaking.cycles > FEW_CYCLES)
        if isinstance(solver, Step):
            many |= solver.steps_per_cycle > FEW_STEPS or _cells(parsed) > FEW // 100
        if many:
            reject()
    given, found = folder / "given.toml", folder / "found.nc"
    found.unlink(missing_ok=True)
    if not (folder / "data").exists():
        shutil.copytree(SWEEPS / "data", folder / "data")
    given.write_text(text, encoding="utf-8", newline="")
    served = is_served("run", given, "-o", found)
    assert served == (parsed is not None)
    assert served == found.exists()
    left = {path.name for path in folder.iterdir() if path.name.startswith(("given", "found"))}
    assert left <= {given.name, found.name}
    return served
