"""What charts say in words: captions, titles of a user's own, and results that no chart is drawn
of.
"""

import io
import re
from pathlib import Path

import matplotlib.image
import pytest
import xarray as xr
from matplotlib import pyplot

import slipsweep
from slipsweep.cli import main
from tests.support.charts import SWEEP_KINDS, caption

#: What a short caption leaves out: options of the model, equations of estimates, the version.
INTERNALS = ("Eq", "monotone", "recoupling", "slipsweep", "_", "Ratio to", "[model]")


@pytest.mark.parametrize("kind", SWEEP_KINDS)
def test_captions_at_90_mm_are_of_six_lines_at_most(lined: xr.Dataset, kind: str) -> None:
    figure = lined.slipsweep.chart(kind, at={"mu_s": 0.25}, width="90mm")
    lines = figure.get_supxlabel().splitlines()
    assert len(lines) <= 6
    text = caption(figure)
    assert text.startswith(("θ = 11°, μs = 0.25", "μs = 0.25", "θ = 11°"))
    assert "Mendez et al. 2012, 15 cycles of a sine; Üy, λ, Δμ estimated" in text
    assert [word for word in INTERNALS if word in text] == []
    if kind != "modes":  # cautions stay
        assert re.search(r"[\d.]+ % of the sliding cells, a trend that no block has\.", text)
        assert "slide continuously with estimated friction: not for design." in text


def test_captions_are_short_or_full_on_request(lined: xr.Dataset) -> None:
    at = {"theta": 14, "mu_s": 0.25, "frequency": 1}
    full, narrow, requested, both = (
        caption(lined.slipsweep.chart("curve", at=at, **options))
        for options in (
            {},
            {"width": 90},
            {"caption": "short"},
            {"width": 90, "caption": "full"},
        )
    )
    assert narrow == requested
    assert full == both
    assert "monotone rise, recoupling by Eq. 12; 15 cycles of a sine; slipsweep" in full
    assert "Left out: values flagged not_recoupled (does not come to rest within" in full
    assert "Left out: does not come to rest, ends upslope." in narrow


def test_short_captions_have_no_paths_of_suites() -> None:
    record = slipsweep.Record.sampled([0.0, 4.0, -3.0, 0.0], 0.2, "pulse")
    suite = slipsweep.Suite((record, record), ("a", "b"), "/home/somebody/motions/*.AT2")
    scales = [1.0, 1.5, 2.0]
    result = slipsweep.sweep(5.0, 0.3, scale=scales, excitation=suite, model="newmark")
    text = caption(result.slipsweep.chart(caption="short"))
    assert "Newmark's block, suite of 2 motions; Üy estimated" in text
    assert "somebody" not in text
    assert "suite /home/somebody/motions/*.AT2" in caption(result.slipsweep.chart())


@pytest.mark.parametrize("kind", ["contours", "families"])
@pytest.mark.parametrize("width", [None, 90])
def test_a_title_of_the_users_own_lies_over_everything(
    lined: xr.Dataset, kind: str, width: int | None
) -> None:
    """And on nothing, though it is long; a dollar sign begins no formula."""
    title = "Permanent displacement of the liner on the south slope, $2 million option, revision C"
    figure = lined.slipsweep.chart(kind, at={"mu_s": 0.25}, width=width, title=title)
    figure.draw_without_rendering()
    (box,) = figure.legends
    texts = [*figure.texts, box.get_title()]
    (drawn,) = [text for text in texts if "$2" in text.get_text()]
    assert " ".join(drawn.get_text().split()).replace("\\", "") == title
    frame = drawn.get_window_extent()
    assert 0 <= frame.x0 < frame.x1 <= figure.bbox.width
    assert frame.y1 <= figure.bbox.height
    assert not any(frame.overlaps(axes.get_tightbbox()) for axes in figure.axes)
    assert not any(frame.overlaps(text.get_window_extent()) for text in box.get_texts())


def test_a_chart_in_other_axes_has_its_title_there(lined: xr.Dataset) -> None:
    figure = pyplot.figure()
    axes = figure.subplots()
    at = {"theta": 11, "mu_s": 0.35, "frequency": 1}
    assert lined.slipsweep.chart("curve", at=at, ax=axes, title="Mine") is axes
    assert axes.get_title() == "Mine"
    pyplot.close(figure)


@pytest.mark.usefixtures("without_layout")
def test_the_command_takes_title_and_caption(
    grid_file: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["chart", str(grid_file), "--kind", "modes", "-o", "a.svg", "--title", "South slope"]
    assert main([*given, "--caption", "short"]) == 0
    text = Path("a.svg").read_text(encoding="utf-8")
    assert "South slope" in text
    assert "monotone rise" not in text
    assert main([*given, "--caption", "none", "--overwrite"]) == 2
    assert "Invalid value for '--caption'" in capsys.readouterr().err


def test_a_notebook_shows_a_chart_without_pyplot() -> None:
    """IPython asks an object for `_repr_png_` where no backend has registered a printer for it."""
    result = slipsweep.sweep(5.0, 0.4, [3.0, 4.0, 5.0], 1.0, model="newmark")
    open_before = pyplot.get_fignums()
    figure = result.slipsweep.chart()
    picture = matplotlib.image.imread(io.BytesIO(figure._repr_png_()))
    assert picture.shape[1] == round(figure.get_size_inches()[0] * figure.dpi)
    assert picture[..., :3].std() > 0.05
    assert pyplot.get_fignums() == open_before


@pytest.mark.parametrize("command", ["chart", "report"])
def test_a_result_of_one_cell_points_to_simulate(
    here: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    slipsweep.sweep(5.0, 0.4, 4.0, 1.0).to_netcdf("one.nc")
    cases = [xr.DataArray([*values], dims="case") for values in ((5.0, 6.0), (3.5, 5.1))]
    slipsweep.sweep(cases[0], 0.38, cases[1], 1.0).to_netcdf("cases.nc")
    for name in ("one.nc", "cases.nc"):
        assert main([command, name]) == 2
        printed = capsys.readouterr().err
        assert printed.count("\n") == 1
        assert f"{name}: no axis has two values or more" in printed
        assert "slipsweep simulate draws the time history of one cell" in printed
    assert sorted(path.name for path in here.iterdir()) == ["cases.nc", "one.nc"]


def test_a_slice_of_one_cell_points_to_simulate(lined: xr.Dataset) -> None:
    at = {"theta": 11, "mu_s": 0.35, "frequency": 1, "amplitude": lined.amplitude.values[30]}
    with pytest.raises(slipsweep.InputError, match="slipsweep simulate draws the time history"):
        lined.slipsweep.chart("curve", at=at)
