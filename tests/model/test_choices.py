"""What a user chooses: the objects, their names, their options, and what files say of them."""

import dataclasses
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import netCDF4
import pytest
import xarray as xr

import slipsweep
from slipsweep import Cosine, Cycle, Harmonics, InputError, Mendez, Newmark, Sine, Square, Step, Triangle
from slipsweep.cli import main
from slipsweep.files import spec
from slipsweep.model.choices import Choice, Family, declared
from slipsweep.model.options import MODELS, SOLVERS
from slipsweep.motion.waveforms import WAVEFORMS
from slipsweep.runs.jobs import sweep_job

FAMILIES: dict[str, Family[Any]] = {family.keyword: family for family in (MODELS, WAVEFORMS, SOLVERS)}

#: Choices with options that are not their defaults, and with their defaults.
CHOSEN: list[tuple[str, Choice]] = [
    ("model", Mendez()),
    ("model", Mendez(rise="literal", recoupling="integrate", g=1.62)),
    ("model", Newmark(g=9.8)),
    ("excitation", Sine()),
    ("excitation", Sine(cycles=3, ramp_in=0.5, ramp_out=1.25)),
    ("excitation", Cosine(cycles=1)),
    ("excitation", Triangle(ramp_in=1 / 3)),
    ("excitation", Square(cycles=10**9)),
    ("excitation", Harmonics([2.5], [3])),
    ("excitation", Harmonics([1, 0.3], [1, 3], [0, 180], cycles=4, ramp_out=0.1)),
    ("solver", Cycle()),
    ("solver", Step()),
    ("solver", Step(rule="simpson", steps_per_cycle=64)),
]
each = pytest.mark.parametrize(("keyword", "choice"), CHOSEN, ids=[repr(choice) for _, choice in CHOSEN])


def test_every_choice_is_here() -> None:
    assert {type(choice) for _, choice in CHOSEN} == {one for family in FAMILIES.values() for one in family.choices}


@each
def test_objects(keyword: str, choice: Choice) -> None:
    """Frozen, comparable, hashable, picklable; the repr makes it again."""
    for one in declared(type(choice)):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(choice, one.name, one.default)
    for again in (pickle.loads(pickle.dumps(choice)), eval(repr(choice), vars(slipsweep)), choice.but()):
        assert again == choice
        assert hash(again) == hash(choice)
        assert repr(again) == repr(choice)
    others = [other for _, other in CHOSEN if other is not choice]
    assert choice not in others
    assert FAMILIES[keyword].of(choice) is choice


def test_equal_however_the_numbers_are_given() -> None:
    assert Sine(cycles=3.0) == Sine(3)  # type: ignore[arg-type]
    assert repr(Sine(3, ramp_in=1)) == "Sine(cycles=3, ramp_in=1.0, ramp_out=0.0)"
    assert Harmonics((1, 0.5), (1, 2)) == Harmonics([1.0, 0.5], [1.0, 2.0], [0, 0])  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("keyword", "name", "choice"),
    [
        ("model", "mendez", Mendez()),
        ("model", "newmark", Newmark()),
        ("excitation", "sine", Sine()),
        ("excitation", "cosine", Cosine()),
        ("excitation", "triangle", Triangle()),
        ("excitation", "square", Square()),
        ("solver", "auto", Cycle()),
        ("solver", "cycle", Cycle()),
        ("solver", "step", Step()),
    ],
)
def test_a_name_is_the_choice_with_its_defaults(keyword: str, name: str, choice: Choice) -> None:
    assert FAMILIES[keyword].of(name) == choice
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.0, "frequency": 1.0}
    given: list[dict[str, Any]] = [{keyword: name}, {keyword: choice}]
    by_name, by_object = (slipsweep.sweep(**block, **one, variables=["limiting_acceleration"]) for one in given)
    xr.testing.assert_identical(by_name, by_object)


# ---------------------------------------------------------------------------------- refused

WRONG: list[tuple[type[Choice], dict[str, Any], str]] = [
    (Mendez, {"rise": "slow"}, "rise = 'slow': must be one of 'monotone', 'literal'"),
    (Mendez, {"rise": None}, "rise = None: must be one of"),
    (Mendez, {"recoupling": 12}, "recoupling = 12: must be one of 'eq12', 'integrate'"),
    (Mendez, {"g": 0}, "g = 0: must be a finite number > 0"),
    (Newmark, {"g": [9.8, 9.81]}, "g = [9.8, 9.81]: must be a single number"),
    (Newmark, {"g": "9.81"}, "g = '9.81': must be a number"),
    (Sine, {"cycles": 0}, "cycles = 0: must be a whole number >= 1"),
    (Cosine, {"cycles": 2.5}, "cycles = 2.5: must be a whole number >= 1"),
    (Triangle, {"cycles": True}, "cycles = True: must be a whole number >= 1"),
    (Square, {"cycles": 10**20}, "cycles = 100000000000000000000: must be a whole number <= 1000000000"),
    (Sine, {"cycles": None}, "cycles = None: must be a whole number"),
    (Sine, {"ramp_in": -0.5}, "ramp_in = -0.5: must be 0 to 100"),
    (Sine, {"ramp_out": float("nan")}, "ramp_out = nan: must be a finite number"),
    (Sine, {"cycles": 2, "ramp_in": 1.5, "ramp_out": 1}, "ramp_in + ramp_out = 2.5: must not exceed the 2 cycles"),
    (Harmonics, {"amplitudes": 1, "multiples": [1]}, "amplitudes = 1: must be a list of numbers"),
    (Harmonics, {"amplitudes": [1], "multiples": "1"}, "multiples = '1': must be a list of numbers"),
    (Harmonics, {"amplitudes": [1, "a"], "multiples": [1, 2]}, "amplitudes[1] = 'a': must be a finite number"),
    (Harmonics, {"amplitudes": [1], "multiples": [101]}, "multiples[0] = 101: must be a whole number <= 100"),
    (Harmonics, {"amplitudes": [1, 2], "multiples": [1, 2], "phases": [0]}, "phases: 1 numbers; must be as many"),
    (Step, {"rule": "euler"}, "rule = 'euler': must be one of 'rectangle', 'trapezoid', 'simpson'"),
    (Step, {"steps_per_cycle": 10}, "steps_per_cycle = 10: must be a multiple of 4 >= 8"),
    (Step, {"steps_per_cycle": 40_000_000}, "steps_per_cycle = 40000000: must be a multiple of 4 <= 16777216"),
]


@pytest.mark.parametrize(("choice", "options", "message"), WRONG, ids=[message[:40] for *_, message in WRONG])
def test_wrong_options_are_named(choice: type[Choice], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        choice(**options)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(list(value)) if isinstance(value, tuple) else repr(value)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('[model]\nfriction = "newmark"\nrise = "literal"', "model.rise: not allowed with model.friction = 'newmark'"),
        ('[solver]\nmethod = "cycle"\nrule = "simpson"', "solver.rule: not allowed with solver.method = 'cycle'"),
        ("[solver]\nsteps_per_cycle = 64", "solver.steps_per_cycle: not allowed with solver.method = 'auto'"),
        ("[excitation]\namplitudes = [1]", "excitation.amplitudes: not allowed with excitation.waveform = 'sine'"),
        ('[excitation]\nwaveform = "harmonics"\namplitudes = [1]', "excitation.multiples: must be given"),
        ("[excitation]\nramp_in = 101", "excitation.ramp_in = 101: must be 0 to 100"),
        ("[excitation]\ncycles = true", "excitation.cycles = True: must be a whole number >= 1"),
    ],
)
def test_wrong_options_in_sweep_files_are_named(table: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        spec.parse(f"{GRID}{table}\n", "a.toml")
    assert str(error.value).startswith(f"a.toml: {message}")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--model newmark --rise literal", "--rise: not allowed with --model = 'newmark', only with 'mendez'"),
        ("--g 0", "--g = 0: must be a finite number > 0"),
        ("--cycles 0", "--cycles = 0: must be a whole number >= 1"),
        ("--ramp-in 101", "--ramp-in = 101: must be 0 to 100"),
        ("--amplitudes 1,0.3", "--amplitudes: not allowed with --waveform = 'sine', only with 'harmonics'"),
        ("--waveform harmonics", "--amplitudes: must be given with --waveform = 'harmonics'"),
        ("--waveform harmonics --amplitudes 1,x --multiples 1,3", "--amplitudes x: must be numbers"),
        ("--waveform harmonics --amplitudes 1,2 --multiples 1,1", "--multiples = [1, 1]: must not be repeated"),
    ],
)
def test_wrong_options_of_commands_are_named(options: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    block = "--theta 5 --mu-s 0.38 --amplitude 3 --frequency 1"
    assert main(f"simulate {block} {options}".split()) == 2
    assert f"error: {message}" in capsys.readouterr().err


# ------------------------------------------------------------------------ attributes, files

#: Results that need no motion: what files say of the choices is the same.
GRID = """
[output]
variables = ["limiting_acceleration"]
[axes.theta]
values = [5]
[axes.mu_s]
values = [0.3, 0.4]
[axes.amplitude]
values = [3]
[axes.frequency]
values = [1]
"""


@each
def test_attributes_give_the_choice_again(keyword: str, choice: Choice) -> None:
    family = FAMILIES[keyword]
    assert family.from_attributes(family.attributes(choice)) == choice


@each
def test_a_file_gives_the_choice_again(keyword: str, choice: Choice, tmp_path: Path) -> None:
    """Written by `run`, read by netCDF4 and xarray, and run once more from the result."""
    family = FAMILIES[keyword]
    lines = "".join(f"{name} = {toml(value)}\n" for name, value in choice.options.items())
    (tmp_path / "a.toml").write_text(f'{GRID}[{keyword}]\n{family.key} = "{choice.name}"\n{lines}')
    result, again = tmp_path / "a.nc", tmp_path / "b.nc"
    assert getattr(spec.load(tmp_path / "a.toml"), keyword) == choice
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(result), "--quiet"]) == 0
    assert getattr(spec.load(result), keyword) == choice
    with netCDF4.Dataset(result) as file:
        assert family.from_attributes({name: file.getncattr(name) for name in file.ncattrs()}) == choice
        # not every program reads attributes of 64 bits that are whole numbers
        assert not [name for name in file.ncattrs() if getattr(file.getncattr(name), "dtype", None) == "i8"]
    assert main(["run", str(result), "-o", str(again), "--quiet"]) == 0
    first, second = (xr.load_dataset(path) for path in (result, again))
    assert family.from_attributes(second.attrs) == choice
    del first.attrs["history"], second.attrs["history"]
    xr.testing.assert_identical(first, second)


def test_the_solver_of_the_command_is_kept(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(f'{GRID}[solver]\nmethod = "step"\nrule = "simpson"\nsteps_per_cycle = 64\n')
    for given, expected in (("step", Step(rule="simpson", steps_per_cycle=64)), ("cycle", Cycle())):
        result = tmp_path / f"{given}.nc"
        assert main(["run", str(tmp_path / "a.toml"), "-o", str(result), "--solver", given, "--quiet"]) == 0
        assert spec.load(result).solver == expected


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"model": "coulomb"}, "attribute model = 'coulomb': must be one of"),
        ({}, "attribute 'model': missing"),
        ({"model": "mendez", "rise": "slow"}, "attribute rise = 'slow': must be one of"),
    ],
)
def test_attributes_of_no_choice(attributes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        MODELS.from_attributes(attributes)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("other", [Cycle(), Step(rule="simpson"), Step(steps_per_cycle=512)])
def test_a_run_goes_on_with_the_same_solver_only(other: Cycle | Step) -> None:
    sweep = spec.parse(GRID, "a.toml")
    one, two = (sweep_job(sweep.with_solver(solver)).asked for solver in (Step(), other))
    assert {name for name in one if one[name] != two[name]} == {"solver"}


# --------------------------------------------------------------------------- one more option

#: Where an option is put in, behind what, and what it is called: an edit of one line each.
NEW = {
    "damping": ("motion/waveforms.py", '    name: ClassVar[str] = "sine"\n', "excitation"),
    "ageing": ("model/options.py", '    name: ClassVar[str] = "mendez"\n', "model"),
    "tolerance": ("model/options.py", '    name: ClassVar[str] = "step"\n', "solver"),
}

#: What the edited package is to do, as Python says it.
SCRIPT = """
import sys
import slipsweep
from slipsweep.cli import main
from slipsweep.files import spec
from slipsweep.runs.jobs import sweep_job
from slipsweep.studies import history

assert slipsweep.__file__.startswith(sys.argv[1]), slipsweep.__file__

# Python
assert slipsweep.Sine(damping=0.5).damping == 0.5
assert "ageing=0.0" in repr(slipsweep.Mendez())
assert slipsweep.Step(tolerance=1) != slipsweep.Step()
try:
    slipsweep.Sine(damping=2)
except slipsweep.InputError as error:
    assert str(error) == "damping = 2: must be 0 to 1", error
else:
    raise AssertionError("2 is let through")
block = {"theta": 5.0, "mu_s": 0.4, "amplitude": 3.0, "frequency": 1.0, "variables": ["limiting_acceleration"]}
attrs = slipsweep.sweep(**block, excitation=slipsweep.Sine(damping=0.5), solver="step").attrs
assert (attrs["damping"], attrs["ageing"], attrs["tolerance"]) == (0.5, 0.0, 0.0), attrs

# resuming
sweep = spec.load("a.toml")
assert (sweep.excitation.damping, sweep.model.ageing, sweep.solver.tolerance) == (0.25, 0.5, 0.75)
one, two = (sweep_job(sweep.with_solver(slipsweep.Step(tolerance=t))).asked for t in (0.75, 0.5))
assert {name for name in one if one[name] != two[name]} == {"solver"}

# the command line: what arrives where it is computed
arrived = {}

def stand_in(**given):
    arrived.update(given)
    raise slipsweep.InputError("as far as that")

history.history_table = stand_in
command = "simulate --theta 5 --mu-s 0.38 --amplitude 3 --frequency 1".split()
assert main([*command, "--damping", "0.5", "--ageing", "1"]) == 2
assert arrived["excitation"] == slipsweep.Sine(damping=0.5), arrived
assert arrived["model"] == slipsweep.Mendez(ageing=1), arrived
"""


@pytest.fixture(scope="module")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package that has new options."""
    folder = tmp_path_factory.mktemp("edited")
    package = Path(slipsweep.__file__).parent
    shutil.copytree(package, folder / "slipsweep", ignore=shutil.ignore_patterns("__pycache__"))
    for name, (file, behind, _) in NEW.items():
        path = folder / "slipsweep" / file
        text = path.read_text(encoding="utf-8")
        assert text.count(behind) == 1
        new = f'    {name}: float = option("what is new", 0.0, least=0.0, most=1.0)\n'
        path.write_text(text.replace(behind, behind + new), encoding="utf-8")
    values = {"damping": 0.25, "ageing": 0.5, "tolerance": 0.75}
    tables = "".join(f"[{NEW[name][2]}]\n{name} = {value}\n" for name, value in values.items())
    (folder / "a.toml").write_text(GRID + tables.replace("[solver]\n", '[solver]\nmethod = "step"\n'))
    return folder


def of_the_copy(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """Run Python where the copy is the package."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "PYTHONUTF8": "1", "NO_COLOR": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=300,
        check=False,
    )


def test_a_new_option_is_an_edit_of_one_line_in_python(edited: Path) -> None:
    (edited / "script.py").write_text(SCRIPT)
    done = of_the_copy(edited, "script.py", str(edited))
    assert (done.returncode, done.stderr.strip()) == (0, "\n".join(["slipsweep: error: as far as that"]))


def test_a_new_option_is_in_the_help_of_commands(edited: Path) -> None:
    shown = of_the_copy(edited, "-m", "slipsweep", "simulate", "--help-all").stdout
    assert "--damping" in shown
    assert "--ageing" in shown
    assert "What is new (with sine; default: 0.0)." in " ".join(shown.split())
    block = ("--theta", "5", "--mu-s", "0.38", "--amplitude", "3", "--frequency", "1")
    refused = of_the_copy(edited, "-m", "slipsweep", "simulate", *block, "--damping", "7")
    assert (refused.returncode, refused.stderr) == (2, "slipsweep: error: --damping = 7: must be 0 to 1\n")


def test_a_new_option_is_a_key_of_sweep_files_and_results(edited: Path) -> None:
    done = of_the_copy(edited, "-m", "slipsweep", "run", "a.toml", "--quiet", "--overwrite")
    assert (done.returncode, done.stderr) == (0, "")
    # the same from the result, whose sweep says nothing of the solver that ran
    again = of_the_copy(edited, "-m", "slipsweep", "run", "a.nc", "-o", "b.nc", "--quiet", "--overwrite")
    assert (again.returncode, again.stderr) == (0, "")
    for name in ("a.nc", "b.nc"):
        with netCDF4.Dataset(edited / name) as file:
            assert [file.getncattr(one) for one in NEW] == [0.25, 0.5, 0.75]


@pytest.mark.parametrize("name", NEW)
def test_a_new_key_is_refused_by_name(edited: Path, name: str) -> None:
    table = NEW[name][2]
    text = (edited / "a.toml").read_text()
    value = next(line for line in text.splitlines() if line.startswith(name))
    (edited / f"{name}.toml").write_text(text.replace(value, f"{name} = 7"))
    refused = of_the_copy(edited, "-m", "slipsweep", "run", f"{name}.toml")
    assert refused.returncode == 2
    assert refused.stderr == f"slipsweep: error: {name}.toml: {table}.{name} = 7: must be 0 to 1\n"
