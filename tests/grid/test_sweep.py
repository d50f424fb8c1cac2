"""`sweep` and its siblings as functions: arguments, results, refusals and costs."""

import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.grid import solvers
from slipsweep.model.variables import (
    DEFAULT_RESULTS,
    FRICTION_PARAMETERS,
    PARAMETERS,
    RESULT_DTYPES,
    RESULTS,
    Validity,
)
from tests.support.cases import choices

AXES: dict[str, Any] = {
    "theta": [0.0, 5.0, 12.0],
    "mu_s": [0.3, 0.6],
    "amplitude": [0.5, 2.0, 4.0, 8.0],
    "frequency": [0.5, 1.0, 2.0, 4.0, 8.0],
}

GOOD: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.0, "frequency": 1.0}


@pytest.fixture
def cells_solved(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Cells of each call of a motion kernel."""
    solved: list[int] = []
    solver_of = solvers.solver_of

    def counting(*arguments: Any) -> Any:
        solver = solver_of(*arguments)

        def call(cells: Any, results: Any) -> None:
            solved.append(results.shape[1])
            solver.solve(cells, results)

        return solver._replace(solve=call)

    monkeypatch.setattr(solvers, "solver_of", counting)
    return solved


# ------------------------------------------------------------------- dimensions and shapes


def test_arrays_are_crossed_in_the_order_of_the_results() -> None:
    result = slipsweep.sweep(**dict(reversed(AXES.items())))
    assert tuple(result.data_vars) == DEFAULT_RESULTS
    for name in DEFAULT_RESULTS:
        assert result[name].dims == ("theta", "mu_s", "amplitude", "frequency")
        assert result[name].shape == (3, 2, 4, 5)
        assert result[name].dtype == RESULT_DTYPES.get(name, "float64")
        assert isinstance(result[name].data, np.ndarray)
        assert result[name].attrs == RESULTS[name]
    for name, values in AXES.items():
        np.testing.assert_array_equal(result[name], values)
        assert result[name].attrs == PARAMETERS[name]


def test_scalars_become_scalar_coordinates() -> None:
    result = slipsweep.sweep(5, 0.38, 3.55, 1.8, yield_acceleration=0.59)
    assert result.sizes == {}
    assert result.permanent_displacement.shape == ()
    assert {name: result[name].item() for name in result.coords} == {
        "theta": 5.0,
        "mu_s": 0.38,
        "amplitude": 3.55,
        "frequency": 1.8,
        "yield_acceleration": 0.59,
    }


@pytest.mark.parametrize(
    "kind", [list, tuple, np.array, lambda x: np.array(x, np.float32)[::-1][::-1], range]
)
def test_any_row_of_numbers_is_an_axis(kind: Any) -> None:
    row = kind(3) if kind is range else kind([0, 1, 2])
    result = slipsweep.sweep(row, 0.38, 3.5, 2.0)
    assert result.theta.dtype == np.float64
    np.testing.assert_array_equal(result.theta, [0, 1, 2])
    expected = [
        slipsweep.sweep(theta, 0.38, 3.5, 2.0).permanent_displacement.item() for theta in (0, 1, 2)
    ]
    np.testing.assert_array_equal(result.permanent_displacement, expected)


def test_arrays_on_one_dimension_are_zipped() -> None:
    theta = xr.DataArray([2.0, 6.0, 9.0], dims="case", coords={"case": ["a", "b", "c"]})
    mu_s = xr.DataArray([0.3, 0.5, 0.4], dims="case", attrs={"made_by": "hand"})
    result = slipsweep.sweep(theta, mu_s, [2.0, 4.0], xr.DataArray([1.0, 2.0, 3.0], dims="case"))
    assert result.permanent_displacement.dims == ("amplitude", "case")
    assert list(result["case"].values) == ["a", "b", "c"]
    assert result.mu_s.attrs == {"made_by": "hand", **PARAMETERS["mu_s"]}
    for at in range(3):
        case = slipsweep.sweep(float(theta[at]), float(mu_s[at]), [2.0, 4.0], at + 1.0)
        xr.testing.assert_equal(result.isel(case=at).drop_vars("case"), case)


def test_an_array_of_two_dimensions_keeps_them() -> None:
    frequency = xr.DataArray([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], dims=("site", "mode"))
    result = slipsweep.sweep([0.0, 5.0], 0.38, 4.0, frequency)
    assert result.permanent_displacement.dims == ("theta", "site", "mode")
    assert result.frequency.dims == ("site", "mode")
    expected = slipsweep.sweep(
        [0.0, 5.0], 0.38, 4.0, frequency.values.ravel()
    ).permanent_displacement
    np.testing.assert_array_equal(result.permanent_displacement, expected.values.reshape(2, 3, 2))


def test_a_lazy_parameter_is_computed() -> None:
    theta = xr.DataArray([0.0, 5.0], dims="case").chunk(1)
    result = slipsweep.sweep(theta, 0.38, 4.0, 1.0)
    assert isinstance(result.theta.data, np.ndarray)
    assert result.permanent_displacement.dims == ("case",)


def test_parameters_are_copied() -> None:
    theta = np.array([0.0, 5.0])
    result = slipsweep.sweep(theta, 0.38, 4.0, 1.0)
    theta[:] = 1.0
    np.testing.assert_array_equal(result.theta, [0.0, 5.0])


def test_a_displacement_amplitude_gives_the_amplitude_of_the_acceleration() -> None:
    frequency = np.array([0.5, 1.0, 2.0])
    displacement = np.array([0.01, 0.05])
    names = ["permanent_displacement", "acceleration_ratio", "amplitude"]
    result = slipsweep.sweep(
        5.0, 0.38, frequency=frequency, displacement_amplitude=displacement, variables=names
    )
    assert result.permanent_displacement.dims == ("displacement_amplitude", "frequency")
    np.testing.assert_allclose(
        result.amplitude, np.multiply.outer(displacement, (2 * np.pi * frequency) ** 2)
    )
    assert result.amplitude.attrs == PARAMETERS["amplitude"]
    for i, j in np.ndindex(2, 3):
        cell = slipsweep.sweep(
            5.0, 0.38, result.amplitude.values[i, j], frequency[j], variables=names
        )
        for name in names[:2]:
            assert cell[name].item() == result[name].values[i, j]


def test_a_grid_of_displacement_amplitudes_is_lazy() -> None:
    """4e10 amplitudes would take 320 GB."""
    grid: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.38,
        "displacement_amplitude": np.linspace(0.01, 0.4, 200_000),
        "frequency": np.linspace(0.1, 3.0, 200_000),
    }
    with pytest.raises(InputError, match="of memory is free"):
        slipsweep.sweep(**grid)
    lazy = slipsweep.sweep(**grid, chunks="auto", variables=["permanent_displacement", "amplitude"])
    assert sum(coordinate.nbytes for coordinate in lazy.coords.values()) < 4e6
    assert lazy.amplitude.shape == lazy.permanent_displacement.shape == (200_000, 200_000)


def test_structure_frequency_sets_a_flag_and_no_more() -> None:
    fs = np.array([0.5, 1.0, 4.0, 50.0])
    plain = slipsweep.sweep(**AXES)
    result = slipsweep.sweep(**AXES, structure_frequency=fs)
    ratio = result.frequency / result.structure_frequency
    flexible = (ratio >= 0.2) & (ratio <= 1.3)
    expected = plain.validity | (flexible * int(Validity.FLEXIBLE_BLOCK))
    xr.testing.assert_equal(
        result.validity, expected.transpose(*result.validity.dims).astype("int16")
    )
    for name in ("permanent_displacement", "sliding_mode"):
        assert (
            result[name].isel(structure_frequency=0).values == plain[name].values
        ).sum() == np.isfinite(plain[name]).sum()
    assert "validity" not in slipsweep.sweep(
        **AXES, structure_frequency=fs, variables=["sliding_mode"]
    )


def test_a_structure_is_flexible_from_a_fifth_to_thirteen_tenths_of_its_frequency() -> None:
    ratio = np.array([0.199, 0.2, 0.7, 1.3, 1.301])
    result = slipsweep.sweep(**{**GOOD, "frequency": 2.0 * ratio}, structure_frequency=2.0)
    flexible = (result.validity & int(Validity.FLEXIBLE_BLOCK)) != 0
    np.testing.assert_array_equal(flexible, [False, True, True, True, False])


# ------------------------------------------------------------------------ what is computed


def test_variables_are_returned_as_asked() -> None:
    result = slipsweep.sweep(
        **AXES, variables=["limiting_acceleration", "validity", "permanent_displacement"]
    )
    assert tuple(result.data_vars) == (
        "permanent_displacement",
        "validity",
        "limiting_acceleration",
    )
    # Eqs. 7-11 do not know of the frequency
    assert result.limiting_acceleration.dims == ("theta", "mu_s", "amplitude")
    friction = slipsweep.friction_parameters(
        *(AXES[name] for name in ("theta", "mu_s", "amplitude"))
    )
    np.testing.assert_array_equal(result.limiting_acceleration, friction.limiting_acceleration)
    everything = slipsweep.sweep(**AXES)
    np.testing.assert_array_equal(result.validity, everything.validity)
    # without the peak velocity the kernel may sum in another order
    np.testing.assert_allclose(
        result.permanent_displacement, everything.permanent_displacement, rtol=1e-13
    )


def test_a_given_parameter_is_a_coordinate_and_no_result() -> None:
    result = slipsweep.sweep(**AXES, delta_mu=0.1, variables=["delta_mu", "decay_rate"])
    assert tuple(result.data_vars) == ("decay_rate",)
    assert result.delta_mu.item() == 0.1


@pytest.mark.parametrize("shaking", ["wave", "record"])
def test_newmarks_displacement_beside_ours_is_that_of_newmarks_block(shaking: str) -> None:
    """With the same yield acceleration, at every frequency or time scale."""
    arguments: dict[str, Any] = {"theta": 5.0, "mu_s": [0.3, 0.4], "yield_acceleration": 1.0}
    if shaking == "wave":
        arguments |= {"amplitude": [2.0, 5.0], "frequency": [0.5, 1.0, 3.0]}
    else:
        values = 4.0 * np.sin(np.arange(200) * 0.1)
        record = slipsweep.Record.sampled(values, 0.02)
        arguments |= {"excitation": record, "time_scale": [0.5, 1.0, 3.0], "scale": [1.0, 2.0]}
    names = ["permanent_displacement", "newmark_displacement"]
    result = slipsweep.sweep(**arguments, variables=names)
    expected = slipsweep.sweep(**arguments, model="newmark").permanent_displacement
    np.testing.assert_allclose(result.newmark_displacement, expected, rtol=1e-13)
    clock = "frequency" if shaking == "wave" else "time_scale"
    assert (expected.diff(clock) != 0.0).all()
    assert (result.permanent_displacement != expected).any()


def test_a_yield_coefficient_is_of_the_models_own_gravity() -> None:
    moon = slipsweep.Newmark(g=1.62)
    shaking: dict[str, Any] = {"amplitude": [0.3, 1.0], "frequency": 1.0, "model": moon}
    result = slipsweep.sweep(yield_coefficient=[0.05, 0.1], **shaking)
    expected = slipsweep.sweep(0.0, 0.5, yield_acceleration=[0.081, 0.162], **shaking)
    np.testing.assert_allclose(
        result.permanent_displacement.transpose("yield_coefficient", "amplitude"),
        expected.permanent_displacement.transpose("yield_acceleration", "amplitude"),
        rtol=1e-13,
    )


def test_nothing_unasked_is_computed(cells_solved: list[int]) -> None:
    result = slipsweep.sweep(**AXES, variables=FRICTION_PARAMETERS)
    assert tuple(result.data_vars) == tuple(name for name in RESULTS if name in FRICTION_PARAMETERS)
    assert not cells_solved
    assert slipsweep.sweep(**AXES, variables=["sliding_mode"]).data_vars.keys() == {"sliding_mode"}


FURTHER_RESULT = """
import slipsweep
found = slipsweep.sweep(5, 0.4, [1.0, 4.0], 2.0, excitation="triangle", variables=["lucky"])
print(found.lucky.attrs["units"], found.lucky.values.tolist())
"""


def test_a_kernel_result_is_added_in_one_place(tmp_path: Path) -> None:
    """A field of `Motion` that `model.variables` names: the exact walk and the grid have it."""
    package = tmp_path / "slipsweep"
    source = Path(slipsweep.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    results = "\nRESULTS: dict[str, dict[str, Any]] = {\n"
    for module, line, added in (
        ("kernels/block.py", "    continuous_pulses: float\n", "    lucky: float = 7.0\n"),
        ("model/variables.py", results, '    "lucky": _cf("1", "a number"),\n'),
    ):
        text = (package / module).read_text(encoding="utf-8")
        assert text.count(line) == 1
        (package / module).write_text(text.replace(line, line + added), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", FURTHER_RESULT],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"},
    )
    assert (done.stdout, done.stderr) == ("1 [7.0, 7.0]\n", "")


def test_progress_counts_every_cell_once() -> None:
    seen: list[int] = []
    slipsweep.sweep(
        np.linspace(0, 15, 400),
        np.linspace(0.2, 0.9, 40),
        [1.0, 3.0],
        [1.0, 2.0],
        progress=seen.append,
    )
    assert sum(seen) == 400 * 40 * 2 * 2
    assert len(seen) > 1


@pytest.mark.parametrize(
    ("chunks", "scheduler"),
    [
        ("auto", "threads"),
        (2, "processes"),
        ({"theta": 1, "amplitude": 3}, "synchronous"),
        ((3, 2, (1, 3), -1), "threads"),
    ],
)
def test_chunked_is_eager_to_the_bit(chunks: Any, scheduler: str) -> None:
    options: dict[str, Any] = {
        **AXES,
        "structure_frequency": 4.0,
        "variables": [*DEFAULT_RESULTS, "decay_rate"],
    }
    lazy = slipsweep.sweep(**options, chunks=chunks)
    assert all(hasattr(lazy[name].data, "dask") for name in lazy.data_vars)
    eager = slipsweep.sweep(**options)
    assert {name: lazy[name].dtype for name in lazy} == {name: eager[name].dtype for name in eager}
    xr.testing.assert_identical(
        lazy.compute(scheduler=scheduler, num_workers=1 + (scheduler == "threads")), eager
    )


def test_a_lazy_sweep_computes_nothing(cells_solved: list[int]) -> None:
    big = np.linspace(0.1, 10, 300)
    lazy = slipsweep.sweep(big, big, big, big, chunks="auto")
    assert lazy.nbytes > 1e11
    assert not cells_solved
    lazy.permanent_displacement[3, 4, 5, 6].compute()
    assert 0 < sum(cells_solved) < 1e7


def test_all_results_of_a_chunk_are_computed_once(cells_solved: list[int]) -> None:
    lazy = slipsweep.sweep(**AXES, variables=DEFAULT_RESULTS, chunks={"theta": 1})
    lazy.compute(scheduler="synchronous")
    assert sum(cells_solved) == 3 * 2 * 4


# ------------------------------------------------------------------------------ attributes


def test_a_history_has_the_results_of_the_sweep() -> None:
    block: dict[str, Any] = {
        **GOOD,
        "yield_acceleration": 0.59,
        "excitation": slipsweep.Sine(cycles=5),
    }
    history = slipsweep.simulate(**block)
    swept = slipsweep.sweep(**block)
    assert history.relative_displacement.dims == ("time",)
    results = history[list(DEFAULT_RESULTS)].drop_vars("time", errors="ignore")
    # a history goes from event to event, a sweep under a sine through batches
    xr.testing.assert_allclose(results, swept, rtol=1e-13, atol=0.0)
    assert [results[name].attrs for name in results] == [swept[name].attrs for name in swept]
    assert history.relative_displacement[-1].item() == pytest.approx(
        swept.permanent_displacement.item(), rel=1e-13
    )


def test_attributes_name_program_version_and_source() -> None:
    attrs = slipsweep.sweep(**GOOD).attrs
    assert attrs["title"] == "Permanent displacement of a rigid block, swept"
    assert attrs["source"] == f"slipsweep {__version__}"
    assert "10.1016/j.soildyn.2011.08.007" in attrs["references"]


def test_attributes_have_the_options_of_the_choices_made() -> None:
    attrs = slipsweep.sweep(**GOOD, excitation=slipsweep.Sine(cycles=3)).attrs
    expected = {
        "g": 9.81,
        "model": "mendez",
        "waveform": "sine",
        "cycles": 3,
        "rise": "monotone",
        "recoupling": "eq12",
        "solver": "cycle",
    }
    assert expected.items() <= attrs.items()
    assert not {"rule", "steps_per_cycle"} & {*attrs}


def test_attributes_have_no_options_of_the_choices_not_made() -> None:
    solver = slipsweep.Step(rule="simpson")
    attrs = slipsweep.sweep(**GOOD, model="newmark", solver=solver).attrs
    assert (attrs["rule"], attrs["steps_per_cycle"]) == ("simpson", 1024)
    assert not {"rise", "recoupling"} & {*attrs}
    assert "10.1680/geot.1965.15.2.139" in attrs["references"]


def test_attributes_of_friction_parameters_are_of_the_model_only() -> None:
    attrs = slipsweep.friction_parameters(5.0, 0.38, 3.0).attrs
    names = {"title", "source", "references", "model", "rise", "recoupling", "g"}
    assert attrs.keys() == names


# ---------------------------------------------------------------------------------- errors

BAD: list[tuple[dict[str, Any], str]] = [
    ({"theta": 90.0}, "theta = 90: must be 0 <= theta < 90 degrees"),
    ({"theta": [0.0, -1.0]}, "theta = -1: must be 0 <= theta < 90 degrees"),
    ({"mu_s": 0.0}, "mu_s = 0: must be a finite number > 0"),
    ({"mu_s": [0.3, math.inf]}, "mu_s = inf: must be a finite number > 0"),
    ({"amplitude": -0.5}, "amplitude = -0.5: must be a finite number >= 0"),
    ({"frequency": 0.0}, "frequency = 0: must be a finite number > 0"),
    (
        {"amplitude": None, "displacement_amplitude": -1.0},
        "displacement_amplitude = -1: must be a finite number >= 0",
    ),
    ({"yield_acceleration": math.nan}, "yield_acceleration = nan: must be a finite number"),
    ({"decay_rate": -1.0}, "decay_rate = -1: must be a finite number >= 0"),
    ({"delta_mu": -0.1}, "delta_mu = -0.1: must be a finite number >= 0"),
    ({"minimum_friction": 0.0}, "minimum_friction = 0: must be a finite number > 0"),
    ({"structure_frequency": 0.0}, "structure_frequency = 0: must be a finite number > 0"),
    ({"g": 0.0}, "g = 0: must be a finite number > 0"),
    ({"g": [9.8, 9.81]}, "g = [9.8, 9.81]: must be a single number"),
    ({"theta": "steep"}, "theta = 'steep': must be a number, or an array of numbers"),
    (
        {"theta": np.zeros((2, 2))},
        "theta: an array of 2 dimensions; must be a scalar, a 1-D array, or a DataArray",
    ),
    ({"theta": []}, "theta = []: must hold at least one value"),
    ({"amplitude": None}, "amplitude, displacement_amplitude: exactly one of them must be given"),
    (
        {"displacement_amplitude": 0.1},
        "amplitude, displacement_amplitude: exactly one of them must be given",
    ),
    ({"frequency": None}, "frequency: must be given"),
    (
        {"amplitude": None, "displacement_amplitude": [1e30, 1.0], "frequency": [1.0, 9e4]},
        "displacement_amplitude = 1e+30: with frequency = 90000, A = (2 pi f)^2 d = 3.",
    ),
    ({"cycles": 0}, "cycles = 0: must be a whole number >= 1"),
    ({"cycles": 2.5}, "cycles = 2.5: must be a whole number >= 1"),
    ({"cycles": 10**20}, "cycles = 100000000000000000000: must be a whole number <= 1000000000"),
    ({"solver": "step", "steps_per_cycle": 10}, "steps_per_cycle = 10: must be a multiple of 4"),
    ({"solver": "step", "steps_per_cycle": 4}, "steps_per_cycle = 4: must be a whole number >= 8"),
    (
        {"solver": "step", "steps_per_cycle": 40_000_000},
        "steps_per_cycle = 40000000: must be a whole number <= 16777216",
    ),
    (
        {"model": "coulomb"},
        "model = 'coulomb': must be one of 'mendez', 'newmark', or Mendez(...), Newmark(...)",
    ),
    ({"rise": "slow"}, "rise = 'slow': must be one of 'monotone', 'literal'"),
    ({"recoupling": "eq13"}, "recoupling = 'eq13': must be one of 'eq12', 'integrate'"),
    ({"waveform": "saw"}, "excitation = 'saw': must be one of 'sine'"),
    (
        {"solver": "fast"},
        "solver = 'fast': must be one of 'auto', 'cycle', 'step', or Cycle(...), Step(...)",
    ),
    (
        {"solver": "step", "rule": "euler"},
        "rule = 'euler': must be one of 'rectangle', 'trapezoid', 'simpson'",
    ),
    ({"variables": "validity"}, "variables = 'validity': must be a list of names"),
    (
        {"variables": ["displacement"]},
        "variables = 'displacement': must be one of 'permanent_displacement', ",
    ),
    ({"variables": []}, "variables = []: must name one of 'permanent_displacement', "),
    (
        {
            "theta": xr.DataArray([1.0, 2.0], dims="case"),
            "mu_s": xr.DataArray([0.3, 0.4, 0.5], dims="case"),
        },
        "mu_s: 3 values along 'case', where another parameter has 2",
    ),
    (
        {
            "theta": xr.DataArray([1.0, 2.0], dims="case", coords={"case": [1, 2]}),
            "mu_s": xr.DataArray([0.3, 0.4], dims="case", coords={"case": [1, 3]}),
        },
        "mu_s: its coordinate 'case' differs from that of another parameter",
    ),
    (
        {
            "theta": [0.0, 10.0],
            "mu_s": xr.DataArray([0.3, 0.4], dims="theta", coords={"theta": [0.0, 5.0]}),
        },
        "mu_s: its coordinate 'theta' differs from that of another parameter",
    ),
    ({"chunks": {"thet": 1}}, "chunks = {'thet': 1}: 'thet' is not a dimension; they are "),
    ({"theta": [1.0, 2.0], "chunks": ((1, 2),)}, "chunks = ((1, 2),): "),
]


BAD_HISTORIES: list[tuple[dict[str, Any], str]] = [
    ({"theta": [1.0, 2.0]}, "theta: simulate takes one case; must be a single number"),
    (
        {"mu_s": xr.DataArray([0.3], dims="case")},
        "mu_s: simulate takes one case; must be a single number",
    ),
    ({"theta": 95.0}, "theta = 95: must be 0 <= theta < 90 degrees"),
    ({"points_per_cycle": 3}, "points_per_cycle = 3: must be a whole number >= 4"),
    ({"points_per_cycle": 10**9, "cycles": 10**9}, "a history of 1e+18 points: takes "),
    ({"times": [0.0, 2.0, 1.0]}, "times: must be one row of finite, increasing numbers >= 0"),
    ({"times": [-1.0]}, "times: must be one row of finite, increasing numbers >= 0"),
    ({"times": [0.0, math.nan]}, "times: must be one row of finite, increasing numbers >= 0"),
    ({"times": [[0.0, 1.0]]}, "times: must be one row of finite, increasing numbers >= 0"),
]


@pytest.mark.parametrize(
    ("call", "change", "message"),
    [
        *((slipsweep.sweep, *bad) for bad in BAD),
        *((slipsweep.simulate, *bad) for bad in BAD_HISTORIES),
    ],
)
def test_bad_input_is_named(call: Callable[..., Any], change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        call(**choices(**{**GOOD, **change}))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_bad_friction_parameters_are_named() -> None:
    with pytest.raises(InputError, match="mu_s = -1: must be a finite number > 0"):
        slipsweep.friction_parameters(5.0, -1.0, 3.0)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"cycles": 15}, r"sweep\(\) has no argument 'cycles': give excitation=Sine\(cycles=15\)"),
        ({"rule": "simpson"}, r"give solver=Step\(rule='simpson'\)"),
        ({"g": 1.6}, r"give model=Mendez\(g=1.6\)"),
    ],
)
def test_an_option_in_the_wrong_place_is_told_where_it_goes(
    option: dict[str, Any], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        slipsweep.sweep(5, 0.4, 3.0, 2.0, **option)


def test_a_friction_angle_is_mu_s() -> None:
    angles = np.array([17.0, 22.0])
    result = slipsweep.sweep(5, phi=angles, amplitude=[3.0, 5.0], frequency=2.0)
    expected = slipsweep.sweep(5, np.tan(np.radians(angles)), amplitude=[3.0, 5.0], frequency=2.0)
    assert result.permanent_displacement.dims == ("phi", "amplitude")
    np.testing.assert_array_equal(result.phi, angles)
    np.testing.assert_array_equal(result.mu_s, expected.mu_s)
    np.testing.assert_array_equal(result.permanent_displacement, expected.permanent_displacement)
    with pytest.raises(InputError, match="phi, mu_s: must not both be given"):
        slipsweep.sweep(5, 0.4, phi=20, amplitude=3.0, frequency=2.0)


def test_units_of_arrays_are_converted() -> None:
    amplitude = xr.DataArray([0.3, 0.5], dims="amplitude", attrs={"units": "g"})
    result = slipsweep.sweep(5, 0.4, amplitude, 2.0)
    np.testing.assert_allclose(result.amplitude, [0.3 * 9.81, 0.5 * 9.81])
    with pytest.raises(InputError, match="amplitude"):
        slipsweep.sweep(5, 0.4, amplitude.assign_attrs(units="Hz"), 2.0)


def test_unknown_arguments_are_errors() -> None:
    with pytest.raises(TypeError, match="colour"):
        slipsweep.sweep(**{**GOOD, "colour": "red"})


def test_a_grid_too_large_for_memory_is_refused() -> None:
    axis = np.linspace(0.1, 10.0, 3000)
    with pytest.raises(
        InputError, match=r"grid of 3000 theta x .* x 3000 frequency, 8\.1e\+13 cells: takes .* TB"
    ):
        slipsweep.sweep(axis, axis, axis, axis)


# ---------------------------------------------------------------------------------- memory

MEMORY = """
from pathlib import Path
import numpy as np, xarray as xr
import slipsweep

def peak():  # not of getrusage: what that tells of a process begins with the memory of its parent
    status = Path('/proc/self/status').read_text()
    return int(status.partition('VmHWM:')[2].split()[0]) * 1024

def run(sizes):
    return {call}

run((3, 3, 3, 3))  # imports, machine code and thread stacks
before = peak()
result = run((100, 100, 100, 20))
print((peak() - before) / result.nbytes)
"""

AXES_OF = (
    "np.linspace(0, 20, sizes[0]), np.linspace(0.2, 0.9, sizes[1]), "
    "np.linspace(0.5, 13, sizes[2]), np.linspace(0.1, 20, sizes[3])"
)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="asks Linux for the memory of a process"
)
@pytest.mark.parametrize(
    "call",
    [
        f"slipsweep.sweep({AXES_OF}, variables=['permanent_displacement'])",
        "slipsweep.sweep(5.0, 0.5, 4.0, np.linspace(0.1, 9, sizes[0] * sizes[3]), "
        "variables=['validity'], "
        "structure_frequency=np.linspace(0.1, 9, sizes[1] * sizes[2]))",
    ],
    ids=["displacement", "structure_frequency"],
)
def test_peak_memory_is_that_of_the_result(call: str) -> None:
    """At most 1.2 times its bytes, beyond what a small sweep takes."""
    done = subprocess.run(
        [sys.executable, "-c", MEMORY.format(call=call)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 1.2
