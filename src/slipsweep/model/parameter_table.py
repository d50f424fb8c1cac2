"""The parameters of a block and its shaking: one row each, with name, unit, bounds and words.

All that mention a parameter take it from its row in `PARAMETER_TABLE`:

- the signatures of `sweep`, `sample`, `simulate`, `limit_amplitude` and others: names and
  order (`tests/model/test_parameter_table.py`), and the text in their docstrings
  (`model/docstrings.py`);
- `model/parameters.py`: the bounds and the unit that a value is converted to;
- `model/variables.py`: the attributes of coordinates, and which inputs go together;
- `files/spec.py`: the keys of the tables [axes], [[cases]], [model] and [uncertainty];
- `cli/options.py`: the options of the command line, with their help;
- `charts/style.py`: the symbols in figures;
- `docs/sweep-files.md`: units and bounds (`tests/test_readme.py`).

The rows stand in the order in which a result has its dimensions.  Nothing here imports NumPy, so
that `slipsweep --help` need not load it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: The largest number that is accepted; the least number above zero is its inverse.  Physics needs
#: no larger one, and it is so far below the largest double that no result of several of them
#: overflows.
LARGEST = 1e30

#: Largest rate constant of friction, s/m.  Friction then has its fast value from micrometres a
#: second on, and steps are as short as that takes.
FASTEST_RATE = 1e5

#: Longest ramp, in cycles; each of them has pieces of its own.
MOST_RAMP = 100

_ABOVE_0 = math.ulp(0.0)
_BELOW_1 = math.nextafter(1.0, 0.0)
_BELOW_90 = math.nextafter(90.0, 0.0)


class Bound(NamedTuple):
    """A closed interval, the words of errors for it, and its short form in documents."""

    low: float
    high: float
    text: str
    brief: str

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return True where values lie in the interval (NaN and infinity never do)."""
        return (values >= self.low) & (values <= self.high)


def _between(low: float, high: float) -> Bound:
    """Return the bound of finite numbers of any sign."""
    return Bound(low, high, f"a finite number from {low:g} to {high:g}", "any")


def _not_negative(high: float) -> Bound:
    """Return the bound of finite numbers that are not negative."""
    brief = "≥ 0" if high == LARGEST else f"0 to {high:,.0f}".replace(",", " ")
    return Bound(0.0, high, f"a finite number >= 0 and at most {high:g}", brief)


def _positive(low: float, high: float) -> Bound:
    """Return the bound of finite numbers above zero."""
    return Bound(low, high, f"a finite number > 0, from {low:g} to {high:g}", "> 0")


def _angle(name: str, symbol: str, low: float) -> Bound:
    """Return the bound of an angle below 90 degrees."""
    if low > 0.0:
        return Bound(low, _BELOW_90, f"0 < {name} < 90 degrees", f"0 < {symbol} < 90")
    return Bound(low, _BELOW_90, f"0 <= {name} < 90 degrees", f"0 ≤ {symbol} < 90")


FINITE = _between(-LARGEST, LARGEST)
NOT_NEGATIVE = _not_negative(LARGEST)
POSITIVE = _positive(1.0 / LARGEST, LARGEST)

#: Units as docstrings write them; CF, and the table, have those on the left.
_UNIT_TEXT = {
    "1": "",
    "degree": "degrees",
    "m": "m",
    "m s-1": "m/s",
    "m s-2": "m/s²",
    "s m-1": "s/m",
    "Hz": "Hz",
}


@dataclass(frozen=True)
class Parameter:
    """A row of the table: an input that `slipsweep.sweep` and the other functions take.

    Attributes
    ----------
    name, symbol
        Name in code, sweep files and results; symbol in documents and figures.
    units
        Its own unit, as CF writes it.
    long_name
        Its CF attribute, for coordinates and figures.
    bound
        Values that are allowed.
    about, more
        The sentence of docstrings that says what it is, to which unit and bounds are added, and
        what else there is to say.
    option
        Help of its option on the command line; None: it has none.
    panel
        Group of the option: of the block, the shaking, or those that few cases need.
    shaking
        Kinds of shaking that it belongs to; empty for a parameter of the block.
    in_model
        True if a sweep file may give it in [model], as one number for the whole sweep.
    drawn
        True if it may be uncertain: the displacement depends on it.
    single_type, type
        Type in docstrings, of one value and of values that may span a grid.
    """

    name: str
    symbol: str
    units: str
    long_name: str
    bound: Bound
    about: str
    more: str = ""
    option: str | None = None
    panel: Literal["Block", "Shaking", "Rare options"] = "Block"
    shaking: tuple[Literal["waveform", "record"], ...] = ()
    in_model: bool = False
    drawn: bool = True
    single_type: str = "float"
    type: str = "float, array or DataArray"

    @property
    def attributes(self) -> dict[str, str]:
        """CF attributes of its coordinate."""
        return {"units": self.units, "long_name": self.long_name}

    @property
    def text(self) -> str:
        """Its description in a docstring."""
        brief = "" if self.bound.brief == "any" else self.bound.brief
        parts = (self.about, _UNIT_TEXT[self.units], brief)
        sentence = ", ".join(part for part in parts if part)
        return f"{sentence}.  {self.more}".rstrip()


PARAMETER_TABLE = (
    Parameter(
        name="theta",
        symbol="θ",
        units="degree",
        long_name="base inclination",
        bound=_angle("theta", "θ", 0.0),
        about="Inclination of the base",
        option="Inclination of the base: 5 (degrees), 0.1rad.",
    ),
    Parameter(
        name="mu_s",
        symbol="μs",
        units="1",
        long_name="static friction coefficient",
        bound=POSITIVE,
        about="Static friction coefficient",
        option="Static friction coefficient.",
    ),
    Parameter(
        name="phi",
        symbol="φ",
        units="degree",
        long_name="friction angle of the interface",
        bound=_angle("phi", "φ", _ABOVE_0),
        about="Friction angle",
        more="Instead of `mu_s` = tan φ.",
        option="Friction angle instead of --mu-s: 21 (degrees).",
    ),
    Parameter(
        name="amplitude",
        symbol="A",
        units="m s-2",
        long_name="peak ground acceleration",
        bound=NOT_NEGATIVE,
        about="Peak ground acceleration A",
        more="A record, or every motion of a suite, is scaled to it.",
        option="Peak ground acceleration: 0.36g, 3.5 (m/s²).",
        panel="Shaking",
        shaking=("waveform", "record"),
    ),
    Parameter(
        name="displacement_amplitude",
        symbol="d",
        units="m",
        long_name="peak ground displacement",
        bound=NOT_NEGATIVE,
        about="Peak ground displacement d",
        more="Instead of `amplitude`: A = (2πf)² d.  Not with a record.",
        option="Peak ground displacement instead: 30mm, 0.03 (m); not with a record.",
        panel="Shaking",
        shaking=("waveform",),
    ),
    Parameter(
        name="frequency",
        symbol="f",
        units="Hz",
        long_name="excitation frequency",
        bound=POSITIVE,
        about="Excitation frequency",
        more="Not with a record, whose time `time_scale` stretches.",
        option="Excitation frequency, Hz; not with a record.",
        panel="Shaking",
        shaking=("waveform",),
    ),
    Parameter(
        name="yield_acceleration",
        symbol="Üy",
        units="m s-2",
        long_name="yield acceleration",
        bound=FINITE,
        about="Yield acceleration Üy",
        more="By default Coulomb's, g tan(φs − θ).",
        option="Yield acceleration: 0.1g, 0.98 (m/s²) (default: Coulomb's).",
        in_model=True,
    ),
    Parameter(
        name="yield_coefficient",
        symbol="ky",
        units="1",
        long_name="yield coefficient, yield acceleration over g",
        bound=FINITE,
        about="Yield coefficient ky = Üy/g of Newmark's block",
        more="Instead of `theta`, `mu_s` and `yield_acceleration`.",
        option="Üy/g of Newmark's block, instead of --theta and --mu-s.",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="upslope_yield_acceleration",
        symbol="Üy,up",
        units="m s-2",
        long_name="yield acceleration upslope",
        bound=POSITIVE,
        about="Yield acceleration upslope Üy,up of a block that slides both ways",
        more=(
            "By default, by statics, g tan(arctan(Üy/g) + 2θ), with no sliding upslope where that "
            "angle reaches 90°.  Beside `yield_coefficient` it or `theta` must be given."
        ),
        option="Yield acceleration upslope, with --sliding both (default: by statics).",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="decay_rate",
        symbol="λ",
        units="1",
        long_name="friction decay with loading rate",
        bound=NOT_NEGATIVE,
        about="Friction decay λ with the loading rate",
        more="By default estimated by Eq. 6; under a record every pulse has it from its own peak.",
        option="Friction decay λ (default: Eq. 6 at the peak).",
        in_model=True,
    ),
    Parameter(
        name="delta_mu",
        symbol="Δμ",
        units="1",
        long_name="friction above static",
        bound=NOT_NEGATIVE,
        about="Friction above static Δμ",
        more="By default estimated by Eqs. 10 and 11; under a record from the peak of each pulse.",
        option="Friction above static Δμ (default: Eqs. 10, 11).",
        in_model=True,
    ),
    Parameter(
        name="minimum_friction",
        symbol="μmin",
        units="1",
        long_name="minimum friction coefficient",
        bound=POSITIVE,
        about="Minimum friction coefficient μmin",
        more="By default estimated by Eq. 9; under a record from the peak of each pulse.",
        option="Minimum friction μmin (default: Eq. 9).",
        in_model=True,
    ),
    Parameter(
        name="residual_mu",
        symbol="μr",
        units="1",
        long_name="residual friction coefficient",
        bound=POSITIVE,
        about='Residual friction coefficient μr of ``Newmark(strength="weakening")``',
        option="Residual friction coefficient, with --strength weakening.",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="residual_phi",
        symbol="φr",
        units="degree",
        long_name="residual friction angle of the interface",
        bound=_angle("residual_phi", "φ", _ABOVE_0),
        about="Residual friction angle",
        more="Instead of `residual_mu` = tan φ.",
        option="Residual friction angle instead: 9 (degrees).",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="weakening_distance",
        symbol="D",
        units="m",
        long_name="slip over which friction falls to its residual value",
        bound=POSITIVE,
        about="Slip D over which friction falls from `mu_s` to `residual_mu`",
        option="Slip from peak to residual friction: 50mm, 0.05 (m).",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="fast_mu",
        symbol="μf",
        units="1",
        long_name="friction coefficient at high velocity",
        bound=POSITIVE,
        about='Friction coefficient μf at high velocity, of ``Newmark(strength="rate")``',
        option="Friction coefficient at high velocity, with --strength rate.",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="rate_constant",
        symbol="a",
        units="s m-1",
        long_name="rate by which friction depends on velocity",
        bound=_not_negative(FASTEST_RATE),
        about="Rate constant a: how fast friction goes from `mu_s` to `fast_mu` with the velocity",
        option="How fast it is approached with the velocity, s/m.",
        panel="Rare options",
        in_model=True,
    ),
    Parameter(
        name="structure_frequency",
        symbol="fs",
        units="Hz",
        long_name="natural frequency of the structure",
        bound=POSITIVE,
        about="Natural frequency of the sliding structure",
        more="For the flag `flexible_block`.  Not with a record.",
        option="Natural frequency of the structure, Hz: flag flexible_block.",
        panel="Rare options",
        shaking=("waveform",),
        in_model=True,
        drawn=False,
    ),
    Parameter(
        name="scale",
        symbol="scale",
        units="1",
        long_name="scale factor of the recorded acceleration",
        bound=POSITIVE,
        about="With a record: factor on its acceleration",
        more="Instead of `amplitude`; 1 if no strength of the motion is given.",
        option="Factor on a record's acceleration (default: 1).",
        panel="Shaking",
        shaking=("record",),
    ),
    Parameter(
        name="pgv",
        symbol="PGV",
        units="m s-1",
        long_name="peak ground velocity that motions are scaled to",
        bound=NOT_NEGATIVE,
        about="With a record: peak ground velocity that it is scaled to",
        more="Instead of `amplitude`.  It is that of the record after `time_scale`.",
        option="Peak ground velocity to scale a record to: 40cm/s.",
        panel="Rare options",
        shaking=("record",),
    ),
    Parameter(
        name="arias_intensity",
        symbol="Ia",
        units="m s-1",
        long_name="Arias intensity that motions are scaled to",
        bound=NOT_NEGATIVE,
        about="With a record: Arias intensity that it is scaled to",
        more="Instead of `amplitude`.  It is that of the record after `time_scale`.",
        option="Arias intensity to scale a record to, m/s.",
        panel="Rare options",
        shaking=("record",),
    ),
    Parameter(
        name="time_scale",
        symbol="time scale",
        units="1",
        long_name="factor on the time of the record",
        bound=POSITIVE,
        about="With a record: factor on its time",
        more="2 makes it last twice as long; by default 1.",
        option="Factor on a record's time (default: 1).",
        panel="Rare options",
        shaking=("record",),
    ),
    Parameter(
        name="polarity",
        symbol="polarity",
        units="1",
        long_name="sign that the recorded acceleration is taken with",
        bound=Bound(-1.0, 1.0, "1 or -1", "any"),
        about="With a record: sign that its acceleration is taken with",
        more=(
            "With 1 (by default) positive acceleration of the record drives the block downslope, "
            "with -1 negative acceleration."
        ),
        option="Sign of a record, 1 or -1; 1: positive drives downslope (default: 1).",
        panel="Shaking",
        shaking=("record",),
        drawn=False,
        single_type="{1, -1}",
        type='{1, -1}, list of these, or "both"',
    ),
    Parameter(
        name="azimuth",
        symbol="azimuth",
        units="degree",
        long_name="downslope direction, from the first component to the second",
        bound=Bound(0.0, 360.0, "0 <= azimuth <= 360 degrees", "0 to 360"),
        about="With a suite of pairs of components, which need it: direction of sliding",
        more="It is counted from the first component towards the second.",
        shaking=("record",),
        drawn=False,
    ),
)


class Quantity(NamedTuple):
    """A number that is given beside the parameters: its unit, if it has one, and its bounds."""

    units: str | None
    bound: Bound


_RAMP = Quantity(None, Bound(0.0, MOST_RAMP, f"0 to {MOST_RAMP}", f"0 to {MOST_RAMP}"))
_SHARE = Bound(_ABOVE_0, _BELOW_1, "a number between 0 and 1", "between 0 and 1")

#: Other numbers with bounds: targets, options of choices, settings.
QUANTITIES = {
    "displacement": Quantity("m", POSITIVE),
    "threshold": Quantity("m", NOT_NEGATIVE),
    "maximum_amplitude": Quantity("m s-2", POSITIVE),
    "g": Quantity("m s-2", POSITIVE),
    "interval": Quantity("s", POSITIVE),
    "quantile": Quantity(None, _SHARE),
    "ramp_in": _RAMP,
    "ramp_out": _RAMP,
}
