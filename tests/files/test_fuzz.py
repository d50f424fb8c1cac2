"""Sweep files damaged at random: each is a sweep or is refused in one line, and nothing else happens."""

import math
import random
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.model.options import Step
from slipsweep.model.variables import PARAMETERS, RESULTS
from slipsweep.motion.waveforms import Waveform
from tests.files.test_spec import CASES, GOOD

SWEEPS = Path(__file__).parents[2] / "sweeps"
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
FILES = [GOOD, GOOD + OPTIONS, CASES, CASES + OPTIONS, *(path.read_text() for path in sorted(SWEEPS.glob("*.toml")))]

#: What a value may become: extremes, no numbers, other types, TOML's own curiosities.
VALUES = [
    "0", "-0.0", "-1", "1", "2", "89.9999", "90", "1e308", "-1e308", "1e-320", "1e400", "nan", "-inf", "inf", "true",
    "0x7f", "1" + "0" * 30, "9223372036854775808", "1" * 5000, '""', '"g"', '"coulomb"', '"nan"', '"\\u0000"',
    "'''a\nb'''", "[]", "[[]]", "[1, 1]", "[2, 1]", "[1, nan]", '["a"]', "{}", "{a = 1}", "1979-05-27T07:32:00Z",
    "07:32:00", '"m/s2"', '"percent"', '"1/g"', '"degree**9"', '"a**b"', '"' + "x" * 3000 + '"', "[" * 200 + "]" * 200,
    "", "=", "\u202e",
]  # fmt: skip

KEYS = [
    "values",
    "start",
    "stop",
    "num",
    "spacing",
    "units",
    "label",
    "g",
    "cycles",
    "variables",
    "a.b",
    '"a\\nb"',
    '""',
]


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
BY_SCHEMA: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
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


#: How the files ended: printed at the end (pytest -s).
ended: Counter[str] = Counter()


@pytest.fixture(scope="module", autouse=True)
def _count() -> Any:
    yield
    print(f"\n{ended.total()} damaged sweep files: {dict(ended)}")


def cells(parsed: spec.SweepSpec) -> int:
    """Cells of the grid."""
    return math.prod({one.dim: one.values.size for one in parsed.parameters.values()}.values())


def check(text: str) -> spec.SweepSpec | None:
    """Parse; whatever is neither a sweep nor a refusal of one line fails."""
    try:
        parsed = spec.parse(text, "a.toml")
    except InputError as error:
        message = str(error)
        assert message.startswith("a.toml: ")
        assert len(message) > len("a.toml: ")
        assert message.splitlines() == [message], message
        assert message.isprintable(), ascii(message)
        assert len(message) < 700, message
        ended["refused"] += 1
        return None
    assert cells(parsed) >= 1
    ended["sweeps"] += 1
    return parsed


many = settings(
    deadline=None, derandomize=True, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)


@settings(many, max_examples=2000)
@given(mutated())
def test_a_damaged_file_is_a_sweep_or_refused_in_one_line(text: str) -> None:
    check(text)


@settings(many, max_examples=300)
@given(BY_SCHEMA.map(document))
def test_random_tables_are_a_sweep_or_refused_in_one_line(text: str) -> None:
    check(text)


def test_the_writer_of_toml() -> None:
    content = {"axes": {"theta": {"values": [1.5, -2], "a\nb": [True, "θ"], "x": float("inf")}}}
    assert tomllib.loads(document(content)) == content


#: More cells than this are not computed, here.
FEW = 500


@settings(many, max_examples=40)
@given(text=mutated())
def test_a_damaged_file_runs_or_fails_in_one_line(
    text: str, tmp_path_factory: pytest.TempPathFactory, capfd: pytest.CaptureFixture[str]
) -> None:
    parsed = check(text)
    if parsed:
        assert isinstance(parsed.excitation, Waveform)
        steps = parsed.solver.steps_per_cycle if isinstance(parsed.solver, Step) else 8
        if cells(parsed) > FEW or parsed.excitation.cycles > 20 or steps > 512:
            return
    folder = tmp_path_factory.mktemp("run")
    (folder / "a.toml").write_text(text, newline="")
    capfd.readouterr()
    status = main(["run", str(folder / "a.toml"), "-o", str(folder / "a.nc")])
    output, errors = capfd.readouterr()
    ended[f"exit status {status}"] += 1
    assert (status == 0) == (folder / "a.nc").exists()
    if parsed:
        assert (status, errors) == (0, "")
    else:
        assert (status, output) == (2, "")
        assert errors.startswith("slipsweep: error: ")
        assert errors.count("\n") == 1
