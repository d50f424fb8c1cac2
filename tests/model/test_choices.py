"""What a user chooses: the objects, their names, their options, and what files say of them."""

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import netCDF4
import pytest
import xarray as xr

import slipsweep
from slipsweep import (
    Cosine,
    Cycle,
    Harmonics,
    InputError,
    Mendez,
    Newmark,
    Sine,
    Square,
    Step,
    Triangle,
)
from slipsweep.cli import main
from slipsweep.files import spec
from slipsweep.model.choices import Choice, Family, declared
from slipsweep.model.options import MODELS, SOLVERS
from slipsweep.motion.waveforms import WAVEFORMS

FAMILIES: dict[str, Family[Any]] = {
    family.keyword: family for family in (MODELS, WAVEFORMS, SOLVERS)
}

#: Choices with options that are not their defaults, and with their defaults.
CHOSEN: list[tuple[str, Choice]] = [
    ("model", Mendez()),
    ("model", Mendez(rise="literal", recoupling="integrate", g=1.62)),
    ("model", Newmark(g=9.8)),
    ("excitation", Sine(cycles=3, ramp_in=0.5, ramp_out=1.25)),
    ("excitation", Cosine(cycles=1)),
    ("excitation", Triangle(ramp_in=1 / 3)),
    ("excitation", Square(cycles=10**9)),
    ("excitation", Harmonics([1, 0.3], [1, 3], [0, 180], cycles=4, ramp_out=0.1)),
    ("solver", Cycle()),
    ("solver", Step()),
    ("solver", Step(rule="simpson", steps_per_cycle=64)),
]
each = pytest.mark.parametrize(
    ("keyword", "choice"), CHOSEN, ids=[repr(choice) for _, choice in CHOSEN]
)


def test_every_choice_is_here() -> None:
    assert {type(choice) for _, choice in CHOSEN} == {
        each for family in FAMILIES.values() for each in family.choices
    }


@each
def test_choices_are_frozen_and_come_back_from_their_repr(keyword: str, choice: Choice) -> None:
    """Frozen, comparable, hashable, picklable; the repr makes it again."""
    for option in declared(type(choice)):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(choice, option.name, option.default)
    for again in (pickle.loads(pickle.dumps(choice)), eval(repr(choice), vars(slipsweep))):
        assert again == choice
        assert hash(again) == hash(choice)
        assert repr(again) == repr(choice)
    others = [other for _, other in CHOSEN if other is not choice]
    assert choice not in others
    assert FAMILIES[keyword].of(choice) is choice


def test_equal_however_the_numbers_are_given() -> None:
    assert Sine(cycles=3.0) == Sine(3)  # type: ignore[arg-type]
    assert repr(Sine(3, ramp_in=1)) == "Sine(cycles=3, ramp_in=1.0, ramp_out=0.0)"
    lists: Any = ([1.0, 0.5], [1.0, 2.0], [0, 0])
    assert Harmonics((1, 0.5), (1, 2)) == Harmonics(*lists)


def test_a_name_is_the_choice_with_its_defaults() -> None:
    for keyword, name, choice in (
        ("model", "newmark", Newmark()),
        ("excitation", "square", Square()),
        ("solver", "auto", Cycle()),
        ("solver", "step", Step()),
    ):
        assert FAMILIES[keyword].of(name) == choice


# ---------------------------------------------------------------------------------- refused

WRONG: list[tuple[type[Choice], dict[str, Any], str]] = [
    (Mendez, {"rise": "slow"}, "rise = 'slow': must be one of 'monotone', 'literal'"),
    (Mendez, {"g": 0}, "g = 0: must be a finite number > 0"),
    (Newmark, {"g": [9.8, 9.81]}, "g = [9.8, 9.81]: must be a single number"),
    (Sine, {"cycles": 0}, "cycles = 0: must be a whole number >= 1"),
    (Cosine, {"cycles": 2.5}, "cycles = 2.5: must be a whole number >= 1"),
    (
        Square,
        {"cycles": 10**20},
        "cycles = 100000000000000000000: must be a whole number <= 1000000000",
    ),
    (Sine, {"ramp_in": -0.5}, "ramp_in = -0.5: must be 0 to 100"),
    (
        Sine,
        {"cycles": 2, "ramp_in": 1.5, "ramp_out": 1},
        "ramp_in + ramp_out = 2.5: must not exceed the 2 cycles",
    ),
    (
        Harmonics,
        {"amplitudes": [1, "a"], "multiples": [1, 2]},
        "amplitudes[1] = 'a': must be a finite number",
    ),
    (
        Harmonics,
        {"amplitudes": [1], "multiples": [101]},
        "multiples[0] = 101: must be a whole number <= 100",
    ),
    (
        Harmonics,
        {"amplitudes": [1, 1], "multiples": [0, 1]},
        "multiples[0] = 0: must be a whole number >= 1",
    ),
    (
        Harmonics,
        {"amplitudes": [1, 2], "multiples": [1, 2], "phases": [0]},
        "phases: 1 numbers; must be as many",
    ),
    (
        Harmonics,
        {"amplitudes": [1, 1], "multiples": [2, 2]},
        "multiples = [2, 2]: must not be repeated",
    ),
    (Harmonics, {"amplitudes": [0.0], "multiples": [1]}, "amplitudes = [0.0]: must not all be 0"),
    (
        Harmonics,
        {"amplitudes": [], "multiples": []},
        "amplitudes = []: must not all be 0, and one at least",
    ),
    (Step, {"rule": "euler"}, "rule = 'euler': must be one of 'rectangle', 'trapezoid', 'simpson'"),
    (Step, {"steps_per_cycle": 10}, "steps_per_cycle = 10: must be a multiple of 4"),
]


@pytest.mark.parametrize(
    ("choice", "options", "message"), WRONG, ids=[message[:40] for *_, message in WRONG]
)
def test_wrong_options_are_named(
    choice: type[Choice], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as error:
        choice(**options)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def toml(value: object) -> str:
    return (
        f'"{value}"'
        if isinstance(value, str)
        else str(list(value))
        if isinstance(value, tuple)
        else repr(value)
    )


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            '[model]\nfriction = "newmark"\nrise = "literal"',
            "model.rise: not allowed with model.friction = 'newmark'",
        ),
        (
            '[solver]\nmethod = "cycle"\nrule = "simpson"',
            "solver.rule: not allowed with solver.method = 'cycle'",
        ),
        (
            "[excitation]\namplitudes = [1]",
            "excitation.amplitudes: not allowed with excitation.waveform = 'sine'",
        ),
        (
            '[excitation]\nwaveform = "harmonics"\namplitudes = [1]',
            "excitation.multiples: must be given",
        ),
        ("[excitation]\nramp_in = 101", "excitation.ramp_in = 101: must be 0 to 100"),
    ],
)
def test_wrong_options_in_sweep_files_are_named(table: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        spec.parse(f"{GRID}{table}\n", "a.toml")
    assert str(error.value).startswith(f"a.toml: {message}")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            "--model newmark --rise literal",
            "--rise: not allowed with --model = 'newmark', only with 'mendez'",
        ),
        ("--ramp-in 101", "--ramp-in = 101: must be 0 to 100"),
        (
            "--waveform harmonics --amplitudes 1,x --multiples 1,3",
            "--amplitudes 1,x: must be numbers",
        ),
    ],
)
def test_wrong_options_of_commands_are_named(
    options: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
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


@pytest.mark.parametrize(("keyword", "choice"), [CHOSEN[1], CHOSEN[7], CHOSEN[10]])
def test_a_file_gives_the_choice_again(keyword: str, choice: Choice, tmp_path: Path) -> None:
    """Written by `run`, read by netCDF4 and xarray, and run once more from the result."""
    family = FAMILIES[keyword]
    lines = "".join(f"{name} = {toml(value)}\n" for name, value in choice.options.items())
    (tmp_path / "a.toml").write_text(f'{GRID}[{keyword}]\n{family.key} = "{choice.name}"\n{lines}')
    result = tmp_path / "a.nc"
    again = tmp_path / "b.nc"
    assert getattr(spec.load(tmp_path / "a.toml"), keyword) == choice
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(result), "--quiet"]) == 0
    assert getattr(spec.load(result), keyword) == choice
    with netCDF4.Dataset(result) as file:
        assert (
            family.from_attributes({name: file.getncattr(name) for name in file.ncattrs()})
            == choice
        )
        # not every program reads attributes of 64 bits that are whole numbers
        assert not [
            name for name in file.ncattrs() if getattr(file.getncattr(name), "dtype", None) == "i8"
        ]
    assert main(["run", str(result), "-o", str(again), "--quiet"]) == 0
    first, second = (xr.load_dataset(path) for path in (result, again))
    assert family.from_attributes(second.attrs) == choice
    del first.attrs["history"], second.attrs["history"]
    xr.testing.assert_identical(first, second)


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
