"""Recorded motions: against closed forms, independent programs, the sine's own solver, and by their
symmetries.
"""

from math import pi, radians, tan
from typing import Any

import numpy as np
import pytest
import xarray as xr
from gmpy2 import mpfr

import slipsweep
from slipsweep import InputError, Record, sweep
from slipsweep.jit.compiling import kernel
from slipsweep.kernels.block import EQ12, MONOTONE, Cell, Options, interface_of
from slipsweep.kernels.eq4 import block_of, eq4_gains
from slipsweep.kernels.slide import SLIDE
from slipsweep.motion.cutting import path_of_record
from slipsweep.motion.paths import Base
from tests.support.block import Interface
from tests.support.cases import choices
from tests.support.digits import workdps
from tests.support.made_up_records import SEEN, band_noise, difference, made
from tests.support.reference import RecordSolution, solve_record
from tests.support.sections import sections_of_record

G = 9.81
RESULTS = ("permanent_displacement", "peak_relative_velocity")
COUNTS = ("number_of_slips", "stick_slip_pulses", "continuous_pulses")
EVERY = (*RESULTS, *COUNTS, "validity")


def sine_record(amplitude: float, frequency: float, cycles: int, samples: int) -> Record:
    times = np.arange(cycles * samples + 1) / (samples * frequency)
    return Record(times, amplitude * np.sin(2 * pi * frequency * times))


def displacement(record: Record, **given: Any) -> float:
    return float(sweep(**choices(**given, excitation=record)).permanent_displacement)


@pytest.fixture(scope="module")
def shaking() -> Record:
    return band_noise()


# ------------------------------------------------------------------------- a linear piece


@kernel
def _followed(
    cell: tuple[float, float, float, float, float, float, float], base: Base, slides: np.ndarray
) -> tuple[float, float]:
    options = Options(MONOTONE, EQ12, 1, True, G)
    block = block_of(Cell(*cell), 1.0, interface_of(Cell(*cell), MONOTONE, G), options)
    piece = base.pieces[0]
    return eq4_gains(block, piece, base.curves[0], piece.begin, piece.finish, slides[0])


def _follow(decay: float, x: float, change: float) -> tuple[float, float]:
    """Gains under Eq. 4 on a record of one piece, a second long."""
    base = path_of_record(Record.sampled([x, x + change], 1.0), 1.0).base
    assert base.pieces.size == 1
    cell = (tan(radians(8.0)), 0.4, 1.0, 1.0, decay, 0.1, 0.1)
    gains: tuple[float, float] = _followed(cell, base, np.zeros(1, SLIDE))
    return gains


def _exact(decay: float, x: float, change: float) -> tuple[mpfr, mpfr]:
    """∫ D and ∫ (1 − t) D over a unit of time, by the reference."""
    with workdps(40):
        g = mpfr(G)
        (section,) = sections_of_record([0, 1], [mpfr(x), mpfr(x) + mpfr(change)])
        interface = Interface(
            g, mpfr(tan(radians(8.0))), mpfr(0.4), mpfr(0.1), mpfr(decay), mpfr(1)
        )

        def rate(ground: mpfr) -> mpfr:
            return interface.relative_acceleration(ground, section.side)

        return section.integrals(rate, section.start, section.end, interface.decay)


#: At the last two λ/g times a change of 3 is 2, where series and closed form meet.
@pytest.mark.parametrize(
    "decay", [0.0, 1e-9, 0.3, 4.0, 60.0, 5e4, 2 / 3 * G * (1 - 1e-13), 2 / 3 * G * (1 + 1e-13)]
)
@pytest.mark.parametrize(
    ("x", "change"),
    [
        (1.0, 3.0),
        (4.0, -3.0),
        (2.0, 1e-7),
        (0.0, 5.0),
        (5.0, -5.0),
        (-1.0, -3.0),
        (-4.0, 4.0),
        (2.0, 0),
    ],
)
def test_integrals_of_eq4_on_a_linear_piece(decay: float, x: float, change: float) -> None:
    """From no decay to a friction that lives in a thousandth of the piece, rising and falling, on
    both sides.
    """
    for gain, exact in zip(_follow(decay, x, change), _exact(decay, x, change), strict=True):
        assert gain == pytest.approx(float(exact), rel=5e-15, abs=5e-15 * G)


# ------------------------------------------------------------------ against other programs


@pytest.mark.filterwarnings("ignore")  # pySLAMMER's own
@pytest.mark.parametrize(
    "name", ["Northridge_1994_PAC-175", "Cape_Mendocino_1992_PET-090", "Duzce_1999_375-090"]
)
def test_newmark_against_pyslammer_on_its_ground_motions(name: str) -> None:
    """pySLAMMER finds onset and stop at samples: with finer samples it comes to this answer.

    Its error falls with the step, and as the square of it where its tolerance of 1e-5 m/s on the
    stop does not show.
    """
    import pyslammer

    g = pyslammer.utilities.G_EARTH
    motion = pyslammer.load_sample_ground_motion(name)
    # a few seconds about the peak: pySLAMMER takes its time
    peak = int(np.argmax(np.abs(motion.accel)))
    values = motion.accel[max(peak - 300, 0) : peak + 300]
    exact = displacement(
        Record.sampled(values * g, motion.dt),
        theta=0.0,
        mu_s=0.3,
        yield_acceleration=0.1 * g,
        model="newmark",
    )
    errors = []
    for parts in (1, 4, 16):
        fine = np.interp(
            np.arange((values.size - 1) * parts + 1) / parts, np.arange(values.size), values
        )
        # rest at the end, for the block to run out
        fine = np.concatenate([fine, np.zeros(100 * parts)])
        analysis = pyslammer.RigidAnalysis(0.1, pyslammer.GroundMotion(fine, motion.dt / parts))
        errors.append(abs(analysis.max_sliding_disp / exact - 1))
    assert exact > 1e-3
    # seen: 0.9 to 3.3 %, then 0.02 to 0.1 %, then 3e-6 to 2e-5
    assert errors[0] < 5e-2
    assert errors[1] < errors[0] / 12
    assert errors[2] < errors[1] / 12


#: Eq. 4 above the yield value for the smaller pulses: b follows it, jumps to it, is held.
MEASURED = {"yield_acceleration": 0.59}
#: The parameters that the paper prints for its stick-slip case.
PRINTED = {"yield_acceleration": 0.59, "decay_rate": 2.7, "delta_mu": 0.09}


def assert_is_reference(record: Record, cell: dict[str, Any], rel: float = 1e-11) -> RecordSolution:
    found = sweep(**choices(**cell, excitation=record))
    expected = solve_record(record.times, record.acceleration, **cell)
    for quantity, value in vars(expected).items():
        assert found[quantity].item() == pytest.approx(float(value), rel=rel), quantity
    return expected


@pytest.mark.filterwarnings("ignore")  # pySLAMMER's own
@pytest.mark.parametrize(
    ("name", "peak", "given", "modes"),
    [
        ("Northridge_1994_PAC-175", 3.0, MEASURED, (3, 0)),
        ("Northridge_1994_PAC-175", 8.0, {}, (2, 1)),
        ("Cape_Mendocino_1992_PET-090", 3.0, MEASURED, (5, 0)),
        ("Cape_Mendocino_1992_PET-090", 8.0, MEASURED, (11, 2)),
        ("Duzce_1999_375-090", 4.0, {}, (3, 0)),
        ("Duzce_1999_375-090", 8.0, MEASURED, (16, 4)),
        ("Kobe_1995_TAK-090", 3.0, MEASURED, (6, 0)),
        ("Kobe_1995_TAK-090", 8.0, {}, (1, 4)),
        ("Kobe_1995_TAK-090", 4.0, PRINTED, (6, 0)),
        ("Kobe_1995_TAK-090", 6.0, PRINTED, (2, 5)),
        ("Kobe_1995_TAK-090", 6.0, {**PRINTED, "rise": "literal"}, (2, 5)),
        ("Northridge_1994_PAC-175", 5.0, {**PRINTED, "rise": "literal"}, (6, 0)),
    ],
)
def test_mendez_on_recorded_motions(
    name: str, peak: float, given: dict[str, Any], modes: tuple[int, int]
) -> None:
    """Five seconds about the largest acceleration, scaled to `peak`, against the reference."""
    import pyslammer

    motion = pyslammer.load_sample_ground_motion(name)
    largest = int(np.argmax(np.abs(motion.accel)))
    half = round(2.5 / motion.dt)
    record = Record.sampled(motion.accel[max(largest - half, 0) : largest + half] * G, motion.dt)
    cell = {
        "theta": 5.0,
        "mu_s": 0.38,
        "scale": peak / float(np.abs(record.acceleration).max()),
        **given,
    }
    expected = assert_is_reference(record, cell)
    assert (expected.stick_slip_pulses, expected.continuous_pulses) == modes
    assert expected.permanent_displacement > 1e-6


def test_a_rise_beyond_a_turn_of_eq4_comes_to_an_end() -> None:
    """A pulse of an earthquake in which the part from a turn of Eq. 4 on ended, by rounding, at
    that turn.
    """
    values = (
        -0.97,
        0.0313594111705,
        0.90939222913,
        1.38378696155,
        1.5104986862,
        1.55004890565,
        1.51117534505,
        1.0644,
    )
    record = Record.sampled([*values, 0.0], 0.005)
    cell = {
        "theta": 0.0,
        "mu_s": 0.3,
        "yield_acceleration": 0.7238795543933454,
        "scale": 0.5414165300481509,
    }
    assert_is_reference(record, cell)


@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_a_block_that_stops_on_a_plateau_slides_again_at_once(recoupling: str) -> None:
    """Held from the peak before, b is above the plateau; at rest there it is c, below it.

    On the rise that follows b goes on from c, not from what it was on the rise to the plateau.
    """
    times = np.array([0.0, 0.04, 0.06, 0.12, 0.14, 0.2])
    values = np.array([5.0, 1.9, 2.1, 2.1, 4.8, 0.0])
    cell: dict[str, Any] = {
        "theta": 15.0,
        "mu_s": 0.4,
        "yield_acceleration": 1.0,
        "recoupling": recoupling,
    }
    expected = assert_is_reference(Record(times, values), cell)
    assert expected.number_of_slips == 2
    finer = np.union1d(times, np.linspace(0.06, 0.12, 38))
    again = Record(finer, np.interp(finer, times, values))
    assert displacement(again, **cell) == pytest.approx(
        float(expected.permanent_displacement), rel=1e-12
    )


@pytest.mark.parametrize("touch", [0.0, -0.0, -1e-12, -1e-300])
def test_a_sample_of_zero_in_a_negative_half_wave_does_not_end_continuous_sliding(
    touch: float,
) -> None:
    """Records rounded to 0.01 m/s² have many samples of exactly 0."""
    cell = {"theta": 2.0, "mu_s": 0.3, "yield_acceleration": 1.0}
    record = Record.sampled([0.0, 6.0, -1.0, touch, -1.0, 6.0, -6.0, 0.0], 0.1)
    expected = assert_is_reference(record, cell)
    assert float(expected.permanent_displacement) == pytest.approx(0.2968, abs=5e-5)


def test_the_largest_velocity_may_be_beyond_the_positive_peak_on_the_negative_side() -> None:
    """D = 0 at Üg = −(g/λ) ln 1.5 = −6.98 m/s², where v turns; the positive peak is 6 m/s²."""
    times = np.array([0.0, 0.05, 0.1, 1.1, 1.15])
    record = Record(times, np.array([0.0, 6.0, 0.0, -10.0, 0.0]))
    cell = {
        "theta": 0.0,
        "mu_s": 0.5,
        "yield_acceleration": 0.1,
        "decay_rate": 0.57,
        "delta_mu": 0.25,
    }
    expected = assert_is_reference(record, cell)
    assert float(expected.peak_relative_velocity) == pytest.approx(0.6694, abs=5e-5)


def test_zero_over_an_interval_ends_continuous_sliding() -> None:
    """From there on Eq. 12 brakes the block, though the base's acceleration is negative again."""
    cell = {"theta": 2.0, "mu_s": 0.3, "yield_acceleration": 1.0}
    after = [-1.0, 0.0, 0.0, 0.0]
    short, long = (
        assert_is_reference(Record.sampled([0.0, 6.0, -1.0, 0.0, 0.0, *then], 0.1), cell)
        for then in ([0.0, 0.0, 0.0, 0.0], after)
    )
    assert float(short.permanent_displacement) == float(long.permanent_displacement) > 0.0


@pytest.mark.parametrize("seed", range(0, 200, 50))
def test_mendez_on_made_up_records(seed: int) -> None:
    """Plateaus, zeros touched, records that begin and end anywhere, all options;
    ``benchmarks.agreement`` has more.
    """
    apart = {one: difference(made(one)) for one in range(seed, seed + 50)}
    assert max(apart.values()) < SEEN, max(apart, key=lambda one: apart[one])


# ---------------------------------------------------------------- against the sine's solver


@pytest.mark.parametrize(
    ("options", "cell"),
    [
        ({"model": "newmark"}, (10.0, 0.5, 4.0, 1.0)),
        ({}, (5.0, 0.38, 6.0, 1.0)),
        ({}, (8.0, 0.3, 2.2, 1.0)),
        ({"recoupling": "integrate"}, (5.0, 0.38, 6.0, 1.0)),
        ({"rise": "literal"}, (5.0, 0.38, 6.0, 1.0)),
        ({"yield_acceleration": 0.59}, (5.0, 0.38, 3.55, 1.8)),
        ({"yield_acceleration": 0.59, "decay_rate": 2.7}, (5.0, 0.38, 3.55, 1.8)),
    ],
)
def test_finely_sampled_sine(
    options: dict[str, Any], cell: tuple[float, float, float, float]
) -> None:
    """Straight lines lie under a sine by up to h²/8: the response to them differs in
    second order.
    """
    theta, mu_s, amplitude, frequency = cell
    sine = slipsweep.sweep(theta, mu_s, amplitude, frequency, **choices(cycles=3, **options))
    records = [sine_record(amplitude, frequency, 3, samples) for samples in (250, 4000)]
    found = [sweep(theta, mu_s, **choices(**options, excitation=record)) for record in records]
    for name in RESULTS:
        errors = [abs(float(result[name] / sine[name]) - 1) for result in found]
        assert errors[0] < 1e-3
        assert errors[1] < errors[0] / 150, f"{name}: 16 times the samples, 256 times less"


@pytest.mark.parametrize(
    ("options", "cell"),
    [
        ({"model": "newmark"}, (10.0, 0.5, 6.0, 1.0)),
        ({}, (8.0, 0.3, 2.9, 1.0)),
        ({"yield_acceleration": 0.59, "decay_rate": 2.7, "delta_mu": 0.09}, (5.0, 0.38, 3.55, 1.8)),
        ({"yield_acceleration": 0.59, "recoupling": "integrate"}, (5.0, 0.38, 3.55, 1.8)),
        (
            {"yield_acceleration": 0.59, "decay_rate": 2.7, "rise": "literal"},
            (5.0, 0.38, 3.55, 1.8),
        ),
    ],
)
def test_a_triangle_is_its_own_record(
    options: dict[str, Any], cell: tuple[float, float, float, float]
) -> None:
    """A wave of straight lines is a record of its corners: two ways through other pieces to one
    answer.
    """
    theta, mu_s, amplitude, frequency = cell
    wave = slipsweep.sweep(
        theta, mu_s, amplitude, frequency, **choices(cycles=3, waveform="triangle", **options)
    )
    times = np.arange(13) / (4 * frequency)
    record = Record(times, amplitude * np.array([0.0, *[1.0, 0.0, -1.0, 0.0] * 3]))
    result = sweep(theta, mu_s, **choices(**options, excitation=record))
    assert float(wave.permanent_displacement) > 1e-4
    for name in (*RESULTS, "validity"):
        assert float(result[name]) == pytest.approx(float(wave[name]), rel=3e-13), name


def test_modes_alternate_between_pulses() -> None:
    """A pulse in each mode and one below yield, at rest between them: the sum of what each does
    alone.
    """
    theta = 5.0
    mu_s = 0.4
    limit = float(slipsweep.friction_parameters(theta, mu_s, 5.0).limiting_acceleration)
    shape = np.array([0.0, 1.0, 0.0, -0.5, 0.0, 0.0])
    peaks = [0.8 * limit, 1.2 * limit, 1.0]
    alone = [Record(np.array([0.0, 0.1, 0.2, 0.3, 0.4, 9.9]), peak * shape) for peak in peaks]
    together = Record(
        np.concatenate([record.times + 10.0 * i for i, record in enumerate(alone)]),
        np.concatenate([record.acceleration for record in alone]),
    )
    results = [sweep(theta, mu_s, excitation=record) for record in (*alone, together)]
    counts = [[int(result[name]) for name in COUNTS[1:]] for result in results]
    assert counts == [[1, 0], [0, 1], [0, 0], [1, 1]]
    moved = [float(result.permanent_displacement) for result in results]
    assert moved[0] > 0
    assert moved[1] != 0
    assert moved[2] == 0
    assert moved[3] == pytest.approx(sum(moved[:3]), rel=1e-12)


# ------------------------------------------------------------------------------- symmetries

MODELS = pytest.mark.parametrize(
    "options", [{"model": "newmark"}, {}, {"recoupling": "integrate"}, {"rise": "literal"}], ids=str
)


@MODELS
def test_time_scale_and_polarity(shaking: Record, options: dict[str, Any]) -> None:
    grid = {
        "theta": [0.0, 5.0, 10.0],
        "mu_s": [0.3, 0.4, 0.5],
        "scale": [0.5, 1.0, 1.5],
        **choices(**options),
    }
    swept = sweep(time_scale=[1.0, 1.7], polarity="both", **grid, excitation=shaking)
    for sign in (1, -1):
        direct = sweep(**grid, excitation=Record(1.7 * shaking.times, sign * shaking.acceleration))
        part = swept.sel(time_scale=1.7, polarity=sign)
        for name in EVERY:
            np.testing.assert_allclose(
                part[name], direct[name], rtol=2e-11, atol=1e-14, err_msg=name
            )
    longer = swept.sel(time_scale=1.7)
    as_recorded = swept.sel(time_scale=1.0)
    assert (as_recorded.permanent_displacement > 0).any()
    for name, power in (("permanent_displacement", 2), ("peak_relative_velocity", 1)):
        np.testing.assert_allclose(
            longer[name], 1.7**power * as_recorded[name], rtol=1e-15, err_msg=name
        )


@pytest.mark.parametrize("step", [0.0, 0.25])
def test_a_sweep_is_what_a_history_ends_with(shaking: Record, step: float) -> None:
    """A history goes by the general rules through all pulses, a sweep by one loop through most;
    steps make plateaus.
    """
    rng = np.random.default_rng(3)
    record = (
        Record(shaking.times, np.round(shaking.acceleration / step) * step) if step else shaking
    )
    for _ in range(10):
        theta = rng.uniform(0.0, 20.0)
        onset = rng.uniform(0.1, 3.0)
        scale = rng.uniform(0.3, 2.0)
        cell = {
            "theta": theta,
            "mu_s": tan(radians(theta)) + rng.uniform(0.05, 0.5),
            "yield_acceleration": onset,
        }
        swept = sweep(**choices(**cell, excitation=record, scale=scale))
        history = slipsweep.simulate(
            **choices(**cell, excitation=record, scale=scale, times=[0.0, 1e4])
        )
        np.testing.assert_allclose(
            swept.permanent_displacement,
            history.relative_displacement[-1],
            rtol=1e-11,
            err_msg=str((cell, scale)),
        )


@MODELS
def test_amplitude_is_the_peak_that_the_record_is_scaled_to(
    shaking: Record, options: dict[str, Any]
) -> None:
    """The same bits as under the scale, amplitude over the record's own peak, whichever sign that
    has.
    """
    amplitude = np.array([0.5, 2.0, 4.5])
    for record in (shaking, Record(shaking.times, -2.5 * shaking.acceleration)):
        peak = np.abs(record.acceleration).max()
        block: dict[str, Any] = {
            "theta": 5.0,
            "mu_s": 0.4,
            "time_scale": 1.5,
            "polarity": "both",
            **choices(**options),
        }
        scaled = sweep(**block, scale=amplitude / peak, excitation=record)
        found = sweep(**block, amplitude=amplitude, excitation=record)
        assert found.permanent_displacement.dims == ("amplitude", "polarity")
        assert "scale" not in found.coords
        # as printed, Eq. 4 leaves these blocks at rest or Eq. 12 without braking
        assert (found.permanent_displacement > 0).any() or "rise" in options
        np.testing.assert_array_equal(found.amplitude, amplitude)
        for name in EVERY:
            np.testing.assert_array_equal(found[name], scaled[name], err_msg=name)


def test_the_block_slides_once_the_peak_passes_the_yield_acceleration(shaking: Record) -> None:
    """Whatever the record: amplitude is the largest acceleration that comes."""
    sign = 1 if shaking.acceleration.max() > -shaking.acceleration.min() else -1
    for onset in (0.3, 2.0):
        amplitude = onset * np.array([1 - 1e-9, 1 + 1e-6])
        slides = sweep(
            5.0,
            0.6,
            amplitude,
            yield_acceleration=onset,
            polarity=sign,
            excitation=shaking,
            model="newmark",
        ).number_of_slips
        assert slides.values.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"amplitude": 1.0, "scale": 1.0}, "amplitude, scale: must not both be given"),
        ({"amplitude": -1.0}, "amplitude = -1: must be a finite number >= 0"),
        (
            {"frequency": 1.0},
            "frequency: not allowed with a Record, "
            "which takes amplitude, scale, pgv, arias_intensity",
        ),
        ({"displacement_amplitude": 1.0}, "displacement_amplitude: not allowed with a Record"),
        ({"structure_frequency": 1.0}, "structure_frequency: not allowed with a Record"),
    ],
)
def test_what_does_not_go_with_a_record(
    shaking: Record, given: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as error:
        sweep(5.0, 0.4, **given, excitation=shaking)
    assert str(error.value).startswith(message)


def test_what_goes_with_a_record_only() -> None:
    for name in ("scale", "time_scale", "polarity"):
        with pytest.raises(
            InputError, match=f"{name}: not allowed with a waveform, which takes amplitude"
        ):
            sweep(5.0, 0.4, 3.0, 1.0, **{name: 1})  # type: ignore[arg-type]


def test_a_record_without_acceleration_has_no_scale() -> None:
    still = Record(np.arange(3.0), np.zeros(3))
    with pytest.raises(
        InputError, match="amplitude: record has no acceleration to scale; give scale"
    ):
        sweep(5.0, 0.4, 1.0, excitation=still)
    assert sweep(5.0, 0.4, scale=1.0, excitation=still).permanent_displacement.item() == 0.0


@MODELS
def test_samples_added_on_the_lines_change_nothing(
    shaking: Record, options: dict[str, Any]
) -> None:
    middle = 0.5 * (shaking.times[1:] + shaking.times[:-1])
    times = np.sort(np.concatenate([shaking.times, middle]))
    finer = Record(times, np.interp(times, shaking.times, shaking.acceleration))
    grid = {"theta": [0.0, 6.0], "mu_s": [0.3, 0.45], "scale": [0.6, 1.4], **choices(**options)}
    one = sweep(**grid, excitation=shaking)
    two = sweep(**grid, excitation=finer)
    for name in EVERY:
        np.testing.assert_allclose(one[name], two[name], rtol=1e-9, atol=1e-13, err_msg=name)


def test_mendez_held_at_yield_is_newmark(shaking: Record) -> None:
    """Where Eq. 4 asks for nothing above Üy and recoupling is integrated, the two models are one
    block.
    """
    theta = 5.0
    mu_s = 0.5
    onset = float(slipsweep.friction_parameters(theta, mu_s, 1.0).yield_acceleration)
    scale = 1.05 * onset / float(shaking.acceleration.max())
    mendez = sweep(
        theta, mu_s, scale=scale, excitation=shaking, model=slipsweep.Mendez(recoupling="integrate")
    )
    newmark = sweep(theta, mu_s, scale=scale, excitation=shaking, model="newmark")
    assert float(newmark.permanent_displacement) > 0
    for name in (*RESULTS, *COUNTS):
        np.testing.assert_allclose(mendez[name], newmark[name], rtol=1e-12, err_msg=name)
    assert (int(mendez.validity), int(newmark.validity)) == (slipsweep.Validity.YIELD_GOVERNS, 0)


def test_only_an_acceleration_up_the_slope_lifts_the_block() -> None:
    """n = g + Üg tan θ ≤ 0: a peak beyond g / tan θ in the other direction has a value, that of the
    reference.
    """
    record = Record.sampled([0.0, 0.0, 30.0, 0.0], 0.05)
    cell = {"theta": 20.0, "mu_s": 0.6}
    assert assert_is_reference(record, cell).continuous_pulses == 1
    assert (
        int(sweep(20.0, 0.6, excitation=record, polarity=-1).validity) == slipsweep.Validity.UPLIFT
    )


def test_dimensions(shaking: Record) -> None:
    theta = xr.DataArray([0.0, 5.0], dims="case", coords={"case": ["a", "b"]})
    axes: dict[str, Any] = {
        "mu_s": [0.3, 0.4, 0.5],
        "scale": [0.5, 1.0, 1.5, 2.0],
        "time_scale": [1.0],
    }
    result = sweep(theta, **axes, polarity="both", excitation=shaking, model="newmark")
    assert dict(result.sizes) == {"mu_s": 3, "case": 2, "scale": 4, "time_scale": 1, "polarity": 2}
    one = sweep(5.0, 0.4, scale=1.5, polarity=-1, excitation=shaking, model="newmark")
    picked = result.sel(mu_s=0.4, scale=1.5, time_scale=1.0, polarity=-1, case="b")
    assert float(picked.permanent_displacement) == float(one.permanent_displacement)


@pytest.mark.parametrize("sliding", ["downslope", "both"])
def test_newmark_at_a_sample_that_is_the_yield_acceleration(sliding: Any) -> None:
    """Üy is a sample, or differs from it in the last bits: the block slides on as if
    it were not.
    """
    rng = np.random.default_rng(3)
    samples = np.concatenate([[0.0], rng.normal(size=150), [0.0]])
    record = slipsweep.Record.sampled(samples, 0.02)
    for sample in np.abs(samples[1:-1]):
        onsets = sample * (1.0 + np.arange(-4, 5) * 2.0**-52)
        found = slipsweep.sweep(
            0.0,
            0.3,
            scale=1.0,
            yield_acceleration=onsets,
            excitation=record,
            model=slipsweep.Newmark(sliding=sliding),
        ).permanent_displacement
        assert float(np.ptp(found.values)) < 1e-12
