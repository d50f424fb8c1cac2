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
    """Sliding mode of a cell (Eq. 7 and the yield acceleration)."""

    MISSING = -1
    STUCK = 0
    STICK_SLIP = 1
    CONTINUOUS = 2


class Validity(IntFlag):
    """What is to be known of a cell's value, or why it has none (`FLAG_KINDS`); 0 means that no flag is raised."""

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
    LimitStatus.REACHED: "the displacement is reached in continuous growth",
    LimitStatus.AT_MODE_JUMP: "it is passed in the jump where the sliding mode changes",
    LimitStatus.AT_JUMP: "it is passed in a jump within one sliding mode",
    LimitStatus.AFTER_GAP: "just below the limit the model gives no value",
    LimitStatus.NOT_REACHED: "not reached up to the maximum amplitude, or before the values end (no limit)",
    LimitStatus.INVALID: "the model gives no value at any amplitude (no limit)",
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
    FlagKind.CAUTION: "an assumption behind the value is broken",
    FlagKind.NOTE: "the value is sound; which rule produced it",
}

#: One line a flag, for people (`slipsweep info`).
VALIDITY_TEXT: dict[Validity, str] = {
    Validity.STATICALLY_UNSTABLE: "yield acceleration <= 0: the block slides under its own weight",
    Validity.UPLIFT: "A tan(theta) >= g: the block loses contact within the cycle",
    Validity.LIMIT_UNDEFINED: "1 - tan(theta) (mu_s - tan(theta)) <= 0: Eq. 7 has no limit",
    Validity.FRICTION_NOT_DECAYING: "calibrated decay rate <= 0 (mu_s xi^2 >= 1)",
    Validity.YIELD_GOVERNS: "Eq. 4 stays below the yield acceleration: with the monotone rise the block slides as "
    "Newmark's, and lambda plays no part",
    Validity.KD_NOT_POSITIVE: "literal rise: Kd <= 0, Eq. 12 cannot stop the block",
    Validity.NOT_RECOUPLED: "does not come to rest within the cycle: Eq. 12 does not hold; displacement unreliable",
    Validity.FLEXIBLE_BLOCK: "0.2 <= f/fs <= 1.3: the rigid-block assumption does not hold",
    Validity.UPSLOPE: "the permanent displacement is negative: the block ends upslope",
    Validity.NEAR_MODE_LIMIT: "0.9 <= xi <= 1.1: at xi = 1 the displacement jumps several times over",
    Validity.FRICTION_ESTIMATED: "lambda by Eq. 6 or delta_mu by Eqs. 10, 11 enters the displacement",
}

#: Dimensions of a result, in order; further ones follow.
DIMENSION_ORDER = (
    "theta",
    "mu_s",
    "amplitude",
    "displacement_amplitude",
    "frequency",
    "yield_acceleration",
    "decay_rate",
    "delta_mu",
    "minimum_friction",
    "structure_frequency",
    "scale",
    "time_scale",
    "polarity",
)

#: Inputs: attributes of their coordinates.
PARAMETERS: dict[str, dict[str, Any]] = {
    "theta": {"units": "degree", "long_name": "plane inclination"},
    "mu_s": {"units": "1", "long_name": "static friction coefficient"},
    "amplitude": {"units": "m s-2", "long_name": "peak ground acceleration"},
    "displacement_amplitude": {"units": "m", "long_name": "peak ground displacement"},
    "frequency": {"units": "Hz", "long_name": "excitation frequency"},
    "yield_acceleration": {"units": "m s-2", "long_name": "yield acceleration"},
    "decay_rate": {"units": "1", "long_name": "friction decay with loading rate"},
    "delta_mu": {"units": "1", "long_name": "friction above static"},
    "minimum_friction": {"units": "1", "long_name": "minimum friction coefficient"},
    "structure_frequency": {"units": "Hz", "long_name": "natural frequency of the structure"},
    "scale": {"units": "1", "long_name": "scale factor of the recorded acceleration"},
    "time_scale": {"units": "1", "long_name": "factor on the time of the record"},
    "polarity": {"units": "1", "long_name": "sign that the recorded acceleration is taken with"},
}

#: Inputs that the shaking has if it is a waveform, and if it is a record.
WAVEFORM_INPUTS = ("amplitude", "displacement_amplitude", "frequency", "structure_frequency")
RECORD_INPUTS = ("amplitude", "scale", "time_scale", "polarity")

#: Inputs that may be drawn: all that the displacement depends on.
DRAWN = (
    "theta", "mu_s", "amplitude", "displacement_amplitude", "frequency",
    "yield_acceleration", "decay_rate", "delta_mu", "minimum_friction", "scale", "time_scale",
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
}

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
}

#: Statistics of `sample`; quantiles, mean and probabilities are of the samples that have a value.
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
}

#: dtype of each result; everything else is float64.
RESULT_DTYPES: dict[str, str] = {
    "sliding_mode": "int8",
    "validity": "int16",
    "limit_status": "int8",
    **dict.fromkeys(RECORD_COUNTS, "int32"),
}

#: What `sweep` returns when nothing is asked for by name.
DEFAULT_RESULTS = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")
DEFAULT_RECORD_RESULTS = ("permanent_displacement", "peak_relative_velocity", *RECORD_COUNTS, "validity")

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
