"""Time histories: what they have in common with a sweep, a waveform and mechanics; slides that last
long.
"""

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep import InputError, Mendez, Record, Sine, simulate, sweep
from slipsweep.model.variables import DEFAULT_RECORD_RESULTS, HISTORY
from tests.support.made_up_records import band_noise

#: Shaking that leaves Newmark's block with a velocity.
SHAKEN: dict[str, Any] = {
    "cosine": slipsweep.Cosine(),
    "ramp": Sine(cycles=3, ramp_out=0.7),
    "harmonics": slipsweep.Harmonics([1, 0.5], [1, 2], phases=[0, 90]),
}


def history(yield_acceleration: float, excitation: Any) -> Any:
    return simulate(
        0,
        0.4,
        3,
        1.5,
        model="newmark",
        excitation=excitation,
        yield_acceleration=yield_acceleration,
        points_per_cycle=16,
    )


@pytest.mark.parametrize("shaken", SHAKEN)
@pytest.mark.parametrize("yield_acceleration", [0.3, 1e-2, 1e-7, 1e-30])
def test_a_long_slide_has_a_bounded_number_of_points(
    shaken: str, yield_acceleration: float
) -> None:
    whole = history(yield_acceleration, SHAKEN[shaken])
    cycles = SHAKEN[shaken].cycles
    time = whole.time.values
    assert time.size <= 16 * (cycles + 100) + 2
    assert (np.diff(time) > 0).all()
    shaking = time[: 16 * cycles + 1]
    np.testing.assert_allclose(shaking, np.arange(16 * cycles + 1) / 16 / 1.5, rtol=1e-14)
    # at rest, where the sweep says, and at no time before
    assert whole.relative_velocity.values[-1] == 0.0
    assert whole.relative_displacement.values[-1] == pytest.approx(
        whole.permanent_displacement.item(), rel=1e-12
    )
    speed = whole.relative_velocity.values[16 * cycles]
    if speed > 0.0:
        assert whole.relative_velocity.values[-2] > 0.0
        braked = whole.relative_velocity.values[16 * cycles :]
        expected = speed - yield_acceleration * (time[16 * cycles :] - time[16 * cycles])
        np.testing.assert_allclose(braked[:-1], expected[:-1], rtol=1e-6, atol=1e-9 * speed)
        # the last interval ends with the slide
        if time.size == 16 * (cycles + 100) + 1:
            assert time[-1] - time[16 * cycles] == pytest.approx(
                speed / yield_acceleration, rel=1e-9
            )


def test_a_finely_sampled_sine_in_continuous_sliding() -> None:
    """A record ends with the plane at rest: what velocity is left when the sine ends is braked by
    Eq. 12.
    """
    block: dict[str, Any] = {"theta": 6.0, "mu_s": 0.38, "yield_acceleration": 0.08}
    sine = simulate(**block, amplitude=6.5, frequency=2.0, excitation=Sine(cycles=3), times=[1.5])
    assert sine.sliding_mode == 2
    friction = slipsweep.friction_parameters(**block, amplitude=6.5).minimum_friction.item()
    t_theta = np.tan(np.radians(6.0))
    held = (
        6.5 - (9.81 + 6.5 * t_theta) * (0.38 - t_theta - friction) - 9.81 * t_theta
    )  # Eq. 4 at the peak
    left = sine.relative_velocity.item()
    u = sine.permanent_displacement.item() + left * abs(left) / (2 * held)
    errors = []
    for samples in (250, 4000):
        times = np.arange(3 * samples + 1) / (2.0 * samples)
        found = sweep(**block, excitation=Record(times, 6.5 * np.sin(4 * np.pi * times)))
        assert (found.number_of_slips, found.stick_slip_pulses, found.continuous_pulses) == (
            1,
            0,
            3,
        )
        errors.append(abs(found.permanent_displacement.item() / u - 1))
        np.testing.assert_allclose(
            found.peak_relative_velocity, sine.peak_relative_velocity, rtol=10 / samples**2
        )
    assert errors[1] < errors[0] / 150


@pytest.mark.parametrize(
    "solver", ["cycle", slipsweep.Step("simpson", 4096)], ids=["cycle", "step"]
)
@pytest.mark.parametrize(
    "excitation",
    [
        *(Sine(cycles, ramp) for cycles in (10, 23) for ramp in (0.3, 1.3, 2.0, 2.3)),
        slipsweep.Cosine(12),
    ],
    ids=str,
)
def test_cycles_behind_a_ramp_repeat_from_what_it_leaves(
    excitation: Sine | slipsweep.Cosine, solver: Any
) -> None:
    """A block that does not recouple comes out of the first cycles in motion: its pulses repeat
    from that velocity.
    """
    cell: dict[str, Any] = {
        "theta": 0,
        "mu_s": 0.4,
        "amplitude": 3,
        "frequency": 1,
        "yield_acceleration": 1e-3,
    }
    swept = sweep(**cell, excitation=excitation, solver=solver)
    history = simulate(**cell, excitation=excitation)
    assert int(swept.validity) & slipsweep.Validity.NOT_RECOUPLED
    assert float(swept.permanent_displacement) == pytest.approx(
        float(history.relative_displacement[-1]), rel=1e-10
    )


#: The sample's motions have many pieces; harmonic ones come again and again at phases that are
#: rounded.
WHOLE: dict[str, Any] = {
    **SHAKEN,
    "triangle": slipsweep.Triangle(cycles=40, ramp_in=1.5),
    "square": slipsweep.Square(cycles=40),
    "record": Record.sampled(3.0 * np.sin(0.7 * np.arange(60.0)) * np.linspace(0.3, 1.0, 60), 0.01),
}


@pytest.mark.parametrize("model", ["newmark", Mendez(), Mendez(recoupling="integrate")], ids=str)
@pytest.mark.parametrize("shaken", WHOLE)
def test_velocity_has_no_gaps_where_pieces_meet(shaken: str, model: Any) -> None:
    """At an instant that rounding puts between two pieces the block does not stand still."""
    excitation = WHOLE[shaken]
    given = {"theta": 3, "mu_s": 0.4, "yield_acceleration": 0.3, "model": model}
    if isinstance(excitation, Record):
        times = excitation.times
    else:
        given |= {"amplitude": 2.5, "frequency": 1.7}
        times = np.arange(48 * excitation.cycles + 1) / 48 / 1.7
    about = np.concatenate([np.nextafter(times, 0), times, np.nextafter(times, np.inf)])
    about = np.concatenate(
        [np.nextafter(about, 0), about, np.nextafter(about, np.inf), times + 1e-13, times - 1e-13]
    )
    velocity = simulate(
        excitation=excitation, **given, times=np.unique(about.clip(0))
    ).relative_velocity
    assert np.abs(np.diff(velocity)[np.diff(velocity.time) < 1e-12]).max() < 1e-10
    assert velocity.max() > 0.01


MODELS: dict[str, Any] = {
    "mendez": "mendez",
    "literal": Mendez(rise="literal"),
    "integrate": Mendez(recoupling="integrate"),
    "newmark": "newmark",
}


@pytest.fixture(scope="module")
def shaking() -> Record:
    return band_noise()


def case_of(seed: int) -> dict[str, Any]:
    """A case of any kind, by its number."""
    rng = np.random.default_rng(seed)
    given: dict[str, Any] = {
        "theta": rng.uniform(0, 15),
        "mu_s": rng.uniform(0.3, 0.8),
        "scale": rng.uniform(0.3, 3),
        "time_scale": rng.uniform(0.3, 3),
        "polarity": int(rng.choice([1, -1])),
        "model": MODELS[str(rng.choice(list(MODELS)))],
    }
    return given | ({"yield_acceleration": rng.uniform(0.1, 2)} if rng.random() < 0.5 else {})


def test_a_history_ends_where_the_sweep_does(shaking: Record) -> None:
    """At rest, with the results of the sweep to the last bit and the displacement to rounding."""
    valued = 0
    modes = set()
    for seed in range(40):
        given = case_of(seed)
        found = simulate(excitation=shaking, **given)
        swept = sweep(excitation=shaking, **given)
        for name in DEFAULT_RECORD_RESULTS:
            np.testing.assert_array_equal(found[name], swept[name])
        if np.isnan(swept.permanent_displacement):
            assert np.isnan(found.relative_displacement).all()
            assert np.isfinite(found.ground_acceleration).all()
            continue
        valued += 1
        modes |= {(bool(swept.stick_slip_pulses > 0), bool(swept.continuous_pulses > 0))}
        assert found.relative_displacement.values[-1] == pytest.approx(
            swept.permanent_displacement.item(), rel=1e-12
        )
        assert abs(found.relative_velocity.values[-1]) <= 1e-9 * swept.peak_relative_velocity.item()
        peak = swept.peak_relative_velocity.item()
        time = found.time.values
        at = np.clip(found.relative_velocity.values.argmax(), 1, time.size - 2)
        # everywhere, and closely where a short slide may have its peak
        places = np.unique(
            [*np.linspace(0.0, time[-1], 40_000), *np.linspace(time[at - 1], time[at + 1], 2_000)]
        )
        fine = simulate(excitation=shaking, **given, times=places)
        assert 0.999 * peak <= fine.relative_velocity.max().item() <= peak * (1 + 1e-12)
    assert valued > 20
    assert modes >= {(False, False), (True, False), (True, True)}


@pytest.mark.parametrize("seed", [3, 9, 40])
def test_velocity_and_displacement_are_integrals(shaking: Record, seed: int) -> None:
    """v̇ = Üg − Ü and u̇ = v, but for velocities upslope that a stick-slip pulse neglects."""
    given = case_of(seed) | {
        "model": "newmark" if seed % 2 else Mendez(recoupling="integrate"),
        "scale": 2.0,
    }
    found = simulate(excitation=shaking, **given, times=np.linspace(0.0, 60.0, 600_001))
    velocity = found.relative_velocity.values
    step = 1e-4
    assert velocity.max() > 0.0
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * step)])
    np.testing.assert_allclose(moved, found.relative_displacement, atol=1e-4 * abs(moved).max())
    rate = (found.ground_acceleration - found.block_acceleration).values
    gained = 0.5 * (rate[1:] + rate[:-1]) * step
    # at an onset, a stop or a jump of the block's acceleration inside a step the two differ
    wrong = np.abs(np.diff(velocity) - gained) > 1e-6 * velocity.max()
    neglected = (velocity[:-1] < 0.0) & (velocity[1:] == 0.0)
    assert (wrong & ~neglected).mean() < 1e-3


def test_a_triangle_given_by_its_corners_moves_as_the_waveform() -> None:
    """In stick-slip, whose rules are the same under a record."""
    cycles = 4
    frequency = 1.3
    corners = np.array([0.0, 1.0, 0.0, -1.0])
    times = np.arange(4 * cycles + 1) / (4 * frequency)
    record = Record(times, 3.0 * np.append(np.tile(corners, cycles), 0.0))
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.45, "yield_acceleration": 1.1}
    at = np.linspace(0.0, 5.0, 4001)
    wave = simulate(
        **block,
        amplitude=3.0,
        frequency=frequency,
        excitation=slipsweep.Triangle(cycles=cycles),
        times=at,
    )
    assert wave.sliding_mode == slipsweep.SlidingMode.STICK_SLIP
    own = simulate(**block, excitation=record, times=at)
    for name in HISTORY:
        np.testing.assert_allclose(own[name], wave[name], rtol=1e-9, atol=1e-11, err_msg=name)


def test_time_and_sign_only_scale(shaking: Record) -> None:
    """v ∝ time_scale, u ∝ time_scale²; a record turned and taken with the other sign is the same
    motion.
    """
    given: dict[str, Any] = {"theta": 4.0, "mu_s": 0.4, "scale": 1.7}
    one = simulate(excitation=shaking, **given)
    slow = simulate(excitation=shaking, **given, time_scale=2.5)
    np.testing.assert_allclose(slow.time, 2.5 * one.time, rtol=1e-15)
    for name, power in zip(HISTORY, (0, 0, 0, 1, 2), strict=True):
        np.testing.assert_allclose(slow[name], one[name] * 2.5**power, rtol=1e-14, err_msg=name)
    turned = Record(shaking.times, -shaking.acceleration)
    other = simulate(excitation=turned, **given, polarity=-1)
    for name in HISTORY:
        np.testing.assert_array_equal(other[name], one[name])
    assert float(one.permanent_displacement) > 0.0


def test_the_plane_moves_as_recorded(shaking: Record) -> None:
    """Straight between the samples, and at rest before and after them."""
    late = Record(shaking.times + 3.0, shaking.acceleration)
    times = np.linspace(-1.0, 30.0, 12_345)
    found = simulate(5.0, 0.4, excitation=late, amplitude=4.0, polarity=-1, times=times)
    expected = np.interp(
        times, late.times, -4.0 / late.peak * late.acceleration, left=0.0, right=0.0
    )
    np.testing.assert_allclose(found.ground_acceleration, expected, atol=1e-13)
    before = times < 3.0
    assert (found.relative_displacement.values[before] == 0.0).all()
    # its samples are the points, where none are asked for
    own = simulate(5.0, 0.4, excitation=late, amplitude=4.0)
    np.testing.assert_array_equal(own.time.values[: late.times.size], late.times)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points_per_cycle": 16}, "points_per_cycle: not allowed with a Record"),
        ({"polarity": "both"}, "polarity: simulate takes one case"),
        ({"frequency": 2.0}, "frequency: not allowed with a Record"),
        ({"times": [2.0, 1.0]}, "times: must be one row of finite, increasing numbers"),
    ],
)
def test_what_a_record_refuses(shaking: Record, given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(5.0, 0.4, excitation=shaking, **given)


@pytest.mark.parametrize("amplitude", [3.55, 9.5])
def test_a_history_ends_with_its_last_sample(amplitude: float) -> None:
    """It is not followed through the cycles after that, which would take hours here."""
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "yield_acceleration": 0.59}
    block |= {"amplitude": amplitude, "frequency": 1.8, "times": [0.5, 1.0]}
    endless, short = (
        simulate(**block, excitation=Sine(cycles=cycles)) for cycles in (1_000_000_000, 10)
    )
    np.testing.assert_array_equal(endless.relative_displacement, short.relative_displacement)
    assert short.relative_displacement[-1] > 0.0


#: Sends itself Ctrl-C when the kernel of a long history begins.
ENDLESS = """
import os, signal, threading
import slipsweep
from slipsweep.kernels import history

block = dict(theta=5, mu_s=0.38, amplitude=9.5, frequency=1.8, yield_acceleration=0.59)
kernel = history.fill_history

def interrupted(*arguments):
    threads.append(threading.current_thread())
    os.kill(os.getpid(), signal.SIGINT)
    kernel(*arguments)

threads = []
history.fill_history = interrupted
endless = slipsweep.Sine(cycles=1_000_000_000)
try:
    slipsweep.simulate(**block, decay_rate=2.7, excitation=endless, times=[1.0, 1e8])
except KeyboardInterrupt:
    print("heard while the kernel runs:", threads[0].daemon and threads[0].is_alive())
"""


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_a_history_of_many_cycles_hears_ctrl_c() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ENDLESS], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("heard while the kernel runs: True\n", "")


def test_an_error_in_the_kernel_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs on a thread, where an error would be lost and the table left as memory was."""

    def out_of_memory(*_: Any) -> None:
        raise MemoryError("no room for the workspace")

    monkeypatch.setattr("slipsweep.grid.solvers.fill_history", out_of_memory)
    with pytest.raises(MemoryError, match="workspace"):
        history(0.3, Sine())
