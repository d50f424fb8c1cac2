"""Names, units and CF attributes of everything slipsweep reads or returns, written once.

`PARAMETERS` describes the inputs (they become coordinates), `RESULTS` what a sweep
returns, `HISTORY` what `simulate` returns along time, `VALIDITY` and `SLIDING_MODE`
the codes.  The xarray datasets, the netCDF files, the sweep-file schema and the figures
all take their words from here.
"""

from enum import IntEnum, IntFlag, StrEnum
from typing import Any

REFERENCE = (
    "B. C. Mendez, M. P. Romo, E. Botero (2012), Linearization of rigid body dynamics on "
    "frictional interfaces under harmonic loading, Soil Dynamics and Earthquake Engineering "
    "32, 152-158, https://doi.org/10.1016/j.soildyn.2011.08.007"
)


class SlidingMode(IntEnum):
    """Sliding mode of a cell.

    It follows from the amplitude, the yield acceleration and the limiting acceleration, Eq. 7 of the paper [1]_.

    See Also
    --------
    Validity : what else is to be known of a cell

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

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


class Validity(IntFlag):
    """What is to be known of a cell's value, or why it has none; 0 means that no flag is raised.

    See Also
    --------
    flags : one boolean variable for each flag
    SlidingMode : the other code of a cell

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=25, mu_s=0.38, amplitude=3.0, frequency=1.0)
    >>> slipsweep.Validity(result.validity.item()).name
    'STATICALLY_UNSTABLE'
    """

    STATICALLY_UNSTABLE = 1
    UPLIFT = 2
    LIMIT_UNDEFINED = 4
    FRICTION_NOT_DECAYING = 8
    YIELD_GOVERNS = 16
    KD_NOT_POSITIVE = 32
    NOT_RECOUPLED = 64
    FLEXIBLE_BLOCK = 128
    UPSLOPE = 256
    NEAR_MODE_LIMIT = 512
    FRICTION_ESTIMATED = 1024


class FlagKind(StrEnum):
    """What a flag says of the value of its cell."""

    NO_VALUE = "no value"
    CAUTION = "caution"
    NOTE = "note"


class LimitStatus(IntEnum):
    """How a limit amplitude was found, or why there is none."""

    REACHED = 0
    AT_MODE_JUMP = 1
    AT_JUMP = 2
    AFTER_GAP = 3
    NOT_REACHED = 4
    INVALID = 5


#: One line a status, for people (`slipsweep limit`).
LIMIT_STATUS_TEXT: dict[LimitStatus, str] = {
    LimitStatus.REACHED: "the displacement is reached where it is continuous",
    LimitStatus.AT_MODE_JUMP: "the displacement is exceeded by the jump where the sliding mode changes",
    LimitStatus.AT_JUMP: "the displacement is exceeded by a jump within one sliding mode",
    LimitStatus.AFTER_GAP: "just below the limit the model gives no value",
    LimitStatus.NOT_REACHED: "not reached up to the maximum amplitude, or the last one with a value (no limit)",
    LimitStatus.INVALID: "the model gives no value at any amplitude (no limit)",
}


class SensitivityStatus(IntEnum):
    """Whether there are Sobol indices, or why there are none."""

    COMPUTED = 0
    NO_VARIANCE = 1
    RUNS_WITHOUT_VALUE = 2


#: One line a status, for people.
SENSITIVITY_STATUS_TEXT: dict[SensitivityStatus, str] = {
    SensitivityStatus.COMPUTED: "there are indices",
    SensitivityStatus.NO_VARIANCE: "all runs have the same displacement",
    SensitivityStatus.RUNS_WITHOUT_VALUE: "some runs have no value",
}

#: End of the search for a limit amplitude when none is given, in g.
MAXIMUM_AMPLITUDE_IN_G = 5.0


#: What each flag says of the value: there is none (NaN, and sliding mode missing); there is one, but an assumption
#: behind it is broken; there is one, and it is sound.
FLAG_KINDS: dict[Validity, FlagKind] = {
    Validity.STATICALLY_UNSTABLE: FlagKind.NO_VALUE,
    Validity.UPLIFT: FlagKind.NO_VALUE,
    Validity.LIMIT_UNDEFINED: FlagKind.NO_VALUE,
    Validity.FRICTION_NOT_DECAYING: FlagKind.NO_VALUE,
    Validity.YIELD_GOVERNS: FlagKind.NOTE,
    Validity.KD_NOT_POSITIVE: FlagKind.NO_VALUE,
    Validity.NOT_RECOUPLED: FlagKind.CAUTION,
    Validity.FLEXIBLE_BLOCK: FlagKind.CAUTION,
    Validity.UPSLOPE: FlagKind.CAUTION,
    Validity.NEAR_MODE_LIMIT: FlagKind.CAUTION,
    Validity.FRICTION_ESTIMATED: FlagKind.NOTE,
}


def flags_of(kind: FlagKind) -> Validity:
    """All flags of a kind."""
    return Validity(sum(flag for flag in Validity if FLAG_KINDS[flag] is kind))


VALUELESS, CAUTIONS, NOTES = flags_of(FlagKind.NO_VALUE), flags_of(FlagKind.CAUTION), flags_of(FlagKind.NOTE)

#: A heading for each kind, for people.
FLAG_KIND_TEXT: dict[FlagKind, str] = {
    FlagKind.NO_VALUE: "the model does not apply",
    FlagKind.CAUTION: "an assumption of the model is violated",
    FlagKind.NOTE: "no assumption is violated; a special rule or an estimate was used",
}

#: One line a flag, for people (`slipsweep info`).
VALIDITY_TEXT: dict[Validity, str] = {
    Validity.STATICALLY_UNSTABLE: "yield acceleration <= 0: the block slides under its own weight",
    Validity.UPLIFT: "A tan(theta) >= g: the block loses contact within the cycle",
    Validity.LIMIT_UNDEFINED: "1 - tan(theta) (mu_s - tan(theta)) <= 0: Eq. 7 has no limit",
    Validity.FRICTION_NOT_DECAYING: "calibrated decay rate <= 0 (mu_s xi^2 >= 1)",
    Validity.YIELD_GOVERNS: "with the monotone rise the block slides at constant yield acceleration, as "
    "Newmark's; the result does not depend on lambda",
    Validity.KD_NOT_POSITIVE: "literal rise: Kd <= 0, Eq. 12 cannot stop the block",
    Validity.NOT_RECOUPLED: "does not come to rest within the cycle: Eq. 12 does not hold; displacement unreliable",
    Validity.FLEXIBLE_BLOCK: "0.2 <= f/fs <= 1.3: the rigid-block assumption does not hold",
    Validity.UPSLOPE: "the permanent displacement is negative: the block ends upslope",
    Validity.NEAR_MODE_LIMIT: "0.9 <= xi <= 1.1: at xi = 1 the displacement jumps to several times its value",
    Validity.FRICTION_ESTIMATED: "the displacement depends on lambda by Eq. 6 or delta_mu by Eqs. 10, 11",
}

#: Dimensions of a result, in order; further ones follow.
DIMENSION_ORDER = (
    "theta",
    "mu_s",
    "phi",
    "amplitude",
    "displacement_amplitude",
    "frequency",
    "yield_acceleration",
    "yield_coefficient",
    "decay_rate",
    "delta_mu",
    "minimum_friction",
    "structure_frequency",
    "scale",
    "pgv",
    "arias_intensity",
    "time_scale",
    "polarity",
    "azimuth",
    "motion",
)

#: Inputs: attributes of their coordinates.
PARAMETERS: dict[str, dict[str, Any]] = {
    "theta": {"units": "degree", "long_name": "base inclination"},
    "mu_s": {"units": "1", "long_name": "static friction coefficient"},
    "phi": {"units": "degree", "long_name": "friction angle, in place of mu_s = tan(phi)"},
    "amplitude": {"units": "m s-2", "long_name": "peak ground acceleration"},
    "displacement_amplitude": {"units": "m", "long_name": "peak ground displacement"},
    "frequency": {"units": "Hz", "long_name": "excitation frequency"},
    "yield_acceleration": {"units": "m s-2", "long_name": "yield acceleration"},
    "yield_coefficient": {"units": "1", "long_name": "yield coefficient, yield acceleration over g"},
    "decay_rate": {"units": "1", "long_name": "friction decay with loading rate"},
    "delta_mu": {"units": "1", "long_name": "friction above static"},
    "minimum_friction": {"units": "1", "long_name": "minimum friction coefficient"},
    "structure_frequency": {"units": "Hz", "long_name": "natural frequency of the structure"},
    "scale": {"units": "1", "long_name": "scale factor of the recorded acceleration"},
    "pgv": {"units": "m s-1", "long_name": "peak ground velocity that motions are scaled to"},
    "arias_intensity": {"units": "m s-1", "long_name": "Arias intensity that motions are scaled to"},
    "time_scale": {"units": "1", "long_name": "factor on the time of the record"},
    "polarity": {"units": "1", "long_name": "sign that the recorded acceleration is taken with"},
    "azimuth": {"units": "degree", "long_name": "downslope direction, from the first component to the second"},
}

#: Inputs of the interface, in place of which Newmark's block may have its yield coefficient alone.
INTERFACE_INPUTS = ("theta", "mu_s", "phi", "yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")

#: Inputs that the shaking has if it is a waveform, and if it is a record.
WAVEFORM_INPUTS = ("amplitude", "displacement_amplitude", "frequency", "structure_frequency")
RECORD_INPUTS = ("amplitude", "scale", "pgv", "arias_intensity", "time_scale", "polarity", "azimuth")

#: Of them, those that say how strong a motion is: one of them is given.
STRENGTHS = ("amplitude", "scale", "pgv", "arias_intensity")

#: Inputs that may be drawn: all that the displacement depends on.
DRAWN = (
    "theta", "mu_s", "amplitude", "displacement_amplitude", "frequency",
    "yield_acceleration", "yield_coefficient", "decay_rate", "delta_mu", "minimum_friction", "scale", "pgv",
    "arias_intensity", "time_scale",
)  # fmt: skip

#: Results of a sweep: attributes of the variables.
RESULTS: dict[str, dict[str, Any]] = {
    "permanent_displacement": {
        "units": "m",
        "long_name": "permanent displacement, downslope",
        "ancillary_variables": "validity",
    },
    "peak_relative_velocity": {
        "units": "m s-1",
        "long_name": "largest downslope relative velocity",
        "ancillary_variables": "validity",
    },
    "sliding_mode": {
        "long_name": "sliding mode",
        "flag_values": [int(mode) for mode in SlidingMode if mode is not SlidingMode.MISSING],
        "flag_meanings": " ".join(mode.name.lower() for mode in SlidingMode if mode is not SlidingMode.MISSING),
        "ancillary_variables": "validity",
    },
    "validity": {
        "long_name": "validity flags; 0 = no flag raised (says nothing about lambda or Uy)",
        "flag_masks": [int(flag) for flag in Validity],
        "flag_meanings": " ".join((flag.name or "").lower() for flag in Validity),
    },
    "newmark_displacement": {
        "units": "m",
        "long_name": "permanent displacement of Newmark's block, downslope",
        "ancillary_variables": "validity",
    },
    "yield_acceleration": {"units": "m s-2", "long_name": "yield acceleration"},
    "limiting_acceleration": {"units": "m s-2", "long_name": "limiting acceleration (Eq. 7)"},
    "acceleration_ratio": {"units": "1", "long_name": "peak ground over limiting acceleration"},
    "minimum_friction": {"units": "1", "long_name": "minimum friction coefficient (Eq. 9)"},
    "delta_mu": {"units": "1", "long_name": "friction above static (Eqs. 10, 11)"},
    "decay_rate": {"units": "1", "long_name": "friction decay with loading rate (Eq. 6 at the peak)"},
    # where the displacement amplitude and the frequency span a grid; elsewhere it is a coordinate
    "amplitude": PARAMETERS["amplitude"],
}

#: The target of `limit_amplitude`.
TOLERABLE_DISPLACEMENT: dict[str, Any] = {"units": "m", "long_name": "tolerable permanent displacement"}

#: Results of `limit_amplitude`; sliding mode and validity go with them.
LIMIT_RESULTS: dict[str, dict[str, Any]] = {
    "limit_amplitude": {
        "units": "m s-2",
        "long_name": "smallest peak ground acceleration that reaches the tolerable displacement",
        "ancillary_variables": "limit_status",
    },
    "limit_status": {
        "long_name": "how the limit amplitude was found",
        "flag_values": [int(status) for status in LimitStatus],
        "flag_meanings": " ".join(status.name.lower() for status in LimitStatus),
    },
    "permanent_displacement": {
        "units": "m",
        "long_name": "permanent displacement, downslope, at the limit amplitude",
        "ancillary_variables": "validity",
    },
}

#: Results of a record, beside the displacement, the velocity and the validity: -1 where there is no value.
RECORD_COUNTS: dict[str, dict[str, Any]] = {
    "number_of_slips": {
        "units": "1",
        "long_name": "number of slips that begin at rest",
        "ancillary_variables": "validity",
    },
    "stick_slip_pulses": {
        "units": "1",
        "long_name": "number of pulses in stick-slip mode",
        "ancillary_variables": "validity",
    },
    "continuous_pulses": {
        "units": "1",
        "long_name": "number of pulses in continuous mode",
        "ancillary_variables": "validity",
    },
}

#: Results of a sweep under a record.
RECORD_RESULTS: dict[str, dict[str, Any]] = {
    "permanent_displacement": RESULTS["permanent_displacement"],
    "peak_relative_velocity": RESULTS["peak_relative_velocity"],
    **RECORD_COUNTS,
    "validity": RESULTS["validity"],
    "newmark_displacement": RESULTS["newmark_displacement"],
    "motion_factor": {"units": "1", "long_name": "factor on the recorded acceleration"},
}

#: Intensity measures of a motion as it was recorded (`slipsweep.motion.intensity`).
INTENSITY_MEASURES: dict[str, dict[str, Any]] = {
    "pga": {"units": "m s-2", "long_name": "peak ground acceleration as recorded"},
    "pgv": {"units": "m s-1", "long_name": "peak ground velocity as recorded"},
    "pgd": {"units": "m", "long_name": "peak ground displacement as recorded"},
    "arias_intensity": {"units": "m s-1", "long_name": "Arias intensity as recorded"},
    "cav": {"units": "m s-1", "long_name": "cumulative absolute velocity as recorded"},
    "significant_duration": {"units": "s", "long_name": "significant duration, 5 to 95 % of the Arias intensity"},
    "mean_period": {"units": "s", "long_name": "mean period, 0.25 to 20 Hz"},
}

#: Coordinates of a suite along `motion`, beside it.
MOTION_COORDINATES: dict[str, dict[str, Any]] = {
    "motion_file": {"long_name": "file of the motion"},
    "motion_sha256": {"long_name": "SHA-256 of the file of the motion"},
    "motion_samples": {"units": "1", "long_name": "samples of the motion"},
    "motion_interval": {"units": "s", "long_name": "mean sampling interval of the motion"},
    **{f"motion_{name}": about for name, about in INTENSITY_MEASURES.items()},
}

#: Of them, long texts, that no table repeats in every row: `slipsweep info` and the file itself tell them.
MOTION_FILES = ("motion_file", "motion_sha256")

#: The labels of a suite, along the dimension of their name.
MOTION: dict[str, Any] = {"long_name": "recorded motion"}

#: The record itself, in the files of results: what is read back to repeat a run.
RECORD_SAMPLES: dict[str, dict[str, Any]] = {
    "record_time": {"units": "s", "long_name": "time of a sample of the record"},
    "record_acceleration": {
        "units": "m s-2",
        "long_name": "recorded acceleration of the plane, at scale and polarity 1",
        "coordinates": "record_time",
    },
}

#: Coordinates of the statistics of `sample`, beside the parameters.
STATISTIC_COORDINATES: dict[str, dict[str, Any]] = {
    "quantile": {"units": "1", "long_name": "share of the samples with a value that lies below"},
    "threshold": {"units": "m", "long_name": "displacement to exceed"},
    "mode": {
        "units": "1",
        **{name: RESULTS["sliding_mode"][name] for name in ("long_name", "flag_values", "flag_meanings")},
    },
    "flag": {
        "units": "1",
        "long_name": "flag of the validity",
        "flag_values": [int(flag) for flag in Validity],
        "flag_meanings": RESULTS["validity"]["flag_meanings"],
    },
    "input": {"long_name": "uncertain input; inputs that are correlated are one, with + between them"},
    "bound": {"units": "1", "long_name": "probability below an end of an interval"},
}

#: Statistics of `sample`.  Quantiles and mean are of the samples that have a value; probabilities also count the
#: statically unstable samples, as exceeding every threshold.
STATISTICS: dict[str, dict[str, Any]] = {
    "displacement_quantile": {
        "units": "m",
        "long_name": "quantile of the permanent displacement",
        "ancillary_variables": "valueless_share",
    },
    "mean_displacement": {
        "units": "m",
        "long_name": "mean permanent displacement",
        "ancillary_variables": "valueless_share",
    },
    "exceedance_probability": {
        "units": "1",
        "long_name": "probability that the permanent displacement exceeds a threshold",
        "ancillary_variables": "valueless_share",
    },
    "mode_share": {"units": "1", "long_name": "share of the samples in a sliding mode"},
    "flag_share": {"units": "1", "long_name": "share of the samples with a flag"},
    "valueless_share": {"units": "1", "long_name": "share of the samples without a value"},
    "first_order_index": {
        "units": "1",
        "long_name": "first-order Sobol index of the permanent displacement",
        "ancillary_variables": "sensitivity_status",
    },
    "first_order_interval": {
        "units": "1",
        "long_name": "95 % interval of the first-order Sobol index",
        "ancillary_variables": "sensitivity_status",
    },
    "total_index": {
        "units": "1",
        "long_name": "total Sobol index of the permanent displacement",
        "ancillary_variables": "sensitivity_status",
    },
    "total_interval": {
        "units": "1",
        "long_name": "95 % interval of the total Sobol index",
        "ancillary_variables": "sensitivity_status",
    },
    "sensitivity_status": {
        "long_name": "whether there are Sobol indices, or why there are none",
        "flag_values": [int(status) for status in SensitivityStatus],
        "flag_meanings": " ".join(status.name.lower() for status in SensitivityStatus),
    },
}

#: Statistics over the motions of a suite; all but counts and shares are of the motions that have a value.
SUITE_STATISTICS: dict[str, dict[str, Any]] = {
    "value_count": {"units": "1", "long_name": "number of motions with a value"},
    "valueless_count": {"units": "1", "long_name": "number of motions without a value"},
    "valueless_flag_count": {"units": "1", "long_name": "number of motions without a value that have a flag"},
    "valueless_share": {"units": "1", "long_name": "share of the motions without a value"},
    **{
        name: {"units": units, "long_name": text, "ancillary_variables": "valueless_share"}
        for name, units, text in (
            ("zero_probability", "1", "probability of zero permanent displacement"),
            ("nonzero_median", "m", "median of the non-zero permanent displacements"),
            ("nonzero_geometric_mean", "m", "geometric mean of the non-zero permanent displacements"),
            ("log_standard_deviation", "1", "standard deviation of ln u of the non-zero permanent displacements u"),
            ("displacement_quantile", "m", "quantile of the permanent displacement"),
        )
    },
    "exceedance_probability": STATISTICS["exceedance_probability"],
}

#: The mean annual rate at which a displacement is exceeded, and its parts that lie outside of the grid's amplitudes.
HAZARD_RESULTS: dict[str, dict[str, Any]] = {
    "annual_rate": {
        "units": "year-1",
        "long_name": "mean annual rate of exceeding a permanent displacement",
        "ancillary_variables": "held_rate omitted_rate valueless_share",
    },
    "held_rate": {
        "units": "year-1",
        "long_name": "part of it above the largest amplitude, where the probability is held constant",
    },
    "omitted_rate": {
        "units": "year-1",
        "long_name": "upper bound of the part below the smallest amplitude, where the probability is taken as 0",
    },
    "valueless_share": {"units": "1", "long_name": "largest share of the motions without a value at any amplitude"},
}

#: dtype of each result; everything else is float64.
RESULT_DTYPES: dict[str, str] = {
    "sliding_mode": "int8",
    "half_wave_mode": "int8",
    "validity": "int16",
    "limit_status": "int8",
    "sensitivity_status": "int8",
    **dict.fromkeys(RECORD_COUNTS, "int32"),
}

#: What `sweep` returns when nothing is asked for by name.
DEFAULT_RESULTS = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")
DEFAULT_RECORD_RESULTS = ("permanent_displacement", "peak_relative_velocity", *RECORD_COUNTS, "validity")
DEFAULT_SUITE_RESULTS = (*DEFAULT_RECORD_RESULTS, "motion_factor")

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
    "ground_acceleration": {"units": "m s-2", "long_name": "acceleration of the plane"},
    "block_acceleration": {"units": "m s-2", "long_name": "acceleration of the block"},
    "friction_coefficient": {"units": "1", "long_name": "instantaneous friction coefficient"},
    "relative_velocity": {"units": "m s-1", "long_name": "relative velocity of the block"},
    "relative_displacement": {"units": "m", "long_name": "relative displacement of the block"},
}

#: The positive half waves of the record that a time history is of, along `half_wave`.
HALF_WAVES: dict[str, dict[str, Any]] = {
    "half_wave_start": {"units": "s", "long_name": "time at which the acceleration of the plane rises through zero"},
    "half_wave_end": {"units": "s", "long_name": "time at which it falls through zero"},
    "half_wave_peak": {"units": "m s-2", "long_name": "largest acceleration of the plane between"},
    "half_wave_mode": {
        "long_name": "sliding mode that the peak decides; stuck where it does not exceed the yield acceleration",
        **{name: RESULTS["sliding_mode"][name] for name in ("flag_values", "flag_meanings")},
    },
}

#: What Eq. 1 makes of a test on a shaking table, along time.
MEASURED_FRICTION: dict[str, dict[str, Any]] = {
    "friction_coefficient": {"units": "1", "long_name": "friction coefficient by Eq. 1"},
    "friction_ratio": {"units": "1", "long_name": "friction coefficient by Eq. 1 over the static one"},
}

#: The slides that a test shows.
SLIDES: dict[str, dict[str, Any]] = {
    "slide_onset": {"units": "s", "long_name": "time at which a slide begins"},
    "slide_peak": {"units": "s", "long_name": "time of the largest table acceleration within a slide"},
    "slide_stop": {"units": "s", "long_name": "time at which a slide stops; missing where the record ends before"},
    "onset_acceleration": {"units": "m s-2", "long_name": "acceleration of the table where a slide begins"},
    "peak_acceleration": {"units": "m s-2", "long_name": "largest acceleration of the table within a slide"},
    "peak_block_acceleration": {"units": "m s-2", "long_name": "largest acceleration of the block within a slide"},
    "least_friction": {"units": "1", "long_name": "least friction coefficient by Eq. 1 within a slide"},
}

#: Results of `calibrate` that have no other name here.
CALIBRATION: dict[str, dict[str, Any]] = {
    "correlation": {"units": "1", "long_name": "correlation of two parameters as estimated"},
    "cycle_start": {"units": "s", "long_name": "time at which a cycle begins"},
    "cycle_peak_acceleration": {"units": "m s-2", "long_name": "largest acceleration of the table in a cycle"},
    "cycle_sliding_mode": {
        "long_name": "sliding mode of a cycle",
        **{name: RESULTS["sliding_mode"][name] for name in ("flag_values", "flag_meanings")},
    },
    "cycle_attenuation_coefficient": {"units": "1", "long_name": "attenuation coefficient Kd of a cycle (Eq. 12)"},
    **{
        f"cycle_{name}{suffix}": {
            "units": PARAMETERS[name]["units"],
            "long_name": f"{what}{PARAMETERS[name]['long_name']} from a cycle alone",
        }
        for name in ("yield_acceleration", "decay_rate", "delta_mu")
        for suffix, what in (("", ""), ("_error", "standard error of the "))
    },
}

#: What was measured, and what is computed with the parameters found, along time.
CALIBRATION_SERIES: dict[str, dict[str, Any]] = {
    f"{kind}_{name}": {**about, "long_name": f"{kind} {about['long_name']}"}
    for kind in ("measured", "computed")
    for name, about in HISTORY.items()
}
