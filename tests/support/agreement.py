"""Cells under all options and waveforms, on which the solvers are held to each other.

`groups` draws the options of one sweep and its cells: thousands of cells take few sweeps.  `compare` solves a group
in all ways that there are and gives the comparisons; the bounds stand in `FLOORS`.
`tests/kernels/test_agreement.py` does so for some groups, ``python -m benchmarks.agreement`` for many.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import hadamard

import slipsweep
from slipsweep.model.variables import VALUELESS, SlidingMode, Validity
from tests.support import brute_force
from tests.support.cases import choices
from tests.support.strategies import G, coulomb_yield, limiting_acceleration

Array = NDArray[Any]
Found = dict[str, Array]

#: Why a cell is drawn as it is; `REGIMES` names each as often as it is wanted.
REGIMES = (
    "coulomb", "coulomb", "measured", "measured", "low_yield", "low_yield", "near_yield", "continuous", "continuous",
    "near_limit", "given", "given", "sharp", "steep", "anything",
)  # fmt: skip

#: What may be given instead of its estimate, and how often it is.
GIVEN = {
    "yield_acceleration": 0.6,
    "decay_rate": 0.35,
    "delta_mu": 0.35,
    "minimum_friction": 0.2,
    "structure_frequency": 0.1,
}

#: A comparison's largest relative difference for well-conditioned cells.  Steps: about ten times what a hundred
#: thousand cells have shown with the finest steps of `compare`; the other ways round differently, no more.
FLOORS = {
    "step, rectangle": 5e-2,
    "step, trapezoid": 5e-3,
    "step, simpson": 1e-4,
    "simulate": 1e-8,
    "brute force": 2e-2,
    "sine as a harmonic": 1e-9,
    "triangle as a record": 1e-9,
}

#: Times as many steps: errors of first order fall to 1/16, of second order and more to 1/16 and less.
FINER = {"rectangle": 16, "trapezoid": 4, "simpson": 4}

#: Moves of all inputs, relative, that show the conditioning: of the size of the errors of steps, and of roundings.
SIZES = {
    "step, rectangle": 1e-3,
    "step, trapezoid": 1e-5,
    "step, simpson": 1e-6,
    "simulate": 1e-13,
    "brute force": 1e-3,
    "sine as a harmonic": 1e-13,
    "triangle as a record": 1e-13,
}
MOVES = 8

CONTINUOUS = int(SlidingMode.CONTINUOUS)

MOTION = ("permanent_displacement", "peak_relative_velocity")


@dataclass(frozen=True)
class Group:
    """Cells of one sweep: its options and the columns of its cells; of those in `histories` a history is taken.

    `fastest` is the multiple of the fastest harmonic; steps and histories resolve that.
    """

    options: dict[str, Any]
    rule: str
    steps: int
    cells: dict[str, Array]
    fastest: int
    regimes: tuple[str, ...]
    histories: tuple[int, ...]
    seed: int


@dataclass(frozen=True)
class Comparison:
    """One cell solved in two ways: the difference of the results over its bound (agreed: 1 at most)."""

    kind: str
    regime: str
    mode: int
    difference: float
    times_bound: float
    text: str


# ---------------------------------------------------------------------------------- drawing


def _phase(rng: random.Random) -> float:
    return rng.choice([0.0, 90.0, 180.0, 270.0, rng.uniform(-180.0, 360.0), rng.uniform(0.0, 360.0)])


def _harmonics(rng: random.Random) -> str:
    count = rng.choice([1, 2, 2, 3, 4])
    multiples = sorted(rng.sample(range(1, rng.choice([4, 8, 20]) + 1), count))
    return ",".join(f"{rng.choice([-1, 1]) * 10 ** rng.uniform(-1.5, 0)}:{m}:{_phase(rng)}" for m in multiples)


def options_of(rng: random.Random) -> dict[str, Any]:
    """Options of `slipsweep.sweep` but for the solver's."""
    options: dict[str, Any] = {"model": rng.choice(["mendez", "mendez", "mendez", "newmark"])}
    if options["model"] == "mendez":
        options["rise"] = rng.choice(["monotone", "literal"])
        options["recoupling"] = rng.choice(["eq12", "integrate"])
    options["waveform"] = rng.choice(["sine", "cosine", "cosine", "triangle", "square", *["harmonics"] * 4])
    if options["waveform"] == "harmonics":
        options["harmonics"] = _harmonics(rng)
    options["cycles"] = rng.choice([1, 2, 3, 4, 5, 6, 8, 10, 12, 40, 1000])
    if rng.random() < 0.5:
        ramps = [rng.choice([0.0, 0.25, 0.5, 1.0, 2.0, rng.uniform(0.0, 4.0)]) for _ in range(2)]
        if sum(ramps) <= options["cycles"]:
            options["ramp_in"], options["ramp_out"] = ramps
    options["g"] = rng.choice([9.81, 9.81, 9.81, 1.62, 980.665])
    return options


def _cell(rng: random.Random, given: list[str], newmark: bool, g: float) -> tuple[str, dict[str, float]]:
    """A regime, and theta, mu_s, amplitude and what is given of a cell."""
    while True:
        regime = rng.choice(REGIMES)
        theta, mu_s = rng.choice([0.0, rng.uniform(0.0, 12.0), rng.uniform(0.0, 35.0)]), rng.uniform(0.1, 1.2)
        if regime == "steep":  # stands by a measured yield acceleration only
            theta = rng.uniform(5.0, 40.0)
            mu_s = rng.uniform(0.2, 1.0) * math.tan(math.radians(theta))
        elif regime == "anything":
            theta, mu_s = rng.uniform(0.0, 80.0), rng.uniform(0.005, 4.0)
        tangent, units = math.tan(math.radians(theta)), g / G
        onset = coulomb_yield(theta, mu_s) * units
        if "yield_acceleration" in given:
            share = 10.0 ** rng.uniform(-3.0, -0.7) if regime == "low_yield" else rng.uniform(0.1, 0.95)
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
            "minimum_friction": rng.choice([rng.uniform(0.01, 1.0) * mu_s, rng.uniform(0.001, 1.0)]),
            "structure_frequency": 10.0 ** rng.uniform(-1.0, 2.0),
        }
        cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": 10.0 ** rng.uniform(-1.0, 1.3)}
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
        columns["displacement_amplitude"] = columns.pop("amplitude") / (2.0 * math.pi * columns["frequency"]) ** 2
    terms = options.get("harmonics", "1:1:0").split(",")
    fastest = max(int(term.split(":")[1]) for term in terms)
    return Group(
        options,
        rng.choice(list(FINER)),
        4 * rng.randint(100, 300) * max(1, fastest // 4),
        columns,
        fastest,
        tuple(regime for regime, _ in drawn),
        (rng.randrange(size),),
        seed,
    )


#: Groups of cells, of all options; those of twice the cells take half as much time again.
groups = st.integers(0, 2**63 - 1).map(group_of)
large_groups = st.integers(0, 2**63 - 1).map(lambda seed: group_of(seed, 64))


# -------------------------------------------------------------------------------- comparing


def _sweep(cells: dict[str, Array], options: dict[str, Any]) -> Found:
    """Results of cells; rows of the columns are the dimension before."""
    columns: dict[str, Any] = {
        name: xr.DataArray(values, dims=("move", "cell")[-values.ndim :]) for name, values in cells.items()
    }
    found = slipsweep.sweep(**columns, **choices(**options))
    return {str(name): found[name].to_numpy() for name in found.data_vars}


def _moved(cells: dict[str, Array], size: float, seed: int) -> dict[str, Array]:
    """Every cell with all its inputs moved up or down by `size`, `MOVES` times."""
    generator = np.random.default_rng(seed)
    # any two of the inputs, of which there are eight at most, move in the same direction in half of the moves
    together = iter(hadamard(MOVES))
    moved = {}
    for name, values in cells.items():
        if name == "frequency":
            moved[name] = values
            continue
        signs = next(together)[:, np.newaxis] * generator.choice([-1.0, 1.0], values.size)
        moved[name] = values * (1.0 + size * signs)
    return moved


def _outcome(found: dict[str, Any]) -> tuple[int, int]:
    """Mode and validity, but for `UPSLOPE`: the sign of a displacement, which may be 0 but for roundings."""
    return int(found["sliding_mode"]), int(found["validity"]) & ~int(Validity.UPSLOPE)


@dataclass(frozen=True)
class Exact:
    """What the cycle solver says of the cells, and of their neighbours."""

    cells: Found
    neighbours: Found

    def of(self, j: int) -> dict[str, Any]:
        return {name: values[j] for name, values in self.cells.items()}

    def outcomes(self, j: int) -> set[tuple[int, int]]:
        """Mode and validity of a cell and of its neighbours."""
        pairs = zip(self.neighbours["sliding_mode"][:, j], self.neighbours["validity"][:, j], strict=True)
        return {_outcome(self.of(j))} | {_outcome({"sliding_mode": mode, "validity": flags}) for mode, flags in pairs}

    def spread(self, name: str, j: int) -> float:
        """How far a result of the neighbours is from the cell's; those without a value do not count."""
        apart = np.abs(self.neighbours[name][:, j] - self.cells[name][j])
        return float(np.nanmax(np.where(np.isnan(apart), 0.0, apart)))


def _amplitude(group: Group, j: int) -> float:
    """The plane's peak acceleration of a cell."""
    if "amplitude" in group.cells:
        return float(group.cells["amplitude"][j])
    return float(group.cells["displacement_amplitude"][j] * (2.0 * math.pi * group.cells["frequency"][j]) ** 2)


def _text(group: Group, j: int, **solver: Any) -> str:
    """The call that repeats a cell, in the words of `cases.choices`."""
    arguments = {name: float(values[j]) for name, values in group.cells.items()} | group.options | solver
    return f"seed {group.seed}, {group.regimes[j]}: " + ", ".join(
        f"{key}={value!r}" for key, value in arguments.items()
    )


def _judged(
    kind: str, group: Group, exact: Exact, j: int, found: dict[str, Any], coarse: dict[str, float] | None = None,
    **solver: Any,
) -> Comparison:  # fmt: skip
    """A cell's results found in another way against the cycle solver's.

    Differences are relative to the result; in continuous mode, where either may cancel, to what the other one comes
    to over the shaking, or a thousandth of what the plane does, if that is more.  To the bound comes how far the
    neighbours are.
    """
    own = exact.of(j)
    mode = int(own["sliding_mode"])
    text = _text(group, j, **solver)
    outcome = _outcome(found)
    if outcome not in exact.outcomes(j):
        return Comparison(kind, group.regimes[j], mode, math.inf, math.inf, f"{text}: mode and validity {outcome}")
    valued = not outcome[1] & VALUELESS
    if valued != all(math.isfinite(found[name]) for name in MOTION):
        return Comparison(kind, group.regimes[j], mode, math.inf, math.inf, f"{text}: {found}")
    if not valued or own["validity"] & VALUELESS:
        return Comparison(kind, group.regimes[j], mode, 0.0, 0.0, text)
    difference, times = 0.0, 0.0
    u, v = (abs(float(own[name])) for name in MOTION)
    scales = (u, v)
    if mode == CONTINUOUS:
        period, cycles = 1.0 / float(group.cells["frequency"][j]), group.options["cycles"]
        pushed = 1e-3 * _amplitude(group, j) * period
        scales = max(u, v * period * cycles, pushed * period * cycles), max(v, u / (period * cycles), pushed)
    for name, scale in zip(MOTION, scales, strict=True):
        apart = abs(found[name] - own[name])
        if apart == 0.0:
            continue
        moved = exact.spread(name, j)
        bound = FLOORS[kind] * scale + moved
        if coarse is not None:  # finer steps are nearer, unless the coarse ones are near already
            bound = min(bound, 0.5 * coarse[name] + 1e-3 * FLOORS[kind] * scale + moved)
        difference = max(difference, apart / scale if scale > 0.0 else math.inf)
        times = max(times, apart / bound if bound > 0.0 else math.inf)
        text += f"; {name} {found[name]!r}, cycle solver {float(own[name])!r}"
    return Comparison(kind, group.regimes[j], mode, difference, times, text)


def _stepped(group: Group, exact: Exact) -> Iterator[Comparison]:
    """The step solver: codes, values, and that finer steps come nearer."""
    options = group.options | {"solver": "step", "rule": group.rule}
    # a lucky count of steps makes no error small
    runs = [_sweep(group.cells, options | {"steps_per_cycle": group.steps + more}) for more in (0, 44, 92)]
    fine = group.steps * FINER[group.rule]
    found = _sweep(group.cells, options | {"steps_per_cycle": fine})
    for j in range(len(group.regimes)):
        coarse = {name: max(abs(run[name][j] - exact.cells[name][j]) for run in runs) for name in MOTION}
        own = {name: values[j] for name, values in found.items()}
        yield _judged(
            f"step, {group.rule}", group, exact, j, own, coarse, solver="step", rule=group.rule, steps_per_cycle=fine
        )


def _about_the_largest(times: Array, velocity: Array, moved: Array, spacing: float, rate: float) -> Array:
    """Finer times wherever V, which changes at this rate at most, may be larger than at any of these.

    As long as V is positive at none: where the block has moved most from one to the next, and where V is just below 0.
    """
    highest = velocity.max()
    if highest > 0.0:
        places = np.flatnonzero(velocity + rate * spacing >= highest)
        # the same pulse comes again in other cycles
        heights, first = np.unique(np.round(velocity[places] / highest, 10), return_index=True)
        places = places[first[np.argsort(-heights)[:256]]]
    else:
        slid = np.where(np.diff(times) <= 1.5 * spacing, np.diff(moved), 0.0)
        below = np.flatnonzero((velocity < 0.0) & (velocity + rate * spacing >= 0.0))
        below = below[np.argsort(-velocity[below], kind="stable")[:256]]
        places = np.union1d(np.argsort(-slid, kind="stable")[:16], below)
    about = times[places, np.newaxis] + np.linspace(-spacing, spacing, 65)
    return np.unique(np.clip(about, times[0], times[-1]))


def _histories(group: Group, exact: Exact) -> Iterator[Comparison]:
    """`simulate`: end and largest velocity of the samples; of cells that slide on into the next pulse, too."""
    cycles = group.options["cycles"]
    carried = [j for j in range(len(group.regimes)) if exact.of(j)["validity"] & Validity.NOT_RECOUPLED]
    for j in {*group.histories, *carried[:2]}:
        arguments = choices(**{name: float(values[j]) for name, values in group.cells.items()}, **group.options)
        shaken, spacing = cycles / arguments["frequency"], 1.0 / arguments["frequency"] / (64 * group.fastest)
        # the largest V comes early, late or again and again
        times = np.arange(min(cycles, 20) * 64 * group.fastest + 1) * spacing
        times = np.union1d(times, shaken - times) if cycles > 20 else times
        found: dict[str, Any] = {MOTION[1]: -math.inf}
        rate = 0.0
        for level in range(9):
            # the run-out is over long before the last of the times
            history = slipsweep.simulate(**arguments, times=np.append(times, 1e12 * shaken))
            velocity, moved = history.relative_velocity.to_numpy(), history.relative_displacement.to_numpy()
            found[MOTION[1]] = np.maximum(found[MOTION[1]], velocity.max())
            if level == 0:
                found |= {name: history[name].item() for name in ("sliding_mode", "validity")}
                found[MOTION[0]] = moved[-1]
            rate = max(rate, 2.0 * np.abs(history.ground_acceleration - history.block_acceleration).max().item())
            if found["sliding_mode"] < 1 or rate * spacing < 1e-9 * velocity.max():
                break
            times = _about_the_largest(times, velocity[:-1], moved[:-1], spacing, rate)
            spacing /= 32.0
        yield _judged("simulate", group, exact, j, found)


def _as_a_harmonic(group: Group, exact: Exact) -> Iterator[Comparison]:
    """A sine has ways of its own; one that is called a harmonic takes those of all waves."""
    if group.options["waveform"] == "sine":
        found = _sweep(group.cells, group.options | {"waveform": "harmonics", "harmonics": "1:1:0"})
        for j in range(len(group.regimes)):
            yield _judged("sine as a harmonic", group, exact, j, {name: values[j] for name, values in found.items()})


def _as_a_record(group: Group, exact: Exact) -> Iterator[Comparison]:
    """A triangle is a record of straight lines, whose pulses have one peak; continuous ones end otherwise."""
    options = group.options
    if options["waveform"] != "triangle" or options["cycles"] > 40 or "ramp_in" in options:
        return
    count = options["cycles"]
    times = np.concatenate([[0.0], 0.25 + 0.5 * np.arange(2 * count), [count]])
    values = np.concatenate([[0.0], np.where(np.arange(2 * count) % 2, -1.0, 1.0), [0.0]])
    names = {"theta", "mu_s", "yield_acceleration"}
    if options["model"] == "mendez":
        names |= {"decay_rate", "delta_mu", "minimum_friction"}
    given = {name: value for name, value in options.items() if name in ("model", "rise", "recoupling", "g")}
    cells = {name: column for name, column in group.cells.items() if name in names}
    cells["scale"] = np.array([_amplitude(group, j) for j in range(len(group.regimes))])
    cells["time_scale"] = 1.0 / group.cells["frequency"]
    found = _sweep(cells, given | {"excitation": slipsweep.Record(times, values)})
    for j in range(len(group.regimes)):
        own = exact.of(j)
        if own["sliding_mode"] != CONTINUOUS:
            result = {name: column[j] for name, column in found.items()}
            # whose mode and whose stiffness a record does not say
            result["sliding_mode"] = own["sliding_mode"]
            result["validity"] |= own["validity"] & np.int16(Validity.FLEXIBLE_BLOCK)
            if own["validity"] & VALUELESS and result["permanent_displacement"] == 0.0:
                continue  # of pulses that do not reach Üy a record says nothing
            if result["validity"] & own["validity"] & VALUELESS:
                result["validity"] = own[
                    "validity"
                ]  # a record looks for no pulse's flags where one for all takes the value
            yield _judged("triangle as a record", group, exact, j, result)


#: Steps a cycle of the slowest harmonics, and of a group.
BRUTE_FORCE_STEPS, MOST_STEPS = 8192, 6_000_000


def _by_brute_force(group: Group, exact: Exact) -> Iterator[Comparison]:
    """Step after step by the rules' text, on as many cells as do not take long."""
    options = group.options
    steps = BRUTE_FORCE_STEPS * max(1, group.fastest // 2)
    count = MOST_STEPS // (steps * options["cycles"])
    terms = np.array([[float(x) for x in term.split(":")] for term in options.get("harmonics", "1:1:0").split(",")])
    ramps = (options.get("ramp_in", 0.0), options.get("ramp_out", 0.0))
    plane = brute_force.shaking(options["waveform"], terms, options["cycles"], *ramps, steps) if count else np.zeros(0)
    # slides from pulses that hardly pass Üy are shorter than some tens of steps
    peaks = plane[:1], plane[1:-1][(plane[1:-1] >= plane[:-2]) & (plane[1:-1] >= plane[2:])]
    heights = np.unique(np.concatenate(peaks).round(6))
    for j in range(min(count, len(group.regimes))):
        own = exact.of(j)
        near = exact.outcomes(j)
        if SlidingMode.STUCK in {mode for mode, _ in near} or own["validity"] & VALUELESS & ~Validity.KD_NOT_POSITIVE:
            continue
        omega = 2.0 * math.pi * float(group.cells["frequency"][j])
        cell = {name: float(values[j]) for name, values in group.cells.items()} | {"amplitude": _amplitude(group, j)}
        one, is_continuous = brute_force.block(cell, options["model"], options["g"])
        if np.any(np.abs(one.onset - one.amplitude * heights) < 0.01 * one.onset):
            continue
        moved = brute_force.moved(one, is_continuous, options, plane, steps)
        found: dict[str, Any] = {"sliding_mode": own["sliding_mode"], "validity": own["validity"]}
        if all(bool(flags & Validity.NOT_RECOUPLED) == moved.recoupled for _, flags in near):
            found["validity"] ^= np.int16(Validity.NOT_RECOUPLED)
        if all(bool(flags & VALUELESS) == moved.valued for _, flags in near):
            found["validity"] ^= np.int16(Validity.KD_NOT_POSITIVE)
        found[MOTION[0]] = moved.displacement / omega**2
        found[MOTION[1]] = moved.peak / omega
        if moved.valued or not own["validity"] & VALUELESS:
            yield _judged("brute force", group, exact, j, found)


def compare(group: Group) -> Iterator[Comparison]:
    """All comparisons of a group."""
    near = exact_of(group, SIZES["simulate"])
    yield from _stepped(group, exact_of(group, SIZES[f"step, {group.rule}"]))
    yield from _histories(group, near)
    yield from _by_brute_force(group, exact_of(group, SIZES["brute force"]))
    yield from _as_a_harmonic(group, near)
    yield from _as_a_record(group, near)


def exact_of(group: Group, move: float) -> Exact:
    """What the cycle solver says of a group, and of its cells moved."""
    options = group.options | {"solver": "cycle"}
    moved = _moved(group.cells, move, group.seed % 2**32)
    return Exact(_sweep(group.cells, options), _sweep(moved, options))


def detected(group: Group, kind: str, wrong: float) -> list[bool]:
    """Of the cells that move, and away from the sliding modes' limits, whether a result so much off is seen."""
    exact = exact_of(group, SIZES[kind])
    seen = []
    for j, regime in enumerate(group.regimes):
        own = exact.of(j)
        if own["permanent_displacement"] > 0.0 and not regime.startswith("near"):
            # in continuous sliding a displacement may be the small rest of large ones; velocities are not
            names = MOTION if own["sliding_mode"] == CONTINUOUS else MOTION[:1]
            found = own | {name: (1.0 - wrong) * own[name] for name in names}
            seen.append(_judged(kind, group, exact, j, found).times_bound > 1.0)
    return seen
