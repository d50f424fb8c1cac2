"""What kernels and results depend on is found: the code of every source that they use counts, and no text does."""

import ast
import functools
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from slipsweep.jit import folders, sources
from slipsweep.jit.sources import Source, keys_of, known_sources, parsed, reached

#: Sources whose code changes no result.
APART = ("charts/", "cli/", "explore/", "runs/", "__main__.py")

AXES = """
[axes]
theta = {values = [5]}
amplitude = {values = [8]}
"""

#: A sweep file of each kind.
KINDS = (
    AXES + "mu_s = {values = [0.5]}\nfrequency = {values = [1]}",
    AXES + "mu_s = {values = [0.5]}\nfrequency = {values = [1]}\n[solver]\nmethod = 'step'",
    AXES + "mu_s = {values = [0.5]}\nfrequency = {values = [1]}\n[excitation]\nwaveform = 'triangle'",
    AXES.replace("amplitude", "scale") + "mu_s = {values = [0.5]}\n[excitation]\nrecord = 'a.csv'\nunits = 'm/s2'",
    AXES + "frequency = {values = [1]}\n[uncertainty]\nsamples = 64\n"
    "[uncertainty.mu_s]\ndistribution = 'uniform'\nloc = 0.4\nscale = 0.2",
)

#: Programs that load what they need and say what that was: to solve them, and for all kernels.
SOLVING = f"""
import sys
from pathlib import Path
from slipsweep.cli import main
for number, text in enumerate({KINDS!r}):
    Path(f"{{number}}.toml").write_text(text)
    assert main(["run", f"{{number}}.toml", "-q"]) == 0
print(*(module.__file__ for name, module in sys.modules.items() if name.partition(".")[0] == "slipsweep"), sep="\\n")
"""
KERNELS = """
import importlib, pkgutil, sys
import slipsweep.kernels
for module in pkgutil.walk_packages(slipsweep.kernels.__path__, "slipsweep.kernels."):
    importlib.import_module(module.name)
print(*(module.__file__ for name, module in sys.modules.items() if name.partition(".")[0] == "slipsweep"), sep="\\n")
"""


def loaded(program: str, folder: Path) -> set[str]:
    """Sources of the package that a program has loaded, but for those that only name what others define."""
    output = subprocess.run([sys.executable, "-c", program], cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    paths = (Path(line).relative_to(sources.PACKAGE) for line in output.stdout.splitlines())
    return {path.as_posix() for path in paths if path.name not in ("__init__.py", "_version.py", "errors.py")}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package's sources."""
    return Path(shutil.copytree(sources.PACKAGE, tmp_path / "slipsweep", ignore=shutil.ignore_patterns("__pycache__")))


# ---------------------------------------------------------------------------------- this package


def test_what_solving_loads_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("".join(f"{0.1 * i:.1f},{i % 7 - 3}\n" for i in range(30)))
    needed = {name for name in loaded(SOLVING, tmp_path) if not name.startswith(APART)}
    assert "grid/plans.py" in needed
    assert needed <= set(reached(known_sources(sources.PACKAGE), sources.RESULTS))


def test_what_kernels_load_is_found(tmp_path: Path) -> None:
    needed = loaded(KERNELS, tmp_path)
    assert "model/equations.py" in needed
    assert needed <= set(reached(known_sources(sources.PACKAGE), sources.MACHINE_CODE))


@functools.cache
def every_source() -> dict[str, Source]:
    """All sources of the package, whether keys depend on them or not."""
    texts = {path.relative_to(sources.PACKAGE).as_posix(): path.read_bytes() for path in sources.PACKAGE.rglob("*.py")}
    return {name: parsed(name, text, texts, sources.PACKAGE.name) for name, text in texts.items()}


def test_what_counts_is_known() -> None:
    every, known = every_source(), known_sources(sources.PACKAGE)
    assert known.items() <= every.items()
    assert keys_of(known) == keys_of(every)


def test_kernels_are_made_where_machine_code_comes_from() -> None:
    for name, source in every_source().items():
        if "jit/cache.py" in source.imports and not name.startswith("jit/"):
            assert name.startswith(sources.MACHINE_CODE), f"{name} may make a kernel whose sources nobody looks at"


def test_code_changes_the_right_keys() -> None:
    known = every_source()
    results, machine_code = (set(reached(known, start)) for start in (sources.RESULTS, sources.MACHINE_CODE))
    assert not [name for name in results | machine_code if name.startswith(APART)]
    before = keys_of(known)
    for name in known:
        edited = (sources.PACKAGE / name).read_bytes() + b"\n_ADDED = 1\n"
        after = keys_of(known | {name: parsed(name, edited, known, "slipsweep")})
        assert (after.results != before.results) == (name in results), name
        assert (after.machine_code != before.machine_code) == (name in machine_code), name


def test_numbers_change_the_keys(package: Path) -> None:
    """What this was made for: a constant of the waves' table, which the kernels take from `motion`."""
    before = keys_of(known_sources(package))
    path = package / "motion/pieces.py"
    text = path.read_text()
    assert "\nTERM = 3\n" in text
    path.write_text(text.replace("\nTERM = 3\n", "\nTERM = 4\n"))
    after = keys_of(known_sources(package))
    assert after.results != before.results
    assert after.machine_code != before.machine_code


def with_other_texts(text: str) -> str:
    """A source with other comments, docstrings and messages of errors, and with other lines."""

    class Other(ast.NodeTransformer):
        def visit_Expr(self, node: ast.Expr) -> ast.AST:
            return ast.Expr(ast.Constant("another docstring")) if isinstance(node.value, ast.Constant) else node

        def visit_Raise(self, node: ast.Raise) -> ast.AST:
            for part in ast.walk(node):
                if isinstance(part, ast.Constant) and isinstance(part.value, str) and " " in part.value:
                    part.value = "another message"
            return node

    tree = Other().visit(ast.parse(text))
    return "# another comment\n\n" + ast.unparse(ast.fix_missing_locations(tree))


def test_texts_change_no_key(package: Path) -> None:
    before = keys_of(known_sources(package))
    for path in package.rglob("*.py"):
        path.write_text(with_other_texts(path.read_text()))
    assert keys_of(known_sources(package)) == before


def test_names_that_people_read_are_no_machine_code(package: Path) -> None:
    before = keys_of(known_sources(package))
    path = package / "model/variables.py"
    path.write_text(path.read_text().replace('"plane inclination"', '"inclination of the plane"'))
    after = keys_of(known_sources(package))
    assert after.machine_code == before.machine_code
    assert after.results != before.results  # they are written into the chunks of a split result


# --------------------------------------------------------------------------------------- imports


def imports(text: str, name: str = "a/one.py") -> list[str]:
    return parsed(
        name, text.encode(), ["__init__.py", "a/__init__.py", "a/two.py", "a/b/three.py", "four.py"], "house"
    ).imports


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import house.a.two", "a/two.py"),
        ("import house.a.two as two", "a/two.py"),
        ("from house.a import two", "a/two.py"),
        ("from house.a.two import name", "a/two.py"),
        ("from house.a import name", "a/__init__.py"),
        ("from house import four", "four.py"),
        ("from house import name", "__init__.py"),
        ("import house", "__init__.py"),
        ("from . import two", "a/two.py"),
        ("from .b.three import name", "a/b/three.py"),
        ("from ..four import name", "four.py"),
        ("def f():\n    from house.four import (\n        name,\n    )", "four.py"),
        ("class C:\n    if x:\n        import house.four", "four.py"),
        ("if TYPE_CHECKING:\n    pass\nelse:\n    import house.four", "four.py"),
    ],
)
def test_an_import_is_found(text: str, found: str) -> None:
    assert imports(text) == [found]


@pytest.mark.parametrize(
    "text", ["import numpy", "from houses.a import two", "if TYPE_CHECKING:\n    import house.four"]
)
def test_no_import_of_ours(text: str) -> None:
    assert imports(text) == []


def test_a_package_says_under_type_checking_what_it_loads_later() -> None:
    assert imports("if TYPE_CHECKING:\n    from house.four import name", "a/__init__.py") == ["four.py"]


def test_circles_end() -> None:
    known = {"a.py": Source("", "", ["b.py"]), "b.py": Source("", "", ["a.py"]), "c.py": Source("", "", [])}
    assert reached(known, "a.py") == ["a.py", "b.py"]


# ------------------------------------------------------------------------------- what is kept of it


def test_damaged_notes_are_made_anew(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folders, "base", lambda: tmp_path)
    for folder in ("grid", "kernels/cycle", "kernels/sine", "kernels/step", "motion"):  # fewer to parse each time
        shutil.rmtree(package / folder)
    right = known_sources(package)
    (kept,) = tmp_path.glob("sources-*.json")
    content = kept.read_bytes()
    monkeypatch.setattr(sources, "_parsed", None)
    assert known_sources(package) == right
    monkeypatch.undo()
    monkeypatch.setattr(folders, "base", lambda: tmp_path)
    for damaged in (b"", content[:-50], b"\xff\xfe", b"[1]", b'{"a": 1}', b'{"a": [1]}'):
        kept.write_bytes(damaged)
        assert known_sources(package) == right
        assert kept.read_bytes() == content


def test_no_folder_for_notes(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right = known_sources(package)
    monkeypatch.setattr(folders, "base", lambda: None)
    assert known_sources(package) == right
