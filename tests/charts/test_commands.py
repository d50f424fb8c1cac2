"""Charts from the command line, and results that cannot be drawn."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib.image
import pytest
import xarray as xr

import slipsweep
from slipsweep import Validity
from slipsweep.charts import kinds, maps
from slipsweep.charts.slices import Result
from slipsweep.cli import main
from slipsweep.errors import InputError
from tests.support.charts import (
    SWEEP_KINDS,
)


@pytest.mark.usefixtures("without_layout")
def test_default_set_of_charts(grid_file: Path, here: Path) -> None:
    assert main(["chart", str(grid_file)]) == 0
    drawn = [kind for kind in SWEEP_KINDS if kind != "curve"]
    assert sorted(one.name for one in here.iterdir()) == sorted(
        f"grid-{kind}.png" for kind in drawn
    )
    for one in here.iterdir():
        image = matplotlib.image.imread(one)
        assert image.shape[1] == 1050
        assert image[..., :3].std() > 0.05
    assert (
        main(["chart", str(grid_file)]) == 2
    )  # existing files are overwritten only with --overwrite
    assert main(["chart", str(grid_file), "--kind", "modes", "--overwrite"]) == 0
    assert (
        main(
            ["chart", str(grid_file), "--at", "theta=6", "--at", "mu_s=0.45", "--at", "frequency=1"]
        )
        == 0
    )
    assert Path("grid-curve.png").exists()


@pytest.mark.usefixtures("without_layout")
def test_a_chart_is_written_in_the_format_of_its_name(
    grid_file: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outputs = [f"-oa.{suffix}" for suffix in ("png", "svg", "pdf")]
    assert (
        main(
            [
                "chart",
                str(grid_file),
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
    grid_file: Path, here: Path, capsys: pytest.CaptureFixture[str], arguments: str, message: str
) -> None:
    assert main(["chart", str(grid_file), *arguments.split()]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("slipsweep: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert list(here.iterdir()) == []


def test_the_title_page_names_axes_and_flags(grid_file: Path) -> None:
    with slipsweep.open_result(grid_file) as data:
        title = kinds.title_page(Result(data, "grid.nc"))
    text = "\n".join(one.get_text() for one in title.texts)
    assert "base inclination θ: 11 values, 0 to 20 degree" in text
    assert "peak ground acceleration A: 53 values, 0.5 to 13.5 m s-2" in text
    for flag in maps.HATCHES:
        named = f"{(flag.name or '').lower()} (" in text
        # of strength that changes, which the paper's law has not
        assert named == (flag not in (Validity.MAY_NOT_STOP, Validity.NOT_AT_REST))
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
            "no axis has two values or more",
        ),
    ],
)
def test_a_spoilt_result_is_refused_in_one_line(spoil: Any, message: str) -> None:
    data = slipsweep.sweep([5.0, 6.0], 0.3, [2.0, 4.0], [1.0, 2.0])
    changed = spoil(data)
    with pytest.raises(InputError, match=message):
        (changed if isinstance(changed, xr.Dataset) else data).slipsweep.chart("families")


def test_a_history_is_drawn_alike_by_command_file_and_accessor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a history: by `simulate`, of its file by `chart`, and of its dataset."""
    monkeypatch.chdir(tmp_path)
    given = ["--theta", "5", "--mu-s", "0.38", "--amplitude", "3.55", "--frequency", "1.8"]
    assert main(["simulate", *given, "-o", "a.nc", "-o", "a.png", "-q"]) == 0
    assert main(["chart", "a.nc", "-o", "b.png"]) == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()
    figure = slipsweep.simulate(5.0, 0.38, 3.55, 1.8).slipsweep.chart()
    figure.savefig("c.png", dpi=150)
    assert Path("a.png").read_bytes() == Path("c.png").read_bytes()
    assert main(["chart", "a.nc", "--kind", "modes"]) == 2
    assert main(["chart", "a.nc", "--at", "theta=5", "-o", "d.png"]) == 2
    assert not Path("d.png").exists()
