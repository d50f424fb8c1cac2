"""Terminal manners: help, completion, plain output where nobody looks, suggestions."""

import re
from pathlib import Path

import pytest

from slipsweep import cli
from tests.support.commands import command as run
from tests.support.commands import run_command
from tests.support.processes import on_a_terminal, slipsweep

COMMANDS = ("run", "info", "export", "simulate")
SIMULATE = ("simulate", "--theta", "5", "--mu-s", "0.4", "--amplitude", "3", "--frequency", "1")
SWEEP = "".join(
    f"[axes.{name}]\nvalues = [{value}]\n"
    for name, value in (("theta", 5), ("mu_s", 0.4), ("amplitude", 3), ("frequency", 1))
)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_plain_in_a_pipe_and_has_examples(tmp_path: Path, command: str) -> None:
    done = slipsweep(tmp_path, command, "--help", environment={"FORCE_COLOR": "1", "COLUMNS": "80"})
    assert (done.returncode, done.stderr) == (0, "")
    assert not re.search("[\x1b─-╿]", done.stdout)  # neither escape codes nor boxes
    examples = done.stdout.partition("Examples:\n")[2].splitlines()
    assert len(examples) >= 2
    for line in examples:  # each whole, in a line of its own
        assert line.startswith(f"  slipsweep {command} ")


def test_help_on_a_terminal_is_that_in_a_pipe(tmp_path: Path) -> None:
    wide = {"COLUMNS": "100"}
    seen = on_a_terminal(tmp_path, "export", "--help", environment=wide)
    assert seen.splitlines() == slipsweep(tmp_path, "export", "--help", environment=wide).stdout.splitlines()


#: All commands.
NAMES = sorted(one.callback.__name__ for one in cli.app.registered_commands if one.callback is not None)


@pytest.mark.parametrize("name", ["", *NAMES])
def test_help_is_one_screen(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Of 40 lines and 100 columns; and every option is in it, by name at least."""
    monkeypatch.setenv("COLUMNS", "100")
    asked = [name] if name else []
    ended = run_command(*asked, "--help")
    lines = ended.output.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 100
    assert not any(line.endswith("...") for line in lines[1:])
    described = run_command(*asked, "--help-all").output if name else ended.output
    rows = re.findall(r"^  (?:-\w, )?(--[a-z][\w-]+)", described, re.MULTILINE)
    assert rows
    for option in rows:
        assert re.search(rf"(^|[ ,]){option}\b", ended.output), option
    # an option in no group would stand beside this one
    assert described.partition("Help:\n")[2].startswith("  -h, --help ") or not name


def test_rare_options_are_described_on_request(tmp_path: Path) -> None:
    short, long = (run(tmp_path, "simulate", option).stdout for option in ("--help", "--help-all"))
    assert "Phases of the harmonics, degrees" not in short
    assert "Phases of the harmonics, degrees" in long
    assert "Rare options (--help-all describes them):\n" in short
    assert "--phases" in short


def test_commands_are_grouped_by_task(tmp_path: Path) -> None:
    text = run(tmp_path, "--help").stdout
    groups = dict(re.findall(r"^([A-Z][\w ]+):\n((?:  \w.*\n?)+)", text, re.MULTILINE))
    tasks = {name: re.findall(r"^  (\w+)", body, re.MULTILINE) for name, body in groups.items()}
    assert tasks["Compute"] == ["run", "simulate", "limit", "hazard"]
    assert sorted(name for names in tasks.values() for name in names) == NAMES


def test_the_examples_are_good_commands(tmp_path: Path) -> None:
    """Every option of the examples is one that the command has."""
    for command in COMMANDS:
        text = run(tmp_path, command, "--help").stdout
        options, _, examples = text.partition("Examples:")
        for option in re.findall(r" (--?[a-z][\w-]*)", examples):
            assert re.search(rf"(^|\s|,){option}\b", options), f"{command}: {option}"


def test_progress_has_no_colour_when_none_is_wanted(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    coloured = on_a_terminal(tmp_path, "run", "a.toml", "-o", "a.nc")
    plain = on_a_terminal(tmp_path, "run", "a.toml", "-o", "b.nc", environment={"NO_COLOR": "1"})
    colour = r"\x1b\[[\d;]*3[0-9](;[\d;]+)?m"
    assert re.search(colour, coloured)
    assert "100%" in plain
    assert not re.search(colour, plain)


def test_compilation_is_said_and_told_apart(tmp_path: Path) -> None:
    """A first run has to be waited for: a terminal says why, and its speed is that of solving."""
    (tmp_path / "a.toml").write_text(SWEEP + '[output]\nvariables = ["delta_mu"]\n')
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first = on_a_terminal(tmp_path, "run", "a.toml", "-o", "a.nc", environment=cache)
    assert "compiling for this processor, once: 1 of 1" in first
    found = re.search(r"1 cells .* in ([\d.]+) s \(([\d.]+) s to compile, once\), (\S+) cells/s", first)
    assert found
    total, compiling, speed = map(float, found.groups())
    assert 0.0 < compiling <= total
    assert speed > 1.01 / total
    again = on_a_terminal(tmp_path, "run", "a.toml", "-o", "b.nc", environment=cache)
    assert "compil" not in again
    assert re.search(r"1 cells .* in [\d.]+ s, \S+ cells/s", again)


def test_errors_are_plain(tmp_path: Path) -> None:
    for text in (on_a_terminal(tmp_path, "info"), slipsweep(tmp_path, "info", environment={"FORCE_COLOR": "1"}).stderr):
        assert text.strip() == "slipsweep: error: Missing argument 'OUT.nc'."


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "a.toml", "--ouput", "a.nc"), "No such option: --ouput; did you mean --output?"),
        (("run", "a.toml", "--overwrit"), "No such option: --overwrit; did you mean --overwrite?"),
        (("simulate", "--yield-aceleration", "1"), "did you mean --yield-acceleration?"),
        (("exprot", "a.nc"), "No such command 'exprot'. Did you mean 'export', 'explore'?"),
        (("run", "a.toml", "--solver", "cycl"), "'cycl' is not one of 'auto', 'step', 'cycle'"),
        (("run", "a.toml"), 'axes.thet: unknown key; did you mean "theta"?'),
        (("simulate", "--mu-s", "rough"), "Invalid value for '--mu-s': 'rough' should be a valid number"),
        ((*SIMULATE, "--ramp-in", "7", "--ramp-out", "8"), "--ramp-in + --ramp-out = 15: must not exceed"),
        (("simulate", "--points", "2"), "Invalid value for '--points': '2' should be greater than or equal to 4"),
    ],
)
def test_what_is_nearest_is_suggested(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "a.toml").write_text(SWEEP.replace("theta", "thet"))
    done = run(tmp_path, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(tmp_path: Path, shell: str) -> None:
    script = slipsweep(
        tmp_path, "--show-completion", shell, environment={"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    ).stdout
    assert "_SLIPSWEEP_COMPLETE" in script
    typed = "slipsweep ex"
    environment = {
        "_SLIPSWEEP_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": typed, "COMP_CWORD": "1",  # bash
        "_TYPER_COMPLETE_ARGS": typed, "_TYPER_COMPLETE_FISH_ACTION": "get-args",  # zsh and fish
    }  # fmt: skip
    done = slipsweep(tmp_path, environment=environment)
    assert "export" in done.stdout
    assert "simulate" not in done.stdout


def test_simulate_takes_a_displacement_and_a_structure(tmp_path: Path) -> None:
    case = ("simulate", "--theta", "5", "--mu-s", "0.38", "--frequency", "2", "--structure-frequency", "2")
    by_displacement = run(tmp_path, *case, "--displacement-amplitude", "0.025")
    acceleration = str((4 * 3.141592653589793) ** 2 * 0.025)
    by_acceleration = run(tmp_path, *case, "--amplitude", acceleration)
    assert by_displacement.returncode == 0
    results = [done.stdout.partition("taken as")[0] for done in (by_displacement, by_acceleration)]
    assert results[0] == results[1]
    assert "flexible_block" in by_displacement.stdout
    assert run(tmp_path, *case, "--amplitude", "3", "--quiet", "-o", "a.csv").stdout == ""
    assert (tmp_path / "a.csv").exists()
    both = run(tmp_path, *case, "--amplitude", "3", "--displacement-amplitude", "0.1")
    assert (both.returncode, both.stderr.strip()) == (
        2, "slipsweep: error: amplitude, displacement_amplitude: exactly one of them must be given",
    )  # fmt: skip
