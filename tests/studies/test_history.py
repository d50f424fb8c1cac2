"""Time histories of slides that last long after the shaking: few points, and all of the slide."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep import Cosine, Harmonics, Sine

#: Shaking that leaves Newmark's block with a velocity.
SHAKEN: dict[str, Any] = {
    "cosine": Cosine(),
    "ramp": Sine(cycles=3, ramp_out=0.7),
    "harmonics": Harmonics([1, 0.5], [1, 2], phases=[0, 90]),
}


def history(yield_acceleration: float, excitation: Any) -> Any:
    return slipsweep.simulate(
        0, 0.4, 3, 1.5, model="newmark", excitation=excitation, yield_acceleration=yield_acceleration,
        points_per_cycle=16,
    )  # fmt: skip


@pytest.mark.parametrize("shaken", SHAKEN)
@pytest.mark.parametrize("yield_acceleration", [0.3, 1e-2, 1e-7, 1e-30])
def test_a_long_slide_has_a_bounded_number_of_points(shaken: str, yield_acceleration: float) -> None:
    whole = history(yield_acceleration, SHAKEN[shaken])
    cycles = SHAKEN[shaken].cycles
    time = whole.time.values
    assert time.size <= 16 * (cycles + 100) + 2
    assert (np.diff(time) > 0).all()
    shaking = time[: 16 * cycles + 1]
    np.testing.assert_allclose(shaking, np.arange(16 * cycles + 1) / 16 / 1.5, rtol=1e-14)
    # at rest, where the sweep says, and at no time before
    assert whole.relative_velocity.values[-1] == 0.0
    assert whole.relative_displacement.values[-1] == pytest.approx(whole.permanent_displacement.item(), rel=1e-12)
    speed = whole.relative_velocity.values[16 * cycles]
    if speed > 0.0:
        assert whole.relative_velocity.values[-2] > 0.0
        braked = whole.relative_velocity.values[16 * cycles :]
        expected = speed - yield_acceleration * (time[16 * cycles :] - time[16 * cycles])
        np.testing.assert_allclose(braked[:-1], expected[:-1], rtol=1e-6, atol=1e-9 * speed)
        # the last interval ends with the slide
        if time.size == 16 * (cycles + 100) + 1:
            assert time[-1] - time[16 * cycles] == pytest.approx(speed / yield_acceleration, rel=1e-9)


@pytest.mark.parametrize("solver", ["cycle", slipsweep.Step("simpson", 4096)], ids=["cycle", "step"])
@pytest.mark.parametrize(
    "excitation",
    [*(Sine(cycles, ramp) for cycles in (10, 23) for ramp in (0.3, 1.3, 2.0, 2.3)), Cosine(12)],
    ids=str,
)
def test_cycles_behind_a_ramp_repeat_from_what_it_leaves(excitation: Sine | Cosine, solver: Any) -> None:
    """A block that does not recouple comes out of the first cycles in motion: its pulses repeat from that velocity."""
    cell: dict[str, Any] = {"theta": 0, "mu_s": 0.4, "amplitude": 3, "frequency": 1, "yield_acceleration": 1e-3}
    swept = slipsweep.sweep(**cell, excitation=excitation, solver=solver)
    history = slipsweep.simulate(**cell, excitation=excitation)
    assert int(swept.validity) & slipsweep.Validity.NOT_RECOUPLED
    assert float(swept.permanent_displacement) == pytest.approx(float(history.relative_displacement[-1]), rel=1e-10)


#: The sample's motions have many pieces; harmonic ones come again and again at phases that are rounded.
WHOLE: dict[str, Any] = {
    **SHAKEN,
    "triangle": slipsweep.Triangle(cycles=40, ramp_in=1.5),
    "square": slipsweep.Square(cycles=40),
    "record": slipsweep.Record.sampled(3.0 * np.sin(0.7 * np.arange(60.0)) * np.linspace(0.3, 1.0, 60), 0.01),
}


@pytest.mark.parametrize("model", ["newmark", slipsweep.Mendez(), slipsweep.Mendez(recoupling="integrate")], ids=str)
@pytest.mark.parametrize("shaken", WHOLE)
def test_velocity_has_no_gaps_where_pieces_meet(shaken: str, model: Any) -> None:
    """At an instant that rounding puts between two pieces the block does not stand still."""
    excitation, given = WHOLE[shaken], {"theta": 3, "mu_s": 0.4, "yield_acceleration": 0.3, "model": model}
    if isinstance(excitation, slipsweep.Record):
        times = excitation.times
    else:
        given |= {"amplitude": 2.5, "frequency": 1.7}
        times = np.arange(48 * excitation.cycles + 1) / 48 / 1.7
    about = np.concatenate([np.nextafter(times, 0), times, np.nextafter(times, np.inf)])
    about = np.concatenate([np.nextafter(about, 0), about, np.nextafter(about, np.inf), times + 1e-13, times - 1e-13])
    velocity = slipsweep.simulate(excitation=excitation, **given, times=np.unique(about.clip(0))).relative_velocity
    assert np.abs(np.diff(velocity)[np.diff(velocity.time) < 1e-12]).max() < 1e-10
    assert velocity.max() > 0.01


ENDLESS = """
import os, signal, threading, time
import slipsweep
block = {"theta": 5, "mu_s": 0.38, "amplitude": 9.5, "frequency": 1.8, "yield_acceleration": 0.59, "decay_rate": 2.7}
slipsweep.simulate(**block, times=[1.0])
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
began = time.monotonic()
try:
    slipsweep.simulate(**block, excitation=slipsweep.Sine(cycles=1_000_000_000), times=[1.0, 1e8])
except KeyboardInterrupt:
    print("heard", time.monotonic() - began < 20.0)
"""


def test_a_history_of_many_cycles_hears_ctrl_c() -> None:
    done = subprocess.run([sys.executable, "-c", ENDLESS], capture_output=True, text=True, timeout=300, check=False)
    assert (done.stdout, done.stderr) == ("heard True\n", "")


def test_an_error_in_the_kernel_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs on a thread, where an error would be lost and the table left as memory was."""

    def out_of_memory(*_: Any) -> None:
        raise MemoryError("no room for the workspace")

    monkeypatch.setattr("slipsweep.kernels.history.fill_history", out_of_memory)
    with pytest.raises(MemoryError, match="workspace"):
        history(0.3, Sine())
