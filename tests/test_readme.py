"""What README.md and docs/ say is so: their blocks run, their tables are those of the program."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import MISSING
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import slipsweep
from slipsweep.files import spec
from slipsweep.model.choices import declared
from slipsweep.model.options import MODELS, SOLVERS
from slipsweep.model.parameter_table import PARAMETER_TABLE
from slipsweep.model.variables import DIMENSION_ORDER, Validity
from slipsweep.motion.reading import Reading
from slipsweep.motion.waveforms import WAVEFORMS
from slipsweep.published import EQUATIONS
from tests.support.commands import command, working_folder

ROOT = Path(__file__).parents[1]

PAGES = sorted(
    page.relative_to(ROOT).as_posix() for page in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"))
)

#: Pages whose blocks are of files, kernels and machines that only a reader has.
NOT_RUN = (
    "CONTRIBUTING.md",
    "SECURITY.md",
    "docs/records.md",
    "docs/releasing.md",
    "docs/scaling.md",
    "docs/suites.md",
    "docs/waveforms.md",
)


class Block(NamedTuple):
    """A fenced block: language, first line, text, and the file that the reader saves it as."""

    language: str
    line: int
    text: str
    file: str


def read(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(document: str) -> list[Block]:
    text = read(document)
    return [
        Block(match[2], text.count("\n", 0, match.start(2)) + 1, match[3], match[1] or "")
        for match in re.finditer(
            r"(?:^<!-- file: (\S+) -->\n)?^```(\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL
        )
    ]


def rows(text: str) -> list[list[str]]:
    """The rows of all tables in some Markdown, without the rulers."""
    lines = (line.strip("|").split("|") for line in text.splitlines() if line.startswith("|"))
    cells = [[cell.strip() for cell in line] for line in lines]
    return [row for row in cells if not set("".join(row)) <= set("-: ")]


def anchors(document: str | Path) -> list[str]:
    """The anchors that GitHub makes of headings."""
    headings = re.findall(r"^#+ (.*)$", (ROOT / document).read_text(encoding="utf-8"), re.MULTILINE)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]


def section(document: str, heading: str) -> str:
    """The text under a heading, up to the next of its level or above."""
    level = heading.split(" ")[0]
    after = read(document).split(f"\n{heading}\n", 1)[1]
    return re.split(rf"^#{{1,{len(level)}}} ", after, maxsplit=1, flags=re.MULTILINE)[0]


# --------------------------------------------------------------------------- blocks that run


def pattern(expected: str) -> str:
    """A regular expression for a printed output in which `...` stands for anything."""
    return ".*".join(map(re.escape, expected.split("...")))


def commands(console: str) -> Iterator[tuple[list[str], str]]:
    """The commands of a console block and the output that each is said to have."""
    for part in re.split(r"^\$ ", console, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield shlex.split(command), output


def output_of(arguments: list[str], folder: Path) -> str:
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONUTF8": "1"}
    done = subprocess.run(
        arguments,
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def printed_by(text: str, where: str, folder: Path) -> str:
    """Output of a reader's program, run in this process, which has imported everything already."""
    assert "slipsweep." not in text or "import slipsweep" in text, where
    output = io.StringIO()
    errors = io.StringIO()
    with (
        working_folder(folder),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
        warnings.catch_warnings(),
    ):
        # all that Python would show
        warnings.simplefilter("error")
        for hidden in (
            DeprecationWarning,
            PendingDeprecationWarning,
            ImportWarning,
            ResourceWarning,
        ):
            warnings.simplefilter("ignore", hidden)
        exec(compile(text, where, "exec"), {"__name__": "__main__"})
    assert errors.getvalue() == "", where
    return output.getvalue()


@pytest.mark.usefixtures("without_layout")
@pytest.mark.parametrize(
    "document", [page for page in PAGES if page not in NOT_RUN and "\n```" in read(page)]
)
def test_blocks_do_what_they_say(document: str, tmp_path: Path) -> None:
    """The blocks of a document, in order, in one folder that holds what a clone holds."""
    run_blocks(document, blocks(document), tmp_path)


def test_blocks_about_statistics_of_suites_do_what_they_say(tmp_path: Path) -> None:
    """The other blocks of the page are of files that only a reader has."""
    begin, end = (
        read("docs/suites.md").split(f"\n## {name}\n")[0].count("\n")
        for name in ("Statistics", "What else takes a suite")
    )
    chosen = [block for block in blocks("docs/suites.md") if begin < block.line < end]
    assert [block.language for block in chosen] == ["console", "python", "text", "csv", "console"]
    run_blocks("docs/suites.md", chosen, tmp_path)


def run_blocks(document: str, chosen: list[Block], tmp_path: Path) -> None:
    shutil.copytree(ROOT / "sweeps", tmp_path / "sweeps")
    for block, after in zip_longest(chosen, chosen[1:]):
        where = f"{document}, line {block.line}"
        if block.language == "console":
            for (program, *arguments), expected in commands(block.text):
                if program == "slipsweep":
                    done = command(tmp_path, *arguments)
                    assert (done.returncode, done.stderr) == (0, ""), where
                    printed = done.stdout
                elif path := shutil.which(program):
                    printed = output_of([path, *arguments], tmp_path)
                else:
                    continue  # a program of others, not on this machine
                assert re.fullmatch(pattern(expected), printed, re.DOTALL), (
                    f"{where} printed:\n{printed}"
                )
        elif block.language == "python":
            printed = printed_by(block.text, where, tmp_path)
            assert printed == (after.text if after and after.language == "text" else ""), where
        elif block.language == "toml":
            spec.parse(block.text, where)
        if block.file:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")


def test_every_page_is_listed() -> None:
    linked = set(re.findall(r"\]\(([^)#]+)\)", read("docs/README.md")))
    assert {Path(page).name for page in PAGES if page.startswith("docs/")} - {"README.md"} <= linked


def test_docstrings_point_to_sections_that_exist() -> None:
    """docs/numerics.md#section in a docstring or comment of the kernels."""
    pointed = {
        anchor
        for source in (ROOT / "src").rglob("*.py")
        for anchor in re.findall(r"numerics\.md#([\w-]+)", source.read_text(encoding="utf-8"))
    }
    assert pointed
    assert pointed <= set(anchors("docs/numerics.md"))


def test_the_two_commands_of_the_readme() -> None:
    """.ci/run takes them from the blocks after these markers and runs them."""
    text = read("README.md")
    marked = dict(re.findall(r"^<!-- ci: (\w+) -->\n```sh\n(.*)\n```$", text, re.MULTILINE))
    assert list(marked) == ["run", "test"]
    for line in marked.values():
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install ")
    assert marked["run"].endswith(" && .venv/bin/slipsweep run sweeps/design_chart.toml")
    assert marked["test"].endswith(" && .venv/bin/pytest")


def test_figures_are_those_of_the_report() -> None:
    """.ci/include-report copies the files of benchmarks/results into the pages that quote them."""
    done = subprocess.run(
        [sys.executable, ROOT / ".ci" / "include-report", "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("document", PAGES)
def test_links_lead_somewhere(document: str) -> None:
    text = read(document)
    for target in re.findall(r'\]\(([^)]+)\)|src="([^"]+)"', text):
        path, _, anchor = "".join(target).partition("#")
        if "://" in path:
            continue
        other = (ROOT / document).parent / path if path else ROOT / document
        assert other.exists(), f"{document}: {path}"
        if anchor:
            assert anchor in anchors(other), f"{document}: #{anchor}"


# ------------------------------------------------------------------------ against the paper

STICK_SLIP: dict[str, Any] = {
    "theta": 5.0,
    "mu_s": 0.38,
    "amplitude": 3.55,
    "yield_acceleration": 0.59,
}
CONTINUOUS: dict[str, Any] = {
    "theta": 6.0,
    "mu_s": 0.38,
    "amplitude": 5.10,
    "yield_acceleration": 0.08,
}


def five_cycles(experiment: dict[str, Any], frequency: float, **friction: Any) -> tuple[str, str]:
    """Displacement in mm and peak velocity in m/s, as the tutorial prints them."""
    result = slipsweep.sweep(
        **experiment, frequency=frequency, **friction, excitation=slipsweep.Sine(cycles=5)
    )
    return (
        f"{result.permanent_displacement.item() * 1000:.0f}",
        f"{result.peak_relative_velocity.item():.3f}",
    )


def test_comparison_with_the_paper() -> None:
    table = rows(section("docs/tutorial.md", "## Against the paper"))[1:]
    stated = {
        re.sub(r"\W+", " ", row[0]).strip(): (row[2].strip("*"), row[4].strip("*")) for row in table
    }
    assert len(stated) == len(table) == 10

    def eqs(name: str) -> tuple[str, ...]:
        cells = (
            slipsweep.friction_parameters(**experiment)[name]
            for experiment in (STICK_SLIP, CONTINUOUS)
        )
        return tuple(f"{cell.item():.2f}" for cell in cells)

    history = slipsweep.simulate(
        **STICK_SLIP, frequency=1.8, decay_rate=2.70, excitation=slipsweep.Sine(cycles=1)
    )
    attenuation = history.block_acceleration.max().item() / 9.81
    printed = (
        five_cycles(STICK_SLIP, 1.8, decay_rate=2.70),
        five_cycles(CONTINUOUS, 3.5, decay_rate=2.30),
    )
    of_paper = five_cycles(STICK_SLIP, 1.8), five_cycles(CONTINUOUS, 3.5)
    computed = [
        eqs("limiting_acceleration"),
        eqs("acceleration_ratio"),
        eqs("delta_mu"),
        eqs("minimum_friction"),
        eqs("decay_rate"),
        (f"{attenuation:.3f}", "–"),
        *zip(*printed, strict=True),
        *zip(*of_paper, strict=True),
    ]
    for (quantity, values), expected in zip(stated.items(), computed, strict=True):
        assert values == expected, quantity


def test_numbers_of_the_paper_sweep() -> None:
    """340 mm and 0.299 m/s, 162 mm and 0.227 m/s: with the rounded friction of Table 2."""
    text = " ".join(section("docs/tutorial.md", "## Against the paper").split())
    for experiment, frequency, decay_rate, delta_mu in (
        (STICK_SLIP, 1.8, 2.70, 0.09),
        (CONTINUOUS, 3.5, 2.30, 0.11),
    ):
        displacement, velocity = five_cycles(
            experiment, frequency, decay_rate=decay_rate, delta_mu=delta_mu
        )
        assert f"{displacement} mm and {velocity} m/s" in text
    estimated = slipsweep.sweep(**STICK_SLIP, frequency=1.8, excitation=slipsweep.Sine(cycles=5))
    assert int(estimated.validity) == Validity.NOT_RECOUPLED | Validity.FRICTION_ESTIMATED


# ------------------------------------------------------------------- tables of the program


@pytest.mark.parametrize(
    ("document", "heading"),
    [("docs/files.md", "## What the numbers mean"), ("docs/model.md", "## Validity")],
)
def test_flags_are_those_of_the_program(document: str, heading: str) -> None:
    stated = [
        (int(bit), name.strip("`"), kind)
        for bit, name, kind, _ in rows(section(document, heading))[1:]
    ]
    assert stated == [(int(flag), (flag.name or "").lower(), str(flag.kind)) for flag in Validity]


@pytest.mark.parametrize(
    "heading",
    [
        "[axes.NAME]",
        "[[cases]]",
        "[model]",
        "[excitation]",
        "[solver]",
        "[output]",
        "[uncertainty]",
    ],
)
def test_keys_are_those_of_the_schema(heading: str) -> None:
    table = heading.strip("[]")
    keys = {
        row[0].strip("`"): row
        for row in rows(section("docs/sweep-files.md", f"## `{heading}`"))
        if len(row) == 4
    }
    axes = {
        name: keys.pop(name)
        for name in list(keys)
        if table == "axes.NAME" and name in spec.KEYS["axes"]
    }
    assert list(keys) == ["key", *spec.KEYS[table]] + (["NAME"] if axes else [])
    if axes:
        assert list(axes) == list(spec.KEYS["axes"])
    # a table of a choice takes the defaults of its options from their declaration
    families: dict[str, Any] = {"model": MODELS, "excitation": WAVEFORMS, "solver": SOLVERS}
    options = dict(families[table].options) if table in families else {}
    if table == "excitation":
        options |= {option.name: option for option in declared(Reading)}
    for name, default in spec.KEYS[table].items():
        stated = keys[name][2].strip("`")
        default = options[name].default if name in options else default
        if default is MISSING:
            assert stated == "–", name
        elif default is not None:
            assert stated.replace('"', "'") == repr(default), name


def test_units_and_bounds_of_parameters_are_those_of_the_program() -> None:
    """A document with other numbers would promise values that are then refused."""
    table = rows(section("docs/sweep-files.md", "## `[axes.NAME]`"))
    stated = {row[0].strip("`"): (row[1].strip("`"), row[2]) for row in table if row[1] != "type"}
    for row in PARAMETER_TABLE:
        if row.name != "polarity":  # a key of [excitation]
            unit, allowed = stated[row.name]
            assert unit == row.units, row.name
            assert allowed == row.bound.brief, row.name


def test_published_equations_are_those_of_the_program() -> None:
    table = rows(section("docs/published.md", "## The equations"))[1:]
    stated = [(name.strip("`"), deviation, limits) for name, _, deviation, limits in table]
    assert stated == [
        (equation.name, equation.deviation, equation.range_text) for equation in EQUATIONS.values()
    ]


def test_the_table_of_contents_of_a_file_names_every_dimension() -> None:
    text = section("docs/files.md", "## What is in a file")
    places = [text.index(f"`{name}`") for name in (*DIMENSION_ORDER, "case")]
    assert places == sorted(places)
