"""What is built to be installed has what it needs, and nothing that is not the project's."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
import yaml

from slipsweep._version import __version__
from slipsweep.model.variables import REFERENCE

ROOT = Path(__file__).parents[1]


def test_the_citation_is_of_this_version_and_of_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == __version__
    (paper,) = citation["references"]
    for part in (
        paper["doi"],
        paper["title"],
        str(paper["year"]),
        f"{paper['start']}-{paper['end']}",
    ):
        assert part in REFERENCE
    assert all(
        f"{author['given-names']} {author['family-names']}" in REFERENCE
        for author in paper["authors"]
    )


@pytest.mark.slow
def test_a_wheel_has_the_package_and_the_sweeps(tmp_path: Path) -> None:
    """The wheel is built from the source distribution, as installers do."""
    if not (ROOT / ".git").exists():
        pytest.skip("no clone: git says what the project's files are")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "-o", tmp_path, ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    (source,) = tmp_path.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        there = {
            name
            for name in archive.namelist()
            if not name.startswith(f"slipsweep-{__version__}.dist-info/")
        }
    tracked = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    files = tracked.stdout.splitlines()
    package = {name.removeprefix("src/") for name in files if name.startswith("src/")}
    assert there == package | {f"slipsweep/{name}" for name in files if name.startswith("sweeps/")}
    with tarfile.open(source) as sources:
        packed = {name.partition("/")[2] for name in sources.getnames()}
    assert {*files} <= packed
