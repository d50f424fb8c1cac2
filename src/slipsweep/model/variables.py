"""Names, units and CF attributes of results, each written once; and the codes that results hold.

`RESULTS` has what a sweep returns, `HISTORY` what `simulate` returns along time.  Datasets, netCDF
files, tables and figures take their words from here.  The inputs, which become coordinates, are
declared in `model/parameter_table.py`; `PARAMETERS` has their attributes.
"""

from collections.abc import Mapping
from enum import IntEnum, IntFlag, StrEnum
from typing import Any, Self

from slipsweep.model.parameter_table import PARAMETER_TABLE

REFERENCE = (
    "B. C. Mendez, M. P. Romo, E. Botero (2012), Linearization of rigid body dynamics on "
    "frictional interfaces under harmonic loading, Soil Dynamics and Earthquake Engineering "
    "32, 152-158, https://doi.org/10.1016/j.soildyn.2011.08.007"
)
NEWMARK_REFERENCE = (
    "N. M. Newmark (1965), Effects of earthquakes on dams and embankments, Géotechnique 15, "
    "139-160, https://doi.org/10.1680/geot.1965.15.2.139"
)


class SlidingMode(IntEnum):
    """Sliding mode of a cell.

    It follows from the amplitude, the yield acceleration and the limiting acceleration, Eq. 7 of
    the paper.

    See Also
    --------
    Validity : what else is to be known of a cell

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=5, mu_s=0.4, amplitude=[1.0, 4.0, 9.0], frequency=2.0)
    >>> [slipsweep.SlidingMode(code).name for code in result.sliding_mode.values]
    ['STUCK', 'STICK_SLIP', 'CONTINUOUS']
    """

    MISSING = -1
    STUCK = 0
    STICK_SLIP = 1
    CONTINUOUS = 2


class FlagKind(StrEnum):
    """Kind of a flag: it decides if the value of the cell can be used."""

    NO_VALUE = "no value"  # NaN, and sliding mode missing
    CAUTION = "caution"
    NOTE = "note"


#: The meaning of each kind, in words.
FLAG_KIND_TEXT: dict[FlagKind, str] = {
    FlagKind.NO_VALUE: "the model does not apply",
    FlagKind.CAUTION: "an assumption of the model is violated",
    FlagKind.NOTE: "no assumption is violated; a special rule or an estimate was used",
}

#: Text for cells without flags.
UNFLAGGED_TEXT = "another program has masked or joined these cells, and left them without flags"


class Validity(IntFlag):
    """Flags of a cell's value, or of why it has none; 0 means that no flag is raised.

    Each flag has its `kind` ("no value", "caution" or "note") and a `text` of one line.

    See Also
    --------
    flags : one boolean variable for each flag
    SlidingMode : the other code of a cell

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=25, mu_s=0.38, amplitude=3.0, frequency=1.0)
    >>> flag = slipsweep.Validity(result.validity.item())
    >>> flag.name, flag.text
    ('STATICALLY_UNSTABLE', 'yield acceleration <= 0: the block slides under its own weight')
    """

    kind: FlagKind
    text: str

    def __new__(cls, mask: int, kind: FlagKind = FlagKind.NO_VALUE, text: str = "") -> Self:
        """Make a flag with its kind and its text."""
        flag = int.__new__(cls, mask)
        flag._value_ = mask
        flag.kind = kind
        flag.text = text
        return flag

    STATICALLY_UNSTABLE = (
        1,
        FlagKind.NO_VALUE,
        "yield acceleration <= 0: the block slides under its own weight",
    )
    UPLIFT = 2, FlagKind.NO_VALUE, "A tan(theta) >= g: the block loses contact within the cycle"
    LIMIT_UNDEFINED = (
        4,
        FlagKind.NO_VALUE,
        "1 - tan(theta) (mu_s - tan(theta)) <= 0: Eq. 7 has no limit",
    )
    FRICTION_NOT_DECAYING = 8, FlagKind.NO_VALUE, "calibrated decay rate <= 0 (mu_s xi^2 >= 1)"
    YIELD_GOVERNS = (
        16,
        FlagKind.NOTE,
        (
            "the yield acceleration governs: the result is that of Newmark's block and does not "
            "depend on lambda"
        ),
    )
    KD_NOT_POSITIVE = 32, FlagKind.NO_VALUE, "literal rise: Kd <= 0, Eq. 12 cannot stop the block"
    NOT_RECOUPLED = (
        64,
        FlagKind.CAUTION,
        ("does not come to rest within the cycle: Eq. 12 does not hold; displacement unreliable"),
    )
    FLEXIBLE_BLOCK = (
        128,
        FlagKind.CAUTION,
        "0.2 <= f/fs <= 1.3: the rigid-block assumption does not hold",
    )
    UPSLOPE = (
        256,
        FlagKind.CAUTION,
        "the permanent displacement is negative: the block ends upslope",
    )
    NEAR_MODE_LIMIT = (
        512,
        FlagKind.CAUTION,
        ("0.9 <= xi <= 1.1: at xi = 1 the displacement jumps to several times its value"),
    )
    FRICTION_ESTIMATED = (
        1024,
        FlagKind.NOTE,
        "the displacement depends on lambda by Eq. 6 or delta_mu by Eqs. 10, 11",
    )
    MAY_NOT_STOP = (
        2048,
        FlagKind.CAUTION,
        (
            "residual_mu or fast_mu <= tan(theta): once it slides, the block may not stop under "
            "its own weight"
        ),
    )
    NOT_AT_REST = (
        4096,
        FlagKind.NO_VALUE,
        "the block slides on under its own weight after the shaking and does not come to rest",
    )


def flags_of(kind: FlagKind) -> Validity:
    """Return all flags of a kind."""
    return Validity(sum(flag for flag in Validity if flag.kind is kind))


VALUELESS, CAUTIONS, NOTES = (flags_of(kind) for kind in FlagKind)

#: Flags of blocks without a value that never stop: their displacement exceeds every length.
ENDLESS = Validity.STATICALLY_UNSTABLE | Validity.NOT_AT_REST


class _Status(IntEnum):
    """A code with a `text` of one line for people."""

    text: str

    def __new__(cls, code: int, text: str = "") -> Self:
        """Make a code with its text."""
        status = int.__new__(cls, code)
        status._value_ = code
        status.text = text
        return status


class LimitStatus(_Status):
    """Status of a limit amplitude: the kind of the limit, or the reason why there is none."""

    REACHED = 0, "the displacement is reached where it is continuous"
    AT_MODE_JUMP = 1, "the displacement is exceeded by the jump where the sliding mode changes"
    AT_JUMP = 2, "the displacement is exceeded by a jump within one sliding mode"
    AFTER_GAP = 3, "just below the limit the model gives no value"
    NOT_REACHED = (
        4,
        "not reached up to the maximum amplitude, or the last one with a value (no limit)",
    )
    INVALID = 5, "the model gives no value at any amplitude (no limit)"


class StrengthStatus(_Status):
    """Status of a required strength: solved, or the reason why there is none."""

    SOLVED = 0, "the displacement at the required strength is the tolerable one"
    ALWAYS_WITHIN = (
        1,
        "not exceeded at any strength, as where nothing slides: static equilibrium is enough",
    )
    NEVER_WITHIN = 2, "exceeded at every strength (no required strength)"


class SensitivityStatus(_Status):
    """Status of Sobol indices: computed, or the reason why there are none."""

    COMPUTED = 0, "there are indices"
    NO_VARIANCE = 1, "all runs have the same displacement"
    RUNS_WITHOUT_VALUE = 2, "some runs have no value"


#: End of the search for a limit amplitude when none is given, in g.
MAXIMUM_AMPLITUDE_IN_G = 5.0


def _cf(units: str, long_name: str, ancillary: str | None = None, **more: str) -> dict[str, Any]:
    """CF attributes of a variable."""
    return (
        {"units": units, "long_name": long_name}
        | ({"ancillary_variables": ancillary} if ancillary else {})
        | more
    )


def _coded(
    long_name: str, codes: Any, ancillary: str | None = None, key: str = "flag_values"
) -> dict[str, Any]:
    """CF attributes of a variable of codes; one below 0 is that of a missing value."""
    valued = [code for code in codes if code >= 0]
    meanings = " ".join(code.name.lower() for code in valued)
    more = {"ancillary_variables": ancillary} if ancillary else {}
    return {
        "long_name": long_name,
        key: [int(code) for code in valued],
        "flag_meanings": meanings,
    } | more


def _estimated(name: str, rule: str) -> dict[str, Any]:
    """CF attributes of a parameter as a result, with the rule that estimates it."""
    attributes = PARAMETERS[name]
    return {**attributes, "long_name": f"{attributes['long_name']} ({rule})"}


#: The direction in which u is measured.
_DIRECTION = (
    "of the block relative to the base, in the direction of the base's acceleration: horizontal "
    "where that is; by statics the distance along the plane is that of Newmark's block times "
    "cos(phi - theta) / cos(phi), mu_s = tan(phi)"
)

#: Inputs: CF attributes of their coordinates, in the order of the dimensions of a result.
PARAMETERS: dict[str, dict[str, Any]] = {row.name: row.attributes for row in PARAMETER_TABLE}

#: Friction angles, each with the friction coefficient that it stands for.
ANGLES = {"phi": "mu_s", "residual_phi": "residual_mu"}

#: Inputs of Newmark's block whose strength changes while it slides.
STRENGTH_INPUTS = {
    "weakening": ("residual_mu", "weakening_distance"),
    "rate": ("fast_mu", "rate_constant"),
}

#: Dimensions of a result, in order; further ones follow.
DIMENSION_ORDER = (*PARAMETERS, "motion")

#: Inputs of the interface, in place of which Newmark's block may have its yield coefficient alone.
INTERFACE_INPUTS = (
    "theta",
    "mu_s",
    "phi",
    "yield_acceleration",
    "decay_rate",
    "delta_mu",
    "minimum_friction",
    "residual_mu",
    "residual_phi",
    "weakening_distance",
    "fast_mu",
    "rate_constant",
)

#: Inputs of the shaking if it is a waveform, and if it is a record.
WAVEFORM_INPUTS = tuple(row.name for row in PARAMETER_TABLE if "waveform" in row.shaking)
RECORD_INPUTS = tuple(row.name for row in PARAMETER_TABLE if "record" in row.shaking)

#: Inputs of a record that say how strong the motion is; one of them is given.
STRENGTHS = ("amplitude", "scale", "pgv", "arias_intensity")

#: Inputs that may be drawn: all that the displacement depends on.
DRAWN = tuple(row.name for row in PARAMETER_TABLE if row.drawn)

#: Inputs that [model] of a sweep file may give, as one number for the whole sweep.
MODEL_INPUTS = tuple(row.name for row in PARAMETER_TABLE if row.in_model)

#: Results of Newmark's block that slides both ways: extremes of u over time.
EXTREMES: dict[str, dict[str, Any]] = {
    "largest_displacement": _cf(
        "m", "largest relative displacement over time, downslope", "validity", comment=_DIRECTION
    ),
    "smallest_displacement": _cf(
        "m", "smallest relative displacement over time, downslope", "validity", comment=_DIRECTION
    ),
}

#: Results of Newmark's block that slides both ways only; the last of them on request.
BOTH_WAYS: dict[str, dict[str, Any]] = {
    **EXTREMES,
    "clearance": _cf("m", "clearance, largest less smallest displacement over time", "validity"),
}

#: Results of a sweep: attributes of the variables.
RESULTS: dict[str, dict[str, Any]] = {
    "permanent_displacement": _cf(
        "m", "permanent displacement, downslope", "validity", comment=_DIRECTION
    ),
    "peak_relative_velocity": _cf("m s-1", "largest downslope relative velocity", "validity"),
    "sliding_mode": _coded("sliding mode", SlidingMode, "validity"),
    "validity": _coded("validity flags; 0 = no flag raised", Validity, key="flag_masks"),
    "newmark_displacement": _cf(
        "m", "permanent displacement of Newmark's block, downslope", "validity", comment=_DIRECTION
    ),
    **BOTH_WAYS,
    "yield_acceleration": PARAMETERS["yield_acceleration"],
    "limiting_acceleration": _cf("m s-2", "limiting acceleration (Eq. 7)"),
    "acceleration_ratio": _cf("1", "peak ground over limiting acceleration"),
    "minimum_friction": _estimated("minimum_friction", "Eq. 9"),
    "delta_mu": _estimated("delta_mu", "Eqs. 10, 11"),
    "decay_rate": _estimated("decay_rate", "Eq. 6 at the peak"),
    # where the displacement amplitude and the frequency span a grid; elsewhere it is a coordinate
    "amplitude": PARAMETERS["amplitude"],
}

#: The target of `limit_amplitude`.
TOLERABLE_DISPLACEMENT: dict[str, Any] = {
    "units": "m",
    "long_name": "tolerable permanent displacement",
}

#: Results of `limit_amplitude`; sliding mode and validity go with them.
LIMIT_RESULTS: dict[str, dict[str, Any]] = {
    "limit_amplitude": _cf(
        "m s-2",
        "smallest peak ground acceleration that reaches the tolerable displacement",
        "limit_status",
    ),
    "limit_status": _coded("how the limit amplitude was found", LimitStatus),
    "permanent_displacement": _cf(
        "m", "permanent displacement, downslope, at the limit amplitude", "validity"
    ),
}

#: Further results under a record, beside displacement, velocity and validity; -1 where there is no
#: value.
RECORD_COUNTS: dict[str, dict[str, Any]] = {
    "number_of_slips": _cf("1", "number of slips that begin at rest", "validity"),
    "stick_slip_pulses": _cf("1", "number of pulses in stick-slip mode", "validity"),
    "continuous_pulses": _cf("1", "number of pulses in continuous mode", "validity"),
}

#: Results of a sweep under a record.
RECORD_RESULTS: dict[str, dict[str, Any]] = {
    **{name: RESULTS[name] for name in ("permanent_displacement", "peak_relative_velocity")},
    **RECORD_COUNTS,
    **{name: RESULTS[name] for name in ("validity", "newmark_displacement", *BOTH_WAYS)},
    "motion_factor": _cf("1", "factor on the recorded acceleration"),
}

#: Intensity measures of a motion as it was recorded (`slipsweep.motion.intensity`).
INTENSITY_MEASURES: dict[str, dict[str, Any]] = {
    "pga": _cf("m s-2", "peak ground acceleration as recorded"),
    "pgv": _cf("m s-1", "peak ground velocity as recorded"),
    "pgd": _cf("m", "peak ground displacement as recorded"),
    "arias_intensity": _cf("m s-1", "Arias intensity as recorded"),
    "cav": _cf("m s-1", "cumulative absolute velocity as recorded"),
    "significant_duration": _cf("s", "significant duration, 5 to 95 % of the Arias intensity"),
    "mean_period": _cf("s", "mean period, 0.25 to 20 Hz"),
}

#: Further coordinates of a suite along `motion`.
MOTION_COORDINATES: dict[str, dict[str, Any]] = {
    "motion_file": {"long_name": "file of the motion"},
    "motion_sha256": {"long_name": "SHA-256 of the file of the motion"},
    "motion_samples": _cf("1", "samples of the motion"),
    "motion_interval": _cf("s", "mean sampling interval of the motion"),
    **{f"motion_{name}": about for name, about in INTENSITY_MEASURES.items()},
}

#: Those with long texts, which tables leave out; `slipsweep info` and the file itself have them.
MOTION_FILES = ("motion_file", "motion_sha256")

#: Samples of a record, stored in files of results so that a run can be repeated.
RECORD_SAMPLES: dict[str, dict[str, Any]] = {
    "record_time": _cf("s", "time of a sample of the record"),
    "record_acceleration": _cf(
        "m s-2",
        "recorded acceleration of the base, at scale and polarity 1",
        coordinates="record_time",
    ),
}

#: Coordinates of the statistics of `sample`, beside the parameters.
STATISTIC_COORDINATES: dict[str, dict[str, Any]] = {
    "quantile": _cf("1", "share of the samples with a value that lies below"),
    "threshold": _cf("m", "displacement to exceed"),
    "mode": {"units": "1", **_coded("sliding mode", SlidingMode)},
    "flag": {"units": "1", **_coded("flag of the validity", Validity)},
    "input": {
        "long_name": "uncertain input; inputs that are correlated are one, with + between them"
    },
    "bound": _cf("1", "probability below an end of an interval"),
}

#: Statistics of `sample`.  Quantiles and mean are of the samples that have a value; probabilities
#: also count the statically unstable samples, as exceeding every threshold.
STATISTICS: dict[str, dict[str, Any]] = {
    "displacement_quantile": _cf("m", "quantile of the permanent displacement", "valueless_share"),
    "mean_displacement": _cf("m", "mean permanent displacement", "valueless_share"),
    "exceedance_probability": _cf(
        "1", "probability that the permanent displacement exceeds a threshold", "valueless_share"
    ),
    "mode_share": _cf("1", "share of the samples in a sliding mode"),
    "flag_share": _cf("1", "share of the samples with a flag"),
    "valueless_share": _cf("1", "share of the samples without a value"),
    "first_order_index": _cf(
        "1", "first-order Sobol index of the permanent displacement", "sensitivity_status"
    ),
    "first_order_interval": _cf(
        "1", "95 % interval of the first-order Sobol index", "sensitivity_status"
    ),
    "total_index": _cf(
        "1", "total Sobol index of the permanent displacement", "sensitivity_status"
    ),
    "total_interval": _cf("1", "95 % interval of the total Sobol index", "sensitivity_status"),
    "sensitivity_status": _coded(
        "whether there are Sobol indices, or why there are none", SensitivityStatus
    ),
}

#: Statistics over the motions of a suite.  All but counts and shares are of motions with a value.
SUITE_STATISTICS: dict[str, dict[str, Any]] = {
    "value_count": _cf("1", "number of motions with a value"),
    "valueless_count": _cf("1", "number of motions without a value"),
    "valueless_flag_count": _cf("1", "number of motions without a value that have a flag"),
    "valueless_share": _cf("1", "share of the motions without a value"),
    "zero_probability": _cf("1", "probability of zero permanent displacement", "valueless_share"),
    "nonzero_median": _cf("m", "median of the non-zero permanent displacements", "valueless_share"),
    "nonzero_geometric_mean": _cf(
        "m", "geometric mean of the non-zero permanent displacements", "valueless_share"
    ),
    "log_standard_deviation": _cf(
        "1",
        "standard deviation of ln u of the non-zero permanent displacements u",
        "valueless_share",
    ),
    "displacement_quantile": STATISTICS["displacement_quantile"],
    "exceedance_probability": STATISTICS["exceedance_probability"],
}

#: Inputs that `required_strength` may solve for, and the attributes of its results.
REQUIRED_STRENGTHS: dict[str, dict[str, Any]] = {
    name: _cf(
        PARAMETERS[name]["units"],
        f"required {PARAMETERS[name]['long_name'].partition(',')[0]}",
        "required_status",
    )
    for name in ("yield_coefficient", "mu_s", "phi")
}

#: Results of `required_strength`: of each motion or sample, or of all of them together.
REQUIRED_RESULTS: dict[str, dict[str, Any]] = {
    **{f"required_{name}": about for name, about in REQUIRED_STRENGTHS.items()},
    "required_status": _coded("how the required strength was found", StrengthStatus),
    **{
        f"required_{name}_quantile": _cf(
            about["units"],
            f"quantile of the {about['long_name']}",
            "always_within_count never_within_count",
        )
        for name, about in REQUIRED_STRENGTHS.items()
    },
    "always_within_count": _cf("1", "number that stay within at every strength"),
    "never_within_count": _cf("1", "number that stay within at no strength"),
}


def has_signed_displacements(attributes: Mapping[Any, Any]) -> bool:
    """Return whether displacements of a result with these attributes may be negative by design."""
    return bool(attributes.get("sliding") == "both")


def counted_text(text: str, attributes: Mapping[Any, Any]) -> str:
    """Return words for what is counted of permanent displacements: |u|, where u has signs.

    `attributes` are those of the result.
    """
    is_of_displacement = "permanent displacement" in text.lower()
    if is_of_displacement and has_signed_displacements(attributes):
        return f"{text}, by magnitude |u|"
    return text


def counted(about: Mapping[str, Any], attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the attributes of a statistic with the words of `counted_text`."""
    return {**about, "long_name": counted_text(str(about["long_name"]), attributes)}


#: The mean annual rate of exceeding a displacement, and its parts outside of the amplitudes of the
#: grid.
HAZARD_RESULTS: dict[str, dict[str, Any]] = {
    "annual_rate": _cf(
        "year-1",
        "mean annual rate of exceeding a permanent displacement",
        "held_rate omitted_rate valueless_share",
    ),
    "held_rate": _cf(
        "year-1", "part of it above the largest amplitude, where the probability is held constant"
    ),
    "omitted_rate": _cf(
        "year-1",
        "upper bound of the part below the smallest amplitude, where the probability is taken as 0",
    ),
    "lower_rate": _cf("year-1", "annual rate with the lower probability of each two amplitudes"),
    "upper_rate": _cf("year-1", "annual rate with the higher probability of each two amplitudes"),
    "valueless_share": _cf("1", "largest share of the motions without a value at any amplitude"),
}

#: Further variables of statistics and annual rates by published equations.
PUBLISHED_RESULTS: dict[str, dict[str, Any]] = {
    "in_range": {
        "long_name": "whether the inputs lie in the range of the equation",
        "flag_values": [0, 1],
        "flag_meanings": "outside inside",
    },
    "outside_rate": _cf(
        "year-1", "part of the annual rate for which the equation is used outside of its range"
    ),
}

#: dtype of each result; everything else is float64.
RESULT_DTYPES: dict[str, str] = {
    "sliding_mode": "int8",
    "half_wave_mode": "int8",
    "validity": "int16",
    "limit_status": "int8",
    "required_status": "int8",
    "always_within_count": "int32",
    "never_within_count": "int32",
    "sensitivity_status": "int8",
    **dict.fromkeys(RECORD_COUNTS, "int32"),
}

#: Displacements that may be negative where a block slides both ways.
SIGNED = ("permanent_displacement", *EXTREMES)

#: Default results of `sweep`; under a suite also the factor on each motion.
DEFAULT_RESULTS = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")
DEFAULT_RECORD_RESULTS = (
    "permanent_displacement",
    "peak_relative_velocity",
    *RECORD_COUNTS,
    "validity",
)

#: The parameters of Eqs. 7-11.
FRICTION_PARAMETERS = (
    "yield_acceleration",
    "limiting_acceleration",
    "acceleration_ratio",
    "minimum_friction",
    "delta_mu",
    "decay_rate",
)

#: Variables of a time history.
HISTORY: dict[str, dict[str, Any]] = {
    "ground_acceleration": _cf("m s-2", "acceleration of the base"),
    "block_acceleration": _cf("m s-2", "acceleration of the block"),
    "friction_coefficient": _cf("1", "instantaneous friction coefficient"),
    "relative_velocity": _cf("m s-1", "relative velocity of the block"),
    "relative_displacement": _cf("m", "relative displacement of the block", comment=_DIRECTION),
}

#: Positive half waves of the record of a time history, along `half_wave`.
HALF_WAVES: dict[str, dict[str, Any]] = {
    "half_wave_start": _cf("s", "time at which the acceleration of the base rises through zero"),
    "half_wave_end": _cf("s", "time at which it falls through zero"),
    "half_wave_peak": _cf("m s-2", "largest acceleration of the base between"),
    "half_wave_mode": _coded(
        "sliding mode that the peak decides; stuck where it does not exceed the yield acceleration",
        SlidingMode,
    ),
}

#: Friction that a test on a shaking table measured, along time (`measured_friction`).
MEASURED_FRICTION: dict[str, dict[str, Any]] = {
    "friction_coefficient": _cf("1", "friction coefficient by Eq. 1"),
    "friction_ratio": _cf("1", "friction coefficient by Eq. 1 over the static one"),
    "free_body_friction": _cf("1", "friction coefficient by statics; at rest the mobilised one"),
}

#: Slides in a test, along `slide`.
SLIDES: dict[str, dict[str, Any]] = {
    "slide_onset": _cf("s", "time at which a slide begins"),
    "slide_peak": _cf("s", "time of the largest table acceleration within a slide"),
    "slide_stop": _cf("s", "time at which a slide stops; missing where the record ends before"),
    "onset_acceleration": _cf("m s-2", "acceleration of the table where a slide begins"),
    "peak_acceleration": _cf("m s-2", "largest acceleration of the table within a slide"),
    "peak_block_acceleration": _cf("m s-2", "largest acceleration of the block within a slide"),
    "least_friction": _cf("1", "least friction coefficient by Eq. 1 within a slide"),
    "slide_free_body_friction": _cf("1", "median friction coefficient by statics within a slide"),
}

#: Further results of `calibrate`.
CALIBRATION: dict[str, dict[str, Any]] = {
    "correlation": _cf("1", "correlation of two parameters as estimated"),
    "cycle_start": _cf("s", "time at which a cycle begins"),
    "cycle_peak_acceleration": _cf("m s-2", "largest acceleration of the table in a cycle"),
    "cycle_sliding_mode": _coded("sliding mode of a cycle", SlidingMode),
    "cycle_attenuation_coefficient": _cf("1", "attenuation coefficient Kd of a cycle (Eq. 12)"),
    **{
        f"cycle_{name}{suffix}": _cf(
            PARAMETERS[name]["units"], f"{what}{PARAMETERS[name]['long_name']} from a cycle alone"
        )
        for name in ("yield_acceleration", "decay_rate", "delta_mu")
        for suffix, what in (("", ""), ("_error", "standard error of the "))
    },
}

#: Series of a test, measured, and computed with the calibrated parameters, along time.
CALIBRATION_SERIES: dict[str, dict[str, Any]] = {
    f"{kind}_{name}": {**about, "long_name": f"{kind} {about['long_name']}"}
    for kind in ("measured", "computed")
    for name, about in HISTORY.items()
}
