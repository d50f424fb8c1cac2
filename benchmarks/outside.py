"""Solvers from elsewhere on the same cells, each used as its own documentation would have it.

Every function takes a group of the sample and a setting, and returns a function that
solves all cells of the group and gives their displacements; None where the solver does
not apply.  Whatever a library compiles, it compiles on the first call, which is timed
apart.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import model
from benchmarks.sample import Group

Array = NDArray[np.float64]
Solve = Callable[[], Array]

STUCK, STICK_SLIP, CONTINUOUS = 0, 1, 2


def _plan(group: Group) -> model.Plan | None:
    if group.mode == STUCK:
        return None
    return model.plan(group.inputs, group.model, group.mode == CONTINUOUS)


def scipy(group: Group, method: str, tolerance: float) -> Solve | None:
    """`solve_ivp`, cell by cell; the rate in plain Python floats; the stop is a terminal event."""
    from scipy.integrate import solve_ivp

    plan = _plan(group)
    if plan is None:
        return None

    def rest(phi: float, y: Array, *args: float) -> float:
        return float(y[0])

    rest.terminal, rest.direction = True, -1  # type: ignore[attr-defined]

    def motion(phi: float, y: Array, *interface: float) -> tuple[float, float]:
        return model.rate(math, phi, model.Interface(*interface)), y[0]

    def solve() -> Array:
        ends = np.zeros((2, group.size))
        for cell in range(group.size):
            y = np.zeros(2)
            for segment in range(3):
                start, end = plan.starts[segment, cell], plan.ends[segment, cell]
                if start == end:
                    continue
                interface = tuple(float(values[cell]) for values in plan.interfaces[segment])
                solution = solve_ivp(
                    motion, (start, end), y, method, args=interface, rtol=tolerance,
                    atol=tolerance * 1e-3 * interface[0], events=rest if plan.may_stop and segment == 2 else None,
                )  # fmt: skip
                y = solution.y[:, -1]
            ends[:, cell] = max(y[0], 0.0) if plan.may_stop else y[0], y[1]
        return plan.displacement(*ends)

    return solve


def diffrax(group: Group, method: str, tolerance: float) -> Solve | None:
    """diffrax, all cells under one `vmap` and `jit`; the stop is a terminal event with a root finder."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp
    import optimistix

    jax.config.update("jax_enable_x64", True)
    plan = _plan(group)
    if plan is None:
        return None

    def motion(phi: Any, y: Any, interface: Any) -> Any:
        return jnp.stack([model.rate(jnp, phi, model.Interface(*interface)), y[0]])

    def rest(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return y[0]

    def one(starts: Any, ends: Any, interfaces: Any) -> Any:
        y = jnp.zeros(2)
        for segment in range(3):
            event = None
            if plan.may_stop and segment == 2:
                event = dfx.Event(
                    rest, optimistix.Newton(rtol=tolerance * 1e-3, atol=tolerance * 1e-3), direction=False
                )
            amplitude = interfaces[segment][0]
            solution = dfx.diffeqsolve(
                dfx.ODETerm(motion), getattr(dfx, method)(), starts[segment], ends[segment], None, y,
                interfaces[segment], event=event, max_steps=16384, throw=False,
                stepsize_controller=dfx.PIDController(rtol=tolerance, atol=tolerance * 1e-3 * amplitude),
            )  # fmt: skip
            # a segment of no length is no step
            y = jnp.where(starts[segment] < ends[segment], solution.ys[-1], y)
        return y

    run = jax.jit(jax.vmap(one, in_axes=(1, 1, 0)))
    arguments = plan.starts, plan.ends, [tuple(map(jnp.asarray, interface)) for interface in plan.interfaces]

    def solve() -> Array:
        velocity, displacement = np.asarray(run(*arguments)).T
        return plan.displacement(np.maximum(velocity, 0.0) if plan.may_stop else velocity, displacement)

    return solve


@functools.cache
def _cyrk(method: str) -> Callable[..., None]:
    from CyRK import nb_diffeq_addr, nbsolve2_ivp
    from numba import njit

    g = model.G

    @njit
    def motion(dy: Any, phi: float, y: Any, args: Any) -> None:
        # model.rate, in the form that a C callback wants
        ground = args[0] * math.sin(phi)
        dy[0] = ground - args[5]
        if args[6] != 0.0:
            friction = args[3] * math.exp(-args[4] * args[6] * ground)
            dy[0] = min(dy[0], args[6] * ((g + ground * args[1]) * (args[2] - friction) + g * args[1]))
        dy[1] = y[0]

    address = nb_diffeq_addr(motion)

    @njit
    def solve(starts: Array, ends: Array, interfaces: Array, may_stop: bool, tolerance: float, results: Array) -> None:
        for cell in range(starts.shape[1]):
            y = np.zeros(2)
            atols = np.full(2, tolerance * 1e-3 * interfaces[0, cell, 0])
            rtols = np.full(2, tolerance)
            for segment in range(3):
                start, end = starts[segment, cell], ends[segment, cell]
                if start == end:
                    continue
                stops = may_stop and segment == 2
                found = nbsolve2_ivp(
                    address, (start, end), y, method=method, args=interfaces[segment, cell], rtols=rtols, atols=atols,
                    dense_output=stops,
                )  # fmt: skip
                before = y
                y = found.y[:, -1].copy()
                if stops and y[0] < 0.0:
                    low, high = start, end
                    for i in range(found.t.size):  # V only falls once it has begun to
                        if found.y[0, i] > 0.0 or (i == 0 and before[0] > 0.0):
                            low = found.t[i]
                        elif i > 0:
                            high = found.t[i]
                            break
                    for _ in range(50):
                        middle = 0.5 * (low + high)
                        if found.call(middle)[0, 0] > 0.0:
                            low = middle
                        else:
                            high = middle
                    y = found.call(low)[:, 0].copy()
                    y[0] = 0.0
                found.free()
            results[0, cell], results[1, cell] = y[0], y[1]

    return solve


def cyrk(group: Group, method: str, tolerance: float) -> Solve | None:
    """CyRK's C++ solvers called from a numba loop; it has no events there: the stop is bisected on dense output."""
    plan = _plan(group)
    if plan is None:
        return None
    interfaces = np.stack([np.stack(interface, axis=-1) for interface in plan.interfaces])
    solver = _cyrk(method)

    def solve() -> Array:
        results = np.empty((2, group.size))
        solver(plan.starts, plan.ends, interfaces, plan.may_stop, tolerance, results)
        return plan.displacement(*results)

    return solve


def _records(group: Group, samples: int) -> tuple[list[Array], Array, Array]:
    """Ground acceleration of every cell, one cycle and the quiet in which the block runs out; dt; yield values."""
    plan = _plan(group)
    assert plan is not None
    records = []
    for amplitude, held in zip(group.inputs["amplitude"], plan.held, strict=True):
        shaking = amplitude * np.sin(2 * np.pi * np.arange(samples + 1) / samples)
        quiet = np.ceil(2 * amplitude / held / (2 * np.pi)) if amplitude > 2 * held else 0
        records.append(np.concatenate([shaking, np.zeros(int(quiet) * samples)]))
    return records, 1 / (samples * group.inputs["frequency"]), plan.held


def pyslammer(group: Group, method: str, samples: int) -> Solve | None:
    """pySLAMMER's RigidAnalysis: trapezoidal rule from sample to sample, onset and stop at samples."""
    if group.regime != "newmark":  # the hard ones creep for thousands of cycles after the shaking
        return None
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pyslammer import GroundMotion, RigidAnalysis
        from pyslammer.constants import G_EARTH

        records, dt, onset = _records(group, samples)
        motions = [GroundMotion(record / G_EARTH, step) for record, step in zip(records, dt, strict=True)]

    def solve() -> Array:
        pairs = zip(motions, onset, strict=True)
        return np.array([RigidAnalysis(value / G_EARTH, motion).max_sliding_disp for motion, value in pairs])

    return solve


def pynewmarkdisp(group: Group, method: str, samples: int) -> Solve | None:
    """pyNewmarkDisp's direct_newmark: sample to sample, in numba; below yield it subtracts ∫|Üg|, a rule of its own."""
    if group.regime != "newmark":  # the hard ones creep for thousands of cycles after the shaking
        return None
    import matplotlib as mpl

    with mpl.rc_context():
        from pynewmarkdisp.newmark import direct_newmark  # sets fonts and a window toolkit
    records, dt, onset = _records(group, samples)
    times = [step * np.arange(record.size) for record, step in zip(records, dt, strict=True)]
    g = 9.81  # it is written into the package, too

    def solve() -> Array:
        cells = zip(times, records, onset, strict=True)
        return np.array([direct_newmark(time, record, value / g, g)["perm_disp"] for time, record, value in cells])

    return solve


class Family(NamedTuple):
    """An outside solver: its function, its package, whether it takes many cells at a time, and its settings."""

    make: Callable[[Group, str, Any], Solve | None]
    package: str
    takes_many: bool
    settings: list[tuple[str, Any]]


#: Settings are a method and its relative tolerance (that of zero is 10⁻³ A of it), or samples a cycle.
FAMILIES = {
    "SciPy": Family(scipy, "scipy", False, [("RK45", 1e-3), ("RK45", 1e-7), ("DOP853", 1e-6), ("DOP853", 1e-12)]),
    "diffrax": Family(
        diffrax, "diffrax", True, [("Tsit5", 1e-4), ("Tsit5", 1e-7), ("Dopri8", 1e-10), ("Dopri8", 1e-13)]
    ),
    "CyRK": Family(cyrk, "CyRK", True, [("RK45", 1e-4), ("RK45", 1e-7), ("DOP853", 1e-7), ("DOP853", 1e-12)]),
    "pySLAMMER": Family(pyslammer, "pyslammer", False, [("", n) for n in (64, 256, 1024, 4096)]),
    "pyNewmarkDisp": Family(pynewmarkdisp, "pynewmarkdisp", False, [("", n) for n in (64, 256, 1024, 4096)]),
}
