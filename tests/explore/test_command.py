"""The command `explore`, and results that it refuses."""

import os
import re
from pathlib import Path

import pytest

from slipsweep import InputError
from slipsweep.explore.page import write_page
from tests.support.commands import command
from tests.support.pages import SWEEP, make


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            SWEEP.replace('"permanent_displacement", "newmark_displacement", ', ""),
            "holds no permanent_displacement",
        ),
        (
            2 * "[[cases]]\ntheta = 5\nmu_s = 0.4\namplitude = 4\nfrequency = 2\n",
            "the dimensions are: case (2)",
        ),
    ],
)
def test_result_without_a_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    result = make(tmp_path, text)
    output = tmp_path / "page.html"
    with pytest.raises(InputError, match=re.escape(message)):
        write_page(result, output)
    assert not output.exists()


def test_explore_writes_the_page_and_prints_its_axes(result: Path, tmp_path: Path) -> None:
    done = command(tmp_path, "explore", str(result), "-o", "page.html")
    assert done.returncode == 0, done.stderr
    assert "23 values" in done.stdout
    assert os.listdir(tmp_path) == ["page.html"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("RESULT", "-o", "page.html"), "exists already"),
        (("RESULT", "-o", "other.html", "--size", "20"), "--size = 20: must be"),
        (("RESULT", "-o", "other.html", "--size", "100kB"), "--size = 100 kB: must be"),
        (("page.html", "-o", "other.html"), "not a netCDF file"),
        (("absent.nc", "-o", "other.html"), "no such file"),
    ],
)
def test_explore_refuses_in_one_line_and_writes_nothing(
    result: Path, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "page.html").write_text("another page")
    words = [word.replace("RESULT", str(result)) for word in arguments]
    done = command(tmp_path, "explore", *words)
    assert done.returncode == 2
    assert done.stderr.startswith("slipsweep: error: ")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert (tmp_path / "page.html").read_text() == "another page"
    assert os.listdir(tmp_path) == ["page.html"]
