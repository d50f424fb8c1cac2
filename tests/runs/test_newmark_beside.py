"""`newmark_displacement`: Newmark's block on the cells of a sweep, beside the paper's, wherever results go."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.cli.common import echo_tally
from slipsweep.files import results, spec
from slipsweep.grid import engine
from slipsweep.grid.tally import Ratios
from slipsweep.runs import store
from slipsweep.runs.jobs import sweep_job

AXES: dict[str, Any] = {
    "theta": [0.0, 5.0, 25.0],
    "mu_s": [0.3, 0.4],
    "amplitude": np.linspace(0.5, 8.0, 30),
    "frequency": [0.5, 1.0, 2.0],
}
BOTH = ["permanent_displacement", "newmark_displacement"]
RECORD = slipsweep.Record(np.arange(9.0) / 10, np.array([0.0, 3.0, -2.0, 5.0, 1.0, 4.0, -6.0, 2.0, 0.0]))


@pytest.mark.parametrize(
    ("given", "options"),
    [
        (AXES, {}),
        (AXES, {"solver": slipsweep.Step(rule="simpson", steps_per_cycle=256)}),
        (AXES, {"excitation": slipsweep.Triangle(cycles=3, ramp_in=1.0)}),
        (AXES, {"model": slipsweep.Mendez(rise="literal", recoupling="integrate", g=9.80665)}),
        (AXES, {"yield_acceleration": [0.1, 1.0], "structure_frequency": [1.0, 3.0]}),
        (AXES | {"mu_s": 0.4}, {"decay_rate": [2.0, 4.0], "delta_mu": [0.1, 0.2], "minimum_friction": 0.02}),
        (
            {"theta": 5.0, "mu_s": [0.3, 0.4], "frequency": [0.5, 2.0], "displacement_amplitude": [0.05, 0.1]},
            {"chunks": {"mu_s": 1}},
        ),
        (AXES, {"chunks": {"amplitude": 7}}),
        ({"theta": [0.0, 25.0], "mu_s": 0.3, "scale": [0.5, 2.0]}, {"excitation": RECORD, "polarity": "both"}),
        ({"theta": 3.0, "mu_s": 0.3, "amplitude": [2.0, 6.0]}, {"excitation": RECORD, "decay_rate": [1.0, 2.0]}),
    ],
)
def test_is_what_newmarks_model_gives(given: dict[str, Any], options: dict[str, Any]) -> None:
    beside = slipsweep.sweep(**given, **options, variables=BOTH).compute()
    model = options.get("model", slipsweep.Mendez())
    own = {name: value for name, value in options.items() if name not in ("decay_rate", "delta_mu", "minimum_friction")}
    alone = slipsweep.sweep(**given, **(own | {"model": slipsweep.Newmark(g=model.g)}), variables=BOTH[:1]).compute()
    assert beside.newmark_displacement.dims == beside.permanent_displacement.dims
    both = xr.broadcast(beside.newmark_displacement, alone.permanent_displacement)
    np.testing.assert_array_equal(*(one.transpose(*both[0].dims) for one in both))
    assert (both[0] > 0).any()
    steep = beside.newmark_displacement.sel(theta=25.0) if "theta" in beside.dims else beside.newmark_displacement[:0]
    assert np.isnan(steep).all() or "yield_acceleration" in options, "statically unstable"


def test_unasked_it_is_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(asked: engine.Request) -> Any:
        raise AssertionError("computed")

    monkeypatch.setattr(engine, "newmark", none)
    assert "newmark_displacement" not in slipsweep.sweep(**AXES)
    assert "newmark_displacement" not in slipsweep.sweep(5.0, 0.4, excitation=RECORD)
    with pytest.raises(AssertionError, match="computed"):
        slipsweep.sweep(**AXES, variables=BOTH)


@pytest.mark.parametrize("alone", [["newmark_displacement"], ["newmark_displacement", "validity"]])
def test_it_may_be_asked_for_alone(alone: list[str]) -> None:
    done: list[int] = []
    found = slipsweep.sweep(**AXES, decay_rate=[2.0, 3.0], delta_mu=0.1, variables=alone, progress=done.append)
    assert set(found.data_vars) == set(alone)
    assert sum(done) == found.newmark_displacement.size


GRID = """
[axes.theta]
values = [0, 5, 25]
[axes.mu_s]
values = [0.3, 0.4]
[axes.amplitude]
start = 0.5
stop = 8
num = 30
[axes.frequency]
values = [0.5, 1, 2]
[output]
variables = ["permanent_displacement", "newmark_displacement", "sliding_mode", "validity"]
"""


def run(text: str, path: Path, **options: Any) -> store.Report:
    return store.run(sweep_job(spec.parse(text, "a.toml")), path, command="slipsweep run a.toml", **options)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("split", [False, True])
def test_in_files_chunk_by_chunk_and_resumed(
    tmp_path: Path, dtype: str, split: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = f'{GRID}dtype = "{dtype}"\n'
    expected = slipsweep.sweep(**AXES, variables=BOTH).newmark_displacement.astype(dtype)
    path = tmp_path / ("chunks" if split else "a.nc")
    whole, calls = engine.newmark, 0

    def fails_later(asked: engine.Request) -> Any:
        nonlocal calls
        calls += 1
        if calls > 3:
            raise KeyboardInterrupt
        return whole(asked)

    with monkeypatch.context() as patch:
        patch.setattr(engine, "newmark", fails_later)
        with pytest.raises(KeyboardInterrupt):
            run(text, path, chunk_cells=100, split=split)
    report = run(text, path, chunk_cells=100, split=split, resume=True)
    files = sorted(path.iterdir()) if split else [path]
    with xr.open_mfdataset(files, combine="by_coords") if split else xr.open_dataset(path) as data:
        np.testing.assert_array_equal(data.newmark_displacement, expected)
        assert data.newmark_displacement.attrs["long_name"] == "permanent displacement of Newmark's block, downslope"
        assert data.newmark_displacement.dtype == dtype
    assert report.tally.ratios is not None
    found = slipsweep.sweep(**AXES, variables=BOTH)
    ratios = (found.permanent_displacement / found.newmark_displacement).values
    slides = np.isfinite(ratios) & (ratios != 0)
    assert report.tally.ratios.number == slides.sum()
    for share in (0.05, 0.5, 0.95):
        close = pytest.approx(np.quantile(ratios[slides], share, method="inverted_cdf"), rel=1e-3)
        assert report.tally.ratios.quantile(share) == close


def test_summary_and_info_tell_the_ratio(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = run(GRID, tmp_path / "a.nc", chunk_cells=100)
    told = results.read_contents(tmp_path / "a.nc").tally
    assert told == report.tally
    assert told is not None
    echo_tally(told)
    assert told.ratios is not None
    low, median, high = (f"{told.ratios.quantile(share):.3g}" for share in (0.05, 0.5, 0.95))
    line = f"displacement over Newmark's, where both slide: median {median}, 5 to 95 % {low} to {high}\n"
    assert capsys.readouterr().out.endswith(line)


def test_ratios_of_any_sign_and_size_are_in_order() -> None:
    values = np.array([-3e4, -2.0, -1e-9, 1e-30, 0.5, 1.0, 7.0, 1e12, math.nan, 0.0])
    ratios = Ratios()
    ratios.add(values[:5], np.ones(5))
    other = Ratios()
    other.add(values[5:], np.ones(5))
    other.add(np.array([1.0, 1.0]), np.array([0.0, math.nan]))
    ratios.merge(other)
    assert ratios.number == 8
    for at, value in enumerate(values[:8]):
        assert ratios.quantile((at + 0.5) / 8) == pytest.approx(value, rel=1e-3)
    assert math.isnan(Ratios().quantile(0.5))


def test_ratios_of_a_large_grid_are_those_of_its_parts() -> None:
    values = np.random.default_rng(1).lognormal(0.0, 2.0, (300, 1, 700))
    values[::7] = math.nan
    whole, parts = Ratios(), Ratios()
    whole.add(values, np.full(values.shape, -2.0))
    for row in values:
        parts.add(row, np.full(row.shape, -2.0))
    assert whole.counts == parts.counts
    assert whole.number == np.isfinite(values).sum()
    assert whole.quantile(0.25) == pytest.approx(np.nanquantile(values / -2.0, 0.25, method="inverted_cdf"), rel=1e-3)
