"""Tables and summaries that commands print have the numbers of Python's functions, in units."""

import re
from pathlib import Path

import numpy as np
import pytest

import slipsweep
from slipsweep.model.variables import LimitStatus, SlidingMode, Validity
from tests.support.commands import command
from tests.support.made_up_records import write_motion

G = 9.81

SWEEP = """
[axes]
theta.values = [0, 14, 30]
mu_s.values = [0.25, 0.5]
amplitude = {start = 0.1, stop = 1.2, num = 12, units = "g"}
frequency.values = [0.5, 2]
[excitation]
cycles = 15
[output]
variables = ["permanent_displacement", "newmark_displacement", "sliding_mode", "validity"]
"""

SUITE = """
[model]
friction = "newmark"
[axes]
yield_coefficient.values = [0.02, 0.05]
amplitude.values = [0.2, 0.6, 2, 6]
[excitation]
records = ["motions/*.csv"]
units = "g"
polarity = "both"
"""

CURVE = "PGA (g),annual rate\n0.01,0.1\n0.1,0.01\n0.4,0.0008\n1.0,0.00005\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a sweep and of a suite, and what `run` printed of them."""
    path = tmp_path_factory.mktemp("tables")
    (path / "motions").mkdir()
    for number, (count, interval) in enumerate(((150, 0.01), (80, 0.02), (200, 0.005)), 1):
        write_motion(path / "motions" / f"m{number}.csv", number, count, interval)
    (path / "hazard.csv").write_text(CURVE)
    for name, text in (("sweep", SWEEP), ("suite", SUITE)):
        (path / f"{name}.toml").write_text(text)
        done = command(path, "run", f"{name}.toml")
        assert (done.returncode, done.stderr) == (0, "")
        (path / f"{name}.txt").write_text(done.stdout)
    return path


def printed(folder: Path, *arguments: object) -> str:
    done = command(folder, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def table(text: str, heading: str, count: int, skipped: int = 0) -> tuple[str, list[list[str]]]:
    """The line that has a heading, and the words of so many lines under it."""
    lines = text.splitlines()
    at = next(at for at, line in enumerate(lines) if heading in line)
    first = at + 1 + skipped
    return lines[at], [line.split() for line in lines[first : first + count]]


def numbers(words: list[str]) -> list[float]:
    """Numbers of a row; what stands for no value is NaN."""
    texts = (word.removesuffix("%") for word in words)
    return [float("nan") if text in ("-", "none") else float(text) for text in texts]


def share(text: str, name: str) -> float:
    """The percentage behind a name at the beginning of a line."""
    match = re.search(rf"^ *{name} +([\d.]+)%", text, re.MULTILINE)
    assert match, name
    return float(match[1]) / 100.0


# ---------------------------------------------------------------------------------- sweeps


@pytest.mark.parametrize("source", ["run", "info"])
def test_shares_of_modes_and_flags_are_those_of_the_cells(folder: Path, source: str) -> None:
    text = (folder / "sweep.txt").read_text()
    if source == "info":
        text = printed(folder, "info", "sweep.nc")
    data = slipsweep.open_result(folder / "sweep.nc").load()
    for mode in SlidingMode:
        expected = float((data.sliding_mode == mode).mean())
        assert share(text, mode.name.lower()) == pytest.approx(expected, abs=5.1e-5)
    raised = 0
    for flag in Validity:
        name = (flag.name or "").lower()
        expected = float((data.validity & int(flag) != 0).mean())
        if expected:
            assert share(text, name) == pytest.approx(expected, abs=5.1e-5)
            assert f"{flag.text}\n" in text
            raised += 1
        else:
            assert not re.search(rf"^ *{name} ", text, re.MULTILINE)
    assert raised > 4


def test_ratio_to_newmark_is_of_cells_in_which_both_slide(folder: Path) -> None:
    """In classes 0.1 % wide."""
    data = slipsweep.open_result(folder / "sweep.nc").load()
    ratio = (data.permanent_displacement / data.newmark_displacement).values
    slides = np.isfinite(ratio) & (data.permanent_displacement.values != 0.0)
    ratio = np.maximum(ratio[slides & (data.newmark_displacement.values != 0.0)], 1e-7)
    match = re.search(
        r"over Newmark's, where both slide: median (\S+), 5 to 95 % (\S+) to (\S+)",
        (folder / "sweep.txt").read_text(),
    )
    assert match
    middle, low, high = map(float, match.groups())
    expected = np.quantile(ratio, [0.5, 0.05, 0.95], method="inverted_cdf")
    np.testing.assert_allclose([middle, low, high], expected, rtol=6e-3)


def test_run_prints_the_range_of_each_axis(folder: Path) -> None:
    text = (folder / "sweep.txt").read_text()
    assert text.startswith("144 cells (3 theta x 2 mu_s x 12 amplitude x 2 frequency) in ")
    ranges = {
        "theta": "0 to 30 degree",
        "mu_s": "0.25 to 0.5",
        "amplitude": "0.981 to 11.772 m/s2 (0.1 to 1.2 g)",
        "frequency": "0.5 to 2 Hz",
    }
    for name, ends in ranges.items():
        assert f"\n  {name:<24}{ends}\n" in text


def test_limits_are_summed_up_in_both_units(folder: Path) -> None:
    text = printed(
        folder, "limit", "sweep.toml", "-d", "5cm", "-d", "0.5m", "--maximum-amplitude", "2g"
    )
    limits = slipsweep.limit_amplitude(
        [0.05, 0.5],
        [0, 14, 30],
        [0.25, 0.5],
        [0.5, 2],
        excitation=slipsweep.Sine(cycles=15),
        maximum_amplitude=2 * G,
    )
    amplitudes = limits.limit_amplitude
    values = {
        "smallest": amplitudes.min(),
        "median": amplitudes.median(),
        "largest": amplitudes.max(),
    }
    for name, value in values.items():
        amount = float(value)
        assert f"\n  {name:<24}{amount:.6g} m/s2 ({amount / G:.4g} g)\n" in text
    assert "displacement 0.05, 0.5 m, searched up to 19.62 m/s2 (2 g)\n" in text
    for status in LimitStatus:
        expected = float((limits.limit_status == status).mean())
        if expected:
            assert share(text, status.name.lower()) == pytest.approx(expected, abs=5.1e-5)
    assert text.startswith("24 limits (3 theta x 2 mu_s x 2 frequency x 2 displacement)\n")


def test_simulate_prints_the_results_of_the_case(tmp_path: Path) -> None:
    options = ("--theta", "5", "--mu-s", "0.38", "--amplitude", "0.9g", "--frequency", "1.8")
    text = printed(tmp_path, "simulate", *options)
    result = slipsweep.sweep(5.0, 0.38, 0.9 * G, 1.8)
    assert f"permanent displacement  {result.permanent_displacement.item():.6g} m\n" in text
    assert f"peak relative velocity  {result.peak_relative_velocity.item():.6g} m/s\n" in text
    assert "sliding mode            continuous\n" in text
    taken = "theta 5 degree, mu_s 0.38, amplitude 8.829 m/s2 (0.9 g), frequency 1.8 Hz"
    assert f"taken as                {taken}\n" in text
    for flag in Validity(result.validity.item()):
        assert f"{flag.kind:<24}{(flag.name or '').lower()}: {flag.text}\n" in text


# ---------------------------------------------------------------------------------- suites


def test_info_has_every_measure_of_every_motion(folder: Path) -> None:
    """In the units of the heading, to four digits."""
    heading, rows = table(printed(folder, "info", "suite.nc"), "motion  samples", 3)
    names = ["samples", "interval (s)", "PGA (m/s2)", "PGV (m/s)", "PGD (m)", "Arias (m/s)"]
    names += ["CAV (m/s)", "D5-95 (s)", "Tm (s)"]
    assert re.split(r"\s{2,}", heading.strip()) == ["motion", *names]
    suite = slipsweep.read_suite(folder / "motions", units="g")
    measures = ["samples", "interval", "pga", "pgv", "pgd", "arias_intensity", "cav"]
    measures += ["significant_duration", "mean_period"]
    for at, (label, *words) in enumerate(rows):
        assert label == suite.labels[at]
        expected = [suite.measures[f"motion_{name}"][at] for name in measures]
        np.testing.assert_allclose(numbers(words), expected, rtol=6e-4)


def test_statistics_of_a_suite_have_a_line_for_each_grid_point(folder: Path) -> None:
    """Median, 16 and 84 % in mm, the share of zeros, and P(u > d) of each displacement."""
    text = printed(folder, "info", "suite.nc", "-d", "1mm", "-d", "2cm")
    heading, rows = table(text, "PGA (g)   ky", 8)
    titles = "PGA (g) ky 16 % median 84 % zero P(u > 1 mm) P(u > 20 mm)"
    assert " ".join(heading.split()) == titles
    data = slipsweep.open_result(folder / "suite.nc").load()
    statistics = slipsweep.suite_statistics(data, thresholds=[0.001, 0.02])
    points = [(a, ky) for a in data.amplitude.values for ky in data.yield_coefficient.values]
    for (amplitude, ky), words in zip(points, rows, strict=True):
        at = statistics.sel(yield_coefficient=ky, amplitude=amplitude)
        middle = 1000.0 * at.displacement_quantile.values
        exceeding = 100.0 * at.exceedance_probability.values
        zeros = 100.0 * at.zero_probability.item()
        row = numbers(words)
        np.testing.assert_allclose(row[:2], [amplitude / G, ky], rtol=6e-4)
        np.testing.assert_allclose(row[2:5], middle, rtol=6e-3)
        np.testing.assert_allclose(row[5:], [zeros, *exceeding], atol=0.06)
    assert "permanent displacement (mm) over 3 motion x 2 polarity:\n" in text


def test_hazard_prints_rates_periods_steps_and_parts(folder: Path) -> None:
    text = printed(folder, "hazard", "suite.nc", "--curve", "hazard.csv", "-d", "1mm", "-d", "10mm")
    data = slipsweep.open_result(folder / "suite.nc").load()
    hazard = slipsweep.displacement_hazard(data, folder / "hazard.csv", [0.001, 0.01])
    low, high = (float(end) / G for end in (0.2, 6.0))
    heading, rows = table(text, "annual rate  period (years)", 4, skipped=1)
    titles = ["annual rate", "period (years)", "steps, from", "to"]
    titles += [f"above {high:.3g} g", f"below {low:.3g} g"]
    assert re.split(r"\s{2,}", heading.strip())[-6:] == titles
    rate = hazard.annual_rate.values.ravel()
    expected = np.column_stack(
        [
            rate,
            1.0 / rate,
            *(hazard[name].values.ravel() / rate for name in ("lower_rate", "upper_rate")),
            *(hazard[name].values.ravel() / rate for name in ("held_rate", "omitted_rate")),
        ]
    )
    assert (rate > 0.0).all()
    np.testing.assert_allclose([numbers(words[-6:]) for words in rows], expected, rtol=6e-4)
    assert "P(u > d | PGA): share over motion and polarity\n" in text
    assert "amplitudes of the result 0.02039 to 0.6116 g, hazard curve 0.01 to 1 g\n" in text


@pytest.mark.parametrize(("displacement", "is_held"), [("0.01mm", False), ("10mm", True)])
def test_hazard_says_where_a_twentieth_of_a_rate_is_held_above_the_axis(
    folder: Path, displacement: str, is_held: bool
) -> None:
    text = printed(folder, "hazard", "suite.nc", "--curve", "hazard.csv", "-d", displacement)
    data = slipsweep.open_result(folder / "suite.nc").load()
    found = slipsweep.displacement_hazard(data, folder / "hazard.csv", displacement)
    assert (found.held_rate > 0.05 * found.annual_rate).any() == is_held
    assert ("\nabove 0.6116 g P(u > d) is taken as it is there: to compute it, " in text) == is_held
    # nothing slides at the lower end of the axis
    assert "nothing is counted" not in text


def test_limits_of_a_suite_have_quantiles_counts_and_every_motion(folder: Path) -> None:
    """All in g: quantiles at each grid point, then the limits one by one."""
    options = ("-d", "1cm", "--maximum-amplitude", "0.6g", "-o", "limits.nc")
    text = printed(folder, "limit", "suite.nc", *options)
    limits = slipsweep.open_result(folder / "limits.nc").load()
    each = limits.limit_amplitude.transpose("yield_coefficient", "motion", "polarity")
    values = each.values.reshape(2, -1) / G
    _, rows = table(text, "16 %  median", 2)
    for words, limits_of_motion in zip(rows, values, strict=True):
        reached = np.nan_to_num(limits_of_motion, nan=1e9)  # above all others
        expected = np.quantile(reached, [0.16, 0.5, 0.84])
        expected[expected > 1.0] = np.nan
        np.testing.assert_allclose(numbers(words[-5:-2]), expected, rtol=6e-4)
        assert words[-2:] == [
            str(limits_of_motion.size),
            str(int(np.isnan(limits_of_motion).sum())),
        ]
    assert np.isnan(values).any()
    _, rows = table(text, "limits of the motions, g, at each grid point:", 6)
    np.testing.assert_allclose([numbers(words[-2:]) for words in rows], values.T, rtol=6e-4)


# ------------------------------------------------------------------------- uncertain inputs


def test_means_of_sobol_indices_and_where_each_is_the_largest(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        """
[axes]
theta.values = [0, 5]
amplitude.values = [0.2, 4, 8]
frequency.values = [1]
[uncertainty]
samples = 64
sensitivity = true
mu_s = {distribution = "uniform", loc = 0.35, scale = 0.1}
amplitude = {kind = "factor", distribution = "lognorm", s = 0.3}
"""
    )
    text = printed(tmp_path, "run", "a.toml")
    data = slipsweep.open_result(tmp_path / "a.nc").load()
    there = data.sensitivity_status == 0
    assert f"at {int(there.sum())} of 6 grid points, and their means:\n" in text
    heading, rows = table(text, "first order", 2)
    assert " ".join(heading.split()) == "first order total largest total at"
    grid = ["theta", "amplitude"]
    total = data.total_index.where(there)
    means = total.mean(grid).to_series().sort_values(ascending=False)
    largest = total.stack(point=grid).dropna("point").argmax("input").values
    for (name, *words), input_name in zip(rows, means.index, strict=True):
        assert name == input_name
        first = float(data.first_order_index.where(there).sel(input=name).mean())
        place = data.input.values.tolist().index(name)
        expected = [first, means[name], np.count_nonzero(largest == place)]
        np.testing.assert_allclose(numbers(words), expected, atol=5.1e-4)
    assert (
        f"none at {int((~there).sum())} (no_variance): all runs have the same displacement" in text
    )


# ------------------------------------------------------------------------------- friction


def test_friction_has_every_slide(tmp_path: Path) -> None:
    test = Path(__file__).parents[2] / "sweeps" / "data" / "shaking_test.csv"
    text = printed(tmp_path, "friction", test, "--theta", "5", "--mu-s", "0.38")
    friction = slipsweep.measured_friction(test, 5.0, 0.38)
    heading, rows = table(text, " onset ", friction.sizes["slide"])
    titles = ["onset", "peak", "stop", "table at onset", "block at most", "least of Eq. 1"]
    assert re.split(r"\s{2,}", heading.strip()) == [*titles, "by statics"]
    columns = ["slide_onset", "slide_peak", "slide_stop", "onset_acceleration"]
    columns += ["peak_block_acceleration", "least_friction", "slide_free_body_friction"]
    expected = np.column_stack([friction[name].values for name in columns])
    np.testing.assert_allclose([numbers(words) for words in rows], expected, rtol=6e-4)
    assert text.startswith(
        f"threshold  {friction.attrs['threshold']:.4g} m/s2: 4 standard deviations"
    )
    for kind in ("static", "kinetic"):
        value = friction[f"{kind}_friction"].item()
        low, high = friction[f"{kind}_friction_interval"].values
        line = f"{kind + ' friction by statics':<28}{value:.3f}   95 %: {low:.3f} to {high:.3f}\n"
        assert line in text


def test_a_threshold_of_slides_may_be_in_g_of_the_gravity_given(tmp_path: Path) -> None:
    test = Path(__file__).parents[2] / "sweeps" / "data" / "shaking_test.csv"
    block = ("--theta", "5", "--mu-s", "0.38", "--g", "9.7")
    text = printed(tmp_path, "friction", test, *block, "--threshold", "0.1g")
    friction = slipsweep.measured_friction(test, 5.0, 0.38, g=9.7, threshold=0.97)
    assert text.startswith("threshold  0.97 m/s2: given\n")
    assert f"{friction.sizes['slide']} slides, s and m/s2:\n" in text
    _, rows = table(text, " onset ", friction.sizes["slide"])
    onsets = [numbers(words)[0] for words in rows]
    np.testing.assert_allclose(onsets, friction.slide_onset, rtol=6e-4)
