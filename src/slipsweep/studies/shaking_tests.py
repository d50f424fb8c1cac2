"""The public functions for tests on a shaking table: files, Datasets or DataArrays in, an xarray.Dataset out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.options import Model
from slipsweep.model.parameters import check_numbers, shown
from slipsweep.motion.shaking import CHANNELS, TABLE, ShakingTest, read_test, unit_factor
from slipsweep.studies.calibration import calibration_dataset
from slipsweep.studies.friction import friction_dataset

#: What a caller may give as a test.
Test = str | Path | ShakingTest | xr.Dataset | Mapping[str, xr.DataArray]


def measured_friction(
    test: Test,
    theta: float,
    mu_s: float,
    *,
    g: float = 9.81,
    offset: str | Sequence[str] = (),
    drift: str | Sequence[str] = (),
    rest: tuple[float, float] | None = None,
    threshold: float | None = None,
) -> xr.Dataset:
    """Friction that a test on a shaking table measured, by Eq. 1 and by statics, and the slides in it.

    Eq. 1 of the paper [1]_ gives μ(t) from the accelerations of table and block.  It falls also for a block of constant
    friction.  Statics gives the friction that acts on the block, tan(θ + arctan(Ü/g)).

    Parameters
    ----------
    test : path, Dataset, mapping of str to DataArray, or ShakingTest
        A CSV file whose header names columns and units: ``time (s), table acceleration (g), block acceleration
        (m/s2)``; or a Dataset along `time` (s) with `ground_acceleration` (the table's) and `block_acceleration`,
        in m/s² or in the unit of their attribute `units`.  Samples need not be evenly spaced.
    theta, mu_s : float
        Inclination of the plane, degrees, and static friction coefficient.
    g : float
        Gravity, m/s².
    offset, drift : str or list of str
        Channels to take a constant, or a straight line, off; "all" for all.  What was taken off stands in the
        attribute `removed`.  Nothing else is subtracted.
    rest : (float, float), optional
        From when to when table and block were at rest, s: what is taken off is then fitted to these samples, else
        to all.
    threshold : float, optional
        Relative acceleration beyond which the block slides, m/s²; by default 4 standard deviations of its noise, and
        0.5 % of the table's largest acceleration at least.

    Returns
    -------
    Dataset
        Along `time` (s): `ground_acceleration`, `block_acceleration` (m/s²), `friction_coefficient` μ(t) by Eq. 1,
        `friction_ratio` μ(t)/μs, and `free_body_friction`, at rest the mobilised friction.
        Along `slide`: `slide_onset`, `slide_peak` (of the table's acceleration) and `slide_stop` (s; NaN where the
        record ends before), `onset_acceleration`, `peak_acceleration` and `peak_block_acceleration` (m/s²),
        `least_friction` (Eq. 1) and `slide_free_body_friction`.  `static_friction` and `kinetic_friction` by statics,
        each with ``_interval`` (95 %, along `bound`).  The attributes `threshold` (m/s²) and `threshold_from` say how
        slides were found; `constant_friction` is a sentence if friction is constant by statics where Eq. 1 falls.

    Raises
    ------
    InputError
        A test that cannot be read, without a block acceleration, or a value that no physics allows.

    See Also
    --------
    calibrate : the parameters of the model, from the same test

    References
    ----------
    .. [1] B. C. Mendez, M. P. Romo and E. Botero (2012), "Linearization of rigid body dynamics on frictional interfaces
       under harmonic loading", Soil Dynamics and Earthquake Engineering 32, 152-158,
       https://doi.org/10.1016/j.soildyn.2011.08.007

    Examples
    --------
    >>> import slipsweep
    >>> test = slipsweep.measured_friction("sweeps/data/shaking_test.csv", theta=5, mu_s=0.38)
    >>> test.sizes["slide"]
    8
    >>> test.least_friction.round(2).values
    array([0.07, 0.07, 0.06, 0.08, 0.06, 0.04, 0.06, 0.05])
    """
    return friction_dataset(test_of(test), theta, mu_s, g=g, offset=offset, drift=drift, rest=rest, threshold=threshold)


def calibrate(
    test: Test | Sequence[Test],
    theta: float,
    mu_s: float,
    *,
    model: Model | str = "mendez",
    offset: str | Sequence[str] = (),
    drift: str | Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    cycles: bool = True,
) -> xr.Dataset:
    """Üy, λ and Δμ from tests on a shaking table, by profile likelihood with the exact solver.

    The table's recorded motion shakes the model's block, and what it does is fitted to whatever was measured of the
    real one, each channel weighted by its noise.  The noise of the table's own record enters the intervals.

    Parameters
    ----------
    test : path, Dataset, mapping of str to DataArray, or ShakingTest, or a list of these
        As for `measured_friction`, but of the block any one or more of `block_acceleration` (m/s²), `relative_velocity`
        (m/s) and `relative_displacement` (m), downslope positive; NaN or a blank cell where there is no sample.
        Several tests of one interface are calibrated together.
    theta, mu_s : float
        Inclination of the plane, degrees, and static friction coefficient, measured by other means.
    model : Mendez or str
        The rules of motion.
    offset, drift : str or list of str
        Channels, `ground_acceleration` among them, whose sensor has an offset, or an offset and a drift in a straight
        line; "all" for all.  These are fitted together with the parameters; what was found stands in the attribute
        `removed`.
    noise : mapping of str to float, optional
        Standard deviation of the noise of channels; by default estimated from the residuals.
    cycles : bool
        Whether each cycle is fitted by itself, too.

    Returns
    -------
    Dataset
        `yield_acceleration` (m/s²), `decay_rate` and `delta_mu`, each with ``_error`` (standard error; NaN where it is
        not determined) and ``_interval`` (95 %, along `bound`; 0 and inf where the data set no bound), and their
        `correlation`.  `static_friction` and `kinetic_friction` by statics with intervals.  Along `cycle`:
        ``cycle_`` and the same names, `cycle_start` (s), `cycle_peak_acceleration` (m/s²), `cycle_sliding_mode` and
        `cycle_attenuation_coefficient` (Kd, stick-slip).  Along `time`: ``measured_`` (less `removed`) and
        ``computed_`` accelerations, velocity and displacement, the computed friction, and the measured
        `friction_coefficient` (Eq. 1) and `free_body_friction`.  ``misfit_`` and a channel is the root mean square of
        their difference.  Several tests have a dimension `test` more.  Attributes: `findings`, sentences on what the
        tests do not determine and what would; `constant_friction`, as of `measured_friction`; `model_table` and
        `uncertainty_table`, to paste into a sweep file, commented out if they are not ready for use.

    Raises
    ------
    InputError
        A test that cannot be read or measured nothing of the block, or a value that no physics allows.

    See Also
    --------
    measured_friction : the friction that the test shows, without a model
    sample : displacements with the errors of the parameters

    Examples
    --------
    A test of two cycles without noise, as `simulate` gives it:

    >>> import numpy as np
    >>> import slipsweep
    >>> test = slipsweep.simulate(
    ...     5, 0.38, 5.0, 2.0, yield_acceleration=1.8, decay_rate=2.0, delta_mu=0.1,
    ...     excitation=slipsweep.Sine(cycles=2), times=np.arange(240) * 0.005,
    ... )
    >>> found = slipsweep.calibrate(test, theta=5, mu_s=0.38, cycles=False)
    >>> print(f"{found.yield_acceleration.item():.2f} m/s2, {found.decay_rate.item():.2f}, {found.delta_mu.item():.2f}")
    1.80 m/s2, 2.00, 0.10
    """
    tests = [test_of(one) for one in test] if isinstance(test, list | tuple) else [test_of(test)]
    return calibration_dataset(tests, theta, mu_s, model=model, offset=offset, drift=drift, noise=noise, cycles=cycles)


def test_of(given: Any) -> ShakingTest:
    """The test that a caller gives."""
    if isinstance(given, ShakingTest):
        return given
    if not isinstance(given, (xr.Dataset, Mapping)):
        return read_test(given)
    known = [name for name in CHANNELS if name in given]
    if TABLE not in known:
        raise InputError(f"test: {TABLE}: missing: must be given, along time; there are {shown(list(given))}")
    for name in known:
        if not isinstance(given[name], (xr.DataArray, xr.Variable)):
            raise InputError(f"test: {name} = {shown(given[name])}: must be a DataArray along time")
    arrays = {name: xr.as_variable(given[name]) for name in known}
    times: Any = given["time"] if "time" in given else getattr(given[TABLE], "coords", {}).get("time")
    if times is None:
        raise InputError("test: time: missing: must be a coordinate, s")
    for name, array in arrays.items():
        if array.dims != ("time",):
            raise InputError(f"test: {name}: dimensions {array.dims}: must be ('time',)")
    values = {name: check_numbers(f"test: {name}", array) for name, array in arrays.items()}
    factors = {
        name: unit_factor(f"test: {name}: units", name, str(array.attrs["units"]))
        for name, array in {**arrays, "time": xr.as_variable(times)}.items()
        if "units" in array.attrs
    }
    scaled = {name: factors.get(name, 1.0) * one for name, one in values.items()}
    return ShakingTest(factors.get("time", 1.0) * check_numbers("test: time", times), scaled)
