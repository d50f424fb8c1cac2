"""The model for solvers of ordinary differential equations that know nothing of it.

One cycle of loading from rest becomes three segments of phase φ = ωt.  On each, the rate
of the relative velocity is the smaller of "block held at `floor`" and "block obeys Eq. 4",
one smooth function a segment, the same for every regime:

==========  ==================  ======================  =================
mode        first segment       second                  third
==========  ==================  ======================  =================
stick-slip  onset to switch     switch to peak          hold, peak to t5
newmark     onset to peak       (empty)                 peak to 2π
continuous  onset to π          (empty)                 π to 2π
==========  ==================  ======================  =================

Onset and switch depend on the plane's motion alone; they are found here, once, and given
to every outside solver.  The stop, in the third segment, depends on the solution and is
left to the solver; what velocity remains runs out as v²/(2b) (Eq. 12).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

G = 9.81
_SAMPLES = 512


class Interface(NamedTuple):
    """What the rate function takes: numbers for one cell, or arrays for many."""

    amplitude: Any
    tan_theta: Any
    excess: Any  # μs − tan θ
    friction_at_rest: Any  # μs + Δμ
    decay: Any  # λ/g
    floor: Any
    side: Any  # sign of Üg; 0 where the block is held at the floor whatever Eq. 4 asks


def rate(xp: Any, phi: Any, interface: Interface) -> Any:
    """dV/dφ = Üg − Ü, with V = ωv; `xp` is numpy, jax.numpy or math."""
    amplitude, tan_theta, excess, friction_at_rest, decay, floor, side = interface
    ground = amplitude * xp.sin(phi)
    friction = friction_at_rest * xp.exp(-decay * side * ground)
    # Üg − Eq. 4, in which |Üg| cancels
    slip = side * ((G + ground * tan_theta) * (excess - friction) + G * tan_theta)
    held = ground - floor
    if isinstance(held, float):
        return min(held, slip) if side else held
    return xp.where(side == 0, held, xp.minimum(held, slip))


@dataclass(frozen=True)
class Plan:
    """Segments of many cells; arrays of shape (3, cells) but for `amplitude`, `omega` and `held`."""

    interfaces: list[Interface]
    starts: Array
    ends: Array
    may_stop: bool
    held: Array
    omega: Array

    def displacement(self, velocity: Array, displacement: Array) -> Array:
        """u in metres from V and W at the end of the last segment."""
        run_out = velocity**2 / (2.0 * self.held) if self.may_stop else 0.0
        return np.asarray((displacement + run_out) / self.omega**2)


def plan(cells: Mapping[str, Array], model: str, continuous: bool) -> Plan:
    """The segments of cells that are all of one mode and slide.

    `cells` holds theta (degrees), mu_s, amplitude, frequency and, NaN where not given,
    yield_acceleration, decay_rate and delta_mu.
    """
    tan_theta, mu_s, amplitude = np.tan(np.radians(cells["theta"])), cells["mu_s"], cells["amplitude"]

    def given(name: str, default: Array) -> Array:
        values = cells.get(name, np.full_like(amplitude, np.nan))
        return np.where(np.isnan(values), default, values)

    onset = given("yield_acceleration", G * (mu_s - tan_theta) / (1 + mu_s * tan_theta))
    limit = (onset + G * mu_s) / (1 - tan_theta * (mu_s - tan_theta))
    ratio = amplitude / limit
    at_rest = mu_s + given("delta_mu", mu_s * ((ratio if continuous else 1 / ratio) - 1))
    decay = given("decay_rate", G / amplitude * np.log(at_rest / (0.01 if continuous else mu_s**2 * ratio))) / G
    zero, peak = np.zeros_like(amplitude), np.full_like(amplitude, np.pi / 2)
    side = zero if model == "newmark" else zero + 1.0
    common = Interface(amplitude, tan_theta, mu_s - tan_theta, at_rest, decay, onset, side)

    begin = np.arcsin(onset / amplitude)
    if continuous:
        free = common._replace(floor=np.full_like(amplitude, -np.inf))
        return Plan(
            [free, free, free._replace(side=-side)], np.stack([begin, 2 * peak, 2 * peak]),
            np.stack([2 * peak, 2 * peak, 4 * peak]), False, zero, 2 * np.pi * cells["frequency"],
        )  # fmt: skip
    switch = peak
    held = onset
    end = 4 * peak
    if model != "newmark":
        end = 2 * peak
        begin = _first(lambda phi: _eq4(phi, common) < amplitude * np.sin(phi), begin, peak)
        held = np.maximum(onset, _eq4(begin, common))
        common = common._replace(floor=held)
        switch = _first(lambda phi: _eq4(phi, common) > held, begin, peak)
        held = np.maximum(held, _eq4(peak, common))
    hold = common._replace(floor=held, side=zero)
    return Plan(
        [common, common, hold], np.stack([begin, switch, peak]), np.stack([switch, peak, end]), True, held,
        2 * np.pi * cells["frequency"],
    )  # fmt: skip


def slide_length(plan: Plan) -> Array:
    """Phase from the onset to the stop, or to the end of the segments, good to a step in 512."""
    velocity = np.zeros_like(plan.omega)
    length = np.zeros_like(plan.omega)
    going = np.ones_like(plan.omega, dtype=bool)
    for interface, start, end in zip(plan.interfaces, plan.starts, plan.ends, strict=True):
        step = (end - start) / _SAMPLES
        for i in range(_SAMPLES):
            velocity = velocity + step * rate(np, start + (i + 0.5) * step, interface)
            if plan.may_stop:
                going &= (velocity > 0) | (end < np.pi)
            length += np.where(going, step, 0.0)
    return length


def _eq4(phi: Array, interface: Interface) -> Array:
    """Eq. 4 on the rise."""
    free = interface._replace(floor=np.full_like(interface.amplitude, -np.inf))
    return np.asarray(interface.amplitude * np.sin(phi) - rate(np, phi, free))


def _first(condition: Any, low: Array, high: Array) -> Array:
    """First phase of [low, high] at which `condition` comes to hold (high if never): a scan, then bisection."""
    width = (high - low) / _SAMPLES
    before, after = low.copy(), high.copy()
    found = np.zeros_like(low, dtype=bool)
    for i in range(1, _SAMPLES + 1):
        phi = low + i * width
        holds = condition(phi) & ~found
        before, after = np.where(holds, phi - width, before), np.where(holds, phi, after)
        found |= holds
    for _ in range(60):
        middle = 0.5 * (before + after)
        holds = condition(middle)
        before, after = np.where(holds, before, middle), np.where(holds, middle, after)
    return np.where(found, after, high)
