"""Charts: what they show is the model's, and nothing is read that they do not show."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib.image
import netCDF4
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch

import slipsweep
from slipsweep.charts import answers, book, curves, kinds, maps, sheet
from slipsweep.charts.accessor import DatasetSource
from slipsweep.charts.answers import boundaries, newmark
from slipsweep.charts.sheet import Sheet
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Look
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.explore.excerpt import read_excerpt
from slipsweep.explore.page import cell_arrays, page
from slipsweep.files import spec
from slipsweep.files import storing as store
from slipsweep.files.jobs import sweep_job
from slipsweep.model.variables import NOTES
from tests.support.commands import command

SWEEP = """
[axes.theta]
start = 0
stop = 20
num = 11
[axes.mu_s]
values = [0.2, 0.3, 0.45, 0.6]
[axes.amplitude]
start = 0.5
stop = 13.5
num = 53
[axes.frequency]
start = 0.2
stop = 20
num = 25
spacing = "log"
[excitation]
cycles = 5
"""

CASES = """
[[cases]]
label = "gentle"
theta = 2
mu_s = 0.4
[[cases]]
label = "steep"
theta = 12
mu_s = 0.5
"""

PLANE = """
[axes.amplitude]
start = 1
stop = 12
num = 23
[axes.frequency]
values = [1, 2, 4]
"""


def made(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.nc"
    store.run(sweep_job(spec.parse(text, name)), path, command="slipsweep run")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("charts")


@pytest.fixture(scope="module")
def grid(folder: Path) -> Path:
    return made(folder, "grid", SWEEP)


@pytest.fixture
def result(grid: Path) -> Iterator[Result]:
    with Result(grid) as opened:
        yield opened


def plane(result: Result, *names: str, x: str = "frequency", y: str = "amplitude", **at: float) -> Any:
    return result.select([*names, "validity"], {x: result.thinned(x), y: result.thinned(y)}, at)


def contours(table: Any, x: str = "frequency", y: str = "amplitude", **look: Any) -> Figure:
    return maps.contours(Sheet(table, x, y, Look(**look)), "permanent_displacement")


def modes(table: Any, x: str, y: str) -> Figure:
    return maps.modes(Sheet(table, x, y, Look()))


def named(axes: Any, begin: str) -> list[Any]:
    """Lines of some axes whose label begins so."""
    return [line for line in axes.lines if str(line.get_label()).startswith(begin)]


def found(figure: Figure, gid: str) -> Any:
    """The artist of a chart's main axes with a name."""
    (artist,) = [child for child in figure.axes[0].get_children() if child.get_gid() == gid]
    return artist


def inside(patch: PathPatch, points: Any) -> Any:
    """Which points a patch of rectangles covers."""
    found = np.zeros(len(points), bool)
    for vertices in patch.get_path().to_polygons():
        polygon = np.asarray(vertices)
        found |= ((points > polygon.min(axis=0) + 1e-9) & (points < polygon.max(axis=0) - 1e-9)).all(axis=1)
    return found


# ------------------------------------------------------------------------------- lines


def test_lines_of_yield_and_mode_limit_lie_where_the_equations_put_them(result: Result) -> None:
    table = plane(result, "permanent_displacement", theta=6, mu_s=0.45)
    figure = contours(table)
    expected = slipsweep.friction_parameters(6.0, 0.45, 1.0)
    for name in ("yield_acceleration", "limiting_acceleration"):
        line = found(figure, name)
        np.testing.assert_array_equal(line.get_xdata(), result.axes["frequency"])
        np.testing.assert_allclose(line.get_ydata(), expected[name].item(), rtol=1e-14)


@pytest.mark.parametrize("upright", [True, False])
def test_lines_over_an_angle_are_curves(result: Result, upright: bool) -> None:
    x, y = ("theta", "amplitude") if upright else ("amplitude", "theta")
    table = plane(result, "sliding_mode", x=x, y=y, mu_s=0.3, frequency=1.0)
    figure = modes(table, x, y)
    expected = slipsweep.friction_parameters(result.axes["theta"], 0.3, 1.0)
    stable = expected.yield_acceleration.values > 0
    assert 0 < stable.sum() < stable.size
    line = found(figure, "yield_acceleration")
    along, values = (line.get_xdata(), line.get_ydata()) if upright else (line.get_ydata(), line.get_xdata())
    np.testing.assert_array_equal(along, result.axes["theta"])
    np.testing.assert_allclose(values[stable], expected.yield_acceleration.values[stable], rtol=1e-14)
    assert np.isnan(values[~stable]).all()


def test_lines_over_displacement_amplitude(folder: Path) -> None:
    """A = ω²d: on the line of yield d = Üy/ω²."""
    axes = PLANE.replace(
        "[axes.amplitude]\nstart = 1\nstop = 12", "[axes.displacement_amplitude]\nstart = 0.01\nstop = 0.4"
    )
    path = made(folder, "given_d", f"{axes}\n[axes.theta]\nvalues = [5]\n[axes.mu_s]\nvalues = [0.4]")
    with Result(path) as opened:
        table = plane(opened, "permanent_displacement", y="displacement_amplitude")
        figure = contours(table, y="displacement_amplitude")
    threshold = slipsweep.friction_parameters(5.0, 0.4, 1.0).yield_acceleration.item()
    expected = threshold / (2 * np.pi * np.array([1.0, 2.0, 4.0])) ** 2
    np.testing.assert_allclose(found(figure, "yield_acceleration").get_ydata(), expected, rtol=1e-13)


def test_lines_in_a_plane_without_the_amplitude(result: Result) -> None:
    """Where neither axis is the amplitude, the line is where the amplitude of the slice is Üy."""
    table = plane(result, "sliding_mode", x="theta", y="mu_s", amplitude=3.0, frequency=1.0)
    (segment,) = found(modes(table, "theta", "mu_s"), "yield_acceleration").allsegs[0]
    for theta, mu_s in segment:
        threshold = slipsweep.friction_parameters(theta, mu_s, 1.0).yield_acceleration.item()
        # within a coarse cell of the grid the line is straight, Üy(θ, μs) nearly so
        assert threshold == pytest.approx(table["amplitude"].item(), rel=0.02)


def test_newmark_has_no_mode_limit(folder: Path) -> None:
    text = f'{PLANE}\n[axes.theta]\nvalues = [5]\n[axes.mu_s]\nvalues = [0.4]\n[model]\nfriction = "newmark"'
    with Result(made(folder, "newmark", text)) as opened:
        assert list(boundaries(plane(opened, "permanent_displacement"))) == ["yield_acceleration"]


def test_contours_lie_where_the_displacement_is_their_level(result: Result) -> None:
    table = plane(result, "permanent_displacement", theta=6, mu_s=0.45)
    figure = contours(table)
    drawn: list[Any] = [c for c in figure.axes[0].get_children() if c.get_gid() == "contours"]
    assert len(drawn) == 2  # below the mode limit and beyond it
    limit = slipsweep.friction_parameters(6.0, 0.45, 1.0).limiting_acceleration.item()
    checked = 0
    for side in drawn:
        for level, segments in zip(side.levels, side.allsegs, strict=True):
            points = np.concatenate([*segments, np.empty((0, 2))])
            # between rows the amplitude is interpolated too
            # (those moved onto the mode limit are tested below)
            shown = points[np.isclose(points[:, 1:], result.axes["amplitude"]).any(axis=1)]
            rows = shown[abs(shown[:, 1] - limit) > 1e-6][::5]
            for frequency, amplitude in rows:
                exact = slipsweep.sweep(
                    6.0, 0.45, amplitude, frequency, excitation=slipsweep.Sine(cycles=5)
                ).permanent_displacement.item()
                # straight in f between points a factor of 1.21 apart
                assert exact == pytest.approx(10**level, rel=0.02)
            checked += len(rows)
    assert checked > 20


# ---------------------------------------------------------------------------- hatching


@pytest.mark.parametrize("x", ["theta", "frequency"])
def test_hatching_is_exactly_where_validity_says_so(result: Result, x: str) -> None:
    keep = {"amplitude": slice(None), x: slice(None)}
    cut = {"theta": 4.0} if x == "frequency" else {"frequency": 1.0}
    table = result.select(["sliding_mode", "validity"], keep, {"mu_s": 0.2, **cut})
    figure = modes(table, x, "amplitude")
    validity = table["validity"].values if table["validity"].dims == ("amplitude", x) else table["validity"].values.T
    patches = {p.get_gid(): p for p in figure.axes[0].patches if isinstance(p, PathPatch)}
    for mode in slipsweep.SlidingMode:
        patches.pop(mode.name.lower().replace("_", "–"), None)
    points = np.stack(np.meshgrid(table[x].values, table["amplitude"].values), axis=-1).reshape(-1, 2)
    seen = np.zeros(validity.shape, int)
    for flag in ~NOTES:
        if (validity & int(flag)).any():
            patch = patches.pop((flag.name or "").lower())
            assert patch.get_hatch()
            seen |= inside(patch, points).reshape(validity.shape) * int(flag)
    assert not patches
    assert (seen != 0).any()
    np.testing.assert_array_equal(seen, validity & ~int(NOTES))


def test_all_flags_but_notes_are_hatched() -> None:
    assert slipsweep.Validity(sum(maps.HATCHES)) == ~NOTES
    assert len({*maps.HATCHES.values()}) == len(maps.HATCHES)


# -------------------------------------------------------------------- scaled and compared


def test_frequencies_collapse_in_the_dimensionless_chart(result: Result) -> None:
    keep: dict[str, Any] = {"amplitude": slice(None), "frequency": [0, 11, 24], "mu_s": [1, 3]}
    table = result.select(["permanent_displacement", "validity"], keep, {"theta": 6})
    drawn = Sheet(table, "amplitude", "mu_s", Look())
    scaled = curves.dimensionless_curves(drawn.panels[0], table["permanent_displacement"])
    assert len(scaled) == 6
    for member, mu_s in enumerate((0.3, 0.6)):
        expected = slipsweep.friction_parameters(6.0, mu_s, 1.0).yield_acceleration.item()
        xs, ys = scaled[member, 0]
        np.testing.assert_allclose(xs, result.axes["amplitude"] / expected, rtol=1e-14)
        assert np.nanmax(ys) > 1
        for number in (1, 2):
            np.testing.assert_array_equal(scaled[member, number][0], xs)
            np.testing.assert_allclose(scaled[member, number][1], ys, rtol=1e-13)
    figure = curves.dimensionless(drawn)
    assert figure.axes[0].get_xlabel().endswith("A / Üy")


def test_the_dimensionless_chart_marks_cautions(lined: Path) -> None:
    """As curves over the amplitude do: jumps at the mode limit lie in it."""
    figure = drawn(lined, "dimensionless", y="mu_s", at={"theta": 11, "mu_s": (0.25, 0.45)})
    amplitudes = xr.open_dataset(lined).amplitude.values
    marks = [line for line in figure.axes[0].lines if line.get_gid() == "caution"]
    for line, mu_s in zip(marks, (0.25, 0.45), strict=True):
        direct = slipsweep.sweep(11.0, mu_s, amplitudes, 1.0, excitation=slipsweep.Sine(cycles=15))
        flags = slipsweep.flags(direct)
        expected = flags.near_mode_limit.values & ~flags.not_recoupled.values
        assert expected.any()
        onset = slipsweep.friction_parameters(11.0, mu_s, 1.0).yield_acceleration.item()
        xs, ys = (np.asarray(one, float) for one in line.get_data())
        np.testing.assert_allclose(xs, amplitudes / onset, rtol=1e-14)
        np.testing.assert_array_equal(np.isfinite(ys), expected)
    assert "caution:\nnear_mode_limit" in legend(figure)


def test_ratio_to_newmark_is_that_of_a_direct_sweep(result: Result) -> None:
    table = plane(result, "permanent_displacement", x="theta", mu_s=0.45, frequency=2.0)
    values = table["permanent_displacement"]
    ratio = sheet.ratios(values, newmark(table), table).T
    given: dict[str, Any] = {
        "theta": result.axes["theta"],
        "mu_s": 0.45,
        "amplitude": result.axes["amplitude"],
        "frequency": table["frequency"].item(),
        "excitation": slipsweep.Sine(cycles=5),
    }
    ours, theirs = (
        slipsweep.sweep(**given, model=model).permanent_displacement.values.T for model in ("mendez", "newmark")
    )
    sliding = theirs > 0
    assert sliding.any()
    np.testing.assert_array_equal(ratio[sliding], (ours / theirs.clip(1e-300))[sliding])
    assert np.isnan(ratio[(ours == 0) & (theirs == 0)]).all()


def test_curves_break_at_the_mode_limit(result: Result) -> None:
    keep: dict[str, Any] = {"amplitude": slice(None), "frequency": [5, 20]}
    table = result.select(["permanent_displacement", "validity"], keep, {"theta": 6, "mu_s": 0.45})
    axes = curves.families(Sheet(table, "amplitude", "frequency", Look()), "permanent_displacement").axes[0]
    limit = slipsweep.friction_parameters(6.0, 0.45, 1.0).limiting_acceleration.item()
    jumps = [line for line in axes.lines if line.get_gid() == "jump"]
    for number, (line, jump) in enumerate(zip(named(axes, "f = "), jumps, strict=True)):
        frequency = table["frequency"].values[number]
        exact = [
            slipsweep.sweep(6.0, 0.45, amplitude, frequency, excitation=slipsweep.Sine(cycles=5))
            for amplitude in (limit, np.nextafter(limit, np.inf))
        ]
        ends = [one.permanent_displacement.item() * 1000 for one in exact]
        assert [one.sliding_mode.item() for one in exact] == [1, 2]
        xs, ys = (np.asarray(one, float) for one in line.get_data())
        (gap,) = np.flatnonzero(np.isnan(ys) & (xs == limit))
        np.testing.assert_allclose(ys[[gap - 1, gap + 1]], ends, rtol=1e-12)
        np.testing.assert_array_equal(jump.get_xdata(), [limit, limit])
        np.testing.assert_allclose(np.asarray(jump.get_ydata(), float), ends, rtol=1e-12)
        expected = table["permanent_displacement"].values[:, number] * 1000
        np.testing.assert_array_equal(ys[np.isfinite(ys) & (xs != limit)], expected[expected > 0])


# ------------------------------------------------------------------------- what is read


def test_only_what_is_shown_is_read(grid: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Counting the values that come out of the file, chart by chart."""
    read: dict[str, int] = {}
    original = Result.read

    def counted(self: Result, name: str, where: Mapping[str, Any]) -> Any:
        values = original(self, name, where)
        read[name] = read.get(name, 0) + values.size
        return values

    monkeypatch.setattr(Result, "read", counted)
    monkeypatch.setattr("slipsweep.cli.chart.write_figure", lambda *arguments: None)  # all is read before
    thetas, amplitudes, frequencies = 11, 53, 25
    expected = {
        "contours": {"permanent_displacement": amplitudes * frequencies, "validity": amplitudes * frequencies},
        "modes": {"sliding_mode": thetas * amplitudes, "validity": thetas * amplitudes},
        "families": {"permanent_displacement": 5 * amplitudes, "validity": 5 * amplitudes},  # every sixth
        "dimensionless": {"permanent_displacement": 12 * amplitudes, "validity": 12 * amplitudes},
        "newmark": {"permanent_displacement": thetas * amplitudes, "validity": thetas * amplitudes},
        "spread": {"permanent_displacement": amplitudes, "validity": amplitudes},
    }
    for kind, counts in expected.items():
        read.clear()
        assert main(["chart", str(grid), "--kind", kind, "-o", str(tmp_path / f"{kind}.png")]) == 0
        assert {name: n for name, n in read.items() if name not in Result(grid).axes} == counts


@pytest.mark.parametrize(("theta", "mu_s"), [(6.0, 0.45), (4.9, 0.45), (6.0, 0.37), (19.3, 0.59)])
def test_slices_are_at_the_very_values_asked_for(result: Result, theta: float, mu_s: float) -> None:
    """Where the file has none it is solved anew."""
    table = plane(result, "permanent_displacement", theta=theta, mu_s=mu_s)
    assert (table["theta"].item(), table["mu_s"].item()) == (theta, mu_s)
    direct = slipsweep.sweep(
        theta, mu_s, result.axes["amplitude"], result.axes["frequency"], excitation=slipsweep.Sine(cycles=5)
    )
    np.testing.assert_allclose(table["permanent_displacement"].values, direct.permanent_displacement, rtol=1e-13)
    np.testing.assert_array_equal(table["validity"].values, direct.validity)
    if (theta, mu_s) == (6.0, 0.45):  # read
        result.attrs["cycles"] = 1
        again = plane(result, "permanent_displacement", theta=theta, mu_s=mu_s)
        np.testing.assert_array_equal(again["permanent_displacement"].values, table["permanent_displacement"].values)


def test_values_that_nothing_lies_between_are_refused_with_their_neighbours(folder: Path) -> None:
    with (
        Result(made(folder, "numbered", CASES + PLANE)) as opened,
        pytest.raises(InputError, match=r"case = 1.5: not among the values of the file.* its neighbours are 1 and 2"),
    ):
        opened.places({"case": 1.5})
    measured = xr.DataArray([0.5, 0.6, 0.7], dims="theta", coords={"theta": [0.0, 3.0, 6.0]})
    dataset = slipsweep.sweep([0.0, 3.0, 6.0], 0.4, [2.0, 3.0], 1.0, yield_acceleration=measured)
    with (
        Result(DatasetSource(dataset)) as opened,
        pytest.raises(
            InputError,
            match=r"theta = 4: .*yield_acceleration is known at those values only; its neighbours are 3 and 6",
        ),
    ):
        opened.places({"theta": 4})


def test_long_axes_are_thinned(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipsweep.charts.slices.MOST_POINTS", 10)
    assert result.thinned("frequency") == slice(0, 25, 3)
    assert result.spread("frequency", 4) == [0, 8, 16, 24]


# ----------------------------------------------------------------------- the command line


@pytest.mark.usefixtures("without_layout")
def test_default_set_of_charts(grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(grid)]) == 0
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted(f"grid-{kind}.png" for kind in kinds.SORTS["sweep"])
    for name in names:
        image = matplotlib.image.imread(tmp_path / name)
        assert image.shape[1] == 1050
        assert image[..., :3].std() > 0.05
    assert main(["chart", str(grid)]) == 2  # nothing is overwritten unasked
    assert main(["chart", str(grid), "--kind", "modes", "--overwrite"]) == 0


@pytest.mark.usefixtures("without_layout")
def test_formats(grid: Path, tmp_path: Path) -> None:
    cuts = ("--at", "theta=12", "--at", "mu_s=0.5")
    outputs = [f"-oa.{suffix}" for suffix in ("png", "svg", "pdf")]
    done = command(tmp_path, "chart", grid, *cuts, "--kind", "contours", *outputs)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["a.png", "a.svg", "a.pdf"]
    assert matplotlib.image.imread(tmp_path / "a.png").shape[2] == 4
    assert ElementTree.parse(tmp_path / "a.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF-")
    assert b"%%EOF" in (tmp_path / "a.pdf").read_bytes()[-10:]


def test_every_axis_has_its_unit_and_the_caption_its_parameters(result: Result) -> None:
    table = plane(result, "permanent_displacement", theta=6, mu_s=0.45)
    figure = contours(table)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "excitation frequency f (Hz)"
    assert axes.get_ylabel() == "peak ground acceleration A (m/s²)"
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert all(label.get_text().endswith("m") for label in figure.axes[-1].get_yticklabels())
    caption = figure.get_supxlabel()
    assert caption.startswith(
        "θ = 6°, μs = 0.45\nÜy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated\n"
        "Mendez et al. 2012, monotone rise, recoupling by Eq. 12; 5 cycles of a sine; slipsweep "
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--x", "freqency"), 'freqency: no such axis; did you mean "frequency"? there are theta, mu_s,'),
        (("--at", "thta=3"), 'thta = 3: no such axis; did you mean "theta"?'),
        (("--at", "theta=45"), "theta = 45: outside the file's range, 0 to 20 degree"),
        (("--at", "theta=nan"), "theta = nan: outside"),
        (("--at", "theta=steep"), 'theta = "steep": must be a number, with a unit that converts to degree'),
        (("--at", "amplitude=0.3Hz"), 'amplitude = "0.3Hz": must be a number, with a unit that converts to m s-2'),
        (("--at", "mu_s=0.3g"), 'mu_s = "0.3g": must be a number'),
        (("--at", "amplitude=3g"), "amplitude = 29.43: outside the file's range"),
        (("--at", "theta"), "--at theta: must be NAME=VALUE"),
        (("--at", "theta=1", "--at", "theta=2"), "theta is given twice"),
        (("--kind", "contour"), 'did you mean "contours"?'),
        (("--kind", "contours", "--variable", "displacement"), 'did you mean "permanent_displacement"?'),
        (("--kind", "contours", "--variable", "validity"), "is a code"),
        (("--kind", "contours", "--x", "theta", "--y", "theta"), "two different axes"),
        (("--kind", "contours", "--x", "theta", "--at", "theta=3"), "is an axis of this chart"),
        (("-o", "a.png"), "give one --kind"),
        (("--kind", "modes", "--levels", "1cm,2cm"), "--levels 1cm,2cm: only with --kind contours"),
        (("--levels", "1cm,2kg"), 'levels = "2kg": must be a number, with a unit that converts to m'),
        (("--levels", "1cm,-1cm"), "levels: -0.01: must be > 0"),
        (("--levels", "1cm"), "levels: 1cm: must be two different values or more"),
        (("--kind", "contours", "--panels", "theta,mu_s,frequency"), "must be one axis or two"),
        (("--kind", "spread", "--y", "theta"), "--y theta: not with spread"),
        (("--kind", "modes", "-o", "a.gif"), "must end in one of .png, .svg, .pdf"),
    ],
)
def test_bad_commands(
    grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(grid), *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("slipsweep: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert list(tmp_path.iterdir()) == []


def test_cuts_with_units(grid: Path) -> None:
    with Result(grid) as opened:
        for text, number in (("0.4g", 0.4 * 9.81), ("400 cm/s^2", 4.0)):
            assert opened.places({"amplitude": text}) == opened.places({"amplitude": number})
        assert opened.places({"theta": "0.2rad"}) == opened.places({"theta": 180 / np.pi * 0.2})
        assert opened.places({"frequency": "1200mHz", "mu_s": "0.45"}) == opened.places(
            {"frequency": 1.2, "mu_s": 0.45}
        )


def test_not_a_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.nc").write_text("no")
    netCDF4.Dataset(tmp_path / "other.nc", "w").close()
    refused = {"text.nc": "not a netCDF", "other.nc": "not written by slipsweep", "none.nc": "no such file"}
    for name, message in refused.items():
        assert main(["chart", str(tmp_path / name)]) == 2
        assert message in capsys.readouterr().err


def test_cases_alone_are_no_chart(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = CASES.replace("theta", "amplitude = 4\nfrequency = 1\ntheta")
    path = made(folder, "rows", rows)
    assert main(["chart", str(path), "--kind", "contours", "-o", str(tmp_path / "a.png")]) == 2
    assert "no axis of two values or more (its dimensions: case, 2)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_case_is_chosen_by_its_name(folder: Path) -> None:
    with Result(made(folder, "cases", CASES + PLANE)) as opened:
        table = opened.select(
            ["permanent_displacement"], {"amplitude": slice(None), "frequency": slice(None)}, {"case": "steep"}
        )
        with pytest.raises(InputError, match="must be a number or one of gentle, steep"):
            opened.places({"case": "stepe"})
    assert (table["theta"].item(), table["mu_s"].item(), table.attrs["picked"]["case"]) == (12.0, 0.5, "steep")
    direct = slipsweep.sweep(12.0, 0.5, table["amplitude"].values, table["frequency"].values)
    np.testing.assert_allclose(table["permanent_displacement"].values, direct.permanent_displacement, rtol=1e-13)
    figure = contours(table)
    assert figure.get_supxlabel().startswith("case steep: θ = 12°")


# ------------------------------------------------------------- results with little to draw

SMALL = """
[axes.theta]
values = [0, 5, 30]
[axes.mu_s]
values = [0.3, 0.5]
[axes.amplitude]
values = [1, 2, 4, 7]
[axes.frequency]
values = [1, 2, 4]
"""


@pytest.fixture(scope="module")
def small(folder: Path) -> Path:
    return made(folder, "small", SMALL)


def one_value(values: Any) -> Any:
    values = np.zeros_like(values)
    values[1, 0, 3, 1] = 0.05
    return values


@pytest.mark.parametrize(
    ("fill", "undrawn"),
    [
        (np.zeros_like, {"families", "dimensionless"}),
        (lambda values: np.full_like(values, np.nan), {"families", "dimensionless"}),
        (lambda values: np.full_like(values, -0.2), {"families", "dimensionless"}),
        (one_value, set()),
        (lambda values: np.full_like(values, 5e-324), set()),
        (lambda values: np.geomspace(1e-300, 1e30, values.size).reshape(values.shape), set()),
        (lambda values: np.full_like(values, np.inf), {"contours", "families", "dimensionless", "newmark", "spread"}),
    ],
)
def test_what_can_be_drawn_is_drawn_and_the_rest_named(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    fill: Any, undrawn: set[str],
) -> None:  # fmt: skip
    path = tmp_path / "a.nc"
    path.write_bytes(small.read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        file.set_auto_mask(False)
        file["permanent_displacement"][:] = fill(file["permanent_displacement"][:])
    monkeypatch.chdir(tmp_path)
    assert main(["chart", "a.nc"]) == 0
    output = capsys.readouterr().out
    there = {kind for kind in kinds.SORTS["sweep"] if (tmp_path / f"a-{kind}.png").exists()}
    assert there == set(kinds.SORTS["sweep"]) - undrawn
    assert {line.split(":")[0] for line in output.splitlines() if ".png" not in line} == {f"no {k}" for k in undrawn}
    for kind in undrawn:
        assert main(["chart", "a.nc", "--kind", kind, "-o", "b.png"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    if "newmark" in undrawn:
        with pytest.raises(InputError, match="displacement: holds inf; what is drawn must be within"):
            read_excerpt(path, 1000)
    else:
        excerpt = read_excerpt(path, 1000)
        page(excerpt, cell_arrays(excerpt), None, "a.nc", "")


def test_a_single_value_is_seen(small: Path) -> None:
    """A line through one point is none: it has a marker."""
    with Result(small) as opened:
        table = opened.select(
            ["permanent_displacement", "validity"],
            {"amplitude": slice(None), "frequency": [0, 1]},
            {"theta": 0, "mu_s": 0.5},
        )
    table.data_vars["permanent_displacement"].values[:-1] = 0.0
    figure = curves.families(Sheet(table, "amplitude", "frequency", Look()), "permanent_displacement")
    for line in named(figure.axes[0], "f = "):
        marked = np.asarray(line.get_markevery())
        assert line.get_marker() not in ("", "None")
        assert np.isfinite(np.asarray(line.get_ydata())[marked]).tolist() == [True]


# ----------------------------------------------------------------- what is fit for a journal

# a lined slope: the interface is weak, the block does not come to rest, and ends upslope
LINED = """
[axes.theta]
values = [8, 11, 14]
[axes.mu_s]
values = [0.25, 0.35, 0.45]
[axes.amplitude]
start = 0.02
stop = 0.8
num = 40
units = "g"
[axes.frequency]
values = [0.5, 1, 2]
[excitation]
cycles = 15
"""


@pytest.fixture(scope="module")
def lined(folder: Path) -> Path:
    return made(folder, "lined", LINED)


def drawn(path: Path, kind: str, **wish: Any) -> Any:
    with Result(path) as opened:
        return kinds.draw(opened, kind, kinds.Wish(**wish))


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_values_that_are_not_to_be_relied_on_leave_a_gap(lined: Path) -> None:
    direct = slipsweep.sweep(
        14.0, 0.25, xr.open_dataset(lined).amplitude.values, 1.0, excitation=slipsweep.Sine(cycles=15)
    )
    flags = slipsweep.flags(direct)
    left_out = (flags.not_recoupled | flags.upslope).values
    assert flags.not_recoupled.any()
    assert flags.upslope.any()
    for shown in (False, True):
        figure = drawn(lined, "families", at={"theta": 14, "mu_s": (0.25, 0.35)}, look=Look(show_cautions=shown))
        (line,) = named(figure.axes[0], "μs = 0.25")
        xs, ys = (np.asarray(one, float) for one in line.get_data())
        seen = [bool(np.isfinite(ys[xs == amplitude]).any()) for amplitude in direct.amplitude.values]
        expected = ~flags.upslope.values if shown else ~left_out  # a logarithmic axis has no place for upslope
        np.testing.assert_array_equal(seen, expected & (direct.permanent_displacement.values > 0))
        assert left_out_of(figure) == (["upslope"] if shown else ["not_recoupled", "upslope"])
        assert ("Drawn on request: values flagged not_recoupled" in figure.get_supxlabel()) == shown


def left_out_of(figure: Figure) -> list[str]:
    """The flags whose values a caption says are left out."""
    (sentence,) = (line for line in figure.get_supxlabel().splitlines() if line.startswith("Left out"))
    return re.findall(r"(\w+) \(", sentence)


def test_velocities_upslope_are_drawn_if_asked_for(lined: Path) -> None:
    """The largest downslope velocity of a block that ends upslope is above zero: a scale has a place for it."""
    at: dict[str, Any] = {"theta": 14, "mu_s": (0.25, 0.35)}
    figure = drawn(lined, "families", at=at, variable="peak_relative_velocity", look=Look(show_cautions=True))
    (line,) = named(figure.axes[0], "μs = 0.25")
    assert np.isfinite(np.asarray(line.get_ydata(), float)[-1])
    assert "Left out" not in figure.get_supxlabel()
    assert "upslope (ends above where it began)" in figure.get_supxlabel()


def test_the_order_of_dimensions_does_not_matter(lined: Path) -> None:
    with Result(lined) as opened:
        keep: dict[str, Any] = {"theta": slice(None), "amplitude": slice(None)}
        table = opened.select(["permanent_displacement", "validity"], keep, {"mu_s": 0.25})
    straight = sheet.reliable(table.data_vars, "permanent_displacement", Look())
    validity = table["validity"]
    turned = {**table.data_vars, "validity": xr.Variable(validity.dims[::-1], validity.values.T)}
    again = sheet.reliable(turned, "permanent_displacement", Look())
    assert np.isnan(straight.values).any()
    np.testing.assert_array_equal(again.values, straight.values)


@pytest.mark.parametrize("kind", ["contours", "newmark"])
def test_contours_leave_them_out_too(lined: Path, kind: str) -> None:
    figure = drawn(lined, kind, x="frequency", at={"theta": 14, "mu_s": 0.25})
    patch = found(figure, "not_recoupled")
    assert patch.get_facecolor()[3] == 0.0
    for lines in (child for child in figure.axes[0].get_children() if child.get_gid() == "contours"):
        for segments in lines.allsegs:
            for segment in segments:
                assert not inside(patch, segment).any()
    assert left_out_of(figure) == ["not_recoupled", "upslope"]


def test_fills_and_contours_end_on_the_mode_limit(lined: Path) -> None:
    """From below as from above: no cell is left white, and none is coloured by what lies beyond the jump."""
    with Result(lined) as opened:
        table = opened.select(
            ["permanent_displacement", "validity"], {"theta": slice(None), "amplitude": slice(None)}, {"mu_s": 0.35}
        )
    panel = Sheet(table, "theta", "amplitude", Look()).panels[0]
    shaking = slipsweep.Sine(cycles=15)

    def at_limit(_: Any) -> Any:
        sides = answers.sides_of(panel.lines["limiting_acceleration"])
        return answers.solve(table, ["permanent_displacement"], **sides)["permanent_displacement"]

    limits = slipsweep.friction_parameters(table["theta"].values, 0.35, 1.0).limiting_acceleration.values
    sides = maps._sides(panel, table["permanent_displacement"], at_limit)
    for (_, ys, values), amplitudes, row in zip(sides, (limits, np.nextafter(limits, 99)), (-1, 0), strict=True):
        np.testing.assert_allclose(ys[row], limits, rtol=1e-14)
        for theta, amplitude, value in zip(table["theta"].values, amplitudes, values[row], strict=True):
            exact = slipsweep.sweep(theta, 0.35, amplitude, 1.0, excitation=shaking).permanent_displacement.item()
            assert value == pytest.approx(exact, rel=1e-12)


def test_ratios_diverge_from_one(lined: Path) -> None:
    bar = drawn(lined, "newmark").axes[-1]
    levels = [float(text.get_text()) for text in bar.get_yticklabels()]
    np.testing.assert_allclose(levels, 1 / np.array(levels[::-1]), rtol=0.02)
    assert not any(level == 1 for level in levels)
    colours = maps.RATIO_COLOURS.resampled(len(levels) + 1)
    middle = colours(len(levels) // 2)[:3]
    assert min(middle) > 0.9
    assert max(abs(np.subtract(colours(0)[:3], colours(len(levels))[:3]))) > 0.3


def test_curves_and_modes_differ_without_colour(lined: Path) -> None:
    figure = drawn(lined, "families", y="mu_s", at={"theta": 11})
    looks = [(str(line._dash_pattern), line.get_marker()) for line in named(figure.axes[0], "μs")]
    assert len(set(looks)) == len({dash for dash, _ in looks}) == len({marker for _, marker in looks}) == 3
    patches = {p.get_gid(): p for p in drawn(lined, "modes").axes[0].patches}
    hatches = [patches[mode].get_hatch() or "" for mode in ("stuck", "stick–slip", "continuous")]
    assert len(set(hatches)) == 3
    grey = [np.dot(patches[mode].get_facecolor()[:3], (0.3, 0.59, 0.11)) for mode in ("stuck", "stick–slip")]
    assert grey[0] > grey[1] + 0.1


def test_newmark_is_beside_every_displacement(lined: Path) -> None:
    figure = drawn(lined, "families", y="mu_s", at={"theta": 11})
    classical = [line for line in figure.axes[0].lines if line.get_gid() == "newmark"]
    for line, mu_s in zip(classical, (0.25, 0.35, 0.45), strict=True):
        direct = slipsweep.sweep(
            11.0, mu_s, np.asarray(line.get_xdata(), float), 1.0, model="newmark", excitation=slipsweep.Sine(cycles=15)
        ).permanent_displacement.values
        np.testing.assert_allclose(np.asarray(line.get_ydata(), float), np.where(direct > 0, direct * 1000, np.nan))
    assert "Newmark (same dash)" in legend(figure)
    for kind in ("contours", "families", "dimensionless", "newmark"):
        assert "Displacement over that of Newmark's block" in drawn(lined, kind).get_supxlabel()


def test_the_ratio_in_the_caption_is_that_of_the_cells_shown(lined: Path) -> None:
    figure = drawn(lined, "contours", x="theta", at={"mu_s": 0.25})
    file = xr.open_dataset(lined).sel(mu_s=0.25, frequency=1)
    ours, theirs = (
        slipsweep.sweep(file.theta.values, 0.25, file.amplitude.values, 1.0, model=model,
                        excitation=slipsweep.Sine(cycles=15))
        for model in ("mendez", "newmark")
    )  # fmt: skip
    there = slipsweep.flags(ours).not_recoupled.values == 0
    ratio = ours.permanent_displacement.values / theirs.permanent_displacement.values.clip(1e-300)
    ratio = ratio[there & (theirs.permanent_displacement.values > 0) & (ratio > 0)]
    low, middle, high = np.quantile(ratio, (0.05, 0.5, 0.95))
    assert f"median {middle:.3g}, in 90 % of the cells {low:.3g} to {high:.3g}." in figure.get_supxlabel()


def test_a_spread_in_panels_names_the_result_once() -> None:
    """The heavy line is one entry of the legend, whatever differs from panel to panel."""
    result = slipsweep.sweep(
        xr.DataArray([5.0, 6.0], dims="case"),
        0.38,
        np.linspace(3, 6, 5),
        1.8,
        decay_rate=xr.DataArray([2.7, 2.3], dims="case"),
    )
    entries = [text for text in legend(result.slipsweep.chart("spread", panels=["case"])) if "this result" in text]
    assert entries == ["this result:\nλ as given, stop by Eq. 12"]


def test_spread_is_between_the_answers_there_are(lined: Path) -> None:
    figure = drawn(lined, "spread", at={"theta": 11, "mu_s": 0.35})
    axes = figure.axes[0]
    amplitudes = xr.open_dataset(lined).amplitude.values
    given: dict[str, Any] = {"theta": 11.0, "mu_s": 0.35, "amplitude": amplitudes, "frequency": 1.0}
    given["excitation"] = slipsweep.Sine(cycles=15)
    expected = {"Newmark": slipsweep.sweep(**given, model="newmark")}
    for recoupling, text in (("eq12", "stop by Eq. 12"), ("integrate", "stop by integration")):
        model = slipsweep.Mendez(recoupling=recoupling)  # type: ignore[arg-type]
        expected[f"λ by Eq. 6, {text}"] = slipsweep.sweep(**given, model=model)
        for rate in (2.0, 3.0):
            expected[f"λ = {rate:g}, {text}"] = slipsweep.sweep(**given, model=model, decay_rate=rate)
    expected["this result:\nλ by Eq. 6, stop by Eq. 12"] = expected["λ by Eq. 6, stop by Eq. 12"]
    # in this slice nothing is left out; of the measured interface's stick-slip the answer by Eqs. 6 and 12 is
    assert "Left out" not in figure.get_supxlabel()
    interface = slipsweep.sweep(
        5.0,
        0.38,
        np.linspace(3, 6, 9),
        1.8,
        yield_acceleration=0.59,
        decay_rate=2.7,
        excitation=slipsweep.Sine(cycles=5),
    )
    assert not slipsweep.flags(interface).not_recoupled.any()
    caption = interface.slipsweep.chart("spread").get_supxlabel()
    assert "Left out: values flagged not_recoupled (" in caption
    assert "upslope" not in caption
    rows = []
    for label, answer in expected.items():
        (line,) = named(axes, label)
        xs, ys = (np.asarray(one, float) for one in line.get_data())
        values = answer.permanent_displacement.values * 1000
        on_axis = np.isin(xs, amplitudes)
        np.testing.assert_allclose(ys[on_axis], np.where(values > 0, values, np.nan), rtol=1e-12)
        assert label in legend(figure)
        rows.append(values)
    (band,) = (child for child in axes.collections if child.get_gid() == "spread")
    vertices = np.concatenate([path.vertices for path in band.get_paths()])
    high = np.max(rows, axis=0)
    for amplitude, most in zip(amplitudes, high, strict=True):
        if most > 0:
            assert vertices[vertices[:, 0] == amplitude, 1].max() == pytest.approx(most, rel=1e-12)


def test_acceleration_in_g(lined: Path) -> None:
    for units, ends, label, other in (
        ("m/s2", (0.1962, 7.848), "(m/s²)", "A (g)"),
        ("g", (0.02, 0.8), "(g)", "A (m/s²)"),
    ):
        figure = drawn(lined, "contours", x="theta", look=Look(units=units))  # type: ignore[arg-type]
        axes = figure.axes[0]
        assert axes.get_ylim() == pytest.approx(ends)
        assert axes.get_ylabel().endswith(label)
        (second,) = axes.child_axes
        assert second.get_ylabel() == other
        factor = 9.81 if units == "g" else 1 / 9.81
        assert second.get_ylim() == pytest.approx([end * factor for end in ends])
        line = found(figure, "yield_acceleration")
        expected = slipsweep.friction_parameters([8.0, 11.0, 14.0], 0.35, 1.0).yield_acceleration.values
        np.testing.assert_allclose(line.get_ydata(), expected / (9.81 if units == "g" else 1), rtol=1e-14)
    assert (
        "A = 0.5 g"
        in drawn(lined, "modes", x="theta", y="mu_s", at={"amplitude": "0.5g"}, look=Look("g")).get_supxlabel()
    )


def test_levels(lined: Path, tmp_path: Path) -> None:
    with Result(lined) as opened:
        levels = kinds.levels_of(opened, "permanent_displacement", ["1cm", "50 mm", 0.3])
    assert levels == (0.01, 0.05, 0.3)
    figure = drawn(lined, "contours", look=Look(levels=levels))
    assert [text.get_text() for text in figure.axes[-1].get_yticklabels()] == ["10 mm", "50 mm", "300 mm"]
    nothing = slipsweep.sweep([40.0, 50.0], 0.3, [2.0, 3.0], 1.0).slipsweep.chart("contours", levels=["1cm", "2cm"])
    assert "No contours: no values." in nothing.get_supxlabel()
    by_default = drawn(lined, "contours")
    assert by_default.axes[-1].get_yticklabels()[-1].get_text() == "1 m"  # nobody designs for ten


@pytest.mark.parametrize("kind", kinds.SORTS["sweep"])
def test_panels(lined: Path, kind: str) -> None:
    x = {"x": "theta"} if kind in ("contours", "modes", "newmark") else {}
    figure = drawn(lined, kind, panels=["mu_s"], at={"mu_s": "0.25,0.4"}, **x)
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in panels] == ["μs = 0.25", "μs = 0.4"]
    assert panels[0].get_ylim() == panels[1].get_ylim()
    with Result(lined) as opened, pytest.raises(InputError, match="--panels"):
        kinds.draw(opened, kind, kinds.Wish(panels=["mu_s", "mu_s"]))


def test_cases_tell_curves_and_panels_apart(folder: Path) -> None:
    path = made(folder, "by_case", CASES + PLANE)
    figure = drawn(path, "families", y="case", at={"frequency": 2})
    assert [line.get_label() for line in named(figure.axes[0], "gentle") + named(figure.axes[0], "steep")] == [
        "gentle",
        "steep",
    ]
    (line,) = named(figure.axes[0], "steep")
    assert "steep: θ = 12°, μs = 0.5." in figure.get_supxlabel()
    limit = slipsweep.friction_parameters(12.0, 0.5, 1.0).limiting_acceleration.item()
    assert limit in np.asarray(line.get_xdata())
    assert [axes.get_title() for axes in drawn(path, "contours", panels=["case"]).axes[:2]] == ["gentle", "steep"]
    with Result(path) as opened, pytest.raises(InputError, match="case: the cases have no order"):
        kinds.draw(opened, "contours", kinds.Wish(x="case"))


@pytest.mark.parametrize("kind", kinds.SORTS["sweep"])
def test_nothing_is_cut_and_no_entry_is_without_its_mark(lined: Path, kind: str) -> None:
    for wish in ({"at": {"mu_s": 0.25}}, {"panels": ["mu_s"]}):
        figure = drawn(lined, kind, **wish)
        figure.draw_without_rendering()
        width, height = figure.get_size_inches()
        drawn_in = figure.get_tightbbox()
        assert min(drawn_in.x0, drawn_in.y0) >= -0.01
        assert drawn_in.x1 <= width + 0.01
        assert drawn_in.y1 <= height + 0.01
        handles = figure.legends[0].legend_handles
        assert len(handles) == len(legend(figure))
        for handle in handles:
            if isinstance(handle, Line2D):
                assert handle.get_linestyle() not in ("", "None") or handle.get_marker() not in ("", "None")
            else:
                assert isinstance(handle, Patch)
                assert handle.get_hatch() or tuple(handle.get_facecolor())[3:] != (0.0,)


def test_the_dataset_draws_what_the_file_does(lined: Path) -> None:
    dataset = xr.open_dataset(lined)
    figure = dataset.slipsweep.chart("families", y="mu_s", at={"theta": 11}, units="g")
    expected = drawn(lined, "families", y="mu_s", at={"theta": 11}, look=Look("g"))
    assert figure.get_supxlabel() == expected.get_supxlabel()
    for ours, theirs in zip(figure.axes[0].lines, expected.axes[0].lines, strict=True):
        np.testing.assert_array_equal(ours.get_xydata(), theirs.get_xydata())
    solved = slipsweep.sweep([8.0, 11.0], 0.3, [1.0, 2.0, 3.0], 1.0)
    assert solved.slipsweep.chart("contours", x="theta").axes[0].get_xlabel() == "base inclination θ (°)"
    xr.testing.assert_identical(solved.slipsweep.flags(), slipsweep.flags(solved))
    with pytest.raises(InputError, match='did you mean "modes"'):
        solved.slipsweep.chart("mode")


@pytest.mark.usefixtures("without_layout")
def test_all_of_a_file_is_a_pdf_with_a_title_page(
    lined: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(lined), "-o", "all.pdf"]) == 0
    assert capsys.readouterr().out == "all.pdf\n"
    pages = (tmp_path / "all.pdf").read_bytes().count(b"/Type /Page ")
    assert pages == 1 + len(kinds.SORTS["sweep"])
    with Result(lined) as opened:
        title = book.title_page(opened)
    for one in title.texts:
        assert one.get_window_extent().x1 < 0.95 * title.bbox.width, one.get_text()
    text = "\n".join(one.get_text() for one in title.texts)
    assert "base inclination θ: 8 to 14°, 3 values" in text
    assert "Permanent displacement" in text
    assert f"slipsweep {slipsweep.__version__}" in text
    for flag in maps.HATCHES:
        assert f"{(flag.name or '').lower()} (" in text
