"""Programs that solve differential equations, and pySLAMMER, on cells of `benchmarks.sample`.

One cycle of a sine: Newmark's block, and the paper's law in stick–slip.  General solvers are given
the rate of the relative velocity, the phases at which it has a kink, and the event that the block
stops.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

import slipsweep
from benchmarks.grids import G
from benchmarks.sample import Group

#: Phases at which the rate has a kink, and one at which every block has stopped.
PEAK = 0.5 * np.pi
ZERO = np.pi
END = 40.0 * np.pi


def rate_by(xp: Any) -> Callable[[Any, Any], Any]:
    """dV/dφ of a sliding block, in units of A, of the phase and a cell, by NumPy or jax.numpy.
    b = max(Üy, Eq. 4) up to the peak of Üg, held beyond it; Eq. 12 from Üg = 0 on.  Newmark's block
    has b = Üy.
    """

    def rate(phase: Any, cell: Any) -> Any:
        base = cell[0] * xp.sin(phase)
        law = cell[6] > 0.0
        x = xp.where(phase < PEAK, base, cell[0])
        friction = cell[4] * xp.exp(-cell[5] * x / G)
        eq4 = x - G * (cell[2] - friction) - x * cell[3] * (cell[2] - cell[3] - friction)
        b = xp.where(law, xp.maximum(cell[1], eq4), cell[1])
        return (xp.where(law & (phase > ZERO), 0.0, base) - b) / cell[0]

    return rate


def cells_of(group: Group) -> Any:
    """What `rate_by` takes of each cell: A, Üy, μs, tan θ, μs + Δμ, λ, and 1 for the law."""
    theta, mu_s, amplitude = (
        xr.DataArray(group.inputs[name], dims="cell") for name in ("theta", "mu_s", "amplitude")
    )
    friction = slipsweep.friction_parameters(theta, mu_s, amplitude)
    onset = friction.yield_acceleration
    most = mu_s + friction.delta_mu
    decay = friction.decay_rate
    law = xr.full_like(mu_s, group.model == "mendez", float)
    return np.nan_to_num(
        np.stack([amplitude, onset, mu_s, np.tan(np.radians(theta)), most, decay, law], axis=1)
    )


def begin_at_yield(group: Group) -> Group:
    """Cells whose slide begins at Üy: in a few others, Eq. 4 lets the block stick for longer."""
    cells = cells_of(group)
    rates = [rate_by(np)(np.arcsin(cell[1] / cell[0]) + 1e-6, cell) for cell in cells]
    return group.take(np.flatnonzero(np.array(rates) > 0.0))


# ------------------------------------------------------------------------------ the programs


def by_diffrax(group: Group, tolerance: float) -> Any:
    """All cells at once (vmap), Dormand and Prince's rule of order 8."""
    return _unscaled(group, _diffrax(tolerance)(cells_of(group)))


@cache
def _diffrax(tolerance: float) -> Any:
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    jax.config.update("jax_enable_x64", True)
    rate = rate_by(jnp)
    term = diffrax.ODETerm(lambda phase, y, cell: jnp.stack([rate(phase, cell), y[0]]))
    error = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    steps = diffrax.ClipStepSizeController(error, jump_ts=jnp.array([PEAK, ZERO]))

    def moving(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return jnp.where(t <= PEAK, 1.0, y[0])

    bisection: Any = optimistix.Bisection
    stop = diffrax.Event(moving, bisection(1e-14, 1e-14))

    def solve(cell: Any) -> Any:
        solution = diffrax.diffeqsolve(
            term,
            diffrax.Dopri8(),
            jnp.arcsin(cell[1] / cell[0]),
            END,
            1e-2,
            jnp.zeros(2),
            cell,
            stepsize_controller=steps,
            event=stop,
            max_steps=100_000,
            throw=False,
        )
        return solution.ys[0, 1]

    return jax.jit(jax.vmap(solve))


def by_scipy(group: Group, tolerance: float) -> Any:
    """`solve_ivp`, DOP853 of a compiled rate, with a terminal event."""
    from scipy.integrate import solve_ivp

    return _one_by_one(group, solve_ivp, tolerance)


def by_cyrk(group: Group, tolerance: float) -> Any:
    """`pysolve_ivp`, likewise."""
    from CyRK import pysolve_ivp

    return _one_by_one(group, pysolve_ivp, tolerance)


def _one_by_one(group: Group, solve_ivp: Any, tolerance: float) -> Any:
    derivatives, stop = _compiled()
    displacements = []
    for cell in cells_of(group):
        y = np.zeros(2)
        ends = [float(np.arcsin(cell[1] / cell[0])), PEAK, ZERO, END]
        for begin, end in itertools.pairwise(ends):
            events = stop if begin >= PEAK else None
            run = solve_ivp(
                derivatives,
                (begin, end),
                y,
                "DOP853",
                args=(cell,),
                events=events,
                rtol=tolerance,
                atol=tolerance,
            )
            y = np.array(run.y[:, -1])
            if events and len(run.t_events[0]):
                break
        displacements.append(y[1])
    return _unscaled(group, np.array(displacements))


@cache
def _compiled() -> tuple[Any, Any]:
    """The rates of V and W, and the event that the block stops."""
    from numba import njit

    rate = njit(rate_by(np))

    @njit  # type: ignore[untyped-decorator]
    def derivatives(phase: float, y: Any, cell: Any) -> Any:
        return np.array([rate(phase, cell), y[0]])

    def stop(phase: float, y: Any, cell: Any) -> float:
        return float(y[0])

    stop.terminal = True  # type: ignore[attr-defined]
    return derivatives, stop


def by_pyslammer(group: Group, steps: int) -> Any:
    """RigidAnalysis of a sine of as many samples (Newmark's block only)."""
    from pyslammer import GroundMotion, RigidAnalysis
    from pyslammer.constants import G_EARTH

    sine = np.sin(2.0 * np.pi * np.arange(steps + 1) / steps)
    cells = cells_of(group)
    runs = [
        RigidAnalysis(cell[1] / G_EARTH, GroundMotion(sine * cell[0] / G_EARTH, 1.0 / steps))
        for cell in cells
    ]
    return np.array([run.max_sliding_disp for run in runs]) / group.inputs["frequency"] ** 2


def _unscaled(group: Group, scaled: Any) -> Any:
    return (
        np.asarray(scaled)
        * group.inputs["amplitude"]
        / (2.0 * np.pi * group.inputs["frequency"]) ** 2
    )


@dataclass(frozen=True)
class Program:
    """Function of a group and a setting, its settings, regimes and cells, its marker and colour."""

    solve: Callable[[Group, Any], Any]
    marker: str
    colour: str
    settings: tuple[float, ...] = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
    cells: int = 1
    regimes: tuple[str, ...] = ("newmark", "stick_slip")


#: By the name of the package.
PROGRAMS = {
    "diffrax": Program(by_diffrax, "s", "#31a354", cells=100_000),
    "CyRK": Program(by_cyrk, "D", "#756bb1"),
    "scipy": Program(by_scipy, "^", "#e6550d"),
    "pyslammer": Program(
        by_pyslammer, "v", "#636363", tuple(2**k for k in range(6, 14)), regimes=("newmark",)
    ),
}
