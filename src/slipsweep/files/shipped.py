"""The sweep files that come with slipsweep, and what they read."""

import tomllib
from collections.abc import Iterable
from pathlib import Path

from slipsweep.errors import InputError, did_you_mean
from slipsweep.files import outputs, spec

_PACKAGE = Path(__file__).parents[1]


def folder() -> Path:
    """Where they are: in the installed package, or at the top of the clone that is installed as it stands."""
    return next(path for path in (_PACKAGE / "sweeps", _PACKAGE.parents[1] / "sweeps") if path.is_dir())


def titles() -> dict[str, str]:
    """Their names, and the titles of their results."""
    texts = {path.stem: path.read_text(encoding="utf-8") for path in sorted(folder().glob("*.toml"))}
    return {name: tomllib.loads(text)["output"]["title"] for name, text in texts.items()}


def write(name: str, into: Path, *, overwrite: bool = False) -> list[Path]:
    """Write a sweep file, and the files that it reads, with their folders; return what was written.

    Raises
    ------
    InputError
        There is no such sweep file, or one of the outputs exists.
    """
    if name not in titles():
        raise InputError(f"NAME = {name}: no such sweep file; {did_you_mean(name, list(titles()))}")
    sources = _sources(name)
    wanted = {into / source.relative_to(folder()): source for source in sources}
    present = [path for path in wanted if path.parent.is_dir()]
    outputs.check_outputs(present, overwrite, reads=sources)
    for path, source in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with outputs.complete_or_absent(path, overwrite) as temporary:
            temporary.write_bytes(source.read_bytes())
    return list(wanted)


def _sources(name: str) -> list[Path]:
    """A sweep file, and what it reads."""
    sweep = folder() / f"{name}.toml"
    read: Iterable[outputs.Read] = spec.load(sweep).files
    return [sweep, *(path for path in read if isinstance(path, Path) and path != sweep)]
