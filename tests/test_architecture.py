"""Data walks one way, and the house stays small: what a folder weighs, a module imports, a function takes."""

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import slipsweep

PACKAGE = Path(slipsweep.__file__).parent

#: Folders, and modules at the top, in the order in which data walk; a folder imports only those before it.
ORDER = (
    "_version", "errors", "jit", "model", "motion", "kernels", "grid", "studies", "files", "charts", "explore", "cli",
)  # fmt: skip

#: Lines that a folder may have, docstrings and blanks among them.  More is a reason to look for the simpler thing;
#: whoever takes something away lowers the limit.
LINES = {
    "jit": 312,
    "model": 1_358,
    "motion": 1_785,
    "kernels": 3_148,
    "grid": 1_047,
    "studies": 3_883,
    "files": 1_887,
    "charts": 2_486,
    "explore": 691,
    "cli": 1_256,
}

#: Modules in all, and lines of a function's body.
MOST_MODULES, MOST_LINES = 110, 90

#: Names of ours that a module imports, in its functions too.
MOST_NAMES = 20

#: The public face, which names what lies in any folder.
FACE = ("slipsweep", "slipsweep.__main__")

NAMES = {
    ".".join(("slipsweep", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in NAMES.items()}


def imported(name: str) -> Iterator[str]:
    """Modules of the package that a module imports, at its head, in a function, or for its annotations only."""
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: imports are absolute"
            full = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [one if one in NAMES else one.rpartition(".")[0] for one in full]
        else:
            continue
        yield from (one for one in found if one in NAMES and one != name)


ARROWS = {name: {*imported(name)} for name in NAMES if name not in FACE}


def folder(name: str) -> str:
    return name.split(".")[1]


def test_every_folder_has_its_place() -> None:
    assert {folder(name) for name in ARROWS} == {*ORDER}


def test_no_import_runs_back_up() -> None:
    back = {
        (name, other)
        for name, others in ARROWS.items()
        for other in others
        if other in FACE or ORDER.index(folder(other)) > ORDER.index(folder(name))
    }
    assert back == set()


def test_no_two_modules_import_each_other() -> None:
    try:
        graphlib.TopologicalSorter(ARROWS).prepare()
    except graphlib.CycleError as error:
        raise AssertionError(f"a circle of imports: {' -> '.join(error.args[1])}") from None


@pytest.mark.parametrize("name", LINES)
def test_a_folder_weighs_no_more_than_it_may(name: str) -> None:
    weight = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in (PACKAGE / name).rglob("*.py"))
    assert weight <= LINES[name]


def test_modules_are_few() -> None:
    assert len(NAMES) <= MOST_MODULES


def test_a_module_imports_few_names_of_ours() -> None:
    counts = {
        name: sum(
            len(node.names)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("slipsweep")
        )
        for name, tree in TREES.items()
    }
    wide = {name: count for name, count in counts.items() if count > MOST_NAMES}
    assert not wide


def test_functions_fit_on_two_screens() -> None:
    lengths = {
        f"{name}.{node.name}": (node.end_lineno or 0)
        - node.body[0].lineno
        - (ast.get_docstring(node) or "").count("\n")
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    }
    assert {name: length for name, length in lengths.items() if length > MOST_LINES} == {}
