"""The models and the solvers that a user may choose, and the sources of their friction inputs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, ClassVar, Literal, TypeAlias

from slipsweep.errors import InputError
from slipsweep.model.choices import Choice, Family, option
from slipsweep.model.parameter_table import PARAMETER_TABLE
from slipsweep.model.parameters import GRAVITY
from slipsweep.model.variables import NEWMARK_REFERENCE, REFERENCE

Rule: TypeAlias = Literal["rectangle", "trapezoid", "simpson"]


class StepRule(IntEnum):
    """Code of `Step.rule` in the kernels.

    The rules are Euler's, Heun's and, where friction does not depend on the motion, Simpson's, else
    that of Runge and Kutta.  Their errors are of the orders 1, 2 and 4.
    """

    RECTANGLE = 0
    TRAPEZOID = 1
    SIMPSON = 2


class Rise(IntEnum):
    """Code of `Mendez.rise` in the kernels; Newmark's block has one of its own."""

    NEWMARK = 0
    MONOTONE = 1
    LITERAL = 2


class Recoupling(IntEnum):
    """Code of `Mendez.recoupling` in the kernels."""

    EQ12 = 0
    INTEGRATE = 1


@dataclass(frozen=True)
class Mendez(Choice):
    """The friction law of Mendez, Romo and Botero (2012), Eqs. 1-12 of the paper [1]_.

    Parameters
    ----------
    rise : {"monotone", "literal"}
        Stick-slip rise of the block's acceleration: not below the yield value and never falling, or
        Eq. 4 as printed.
    recoupling : {"eq12", "integrate"}
        After the base's acceleration has reversed: Eq. 12, or integration until the stop.
    g : float
        Gravity, m/s².

    Raises
    ------
    InputError
        A value that is not allowed.

    See Also
    --------
    Newmark : the classical block, whose friction does not decay

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on
       frictional interfaces under harmonic loading", Soil Dynamics and Earthquake Engineering 32,
       152-158, https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Mendez(recoupling="integrate")
    Mendez(rise='monotone', recoupling='integrate', g=9.81)
    """

    name: ClassVar[str] = "mendez"
    reference: ClassVar[str] = REFERENCE
    rise: Literal["monotone", "literal"] = option("rise of the block's acceleration", "monotone")
    recoupling: Literal["eq12", "integrate"] = option(
        "rule by which the block re-sticks after the base has reversed", "eq12"
    )
    g: float = option("gravity, m/s²", GRAVITY)


@dataclass(frozen=True)
class Newmark(Choice):
    """Newmark's rigid block [1]_, whose acceleration is Üy while it slides.

    Parameters
    ----------
    sliding : {"downslope", "both"}
        Directions in which it slides.  With "both" its acceleration is −Üy,up while it slides
        upslope (`upslope_yield_acceleration`); displacements may then be negative, and what counts
        them, statistics and charts, takes ``|u|``.
    strength : {"constant", "weakening", "rate"}
        Friction while it slides.  "constant": μs.  "weakening": μr + (μs − μr) max(0, 1 − s/D),
        which falls with the slip s = ∫|v|dt (`residual_mu` μr, `weakening_distance` D).  "rate":
        μf − (μf − μs) e^(−a|v|), which depends on the velocity [2]_ (`fast_mu` μf, `rate_constant`
        a).  The block's acceleration is that of Coulomb with this friction; steps in time solve it.
    g : float
        Gravity, m/s².

    Raises
    ------
    InputError
        A value that is not allowed.

    See Also
    --------
    Mendez : the paper's block, whose friction decays with the loading rate

    References
    ----------
    .. [1] N. M. Newmark (1965), "Effects of earthquakes on dams and embankments", Géotechnique 15,
       139-160, https://doi.org/10.1680/geot.1965.15.2.139
    .. [2] M. C. Constantinou, A. Mokha and A. M. Reinhorn (1990), "Teflon bearings in base
       isolation II: modeling", Journal of Structural Engineering 116, 455-474,
       https://doi.org/10.1061/(ASCE)0733-9445(1990)116:2(455)

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Newmark()
    Newmark(sliding='downslope', strength='constant', g=9.81)
    """

    name: ClassVar[str] = "newmark"
    reference: ClassVar[str] = NEWMARK_REFERENCE
    sliding: Literal["downslope", "both"] = option(
        "directions in which Newmark's block slides", "downslope"
    )
    strength: Literal["constant", "weakening", "rate"] = option(
        "friction of Newmark's block while it slides: constant, by slip or by velocity", "constant"
    )
    g: float = option("gravity, m/s²", GRAVITY)


@dataclass(frozen=True)
class Cycle(Choice):
    """The solver that goes from event to event, exact to rounding for every excitation.

    See Also
    --------
    Step : steps of fixed length

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Cycle()
    Cycle()
    """

    name: ClassVar[str] = "cycle"


@dataclass(frozen=True)
class Step(Choice):
    """The solver that takes steps in time, cut where a phase of the motion ends.

    Parameters
    ----------
    rule : {"rectangle", "trapezoid", "simpson"}
        Orders 1, 2 and 4.
    steps_per_cycle : int
        A multiple of 4, at least 8.  Under a record there is one step between two samples for each
        64 of them, rounded up.

    Raises
    ------
    InputError
        A value that is not allowed.

    See Also
    --------
    Cycle : from event to event

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Step(rule="simpson")
    Step(rule='simpson', steps_per_cycle=1024)
    """

    name: ClassVar[str] = "step"
    rule: Rule = option("rule of the steps; orders 1, 2 and 4", "trapezoid")
    # with the default the median error of the trapezoid is 1e-5 (docs/speed.md); no accuracy needs
    # the largest number
    steps_per_cycle: int = option("steps in a cycle", 1024, least=8, most=16_777_216)

    def check(self) -> None:
        """Refuse steps that do not end at the zeros and peaks of a sine."""
        if self.steps_per_cycle % 4:
            raise InputError(f"steps_per_cycle = {self.steps_per_cycle}: must be a multiple of 4")


Model = Mendez | Newmark


def slides_both_ways(model: Model) -> bool:
    """Return whether the model is Newmark's block that slides downslope and upslope."""
    return isinstance(model, Newmark) and model.sliding == "both"


def changing_strength(model: Model) -> str | None:
    """Return how the strength of the model's block changes while it slides; None if it does not."""
    if isinstance(model, Newmark) and model.strength != "constant":
        return model.strength
    return None


def check_constant_strength(what: str, model: Model) -> None:
    """Raise InputError if the strength of the block changes while it slides.

    `what` names the computation that does not allow it.
    """
    if (strength := changing_strength(model)) is not None:
        raise InputError(f"strength = {strength!r}: not allowed for {what}, only 'constant'")


Solver = Cycle | Step

MODELS: Family[Model] = Family("model", "friction", (Mendez, Newmark), "mendez", "model")
SOLVERS: Family[Solver] = Family(
    "solver", "method", (Cycle, Step), "auto", "solver", {"auto": "cycle"}
)

#: How the strength changes, in words.
STRENGTH_TEXT = {
    "weakening": "friction falls from μs to μr over the slip D",
    "rate": "friction goes from μs to μf with the velocity",
}

#: Steps where the strength changes while the block slides: the largest error of 1,000 random cells
#: was 2e-7 of u, the median 8e-11 (python -m benchmarks.strength).
STRENGTH_STEPS = Step("simpson", 512)


def solver_for(model: Model, solver: Any) -> Solver:
    """Return the solver that a caller gives, as an object or a name; "auto" is by the model.

    InputError: unknown, or one that cannot solve a block whose strength changes.
    """
    strength = changing_strength(model)
    if strength is not None and solver == "auto":
        return STRENGTH_STEPS
    chosen = SOLVERS.of(solver)
    if strength is not None and isinstance(chosen, Cycle):
        raise InputError(
            f"solver = 'cycle': not allowed with strength = {strength!r}, which changes while the "
            "block slides; only 'step' or 'auto'"
        )
    return chosen


#: Inputs that the displacement depends on, and the rule that estimates one that is not given.
_ESTIMATES = {
    "yield_acceleration": "by Coulomb",
    "decay_rate": "by Eq. 6",
    "delta_mu": "by Eqs. 10–11",
}
_SYMBOLS = {row.name: row.symbol for row in PARAMETER_TABLE}


def friction_inputs(model: str, inputs: Collection[str], drawn: Mapping[str, str]) -> str:
    """Sources of Üy, λ and Δμ of a result, such as 'Üy, λ given; Δμ by Eqs. 10–11: estimated'.

    `inputs` are the names of the parameters that are given.  `drawn` has the uncertain ones, each
    with its kind: a draw is the value ("absolute"), or is applied to it ("factor", "offset").
    Newmark's block has only Üy.
    """
    if "yield_coefficient" in drawn:
        return "Üy drawn"
    if "yield_coefficient" in inputs:
        return "Üy given"
    parts: dict[str, list[str]] = {" given": [], " drawn": [], ": estimated": []}
    for name, rule in _ESTIMATES.items():
        if model == "newmark" and name != "yield_acceleration":
            continue
        symbol = _SYMBOLS[name]
        if name in drawn and (name in inputs or drawn[name] == "absolute"):
            parts[" drawn"].append(symbol)
        elif name in inputs:
            parts[" given"].append(symbol)
        else:
            notes = ["μmin given"] if name == "decay_rate" and "minimum_friction" in inputs else []
            notes += ["drawn about it"] if name in drawn else []
            parts[": estimated"].append(
                f"{symbol} {rule}" + (f" ({', '.join(notes)})" if notes else "")
            )
    return "; ".join(", ".join(symbols) + source for source, symbols in parts.items() if symbols)
