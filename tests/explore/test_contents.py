"""Contents of the page that `slipsweep explore` writes."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from slipsweep import (
    Newmark,
    Sine,
    SlidingMode,
    Validity,
    simulate,
    suite_statistics,
    sweep,
)
from slipsweep.explore.page import write_page
from tests.support.pages import SUITE, SWEEP, axes_of, contents, make


def test_page_holds_the_results_of_the_file(result: Path, written: Path) -> None:
    meta, arrays = contents(written)
    axes = axes_of(meta)
    assert axes["theta"] == [0.0, 5.0, 20.0]
    with xr.open_dataset(result, mask_and_scale=False) as data:
        expected = data.sel(axes).transpose(*axes).load()
    for name in ("sliding_mode", "validity"):
        values = np.broadcast_to(arrays[name], expected[name].shape)
        np.testing.assert_array_equal(values, expected[name])
    # single precision, and once more by the law of frequencies
    for name in ("permanent_displacement", "newmark_displacement"):
        np.testing.assert_allclose(arrays[name], expected[name], rtol=4e-7, atol=0)


def test_displacements_are_stored_at_one_frequency(written: Path) -> None:
    """u = W/ω²."""
    meta, _ = contents(written)
    assert meta["arrays"]["permanent_displacement"]["shape"] == [3, 2, 23, 1]


def test_figures_have_titles_units_and_scales(written: Path) -> None:
    meta, _ = contents(written)
    assert [dim["log"] for dim in meta["dims"]] == [False, False, False, True]
    text = json.dumps(meta["figures"], ensure_ascii=False)
    assert '"excitation frequency f (Hz), logarithmic scale"' in text
    assert '"peak ground acceleration A (m/s²)"' in text
    assert '[10.0, "10 mm"]' in text  # of the bar of colours


def test_notes_have_the_ends_of_the_colours(result: Path, written: Path) -> None:
    """Nine displacements in ten lie between them."""
    with xr.open_dataset(result) as data:
        mm = 1000.0 * data[["permanent_displacement", "newmark_displacement"]].to_array().values
    low, high = np.percentile(np.log10(mm[mm > 0]), (5, 95))
    note = f"those beyond {10 ** math.floor(low):g} and {10 ** math.ceil(high):g} mm have"
    assert note in written.read_text()


def test_notes_have_the_number_of_cells(written: Path) -> None:
    assert "All 2,484 cells of the file are in this page." in written.read_text()


def test_notes_have_the_number_of_histories(written: Path) -> None:
    kept = contents(written)[0]["histories"]["keep"]
    counts = " × ".join(f"{len(indices)} {dim}" for dim, indices in kept.items())
    note = f"the first 3 of 4 cycles, 64 points a cycle, computed event by event for {counts}"
    assert note in written.read_text()


#: Powers of ω by which quantities of a history follow from those at 1 rad/s.
POWERS = {"block_acceleration": 0, "relative_velocity": -1, "relative_displacement": -2}


def test_histories_are_those_of_simulate(written: Path) -> None:
    meta, arrays = contents(written)
    axes = axes_of(meta)
    store = meta["histories"]
    assert list(store["keep"]) == ["theta", "mu_s", "amplitude"]
    frequency = 1.7
    omega = 2.0 * math.pi * frequency
    times = np.array(store["phase"]) / omega
    modes = set()
    for place in np.ndindex(*(len(kept) for kept in store["keep"].values())):
        cell = {
            dim: axes[dim][indices[at]]
            for (dim, indices), at in zip(store["keep"].items(), place, strict=True)
        }
        if cell["amplitude"] % 2 != 0 or cell["theta"] == 0.0:
            continue
        scale = arrays["history_scale"][place]
        expected = simulate(**cell, frequency=frequency, times=times, excitation=Sine(cycles=4))
        if np.isnan(scale).any():
            assert expected.validity & Validity.STATICALLY_UNSTABLE
            continue
        modes.add(int(expected.sliding_mode))
        ground = cell["amplitude"] * np.array(store["ground"])
        np.testing.assert_allclose(
            expected.ground_acceleration, ground, atol=1e-12 * cell["amplitude"]
        )
        for row, (name, power) in enumerate(POWERS.items()):
            values = arrays["histories"][(*place, row)] * float(scale[row]) * omega**power
            tolerance = float(np.abs(expected[name]).max()) / 60_000
            differs = np.abs(values - expected[name].values) > tolerance
            # the acceleration jumps where braking begins, which rounding of t = φ/ω may put on
            # either side
            jumps = store["cycles"] if name == "block_acceleration" else 0
            assert np.count_nonzero(differs) <= jumps
    assert modes == {SlidingMode.STUCK, SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS}


def test_histories_of_a_block_that_slides_both_ways_are_those_of_simulate(tmp_path: Path) -> None:
    model = Newmark(sliding="both")
    sweep([2, 5], 0.3, [4, 8], [1, 2], model=model).to_netcdf(tmp_path / "both.nc")
    write_page(tmp_path / "both.nc", tmp_path / "both.html")
    meta, arrays = contents(tmp_path / "both.html")
    phase = np.array(meta["histories"]["phase"])
    times = phase / (2.0 * math.pi)  # those of 1 Hz
    for place, case in enumerate([(2, 4), (2, 8), (5, 4), (5, 8)]):
        theta, amplitude = case
        expected = simulate(theta, 0.3, amplitude, 1.0, times=times, model=model)
        velocity = arrays["histories"].reshape(4, 3, -1)[place, 1]
        scale = float(arrays["history_scale"].reshape(4, 3)[place, 1])
        largest = float(np.abs(expected.relative_velocity).max())
        np.testing.assert_allclose(
            velocity * scale / (2.0 * math.pi), expected.relative_velocity, atol=largest / 60_000
        )
    assert float(expected.relative_velocity.min()) < 0.0


@pytest.fixture(scope="module")
def thinned(tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, Path]:
    """A result of 496,800 cells, whose page is to have 2.5 MB."""
    folder = tmp_path_factory.mktemp("thinned")
    # A = ω²d: no frequency gives another
    amplitudes = np.linspace(0.1, 0.001, 460)
    frequencies = np.geomspace(0.2, 10, 180)
    data = sweep([0, 5, 20], [0.3, 0.5], displacement_amplitude=amplitudes, frequency=frequencies)
    data.to_netcdf(folder / "large.nc")
    write_page(folder / "large.nc", folder / "page.html", size=2_500_000)
    return data, folder / "page.html"


def test_a_large_result_fills_the_size_of_the_page(thinned: tuple[xr.Dataset, Path]) -> None:
    assert 1_800_000 < thinned[1].stat().st_size <= 2_500_000


def test_a_thinned_page_has_values_of_the_file_in_order_with_the_ends(
    thinned: tuple[xr.Dataset, Path],
) -> None:
    data, page = thinned
    meta, arrays = contents(page)
    axes = axes_of(meta)
    amplitudes = axes["displacement_amplitude"]
    assert len(amplitudes) < 460
    assert (amplitudes[0], amplitudes[-1]) == (0.001, 0.1)
    expected = data.permanent_displacement.sel(axes).values.astype("f4")
    np.testing.assert_array_equal(arrays["permanent_displacement"], expected)


def test_notes_of_a_thinned_page_have_the_values_kept(thinned: tuple[xr.Dataset, Path]) -> None:
    meta, _ = contents(thinned[1])
    lengths = {dim: len(values) for dim, values in axes_of(meta).items()}
    text = thinned[1].read_text(encoding="utf-8")
    assert f"Thinned: {math.prod(lengths.values()):,} of the file&#39;s 496,800 cells" in text
    kept = lengths["displacement_amplitude"]
    assert f"displacement_amplitude: {kept} of 460 values" in text


# ------------------------------------------------------------------ other shaking, and statistics


def spread(values: xr.DataArray, dims: list[str]) -> np.ndarray:
    """Values along all dimensions of a page, of length 1 along those that they do not have."""
    values = values.expand_dims([dim for dim in dims if dim not in values.dims])
    return values.transpose(*dims).values


def test_the_map_of_a_suite_is_of_strength_over_friction(
    suite_page: tuple[xr.Dataset, Path],
) -> None:
    meta, _ = contents(suite_page[1])
    assert (meta["map"]["y"], meta["map"]["x"]) == ("amplitude", "mu_s")


def test_a_suite_has_the_names_and_displacements_of_its_motions(
    suite_page: tuple[xr.Dataset, Path],
) -> None:
    data, path = suite_page
    data = data.sortby("polarity")
    meta, arrays = contents(path)
    motion = next(dim for dim in meta["dims"] if dim["name"] == "motion")
    assert motion["labels"] == data.motion.values.tolist()
    displacements = spread(data.permanent_displacement, [*axes_of(meta)])
    np.testing.assert_array_equal(arrays["permanent_displacement"], displacements.astype("f4"))
    np.testing.assert_array_equal(arrays["validity"], spread(data.validity, [*axes_of(meta)]))


@pytest.mark.parametrize("name", ["displacement_quantile", "exceedance_probability"])
def test_a_suite_has_statistics_over_its_motions(
    suite_page: tuple[xr.Dataset, Path], name: str
) -> None:
    data, path = suite_page
    meta, arrays = contents(path)
    statistics = suite_statistics(data, quantiles=[0.16, 0.5, 0.84])[name]
    expected = spread(statistics, [*axes_of(meta)])
    assert meta["arrays"][name]["dims"] == list(statistics.dims)
    np.testing.assert_allclose(np.broadcast_to(arrays[name], expected.shape), expected, rtol=1e-6)
    assert len(np.unique(expected)) > 3


def test_a_suite_has_no_histories(suite_page: tuple[xr.Dataset, Path]) -> None:
    assert contents(suite_page[1])[0]["histories"] is None


CASES = "[axes]\namplitude.values = [2, 6]\nfrequency.values = [1, 2]\n" + "".join(
    f'[[cases]]\nlabel = "{phi}"\ntheta = 5\nphi = {phi}\n' for phi in (20, 25)
)


@pytest.mark.parametrize(
    ("text", "dim"),
    [(SWEEP.replace("mu_s.values = [0.3, 0.5]", "phi.values = [20, 30]"), "phi"), (CASES, "case")],
)
def test_results_over_friction_angles_have_histories(tmp_path: Path, text: str, dim: str) -> None:
    write_page(make(tmp_path, text), tmp_path / "a.html")
    meta, _ = contents(tmp_path / "a.html")
    assert meta["histories"] is not None
    assert dim in axes_of(meta)


@pytest.mark.parametrize("ramp", ["ramp_in", "ramp_out"])
def test_no_histories_of_waves_that_end_beyond_them(tmp_path: Path, ramp: str) -> None:
    write_page(make(tmp_path, f"{SWEEP}excitation.{ramp} = 1\n"), tmp_path / "a.html")
    assert (contents(tmp_path / "a.html")[0]["histories"] is None) == (ramp == "ramp_out")


RECORD = f"""
excitation.record = "{(SUITE / "rock-far_H1.AT2").as_posix()}"
axes.theta.values = [2, 5]
axes.scale.values = [1, 2, 4]
axes.time_scale.values = [0.5, 1, 2]
"""

UNCERTAIN = (
    "uncertainty = {samples = 64, mu_s = {distribution = 'uniform', loc = 0.1, scale = 0.2}}\n"
)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("axes.mu_s.values = [0.2]\n", ["permanent_displacement"]),
        (UNCERTAIN, ["displacement_quantile", "exceedance_probability"]),
    ],
)
def test_records_and_uncertain_inputs_over_scale_and_time_scale(
    tmp_path: Path, text: str, names: list[str]
) -> None:
    result = make(tmp_path, RECORD + text)
    output = tmp_path / "page.html"
    write_page(result, output)
    meta, arrays = contents(output)
    assert meta["map"] == {"y": "scale", "x": "time_scale"}
    for name in names:
        with xr.open_dataset(result) as data:
            dims = [dim for dim in axes_of(meta) if dim in data[name].dims]
            expected = data[name].transpose(*dims).values
        assert np.nanmax(expected) > 0.0
        values = arrays[name].reshape(expected.shape)
        np.testing.assert_allclose(values, expected, rtol=4e-7)
        # u grows with the square of the time scale: stored at one of them
        if name != "exceedance_probability":
            place = [*axes_of(meta)].index("time_scale")
            assert meta["arrays"][name]["shape"][place] == 1
