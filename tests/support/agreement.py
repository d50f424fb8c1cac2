"""Cells under all options and waveforms, on which the solvers are held to each other.

`groups` draws the options of one sweep and its cells: thousands of cells take few sweeps.
`compare` solves a group by steps, some cells as histories and some by the multiple-precision
reference; the bounds stand in `FLOORS`. `tests/kernels/test_agreement.py` does so for some groups,
``python -m benchmarks.agreement`` for many.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.linalg import hadamard

import slipsweep
from slipsweep.model.variables import VALUELESS, SlidingMode, Validity
from tests.support import reference
from tests.support.cases import choices
from tests.support.strategies import G, coulomb_yield, limiting_acceleration

Array = NDArray[Any]
Found = dict[str, Array]

#: Why a cell is drawn as it is; `REGIMES` names each as often as it is wanted.
REGIMES = (
    "coulomb",
    "coulomb",
    "measured",
    "measured",
    "low_yield",
    "low_yield",
    "near_yield",
    "continuous",
    "continuous",
    "near_limit",
    "given",
    "given",
    "sharp",
    "steep",
    "anything",
)

#: What may be given instead of its estimate, and how often it is.
GIVEN = {
    "yield_acceleration": 0.6,
    "decay_rate": 0.35,
    "delta_mu": 0.35,
    "minimum_friction": 0.2,
    "structure_frequency": 0.1,
}

#: A comparison's largest relative difference for well-conditioned cells.  Steps: about ten times
#: what a hundred thousand cells have shown with the finest steps of `compare`; the other ways round
#: differently, no more.
FLOORS = {
    "step, rectangle": 5e-2,
    "step, trapezoid": 5e-3,
    "step, simpson": 1e-4,
    "simulate": 1e-8,
    "reference": 1e-9,
}

#: What steps may be wrong by where friction decays in a layer that is thinner than a step.
THIN_LAYER = 2e-3

#: Times as many steps: errors of first order fall to 1/16, of second order and more to 1/16 and
#: less.
FINER = {"rectangle": 16, "trapezoid": 4, "simpson": 4}

#: Moves of all inputs, relative, that show the conditioning: of the size of the errors of steps,
#: and of roundings.
SIZES = {
    "step, rectangle": 1e-3,
    "step, trapezoid": 1e-5,
    "step, simpson": 1e-6,
    "simulate": 1e-13,
    "reference": 1e-13,
}
MOVES = 8

CONTINUOUS = int(SlidingMode.CONTINUOUS)

MOTION = ("permanent_displacement", "peak_relative_velocity")


@dataclass(frozen=True)
class Group:
    """Cells of one sweep: its options, the columns of its cells, and why each is drawn.

    `fastest` is the multiple of the fastest harmonic; steps and histories resolve that.  Of the
    cell `one` a history is taken and the reference asked.
    """

    options: dict[str, Any]
    rule: str
    steps: int
    cells: dict[str, Array]
    fastest: int
    regimes: tuple[str, ...]
    one: int
    seed: int

    def cell(self, j: int) -> dict[str, Any]:
        """The inputs of a cell."""
        return {name: float(values[j]) for name, values in self.cells.items()}

    def amplitude(self, j: int) -> float:
        """The plane's peak acceleration of a cell."""
        cell = self.cell(j)
        if "amplitude" in cell:
            return float(cell["amplitude"])
        return float(cell["displacement_amplitude"] * (2.0 * math.pi * cell["frequency"]) ** 2)


@dataclass(frozen=True)
class Comparison:
    """Difference of a cell solved in two ways, over its bound: 1 at most if they agree."""

    kind: str
    regime: str
    mode: int
    difference: float
    times_bound: float
    text: str


# ---------------------------------------------------------------------------------- drawing


def _phase(rng: random.Random) -> float:
    return rng.choice(
        [0.0, 90.0, 180.0, 270.0, rng.uniform(-180.0, 360.0), rng.uniform(0.0, 360.0)]
    )


def _harmonics(rng: random.Random) -> str:
    count = rng.choice([1, 2, 2, 3, 4])
    multiples = sorted(rng.sample(range(1, rng.choice([4, 8, 20]) + 1), count))
    return ",".join(
        f"{rng.choice([-1, 1]) * 10 ** rng.uniform(-1.5, 0)}:{m}:{_phase(rng)}" for m in multiples
    )


def options_of(rng: random.Random) -> dict[str, Any]:
    """Options of `slipsweep.sweep` but for the solver's."""
    options: dict[str, Any] = {"model": rng.choice(["mendez", "mendez", "mendez", "newmark"])}
    if options["model"] == "mendez":
        options["rise"] = rng.choice(["monotone", "literal"])
        options["recoupling"] = rng.choice(["eq12", "integrate"])
    options["waveform"] = rng.choice(
        ["sine", "cosine", "cosine", "triangle", "square", *["harmonics"] * 4]
    )
    if options["waveform"] == "harmonics":
        options["harmonics"] = _harmonics(rng)
    options["cycles"] = rng.choice([1, 2, 3, 4, 5, 6, 8, 10, 12, 40, 1000])
    if rng.random() < 0.5:
        ramps = [rng.choice([0.0, 0.25, 0.5, 1.0, 2.0, rng.uniform(0.0, 4.0)]) for _ in range(2)]
        if sum(ramps) <= options["cycles"]:
            options["ramp_in"], options["ramp_out"] = ramps
    options["g"] = rng.choice([9.81, 9.81, 9.81, 1.62, 980.665])
    return options


def _cell(
    rng: random.Random, given: list[str], newmark: bool, g: float
) -> tuple[str, dict[str, float]]:
    """A regime, and theta, mu_s, amplitude and what is given of a cell."""
    while True:
        regime = rng.choice(REGIMES)
        theta = rng.choice([0.0, rng.uniform(0.0, 12.0), rng.uniform(0.0, 35.0)])
        mu_s = rng.uniform(0.1, 1.2)
        if regime == "steep":  # stands by a measured yield acceleration only
            theta = rng.uniform(5.0, 40.0)
            mu_s = rng.uniform(0.2, 1.0) * math.tan(math.radians(theta))
        elif regime == "anything":
            theta = rng.uniform(0.0, 80.0)
            mu_s = rng.uniform(0.005, 4.0)
        tangent = math.tan(math.radians(theta))
        units = g / G
        onset = coulomb_yield(theta, mu_s) * units
        if "yield_acceleration" in given:
            share = (
                10.0 ** rng.uniform(-3.0, -0.7) if regime == "low_yield" else rng.uniform(0.1, 0.95)
            )
            onset = onset * share if onset > 0.0 else rng.uniform(0.01, 8.0) * units
        limit = limiting_acceleration(theta, mu_s, onset / units) * units
        uplift = math.inf if newmark or tangent == 0.0 else g / tangent
        high = 8.0 * onset if newmark else min(limit, uplift, limit / math.sqrt(mu_s))
        amplitude = onset + rng.uniform(0.002, 0.98) * (high - onset)
        if regime == "near_yield":
            amplitude = onset * (1.0 + 10.0 ** rng.uniform(-9.0, -2.0))
        elif regime == "near_limit":
            amplitude = limit * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9.0, -2.0))
        elif regime == "continuous" or (regime in ("given", "sharp") and rng.random() < 0.5):
            amplitude = limit * rng.uniform(1.001, 3.0)
        elif regime == "anything":
            amplitude = rng.uniform(0.01, 60.0) * units
        if regime != "anything" and not (0.01 * units < onset < high and amplitude < uplift):
            continue
        e_foldings = rng.choice([0.0, rng.uniform(0.1, 10.0), rng.uniform(0.1, 30.0)])
        if regime == "sharp":
            e_foldings = 10.0 ** rng.uniform(1.0, 5.0)
        values = {
            "yield_acceleration": onset,
            "decay_rate": e_foldings * g / amplitude,
            "delta_mu": rng.choice([0.0, rng.uniform(0.01, 0.4)]),
            "minimum_friction": rng.choice(
                [rng.uniform(0.01, 1.0) * mu_s, rng.uniform(0.001, 1.0)]
            ),
            "structure_frequency": 10.0 ** rng.uniform(-1.0, 2.0),
        }
        cell = {
            "theta": theta,
            "mu_s": mu_s,
            "amplitude": amplitude,
            "frequency": 10.0 ** rng.uniform(-1.0, 1.3),
        }
        return regime, cell | {name: values[name] for name in given}


def group_of(seed: int, size: int = 32) -> Group:
    """The group of a seed."""
    # a number from which all is drawn: many times faster than hypothesis' own draws
    rng = random.Random(seed)
    options = options_of(rng)
    given = [name for name, share in GIVEN.items() if rng.random() < share]
    drawn = [_cell(rng, given, options["model"] == "newmark", options["g"]) for _ in range(size)]
    columns = {name: np.array([cell[name] for _, cell in drawn]) for name in drawn[0][1]}
    if rng.random() < 0.15:
        columns["displacement_amplitude"] = (
            columns.pop("amplitude") / (2.0 * math.pi * columns["frequency"]) ** 2
        )
    terms = options.get("harmonics", "1:1:0").split(",")
    fastest = max(int(term.split(":")[1]) for term in terms)
    return Group(
        options,
        rng.choice(list(FINER)),
        4 * rng.randint(100, 300) * max(1, fastest // 4),
        columns,
        fastest,
        tuple(regime for regime, _ in drawn),
        rng.randrange(size),
        seed,
    )


# -------------------------------------------------------------------------------- comparing


def _sweep(cells: dict[str, Array], options: dict[str, Any]) -> Found:
    """Results of cells; rows of the columns are the dimension before."""
    columns: dict[str, Any] = {
        name: xr.DataArray(values, dims=("move", "cell")[-values.ndim :])
        for name, values in cells.items()
    }
    result = slipsweep.sweep(**columns, **choices(**options))
    return {str(name): result[name].to_numpy() for name in result.data_vars}


def exact_of(group: Group, size: float) -> Found:
    """Results of the cycle solver: the cells in row 0, below with all inputs moved by ± `size`."""
    generator = np.random.default_rng(group.seed % 2**32)
    # any two of the inputs, of which there are eight at most, move in the same direction in half of
    # the moves
    together = iter(hadamard(MOVES))
    moved = dict(group.cells)
    for name, values in group.cells.items():
        if name != "frequency":
            signs = next(together)[:, np.newaxis] * generator.choice([-1.0, 1.0], values.size)
            moved[name] = values * (1.0 + size * np.vstack([np.zeros(values.size), signs]))
    return _sweep(moved, group.options | {"solver": "cycle"})


def _outcome(mode: Any, validity: Any) -> tuple[int, int]:
    """Mode and validity without `UPSLOPE`, which rounding may raise where a displacement is 0."""
    return int(mode), int(validity) & ~int(Validity.UPSLOPE)


def _judged(
    kind: str,
    group: Group,
    exact: Found,
    j: int,
    results: dict[str, Any],
    coarse: dict[str, float] | None = None,
    **solver: Any,
) -> Comparison:
    """A cell's results found in another way against the cycle solver's.

    Differences are relative to the result; in continuous mode, where either may cancel, to what the
    other one comes to over the shaking, or a thousandth of what the plane does, if that is more.
    To the bound comes how far the neighbours are.
    """
    exact_of_cell = {name: values[0, j] for name, values in exact.items()}
    mode = int(exact_of_cell["sliding_mode"])
    arguments = group.cell(j) | group.options | solver
    # the call that repeats a cell, in the words of `cases.choices`
    text = ", ".join(f"{key}={value!r}" for key, value in arguments.items())
    text = f"seed {group.seed}, {group.regimes[j]}: {text}"
    outcome = _outcome(results["sliding_mode"], results["validity"])
    if outcome not in map(_outcome, exact["sliding_mode"][:, j], exact["validity"][:, j]):
        return Comparison(
            kind, group.regimes[j], mode, math.inf, math.inf, f"{text}: mode and validity {outcome}"
        )
    valued = not outcome[1] & VALUELESS
    if valued != all(math.isfinite(results[name]) for name in MOTION):
        return Comparison(kind, group.regimes[j], mode, math.inf, math.inf, f"{text}: {results}")
    if not valued or exact_of_cell["validity"] & VALUELESS:
        return Comparison(kind, group.regimes[j], mode, 0.0, 0.0, text)
    difference = 0.0
    times = 0.0
    u, v = (abs(float(exact_of_cell[name])) for name in MOTION)
    period = 1.0 / float(group.cells["frequency"][j])
    cycles = group.options["cycles"]
    pushed = group.amplitude(j) * period
    nothing = (1e-22 * pushed * period, 1e-22 * pushed)
    scales = max(u, nothing[0]), max(v, nothing[1])
    if mode == CONTINUOUS:
        pushed = 1e-3 * pushed
        scales = (
            max(u, v * period * cycles, pushed * period * cycles),
            max(v, u / (period * cycles), pushed),
        )
    for name, scale, least in zip(MOTION, scales, nothing, strict=True):
        apart = abs(float(results[name]) - exact_of_cell[name])
        if apart == 0.0:
            continue
        # those that have a value
        moved = float(np.nanmax(np.abs(exact[name][:, j] - exact_of_cell[name]))) + least
        bound = FLOORS[kind] * scale + moved
        if kind.startswith("step") and group.regimes[j] == "sharp":
            # friction may decay in a layer that is thinner than a step: seen less accurately
            times = max(times, apart / (max(FLOORS[kind], THIN_LAYER) * scale + moved))
            difference = max(difference, apart / scale)
            continue
        if coarse is not None:  # finer steps are nearer, unless the coarse ones are near already
            bound = min(bound, 0.5 * coarse[name] + 1e-3 * FLOORS[kind] * scale + moved)
        difference = max(difference, apart / scale)
        times = max(times, apart / bound)
        text += f"; {name} {float(results[name])!r}, cycle solver {float(exact_of_cell[name])!r}"
    return Comparison(kind, group.regimes[j], mode, difference, times, text)


def _stepped(group: Group, exact: Found) -> Iterator[Comparison]:
    """The step solver: codes, values, and that finer steps come nearer."""
    options = group.options | {"solver": "step", "rule": group.rule}
    # a lucky count of steps makes no error small
    runs = [
        _sweep(group.cells, options | {"steps_per_cycle": group.steps + more})
        for more in (0, 44, 92)
    ]
    fine = group.steps * FINER[group.rule]
    results = _sweep(group.cells, options | {"steps_per_cycle": fine})
    for j in range(len(group.regimes)):
        coarse = {
            name: max(abs(run[name][j] - exact[name][0, j]) for run in runs) for name in MOTION
        }
        of_cell = {name: values[j] for name, values in results.items()}
        yield _judged(
            f"step, {group.rule}",
            group,
            exact,
            j,
            of_cell,
            coarse,
            solver="step",
            rule=group.rule,
            steps_per_cycle=fine,
        )


def _histories(group: Group, exact: Found) -> Iterator[Comparison]:
    """Last displacement and largest velocity of `simulate`, also for continuous sliding."""
    cycles = group.options["cycles"]
    carried = [
        j for j in range(len(group.regimes)) if exact["validity"][0, j] & Validity.NOT_RECOUPLED
    ]
    for j in {group.one, *carried[:2]}:
        arguments = choices(**group.cell(j), **group.options)
        shaken = cycles / arguments["frequency"]
        spacing = 1.0 / arguments["frequency"] / (256 * group.fastest)
        # the largest V comes early, late or again and again; the run-out is over long before the
        # last of the times
        times = np.arange(min(cycles, 20) * 256 * group.fastest + 1) * spacing
        times = np.union1d(times, shaken - times) if cycles > 20 else times
        history = slipsweep.simulate(**arguments, times=np.append(times, 1e12 * shaken))
        codes = {name: history[name].item() for name in ("sliding_mode", "validity")}
        codes[MOTION[0]] = history.relative_displacement.to_numpy()[-1]
        highest = history.relative_velocity.to_numpy().max()
        displacement = exact[MOTION[1]][0, j]
        # between two samples V may be larger than at either; of a slip that lies between them no
        # sample knows
        ground = history.ground_acceleration.to_numpy()
        relative = np.abs(ground - history.block_acceleration.to_numpy())
        rate = 2.0 * max(relative.max(), np.abs(np.diff(ground)).max())
        codes[MOTION[1]] = (
            displacement if highest <= displacement <= highest + rate * spacing else highest
        )
        yield _judged("simulate", group, exact, j, codes)


def _by_reference(group: Group, exact: Found) -> Iterator[Comparison]:
    """The multiple-precision reference on a cell that takes it no minutes."""
    if group.fastest > 8 or group.options["cycles"] > 40 or group.options.get("ramp_in", 0.0) > 2.0:
        return
    cell = group.cell(group.one) | {"amplitude": group.amplitude(group.one)} | group.options
    cell.pop("displacement_amplitude", None)
    yield _judged("reference", group, exact, group.one, vars(reference.solve(**cell, dps=15)))


def compare(group: Group) -> Iterator[Comparison]:
    """All comparisons of a group."""
    near = exact_of(group, SIZES["simulate"])
    yield from _stepped(group, exact_of(group, SIZES[f"step, {group.rule}"]))
    yield from _histories(group, near)
    yield from _by_reference(group, near)
