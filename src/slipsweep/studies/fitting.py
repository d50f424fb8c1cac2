"""Least squares of a test: Üy, λ and Δμ from all that was measured, with what else is not known.

Beside the three parameters stand nuisances, each with a standard deviation for a prior: the ways in which the
table's motion may be wrong (`table_motion`), and the offsets and drifts of sensors that are asked for.  Their effect on
what is computed is linear, but for what a new round of fitting puts right, so that they need not be searched for:
residuals e have the covariance 1 + E Eᵀ, E being the effects, and are whitened by it.  The intervals of
the parameters then hold all of it: noise of the block's sensors, noise of the table's, offsets, drifts.

The block's acceleration jumps where the block stops, and where the table's changes its sign in continuous sliding.
A sample next to a jump tells on which side of it the jump lies, which no derivative sees: such samples are left
out, wherever the jumps of the computed motion lie, until that changes no more.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import least_squares

from slipsweep.motion.shaking import TABLE, ShakingTest
from slipsweep.studies.forward import COLUMN, Forward
from slipsweep.studies.friction import noise_of
from slipsweep.studies.table_motion import TableMotion

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: What is sought, in the order of all vectors here.
SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")

#: The least noise that a channel is taken to have, in parts of its largest value.
_LEAST_NOISE = 1e-4

#: Intervals of sampling to either side of a jump that are left out.
_BESIDE_A_JUMP = 1.6

#: Rounds of fitting in which the samples left out, the noise and the effects settle.
_MOST_ROUNDS = 6

#: The same where the effects are known already.
_FEW_ROUNDS = 2

#: Parts of its standard error by which no parameter moves any more.
_SETTLED = 0.1

#: Yield accelerations that are tried, in parts of their size (`Fit.scale`).
_ONSETS = np.geomspace(0.03, 3.0, 16)

#: Sum of squares by which another Üy must be better.
_BETTER = 1.0

#: Step of the derivatives by parameters, in parts of their size; by ways the table's motion is wrong, in deviations.
_STEP, _SHAPE_STEP = 1e-4, 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """An offset or a drift of a sensor: what one unit of it adds to channels, and how large it may be."""

    name: str
    parts: Mapping[str, Floats]
    deviation: float


@dataclass(frozen=True, eq=False)
class Whitening:
    """Residuals with the covariance 1 + E Eᵀ made independent, and what they say of the nuisances."""

    left: Floats
    sizes: Floats
    right: Floats

    @classmethod
    def of(cls, effects: Floats) -> "Whitening":
        left, sizes, right = np.linalg.svd(effects, full_matrices=False)
        return cls(left, sizes, right)

    def __call__(self, residuals: Floats) -> Floats:
        shrunk = 1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2)
        along = self.left.T @ residuals
        return np.asarray(residuals - self.left @ (shrunk * along.T).T)

    def nuisances(self, residuals: Floats) -> Floats:
        """Their most likely values, in standard deviations of the prior."""
        return np.asarray(self.right.T @ ((self.sizes / (1.0 + self.sizes**2)) * (self.left.T @ residuals).T).T)

    def spread(self) -> Floats:
        """Their covariance, for known parameters."""
        inside = (self.right.T / (1.0 + self.sizes**2)) @ self.right
        return np.asarray(inside + np.eye(self.right.shape[1]) - self.right.T @ self.right)


@dataclass(eq=False)
class Fit:
    """A test and how it is fitted; `solve` finds the parameters.

    Attributes
    ----------
    test : ShakingTest
    motion : TableMotion
        Its last shapes may be lines, of which `table_lines` are the names.
    forward : Forward
    use : dict of str to ndarray
        Which samples of which channels count.
    lines : list of Line
    table_lines : tuple of str
    fixed : tuple of int
        Places of parameters that are not sought.
    noise : dict of str to float
        Standard deviation of each channel; what is not given is found.
    scans : bool
        Whether many Üy are tried.
    """

    test: ShakingTest
    motion: TableMotion
    forward: Forward
    use: dict[str, Mask]
    lines: list[Line] = field(default_factory=list)
    table_lines: tuple[str, ...] = ()
    fixed: tuple[int, ...] = ()
    given_noise: Mapping[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)
    scans: bool = True

    def __post_init__(self) -> None:
        table = float(np.abs(self.test.channels[TABLE]).max())
        #: Sizes and lower bounds of the parameters.
        self.scale = np.array([0.3 * table, 2.0, 0.3 * self.forward.mu_s])
        self.least = np.array([1e-6 * table, 0.0, 0.0])
        for name in self.channels:
            values = self.test.channels[name][self.use[name]]
            self.noise.setdefault(name, self.given_noise.get(name, max(noise_of(values), self.least_noise(name))))

    def least_noise(self, name: str) -> float:
        """The least noise that a channel is taken to have."""
        return _LEAST_NOISE * float(np.nanmax(np.abs(self.test.channels[name]), initial=1e-12))

    @property
    def channels(self) -> tuple[str, ...]:
        """What is fitted to."""
        return tuple(self.use)

    @property
    def free(self) -> list[int]:
        """Places of the parameters that are sought."""
        return [at for at in range(len(SOUGHT)) if at not in self.fixed]

    # ------------------------------------------------------------------ measured and computed

    def computed(self, parameters: Floats, wrong: Floats, times: Floats | None = None) -> Floats:
        """The history of the block."""
        every = np.zeros(self.motion.shapes.shape[1])
        every[: wrong.size] = wrong
        return self.forward(self.motion.record(every), parameters, self.test.times if times is None else times)

    def stacked(self, columns: Callable[[str], Floats]) -> Floats:
        """The samples that count, of all channels, in standard deviations."""
        return np.concatenate([columns(name)[self.use[name]] / self.noise[name] for name in self.channels])

    def of_history(self, history: Floats) -> Floats:
        """`stacked` of a history."""
        return self.stacked(lambda name: history[:, COLUMN[name]])

    def of_line(self, line: Line) -> Floats:
        """`stacked` of one standard deviation of a line."""
        none = np.zeros(self.test.times.size)
        return line.deviation * self.stacked(lambda name: line.parts.get(name, none))

    def residuals(self, parameters: Floats, wrong: Floats, effects: Floats) -> Floats:
        """Measured less computed values, as if the table's motion were that of the spline."""
        history = self.computed(parameters, wrong)
        found = self.stacked(lambda name: self.test.channels[name] - history[:, COLUMN[name]])
        if wrong.size:
            found = found + effects[:, : wrong.size] @ wrong
        return np.where(np.isfinite(found), found, 1e3)  # no value: far off

    def derivatives(self, parameters: Floats, wrong: Floats) -> Floats:
        """Of the samples computed, by the parameters: a column each."""
        columns = []
        for at in range(len(SOUGHT)):
            step = np.zeros(len(SOUGHT))
            step[at] = _STEP * self.scale[at]
            low, high = np.maximum(parameters - step, self.least), np.maximum(parameters + step, self.least)
            change = self.computed(high, wrong) - self.computed(low, wrong)
            columns.append(self.of_history(change) / (high - low)[at])
        return np.nan_to_num(np.column_stack(columns))

    def shape_effects(self, parameters: Floats, wrong: Floats) -> list[Floats]:
        """What each way of the table's motion to be wrong, one standard deviation of it, does to the history."""
        base = self.computed(parameters, wrong)
        found = []
        for at in range(wrong.size):
            step = np.zeros(wrong.size)
            step[at] = _SHAPE_STEP if at < wrong.size - len(self.table_lines) else 1e-3
            found.append((self.computed(parameters, wrong + step) - base) / step[at])
        return found

    def effects(self, shapes: Sequence[Floats]) -> Floats:
        """What each nuisance does to the samples computed: a column each."""
        columns = [self.of_history(one) for one in shapes]
        columns += [self.of_line(one) for one in self.lines]
        rows = sum(int(self.use[name].sum()) for name in self.channels)
        return np.nan_to_num(np.column_stack(columns)) if columns else np.zeros((rows, 0))

    # ------------------------------------------------------------------------------- jumps

    def jumps(self, parameters: Floats, wrong: Floats) -> Floats:
        """Times at which the block's computed acceleration jumps by more than the noise."""
        times = self.test.times
        fine = np.interp(np.arange(0, times.size - 1, 0.125), np.arange(times.size), times)
        history = self.computed(parameters, wrong, fine)
        block, table = history[:, COLUMN["block_acceleration"]], history[:, COLUMN[TABLE]]
        # either is smooth where the block holds its acceleration or stays with the table
        change = np.minimum(np.abs(np.diff(block)), np.abs(np.diff(block - table)))
        least = max(self.noise.get("block_acceleration", 0.0), 0.02 * float(np.abs(table).max()))
        return np.asarray(fine[np.flatnonzero(change > least)])

    def beside(self, jumps: Floats) -> Mask:
        """Samples next to a jump."""
        times = self.test.times
        before = np.diff(times, prepend=2 * times[0] - times[1])
        after = np.append(before[1:], before[-1])
        found = np.zeros(times.size, dtype=bool)
        for jump in jumps:
            found |= (times > jump - _BESIDE_A_JUMP * after) & (times < jump + _BESIDE_A_JUMP * before)
        return found

    # ------------------------------------------------------------------------------- solving

    def rough(self, start: Floats) -> float:
        """How far a start is from what was measured: no sample counts for more than a few."""
        history = self.computed(start, np.zeros(self.motion.shapes.shape[1]))
        total = 0.0
        for name in self.channels:
            values = self.test.channels[name]
            spread = max(self.noise[name], 0.1 * float(np.nanmax(np.abs(values))))
            rest = (values - history[:, COLUMN[name]])[self.use[name]] / spread
            total += float(np.mean(np.log1p(rest**2))) if np.isfinite(rest).all() else 1e6
        return total

    def search(self, start: Floats, wrong: Floats, effects: Floats, loss: str = "linear") -> Floats:
        """Parameters of the least squares, from a start."""
        free, whiten = self.free, Whitening.of(effects)

        def all_of(part: Floats) -> Floats:
            whole = start.copy()
            # what is as good as at its bound is there
            whole[free] = np.where(part - self.least[free] < 1e-9 * self.scale[free], self.least[free], part)
            return whole

        found = least_squares(
            lambda part: whiten(self.residuals(all_of(part), wrong, effects)),
            np.maximum(start, 2.0 * self.least + 1e-9)[free],
            lambda part: -whiten(self.derivatives(all_of(part), wrong)[:, free]),
            bounds=(self.least[free], np.inf),
            x_scale=self.scale[free],
            loss=loss,
            f_scale=3.0,
            ftol=1e-8,
            xtol=1e-6,
            gtol=1e-8,
            max_nfev=40,
        )
        return all_of(np.asarray(found.x))

    def scanned(self, found: Floats, wrong: Floats, effects: Floats) -> Floats:
        """The least squares, looked for from many Üy: where Eq. 4 meets the table's acceleration none matters."""
        if 0 in self.fixed:
            return found
        whiten, best = Whitening.of(effects), found

        def rest(tried: Floats) -> Floats:
            return whiten(self.residuals(tried, wrong, effects))

        least = float(np.sum(rest(found) ** 2)) - _BETTER
        for value in self.scale[0] * _ONSETS:
            tried = np.array([value, *found[1:]])
            # λ and Δμ that go with it, by one step
            slopes = whiten(self.derivatives(tried, wrong)[:, 1:])
            tried[1:] = np.maximum(found[1:] + np.linalg.lstsq(slopes, rest(tried), rcond=1e-6)[0], self.least[1:])
            if (square := float(np.sum(rest(tried) ** 2))) < least:
                best, least = tried, square
        if best is found:
            return found
        again = self.search(best, wrong, effects)
        return again if np.sum(rest(again) ** 2) < np.sum(rest(found) ** 2) else found

    def solve(self, starts: Sequence[Floats], shapes: Sequence[Floats] | None = None, near: bool = False) -> "Solution":
        """The parameters of the least squares, from the best of the starts.

        `shapes` are the effects of the ways of the table's motion to be wrong, where they are known already; `near`
        says that the start is close.
        """
        all_samples = dict(self.use)
        wrong = np.zeros(self.motion.shapes.shape[1])
        parameters = min(starts, key=self.rough)
        if not near:
            parameters = self._robust(parameters, wrong)
        solution = self._settled(parameters, wrong, shapes)
        if not self.scans:
            return solution
        elsewhere = self.scanned(solution.parameters, solution.wrong, self.effects(solution.shapes))
        if elsewhere is solution.parameters:
            return solution
        # other samples lie beside its jumps: what is better is not known before it has settled, with the same noise
        alone = replace(self, use=dict(all_samples), noise={}, given_noise=dict(self.noise), scans=False)
        other = alone._settled(elsewhere, solution.wrong)
        if other.cost() > solution.cost() - _BETTER:
            return solution
        free = replace(self, use=all_samples, noise=dict(self.noise), scans=False)
        return free._settled(other.parameters, other.wrong)

    def _settled(self, parameters: Floats, wrong: Floats, shapes: Sequence[Floats] | None = None) -> "Solution":
        """The least squares near a start; each round leaves out the samples beside the jumps of the one before."""
        all_samples = dict(self.use)
        for turn in range(_MOST_ROUNDS if shapes is None else _FEW_ROUNDS):
            before = parameters
            if "block_acceleration" in self.use:
                clear = ~self.beside(self.jumps(parameters, wrong))
                self.use["block_acceleration"] = all_samples["block_acceleration"] & clear
            now = self.shape_effects(parameters, wrong) if shapes is None else shapes
            self._take_noise(parameters, wrong, now)
            effects = self.effects(now)
            parameters = self.search(parameters, wrong, effects)
            solution = Solution.of(self, parameters, wrong, now)
            errors = solution.errors
            if turn and np.all(np.abs(parameters - before) <= _SETTLED * np.where(errors > 0.0, errors, np.inf)):
                break
            wrong = solution.nuisances[: wrong.size]
        return solution

    def _robust(self, start: Floats, wrong: Floats) -> Floats:
        """So that no sample counts for much, and without the noise of the table, which would mix them."""
        noisy = wrong.size - len(self.table_lines)
        nothing = np.zeros((self.test.times.size, len(COLUMN)))
        first = [nothing] * noisy + self.shape_effects(start, wrong)[noisy:] if self.table_lines else []
        return self.search(start, wrong if first else wrong[:0], self.effects(first), "soft_l1")

    def _take_noise(self, parameters: Floats, wrong: Floats, shapes: Sequence[Floats]) -> None:
        """What is left over is the noise of a channel, where that was not given."""
        effects = self.effects(shapes)
        found = self.residuals(parameters, wrong, effects)
        found = found - effects @ Whitening.of(effects).nuisances(found)
        ends = np.cumsum([int(self.use[name].sum()) for name in self.channels])
        for name, part in zip(self.channels, np.split(found, ends[:-1]), strict=True):
            if name not in self.given_noise and part.size:
                self.noise[name] = max(self.noise[name] * float(np.sqrt(np.mean(part**2))), self.least_noise(name))


#: Steps to the least squares at each Üy, and the sum of squares above the least at which a profile ends.
_PROFILE_STEPS, _FAR = 2, 50.0

#: Where the profile over Üy is computed, in standard errors of it about the best, and beyond in parts of the size.
_ABOUT = np.linspace(-3.0, 3.0, 9)


@dataclass(frozen=True, eq=False)
class Profile:
    """The least sum of squares over λ and Δμ for each Üy, above the least of all, and what they are there.

    Where Üy stops to matter, as where Eq. 4 meets the table's acceleration, no parabola describes how well it is
    known; and λ and Δμ depend on it.
    """

    onsets: Floats
    above: Floats
    others: Floats
    errors: Floats

    def better(self, found: Floats) -> Floats | None:
        """The best parameters of the profile, if those found are not about as good."""
        nearest = int(np.argmin(np.abs(self.onsets - found[0])))
        best = int(np.argmin(self.above))
        apart = np.abs(self.others[nearest] - found[1:]) > 1.5 * self.errors[nearest]
        if self.above[nearest] <= _BETTER and not (apart & (self.errors[nearest] > 0.0)).any():
            return None
        return np.array([self.onsets[best], *self.others[best]])

    def interval(self, at: int, square: float) -> tuple[float, float]:
        """Where the sum of squares of parameter `at` lies no more than `square` above the least, from end to end."""
        inside = np.maximum(square - self.above, 0.0)
        if at > 0:
            middle, half = self.others[:, at - 1], self.errors[:, at - 1] * np.sqrt(inside)
            within = inside > 0.0
            return float((middle - half)[within].min()), float((middle + half)[within].max())
        # √ of a parabola is straight
        root, limit = np.sqrt(np.maximum(self.above, 0.0)), square**0.5
        inner = np.flatnonzero(root <= limit)
        ends = []
        for end, beyond in ((inner[0], inner[0] - 1), (inner[-1], inner[-1] + 1)):
            if not 0 <= beyond < root.size:
                ends.append(0.0 if beyond < 0 else np.inf)
                continue
            part = (limit - root[end]) / (root[beyond] - root[end])
            ends.append(float(self.onsets[end] + part * (self.onsets[beyond] - self.onsets[end])))
        return ends[0], ends[1]


@dataclass(frozen=True, eq=False)
class Solution:
    """What a fit found.

    Attributes
    ----------
    fit : Fit
    parameters : ndarray
        As `SOUGHT`.
    covariance : ndarray
        Of the parameters: zero of what is fixed, infinite of what no sample depends on.
    nuisances : ndarray
        Most likely values, in standard deviations of their priors.
    spread : ndarray
        Standard deviations of the nuisances, in the same.
    wrong : ndarray
        How the table's motion is wrong where the effects were found.
    shapes : sequence of ndarray
        These effects (`Fit.shape_effects`).
    """

    fit: Fit
    parameters: Floats
    covariance: Floats
    nuisances: Floats
    spread: Floats
    wrong: Floats
    shapes: Sequence[Floats]

    @property
    def errors(self) -> Floats:
        """Standard errors of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    def squares(self) -> float:
        """The sum of squares of the whitened residuals."""
        effects = self.fit.effects(self.shapes)
        return float(np.sum(Whitening.of(effects)(self.fit.residuals(self.parameters, self.wrong, effects)) ** 2))

    def cost(self) -> float:
        """The same, every sample that is left out counted as what is to be expected of it: but for a constant."""
        return self.squares() - sum(float(one.sum()) for one in self.fit.use.values())

    def profile(self) -> Profile:
        """How the sum of squares depends on Üy."""
        fit, wrong, effects = self.fit, self.wrong, self.fit.effects(self.shapes)
        whiten, size = Whitening.of(effects), fit.scale[0]
        width = float(np.clip(self.errors[0], 1e-5 * size, 0.05 * size))
        near = self.parameters[0] + width * _ABOUT
        onsets = np.unique(np.concatenate([near, size * _ONSETS]))
        onsets = onsets[onsets > fit.least[0]]
        squares, others, errors = np.empty(onsets.size), np.empty((onsets.size, 2)), np.empty((onsets.size, 2))
        middle = int(np.argmin(np.abs(onsets - self.parameters[0])))
        for side in (range(middle, onsets.size), range(middle, -1, -1)):
            tried = self.parameters.copy()
            for at in side:
                tried[0] = onsets[at]
                for _ in range(_PROFILE_STEPS):
                    slopes = whiten(fit.derivatives(tried, wrong)[:, 1:])
                    rest = whiten(fit.residuals(tried, wrong, effects))
                    step = np.linalg.lstsq(slopes, rest, rcond=1e-6)[0]
                    tried[1:] = np.clip(tried[1:] + step, fit.least[1:], 30.0 * fit.scale[1:])
                squares[at] = self._above(tried, effects)
                others[at] = tried[1:]
                errors[at] = np.sqrt(np.diag(covariance_of(slopes, fit.scale[1:], (0, 1))))
                if squares[at] - squares[middle] > _FAR:
                    # no further: it only grows, and a start this far off may not come back
                    rest_of = slice(at + 1, None) if side.step > 0 else slice(0, at)
                    squares[rest_of], others[rest_of], errors[rest_of] = np.inf, tried[1:], 0.0
                    break
        return Profile(onsets, squares - squares.min(), others, np.nan_to_num(errors, posinf=0.0))

    def _above(self, tried: Floats, effects: Floats) -> float:
        """How much larger the sum of squares is for other parameters, on the samples beside no jump of either.

        A sample on the other side of a jump would decide between them, and may be one that chance put there.
        """
        fit, clear = self.fit, np.ones(effects.shape[0], dtype=bool)
        if "block_acceleration" in fit.use:
            beside = fit.beside(fit.jumps(tried, self.wrong)).astype(np.float64)
            parts = {"block_acceleration": beside}
            clear = fit.stacked(lambda name: parts.get(name, np.zeros(beside.size))) == 0.0
        inside = effects[clear]
        root = cho_factor(np.eye(effects.shape[1]) + inside.T @ inside)
        found = []
        for parameters in (tried, self.parameters):
            rest = fit.residuals(parameters, self.wrong, effects)[clear]
            along = inside.T @ rest
            found.append(float(rest @ rest - along @ cho_solve(root, along)))
        return found[0] - found[1]

    @classmethod
    def of(cls, fit: Fit, parameters: Floats, wrong: Floats, shapes: Sequence[Floats]) -> "Solution":
        """The covariance where the least squares lie."""
        effects = fit.effects(shapes)
        whiten = Whitening.of(effects)
        slopes = fit.derivatives(parameters, wrong)
        covariance = covariance_of(whiten(slopes), fit.scale, fit.free)
        found = fit.residuals(parameters, wrong, effects)
        moved = whiten.nuisances(slopes)
        known = np.where(np.isfinite(covariance), covariance, 0.0)
        spread = np.sqrt(np.diag(whiten.spread()) + np.einsum("ij,jk,ik->i", moved, known, moved))
        return cls(fit, parameters, covariance, whiten.nuisances(found), spread, wrong, shapes)


def covariance_of(slopes: Floats, scale: Floats, free: Sequence[int]) -> Floats:
    """Covariance of parameters from whitened derivatives, a column each."""
    number = slopes.shape[1]
    covariance = np.zeros((number, number))
    sizes = np.sqrt(np.sum(slopes**2, axis=0))
    known = [at for at in free if sizes[at] * scale[at] > 1e-3]
    lost = [at for at in free if at not in known]
    part = slopes[:, known] / sizes[known]
    values, vectors = np.linalg.eigh(part.T @ part)
    inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T / np.outer(sizes[known], sizes[known])
    covariance[np.ix_(known, known)] = inverse
    covariance[lost, lost] = np.inf
    return covariance
