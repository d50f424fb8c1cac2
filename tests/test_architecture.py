"""Data walks one way: a folder imports only those before it, and no two modules import each other."""

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import slipsweep

PACKAGE = Path(slipsweep.__file__).parent

#: Folders, and modules at the top, in the order in which data walk; a folder imports only those
#: before it.
ORDER = (
    "_version",
    "errors",
    "locks",
    "jit",
    "model",
    "published",
    "motion",
    "kernels",
    "grid",
    "studies",
    "files",
    "charts",
    "explore",
    "cli",
)

#: Lines of a function's body.
MOST_LINES = 120

#: The public face, which names what lies in any folder.
FACE = ("slipsweep", "slipsweep.__main__")

NAMES = {
    ".".join(("slipsweep", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
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


def test_the_stepping_kernel_shares_no_solver_with_the_exact_ones() -> None:
    """It is to check them: of the kernels it takes what a cell is, Eqs. 7-11 and the flags."""
    steppers = {"slipsweep.kernels.step", "slipsweep.kernels.step_cells"}
    shared = {name for each in steppers for name in ARROWS[each] if folder(name) == "kernels"}
    assert shared - steppers == {"slipsweep.kernels.block"}


def test_no_two_modules_import_each_other() -> None:
    try:
        graphlib.TopologicalSorter(ARROWS).prepare()
    except graphlib.CycleError as error:
        raise AssertionError(f"a circle of imports: {' -> '.join(error.args[1])}") from None


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
