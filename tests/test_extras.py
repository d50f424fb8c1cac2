"""A feature works with its extra alone; without it a line says how to install it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SWEEP = """
[axes]
theta.values = [0, 5]
mu_s.values = [0.3, 0.4]
amplitude.values = [3, 5]
frequency.values = [1, 2]
"""

#: Commands that need an extra.
LINES = {
    "explore": ["explore a.nc -o a.html -q"],
    "parquet": ["export a.nc -o a.parquet -q"],
    "xlsx": ["export a.nc -o a.xlsx -q", "export a.nc -o b.xlsx --columns theta -q"],
    "zarr": ["run a.toml -o a.zarr -q", "export a.zarr -o b.csv -q"],
    "cluster": ["run a.toml -o b.nc -q --workers 1"],
}

#: Runs the lines with the packages that slipsweep itself needs, then those of each extra with its
#: packages as well.
BARE = """
import contextlib, io, json, os, sys
from importlib import metadata
from packaging.requirements import Requirement

def needed(name, extras=("",), seen=None):
    seen = set() if seen is None else seen
    if (name, extras) in seen:
        return set()
    seen.add((name, extras))
    distributions = {name.lower().replace("_", "-")}
    with contextlib.suppress(metadata.PackageNotFoundError):
        for text in metadata.requires(name) or ():
            one = Requirement(text)
            if any(one.marker is None or one.marker.evaluate({"extra": extra}) for extra in extras):
                distributions |= needed(one.name, ("", *one.extras), seen)
    return distributions

def absent(extra):
    present = needed("slipsweep", ("", extra))
    return {
        package for package, owners in metadata.packages_distributions().items()
        if present.isdisjoint(owner.lower().replace("_", "-") for owner in owners)
    }

def ended(line):
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors):
        status = main(line.split())
    return status, errors.getvalue()

if __name__ == "__main__":
    lines = json.loads(sys.argv[1])
    missing = absent("")
    sys.modules.update(dict.fromkeys(missing))
    from slipsweep.cli import main
    whole = ended("run a.toml -o a.nc -q")
    bare = {extra: ended(first) for extra, (first, *_) in lines.items()}
    print(json.dumps({"run": whole, **bare}), flush=True)
    for extra, several in lines.items():
        if not os.fork():
            for package in missing - absent(extra):
                del sys.modules[package]
            print(json.dumps([ended(line) for line in several]), flush=True)
            os._exit(0)
        os.wait()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_each_extra_alone_is_all_that_its_commands_need(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    # in a file: a worker runs it, too
    (tmp_path / "bare.py").write_text(BARE)
    command = [sys.executable, "bare.py", json.dumps(LINES)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    bare, *complete = map(json.loads, done.stdout.splitlines())
    assert bare.pop("run") == [0, ""]
    for extra, (status, text) in bare.items():
        assert status == 2, text
        assert f"; in the cloned repository: pip install '.[{extra}]'" in text
        assert text.count("\n") == 1
    assert complete == [[[0, ""]] * len(lines) for lines in LINES.values()]
