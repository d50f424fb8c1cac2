"""All charts of a result as one PDF: those that `slipsweep chart` draws."""

import re
from pathlib import Path

import pytest

from tests.support.commands import command

SWEEP = """
[model]
friction = "newmark"
[axes.theta]
values = [0, 5]
[axes.mu_s]
values = [0.3]
[axes.amplitude]
values = [4, 6, 8]
[axes.frequency]
values = [1, 2]
"""


@pytest.mark.usefixtures("without_layout")
def test_a_report_has_a_title_page_and_a_chart_a_page(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    assert command(tmp_path, "run", "a.toml").returncode == 0
    done = command(tmp_path, "report", "a.nc")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "a.pdf\n"
    pages = re.findall(rb"/Type /Page\b", (tmp_path / "a.pdf").read_bytes())
    assert (
        len(pages) == 1 + 5
    )  # contours, modes, families, dimensionless, spread; no ratio of Newmark's block to itself
    content = (tmp_path / "a.pdf").read_bytes()
    for arguments, message in (
        (("a.nc",), "a.pdf: exists already; give --overwrite"),
        (("a.nc", "-o", "a.png"), "a.png: the name must end in .pdf"),
    ):
        again = command(tmp_path, "report", *arguments)
        assert (again.returncode, again.stderr.count("\n")) == (2, 1)
        assert message in again.stderr
    assert (tmp_path / "a.pdf").read_bytes() == content
