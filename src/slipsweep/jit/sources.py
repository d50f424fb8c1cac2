"""What compiled kernels and kept results depend on: found by following imports.

The walk begins at sources of the package and follows every import in them, also those inside functions, to
other sources of the package.  What counts is their code: comments, docstrings and the messages of errors
change no digest.

To read all sources takes 2 ms, to parse those that count 300: what the parser finds is kept beside the kernels.
"""

import ast
import functools
import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from slipsweep.jit import folders
from slipsweep.jit.garbage import no_collections

#: The folder of the package.
PACKAGE = Path(__file__).parents[1]

#: How the sources begin that results come from, or are written by, and those that machine code comes from.
RESULTS: tuple[str, ...] = ("files/spec.py", "files/netcdf.py")
MACHINE_CODE = "kernels/"

#: Where statements lie in other statements.
_BLOCKS = ("body", "orelse", "handlers", "finalbody", "cases")

#: Versions of the sources whose parts are kept.
_KEPT = 4


class Source(NamedTuple):
    """What there is to know of a source: digests of its code, and the sources that it imports.

    `machine_code` leaves out strings with a blank, too: they are texts, of which there are none in machine code.
    """

    code: str
    machine_code: str
    imports: list[str]


class Keys(NamedTuple):
    """Digests of all sources that a result depends on, and of those that a compiled kernel does."""

    results: str
    machine_code: str


@functools.cache
def keys() -> Keys:
    """The keys of this package."""
    return keys_of(known_sources(PACKAGE))


def keys_of(sources: Mapping[str, Source]) -> Keys:
    """The keys of a package."""
    return Keys(
        results=_digest(f"{name} {sources[name].code}" for name in reached(sources, RESULTS)),
        machine_code=_digest(f"{name} {sources[name].machine_code}" for name in reached(sources, MACHINE_CODE)),
    )


def reached(sources: Mapping[str, Source], start: str | tuple[str, ...]) -> list[str]:
    """Names of the sources that begin with `start`, and of all that they import, directly or not."""
    todo = [name for name in sources if name.startswith(start)]
    found: set[str] = set()
    while todo:
        name = todo.pop()
        if name not in found:
            found.add(name)
            todo += sources[name].imports
    return sorted(found)


def known_sources(package: Path) -> dict[str, Source]:
    """The sources of a package that keys depend on, by their paths in it; parsed, or as they were parsed before."""
    texts = {path.relative_to(package).as_posix(): path.read_bytes() for path in sorted(package.rglob("*.py"))}
    base = folders.base()
    if base is None:
        return _parsed(texts, package.name)
    state = _digest(f"{name} {hashlib.sha256(text).hexdigest()}" for name, text in texts.items())
    kept = base / f"sources-{state}.json"
    with suppress(OSError, ValueError, TypeError, AttributeError):  # not there, or damaged
        return {name: Source(*source) for name, source in json.loads(kept.read_bytes()).items()}
    sources = _parsed(texts, package.name)
    with suppress(OSError):
        folders.write(kept, json.dumps(sources).encode())
        folders.keep_latest(_KEPT, "sources-*.json", kept)
    return sources


def _parsed(texts: Mapping[str, bytes], package: str) -> dict[str, Source]:
    found: dict[str, Source] = {}
    todo = [name for name in texts if name.startswith((*RESULTS, MACHINE_CODE))]
    with no_collections():
        while todo:  # those of charts, pages and commands need not be parsed: nearly half of all
            name = todo.pop()
            if name not in found:
                found[name] = parsed(name, texts[name], texts, package)
                todo += found[name].imports
    return found


def parsed(name: str, text: bytes, names: Collection[str], package: str) -> Source:
    """A source, of which the text is known, among those of these names."""
    tree = ast.parse(text)
    imports = {_source(module, names) for module in _imports(tree, name, package)}
    code: list[str] = []
    texts: list[str] = []
    _append_code(tree, code, texts)
    machine_code = _digest(code)
    return Source(_digest([machine_code, *texts]), machine_code, sorted(filter(None, imports)))


def _imports(tree: ast.AST, name: str, package: str) -> Iterator[list[str]]:
    """Modules of the package that a source imports, or names in them, by their parts after the package's own."""
    lazy = name.endswith("__init__.py")  # a package says under TYPE_CHECKING what it loads when asked for it
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING" and not lazy:
            todo += node.orelse
            continue
        full: list[str] = []
        if isinstance(node, ast.Import):
            full = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = [package, *name.split("/")]
            where = [*above[: len(above) - node.level]] if node.level else []
            where += [node.module] if node.module else []
            full = [".".join([*where, alias.name]) for alias in node.names]
        yield from (parts[1:] for module in full if (parts := module.split("."))[0] == package)
        for block in _BLOCKS:
            todo += getattr(node, block, ())


def _source(module: list[str], names: Collection[str]) -> str | None:
    """The source of a module, or of the module that a name is in."""
    for parts in (module, module[:-1]):
        for name in ("/".join(parts) + ".py", "/".join([*parts, "__init__.py"])):
            if name in names:
                return name
    return None


def _append_code(node: Any, code: list[str], texts: list[str] | None) -> None:
    """Append a tree as text, the same for all versions of Python, but texts, strings with a blank, to `texts`."""
    if isinstance(node, list):
        for item in node:
            # a string by itself is a docstring
            if not (isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant)):
                _append_code(item, code, texts)
    elif isinstance(node, ast.AST):
        code.append(f"({type(node).__name__}")
        texts = None if isinstance(node, ast.Raise) else texts  # messages of errors count for nothing
        for name in node._fields:
            value = getattr(node, name, None)
            # whether a name is read or written is said by where it stands
            if value is not None and value != [] and name != "ctx":
                code.append(name)
                _append_code(value, code, texts)
        code.append(")")
    elif not isinstance(node, str) or " " not in node:
        code.append(repr(node))
    elif texts is not None:
        texts.append(node)


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
