"""Folders import only those before them, and no two modules import each other."""

import ast
import graphlib
import itertools
import re
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
    """Modules of the package that a module imports, at its head, in a function, or for types."""
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: imports are absolute"
            full = [f"{node.module}.{alias.name}" for alias in node.names]
            modules = [module if module in NAMES else module.rpartition(".")[0] for module in full]
        else:
            continue
        yield from (module for module in modules if module in NAMES and module != name)


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
    names = ("step", "step_cells", "step_newmark")
    steppers = {f"slipsweep.kernels.{name}" for name in names}
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


#: Rows of the walk in docs/architecture.md: a file and a function in it.
WALK = re.findall(
    r"^\| `([\w/]+\.py)` \| `(\w+)` \|",
    (Path(__file__).parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8"),
    flags=re.MULTILINE,
)


def names_in(path: str) -> set[str]:
    """Names that a module of the package mentions, as they are or after a dot."""
    nodes = [*ast.walk(ast.parse((PACKAGE / path).read_text(encoding="utf-8")))]
    plain = {node.id for node in nodes if isinstance(node, ast.Name)}
    return plain | {node.attr for node in nodes if isinstance(node, ast.Attribute)}


def functions_of(path: str) -> set[str]:
    """Names of the functions that a module of the package defines."""
    nodes = ast.walk(ast.parse((PACKAGE / path).read_text(encoding="utf-8")))
    return {node.name for node in nodes if isinstance(node, ast.FunctionDef)}


def test_theta_goes_from_sweep_to_the_formula_through_eight_files() -> None:
    assert WALK[0] == ("studies/sweeps.py", "sweep")
    assert WALK[-1] == ("model/equations.py", "coulomb_yield_acceleration")
    assert len({path for path, _ in WALK}) <= 8


def test_each_function_on_the_way_of_theta_is_in_its_file_and_mentioned_in_the_file_before() -> (
    None
):
    for path, function in WALK:
        assert function in functions_of(path), path
    for (path, _), (_, function) in itertools.pairwise(WALK):
        assert function in names_in(path), f"{path} does not call {function}"


def test_functions_beside_the_way_of_theta_are_in_their_files() -> None:
    page = (Path(__file__).parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = page.partition("## The way of theta\n")[2].partition("\n## ")[0]
    beside = re.findall(r"`(?:Plan\.)?(\w+)`\s+\(`([\w/]+\.py)`\)", section)
    assert len(beside) >= 4
    for function, path in beside:
        assert function in functions_of(path), path
