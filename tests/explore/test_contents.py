"""The page that `slipsweep explore` writes: what is in it."""

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
from slipsweep.model.variables import CAUTIONS, VALUELESS
from tests.support.pages import SUITE, SWEEP, axes_of, contents, make


def test_page_holds_the_dataset(result: Path, written: Path) -> None:
    meta, arrays = contents(written)
    with xr.open_dataset(result, mask_and_scale=False) as data:
        expected = data.sel(axes_of(meta)).transpose(*axes_of(meta))
        assert axes_of(meta)["theta"] == [0.0, 5.0, 20.0]
        for name in ("sliding_mode", "validity"):
            np.testing.assert_array_equal(
                np.broadcast_to(arrays[name], expected[name].shape), expected[name]
            )
        # single precision, and once more by the law of frequencies
        np.testing.assert_allclose(
            arrays["permanent_displacement"], expected.permanent_displacement, rtol=4e-7, atol=0
        )
        lengths = expected[["permanent_displacement", "newmark_displacement"]].to_array() * 1000.0
    # u = W/ω²: stored at one frequency
    assert meta["arrays"]["permanent_displacement"]["shape"] == [3, 2, 23, 1]
    assert [dim["log"] for dim in meta["dims"]] == [False, False, False, True]
    text = json.dumps(meta["figures"], ensure_ascii=False)
    assert '"excitation frequency f (Hz), logarithmic scale"' in text
    assert '"peak ground acceleration A (m/s²)"' in text
    assert '[10.0, "10 mm"]' in text  # of the bar of colours
    low, high = np.nanpercentile(np.log10(lengths.where(lengths > 0)), (5, 95))  # nine cells in ten
    assert (
        f"those beyond {10 ** math.floor(low):g} and {10 ** math.ceil(high):g} mm have"
        in written.read_text()
    )
    assert meta["unsound"] == int(CAUTIONS | VALUELESS)
    assert "All 2,484 cells of the file are in this page." in written.read_text()
    # the slope that is statically unstable has histories of no cell
    kept = meta["histories"]["keep"]
    histories = " × ".join(f"{len(indices)} {dim}" for dim, indices in kept.items())
    note = f"the first 3 of 4 cycles, 64 points a cycle, computed event by event for {histories}"
    assert note in written.read_text()


def test_histories_are_those_of_simulate(written: Path) -> None:
    meta, arrays = contents(written)
    axes = axes_of(meta)
    store = meta["histories"]
    assert list(store["keep"]) == ["theta", "mu_s", "amplitude"]
    frequency = 1.7
    omega = 2.0 * math.pi * frequency
    seen = set()
    factors = {
        "block_acceleration": 1.0,
        "relative_velocity": 1.0 / omega,
        "relative_displacement": 1.0 / omega**2,
    }
    for place in np.ndindex(*(len(kept) for kept in store["keep"].values())):
        case = {
            dim: axes[dim][kept[at]]
            for (dim, kept), at in zip(store["keep"].items(), place, strict=True)
        }
        scale = arrays["history_scale"][place]
        if case["amplitude"] % 2 != 0 or case["theta"] == 0.0:
            continue
        times = np.array(store["phase"]) / omega
        expected = simulate(**case, frequency=frequency, times=times, excitation=Sine(cycles=4))
        if np.isnan(scale).any():
            assert expected.validity & Validity.STATICALLY_UNSTABLE
            continue
        seen.add(int(expected.sliding_mode))
        ground = case["amplitude"] * np.array(store["ground"])
        np.testing.assert_allclose(
            expected.ground_acceleration, ground, atol=1e-12 * case["amplitude"]
        )
        for row, (name, factor) in enumerate(factors.items()):
            kept = arrays["histories"][(*place, row)] * float(scale[row]) * factor
            differs = (
                np.abs(kept - expected[name].values) > float(np.abs(expected[name]).max()) / 60_000
            )
            # the acceleration jumps where braking begins, which rounding of t = φ/ω may put on
            # either side
            assert np.count_nonzero(differs) <= (
                store["cycles"] if name == "block_acceleration" else 0
            )
    assert seen == {SlidingMode.STUCK, SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS}


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


def test_large_result_is_thinned_to_the_size_and_says_how(tmp_path: Path) -> None:
    # A = ω²d: no frequency gives another
    amplitudes = np.linspace(0.1, 0.001, 460)
    frequencies = np.geomspace(0.2, 10, 180)
    data = sweep([0, 5, 20], [0.3, 0.5], displacement_amplitude=amplitudes, frequency=frequencies)
    data.to_netcdf(tmp_path / "own.nc")
    excerpt = write_page(tmp_path / "own.nc", tmp_path / "page.html", size=2_500_000)
    assert 1_800_000 < (tmp_path / "page.html").stat().st_size <= 2_500_000
    meta, arrays = contents(tmp_path / "page.html")
    axes = axes_of(meta)
    kept = {dim: len(values) for dim, values in axes.items()}
    assert kept == excerpt.sizes != excerpt.lengths
    assert axes["displacement_amplitude"][:: kept["displacement_amplitude"] - 1] == [
        0.001,
        0.1,
    ]  # in order, with ends
    expected = data.permanent_displacement.sel(axes).values.astype("f4")
    np.testing.assert_array_equal(arrays["permanent_displacement"], expected)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f"Thinned: {math.prod(kept.values()):,} of the file&#39;s 496,800 cells" in text
    assert f"displacement_amplitude: {kept['displacement_amplitude']} of 460 values" in text


# ------------------------------------------------------------------ other shaking, and statistics


def test_a_suite_shows_its_motions_and_their_statistics(
    suite_page: tuple[xr.Dataset, Path],
) -> None:
    data, path = suite_page
    data = data.sortby("polarity")
    meta, arrays = contents(path)
    assert (meta["map"]["y"], meta["map"]["x"]) == ("amplitude", "mu_s")
    motion = next(dim for dim in meta["dims"] if dim["name"] == "motion")
    assert motion["labels"] == data.motion.values.tolist()
    order = [dim["name"] for dim in meta["dims"]]

    def spread(values: xr.DataArray) -> np.ndarray:
        values = values.expand_dims([dim for dim in order if dim not in values.dims])
        return values.transpose(*order).values

    np.testing.assert_array_equal(
        arrays["permanent_displacement"], spread(data.permanent_displacement).astype("f4")
    )
    np.testing.assert_array_equal(arrays["validity"], spread(data.validity))
    found = suite_statistics(data, quantiles=[0.16, 0.5, 0.84])
    for name in ("displacement_quantile", "exceedance_probability"):
        expected = spread(found[name])
        np.testing.assert_allclose(
            np.broadcast_to(arrays[name], expected.shape), expected, rtol=1e-6
        )
        assert meta["arrays"][name]["dims"] == list(found[name].dims)
    assert 0.0 < arrays["exceedance_probability"].mean() < 1.0
    assert meta["histories"] is None


CASES = "[axes]\namplitude.values = [2, 6]\nfrequency.values = [1, 2]\n" + "".join(
    f'[[cases]]\nlabel = "{phi}"\ntheta = 5\nphi = {phi}\n' for phi in (20, 25)
)


@pytest.mark.parametrize(
    ("text", "dim"),
    [(SWEEP.replace("mu_s.values = [0.3, 0.5]", "phi.values = [20, 30]"), "phi"), (CASES, "case")],
)
def test_friction_angles(tmp_path: Path, text: str, dim: str) -> None:
    write_page(make(tmp_path, text), tmp_path / "a.html")
    meta, _ = contents(tmp_path / "a.html")
    assert meta["histories"] is not None
    assert dim in axes_of(meta)


@pytest.mark.parametrize("ramp", ["ramp_in", "ramp_out"])
def test_no_histories_of_waves_that_end_beyond_them(tmp_path: Path, ramp: str) -> None:
    write_page(make(tmp_path, f"{SWEEP}excitation.{ramp} = 1\n"), tmp_path / "a.html")
    assert (contents(tmp_path / "a.html")[0]["histories"] is None) == (ramp == "ramp_out")


@pytest.mark.parametrize("drawn", [False, True])
def test_records_and_uncertain_inputs(tmp_path: Path, drawn: bool) -> None:
    text = f'excitation.record = "{(SUITE / "rock-far_H1.AT2").as_posix()}"\naxes.theta.values = [2, 5]\n'
    text += "axes.scale.values = [1, 2, 4]\naxes.time_scale.values = [0.5, 1, 2]\n"
    uncertain = (
        "uncertainty = {samples = 64, mu_s = {distribution = 'uniform', loc = 0.1, scale = 0.2}}\n"
    )
    result = make(tmp_path, text + (uncertain if drawn else "axes.mu_s.values = [0.2]\n"))
    output = tmp_path / "page.html"
    write_page(result, output)
    meta, arrays = contents(output)
    assert meta["map"] == {"y": "scale", "x": "time_scale"}
    with xr.open_dataset(result) as data:
        names = (
            ("displacement_quantile", "exceedance_probability")
            if drawn
            else ("permanent_displacement",)
        )
        for name in names:
            order = [dim["name"] for dim in meta["dims"] if dim["name"] in data[name].dims]
            expected = data[name].transpose(*order).values
            np.testing.assert_allclose(
                arrays[name].reshape([data.sizes[d] for d in order]), expected, rtol=4e-7
            )
            assert np.nanmax(expected) > 0.0
            # u grows with the square of the time scale: stored at one of them
            if name != "exceedance_probability":
                length = meta["arrays"][name]["shape"][list(axes_of(meta)).index("time_scale")]
                assert length == 1
