#!/usr/bin/env -S uv run --script

# /// script
# dependencies = ["nox>=2025.2"]
# ///

"""The tasks of .ci/run one by one, each in an environment of its own.

`nox --list` shows them, `nox -s lint` runs one.  .ci/run itself does what a newcomer does, in a
copy of the tree; the tasks are for the work on a change.
"""

import nox

nox.needs_version = ">=2025.2"
nox.options.default_venv_backend = "uv|virtualenv"

PROJECT = nox.project.load_toml("pyproject.toml")


@nox.session(python=["3.11", "3.12", "3.13", "3.14"], default=False)
def tests(session: nox.Session) -> None:
    """Run the tests; what follows -- goes to pytest."""
    session.install("--editable", ".[test]")
    session.run("pytest", *session.posargs)


@nox.session(default=False)
def site(session: nox.Session) -> None:
    """Build the documentation site, and compare what its notebooks print with what is stored."""
    session.install("--editable", ".[test,docs]")
    session.run(".ci/site", external=True)


@nox.session(default=False)
@nox.parametrize("versions", ["current", "lowest", "newest"])
def wheel(session: nox.Session, versions: str) -> None:
    """Use the wheel where there is no compiler, no home and nothing to write."""
    session.run(".ci/wheel", versions, external=True)


@nox.session(default=False)
def lint(session: nox.Session) -> None:
    """Run all linters on all files, or the one whose id follows --."""
    linters = nox.project.dependency_groups(PROJECT, "lint")
    session.install("--editable", ".[test,docs]", *linters)
    session.run("pre-commit", "run", "--all-files", *session.posargs)


@nox.session(default=False)
def lowest(session: nox.Session) -> None:
    """Run the tests with the lowest version of every dependency."""
    session.run(".ci/lowest", *session.posargs, external=True)


if __name__ == "__main__":
    nox.main()
