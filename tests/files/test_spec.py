"""Sweep files: what they mean, and one clear line for each way to get them wrong."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from slipsweep import Cycle, Mendez, Sine, Step
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.model import variables

GOOD = """
[axes]
theta = {start = 0, stop = 20, num = 5}
mu_s = {values = [0.3, 0.5]}
amplitude = {start = 0.1, stop = 1, num = 4, units = "g"}
frequency = {start = 0.1, stop = 10, num = 3, spacing = "log"}
"""

CASES = """
[[cases]]
label = "first"
theta = 5
amplitude = 3
[[cases]]
theta = 6
amplitude = 5
[axes]
mu_s.values = [0.3, 0.5, 0.7]
frequency.values = [1, 2]
"""


def axis(name: str, body: str) -> str:
    """Return a good sweep file but for one axis."""
    return re.sub(rf"(?m)^{name} = .*$", f"{name} = {{{body}}}", GOOD)


def test_axes_become_arrays_in_the_parameters_own_units() -> None:
    arguments = spec.parse(GOOD, "a.toml").inputs
    np.testing.assert_allclose(arguments["theta"], [0, 5, 10, 15, 20])
    np.testing.assert_allclose(arguments["mu_s"], [0.3, 0.5])
    np.testing.assert_allclose(arguments["amplitude"], np.array([0.1, 0.4, 0.7, 1.0]) * 9.81)
    np.testing.assert_allclose(arguments["frequency"], [0.1, 1, 10])


def test_a_sweep_file_has_pythons_defaults() -> None:
    sweep = spec.parse(GOOD, "a.toml")
    assert sweep.excitation == Sine(cycles=10, ramp_in=0.0, ramp_out=0.0)
    assert sweep.model == Mendez(rise="monotone", recoupling="eq12", g=9.81)
    assert sweep.solver == Cycle()
    assert "yield_acceleration" not in sweep.inputs
    plan = sweep.plan()
    assert plan.sizes == {"theta": 5, "mu_s": 2, "amplitude": 4, "frequency": 3}
    assert list(plan.names) == list(variables.DEFAULT_RESULTS)


WORDS = {
    ("model", "friction"): ("mendez", "newmark"),
    ("model", "rise"): ("monotone", "literal"),
    ("model", "recoupling"): ("eq12", "integrate"),
    ("excitation", "waveform"): ("sine", "cosine", "triangle", "square"),
    ("solver", "method"): ("auto", "cycle", "step"),
    ("solver", "rule"): ("rectangle", "trapezoid", "simpson"),
}


@pytest.mark.parametrize(("table", "key"), WORDS)
def test_every_word_reaches_the_sweep(table: str, key: str) -> None:
    choices = []
    for word in WORDS[table, key]:
        step = 'method = "step"\n' if key == "rule" else ""
        choice = getattr(spec.parse(f'{GOOD}[{table}]\n{step}{key} = "{word}"\n', "a.toml"), table)
        assert word in ("auto", choice.name, getattr(choice, key, None))
        choices.append(choice)
    assert len(set(choices)) == len(WORDS[table, key]) - ("auto" in WORDS[table, key])


def test_options_reach_the_sweep() -> None:
    text = """
    model.rise = "literal"
    model.recoupling = "integrate"
    model.yield_acceleration = 0.5
    model.structure_frequency = 3
    model.g = 9.8
    excitation.cycles = 5
    solver = {method = "step", steps_per_cycle = 512, rule = "simpson"}
    output.variables = ["validity"]
    """
    sweep = spec.parse(text + GOOD, "a.toml")
    assert sweep.model == Mendez(rise="literal", recoupling="integrate", g=9.8)
    assert sweep.excitation == Sine(cycles=5)
    assert sweep.solver == Step(rule="simpson", steps_per_cycle=512)
    assert sweep.inputs["yield_acceleration"] == 0.5
    assert sweep.inputs["structure_frequency"] == 3.0
    assert sweep.output.variables == ["validity"]


def test_cases_are_zipped_and_crossed_with_the_axes() -> None:
    sweep = spec.parse(CASES, "a.toml")
    arguments = sweep.inputs
    assert sweep.plan().sizes == {"mu_s": 3, "frequency": 2, "case": 2}
    assert sweep.labels == ("first", "2")
    for name, values in {"theta": [5, 6], "amplitude": [3, 5]}.items():
        assert arguments[name].dims == ("case",)
        np.testing.assert_array_equal(arguments[name].values, values)


def test_the_plan_of_a_block() -> None:
    part = spec.parse(CASES, "a.toml").plan().part({"mu_s": slice(1, 3), "case": slice(1, 2)})
    assert part.sizes == {"mu_s": 2, "frequency": 2, "case": 1}
    coords = part.template().coords
    np.testing.assert_array_equal(coords["mu_s"].values, [0.5, 0.7])
    np.testing.assert_array_equal(coords["frequency"].values, [1, 2])
    np.testing.assert_array_equal(coords["theta"].values, [6])


@pytest.mark.parametrize(
    ("name", "units", "factor"),
    [
        ("amplitude", "m s-2", 1),
        ("amplitude", "cm/s^2", 0.01),
        ("amplitude", "Gal", 0.01),
        ("amplitude", "g", 9.81),
        ("theta", "rad", math.degrees(1)),
        # an angular frequency: one turn is one cycle
        ("frequency", "rpm", 1 / 60),
        ("frequency", "rad/s", 1 / (2 * math.pi)),
    ],
)
def test_axes_are_converted_to_the_parameters_own_units(
    name: str, units: str, factor: float
) -> None:
    text = axis(name, f'values = [0.25, 0.5], units = "{units}"')
    inputs = spec.parse(text, "a.toml").inputs
    np.testing.assert_allclose(inputs[name], np.array([0.25, 0.5]) * factor, rtol=1e-14)


def test_g_as_a_unit_is_the_gravity_of_the_model() -> None:
    arguments = spec.parse(GOOD + "[model]\ng = 1.62\n", "a.toml").inputs
    assert arguments["amplitude"][-1] == 1.62


BAD = {
    # keys
    "unknown table": ("[sovler]\n" + GOOD, 'sovler: unknown key; did you mean "solver"?'),
    "unknown axis": (
        GOOD.replace("theta", "thetta"),
        'axes.thetta: unknown key; did you mean "theta"?',
    ),
    "unknown key": (
        axis("theta", "strat = 0"),
        'axes.theta.strat: unknown key; did you mean "start"?',
    ),
    "unknown key in a case": (
        CASES.replace("theta = 6", "thet = 6"),
        "cases[row 2].thet: unknown key; did you mean",
    ),
    "missing axis": (GOOD.replace("mu_s", "# mu_s"), "mu_s: must be given"),
    "missing amplitude": (
        GOOD.replace("amplitude", "# amplitude"),
        "exactly one of them must be given",
    ),
    "missing stop": (axis("theta", "start = 0, num = 3"), "axes.theta.stop: missing"),
    # types
    "text for a number": (
        axis("theta", 'values = ["a"]'),
        "axes.theta.values = ['a']: must be a number",
    ),
    "number for a list": (axis("theta", "values = 3"), "axes.theta.values = 3: must be a list"),
    "number for a table": ("axes = 3", "axes = 3: must be a table"),
    "fraction of a point": (
        axis("theta", "start = 0, stop = 1, num = 2.5"),
        "axes.theta.num = 2.5: must be",
    ),
    "wrong word": (
        GOOD + '[model]\nrise = "slow"',
        "model.rise = 'slow': must be one of 'monotone', 'literal'",
    ),
    "waveform": (
        GOOD + '[excitation]\nwaveform = "sawtooth"',
        "excitation.waveform = 'sawtooth': must be one of 'sine', 'cosine', 'triangle', "
        "'square', 'harmonics'",
    ),
    "variable": (
        GOOD + '[output]\nvariables = ["validty"]',
        "variables = 'validty': must be one of",
    ),
    "number for a path": (GOOD + "[output]\npath = 3", "output.path = 3: must be a text"),
    "empty path": (GOOD + "[output]\npath = ''", 'output.path = "": must be the name of a file'),
    # axes
    "empty": (
        axis("theta", "values = []"),
        "axes.theta.values = []: must be a list of one number at least",
    ),
    "unsorted": (
        axis("mu_s", "values = [0.5, 0.4]"),
        "axes.mu_s.values: 0.4 after 0.5: must increase",
    ),
    "backwards": (
        axis("theta", "start = 9, stop = 3, num = 4"),
        "axes.theta.stop = 3.0: must be greater than start",
    ),
    "logarithm of zero": (
        axis("theta", 'start = 0, stop = 3, num = 4, spacing = "log"'),
        'axes.theta.start = 0.0: must be positive with spacing = "log"',
    ),
    "two forms": (
        axis("theta", "values = [1, 2], num = 4"),
        "axes.theta.num: not allowed beside values",
    ),
    # units
    "incompatible": (
        axis("theta", 'values = [1], units = "kg"'),
        'axes.theta.units = "kg": must be a unit that converts',
    ),
    "grams": (
        GOOD.replace("amplitude", "displacement_amplitude"),
        'axes.displacement_amplitude.units = "g": must be a unit that converts to m',
    ),
    # range
    "not a number": (
        axis("theta", "values = [nan]"),
        "axes.theta.values = nan: must be 0 <= theta < 90",
    ),
    "theta": (
        axis("theta", "values = [0, 90]"),
        "axes.theta.values = 90: must be 0 <= theta < 90 degrees",
    ),
    "mu_s": (
        axis("mu_s", "start = 0, stop = 1, num = 3"),
        "axes.mu_s = 0: must be a finite number > 0",
    ),
    "cycles": (
        GOOD + "[excitation]\ncycles = 0",
        "excitation.cycles = 0: must be a whole number >= 1",
    ),
    "decay rate": (
        GOOD + "[model]\ndecay_rate = -1",
        "model.decay_rate = -1: must be a finite number >= 0",
    ),
    # tables against each other
    "given twice": (GOOD + "[[cases]]\ntheta = 5", "cases.theta: given twice"),
    "twice, model": (
        GOOD + "[model]\ndelta_mu = 1\n[axes.delta_mu]\nvalues = [1]",
        "model.delta_mu: given twice",
    ),
    "key missing in a row": (
        CASES.replace("theta = 6", ""),
        "cases[row 2].theta: every row must give what row 1",
    ),
    "range in a row": (
        CASES.replace("theta = 6", "theta = 99"),
        "cases[row 2].theta = 99: must be 0 <= theta",
    ),
    "empty row": (GOOD + "[[cases]]", "cases[row 1]: must give at least one parameter"),
    "rise of newmark": (
        GOOD + '[model]\nfriction = "newmark"\nrise = "literal"',
        "model.rise: not allowed with model.friction = 'newmark', only with 'mendez'",
    ),
    "record and wave": (
        GOOD + '[excitation]\nrecord = "a.csv"\ncycles = 2',
        "excitation.cycles: not allowed with excitation.record",
    ),
    "reading without a record": (
        GOOD + "[excitation]\ngaps = 'linear'",
        "excitation.gaps: only beside excitation.rec",
    ),
    "no variables": (GOOD + "[output]\nvariables = []", "variables = []: must name one of"),
    # TOML
    "syntax": (
        "[axes.theta]\nvalues = [1,\nb",
        "not valid TOML: Invalid value (at line 3, column 1)",
    ),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD.keys())
def test_bad_files_are_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        spec.parse(text, "folder/a.toml").plan()
    words = str(error.value)
    assert words.startswith("folder/a.toml: ")
    assert message in words
    assert "\n" not in words
    assert len(words) < 400


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.toml", b"\xff\xfe\x00", "not a sweep file: it is not UTF-8 text"),
        ("a.nc", b"nothing", "not a netCDF file"),
        ("a.toml", b"\x89HDF nothing more", "not a netCDF file"),
    ],
)
def test_files_of_another_kind_are_refused(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        spec.load(tmp_path / name)


@pytest.mark.parametrize(
    "path",
    sorted((Path(__file__).parents[2] / "sweeps").glob("*.toml")),
    ids=lambda path: path.stem,
)
def test_the_sweeps_that_come_along_are_good(path: Path) -> None:
    sweep = spec.load(path)
    if path.stem == "design_chart":
        assert 2.5e6 < sweep.plan().cells < 3.5e6


def test_the_measured_interface_takes_no_estimate_and_holds_the_tests() -> None:
    """The cases of sweeps/paper.toml, at the amplitude and frequency of their tests."""
    sweeps = Path(__file__).parents[2] / "sweeps"
    plan = spec.load(sweeps / "interface.toml").plan()
    table = plan.solve()
    paper = spec.load(sweeps / "paper.toml").plan().solve()
    assert table.attrs["friction_inputs"] == "Üy, λ, Δμ given"
    flags = np.bitwise_or.reduce(table["validity"].values, axis=None)
    assert not flags & (variables.Validity.FRICTION_ESTIMATED | variables.VALUELESS)
    for case in range(2):
        amplitude, frequency = (
            float(paper[name].values[case]) for name in ("amplitude", "frequency")
        )
        at = [
            int(np.abs(table[name].values - value).argmin())
            for name, value in (("amplitude", amplitude), ("frequency", frequency))
        ]
        near = table["permanent_displacement"].values[at[0], at[1], case]
        assert near == pytest.approx(paper["permanent_displacement"].values[case], rel=0.03)
        assert table["newmark_displacement"].values[at[0], at[1], case] > near
