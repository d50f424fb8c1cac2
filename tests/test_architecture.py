"""Data walks one way: a folder of the package imports only those before it, and no two modules import each other."""

import ast
import graphlib
from collections.abc import Iterator, Mapping

from slipsweep.jit.sources import PACKAGE

#: Folders, and modules at the top, in the order in which data walk.
ORDER = (
    "_version", "errors", "jit", "model", "motion", "kernels", "grid", "studies", "files", "charts", "explore",
    "cli",
)  # fmt: skip

#: The public face, which names what lies in any folder.
FACE = ("slipsweep", "slipsweep.__main__")

#: Imports that are against the order: to be emptied, and never to grow.
AGAINST: set[tuple[str, str]] = set()


NAMES = {
    ".".join(("slipsweep", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
}


def imported(name: str) -> Iterator[str]:
    """Modules of the package that a module imports, at its head, in a function, or for its annotations only."""
    for node in ast.walk(ast.parse(NAMES[name].read_text())):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: imports are absolute"
            full = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [one if one in NAMES else one.rpartition(".")[0] for one in full]
        else:
            continue
        yield from (one for one in found if one in NAMES and one != name)


ARROWS = {name: {*imported(name)} for name in NAMES}


def folder(name: str) -> str:
    return name.split(".")[1]


def test_every_folder_has_its_place() -> None:
    assert {folder(name) for name in NAMES if name not in FACE} == {*ORDER}


def test_no_import_runs_back_up() -> None:
    back = {
        (name, other)
        for name, others in ARROWS.items()
        for other in others
        if name not in FACE and (other in FACE or ORDER.index(folder(other)) > ORDER.index(folder(name)))
    }
    assert back == AGAINST


def circle(arrows: Mapping[str, set[str]]) -> list[str]:
    """Some circle of imports, from a module to itself; empty where there is none."""
    try:
        graphlib.TopologicalSorter(arrows).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def test_no_two_modules_import_each_other() -> None:
    arrows = {name: others for name, others in ARROWS.items() if name not in FACE}
    assert circle(arrows) == []


def test_a_circle_is_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert set(circle({"a": {"b"}, "b": {"c"}, "c": {"b"}})) == {"b", "c"}
