"""Charts of sweeps: what they show is the model's, and nothing is read that they do not show."""

import itertools
import re
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import slipsweep
from slipsweep.charts import kinds, maps, solved, style
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Options
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files.selection import find, places_at
from slipsweep.model.variables import NOTES

SINE = slipsweep.Sine(cycles=5)
AMPLITUDES = np.linspace(0.5, 13.5, 53)
FREQUENCIES = np.geomspace(0.2, 20, 25)

SWEEP_KINDS = list(kinds.kinds_of("sweep"))

#: A lined slope: the interface is weak, the block does not come to rest, and ends upslope.
LINED_SINE = slipsweep.Sine(cycles=15)


@pytest.fixture(scope="module")
def grid() -> xr.Dataset:
    return slipsweep.sweep(
        np.arange(0, 21, 2.0), [0.2, 0.3, 0.45, 0.6], AMPLITUDES, FREQUENCIES, excitation=SINE
    )


@pytest.fixture(scope="module")
def lined() -> xr.Dataset:
    amplitudes = np.linspace(0.02, 0.8, 40) * 9.81
    return slipsweep.sweep(
        [8.0, 11.0, 14.0], [0.25, 0.35, 0.45], amplitudes, [0.5, 1, 2], excitation=LINED_SINE
    )


@pytest.fixture(scope="module")
def path(grid: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("charts") / "grid.nc"
    grid.to_netcdf(found)
    return found


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def named(figure: Figure, gid: str) -> list[Any]:
    """The artists of a chart's first axes with a name."""
    return [child for child in figure.axes[0].get_children() if child.get_gid() == gid]


def labelled(figure: Figure, begin: str) -> list[Any]:
    """Lines of a chart's first axes whose label begins so."""
    return [line for line in figure.axes[0].lines if str(line.get_label()).startswith(begin)]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def caption(figure: Figure) -> str:
    """A caption as one line."""
    return " ".join(figure.get_supxlabel().split())


def inside(area: Any, cells: Any) -> Any:
    """Which points a filled area covers, those on its edge among them."""
    (path,) = area.get_paths()
    return path.contains_points(cells, radius=1e-9) | path.contains_points(cells, radius=-1e-9)


# -------------------------------------------------------------------------- lines and contours


@pytest.mark.parametrize(
    ("x", "y"), [("frequency", "amplitude"), ("theta", "amplitude"), ("amplitude", "theta")]
)
def test_lines_of_yield_and_mode_limit_lie_where_the_equations_put_them(
    grid: xr.Dataset, x: str, y: str
) -> None:
    at = {"theta": 6, "mu_s": 0.3} if x == "frequency" else {"frequency": 1, "mu_s": 0.3}
    figure = grid.slipsweep.chart("modes", x=x, y=y, at=at)
    other = x if y == "amplitude" else y
    thetas = 6.0 if other == "frequency" else grid.theta.values
    expected = slipsweep.friction_parameters(thetas, 0.3, 1.0)
    for gid, name in (
        ("yield_line", "yield_acceleration"),
        ("limit_line", "limiting_acceleration"),
    ):
        (line,) = named(figure, gid)
        vertices = np.concatenate(line.allsegs[0])
        along, values = vertices.T if y == "amplitude" else vertices.T[::-1]
        on_grid = np.isin(along, grid[other])
        assert on_grid.sum() > 3
        stable = expected[name].where(expected.yield_acceleration > 0)
        stable = stable.sel(theta=along[on_grid]) if stable.dims else stable
        np.testing.assert_allclose(values[on_grid], stable, rtol=1e-12)


def test_lines_over_a_displacement_amplitude() -> None:
    """A = ω²d: on the line of yield d = Üy/ω²."""
    result = slipsweep.sweep(
        5.0, 0.4, displacement_amplitude=np.linspace(0.01, 0.4, 23), frequency=[1.0, 2.0, 4.0]
    )
    (line,) = named(result.slipsweep.chart("contours"), "yield_line")
    threshold = slipsweep.friction_parameters(5.0, 0.4, 1.0).yield_acceleration.item()
    frequencies, amplitudes = np.concatenate(line.allsegs[0]).T
    on_grid = np.isin(frequencies, result.frequency)
    assert on_grid.sum() >= 2
    expected = threshold / (2 * np.pi * frequencies) ** 2
    np.testing.assert_allclose(amplitudes[on_grid], expected[on_grid], rtol=1e-12)


def test_contours_lie_where_the_displacement_is_their_level(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    drawn = named(figure, "contours")
    assert len(drawn) == 2  # below the mode limit and beyond it
    assert all(len(segments[0]) for segments in drawn[0].allsegs)
    checked = 0
    for side in drawn:
        for level, segments in zip(side.levels, side.allsegs, strict=True):
            every = np.concatenate([*segments, np.empty((0, 2))])
            # between rows the amplitude is interpolated too
            rows = every[np.isclose(every[:, 1:], AMPLITUDES).any(axis=1)][::5]
            for frequency, amplitude in rows:
                exact = slipsweep.sweep(
                    6.0, 0.45, amplitude, frequency, excitation=SINE
                ).permanent_displacement
                assert exact.item() == pytest.approx(
                    10**level, rel=0.02
                )  # straight in f between points
            checked += len(rows)
    assert checked > 20


def test_what_does_not_slide_has_no_colour_of_a_displacement(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    figure.draw_without_rendering()
    axes = figure.axes[0]
    threshold = slipsweep.friction_parameters(6.0, 0.45, 1.0).yield_acceleration.item()
    covers = [one for one in axes.collections if one.get_zorder() == 1.05]
    low, high = covers[0].get_paths()[0].get_extents().intervaly
    assert low <= axes.get_ylim()[0]
    assert high == pytest.approx(threshold, rel=1e-12)
    np.testing.assert_array_equal(covers[0].get_facecolor(), [[1, 1, 1, 1]])
    assert min(style.COLOURS(0)[:3]) < 0.9  # not the white of no sliding
    assert legend(figure)[0] == legend(grid.slipsweep.chart("modes"))[0] == "no sliding"


# ---------------------------------------------------------------------------- hatching


@pytest.mark.parametrize("x", ["theta", "frequency"])
def test_hatching_is_where_validity_says_so(grid: xr.Dataset, x: str) -> None:
    at = {"mu_s": 0.2, **({"theta": 4.0} if x == "frequency" else {"frequency": 1.0})}
    figure = grid.slipsweep.chart("modes", x=x, at=at)
    cells = grid.validity.sel(at, method="nearest").transpose("amplitude", x)
    mesh = np.stack(np.meshgrid(grid[x], grid.amplitude), axis=-1).reshape(-1, 2)
    seen = 0
    for flag in ~NOTES:
        expected = (cells.values & int(flag)) != 0
        name = (flag.name or "").lower()
        patches = named(figure, name)
        small = re.search(rf"{name} \((\d+) cell", caption(figure))
        left = int(small[1]) if small else 0
        covered = (
            inside(patches[0], mesh).reshape(cells.shape)
            if patches
            else np.zeros(cells.shape, bool)
        )
        assert not (covered & ~expected).any()
        assert (
            covered.sum() + left == expected.sum()
        )  # regions too small for a hatch are counted in the caption
        assert all(patch.hatches[0] for patch in patches)
        seen += covered.sum()
    assert seen > 0


def test_all_flags_but_notes_have_a_hatch_of_their_own() -> None:
    assert slipsweep.Validity(sum(maps.HATCHES)) == ~NOTES
    assert len({*maps.HATCHES.values(), maps.UNSOUND_HATCH}) == len(maps.HATCHES) + 1


def test_what_no_block_does_is_marked_and_its_share_told(lined: xr.Dataset) -> None:
    """Displacements that fall with A, or lie below half of Newmark's: against sweeps of this test's own."""
    given: dict[str, Any] = {
        "theta": 14.0,
        "mu_s": 0.25,
        "frequency": 1.0,
        "excitation": LINED_SINE,
    }
    amplitudes = lined.amplitude.values
    ours = slipsweep.sweep(amplitude=amplitudes, **given)
    before = slipsweep.sweep(amplitude=amplitudes * 0.99, **given).permanent_displacement.values
    theirs = slipsweep.sweep(
        amplitude=amplitudes, model="newmark", **given
    ).permanent_displacement.values
    u = ours.permanent_displacement.values
    flags = slipsweep.flags(ours)
    shown = (u > 0) & ~flags.not_recoupled.values
    falls = shown & (u < before)
    below = shown & (u < theirs / 2)
    assert falls.any()
    assert below.any()
    figure = lined.slipsweep.chart("curve", at={"theta": 14, "mu_s": 0.25, "frequency": 1})
    (line,) = named(figure, "unsound")
    xs, ys = line.get_data()
    np.testing.assert_array_equal(np.isin(amplitudes, xs[np.isfinite(ys)]), falls | below)
    share = [f"{100 * one.sum() / shown.sum():.2g} %" for one in (falls | below, falls, below)]
    trends = f"The displacement falls with A in {share[1]} and lies below half of Newmark's in {share[2]}"
    assert f"{share[0]} of the sliding cells shown. {trends}" in caption(figure)
    ratio = lined.slipsweep.chart("newmark", at={"mu_s": 0.25, "frequency": 1})
    (patch,) = named(ratio, style.UNSOUND)
    cells = np.stack([np.full_like(amplitudes, 14.0), amplitudes], axis=-1)
    np.testing.assert_array_equal(inside(patch, cells), falls | below)
    sound = slipsweep.sweep(5.0, 0.4, [2.0, 4.0, 6.0], 1.0, model="newmark").slipsweep.chart(
        "curve"
    )
    assert "falls with A" not in caption(sound)


def test_shares_of_what_is_unsound_are_those_of_all_cells() -> None:
    """Of some 300 000 cells half are counted: to a percent or two what all of them say, on axes long and short."""
    axes = (
        np.linspace(0, 20, 11),
        np.linspace(0.2, 0.9, 8),
        np.geomspace(0.5, 14, 61),
        np.geomspace(0.1, 20, 58),
    )
    result = slipsweep.sweep(*axes)
    slides = result.permanent_displacement.where(~slipsweep.flags(result).not_recoupled) > 0
    estimated = slides & (result.sliding_mode == 2) & slipsweep.flags(result).friction_estimated
    trends, continuous = solved.unsound_texts(result)
    share, counted = re.findall(
        r"^([\d.]+) % .* \(counted in (\d+) cells, evenly spaced\)$", continuous
    )[0]
    assert abs(float(share) - 100 * float(estimated.sum() / slides.sum())) < 1.5
    assert 100_000 < int(counted) < 250_000
    assert trends.startswith("the displacement falls with A in ")


# -------------------------------------------------------------------- curves


def test_one_curve_has_newmarks_beside(grid: xr.Dataset, lined: xr.Dataset) -> None:
    """Over the frequency, the amplitude and ky; with one axis left it is what is drawn."""
    at: dict[str, Any] = {"theta": 6, "mu_s": 0.45}
    for x, cut in (("amplitude", {"frequency": 2.0}), ("frequency", {"amplitude": 9.0})):
        figure = grid.slipsweep.chart(at=at | cut)
        given: dict[str, Any] = {x: grid[x].values, **cut, "excitation": SINE}
        ours, theirs = (
            slipsweep.sweep(6.0, 0.45, **given, model=model).permanent_displacement.values * 1000
            for model in ("mendez", "newmark")
        )
        xs, ys = labelled(figure, "this result")[0].get_data()
        on_grid = np.isin(xs, grid[x]) & np.isfinite(ys)
        np.testing.assert_allclose(ys[on_grid], ours[np.isin(grid[x], xs[on_grid])], rtol=1e-12)
        assert on_grid.sum() > 10
        (line,) = named(figure, "newmark")
        np.testing.assert_allclose(
            line.get_ydata(), np.where(theirs > 0, theirs, np.nan), rtol=1e-12
        )
        lines = (
            {"yield": "yield_line", "mode limit (Eq. 7)": "limit_line"} if x == "amplitude" else {}
        )
        assert {*legend(figure)} >= {"Newmark's block", *lines}
        marks = [line.get_xdata()[0] for gid in lines.values() for line in named(figure, gid)]
        assert marks == pytest.approx(
            [3.2306287100, 7.9326887206] if lines else []
        )  # g tan(φ − θ), Eq. 7


def test_newmarks_block_over_its_yield_coefficient(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ky = np.linspace(0.05, 0.4, 8)
    given: dict[str, Any] = {
        "amplitude": np.linspace(1, 6, 11),
        "frequency": [0.5, 1, 2],
        "model": "newmark",
    }
    result = slipsweep.sweep(yield_coefficient=ky, **given)
    result.to_netcdf("ky.nc")
    assert main(["chart", "ky.nc"]) == 0
    assert capsys.readouterr().out.split() == [
        f"ky-{kind}.png" for kind in ("contours", "modes", "families", "dimensionless")
    ]
    assert main(["report", "ky.nc"]) == 0
    assert (
        Path("ky.pdf").read_bytes().count(b"/Type /Page ") == 1 + 4
    )  # no ratio of Newmark's block to itself
    for at in ({"amplitude": 3.0, "frequency": 1}, {"ky": ky[2], "frequency": 1}):
        figure = result.slipsweep.chart(at=at)
        expected = result.permanent_displacement.rename(yield_coefficient="ky").sel(at) * 1000
        xs, ys = labelled(figure, "Newmark's block")[0].get_data()
        np.testing.assert_array_equal(xs, expected[expected.dims[0]])
        np.testing.assert_allclose(ys, expected.where(expected > 0))
        assert ("no sliding: Üy above A" in legend(figure)) == ("amplitude" in at)
    (line,) = named(result.slipsweep.chart("modes", at={"frequency": 1}), "yield_line")
    along, amplitudes = np.concatenate(line.allsegs[0]).T
    np.testing.assert_allclose(amplitudes, along * 9.81, rtol=1e-12)
    assert along.size > 5


def test_the_dimensionless_chart_is_of_any_frequency(grid: xr.Dataset) -> None:
    for frequency in FREQUENCIES[[0, 24]]:
        at = {"theta": 6, "mu_s": (0.3, 0.6), "frequency": frequency}
        figure = grid.slipsweep.chart("dimensionless", y="mu_s", at=at)
        for mu_s in (0.3, 0.6):
            onset = slipsweep.friction_parameters(6.0, mu_s, 1.0).yield_acceleration.item()
            found = dict(zip(*labelled(figure, f"μs = {mu_s:g}")[0].get_data(), strict=True))
            u = grid.permanent_displacement.sel(
                theta=6, mu_s=mu_s, frequency=FREQUENCIES[12]
            ).values
            ys = np.array([found[x] for x in AMPLITUDES / onset])
            there = np.isfinite(ys) & (ys > 0)
            expected = u * (2 * np.pi * FREQUENCIES[12]) ** 2 / AMPLITUDES
            np.testing.assert_allclose(ys[there], expected[there], rtol=1e-12)
        assert figure.axes[0].get_xlabel().endswith("A / Üy")


def test_ratio_to_newmark_is_that_of_a_direct_sweep(lined: xr.Dataset) -> None:
    at = {"mu_s": 0.25, "frequency": 1}
    figure = lined.slipsweep.chart("contours", x="theta", at=at)
    given: dict[str, Any] = {
        "theta": lined.theta.values,
        "mu_s": 0.25,
        "amplitude": lined.amplitude.values,
    }
    ours, theirs = (
        slipsweep.sweep(**given, frequency=1.0, model=model, excitation=LINED_SINE)
        for model in ("mendez", "newmark")
    )
    kept = slipsweep.flags(ours).not_recoupled.values == 0
    ratio = ours.permanent_displacement.values / theirs.permanent_displacement.values.clip(1e-300)
    ratio = ratio[kept & (theirs.permanent_displacement.values > 0) & (ratio > 0)]
    low, middle, high = np.quantile(ratio, (0.05, 0.5, 0.95))
    text = f"median {middle:.3g}; 90 % of the sliding cells shown lie between {low:.3g} and {high:.3g}."
    assert text in caption(figure)


def test_curves_break_at_the_mode_limit(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart(
        "families", at={"theta": 6, "mu_s": 0.45, "frequency": (1.0, 5.0)}
    )
    limit = slipsweep.friction_parameters(6.0, 0.45, 1.0).limiting_acceleration.item()
    beyond = int(np.searchsorted(AMPLITUDES, limit))
    for line, jump in zip(labelled(figure, "f = "), named(figure, "jump"), strict=True):
        xs, ys = line.get_data()
        assert (xs[beyond], np.isnan(ys[beyond])) == (AMPLITUDES[beyond], True)
        np.testing.assert_array_equal(jump.get_xdata(), AMPLITUDES[[beyond - 1, beyond]])
        np.testing.assert_array_equal(jump.get_ydata(), ys[[beyond - 1, beyond + 1]])


def test_values_that_are_unreliable_leave_a_gap(lined: xr.Dataset) -> None:
    direct = slipsweep.sweep(14.0, 0.25, lined.amplitude.values, 1.0, excitation=LINED_SINE)
    flags = slipsweep.flags(direct)
    assert flags.not_recoupled.any()
    assert flags.upslope.any()
    at: dict[str, Any] = {"theta": 14, "frequency": 1, "mu_s": (0.25, 0.35)}
    for shown in (False, True):
        figure = lined.slipsweep.chart("families", at=at, show_cautions=shown)
        xs, ys = labelled(figure, "μs = 0.25")[0].get_data()
        seen = [
            bool(np.isfinite(ys[xs == amplitude]).any()) for amplitude in direct.amplitude.values
        ]
        # a logarithmic axis has no place for upslope
        expected = ~flags.upslope.values if shown else ~(flags.not_recoupled | flags.upslope).values
        np.testing.assert_array_equal(seen, expected & (direct.permanent_displacement.values > 0))
        text = caption(figure)
        assert ("Drawn on request: values flagged not_recoupled" in text) == shown
        assert ("Left out: values flagged not_recoupled (does not come to rest" in text) == (
            not shown
        )
        (mark,) = [one for one in named(figure, "caution") if np.isfinite(one.get_ydata()).any()][
            :1
        ]
        assert mark.get_linewidth() > 5
    velocity = lined.slipsweep.chart(
        "families",
        y="mu_s",
        at=at | {"mu_s": (0.25,)},
        variable="peak_relative_velocity",
        show_cautions=True,
    )
    assert np.isfinite(
        labelled(velocity, "μs = 0.25")[0].get_ydata()[-1]
    )  # of a block that ends upslope it is above 0


@pytest.mark.parametrize("kind", ["contours", "newmark"])
def test_contours_leave_them_out_too(lined: xr.Dataset, kind: str) -> None:
    figure = lined.slipsweep.chart(kind, x="frequency", at={"theta": 14, "mu_s": 0.25})
    (patch,) = named(figure, "not_recoupled")
    for lines in named(figure, "contours"):
        for segment in (one for segments in lines.allsegs for one in segments):
            assert not inside(patch, segment).any()


def test_a_single_point_is_barred_too_and_angles_are_not_logarithmic() -> None:
    result = slipsweep.sweep([8.0, 11.0, 14.0, 18.4], 0.35, 4.905, 1.0, excitation=LINED_SINE)
    figure = result.slipsweep.chart("curve", x="theta", width="90mm")
    assert figure.axes[0].get_xscale() == "linear"
    (line,) = named(figure, "caution")
    there = np.isfinite(line.get_ydata())
    assert there.any()
    assert line.get_marker() == "."
    figure.draw_without_rendering()
    label = figure.axes[0].yaxis.label.get_window_extent()
    assert label.y1 <= figure.legends[0].get_window_extent().y0
    assert [solved.percent(share) for share in (1.0, 0.996, 0.054, 0.00312)] == [
        "100 %",
        "100 %",
        "5.4 %",
        "0.31 %",
    ]


def test_labels_of_panels_lie_apart(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("dimensionless", panels=["theta"])
    figure.draw_without_rendering()
    boxes = [axes.xaxis.label.get_window_extent() for axes in figure.axes]
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


def test_spread_is_between_the_options_there_are(lined: xr.Dataset) -> None:
    figure = lined.slipsweep.chart("spread", at={"theta": 11, "mu_s": 0.35, "frequency": 1})
    amplitudes = lined.amplitude.values
    given: dict[str, Any] = {"theta": 11.0, "mu_s": 0.35, "amplitude": amplitudes, "frequency": 1.0}
    given["excitation"] = LINED_SINE
    expected = {"Newmark's block": slipsweep.sweep(**given, model="newmark")}
    for recoupling, text in (("eq12", "stop by Eq. 12"), ("integrate", "stop by integration")):
        model = slipsweep.Mendez(recoupling=recoupling)  # type: ignore[arg-type]
        expected[f"λ by Eq. 6, {text}"] = slipsweep.sweep(**given, model=model)
        for rate in (2.0, 3.0):
            expected[f"λ = {rate:g}, {text}"] = slipsweep.sweep(
                **given, model=model, decay_rate=rate
            )
    expected["this result:\nλ by Eq. 6, stop by Eq. 12"] = expected["λ by Eq. 6, stop by Eq. 12"]
    rows = []
    for label, answer in expected.items():
        xs, ys = labelled(figure, label)[0].get_data()
        values = answer.permanent_displacement.values * 1000
        at = np.searchsorted(xs, amplitudes, side="right") - 1  # behind the gap at the mode limit
        np.testing.assert_allclose(ys[at], np.where(values > 0, values, np.nan), rtol=1e-12)
        assert label in legend(figure)
        rows.append(values)
    vertices = np.concatenate([path.vertices for path in named(figure, "spread")[0].get_paths()])
    for amplitude, most in zip(amplitudes, np.max(rows, axis=0), strict=True):
        if most > 0:
            assert vertices[vertices[:, 0] == amplitude, 1].max() == pytest.approx(most, rel=1e-12)


# ------------------------------------------------------------------------- what is read, and where


def test_only_what_is_shown_is_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counting the values that are loaded, chart by chart."""
    read: Counter[str] = Counter()
    original = xr.Dataset.load

    def counted(self: xr.Dataset, **options: Any) -> xr.Dataset:
        read.update({str(name): one.size for name, one in self.data_vars.items()})
        return original(self, **options)

    # times 53 amplitudes: 25 frequencies, 11 angles, every sixth frequency, one, 4 coefficients of
    # friction
    curves = {
        "contours": 25,
        "modes": 11,
        "families": 5,
        "curve": 1,
        "dimensionless": 4,
        "newmark": 11,
        "spread": 1,
    }
    monkeypatch.setattr(xr.Dataset, "load", counted)
    with slipsweep.open_result(path) as data:
        for kind, count in curves.items():
            read.clear()
            kinds.draw(Result(data, "grid"), kind, Options())
            drawn = "sliding_mode" if kind == "modes" else "permanent_displacement"
            assert read == {drawn: count * 53, "validity": count * 53}


@pytest.mark.parametrize(("theta", "mu_s"), [(6.0, 0.45), (4.9, 0.45), (6.0, 0.37), (19.3, 0.59)])
def test_slices_are_at_the_very_values_requested(
    grid: xr.Dataset, theta: float, mu_s: float
) -> None:
    """Where the result has none the slice is solved."""
    keep: dict[str, Any] = {"frequency": slice(None), "amplitude": slice(None)}
    found = Result(grid, "grid").select(
        ["permanent_displacement", "validity"], keep, {"theta": theta, "mu_s": mu_s}
    )
    direct = slipsweep.sweep(theta, mu_s, AMPLITUDES, FREQUENCIES, excitation=SINE)
    for name in ("theta", "mu_s", "permanent_displacement", "validity"):
        np.testing.assert_array_equal(found[name].transpose(*direct[name].dims), direct[name])


def test_values_on_axes_are_found_as_messages_print_them(grid: xr.Dataset) -> None:
    result = slipsweep.sweep(5.0, [0.3, 1 / 3, 0.4], [0.3 * 9.81, 4.0], np.geomspace(0.3, 3, 7))
    printed = f"{result.frequency.values[2]:.4g}"
    for at, expected in (
        ({"amplitude": "0.3g"}, {"amplitude": [0]}),
        ({"amplitude": "294.3 cm/s^2, 4"}, {"amplitude": [0, 1]}),
        ({"mu_s": "0.3333", "theta": "5deg"}, {"mu_s": [1]}),
        ({"frequency": printed}, {"frequency": [2]}),
        ({"frequency": f"{printed}Hz"}, {"frequency": [2]}),
        ({"frequency": f"{float(printed) * 1000:g}mHz"}, {"frequency": [2]}),
    ):
        found = places_at(result, "result", at, list(map(str, result.dims)))
        assert {name: places.tolist() for name, places in found.items()} == expected
    assert find(result, {"mu_s": 0.3333})["mu_s"][0].index is None  # a number is what it is
    wrong: tuple[tuple[dict[str, Any], str], ...] = (
        (
            {"frequency": "1.2"},
            r"frequency = 1.2: not among the values of the result; its neighbours are 0.948683 and",
        ),
        ({"frequency": "1200mHz"}, "frequency = 1.2: not among the values"),
        ({"theta": 6}, "theta = 6: outside the range of the result, 5 degree"),
        ({"thta": 5}, 'did you mean "theta"'),
    )
    for cut, message in wrong:
        with pytest.raises(InputError, match=message):
            places_at(result, "result", cut, list(map(str, result.dims)))


def test_values_that_nothing_lies_between_are_refused_with_their_neighbours() -> None:
    measured = xr.DataArray([0.5, 0.6, 0.7], dims="theta", coords={"theta": [0.0, 3.0, 6.0]})
    result = slipsweep.sweep([0.0, 3.0, 6.0], 0.4, [2.0, 3.0], 1.0, yield_acceleration=measured)
    with pytest.raises(
        InputError,
        match=r"theta = 4: .*neighbours are 3 and 6 degree .yield_acceleration is known at",
    ):
        result.slipsweep.chart("families", at={"theta": 4})


# --------------------------------------------------------------------------- looks


def test_axes_have_units_and_the_caption_its_parameters(grid: xr.Dataset) -> None:
    figure = grid.slipsweep.chart("contours", at={"theta": 6, "mu_s": 0.45})
    axes = figure.axes[0]
    assert axes.get_xlabel() == "excitation frequency f (Hz)"
    assert axes.get_ylabel() == "peak ground acceleration A (m/s²)"
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert figure.get_supxlabel().startswith(
        "θ = 6°, μs = 0.45\nÜy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated\n"
        "Mendez et al. 2012, monotone rise, recoupling by Eq. 12; 5 cycles of a sine; slipsweep "
    )


def test_acceleration_in_g(lined: xr.Dataset) -> None:
    for units, ends, label, other in (
        ("m/s2", (0.1962, 7.848), "(m/s²)", "A (g)"),
        ("g", (0.02, 0.8), "(g)", "A (m/s²)"),
    ):
        figure = lined.slipsweep.chart("contours", x="theta", at={"mu_s": 0.35}, units=units)
        axes = figure.axes[0]
        assert axes.get_ylim() == pytest.approx(ends)
        assert axes.get_ylabel().endswith(label)
        (second,) = axes.child_axes
        assert second.get_ylabel() == other
        factor = 9.81 if units == "g" else 1 / 9.81
        assert second.get_ylim() == pytest.approx([end * factor for end in ends])
        expected = slipsweep.friction_parameters(lined.theta, 0.35, 1.0).yield_acceleration.values
        vertices = np.concatenate(named(figure, "yield_line")[0].allsegs[0])
        drawn = vertices[np.isin(vertices[:, 0], lined.theta), 1]
        np.testing.assert_allclose(
            drawn, np.sort(expected)[::-1] / (9.81 if units == "g" else 1), rtol=1e-12
        )
    modes = lined.slipsweep.chart("modes", x="theta", y="mu_s", at={"amplitude": "0.5g"}, units="g")
    assert "A = 0.5 g" in caption(modes)


def test_ratios_have_one_order_of_lightness() -> None:
    colours = style.ratio_colours(5)
    lightness = style.to_grey(colours(np.arange(colours.N)))[:, 0]
    assert (np.diff(lightness) < -0.01).all()
    assert np.ptp(colours(5)[:3]) < 0.01  # grey at 1
    assert colours(0)[0] > colours(0)[2]  # warm below
    assert colours(10)[0] < colours(10)[2]  # cold above


@pytest.mark.parametrize("kind", SWEEP_KINDS)
def test_a_narrow_grey_chart_is_legible(lined: xr.Dataset, kind: str) -> None:
    """Nothing is cut off, no legend lies on the data, no entry is without its mark, and nothing has a colour."""
    figure = lined.slipsweep.chart(
        kind, at={"mu_s": 0.25}, width=90 if kind == "modes" else "90mm", grey=True
    )
    figure.draw_without_rendering()
    width, height = figure.get_size_inches()
    assert width == pytest.approx(90 / 25.4)
    box = figure.get_tightbbox()
    assert min(box.x0, box.y0) >= -0.02
    assert box.x1 <= width + 0.02
    assert box.y1 <= height + 0.02
    frame = figure.legends[0].get_window_extent()
    assert not any(frame.overlaps(axes.get_window_extent()) for axes in figure.axes)
    for handle in figure.legends[0].legend_handles:
        assert handle is not None
        if isinstance(handle, Line2D):
            assert handle.get_linestyle() not in ("", "None") or handle.get_marker() not in (
                "",
                "None",
            )
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert np.ptp(np.asarray(canvas.buffer_rgba(), float)[..., :3], axis=-1).max() <= 2


@pytest.mark.parametrize("kind", ["contours", "newmark"])
def test_a_grey_colour_bar_has_the_same_numbers(lined: xr.Dataset, kind: str) -> None:
    bars = [
        lined.slipsweep.chart(kind, at={"mu_s": 0.25}, grey=grey).axes[-1] for grey in (False, True)
    ]
    coloured, grey = ([text.get_text() for text in bar.get_yticklabels()] for bar in bars)
    assert coloured == grey
    assert ("30 mm" if kind == "contours" else "3") in grey


def test_curves_and_modes_differ_without_colour(lined: xr.Dataset) -> None:
    figure = lined.slipsweep.chart("families", y="mu_s", at={"theta": 11})
    looks = [(str(line._dash_pattern), line.get_marker()) for line in labelled(figure, "μs")]
    assert len({dash for dash, _ in looks}) == len({marker for _, marker in looks}) == 3
    figure = lined.slipsweep.chart("modes")
    hatches = [named(figure, text)[0].hatches[0] for text in style.MODE_TEXT.values()]
    assert len(set(hatches)) == 3


@pytest.mark.parametrize("kind", [kind for kind in SWEEP_KINDS if kind != "curve"])
def test_panels(lined: xr.Dataset, kind: str) -> None:
    x = {"x": "theta"} if kind in ("contours", "modes", "newmark") else {}
    figure = lined.slipsweep.chart(kind, panels=["mu_s"], at={"mu_s": "0.25,0.4"}, **x)
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in panels] == ["μs = 0.25", "μs = 0.4"]
    assert panels[0].get_ylim() == panels[1].get_ylim()
    with pytest.raises(InputError, match="--panels"):
        lined.slipsweep.chart(kind, panels=["mu_s", "mu_s"])


def test_cases_tell_curves_and_panels_apart() -> None:
    result = slipsweep.sweep(
        xr.DataArray([2.0, 12.0], dims="case"),
        xr.DataArray([0.4, 0.5], dims="case"),
        np.linspace(1, 12, 23),
        [1, 2, 4],
    ).assign_coords(label=("case", ["gentle", "steep"]))
    figure = result.slipsweep.chart("families", y="case", at={"frequency": 2})
    (line,) = labelled(figure, "steep")
    assert "steep: θ = 12°, μs = 0.5." in caption(figure)
    np.testing.assert_array_equal(np.unique(line.get_xdata()), result.amplitude)
    panels = result.slipsweep.chart("contours", panels=["case"]).axes[:2]
    assert [axes.get_title() for axes in panels] == ["gentle", "steep"]
    picked = result.slipsweep.chart("contours", at={"case": "steep"})
    assert picked.get_supxlabel().startswith("case steep: θ = 12°")
    for options, message in (
        ({"x": "case"}, "--x case: no such axis; known here: amplitude, frequency"),
        ({"at": {"case": "stepe"}}, "must be a number or one of gentle, steep"),
        ({"at": {"case": 1.5}}, r"case = 1.5: must be a number or one of"),
    ):
        with pytest.raises(InputError, match=message):
            result.slipsweep.chart("contours", **options)


def test_what_is_not_to_be_read_is_said() -> None:
    """A coarse grid, estimated friction in continuous sliding; a slice at another friction angle is solved."""
    coarse = slipsweep.sweep(5.0, 0.3, [1.0, 3.0, 4.0, 9.0], [1.0, 2.0, 4.0])
    text = caption(coarse.slipsweep.chart("contours"))
    assert "Coarse grid: values grow more than tenfold from cell to cell" in text
    assert (
        "of the sliding cells slide continuously with estimated friction: not for design." in text
    )
    angles = slipsweep.sweep(5.0, phi=[20.0, 24.0], amplitude=[2.0, 4.0, 6.0], frequency=[1.0, 2.0])
    slices = Result(angles, "angles").select(
        ["permanent_displacement"], {"amplitude": slice(None)}, {"phi": 22.0}
    )
    own = slipsweep.sweep(5.0, phi=22.0, amplitude=[2.0, 4.0, 6.0], frequency=1.0)
    np.testing.assert_array_equal(slices.permanent_displacement, own.permanent_displacement)


def test_little_to_draw(grid: xr.Dataset) -> None:
    """All zero, all missing, one value: what can be drawn is, and the rest says why."""
    small = slipsweep.sweep([0.0, 5.0, 30.0], [0.3, 0.5], [1.0, 2.0, 4.0, 7.0], [1.0, 2.0, 4.0])
    for fill in (0.0, np.nan):
        data = small.assign(permanent_displacement=small.permanent_displacement * 0 + fill)
        result = Result(data, "small")
        options = Options()
        figures, left_out = kinds.draw_all(
            result, kinds.fitting(result, options), options, strict=False
        )
        assert set(left_out) == {"families", "dimensionless"}
        assert "No contours: no values" in caption(figures["contours"])
    single = small.permanent_displacement.where(small.amplitude == 7.0, 0.0)
    figure = small.assign(permanent_displacement=single).slipsweep.chart(
        "families", at={"theta": 0, "mu_s": 0.5}
    )
    for line in labelled(figure, "f = "):  # a line through one point is none: it has a marker
        assert np.isfinite(line.get_ydata()[np.asarray(line.get_markevery())]).tolist() == [True]


# ----------------------------------------------------------------------- the command line


@pytest.mark.usefixtures("without_layout")
def test_default_set_of_charts(path: Path, here: Path) -> None:
    assert main(["chart", str(path)]) == 0
    drawn = [kind for kind in SWEEP_KINDS if kind != "curve"]
    assert sorted(one.name for one in here.iterdir()) == sorted(
        f"grid-{kind}.png" for kind in drawn
    )
    for one in here.iterdir():
        image = matplotlib.image.imread(one)
        assert image.shape[1] == 1050
        assert image[..., :3].std() > 0.05
    assert main(["chart", str(path)]) == 2  # existing files are overwritten only with --overwrite
    assert main(["chart", str(path), "--kind", "modes", "--overwrite"]) == 0
    assert (
        main(["chart", str(path), "--at", "theta=6", "--at", "mu_s=0.45", "--at", "frequency=1"])
        == 0
    )
    assert Path("grid-curve.png").exists()


@pytest.mark.usefixtures("without_layout")
def test_formats(path: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = [f"-oa.{suffix}" for suffix in ("png", "svg", "pdf")]
    assert (
        main(
            [
                "chart",
                str(path),
                "--at",
                "theta=12",
                "--kind",
                "contours",
                "--width",
                "3.5inch",
                *outputs,
            ]
        )
        == 0
    )
    assert capsys.readouterr().out.split() == ["a.png", "a.svg", "a.pdf"]
    assert matplotlib.image.imread("a.png").shape[1] == 525
    assert ElementTree.parse("a.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert Path("a.pdf").read_bytes().startswith(b"%PDF-")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--at theta=45", "theta = 45: outside the range of the result, 0 to 20 degree"),
        (
            "--at theta=steep",
            'theta = "steep": must be a number, with a unit that converts to degree',
        ),
        ("--at theta", "--at theta: must be NAME=VALUE"),
        ("--kind contour", 'did you mean "contours"?'),
        ("--kind contours --variable validity", "is a code"),
        ("--kind contours --x theta --y theta", "--y theta: no such axis"),
        ("--kind contours --x theta --at theta=3", "is an axis of this chart"),
        (
            "-k modes --at theta=6 --at mu_s=0.3 --at frequency=1",
            "needs another axis with two values or more",
        ),
        ("-o a.png", "give one --kind"),
        ("-k contours --levels 1cm", "levels: 0.01: must be two different values or more"),
        ("--kind modes -o a.gif", "must end in one of .png, .svg, .pdf"),
        ("--kind modes --width 9mm", "width = 9mm: must be 50 to 1000 mm"),
    ],
)
def test_bad_commands(
    path: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: str, message: str
) -> None:
    assert main(["chart", str(path), *arguments.split()]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("slipsweep: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert list(here.iterdir()) == []


def test_the_title_page_names_axes_and_flags(path: Path) -> None:
    with slipsweep.open_result(path) as data:
        title = kinds.title_page(Result(data, "grid.nc"))
    text = "\n".join(one.get_text() for one in title.texts)
    assert " θ: 11 values, 0 to 20 degree" in text
    for flag in maps.HATCHES:
        assert f"{(flag.name or '').lower()} (" in text
    for one in title.texts:
        assert one.get_window_extent().x1 < 0.95 * title.bbox.width, one.get_text()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda data: data.assign_attrs(rise=7.5), "attributes do not say what was solved"),
        (
            lambda data: data.attrs.pop("recoupling"),
            "attribute 'recoupling': missing; it says what was solved",
        ),
        (
            lambda data: data.amplitude.attrs.update(units="g"),
            'amplitude: units = "g"; must be "m s-2"',
        ),
        (lambda data: data.isel(theta=slice(0)), "holds no cells"),
        (
            lambda data: data.swap_dims(theta="case").isel(amplitude=0, frequency=0),
            "needs an axis with two values",
        ),
    ],
)
def test_a_spoilt_result_is_refused_in_one_line(spoil: Any, message: str) -> None:
    data = slipsweep.sweep([5.0, 6.0], 0.3, [2.0, 4.0], [1.0, 2.0])
    changed = spoil(data)
    with pytest.raises(InputError, match=message):
        (changed if isinstance(changed, xr.Dataset) else data).slipsweep.chart("families")
