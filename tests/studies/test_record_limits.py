"""Limit amplitudes under a record: against dense scans, by the scaling laws, and on the command line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, Mendez, Record, limit_amplitude, sweep
from slipsweep.model.variables import RECORD_COUNTS, LimitStatus

SYNTHETIC = Path(__file__).parents[2] / "sweeps" / "data" / "synthetic.csv"


@pytest.fixture(scope="module")
def shaking() -> Record:
    """Some pulses of different sizes and both signs."""
    times = np.arange(0.0, 8.0, 0.02)
    wave = np.sin(2 * np.pi * 1.1 * times) + 0.7 * np.sin(2 * np.pi * 2.7 * times + 1.0)
    return Record(times, wave * times**2 * np.exp(-1.2 * times))


def case_of(seed: int) -> dict[str, Any]:
    """A case of any kind, by its number."""
    rng = np.random.default_rng(seed)
    models: list[Any] = ["mendez", Mendez(rise="literal"), Mendez(recoupling="integrate"), "newmark"]
    given: dict[str, Any] = {
        "theta": rng.uniform(0, 15),
        "mu_s": rng.uniform(0.3, 0.8),
        "time_scale": rng.uniform(0.3, 3),
        "polarity": int(rng.choice([1, -1])),
        "model": models[rng.integers(4)],
    }
    return given | ({"yield_acceleration": rng.uniform(0.1, 2)} if rng.random() < 0.5 else {})


def test_limits_are_exact_and_the_first(shaking: Record) -> None:
    """The displacement is reached there, not at the number before, nor at any of a dense scan below."""
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
        at = sweep(excitation=shaking, **given, amplitude=[np.nextafter(limit, 0.0), limit], variables=names)
        below, above = at.permanent_displacement.values
        assert above >= wanted
        assert not below >= wanted
        scan = sweep(excitation=shaking, **given, amplitude=np.linspace(0.2 * limit, limit, 4000)[:-1])
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
    """u ∝ time_scale²: a displacement at twice the time is four of them; a record turned is the other sign."""
    block: dict[str, Any] = {"theta": [0.0, 8.0], "mu_s": [0.35, 0.6]}
    wanted = np.array([0.002, 0.05])
    one = limit_amplitude(wanted, **block, excitation=shaking, polarity="both")
    slow = limit_amplitude(4.0 * wanted, **block, excitation=shaking, polarity="both", time_scale=2.0)
    np.testing.assert_array_equal(one.limit_amplitude, slow.limit_amplitude)
    np.testing.assert_array_equal(4.0 * one.permanent_displacement, slow.permanent_displacement)
    turned = limit_amplitude(wanted, **block, excitation=Record(shaking.times, -shaking.acceleration), polarity=[-1, 1])
    np.testing.assert_array_equal(one.limit_amplitude, turned.limit_amplitude)
    assert one.limit_amplitude.dims == ("theta", "mu_s", "polarity", "displacement")
    # the strength of the record itself plays no part
    strong = limit_amplitude(
        wanted, **block, excitation=Record(shaking.times, 8.0 * shaking.acceleration), polarity="both"
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
