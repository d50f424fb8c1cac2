"""The table of parameters is what signatures, docstrings, sweep files and the command line have."""

import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest

import slipsweep
from slipsweep.cli.options import ParameterOptions
from slipsweep.files import spec
from slipsweep.model.parameter_table import PARAMETER_TABLE
from slipsweep.model.parameters import check_values

ROWS = {row.name: row for row in PARAMETER_TABLE}

#: Public functions, and the parameters that they do not take.
WITHOUT: dict[Callable[..., Any], set[str]] = {
    slipsweep.sweep: set(),
    slipsweep.sample: {"structure_frequency"},
    slipsweep.simulate: {"azimuth"},
    slipsweep.limit_amplitude: {
        "amplitude",
        "displacement_amplitude",
        "scale",
        "pgv",
        "arias_intensity",
    },
    # the strength of the block is solved for, and the shaking shakes no structure
    slipsweep.required_strength: {name for name, row in ROWS.items() if not row.shaking}
    - {"theta", "upslope_yield_acceleration"}
    | {"structure_frequency"},
    # Eqs. 7-11
    slipsweep.friction_parameters: {*ROWS}
    - {"theta", "mu_s", "phi", "amplitude"}
    - {"yield_acceleration", "decay_rate", "delta_mu", "minimum_friction"},
}
FUNCTIONS = pytest.mark.parametrize("function", WITHOUT, ids=lambda function: function.__name__)

#: Functions whose docstrings have parameters of the table.
DESCRIBED = pytest.mark.parametrize(
    "function",
    [*WITHOUT, slipsweep.measured_friction, slipsweep.calibrate],
    ids=lambda function: function.__name__,
)


@FUNCTIONS
def test_signatures_have_the_parameters_of_the_table_in_its_order(
    function: Callable[..., Any],
) -> None:
    taken = [name for name in ROWS if name not in WITHOUT[function]]
    parameters = inspect.signature(function).parameters.values()
    by_position = [one.name for one in parameters if one.kind is one.POSITIONAL_OR_KEYWORD]
    by_keyword = [one.name for one in parameters if one.kind is one.KEYWORD_ONLY]
    assert {*by_position, *by_keyword} & {*ROWS} == {*taken}
    for names in (by_position, by_keyword):
        of_table = [name for name in names if name in ROWS]
        assert of_table == [name for name in taken if name in of_table]


@FUNCTIONS
def test_no_parameter_has_to_be_given_by_python(function: Callable[..., Any]) -> None:
    """What is missing is then an `InputError`, which names it, and not a `TypeError`."""
    parameters = inspect.signature(function).parameters.values()
    assert {one.default for one in parameters if one.name in ROWS} == {None}


@DESCRIBED
def test_help_has_the_whole_text_of_every_parameter(function: Callable[..., Any]) -> None:
    text = " ".join(inspect.getdoc(function).split())  # type: ignore[union-attr]
    for name in inspect.signature(function).parameters:
        if name in ROWS:
            assert text.count(" ".join(ROWS[name].text.split())) == 1, name


@DESCRIBED
def test_docstrings_describe_every_argument_in_the_order_of_the_signature(
    function: Callable[..., Any],
) -> None:
    docstring = inspect.getdoc(function) or ""
    section = docstring.partition("Parameters\n----------\n")[2].partition("\n\nReturns\n")[0]
    described: list[str] = []
    for heading in re.findall(r"^(\w[\w, ]*)(?: :|$)", section, flags=re.MULTILINE):
        described += heading.split(", ")
    assert sorted(described) == sorted(inspect.signature(function).parameters)
    single = [name for name in inspect.signature(function).parameters if f"\n{name} :" in docstring]
    assert [name for name in described if name in single] == single


@DESCRIBED
def test_sources_do_not_describe_parameters_of_the_table_again(
    function: Callable[..., Any],
) -> None:
    source = inspect.getsource(function)
    written = re.findall(r"^    (\w[\w, ]*)(?: : .*)?$", source, flags=re.MULTILINE)
    assert {name for names in written for name in names.split(", ")}.isdisjoint(ROWS)


def test_sweep_files_and_the_command_line_take_the_parameters_of_the_table() -> None:
    of_excitation = {"polarity"}
    assert {*spec.KEYS["axes"]} == {*ROWS} - of_excitation
    assert {*spec.KEYS["cases"]} == {*ROWS} - of_excitation | {"label"}
    assert {*inspect.signature(ParameterOptions).parameters} == {*ROWS} - {"azimuth"}


@pytest.mark.parametrize("name", [name for name in ROWS if name != "polarity"])
def test_values_at_the_bounds_are_taken_and_those_beyond_are_refused(name: str) -> None:
    row = ROWS[name]
    for end in (row.bound.low, row.bound.high):
        assert check_values(row.name, end) == end
    too_large = 2.0 * row.bound.high
    with pytest.raises(slipsweep.InputError, match=re.escape(f"{row.name} = ")) as refusal:
        check_values(row.name, too_large)
    assert row.bound.text in str(refusal.value)
