"""Every flag against its definition, in plain Python that shares nothing with the kernels."""

import functools
import math
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import assume, given
from hypothesis import strategies as st

import slipsweep
from slipsweep import Validity
from slipsweep.model.variables import CAUTIONS, NOTES, VALUELESS
from tests.support import strategies
from tests.support.flag_definitions import Interface, flags_of_record, flags_of_sine

CELLS = 400
MODELS = [slipsweep.Mendez(r, o) for r in ("monotone", "literal") for o in ("eq12", "integrate")]
GIVEN = [
    (),
    ("yield_acceleration",),
    ("yield_acceleration", "decay_rate"),
    ("decay_rate", "delta_mu"),
    ("delta_mu", "minimum_friction"),
    ("yield_acceleration", "decay_rate", "delta_mu"),
]


def drawn(seed: int, names: tuple[str, ...]) -> dict[str, Any]:
    """Cells of all kinds: from slopes that stand alone to steep ones, from rest to beyond uplift."""
    rng = np.random.default_rng(seed)
    theta = np.where(rng.random(CELLS) < 0.1, 0.0, rng.uniform(0.0, 40.0, CELLS))
    mu_s = np.tan(np.radians(theta)) * rng.uniform(0.9, 1.2, CELLS) + rng.uniform(0.02, 1.0, CELLS)
    # where Eq. 7 has no limit
    rough = (rng.random(CELLS) < 0.1) & (theta > 20.0)
    steep = np.tan(np.radians(np.maximum(theta, 20.0)))
    mu_s = np.where(rough, steep + rng.uniform(0.9, 1.3, CELLS) / steep, mu_s)
    onset = 9.81 * np.tan(np.arctan(mu_s) - np.radians(theta))
    given = {
        "yield_acceleration": onset * rng.uniform(-0.05, 1.0, CELLS),
        "decay_rate": rng.uniform(0.0, 12.0, CELLS),
        "delta_mu": rng.uniform(0.0, 0.5, CELLS),
        "minimum_friction": rng.uniform(0.01, 0.4, CELLS),
    }
    limit = (given["yield_acceleration"] if "yield_acceleration" in names else onset) + 9.81 * mu_s
    amplitude = limit * rng.choice([0.3, 0.6, 1.0, 1.8], CELLS) * rng.uniform(0.7, 1.5, CELLS)
    return {"theta": theta, "mu_s": mu_s, "amplitude": np.abs(amplitude), **{name: given[name] for name in names}}


def told(cells: dict[str, Any], model: Any, cycles: int, solver: str) -> xr.Dataset:
    zipped: dict[str, Any] = {name: xr.DataArray(values, dims="cell") for name, values in cells.items()}
    return slipsweep.sweep(
        **zipped,
        frequency=2.0,
        excitation=slipsweep.Sine(cycles=cycles),
        model=model,
        solver=solver,
        variables=["permanent_displacement", "sliding_mode", "validity"],
    )


@functools.cache
def defined(number: int, names: tuple[str, ...], cycles: int, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """Flags by their definitions, and those that are decided: the same for both solvers."""
    cells = drawn(number, names)
    optional = [cells.get(name, np.full(CELLS, math.nan)) for name in FRICTION]
    interface = Interface(np.tan(np.radians(cells["theta"])), cells["mu_s"], cells["amplitude"], *optional)
    options = (model.name, *(getattr(model, name, "") for name in ("rise", "recoupling")))
    return flags_of_sine(interface, cycles, *options)


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize("model", [*MODELS, slipsweep.Newmark()], ids=str)
def test_random_cells_have_the_flags_of_their_definitions(solver: str, model: Any) -> None:
    seen, raised = 0, 0
    undecided = 0
    for number, names in enumerate(GIVEN):
        cells, cycles = drawn(number, names), 1 + number % 3
        expected, decided = defined(number, names, cycles, model)
        found = told(cells, model, cycles, solver)
        flags = found.validity.values.astype(int)
        wrong = np.flatnonzero((flags ^ expected) & decided)
        assert not wrong.size, "\n".join(
            f"{ {name: float(values[j]) for name, values in cells.items()} }, {cycles} cycles: "
            f"{Validity(int(flags[j]))!r}, by definition {Validity(int(expected[j]))!r}"
            for j in wrong[:5]
        )
        seen, undecided = seen + CELLS, undecided + int(np.count_nonzero(decided != 2047))
        raised |= int(np.bitwise_or.reduce(flags).item())
        np.testing.assert_array_equal(np.isnan(found.permanent_displacement), flags & int(VALUELESS) != 0)
        np.testing.assert_array_equal(found.permanent_displacement < 0, flags & int(Validity.UPSLOPE) != 0)
    assert undecided < 0.1 * seen
    if model == slipsweep.Newmark():
        assert raised == Validity.STATICALLY_UNSTABLE
    else:
        never = 0 if model.rise == "literal" else Validity.KD_NOT_POSITIVE
        never |= 0 if model.recoupling == "eq12" else Validity.NOT_RECOUPLED
        assert Validity(raised) | never == Validity(2047) & ~Validity.FLEXIBLE_BLOCK | never


FRICTION = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize("border", [0.9, 1.1])
@strategies.reproducible
@given(theta=strategies.thetas, mu_s=st.floats(0.1, 0.8), share=st.floats(0.1, 0.9))
def test_near_the_mode_limit_begins_and_ends_at_the_number(
    solver: str, border: float, theta: float, mu_s: float, share: float
) -> None:
    """The bit goes with ξ as it is returned, to the last digit of the amplitude."""
    onset = strategies.coulomb_yield(theta, mu_s) * share
    limit = strategies.limiting_acceleration(theta, mu_s, onset)
    assume(onset > 0 and limit > 0 and border * limit * math.tan(math.radians(theta)) <= 9.0)
    amplitudes = [border * limit]
    for _ in range(4):
        amplitudes = [math.nextafter(amplitudes[0], 0.0), *amplitudes, math.nextafter(amplitudes[-1], math.inf)]
    found = slipsweep.sweep(
        theta, mu_s, amplitudes, 1.0, yield_acceleration=onset, solver=solver, decay_rate=3.0,
        variables=["acceleration_ratio", "validity", "sliding_mode"],
    )  # fmt: skip
    near = (found.validity.values & Validity.NEAR_MODE_LIMIT) != 0
    ratio = found.acceleration_ratio.values
    np.testing.assert_array_equal(near, (ratio >= 0.9) & (ratio <= 1.1) & (found.sliding_mode.values > 0))
    assert near.any()
    assert not near.all()


@st.composite
def records(draw: st.DrawFn) -> np.ndarray:
    samples = draw(st.lists(st.floats(-1.0, 1.0).map(lambda x: round(x, 3)), min_size=3, max_size=25))
    return np.array([0.0, *samples, 0.0])


@strategies.reproducible
@given(
    samples=records(),
    theta=strategies.thetas,
    mu_s=st.floats(0.15, 0.9),
    strength=st.floats(0.3, 1.6),
    share=st.none() | st.floats(0.05, 1.0),
    friction=st.fixed_dictionaries({}, optional={"decay_rate": st.floats(0, 8), "delta_mu": st.floats(0, 0.4)}),
)
def test_a_record_has_the_flags_of_its_pulses(
    samples: np.ndarray, theta: float, mu_s: float, strength: float, share: float | None, friction: dict[str, float]
) -> None:
    onset = strategies.coulomb_yield(theta, mu_s)
    assume(onset > 0.05 and samples.any())
    limit = strategies.limiting_acceleration(theta, mu_s, onset)
    shaking = np.array((samples * strength * limit).tolist())
    record = slipsweep.Record(np.array([0.05 * k for k in range(samples.size)]), shaking)
    own: dict[str, Any] = dict(friction) if share is None else friction | {"yield_acceleration": onset * share}
    found = slipsweep.sweep(theta, mu_s, excitation=record, **own)
    raised = int(found.validity)
    if raised & VALUELESS:
        assert not raised & (Validity.UPSLOPE | Validity.NEAR_MODE_LIMIT | Validity.FRICTION_ESTIMATED)
        return
    expected, decided = flags_of_record(theta, mu_s, shaking, float(found.permanent_displacement), own)
    assert Validity((raised ^ expected) & decided & ~int(Validity.NOT_RECOUPLED)) == Validity(0)
    newmark = slipsweep.sweep(theta, mu_s, excitation=record, model="newmark")
    assert int(newmark.validity) == 0


def test_flags_of_a_value_need_one_and_friction_parameters_have_those_before_the_motion() -> None:
    cell: dict[str, Any] = {"theta": 10.0, "mu_s": 0.5, "amplitude": 3.2, "frequency": 1.0}
    none = slipsweep.sweep(**cell, model=slipsweep.Mendez(rise="literal"))
    assert int(none.validity) == Validity.KD_NOT_POSITIVE | Validity.YIELD_GOVERNS
    near = slipsweep.friction_parameters(theta=10.0, mu_s=0.5, amplitude=8.0)
    assert int(near.validity) == Validity.NEAR_MODE_LIMIT
    assert CAUTIONS & NOTES == CAUTIONS & VALUELESS == NOTES & VALUELESS == Validity(0)
    assert Validity(2047) == CAUTIONS | NOTES | VALUELESS


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_a_ramp_that_ends_too_soon_moves_no_block_and_raises_no_flag(solver: str) -> None:
    """Between two ramps the shaking stays below the yield acceleration; the mode goes by the peak without them."""
    found = slipsweep.sweep(5.0, 0.4, [3.2, 4.5], 1.0, excitation=slipsweep.Sine(1, 0.5, 0.5), solver=solver)
    np.testing.assert_array_equal(found.permanent_displacement, [0.0, 0.0])
    np.testing.assert_array_equal(found.validity, [0, 0])
    assert (found.sliding_mode > 0).all()
