"""The wheel and the source distribution have all files of the project, and no others."""

import shutil
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


#: A project that is ready for release, file by file.
READY = {
    "src/slipsweep/_version.py": '__version__ = "1.2.0"\n',
    "CITATION.cff": "version: 1.2.0\ndate-released: 2027-03-01\n",
    "CHANGELOG.md": "## Unreleased\n\n## 1.2.0 (2027-03-01)\n",
    "SECURITY.md": "Write to somebody.\n",
}


@pytest.mark.parametrize(
    ("file", "text", "refusal"),
    [
        ("SECURITY.md", READY["SECURITY.md"], ""),
        ("SECURITY.md", "Write to\nPLACEHOLDER-CONTACT.\n", "SECURITY.md:2: PLACEHOLDER-CONTACT"),
        ("src/slipsweep/_version.py", '__version__ = "1.2.1"\n', "_version.py: is not of v1.2.0"),
        ("CITATION.cff", "version: 1.1.0\ndate-released: 2027-03-01\n", "version is not of v1.2.0"),
        ("CITATION.cff", "version: 1.2.0\n", "date-released is missing"),
        ("CHANGELOG.md", "## Unreleased\n", "has no heading ## 1.2.0"),
        (
            "CHANGELOG.md",
            "## 1.2.0 (2027-02-01)\n",
            "dated 2027-02-01, and CITATION.cff 2027-03-01",
        ),
    ],
)
def test_a_release_that_is_not_ready_is_refused(
    tmp_path: Path, file: str, text: str, refusal: str
) -> None:
    for name, content in (READY | {file: text}).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / ".ci").mkdir()
    check = shutil.copy(ROOT / ".ci" / "release-check", tmp_path / ".ci")
    for command in (["git", "init", "--quiet"], ["git", "add", "."]):
        subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([sys.executable, check, "v1.2.0"], capture_output=True, text=True)
    assert done.returncode == bool(refusal), done.stderr
    assert refusal in done.stderr
    assert done.stderr.count("\n") == bool(refusal)


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
