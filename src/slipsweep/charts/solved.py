"""What charts compute on their slice, and what a run warns of: thresholds, other options, trends that no block has."""

import math
from collections.abc import Hashable, Iterable
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.model.options import (
    MODELS,
    SOLVERS,
    Mendez,
    Model,
    Newmark,
    changing_strength,
    slides_both_ways,
)
from slipsweep.model.variables import (
    PARAMETERS,
    RECORD_INPUTS,
    SIGNED,
    STRENGTH_INPUTS,
    STRENGTHS,
    VALUELESS,
    WAVEFORM_INPUTS,
    SlidingMode,
    Validity,
    has_signed_displacements,
)
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, peak_acceleration
from slipsweep.studies.datasets import friction_parameters, sweep
from slipsweep.studies.result_counts import Tally
from slipsweep.studies.upslope import sliding_ways, upslope_yield_acceleration

#: Amplitudes of a motion.
DRIVES = ("amplitude", "displacement_amplitude")

DISPLACEMENT = "permanent_displacement"

#: Most cells of a result that are looked at for what is unsound, and of one whose cells take ten
#: times as long or more: by steps, or under another waveform than a sine.
_LOOKED_AT = 250_000
_LOOKED_AT_OTHERS = 25_000

_BLOCK = ("theta", "mu_s", "yield_acceleration")

#: Coordinates that decide which way a block slides.
_DRIVING = (*_BLOCK, *DRIVES, *STRENGTHS[1:], "time_scale", "polarity", "azimuth", "motion")

#: Attribute of a slice whose displacements have lost their signs: the share that ends upslope.
UPSLOPE_SHARE = "share_upslope"

#: Flags of values that are unreliable, left out unless requested, and what captions say of them.
LEFT_OUT = {
    Validity.NOT_RECOUPLED: "not_recoupled (does not come to rest within the cycle)",
    Validity.UPSLOPE: "upslope (ends above where it began)",
}


#: What is said of cells whose block would also slide upslope.
SLIDES_BACK = (
    "the base's acceleration also exceeds the upslope yield acceleration: the displacement is too "
    'large; sliding = "both" of [model] friction = "newmark" includes sliding back'
)


def is_recorded(data: xr.Dataset) -> bool:
    """Return True if a result is of recorded motions."""
    return not {"record", "suite"}.isdisjoint(data.attrs)


def is_newmark(data: xr.Dataset) -> bool:
    """Return True if a result is of Newmark's block."""
    return bool(data.attrs["model"] == "newmark")


def by_magnitude(data: xr.Dataset) -> xr.Dataset:
    """Return a slice with |u| in place of u, and the share that ends upslope, if u has signs."""
    if not has_signed_displacements(data.attrs):
        return data
    share = {}
    if DISPLACEMENT in data:
        moved = data[DISPLACEMENT]
        sliding = max(int((moved.fillna(0.0) != 0.0).sum()), 1)
        share = {UPSLOPE_SHARE: int((moved < 0.0).sum()) / sliding}
    magnitudes = {
        name: abs(data[name]).assign_attrs(data[name].attrs) for name in SIGNED if name in data
    }
    return data.assign(magnitudes).assign_attrs(share)


def solve(
    data: xr.Dataset,
    names: Iterable[str],
    model: Model | None = None,
    motion: Any = None,
    **changed: Any,
) -> xr.Dataset:
    """Solve the cells of a slice as its result was, or by another model or parameters; None: the model's estimate."""
    chosen = model or MODELS.from_attributes(data.attrs)
    block: tuple[str, ...] = _BLOCK
    if "yield_coefficient" in data.coords:
        block = ("yield_coefficient",)
    if slides_both_ways(chosen):
        block += ("theta", "upslope_yield_acceleration")
    friction: tuple[str, ...] = ()
    if isinstance(chosen, Mendez):
        friction = ("decay_rate", "delta_mu", "minimum_friction")
    friction += STRENGTH_INPUTS.get(changing_strength(chosen) or "", ())
    wanted = (*block, *friction, *WAVEFORM_INPUTS, *RECORD_INPUTS[1:])
    given = {name: _bare(data[name]) for name in wanted if name in data.coords} | changed
    if given.get("displacement_amplitude") is not None:
        given["amplitude"] = None
    return sweep(
        **given,
        model=chosen,
        excitation=motion or WAVEFORMS.from_attributes(data.attrs),
        solver=SOLVERS.from_attributes(data.attrs)
        if SOLVERS.attribute in data.attrs
        else SOLVERS.default,
        variables=list(names),
    )


def _bare(array: xr.DataArray) -> Any:
    """Values along their dimensions, as the public functions take them."""
    return array.astype(np.float64).reset_coords(drop=True)


def with_amplitude(data: xr.Dataset) -> xr.Dataset:
    """The same with A = ω²d where the file has d instead: files do not hold A where d and f span a grid."""
    if "amplitude" in data.coords or not {"displacement_amplitude", "frequency"} <= {*data.coords}:
        return data
    found = xr.apply_ufunc(peak_acceleration, data["displacement_amplitude"], data["frequency"])
    return data.assign_coords(amplitude=found.assign_attrs(PARAMETERS["amplitude"]))


def thresholds(data: xr.Dataset, always: bool = False) -> xr.Dataset:
    """Accelerations of yield and of the mode limit (Eq. 7) of a slice, m/s², along the dimensions they depend on.

    ``yield_line`` and, but for Newmark's block where not `always`, ``limit_line``; NaN where the
    block slides under its own weight.  None for a record: each of its pulses has its own peak.  For
    a block that slides both ways ``yield_line`` is the smaller of Üy and Üy,up, and there are also
    ``downslope_line``, Üy, and ``upslope_line``, −Üy,up.
    """
    if is_recorded(data) and "half_wave_peak" not in data:
        return xr.Dataset()
    lines = boundaries(data, always)
    return lines.drop_vars("rest_angle").where(lines["rest_angle"] > 0)


def boundaries(data: xr.Dataset, always: bool = False) -> xr.Dataset:
    """As `thresholds`, also where the block slides under its own weight, and ``rest_angle``, degrees.

    The angle, arctan(Üy/g), is by how much the base may be steeper before the block slides under
    its own weight: φ − θ with Coulomb's Üy.  Between cells on either side of this limit, where the
    angle is 0, the other two go on smoothly.
    """
    g = float(data.attrs["g"])
    lines = {}
    if "yield_coefficient" in data.coords:
        onset = data["yield_coefficient"] * g
    else:
        given = {name: _bare(data[name]) for name in _BLOCK if name in data.coords}
        # neither depends on the amplitude, nor on what it is taken for otherwise
        found = friction_parameters(
            amplitude=0.0, delta_mu=0.0, decay_rate=0.0, model=Mendez(g=g), **given
        )
        onset = found["yield_acceleration"]
        if always or not is_newmark(data):
            undefined = has_flags(found["validity"], Validity.LIMIT_UNDEFINED)
            lines["limit_line"] = found["limiting_acceleration"].where(~undefined)
    lines["yield_line"] = onset
    if has_signed_displacements(data.attrs):
        upslope = _upslope_onset(data, onset)
        lines["yield_line"] = xr.apply_ufunc(np.minimum, onset.reset_coords(drop=True), upslope)
        lines["downslope_line"] = onset
        lines["upslope_line"] = -upslope
    lines["rest_angle"] = xr.apply_ufunc(lambda ratio: np.degrees(np.arctan(ratio)), onset / g)
    return xr.Dataset(lines).reset_coords(drop=True)


def _upslope_onset(data: xr.Dataset, onset: xr.DataArray) -> xr.DataArray:
    """Return Üy,up of a block that slides both ways: as given, or by statics from Üy."""
    if "upslope_yield_acceleration" in data.coords:
        given: xr.DataArray = _bare(data["upslope_yield_acceleration"])
        return given
    return upslope_yield_acceleration(onset, _bare(data["theta"]), float(data.attrs["g"]))


def newmark(data: xr.Dataset) -> xr.DataArray | None:
    """Permanent displacement of Newmark's block on the cells of a slice: the file's, or solved but of records."""
    if "newmark_displacement" in data or is_recorded(data):
        return data.get("newmark_displacement")
    return solve(data, [DISPLACEMENT], Newmark(g=float(data.attrs["g"])))[DISPLACEMENT]


def has_flags(validity: xr.DataArray, flags: int) -> xr.DataArray:
    """Return True where any of some flags is set."""
    return (validity.fillna(0).astype(np.int64) & int(flags)) != 0


def reliable(results: xr.Dataset, name: str, show_cautions: bool = False) -> xr.DataArray:
    """A result as it may be drawn: NaN where it is upslope, or left out for its flags, or without any."""
    values = results[name]
    shown = values >= 0
    if "validity" in results and not show_cautions:
        flags = results["validity"]
        shown = shown & flags.notnull() & ~has_flags(flags, sum(LEFT_OUT))
    return values.where(shown).transpose(*values.dims)


def unsound(
    data: xr.Dataset, drawn: xr.DataArray, theirs: xr.DataArray | None
) -> tuple[xr.DataArray, str]:
    """Where the displacements `drawn` of a slice have a trend that no block has, and the trends and shares in words.

    One is smaller than at an amplitude that is 1 % smaller, which is solved for each cell, of
    recorded motions than at the next smaller amplitude of the slice; or it is less than half of
    that of Newmark's block, `theirs`.
    """
    ours = data[DISPLACEMENT]
    drive = next(
        (name for name in ("displacement_amplitude", *STRENGTHS) if name in data.coords), ""
    )
    if is_recorded(data):
        before = ours.shift({drive: 1}) if drive in ours.dims else ours
    else:
        # without the coordinate, by which the cells would not be the same
        before = solve(data, [DISPLACEMENT], **{drive: _bare(data[drive] * 0.99)})[
            DISPLACEMENT
        ].drop_vars(drive)
    trends = {"falls with A": ours < before * (1 - 1e-9)}  # less is rounding
    if theirs is not None:
        trends["lies below half of Newmark's"] = ours < 0.5 * theirs
    slides = drawn > 0
    cells = xr.zeros_like(drawn, bool)
    parts = []
    for text, trend in trends.items():
        cells = cells | (found := trend & slides)
        parts += (
            [f"{text} in {percent(int(found.sum()) / int(slides.sum()))}"] if found.any() else []
        )
    text = (
        f"the displacement {' and '.join(parts)} of the sliding cells, a trend that no block has"
        if parts
        else ""
    )
    return cells.transpose(*drawn.dims), text


def unsound_texts(results: xr.Dataset) -> list[str]:
    """What a design must not rest on: trends that no block has, and continuous sliding with estimated friction.

    Of many cells some are counted, evenly spaced, which is said; of results that say neither,
    nothing is said.
    """
    drives = {*STRENGTHS, "displacement_amplitude"}
    if DISPLACEMENT not in results or drives.isdisjoint(results.coords) or is_newmark(results):
        return []
    how = (results.attrs.get("waveform"), results.attrs.get(SOLVERS.attribute, "cycle"))
    others = not is_recorded(results) and how != ("sine", "cycle")
    most = _LOOKED_AT_OTHERS if others else _LOOKED_AT
    some, counted = _counted(results, results[DISPLACEMENT].dims, most)
    some = some.load()
    drawn = reliable(some, DISPLACEMENT)
    texts = [unsound(some.assign({DISPLACEMENT: drawn}), drawn, newmark(some))[1]]
    if {"sliding_mode", "validity"} <= {*some}:
        texts.append(estimated(some, drawn, some["sliding_mode"] == SlidingMode.CONTINUOUS))
    return [text + counted for text in texts if text]


def _counted(results: xr.Dataset, dims: Iterable[Hashable], most: int) -> tuple[xr.Dataset, str]:
    """Results of at most so many cells along dimensions, and what to say of it if these are not all."""
    sizes = {dim: results.sizes[dim] for dim in dims}
    some = results
    while math.prod(sizes.values()) > most:
        longest = max(sizes, key=lambda dim: sizes[dim])
        some = some.isel({longest: slice(1, None, 2)})
        sizes[longest] = some.sizes[longest]
    cells = math.prod(sizes.values())
    return some, "" if some is results else f" (counted in {cells} cells, evenly spaced)"


def slides_back_text(results: xr.Dataset, motion: Record | Suite | None = None) -> str:
    """The share of the sliding cells whose block would also slide upslope, in words; empty if there are none.

    It follows from the coordinates: no result is read.
    """
    there = [name for name in _DRIVING if name in results.coords]
    if DISPLACEMENT not in results or {*DRIVES, *STRENGTHS}.isdisjoint(there):
        return ""
    if "displacement_amplitude" in there:
        there.append("frequency")
    dims = dict.fromkeys(dim for name in there for dim in results[name].dims)
    unread = results.drop_vars({*results.data_vars} - {"ground_acceleration"})
    some, counted = _counted(unread, dims, _LOOKED_AT)
    ways = sliding_ways(some, motion)
    if ways is None or not (ways[0] & ways[1]).any():
        return ""
    share = float((ways[0] & ways[1]).mean() / ways[0].mean())
    cells = f"in {percent(share)} of the sliding cells " if dims else ""
    return f"{cells}{SLIDES_BACK}{counted}"


def estimated(data: xr.Dataset, drawn: xr.DataArray, continuous: xr.DataArray) -> str:
    """The share of the sliding cells that slide continuously with estimated friction, in words (docs/trust.md)."""
    slides = drawn > 0
    cells = slides & continuous & has_flags(data["validity"], Validity.FRICTION_ESTIMATED)
    if not cells.any():
        return ""
    share = percent(int(cells.sum()) / int(slides.sum()))
    return (
        f"{share} of the sliding cells slide continuously with estimated friction: not for design"
    )


def why_nothing_slides(data: xr.Dataset, tally: Tally) -> str:
    """The likely reason why every cell of a sweep is stuck or has no value; empty where one slides."""
    modes = tally.modes or {}
    coords = data.coords
    if not modes or modes[SlidingMode.STICK_SLIP] + modes[SlidingMode.CONTINUOUS]:
        return ""
    if not modes[SlidingMode.STUCK]:
        flags = {flag: count for flag, count in (tally.flags or {}).items() if flag in VALUELESS}
        why = (
            max(flags, key=lambda flag: flags[flag]).text
            if flags
            else "validity is not among the variables"
        )
        mu_s = float(coords["mu_s"].min()) if "mu_s" in coords else 0.0
        is_angle = mu_s > 3.0 and "phi" not in coords
        return f"no cell has a value: {why}" + (
            f"; did you mean phi = {mu_s:.6g}?" if is_angle else ""
        )
    g = float(data.attrs["g"])
    smallest = {
        name: float(coords[name].min()) for name in ("yield_acceleration", "mu_s") if name in coords
    }
    if "mu_s" in smallest and "theta" in coords:
        coulomb = g * math.tan(math.atan(smallest["mu_s"]) - math.radians(coords["theta"].max()))
        smallest.setdefault("yield_acceleration", coulomb)
    if "amplitude" not in coords or "yield_acceleration" not in smallest:
        return "no cell slides"
    least = smallest["yield_acceleration"]
    largest = float(coords["amplitude"].max())
    hint = '; did you mean units = "g"?' if largest <= 3.0 and largest * g > least else ""
    texts = (f"{one:.6g} m/s2 ({one / g:.4g} g)" for one in (largest, least))
    return (
        "no cell slides: largest amplitude {}, smallest yield acceleration {}".format(*texts) + hint
    )


def percent(share: float) -> str:
    """A share in percent, in two digits or 100."""
    return f"{float(f'{100 * share:.2g}'):g} %"
