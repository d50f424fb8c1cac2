"""The models and the solvers that a user may choose, with their options."""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

from slipsweep.model.choices import Choice, Family, option
from slipsweep.model.parameters import MOST_STEPS, STEPS_PER_CYCLE

Rule: TypeAlias = Literal["rectangle", "trapezoid", "simpson"]


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
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Mendez(recoupling="integrate")
    Mendez(rise='monotone', recoupling='integrate', g=9.81)
    """

    name: ClassVar[str] = "mendez"
    rise: Literal["monotone", "literal"] = option("rise of the block's acceleration", "monotone")
    recoupling: Literal["eq12", "integrate"] = option(
        "rule by which the block re-sticks after the base has reversed", "eq12"
    )
    g: float = option("gravity, m/s²", 9.81)


@dataclass(frozen=True)
class Newmark(Choice):
    """Newmark's rigid block [1]_: its acceleration is Üy while it slides, and the base's while it does not.

    Parameters
    ----------
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
    .. [1] N. M. Newmark (1965), "Effects of earthquakes on dams and embankments", Géotechnique 15, 139-160,
       https://doi.org/10.1680/geot.1965.15.2.139

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.Newmark()
    Newmark(g=9.81)
    """

    name: ClassVar[str] = "newmark"
    g: float = option("gravity, m/s²", 9.81)


@dataclass(frozen=True)
class Cycle(Choice):
    """The solver that goes from event to event: exact to rounding for every excitation.

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
    """The solver that takes fixed steps in phase, cut at the events inside them.

    Parameters
    ----------
    rule : {"rectangle", "trapezoid", "simpson"}
        Orders 1, 2 and 4.
    steps_per_cycle : int
        A multiple of 4, at least 8.

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
    steps_per_cycle: int = option("steps in a cycle", STEPS_PER_CYCLE, least=8, most=MOST_STEPS, multiple_of=4)


Model = Mendez | Newmark
Solver = Cycle | Step

MODELS: Family[Model] = Family("model", "friction", (Mendez, Newmark), "mendez", "model")
SOLVERS: Family[Solver] = Family("solver", "method", (Cycle, Step), "auto", "solver", {"auto": "cycle"})
