"""Published equations for the permanent displacement of a rigid block.

One function for each equation. All take the yield coefficient ky and the peak ground acceleration
in g, and return an `Estimate`: the median in m, the standard deviation of ln u, the probability of
no displacement, and True if the inputs lie in the range that the equation was made for.  Arrays are
combined as NumPy combines them.  A block with ky of at least the peak ground acceleration does not
slide, whatever the fit gives.

`EQUATIONS` has the record of each by its name: source, inputs, range, standard deviation, and the
conditions that it is for.  `slipsweep.published_statistics` evaluates them at the grid points of a
result.

Examples
--------
>>> from slipsweep import published
>>> estimate = published.jibson_2007(yield_coefficient=0.1, pga=0.4)
>>> print(f"{100 * estimate.median:.5f} cm, 84 %: {100 * estimate.quantile(0.84):.1f} cm")
6.14159 cm, 84 %: 19.7 cm
>>> print(published.EQUATIONS["jibson-2007"].source)  # doctest: +ELLIPSIS
R. W. Jibson (2007), "Regression models for estimating coseismic landslide displacement", ...
"""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model.parameters import GRAVITY, check_list, check_numbers, number_text, shown

__all__ = [
    "EQUATIONS",
    "Equation",
    "Estimate",
    "ambraseys_menu_1988",
    "bray_travasarou_2007",
    "jibson_2007",
    "jibson_2007_magnitude",
    "newmark_1965",
    "rathje_saygili_2009",
    "sarma_1975",
    "saygili_rathje_2008",
    "saygili_rathje_2008_pgv",
    "yegian_1991",
]

Floats = NDArray[np.float64]

#: A number or an array of numbers.
Values = float | Sequence[float] | Floats

#: Natural logarithm of 10, and of the centimetres in a metre.
_LN_10 = math.log(10.0)
_LN_CM = math.log(100.0)

#: Words for the inputs, with their units.
INPUTS = {
    "yield_coefficient": "yield coefficient ky",
    "pga": "peak ground acceleration, g",
    "magnitude": "moment magnitude M",
    "pgv": "peak ground velocity, m/s",
    "period": "period T, s",
    "cycles": "number N of equal cycles",
    "pulse_duration": "duration of the pulse, s",
}

#: Largest input of each kind; a number above it has another unit, or is a slip.
_MOST = {"magnitude": 10.0, "pga": 100.0, "yield_coefficient": 100.0}


class Estimate(NamedTuple):
    """Distribution of the permanent displacement by a published equation.

    Displacements that are not zero are lognormal.

    Attributes
    ----------
    median : float or ndarray
        Median of the displacements that are not zero, m; 0 where the block does not slide.
    log_standard_deviation : float or ndarray
        Standard deviation of ln u; 0 for a closed form.
    zero_probability : float or ndarray
        Probability of no displacement.
    in_range : bool or ndarray
        True where all inputs lie in the range of the equation.

    See Also
    --------
    slipsweep.published_statistics : the same at the grid points of a result

    Examples
    --------
    >>> from slipsweep import published
    >>> estimate = published.bray_travasarou_2007(0.1, [0.2, 0.4], 7.0)
    >>> estimate.zero_probability.round(3), estimate.in_range
    (array([0.504, 0.008]), array([ True,  True]))
    """

    median: Any
    log_standard_deviation: Any
    zero_probability: Any
    in_range: Any

    def quantile(self, share: Values) -> Any:
        """Return the displacement that a `share` of all cases does not exceed, m.

        Zero displacements count.
        """
        from scipy.special import ndtri

        with np.errstate(divide="ignore", invalid="ignore"):
            above = (np.asarray(share) - self.zero_probability) / (1.0 - self.zero_probability)
            factor = np.exp(self.log_standard_deviation * ndtri(np.clip(above, 0.0, 1.0)))
            # a closed form has no scatter: 0 · ∞ at the ends
            factor = np.where(np.equal(self.log_standard_deviation, 0.0), 1.0, factor)
            value = np.where(above > 0.0, self.median * factor, 0.0)
        return np.where(np.isnan(self.median), np.nan, value)[()]

    def exceedance_probability(self, displacement: Values) -> Any:
        """Return the probability that the displacement is larger than `displacement`, m."""
        from scipy.special import ndtr

        limit = np.asarray(displacement, np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (np.log(self.median) - np.log(limit)) / self.log_standard_deviation
            scattered = ndtr(distance)
        certain = np.where(self.median > limit, 1.0, 0.0)
        slides = np.not_equal(self.log_standard_deviation, 0.0) & (self.median > 0.0)
        share = (1.0 - self.zero_probability) * np.where(slides, scattered, certain)
        return np.where(np.isnan(self.median), np.nan, share)[()]


@dataclass(frozen=True)
class Equation:
    """Record of a published equation.

    Attributes
    ----------
    name : str
        Name that ``--equations`` takes.
    label : str
        Authors and year, for legends.
    function : callable
        The function of this module.
    source : str
        Full citation.
    deviation : str
        Standard deviation as published, with the logarithm that it belongs to.
    conditions : str
        The shaking that the equation is for.
    bounds : dict
        Ranges of inputs, and of ``ratio``, ky over the peak ground acceleration.

    See Also
    --------
    slipsweep.published_statistics : equations by name, at the grid points of a result

    Examples
    --------
    >>> from slipsweep import published
    >>> record = published.EQUATIONS["rathje-saygili-2009"]
    >>> record.inputs, record.deviation
    (('yield_coefficient', 'pga', 'magnitude'), '0.732 + 0.789 r − 0.539 r² (ln)')
    """

    name: str
    label: str
    function: Callable[..., Estimate]
    source: str
    deviation: str
    conditions: str
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple(name for name in inspect.signature(self.function).parameters if name != "g")

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the inputs that have no default."""
        parameters = inspect.signature(self.function).parameters.values()
        return tuple(each.name for each in parameters if each.default is each.empty)

    @property
    def range_text(self) -> str:
        """Range in words: ``ky/PGA 0.1 to 0.9``."""
        names = {"ratio": "ky/PGA", "yield_coefficient": "ky", "magnitude": "M"}
        parts = (f"{names[name]} {low:g} to {high:g}" for name, (low, high) in self.bounds.items())
        return ", ".join(parts)


def check_equations(names: Any) -> tuple[str, ...]:
    """Return the names of equations, each once (InputError: there is no such equation)."""
    listed = names.split(",") if isinstance(names, str) else check_list("equations", names, "names")
    once = dict.fromkeys(str(name).strip() for name in listed)
    for name in once:
        if name not in EQUATIONS:
            hint = did_you_mean(name, [*EQUATIONS])
            raise InputError(f"equations = {shown(name)}: no such published equation; {hint}")
    return tuple(once)


def _checked(**arguments: Any) -> dict[str, Floats]:
    """Return inputs as arrays (InputError: not above zero, or too large); NaN is allowed."""
    inputs = {}
    for name, values in arguments.items():
        array = check_numbers(name, values)
        most = _MOST.get(name, math.inf)
        allowed = np.isnan(array) | ((array > 0.0) & (array <= most) & np.isfinite(array))
        for wrong in array[~allowed][:1]:
            limit = "" if math.isinf(most) else f" and at most {most:g}"
            text = number_text(float(wrong))
            raise InputError(f"{name} = {text}: must be {INPUTS[name]}, > 0{limit}")
        inputs[name] = array
    return inputs


def _ratio(inputs: Mapping[str, Floats]) -> Floats:
    """Return ky over the peak ground acceleration; NaN where the block does not slide."""
    ratio = inputs["yield_coefficient"] / inputs["pga"]
    return np.where(ratio < 1.0, ratio, np.nan)


def _estimate(
    name: str,
    inputs: Mapping[str, Floats],
    log_median: Any,
    log_standard_deviation: Any,
    zero_probability: Any = 0.0,
) -> Estimate:
    """Assemble an estimate from ln u (u in m) and its scatter; compare inputs with the range."""
    ratio = inputs["yield_coefficient"] / inputs["pga"]
    rests = ratio >= 1.0
    in_range = np.isfinite(ratio)
    for bounded, (low, high) in EQUATIONS[name].bounds.items():
        values = ratio if bounded == "ratio" else inputs[bounded]
        # a ky of 0.4 that was computed may be 0.4 + 1e-16
        in_range = in_range & (values >= low * (1.0 - 1e-9)) & (values <= high * (1.0 + 1e-9))
    median = np.where(rests, 0.0, np.exp(log_median))
    shape = np.broadcast_shapes(median.shape, in_range.shape)
    deviation = np.where(rests, 0.0, log_standard_deviation)
    zero = np.where(rests, 1.0, zero_probability)
    parts = (median, deviation, zero, in_range)
    return Estimate(*(np.broadcast_to(part, shape)[()] for part in parts))


def ambraseys_menu_1988(yield_coefficient: Values, pga: Values) -> Estimate:
    """Permanent displacement by Ambraseys and Menu [1]_.

    log10 u = 0.90 + 2.53 log10(1 − r) − 1.09 log10 r, u in cm, r = ky/PGA; standard deviation 0.30
    of log10 u.  From 50 records close to the source of 11 earthquakes, Ms 6.6 to 7.3, for
    0.1 ≤ r ≤ 0.9.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    jibson_2007 : the same form, from more records

    References
    ----------
    .. [1] N. N. Ambraseys and J. M. Menu (1988), "Earthquake-induced ground displacements",
       Earthquake Engineering and Structural Dynamics 16, 985-1006,
       https://doi.org/10.1002/eqe.4290160704

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.ambraseys_menu_1988(0.1, 0.4).median:.4f} cm")
    17.3840 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga)
    ratio = _ratio(inputs)
    log10_cm = 0.90 + 2.53 * np.log10(1.0 - ratio) - 1.09 * np.log10(ratio)
    return _estimate("ambraseys-menu-1988", inputs, _LN_10 * log10_cm - _LN_CM, _LN_10 * 0.30)


def jibson_2007(yield_coefficient: Values, pga: Values) -> Estimate:
    """Permanent displacement by Jibson [1]_, Eq. 6.

    log10 u = 0.215 + 2.341 log10(1 − r) − 1.438 log10 r, u in cm, r = ky/PGA; standard deviation
    0.510 of log10 u.  From 2270 records of 30 earthquakes, M 5.3 to 7.6, for ky of 0.05 to 0.4.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    jibson_2007_magnitude : with the magnitude

    References
    ----------
    .. [1] R. W. Jibson (2007), "Regression models for estimating coseismic landslide displacement",
       Engineering Geology 91, 209-218, https://doi.org/10.1016/j.enggeo.2007.01.013

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.jibson_2007(0.1, 0.4).median:.5f} cm")
    6.14159 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga)
    ratio = _ratio(inputs)
    log10_cm = 0.215 + 2.341 * np.log10(1.0 - ratio) - 1.438 * np.log10(ratio)
    return _estimate("jibson-2007", inputs, _LN_10 * log10_cm - _LN_CM, _LN_10 * 0.510)


def jibson_2007_magnitude(yield_coefficient: Values, pga: Values, magnitude: Values) -> Estimate:
    """Permanent displacement by Jibson [1]_, Eq. 7.

    log10 u = −2.710 + 2.335 log10(1 − r) − 1.478 log10 r + 0.424 M, u in cm, r = ky/PGA; standard
    deviation 0.454 of log10 u.  From the same records as `jibson_2007`.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.
    magnitude : float or array
        Moment magnitude M.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero, or a magnitude above 10.

    See Also
    --------
    jibson_2007 : without the magnitude

    References
    ----------
    .. [1] R. W. Jibson (2007), "Regression models for estimating coseismic landslide displacement",
       Engineering Geology 91, 209-218, https://doi.org/10.1016/j.enggeo.2007.01.013

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.jibson_2007_magnitude(0.1, 0.4, 7.0).median:.5f} cm")
    7.17981 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, magnitude=magnitude)
    ratio = _ratio(inputs)
    log10_cm = -2.710 + 2.335 * np.log10(1.0 - ratio) - 1.478 * np.log10(ratio)
    log10_cm = log10_cm + 0.424 * inputs["magnitude"]
    return _estimate("jibson-2007-magnitude", inputs, _LN_10 * log10_cm - _LN_CM, _LN_10 * 0.454)


def saygili_rathje_2008(yield_coefficient: Values, pga: Values) -> Estimate:
    """Permanent displacement by Saygili and Rathje [1]_, from PGA.

    ln u = 5.52 − 4.43 r − 20.39 r² + 42.61 r³ − 28.74 r⁴ + 0.72 ln PGA, u in cm, PGA in g,
    r = ky/PGA; standard deviation 1.13 of ln u.  From 2383 records, for ky of 0.05 to 0.3.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    saygili_rathje_2008_pgv : with the peak ground velocity, and less scatter

    References
    ----------
    .. [1] G. Saygili and E. M. Rathje (2008), "Empirical predictive models for earthquake-induced
       sliding displacements of slopes", Journal of Geotechnical and Geoenvironmental Engineering
       134, 790-803, https://doi.org/10.1061/(ASCE)1090-0241(2008)134:6(790)

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.saygili_rathje_2008(0.1, 0.4).median:.2f} cm")
    20.74 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga)
    ratio = _ratio(inputs)
    shape = -4.43 * ratio - 20.39 * ratio**2 + 42.61 * ratio**3 - 28.74 * ratio**4
    log_cm = 5.52 + shape + 0.72 * np.log(inputs["pga"])
    return _estimate("saygili-rathje-2008", inputs, log_cm - _LN_CM, 1.13)


def saygili_rathje_2008_pgv(yield_coefficient: Values, pga: Values, pgv: Values) -> Estimate:
    """Permanent displacement by Saygili and Rathje [1]_, from PGA and PGV.

    ln u = −1.56 − 4.58 r − 20.84 r² + 44.75 r³ − 30.50 r⁴ − 0.64 ln PGA + 1.55 ln PGV, u in cm, PGA
    in g, PGV in cm/s, r = ky/PGA; standard deviation 0.405 + 0.524 r of ln u.  From 2383 records,
    for ky of 0.05 to 0.3.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.
    pgv : float or array
        Peak ground velocity, m/s, > 0.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    saygili_rathje_2008 : without the velocity

    References
    ----------
    .. [1] G. Saygili and E. M. Rathje (2008), "Empirical predictive models for earthquake-induced
       sliding displacements of slopes", Journal of Geotechnical and Geoenvironmental Engineering
       134, 790-803, https://doi.org/10.1061/(ASCE)1090-0241(2008)134:6(790)

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.saygili_rathje_2008_pgv(0.1, 0.4, 0.40).median:.4f} cm")
    17.7568 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, pgv=pgv)
    ratio = _ratio(inputs)
    shape = -4.58 * ratio - 20.84 * ratio**2 + 44.75 * ratio**3 - 30.50 * ratio**4
    log_cm = -1.56 + shape - 0.64 * np.log(inputs["pga"]) + 1.55 * np.log(100.0 * inputs["pgv"])
    deviation = 0.405 + 0.524 * ratio
    return _estimate("saygili-rathje-2008-pgv", inputs, log_cm - _LN_CM, deviation)


def rathje_saygili_2009(yield_coefficient: Values, pga: Values, magnitude: Values) -> Estimate:
    """Permanent displacement by Rathje and Saygili [1]_, from PGA and magnitude.

    ln u = 4.89 − 4.85 r − 19.64 r² + 42.49 r³ − 29.06 r⁴ + 0.72 ln PGA + 0.89 (M − 6), u in cm, PGA
    in g, r = ky/PGA; standard deviation 0.732 + 0.789 r − 0.539 r² of ln u.  From more than 2000
    records, for ky of 0.05 to 0.3.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.
    magnitude : float or array
        Moment magnitude M.

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u, and True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero, or a magnitude above 10.

    See Also
    --------
    saygili_rathje_2008 : without the magnitude

    References
    ----------
    .. [1] E. M. Rathje and G. Saygili (2009), "Probabilistic assessment of earthquake-induced
       sliding displacements of natural slopes", Bulletin of the New Zealand Society for Earthquake
       Engineering 42, 18-27, https://doi.org/10.5459/bnzsee.42.1.18-27

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{100 * published.rathje_saygili_2009(0.1, 0.54, 6.75).median:.1f} cm")
    43.7 cm
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, magnitude=magnitude)
    ratio = _ratio(inputs)
    shape = -4.85 * ratio - 19.64 * ratio**2 + 42.49 * ratio**3 - 29.06 * ratio**4
    log_cm = 4.89 + shape + 0.72 * np.log(inputs["pga"]) + 0.89 * (inputs["magnitude"] - 6.0)
    deviation = 0.732 + 0.789 * ratio - 0.539 * ratio**2
    return _estimate("rathje-saygili-2009", inputs, log_cm - _LN_CM, deviation)


def bray_travasarou_2007(yield_coefficient: Values, pga: Values, magnitude: Values) -> Estimate:
    """Permanent displacement by Bray and Travasarou [1]_ of a rigid mass (Ts < 0.05 s).

    ln u = −0.22 − 2.83 ln ky − 0.333 (ln ky)² + 0.566 ln ky ln PGA + 3.04 ln PGA − 0.244 (ln PGA)²
    + 0.278 (M − 7), u in cm, PGA in g; standard deviation 0.66 of ln u.  This is of displacements
    that are not zero.  The probability of zero (less than 1 cm) is
    1 − Φ(−1.76 − 3.22 ln ky + 3.52 ln PGA).  From 688 records, for ky of 0.02 to 0.4.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.
    magnitude : float or array
        Moment magnitude M.

    Returns
    -------
    Estimate
        Median (m) and standard deviation of ln u where it is not zero, the probability of zero, and
        True if the inputs are in the range.

    Raises
    ------
    InputError
        An input is not above zero, or a magnitude above 10.

    See Also
    --------
    slipsweep.suite_statistics : counts displacements up to ``zero="1cm"`` as zero, too

    References
    ----------
    .. [1] J. D. Bray and T. Travasarou (2007), "Simplified procedure for estimating
       earthquake-induced deviatoric slope displacements", Journal of Geotechnical and
       Geoenvironmental Engineering 133, 381-392,
       https://doi.org/10.1061/(ASCE)1090-0241(2007)133:4(381)

    Examples
    --------
    >>> from slipsweep import published
    >>> estimate = published.bray_travasarou_2007(0.08, 0.24, 7.0)
    >>> print(f"{100 * estimate.median:.1f} cm, zero: {estimate.zero_probability:.0%}")
    7.5 cm, zero: 9%
    """
    from scipy.special import ndtr

    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, magnitude=magnitude)
    strength = np.log(inputs["yield_coefficient"])
    shaking = np.log(inputs["pga"])
    log_cm = -0.22 - 2.83 * strength - 0.333 * strength**2 + 0.566 * strength * shaking
    log_cm = log_cm + 3.04 * shaking - 0.244 * shaking**2 + 0.278 * (inputs["magnitude"] - 7.0)
    zero = 1.0 - ndtr(-1.76 - 3.22 * strength + 3.52 * shaking)
    return _estimate("bray-travasarou-2007", inputs, log_cm - _LN_CM, 0.66, zero)


def yegian_1991(
    yield_coefficient: Values, pga: Values, period: Values, cycles: Values, g: float = GRAVITY
) -> Estimate:
    """Permanent displacement by Yegian, Marciano and Ghahraman [1]_, for N cycles of period T.

    log10 (u / (A N T²)) = 0.22 − 10.12 r + 16.38 r² − 11.48 r³, r = ky/PGA, A = PGA g; standard
    deviation 0.45 of log10.  From the displacements under earthquake records of Franklin and Chang
    (1977), of which N is the equivalent number of cycles and T the predominant period.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Peak ground acceleration, g, > 0.
    period : float or array
        T, s.
    cycles : float or array
        N.
    g : float
        Gravity, m/s².

    Returns
    -------
    Estimate
        Median (m), standard deviation of ln u; the source gives no range.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    sarma_1975 : a rectangular pulse

    Notes
    -----
    One copy of a textbook prints the constant as −0.22.

    References
    ----------
    .. [1] M. K. Yegian, E. A. Marciano and V. G. Ghahraman (1991), "Earthquake-induced permanent
       deformations: probabilistic approach", Journal of Geotechnical Engineering 117, 35-50,
       https://doi.org/10.1061/(ASCE)0733-9410(1991)117:1(35)

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{published.yegian_1991(0.1, 0.4, period=0.5, cycles=10).median:.3f} m")
    0.336 m
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, period=period, cycles=cycles)
    ratio = _ratio(inputs)
    log10 = 0.22 - 10.12 * ratio + 16.38 * ratio**2 - 11.48 * ratio**3
    unit = inputs["pga"] * g * inputs["cycles"] * inputs["period"] ** 2
    return _estimate("yegian-1991", inputs, _LN_10 * log10 + np.log(unit), _LN_10 * 0.45)


def newmark_1965(
    yield_coefficient: Values,
    pga: Values,
    pgv: Values,
    cycles: Values = 1.0,
    g: float = GRAVITY,
) -> Estimate:
    """Permanent displacement by Newmark [1]_: one rectangular pulse of acceleration.

    u = V²/(2 g ky) (1 − r) for each pulse, r = ky/PGA: the block follows its base with g ky until
    both are as fast again.  V is the velocity that the pulse gives the base.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Acceleration of the pulse, g, > 0.
    pgv : float or array
        V, m/s, > 0.
    cycles : float or array
        Number of pulses.
    g : float
        Gravity, m/s².

    Returns
    -------
    Estimate
        The displacement (m); a closed form, without scatter.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    sarma_1975 : the same pulse by its duration

    References
    ----------
    .. [1] N. M. Newmark (1965), "Effects of earthquakes on dams and embankments", Géotechnique 15,
       139-160, https://doi.org/10.1680/geot.1965.15.2.139

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{published.newmark_1965(0.1, 0.4, pgv=0.40).median:.4f} m")
    0.0612 m
    """
    inputs = _checked(yield_coefficient=yield_coefficient, pga=pga, pgv=pgv, cycles=cycles)
    ratio = _ratio(inputs)
    each = inputs["pgv"] ** 2 / (2.0 * g * inputs["yield_coefficient"]) * (1.0 - ratio)
    return _estimate("newmark-1965", inputs, np.log(inputs["cycles"] * each), 0.0)


def sarma_1975(
    yield_coefficient: Values,
    pga: Values,
    pulse_duration: Values,
    cycles: Values = 1.0,
    g: float = GRAVITY,
) -> Estimate:
    """Permanent displacement by Sarma [1]_: one rectangular pulse of acceleration.

    u = A t² (1/r − 1)/2 for each pulse, r = ky/PGA, A = PGA g, t its duration.  With half a period
    as t, 4u/(A T²) = (1/r − 1)/2.

    Parameters
    ----------
    yield_coefficient : float or array
        ky, > 0.
    pga : float or array
        Acceleration of the pulse, g, > 0.
    pulse_duration : float or array
        t, s, > 0.
    cycles : float or array
        Number of pulses.
    g : float
        Gravity, m/s².

    Returns
    -------
    Estimate
        The displacement (m); a closed form, without scatter.

    Raises
    ------
    InputError
        An input is not above zero.

    See Also
    --------
    newmark_1965 : the same pulse by the velocity that it gives the base, V = A t

    References
    ----------
    .. [1] S. K. Sarma (1975), "Seismic stability of earth dams and embankments", Géotechnique 25,
       743-761, https://doi.org/10.1680/geot.1975.25.4.743

    Examples
    --------
    >>> from slipsweep import published
    >>> print(f"{published.sarma_1975(0.1, 0.4, pulse_duration=0.1).median:.4f} m")
    0.0589 m
    """
    inputs = _checked(
        yield_coefficient=yield_coefficient, pga=pga, pulse_duration=pulse_duration, cycles=cycles
    )
    ratio = _ratio(inputs)
    unit = inputs["pga"] * g * inputs["pulse_duration"] ** 2
    each = 0.5 * unit * (1.0 / ratio - 1.0)
    return _estimate("sarma-1975", inputs, np.log(inputs["cycles"] * each), 0.0)


def _source(function: Callable[..., Estimate]) -> str:
    """The reference in a function's docstring, on one line."""
    reference = (inspect.getdoc(function) or "").split(".. [1] ")[1].split("\n\n")[0]
    return " ".join(reference.split())


def _record(label: str, function: Callable[..., Estimate], *about: Any) -> Equation:
    name = function.__name__.replace("_", "-")
    return Equation(name, label, function, _source(function), *about)


_RECORDS = (
    _record(
        "Ambraseys and Menu 1988",
        ambraseys_menu_1988,
        "0.30 (log10)",
        "under 50 records close to the source of 11 earthquakes, Ms 6.6 to 7.3",
        {"ratio": (0.1, 0.9)},
    ),
    _record(
        "Jibson 2007",
        jibson_2007,
        "0.510 (log10)",
        "under 2270 records of 30 earthquakes, M 5.3 to 7.6",
        {"yield_coefficient": (0.05, 0.4)},
    ),
    _record(
        "Jibson 2007, with M",
        jibson_2007_magnitude,
        "0.454 (log10)",
        "under 2270 records of 30 earthquakes",
        {"yield_coefficient": (0.05, 0.4), "magnitude": (5.3, 7.6)},
    ),
    _record(
        "Saygili and Rathje 2008",
        saygili_rathje_2008,
        "1.13 (ln)",
        "under 2383 records of earthquakes",
        {"yield_coefficient": (0.05, 0.3)},
    ),
    _record(
        "Saygili and Rathje 2008, with PGV",
        saygili_rathje_2008_pgv,
        "0.405 + 0.524 r (ln)",
        "under 2383 records of earthquakes",
        {"yield_coefficient": (0.05, 0.3)},
    ),
    _record(
        "Rathje and Saygili 2009",
        rathje_saygili_2009,
        "0.732 + 0.789 r − 0.539 r² (ln)",
        "under more than 2000 records of earthquakes",
        {"yield_coefficient": (0.05, 0.3)},
    ),
    _record(
        "Bray and Travasarou 2007",
        bray_travasarou_2007,
        "0.66 (ln)",
        "under 688 records of earthquakes, Ts < 0.05 s; less than 1 cm counts as zero",
        {"yield_coefficient": (0.02, 0.4)},
    ),
    _record(
        "Yegian and others 1991",
        yegian_1991,
        "0.45 (log10)",
        "under earthquake records with N equivalent cycles of period T",
    ),
    _record(
        "Newmark 1965",
        newmark_1965,
        "none",
        "under rectangular pulses of the same peak acceleration and velocity",
    ),
    _record(
        "Sarma 1975",
        sarma_1975,
        "none",
        "under rectangular pulses of the same peak acceleration, half a period long",
    ),
)

#: The records of all equations, by name.
EQUATIONS: dict[str, Equation] = {record.name: record for record in _RECORDS}
