"""Regions of maps end where the equations have their limits, and white means no sliding."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

import slipsweep
from slipsweep.charts import maps, style
from slipsweep.model.variables import NOTES, SlidingMode, Validity
from tests.support.charts import inside, named

Floats = NDArray[np.float64]

#: Flags that only blocks have whose strength changes.
CHANGING = {Validity.MAY_NOT_STOP, Validity.NOT_AT_REST}

#: Coarse along θ and μs: φ = arctan μs lies anywhere between two cells.
THETAS = np.arange(0.0, 21.0, 2.0)
FRICTIONS = np.linspace(0.1, 0.5, 9)

#: Axes of a map, and where on the other axes it is.
MAPS: dict[tuple[str, str], dict[str, Any]] = {
    ("theta", "amplitude"): {"mu_s": 0.2, "frequency": 1.0},
    ("mu_s", "amplitude"): {"theta": 10.0, "frequency": 1.0},
    ("theta", "mu_s"): {"amplitude": 4.0, "frequency": 1.0},
}


@pytest.fixture(scope="module")
def steep() -> xr.Dataset:
    amplitudes = np.linspace(0.5, 12.5, 25)
    return slipsweep.sweep(THETAS, FRICTIONS, amplitudes, [0.5, 1.0, 2.0])


class Picture:
    """What a map looks like without the hatches, lines and labels in it: colours of points and
    pixels.
    """

    def __init__(self, figure: Figure, names: Sequence[str]) -> None:
        self.axes = figure.axes[0]
        self.names = names
        for artist in [*self.axes.texts, *self.axes.collections]:
            if hasattr(artist, "hatches"):
                artist.hatches = [None]
            if artist in self.axes.texts or not getattr(artist, "filled", True):
                artist.set_visible(False)
        for artist in (*figure.legends, *figure.texts, *figure.axes[1:]):
            artist.set_visible(False)
        figure.set_layout_engine("none")
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        self.pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(float) / 255.0

    def colours(self, xs: Floats, ys: Floats) -> Floats:
        places = self.axes.transData.transform(np.stack([xs, ys], axis=-1)).astype(int)
        return np.asarray(self.pixels[places[:, 1], places[:, 0]])

    def inner(self) -> tuple[dict[str, Floats], Floats]:
        """The parameters at the pixels in the frame, and their colours."""
        low, high = self.axes.bbox.get_points().astype(int)
        low += 3
        high -= 3
        columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        pixels = np.stack([columns.ravel(), rows.ravel()], axis=-1)
        places = self.axes.transData.inverted().transform(pixels + 0.5)
        values = dict(zip(self.names, places.T, strict=True))
        return values, self.pixels[pixels[:, 1], pixels[:, 0]]


def parameters_at(values: dict[str, Any]) -> xr.Dataset:
    """Üy, Üg,lim and the sliding mode at points, by the equations."""
    given: dict[str, Any] = {
        name: xr.DataArray(one, dims="point" if np.ndim(one) else ())
        for name, one in values.items()
        if name != "frequency"
    }
    return slipsweep.friction_parameters(**given)


def is_near(values: Floats, colour: Any) -> NDArray[np.bool_]:
    return np.asarray(np.abs(values - to_rgb(colour)).max(axis=-1) < 0.02)


@pytest.mark.parametrize("kind", ["contours", "modes", "newmark"])
@pytest.mark.parametrize("names", MAPS, ids="-".join)
def test_regions_end_where_the_block_begins_to_slide(
    steep: xr.Dataset, kind: str, names: tuple[str, str]
) -> None:
    """White is what does not slide and nothing else; beyond φ it slides under its own weight."""
    x, y = names
    figure = steep.slipsweep.chart(kind, x=x, y=y, at=MAPS[names])
    values, colours = Picture(figure, names).inner()
    at = MAPS[names] | values
    onset = parameters_at(at).yield_acceleration.values
    white = is_near(colours, "white")
    # a pixel is some 0.03 m/s²
    assert white.any()
    assert (onset[white] > 0).all()
    assert (at["amplitude"] < onset + 0.06)[white].all()
    assert white[(at["amplitude"] < onset - 0.06) & (onset > 0.06)].all()

    (area,) = named(figure, "statically_unstable")
    unstable = inside(area, np.stack([values[x], values[y]], axis=-1))
    rest_angle = np.degrees(np.arctan(at["mu_s"])) - at["theta"] + 0 * values[x]
    # straight between cells, where φ is not straight in μs
    off = 0.08 if "mu_s" in names else 0.001
    assert unstable.any()
    assert (rest_angle[unstable] < off).all()
    assert unstable[rest_angle < -off].all()
    assert is_near(colours[rest_angle < -0.2], maps.NO_VALUE).all()
    # before it are the colours of what slides, without a gap, and hatches of what is left out
    grey = is_near(colours, maps.NO_VALUE) & (rest_angle > 0.2)
    points = np.stack([values[x], values[y]], axis=-1)[grey]
    left_out = np.zeros(len(points), bool)
    for artist in named(figure, "not_recoupled") + named(figure, "upslope"):
        left_out |= inside(artist, points)
    # but for pixels that an edge runs through
    assert np.count_nonzero(~left_out) < 5e-4 * len(colours)


@pytest.mark.parametrize("names", MAPS, ids="-".join)
def test_each_point_of_a_mode_chart_has_the_colour_of_its_mode(
    steep: xr.Dataset, names: tuple[str, str]
) -> None:
    x, y = names
    figure = steep.slipsweep.chart("modes", x=x, y=y, at=MAPS[names])
    values, colours = Picture(figure, names).inner()
    at = MAPS[names] | values
    found = parameters_at(at)
    distances = [
        np.abs(at["amplitude"] - found[name].values)
        for name in ("yield_acceleration", "limiting_acceleration")
    ]
    # two pixels, and the bend of the lines between cells of this coarse grid
    clear = (np.min(distances, axis=0) > 0.12) & (found.yield_acceleration.values > 0.12)
    modes = found.sliding_mode.values
    for mode, (colour, _) in maps.MODES.items():
        assert is_near(colours[clear & (modes == mode)], colour).all(), mode
    assert {*modes[clear]} >= {SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS}


def test_colours_of_contours_change_at_the_mode_limit_not_beside_it() -> None:
    """Along the dashed line the displacement jumps: each side has the colours of its own cells."""
    result = slipsweep.sweep([2.0, 6.0, 10.0, 14.0], 0.4, np.linspace(4.0, 9.0, 26), 1.0)
    levels = [0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0]
    figure = result.slipsweep.chart("contours", x="theta", levels=levels)
    picture = Picture(figure, ("theta", "amplitude"))
    thetas = np.array([3.0, 5.0, 7.0, 9.0, 11.0, 13.0])
    lines = np.concatenate(named(figure, "limit_line")[0].allsegs[0])
    limits = np.interp(thetas, *lines[np.argsort(lines[:, 0])].T)
    below, above = (picture.colours(thetas, limits + shift) for shift in (-0.05, 0.05))
    lightness = [style.to_grey(one)[:, 0] for one in (below, above)]
    # u jumps up: darker
    assert (lightness[1] < lightness[0] - 0.05).all()


def test_hatches_end_where_the_colours_do() -> None:
    """Left out cells: half way to their neighbours, in steps, as the colours beside them."""
    sine = slipsweep.Sine(cycles=15)
    amplitudes = np.linspace(1.0, 8.0, 29)
    result = slipsweep.sweep([6.0, 10.0, 14.0], 0.25, amplitudes, 1.0, excitation=sine)
    figure = result.slipsweep.chart("contours", x="theta")
    picture = Picture(figure, ("theta", "amplitude"))
    values, colours = picture.inner()
    points = np.stack([values["theta"], values["amplitude"]], axis=-1)
    areas = named(figure, "not_recoupled") + named(figure, "upslope")
    hatched = np.any([inside(area, points) for area in areas], axis=0)
    missing = is_near(colours, maps.NO_VALUE) & (values["theta"] < 13.9)
    assert missing.any()
    # a pixel's width along the edges may be of either
    assert np.count_nonzero(missing & ~hatched) < 0.01 * np.count_nonzero(missing)


@pytest.mark.parametrize("kind", ["contours", "modes", "newmark", "families", "spread"])
def test_legends_name_flags_in_plain_words(lined: xr.Dataset, kind: str) -> None:
    figure = lined.slipsweep.chart(kind, at={"mu_s": 0.25}, show_cautions=kind == "families")
    texts = "\n".join(text.get_text() for text in figure.legends[0].get_texts()).splitlines()
    assert not any("_" in text for text in texts)
    assert "near the mode limit" in texts
    if kind != "spread":
        assert "does not come to rest" in texts


def test_every_flag_but_notes_has_words_and_a_hatch_of_its_own() -> None:
    for texts in (style.FLAG_TEXT, maps.HATCHES):
        shown = {texts[flag] for flag in ~NOTES}
        assert len(shown) == len(~NOTES)
    assert maps.UNSOUND_HATCH not in maps.HATCHES.values()


def test_hatches_differ_by_their_signs_and_are_closer_in_narrow_figures(lined: xr.Dataset) -> None:
    """Not by their density, which nobody sees in a small region or legend."""
    newmarks = {Validity.STATICALLY_UNSTABLE, Validity.FLEXIBLE_BLOCK, *CHANGING}
    for flags in (maps.HATCHES.keys() - CHANGING, newmarks):
        signs = [maps.UNSOUND_HATCH[0], *(maps.HATCHES[flag][0] for flag in flags)]
        assert len({*signs}) == len(signs)
    densities = [
        len(
            named(lined.slipsweep.chart("modes", at={"mu_s": 0.25}, width=width), gid)[0].hatches[0]
        )
        for width, gid in itertools.product((None, 90), ("near_mode_limit",))
    ]
    assert densities[1] > densities[0]


def test_hatches_show_on_the_greys_of_a_map(lined: xr.Dataset) -> None:
    """Black lines on the darkest grey of displacements: a contrast of 4.5, as for text."""
    figure = lined.slipsweep.chart("contours", at={"mu_s": 0.25}, x="theta", grey=True)
    darkest = Picture(figure, ("theta", "amplitude")).inner()[1].min()
    luminance = ((darkest + 0.055) / 1.055) ** 2.4
    assert (luminance + 0.05) / 0.05 > 4.5
