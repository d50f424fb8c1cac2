"""Charts: what they show is the model's, and nothing is read that they do not show."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib.image
import netCDF4
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

import slipsweep
from slipsweep.charts import charts
from slipsweep.charts.slices import Result, boundaries, newmark
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.explore import page as explore
from slipsweep.files import spec
from slipsweep.model.variables import NOTES
from slipsweep.runs import store
from slipsweep.runs.jobs import sweep_job
from tests.support.processes import slipsweep as command

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


def found(figure: Figure, gid: str) -> Any:
    """The artist of a chart's main axes with a name."""
    (artist,) = [child for child in figure.axes[0].get_children() if child.get_gid() == gid]
    return artist


# ------------------------------------------------------------------------------- lines


def test_lines_of_yield_and_mode_limit_lie_where_the_equations_put_them(result: Result) -> None:
    table = plane(result, "permanent_displacement", theta=6, mu_s=0.45)
    figure = charts.contours(table, boundaries(table), "permanent_displacement", "frequency", "amplitude")
    expected = slipsweep.friction_parameters(6.0, 0.45, 1.0)
    for name in ("yield_acceleration", "limiting_acceleration"):
        line = found(figure, name)
        np.testing.assert_array_equal(line.get_xdata(), result.axes["frequency"])
        np.testing.assert_allclose(line.get_ydata(), expected[name].item(), rtol=1e-14)


@pytest.mark.parametrize("upright", [True, False])
def test_lines_over_an_angle_are_curves(result: Result, upright: bool) -> None:
    x, y = ("theta", "amplitude") if upright else ("amplitude", "theta")
    table = plane(result, "sliding_mode", x=x, y=y, mu_s=0.3, frequency=1.0)
    figure = charts.modes(table, boundaries(table), x, y)
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
        figure = charts.contours(
            table, boundaries(table), "permanent_displacement", "frequency", "displacement_amplitude"
        )
    threshold = slipsweep.friction_parameters(5.0, 0.4, 1.0).yield_acceleration.item()
    expected = threshold / (2 * np.pi * np.array([1.0, 2.0, 4.0])) ** 2
    np.testing.assert_allclose(found(figure, "yield_acceleration").get_ydata(), expected, rtol=1e-13)


def test_lines_in_a_plane_without_the_amplitude(result: Result) -> None:
    """Where neither axis is the amplitude, the line is where the amplitude of the slice is Üy."""
    table = plane(result, "sliding_mode", x="theta", y="mu_s", amplitude=3.0, frequency=1.0)
    (segment,) = found(charts.modes(table, boundaries(table), "theta", "mu_s"), "yield_acceleration").allsegs[0]
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
    figure = charts.contours(table, boundaries(table), "permanent_displacement", "frequency", "amplitude")
    drawn: list[Any] = [c for c in figure.axes[0].get_children() if c.get_gid() == "contours of permanent_displacement"]
    assert len(drawn) == 2  # below the mode limit and beyond it
    checked = 0
    for side in drawn:
        for level, segments in zip(side.levels, side.allsegs, strict=True):
            points = np.concatenate([*segments, np.empty((0, 2))])
            # between rows the amplitude is interpolated too
            rows = points[np.isclose(points[:, 1:], result.axes["amplitude"]).any(axis=1)][::5]
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
    figure = charts.modes(table, boundaries(table), x, "amplitude")
    validity = table["validity"].values if table["validity"].dims == ("amplitude", x) else table["validity"].values.T
    patches = {p.get_gid(): p for p in figure.axes[0].patches if isinstance(p, PathPatch)}
    points = np.stack(np.meshgrid(table[x].values, table["amplitude"].values), axis=-1).reshape(-1, 2)
    seen = np.zeros(validity.shape, int)
    for flag in ~NOTES:
        if (validity & int(flag)).any():
            patch = patches.pop((flag.name or "").lower())
            assert patch.get_hatch()
            # a compound path is tested rectangle by rectangle
            inside = np.zeros(len(points), bool)
            for vertices in patch.get_path().to_polygons():
                polygon = np.asarray(vertices)
                (left, bottom), (right, top) = polygon.min(axis=0), polygon.max(axis=0)
                within = (points > (left, bottom)) & (points < (right, top))
                inside |= within.all(axis=1)
            seen |= inside.reshape(validity.shape) * int(flag)
    assert not patches
    assert (seen != 0).any()
    np.testing.assert_array_equal(seen, validity & ~int(NOTES))


# -------------------------------------------------------------------- scaled and compared


def test_frequencies_collapse_in_the_dimensionless_chart(result: Result) -> None:
    keep: dict[str, Any] = {"amplitude": slice(None), "frequency": [0, 11, 24], "mu_s": [1, 3]}
    table = result.select(["permanent_displacement"], keep, {"theta": 6})
    curves = charts.dimensionless_curves(table, boundaries(table), "mu_s")
    assert len(curves) == 6
    for member, mu_s in enumerate((0.3, 0.6)):
        expected = slipsweep.friction_parameters(6.0, mu_s, 1.0).yield_acceleration.item()
        xs, ys = curves[member, 0]
        np.testing.assert_allclose(xs, result.axes["amplitude"] / expected, rtol=1e-14)
        assert np.nanmax(ys) > 1
        for number in (1, 2):
            np.testing.assert_array_equal(curves[member, number][0], xs)
            np.testing.assert_allclose(curves[member, number][1], ys, rtol=1e-13)
    figure = charts.dimensionless(table, boundaries(table), "mu_s")
    assert figure.axes[0].get_xlabel() == "A / Üy"


def test_ratio_to_newmark_is_that_of_a_direct_sweep(result: Result) -> None:
    table = plane(result, "permanent_displacement", x="theta", mu_s=0.45, frequency=2.0)
    ratio = charts.displacement_ratio(table, newmark(table), "theta", "amplitude")
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
    table = result.select(["permanent_displacement"], keep, {"theta": 6, "mu_s": 0.45})
    axes = charts.families(table, boundaries(table), "permanent_displacement", "amplitude", "frequency").axes[0]
    limit = slipsweep.friction_parameters(6.0, 0.45, 1.0).limiting_acceleration.item()
    for number, line in enumerate(axes.lines[:2]):
        xs, ys = line.get_data()
        drawn = np.isfinite(ys)
        last = np.flatnonzero(drawn & (np.asarray(xs) <= limit))[-1]
        assert not drawn[last + 1]
        expected = table["permanent_displacement"].values[:, number] * 1000
        np.testing.assert_array_equal(np.asarray(ys)[drawn], expected[expected > 0])


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
    thetas, amplitudes, frequencies = 11, 53, 25
    expected = {
        "contours": {"permanent_displacement": amplitudes * frequencies, "validity": amplitudes * frequencies},
        "modes": {"sliding_mode": thetas * amplitudes, "validity": thetas * amplitudes},
        "families": {"permanent_displacement": 6 * amplitudes},
        "dimensionless": {"permanent_displacement": 4 * 3 * amplitudes},
        "newmark": {"permanent_displacement": thetas * amplitudes, "validity": thetas * amplitudes},
    }
    for kind, counts in expected.items():
        read.clear()
        assert main(["chart", str(grid), "--kind", kind, "-o", str(tmp_path / f"{kind}.png")]) == 0
        assert {name: n for name, n in read.items() if name not in Result(grid).axes} == counts


@pytest.mark.parametrize(
    ("asked", "theta", "mu_s"), [((4.9, 0.37), 4.0, 0.3), ((5.1, 0.38), 6.0, 0.45), ((20.9, 0.61), 20.0, 0.6)]
)
def test_nearest_values_are_taken(result: Result, asked: tuple[float, float], theta: float, mu_s: float) -> None:
    table = plane(result, "permanent_displacement", theta=asked[0], mu_s=asked[1])
    assert (table["theta"].item(), table["mu_s"].item()) == (theta, mu_s)
    direct = slipsweep.sweep(
        theta, mu_s, result.axes["amplitude"], result.axes["frequency"], excitation=slipsweep.Sine(cycles=5)
    )
    np.testing.assert_allclose(table["permanent_displacement"].values, direct.permanent_displacement, rtol=1e-13)


def test_long_axes_are_thinned(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipsweep.charts.slices.MOST_POINTS", 10)
    assert result.thinned("frequency") == slice(0, 25, 3)
    assert result.spread("frequency", 4) == [0, 8, 16, 24]


# ----------------------------------------------------------------------- the command line


def test_default_set_of_charts(grid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(grid)]) == 0
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted(f"grid-{kind}.png" for kind in ("contours", "modes", "families", "dimensionless", "newmark"))
    for name in names:
        image = matplotlib.image.imread(tmp_path / name)
        assert image.shape[1] == 1050
        assert image[..., :3].std() > 0.05
    assert main(["chart", str(grid)]) == 2  # nothing is overwritten unasked
    assert main(["chart", str(grid), "--kind", "modes", "--overwrite"]) == 0


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
    figure = charts.contours(table, boundaries(table), "permanent_displacement", "frequency", "amplitude")
    axes = figure.axes[0]
    assert axes.get_xlabel() == "excitation frequency f (Hz)"
    assert axes.get_ylabel() == "peak ground acceleration A (m/s²)"
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert all(label.get_text().endswith("m") for label in figure.axes[-1].get_yticklabels())
    caption = figure.get_supxlabel()
    assert caption.startswith("θ = 6°, μs = 0.45\nmodel: mendez, monotone, eq12; 5 cycles of a sine; slipsweep ")


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
            assert opened.nearest({"amplitude": text}) == opened.nearest({"amplitude": number})
        assert opened.nearest({"theta": "0.2rad"}) == opened.nearest({"theta": 180 / np.pi * 0.2})
        assert opened.nearest({"frequency": "1200mHz", "mu_s": "0.45"}) == opened.nearest(
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
            opened.nearest({"case": "stepe"})
    assert (table["theta"].item(), table["mu_s"].item(), table.attrs["case"]) == (12.0, 0.5, "steep")
    direct = slipsweep.sweep(12.0, 0.5, table["amplitude"].values, table["frequency"].values)
    np.testing.assert_allclose(table["permanent_displacement"].values, direct.permanent_displacement, rtol=1e-13)
    figure = charts.contours(table, boundaries(table), "permanent_displacement", "frequency", "amplitude")
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
        (lambda values: np.full_like(values, np.inf), {"contours", "families", "dimensionless", "newmark"}),
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
    kinds = {"contours", "modes", "families", "dimensionless", "newmark"}
    assert {kind for kind in kinds if (tmp_path / f"a-{kind}.png").exists()} == kinds - undrawn
    assert {line.split(":")[0] for line in output.splitlines() if ".png" not in line} == {f"no {k}" for k in undrawn}
    for kind in undrawn:
        assert main(["chart", "a.nc", "--kind", kind, "-o", "b.png"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    if "newmark" in undrawn:
        with pytest.raises(InputError, match="displacement: holds inf; what is drawn must be within"):
            explore.read_excerpt(path, 1000)
    else:
        explore.page(explore.read_excerpt(path, 1000), None, "a.nc", "")


def test_a_single_value_is_seen(small: Path) -> None:
    """A line through one point is none: it has a marker."""
    with Result(small) as opened:
        table = opened.select(
            ["permanent_displacement"], {"amplitude": slice(None), "frequency": [0, 1]}, {"theta": 0, "mu_s": 0.5}
        )
    table.data_vars["permanent_displacement"].values[:-1] = 0.0
    figure = charts.families(table, boundaries(table), "permanent_displacement", "amplitude", "frequency")
    for line in figure.axes[0].get_lines()[:2]:
        marked = np.asarray(line.get_markevery())
        assert line.get_marker() == "."
        assert np.isfinite(np.asarray(line.get_ydata())[marked]).tolist() == [True]
