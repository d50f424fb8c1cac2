"""`slipsweep example`: the sweep files that come with slipsweep, and what they read."""

import tomllib
from pathlib import Path
from typing import Annotated

from slipsweep.cli.common import echo
from slipsweep.cli.options import Overwrite, Text, command, read
from slipsweep.errors import InputError, did_you_mean

_PACKAGE = Path(__file__).parents[1]


@command("Start", "slipsweep example", "slipsweep example paper")
def example(
    name: Annotated[Text, read("NAME", "Sweep file to write (default: list their names).")] = None,
    overwrite: Overwrite = False,
) -> None:
    """List the sweep files that come with slipsweep, or write one with its data."""
    # in the installed package, or at the top of the clone that is installed as it stands
    folder = next(path for path in (_PACKAGE / "sweeps", _PACKAGE.parents[1] / "sweeps") if path.is_dir())
    sweeps = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if name is None:
        titles = {stem: tomllib.loads(path.read_text("utf-8"))["output"]["title"] for stem, path in sweeps.items()}
        echo(*(f"{stem:<14}{title}" for stem, title in titles.items()))
        return
    if name not in sweeps:
        raise InputError(f"NAME = {name}: no such sweep file; {did_you_mean(name, list(sweeps))}")
    from slipsweep.files import outputs, spec

    # the sweep file is among the files that are read for it
    wanted = {path.relative_to(folder): path for path in spec.load(sweeps[name]).files if isinstance(path, Path)}
    present = [path for path in wanted if path.parent.is_dir()]
    outputs.check_outputs(present, overwrite, reads=list(wanted.values()))
    for path, source in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with outputs.complete_or_absent(path, overwrite) as temporary:
            temporary.write_bytes(source.read_bytes())
        echo(path)
