"""Everything public is in the reference, and the examples in its docstrings run."""

import doctest
import shutil
from pathlib import Path

import pytest

import slipsweep
from slipsweep import published

ROOT = Path(__file__).parents[1]
OBJECTS = sorted(name for name in dir(slipsweep) if not name.startswith("_"))
EQUATIONS = [name for name in published.__all__ if callable(getattr(published, name))]


def check(name: str, docstring: str) -> None:
    """Run the examples of a docstring, with no name but their own."""
    test = doctest.DocTestParser().get_doctest(docstring, {}, name, None, None)
    assert test.examples, f"{name}: no examples"
    printed: list[str] = []
    doctest.DocTestRunner(optionflags=doctest.FAIL_FAST).run(test, out=printed.append)
    assert not printed, "".join(printed)


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with the data of a clone, to write to."""
    shutil.copytree(ROOT / "sweeps", tmp_path / "sweeps")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("clone")
@pytest.mark.parametrize("name", OBJECTS)
def test_examples_of_docstrings_run(name: str) -> None:
    check(name, getattr(slipsweep, name).__doc__)


@pytest.mark.parametrize("name", EQUATIONS)
def test_examples_of_published_equations_run(name: str) -> None:
    check(name, getattr(published, name).__doc__)


@pytest.mark.usefixtures("clone")
def test_the_example_of_the_accessor_runs() -> None:
    from slipsweep.charts.accessor import SlipsweepAccessor

    check("Dataset.slipsweep", SlipsweepAccessor.__doc__ or "")


def test_the_reference_lists_everything_public() -> None:
    """The site's build fails on a name that is listed and not there; this on one not listed."""
    lines = (ROOT / "docs" / "site" / "python.rst").read_text(encoding="utf-8").splitlines()
    equations = {f"published.{name}" for name in EQUATIONS}
    module = ".. automodule:: slipsweep.published"
    assert {line.strip() for line in lines} >= {*OBJECTS, *equations, module} - {"published"}
