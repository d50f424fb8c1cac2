"""The inverse of the sweep: limit amplitudes against the sweep itself, closed forms, dense scans
and scaling laws.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import slipsweep
from slipsweep import InputError, Mendez, Record, SlidingMode, Validity, limit_amplitude, sweep
from slipsweep.model.variables import RECORD_COUNTS, LimitStatus
from tests.support.cases import choices
from tests.support.commands import command
from tests.support.made_up_records import few_pulses, made, write_motion


def sweep_at(amplitude: xr.DataArray, inputs: dict[str, Any], **options: Any) -> xr.DataArray:
    given: dict[str, Any] = {
        name: xr.DataArray(values, dims=name) if np.ndim(values) else values
        for name, values in inputs.items()
    }
    result = sweep(
        **choices(
            amplitude=amplitude.fillna(0.0),
            **given,
            solver="cycle",
            variables=["permanent_displacement"],
            **options,
        )
    )
    return result["permanent_displacement"]


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rise": "literal"},
        {"recoupling": "integrate"},
        {"model": "newmark"},
        {"yield_acceleration": 0.6},
    ],
    ids=str,
)
def test_inverse_of_sweep_to_the_last_bit(options: dict[str, Any]) -> None:
    inputs: dict[str, Any] = {
        "theta": [0.0, 6.0, 14.0],
        "mu_s": [0.2, 0.38, 0.7, 1.2],
        "frequency": [0.3, 1.0, 7.0],
    }
    displacement = [1e-3, 0.05, 0.8]
    limits = limit_amplitude(displacement, **choices(**inputs, **options))
    assert limits.limit_amplitude.dims == ("theta", "mu_s", "frequency", "displacement")
    found = limits.limit_amplitude.notnull()
    assert found.mean() > 0.5
    target = xr.DataArray(displacement, dims="displacement")
    at = sweep_at(limits.limit_amplitude, inputs, **options).transpose(*found.dims)
    before = xr.apply_ufunc(np.nextafter, limits.limit_amplitude, 0.0)
    below = sweep_at(before, inputs, **options).transpose(*found.dims)
    assert bool((at >= target).where(found, True).all())
    assert not bool(((below >= target) & found).any())
    np.testing.assert_array_equal(at.where(found), limits.permanent_displacement)
    # the status says which of the two kinds of NaN it is, and nothing else is NaN
    np.testing.assert_array_equal(limits.limit_status >= LimitStatus.NOT_REACHED, ~found)


def test_limits_of_newmarks_block_are_those_of_the_closed_form() -> None:
    """One pulse of Newmark's block, solved by Brent's method on the classical closed form."""
    yielded = 1.5
    omega = 2 * math.pi * 2.0
    g = 9.81
    block: dict[str, Any] = {
        "yield_acceleration": yielded,
        "model": "newmark",
        "excitation": slipsweep.Sine(cycles=1),
    }

    def displacement(amplitude: float) -> float:
        start = math.asin(yielded / amplitude)

        def velocity(phase: float) -> float:
            return amplitude * (math.cos(start) - math.cos(phase)) - yielded * (phase - start)

        stop = brentq(velocity, math.pi - start, start + 2 * math.pi, xtol=1e-15)
        slid = stop - start
        travel = (
            amplitude * (slid * math.cos(start) - math.sin(stop) + math.sin(start))
            - yielded * slid * slid / 2
        )
        return float(travel) / omega**2

    for target in (1e-4, 0.004, 0.02):
        expected = brentq(
            lambda a, target=target: displacement(a) - target, yielded * 1.0001, 5 * g, xtol=1e-14
        )
        limits = limit_amplitude(target, 3, 0.5, 2.0, maximum_amplitude=5 * g, **block)
        assert limits.limit_amplitude.item() == pytest.approx(expected, rel=1e-10)
        assert limits.limit_status.item() == LimitStatus.REACHED


def test_a_target_within_the_jump_is_reached_at_the_mode_limit() -> None:
    limit = slipsweep.friction_parameters(5, 0.3, 1.0).limiting_acceleration.item()
    amplitudes = np.concatenate([np.linspace(2.0, limit, 20_001), [np.nextafter(limit, np.inf)]])
    moved = sweep(5, 0.3, amplitudes, 2.0).permanent_displacement.values
    below = moved[:-1].max()
    above = moved[-1]
    assert above > 1.5 * below
    limits = limit_amplitude(np.linspace(below * 1.001, above * 0.999, 5), 5, 0.3, 2.0)
    np.testing.assert_array_equal(limits.limit_amplitude, np.nextafter(limit, np.inf))
    assert (limits.limit_status == LimitStatus.AT_MODE_JUMP).all()
    assert (limits.sliding_mode == SlidingMode.CONTINUOUS).all()


def test_a_target_beyond_a_gap_without_values_is_reached_after_it() -> None:
    """With mu_s > 1 the calibrated decay rate is not positive below the mode limit, from xi =
    mu_s^-1/2 on.
    """
    given: dict[str, Any] = {"theta": 10, "mu_s": 1.2, "frequency": 1.0, "yield_acceleration": 4.0}
    limit = slipsweep.friction_parameters(
        10, 1.2, 1.0, yield_acceleration=4.0
    ).limiting_acceleration.item()
    edge = limit / math.sqrt(1.2)
    amplitudes = np.linspace(4.0, edge * (1 - 1e-12), 20_001)
    below = sweep(**choices(amplitude=amplitudes, **given)).permanent_displacement.max().item()
    assert sweep(**choices(amplitude=edge * (1 + 1e-9), **given)).permanent_displacement.isnull()
    limits = limit_amplitude([below * 0.5, below * 1.001], **choices(**given))
    assert limits.limit_amplitude[0].item() < edge
    assert limits.limit_amplitude[1].item() == np.nextafter(limit, np.inf)
    assert limits.limit_status[1].item() == LimitStatus.AFTER_GAP
    limits = limit_amplitude(
        [below * 0.5, below * 1.001], **choices(**given | {"frequency": [1.0, 2.0]})
    )
    legend = [text.get_text() for text in limits.slipsweep.chart().legends[0].get_texts()]
    assert "set by a discontinuity\nof the model" in legend


def test_smallest_amplitude_of_a_dense_scan() -> None:
    """Brute force: the first of 200 000 amplitudes of `sweep` that reaches the target lies just
    above the limit.
    """
    amplitudes = np.linspace(0.3, 20, 200_001)
    step = amplitudes[1] - amplitudes[0]
    cases: list[tuple[float, float, dict[str, Any]]] = [
        (5, 0.3, {}),
        (12, 0.5, {"recoupling": "integrate"}),
        (2, 0.4, {"rise": "literal"}),
    ]
    for theta, mu_s, options in cases:
        moved = sweep(
            theta, mu_s, amplitudes, 1.5, **choices(**options)
        ).permanent_displacement.values
        targets = np.geomspace(1e-4, np.nanmax(moved), 60)[:-1]
        limits = limit_amplitude(
            targets, theta, mu_s, 1.5, **choices(**options)
        ).limit_amplitude.values
        first = amplitudes[(moved[:, np.newaxis] >= targets).argmax(axis=0)]
        assert ((first - limits >= 0) & (first - limits <= step)).all()


def test_beside_a_gap_every_displacement_is_reached() -> None:
    """With the literal rise Kd comes to 0 at the gap's edge, and the run-out v²/(2 g Kd) beyond all
    bounds.
    """
    given: dict[str, Any] = {
        "theta": 0,
        "mu_s": [0.3, 0.4, 0.6],
        "yield_acceleration": 1.0,
        "frequency": 1.0,
    }
    given["model"] = Mendez("literal")
    limits = limit_amplitude([1e3, 1e6, 1e9], **given).transpose("mu_s", "displacement")
    assert (limits.limit_status[:, 2] == LimitStatus.AFTER_GAP).all()
    assert (limits.permanent_displacement >= limits.displacement).all()
    edges = limits.limit_amplitude.values[:, 2]
    assert (np.ptp(limits.limit_amplitude.values, axis=1) <= 1e-9 * edges).all()
    for mu_s, edge in zip(given["mu_s"], edges, strict=True):
        one = given | {"mu_s": mu_s}
        below = sweep(amplitude=np.nextafter(edge, 0), **one)
        assert int(below.validity) & Validity.KD_NOT_POSITIVE
        assert sweep(amplitude=edge * (1 + 1e-3), **one).permanent_displacement < 1e5


def test_narrow_peaks_of_blocks_that_do_not_recouple_are_found() -> None:
    """The limit is never above the first of 20 000 amplitudes that reaches the target: u(A) is a
    saw, or has a kink.
    """
    names = ("theta", "mu_s", "yield_acceleration", "displacement")
    rows = [
        (2.3172513553765843, 0.1577915701729295, 0.0515279329701465, 1.9511674594282442),
        (0.36648698271118385, 0.46619195565406957, 0.10852104853669972, 5.5909408592753485),
        (15.89918679025317, 0.4068037810141504, 0.6496015442182281, 3.7266584270787724),
        (24.5976881494476, 0.3295178983842375, 0.471275, 2.280030173177515),
        (3.6498712978278363, 0.3445097343681004, 0.370525, 3.500075),
        (4.018, 0.5588, 0.4121, 4.9024),
        (6.531864096216997, 0.7620945159987893, 0.06682691928764979, 3.885477466657119),
    ]
    columns = zip(names, zip(*rows, strict=True), strict=True)
    given: dict[str, Any] = {name: xr.DataArray([*values], dims="case") for name, values in columns}
    # at the same amplitudes u ∝ 1/f²: metres and centimetres
    given["frequency"] = xr.DataArray([1.0, 10.0] * 3 + [10.0], dims="case")
    target = given.pop("displacement") / given["frequency"] ** 2
    limits = limit_amplitude(displacement=target, **given).limit_amplitude
    amplitudes = np.geomspace(0.05, 6.0, 20_001)
    moved = sweep(amplitude=amplitudes, **given).permanent_displacement
    first = amplitudes[(moved >= target).transpose("case", "amplitude").values.argmax(axis=1)]
    assert ((limits <= first) & (limits > 0.9 * first)).all()


@pytest.mark.parametrize(("seed", "displacement"), [(70, 0.01), (1514, 0.003), (5903, 0.1)])
def test_peaks_of_a_record_where_slips_become_one(seed: int, displacement: float) -> None:
    """The limit is never above the first of 20 000 amplitudes that reaches the target."""
    one = made(seed)
    given: dict[str, Any] = {
        "theta": one.theta,
        "mu_s": one.mu_s,
        **choices(**one.given, excitation=one.record),
    }
    limit = limit_amplitude(displacement, **given).limit_amplitude.item()
    amplitudes = np.geomspace(0.5 * limit, 1.5 * limit, 20_001)
    moved = sweep(amplitude=amplitudes, **given).permanent_displacement.values
    first = amplitudes[(moved >= displacement).argmax()]
    assert 0.999 * first < limit <= first


def test_a_peak_at_the_mode_limit_of_the_highest_of_many_pulses_is_found() -> None:
    """Beyond it the block slides upslope in the long negative half wave: u falls at once."""
    heights = np.linspace(0.05, 0.4, 200)
    others = np.column_stack([heights, -heights]).ravel()
    motion = Record.sampled([0.0, *others, 0.0, 1.0, -1.0, -1.0, -1.0, 0.0], 0.1)
    given: dict[str, Any] = {"theta": 5.0, "mu_s": 0.3, "excitation": motion}
    end = slipsweep.friction_parameters(5.0, 0.3, 5.0).limiting_acceleration.item()
    near = end * np.array([1.0 - 1e-9, 1.0 + 1e-9])
    before, after = sweep(amplitude=near, **given).permanent_displacement.values
    assert after < 0.0 < before
    target = before * (1.0 - 1e-10)
    limit = limit_amplitude(target, **given, maximum_amplitude=1.5 * end).limit_amplitude.item()
    assert (1.0 - 1e-8) * end < limit < end


def test_cells_without_a_limit_say_why() -> None:
    limits = limit_amplitude(1e6, [0, 20], 0.3, 1.0)
    np.testing.assert_array_equal(
        limits.limit_status, [LimitStatus.NOT_REACHED, LimitStatus.INVALID]
    )
    assert limits.limit_amplitude.isnull().all()
    assert limits.permanent_displacement.isnull().all()
    assert (limits.sliding_mode == SlidingMode.MISSING).all()
    assert limits.validity[1].item() & Validity.STATICALLY_UNSTABLE
    assert (
        limit_amplitude(1e6, 12, 0.3, 1.0, maximum_amplitude=60.0).validity.item() & Validity.UPLIFT
    )  # at its end
    assert limit_amplitude("50mm", 5, 0.3, 1.0).displacement == 0.05
    # never beyond the end of the search: yield lies above it
    assert (
        limit_amplitude(0.01, 0, 0.5, 1.0, maximum_amplitude=1.0).limit_status
        == LimitStatus.NOT_REACHED
    )


def test_limits_of_zipped_inputs_do_not_depend_on_how_they_are_cut(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Cells that share a dimension, scanned in slabs of a few, give the bits of single calls."""
    case = {"displacement": [0.01, 0.2, 0.05], "theta": [2.0, 6.0, 9.0], "mu_s": [0.3, 0.5, 0.4]}
    case["frequency"] = [1.0, 2.0, 0.7]
    monkeypatch.setattr("slipsweep.studies.limits.SCANNED", 1024)
    zipped: dict[str, Any] = {name: xr.DataArray(row, dims="case") for name, row in case.items()}
    together = limit_amplitude(**choices(**zipped))
    assert together.limit_amplitude.dims == ("case",)
    for number in range(3):
        single: dict[str, Any] = {name: row[number] for name, row in case.items()}
        alone = limit_amplitude(**choices(**single))
        for name in alone.data_vars:
            np.testing.assert_array_equal(together[name][number], alone[name])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"displacement": 0.0}, "displacement = 0: must be a finite number > 0"),
        ({"displacement": []}, "displacement = []"),
        ({"amplitude_steps": 1}, "amplitude_steps = 1"),
        ({"model": "jibson"}, "model = 'jibson'"),
    ],
)
def test_limits_of_impossible_inputs_are_refused(given: dict[str, Any], message: str) -> None:
    asked: dict[str, Any] = {
        "displacement": 0.05,
        "theta": 5,
        "mu_s": 0.4,
        "frequency": 1.0,
        **given,
    }
    with pytest.raises(InputError) as refused:
        limit_amplitude(**choices(**asked))
    assert message in str(refused.value)


@pytest.fixture(scope="module")
def shaking() -> Record:
    return few_pulses()


def case_of(seed: int) -> dict[str, Any]:
    """A case of any kind, by its number."""
    rng = np.random.default_rng(seed)
    models: list[Any] = [
        "mendez",
        Mendez(rise="literal"),
        Mendez(recoupling="integrate"),
        "newmark",
    ]
    given: dict[str, Any] = {
        "theta": rng.uniform(0, 15),
        "mu_s": rng.uniform(0.3, 0.8),
        "time_scale": rng.uniform(0.3, 3),
        "polarity": int(rng.choice([1, -1])),
        "model": models[rng.integers(4)],
    }
    return given | ({"yield_acceleration": rng.uniform(0.1, 2)} if rng.random() < 0.5 else {})


def test_limits_are_exact_and_the_first(shaking: Record) -> None:
    """The displacement is reached there, not at the number before, nor at any of a dense scan
    below.
    """
    seen = set()
    for seed in range(24):
        given = case_of(seed)
        wanted = 10.0 ** np.random.default_rng(seed).uniform(-4, 0)
        found = limit_amplitude(wanted, excitation=shaking, **given)
        seen.add(LimitStatus(found.limit_status.item()))
        if np.isnan(found.limit_amplitude):
            assert found.limit_status in (LimitStatus.NOT_REACHED, LimitStatus.INVALID)
            scan = sweep(excitation=shaking, **given, amplitude=np.linspace(0.01, 5 * 9.81, 4000))
            assert not (scan.permanent_displacement >= wanted).any()
            continue
        limit = found.limit_amplitude.item()
        names = ("permanent_displacement", "validity", *RECORD_COUNTS)
        at = sweep(
            excitation=shaking,
            **given,
            amplitude=[np.nextafter(limit, 0.0), limit],
            variables=names,
        )
        below, above = at.permanent_displacement.values
        assert above >= wanted
        assert not below >= wanted
        scan = sweep(
            excitation=shaking, **given, amplitude=np.linspace(0.2 * limit, limit, 4000)[:-1]
        )
        assert not (scan.permanent_displacement >= wanted).any(), seed
        for name in names:
            assert found[name].item() == at[name].values[1]
        pulses = [at[name].values for name in ("stick_slip_pulses", "continuous_pulses")]
        jumps = above - below > 1e-6 * above
        if found.limit_status == LimitStatus.AT_MODE_JUMP:
            assert jumps
            assert any(before != after for before, after in pulses)
        elif found.limit_status == LimitStatus.REACHED:
            assert not jumps
    assert {LimitStatus.REACHED, LimitStatus.AT_MODE_JUMP} <= seen


def test_time_and_sign_only_scale(shaking: Record) -> None:
    """u ∝ time_scale²: a displacement at twice the time is four of them; a record turned is the
    other sign.
    """
    block: dict[str, Any] = {"theta": [0.0, 8.0], "mu_s": [0.35, 0.6]}
    wanted = np.array([0.002, 0.05])
    one = limit_amplitude(wanted, **block, excitation=shaking, polarity="both")
    slow = limit_amplitude(
        4.0 * wanted, **block, excitation=shaking, polarity="both", time_scale=2.0
    )
    np.testing.assert_array_equal(one.limit_amplitude, slow.limit_amplitude)
    np.testing.assert_array_equal(4.0 * one.permanent_displacement, slow.permanent_displacement)
    turned = limit_amplitude(
        wanted, **block, excitation=Record(shaking.times, -shaking.acceleration), polarity=[-1, 1]
    )
    np.testing.assert_array_equal(one.limit_amplitude, turned.limit_amplitude)
    assert one.limit_amplitude.dims == ("theta", "mu_s", "polarity", "displacement")
    # the strength of the record itself plays no part
    strong = limit_amplitude(
        wanted,
        **block,
        excitation=Record(shaking.times, 8.0 * shaking.acceleration),
        polarity="both",
    )
    np.testing.assert_array_equal(one.limit_amplitude, strong.limit_amplitude)


def test_no_limit_and_what_is_refused(shaking: Record) -> None:
    weak = limit_amplitude(0.1, 5.0, [0.05, 0.4], excitation=shaking, maximum_amplitude=1.0)
    assert list(weak.limit_status.values) == [LimitStatus.INVALID, LimitStatus.NOT_REACHED]
    assert (weak.stick_slip_pulses.values == -1).all()
    with pytest.raises(InputError, match="frequency: not allowed with a Record"):
        limit_amplitude(0.1, 5.0, 0.4, 1.0, excitation=shaking)
    with pytest.raises(InputError, match="time_scale: not allowed with a waveform"):
        limit_amplitude(0.1, 5.0, 0.4, 1.0, time_scale=2.0)
    with pytest.raises(InputError, match="frequency: must be given"):
        limit_amplitude(0.1, 5.0, 0.4)
    with pytest.raises(InputError, match="has no acceleration to scale"):
        limit_amplitude(0.1, 5.0, 0.4, excitation=Record.sampled([0.0, 0.0, 0.0], 0.1))


@pytest.mark.parametrize(
    ("axes", "excitation"),
    [
        ("displacement_amplitude.values = [0.01, 0.02]\nfrequency.values = [2]", ""),
        ("scale.values = [1, 2]", '[excitation]\nrecord = "m.csv"\nunits = "g"\n'),
        ("pgv.values = [0.1, 0.3]", '[excitation]\nrecord = "m.csv"\nunits = "g"\n'),
    ],
)
def test_limits_of_a_sweep_do_not_depend_on_its_strengths(
    tmp_path: Path, axes: str, excitation: str
) -> None:
    """The axis of the shaking's strength, whichever it is, gives way to the amplitude sought."""
    write_motion(tmp_path / "m.csv", 3, 100, 0.02)
    block = 'theta.values = [2]\nmu_s.values = [0.2]\n[model]\nfriction = "newmark"\n'
    (tmp_path / "a.toml").write_text(f"[axes]\n{axes}\n{block}{excitation}")
    done = command(tmp_path, "limit", "a.toml", "-d", "1cm", "-o", "a.nc", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    shaking: dict[str, Any] = {"frequency": 2.0}
    if excitation:
        shaking = {"excitation": slipsweep.read_record(tmp_path / "m.csv", units="g")}
    expected = limit_amplitude(0.01, 2.0, 0.2, **shaking, model="newmark")
    found = slipsweep.open_result(tmp_path / "a.nc").limit_amplitude.load()
    assert found.squeeze().item() == expected.limit_amplitude.item()


def test_the_search_ends_at_five_g_of_the_models_gravity() -> None:
    """A limit between 3 and 5 g is found, one above 5 g is not reached."""
    for g in (9.81, 1.62):
        given: dict[str, Any] = {"frequency": 0.5, "model": slipsweep.Newmark(g=g)}
        found = limit_amplitude(0.01, yield_coefficient=[3.5, 4.999], amplitude_steps=16, **given)
        assert found.attrs["maximum_amplitude"] == pytest.approx(5.0 * g, rel=1e-15)
        np.testing.assert_array_equal(
            found.limit_status, [LimitStatus.REACHED, LimitStatus.NOT_REACHED]
        )
        assert 3.5 * g < found.limit_amplitude[0] < 5.0 * g


@pytest.mark.parametrize(
    "motion", [{"frequency": [0.5, 2.0]}, {"excitation": few_pulses(), "polarity": "both"}]
)
def test_limits_both_ways_are_of_the_largest_displacement(motion: dict[str, Any]) -> None:
    """Reached by the largest |u| over time at the limit, not at the number before, nor below."""
    both = slipsweep.Newmark(sliding="both")
    blocks: tuple[dict[str, Any], ...] = (
        {"theta": [0.0, 6.0], "mu_s": [0.2, 0.5]},
        {"yield_coefficient": [0.3, 0.05], "upslope_yield_acceleration": 1.0},
    )
    for block in blocks:
        given: dict[str, Any] = {**block, **motion, "model": both}
        limits = limit_amplitude([0.003, 0.1], **given)
        assert limits.attrs["criterion"].startswith("largest displacement over time")
        limit = limits.limit_amplitude
        assert limit.notnull().all()

        def largest(amplitude: xr.DataArray, given: dict[str, Any] = given) -> xr.DataArray:
            result = sweep(amplitude=amplitude, **given)
            downslope: xr.DataArray = result.largest_displacement
            upslope = -result.smallest_displacement
            both_ways = downslope.where(downslope > upslope, upslope)
            return both_ways.transpose(*amplitude.dims, ...)

        assert (largest(limit) >= limits.displacement).all()
        before = xr.apply_ufunc(np.nextafter, limit, 0.0)
        assert (largest(before) < limits.displacement).all()
        shares = xr.DataArray(np.linspace(0.02, 0.999, 300), dims="share")
        assert (largest(limit * shares) < limits.displacement).all()
        for name in ("largest_displacement", "smallest_displacement"):
            at_limit = sweep(amplitude=limit, **given)[name].transpose(*limit.dims)
            np.testing.assert_array_equal(limits[name], at_limit)


SWEEP = """
[model]
friction = "newmark"
[axes]
theta.values = [0, 5]
mu_s.values = [0.3, 0.5]
amplitude.values = [1, 4]
frequency.values = [1, 2, 4]
[excitation]
cycles = 3
"""


def test_command_on_sweep_and_on_result(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(SWEEP)
    assert command(tmp_path, "run", "small.toml", "-q").returncode == 0
    # the file holds what `limit_amplitude` gives with the sweep's own options
    expected = limit_amplitude(
        [0.02, 0.05],
        [0, 5],
        [0.3, 0.5],
        [1, 2, 4],
        model="newmark",
        excitation=slipsweep.Sine(cycles=3),
    )
    for source, result in (("small.toml", "one.nc"), ("small.nc", "two.nc")):
        done = command(
            tmp_path, "limit", source, "-d", "50mm", "-d", "2 cm", "-o", result, "-o", "l.svg"
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert "24 limits (2 theta x 2 mu_s x 3 frequency x 2 displacement)" in done.stdout
        with xr.open_dataset(tmp_path / result) as dataset:
            np.testing.assert_array_equal(dataset.limit_amplitude, expected.limit_amplitude)
            np.testing.assert_array_equal(dataset.limit_status, expected.limit_status)
            assert dataset.limit_status.attrs["flag_meanings"].split()[4] == "not_reached"
        svg = (tmp_path / "l.svg").read_text()
        assert "<svg" in svg
        (tmp_path / "l.svg").unlink()
    # nothing is overwritten unasked
    refused = command(tmp_path, "limit", "small.nc", "-d", "50mm", "-o", "one.nc")
    assert refused.returncode == 2
    assert "one.nc" in refused.stderr
