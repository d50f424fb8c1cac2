"""Synthetic tests on a shaking table: `simulate`, sampled, with noise, drift and digitisation."""

from collections.abc import Collection
from typing import Any

import numpy as np
import xarray as xr
from scipy.signal import lfilter

import slipsweep
from slipsweep.studies.calibration.shaking_test import CHANNELS, RESPONSES

#: One test in either sliding mode: parameters and a motion of the table.
STICK_SLIP: dict[str, Any] = {
    "theta": 5.0,
    "mu_s": 0.38,
    "amplitude": 3.55,
    "frequency": 1.8,
    "yield_acceleration": 0.59,
    "decay_rate": 2.7,
    "delta_mu": 0.09,
    "excitation": slipsweep.Sine(cycles=5),
}
CONTINUOUS: dict[str, Any] = {
    "theta": 6.0,
    "mu_s": 0.38,
    "amplitude": 5.6,
    "frequency": 2.5,
    "yield_acceleration": 0.9,
    "decay_rate": 2.3,
    "delta_mu": 0.11,
    "excitation": slipsweep.Sine(cycles=8),
}

#: Tests that determine all three parameters well: Üy lies beyond where Eq. 4 meets the table's
#: acceleration, and the block follows Eq. 4 over a part of each rise that is long enough to tell λ
#: from Δμ.
CALIBRATED: dict[str, dict[str, Any]] = {
    "stick_slip": {
        "theta": 5.0,
        "mu_s": 0.38,
        "amplitude": 5.0,
        "frequency": 2.0,
        "yield_acceleration": 1.8,
        "decay_rate": 2.0,
        "delta_mu": 0.1,
        "excitation": slipsweep.Sine(cycles=5),
    },
    "continuous": {
        "theta": 6.0,
        "mu_s": 0.38,
        "amplitude": 7.0,
        "frequency": 2.5,
        "yield_acceleration": 2.0,
        "decay_rate": 2.3,
        "delta_mu": 0.05,
        "excitation": slipsweep.Sine(cycles=5),
    },
}

SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")


def exact(
    case: dict[str, Any], rate: float = 200.0, lead: float = 0.5, tail: float = 0.5
) -> xr.Dataset:
    """Channels of a test without sensors' errors; `lead` and `tail` s of rest about the shaking."""
    excitation = case["excitation"]
    shaken = excitation.cycles / case["frequency"]
    times = np.arange(round((lead + shaken + tail) * rate) + 1) / rate
    moving = times >= lead
    history = slipsweep.simulate(**case, times=times[moving] - lead)
    channels = {}
    for name in CHANNELS:
        values = np.zeros(times.size)
        values[moving] = history[name].values
        channels[name] = ("time", values, history[name].attrs)
    return xr.Dataset(channels, {"time": ("time", times, {"units": "s"})})


def digitised(values: np.ndarray, bits: int, full_scale: float) -> np.ndarray:
    """Values as a converter of so many bits gives them, from −full_scale to full_scale."""
    step = 2.0 * full_scale / 2**bits
    return np.asarray(np.clip(np.round(values / step) * step, -full_scale, full_scale - step))


def measured(
    clean: xr.Dataset,
    seed: int = 0,
    noise: float = 0.02,
    bits: int | None = 12,
    responses: Collection[str] = RESPONSES,
) -> xr.Dataset:
    """Add white noise, in parts of each channel's peak, then digitise to `bits`."""
    generator = np.random.default_rng(seed)
    test = clean.copy(deep=True)
    for name in CHANNELS:
        values = clean[name].values
        peak = float(np.abs(values).max())
        noisy = values + noise * peak * generator.standard_normal(values.size)
        test[name].values[:] = noisy if bits is None else digitised(noisy, bits, 1.25 * peak)
    return test.drop_vars([name for name in RESPONSES if name not in responses])


def coloured(samples: int, correlation: float, seed: int = 0) -> np.ndarray:
    """Noise of first order and unit variance: neighbouring samples have this correlation."""
    white = np.random.default_rng(seed).standard_normal(samples + 300)
    noise = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], white)
    return np.asarray(noise[300:])


def coulomb(kinetic: float, noise: float = 0.01, seed: int = 0) -> xr.Dataset:
    """Test of a block of constant friction, static 0.38, on 6 degrees: six cycles, 2 Hz, 0.55 g.
    Integrated in steps of 1/8000 s, independently of the solvers.
    """
    rate = 200
    fine = 40
    shaken = 3.0
    peak = 0.55 * 9.81
    times = np.arange(round((shaken + 1.0) * rate * fine)) / (rate * fine)
    moving = (times > 0.25) & (times < 0.25 + shaken)
    table = np.where(moving, peak * np.sin(4.0 * np.pi * (times - 0.25)), 0.0)
    onset, held = (
        9.81 * np.tan(np.arctan(friction) - np.radians(6.0)) for friction in (0.38, kinetic)
    )
    block = table.copy()
    velocity = np.zeros(times.size)
    speed = 0.0
    slides = False
    for i, value in enumerate(table):
        slides = slides or value > onset
        if slides:
            speed += (value - held) / (rate * fine)
            slides = speed > 0.0 or value > held
            speed = max(speed, 0.0)
            block[i] = held if slides else value
        velocity[i] = speed
    values = (table, block, velocity, np.cumsum(velocity) / (rate * fine))
    channels = {name: ("time", one[::fine]) for name, one in zip(CHANNELS, values, strict=True)}
    return measured(xr.Dataset(channels, {"time": ("time", times[::fine])}), seed, noise, bits=None)
