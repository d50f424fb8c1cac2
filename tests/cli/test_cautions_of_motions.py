"""Cautions on recorded motions that commands print: clipping, zeros, vertical, large factors."""

import math
import re
from pathlib import Path

import pytest

from tests.support.commands import run_command

SWEEP = """
model.friction = "newmark"
excitation.records = "m"
axes.theta.values = [5]
axes.mu_s.values = [0.2]
axes.amplitude.values = [0.3, 2]
"""


def told(*arguments: object, status: int = 0) -> str:
    ended = run_command(*arguments)
    assert ended.status == status, ended.errors
    return ended.errors if status else ended.output


@pytest.fixture(autouse=True)
def _motions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A weak motion, a clipped one, one whose second half is 0, and a vertical component."""
    monkeypatch.chdir(tmp_path)
    Path("m").mkdir()
    shaking = [math.sin(0.3 * at + 0.2) for at in range(40)]
    motions = {
        "weak": [0.1 * value for value in shaking],
        "clipped": [min(value, 0.7) for value in shaking],
        "half": [*shaking[:20], *[0.0] * 20],
        "a-UP": shaking,
    }
    for name, values in motions.items():
        Path(f"m/{name}.txt").write_text("dt = 0.02, in m/s2\n" + "\n".join(map(str, values)))


def run(text: str, status: int = 0) -> str:
    """Run a sweep; return what is printed."""
    Path("a.toml").write_text(text)
    return told("run", "a.toml", "--overwrite", status=status)


@pytest.fixture(params=["swept", "repeated"])
def output(request: pytest.FixtureRequest) -> str:
    """Output of a run, and of a run that repeats its result."""
    swept = run(SWEEP)
    return swept if request.param == "swept" else told("run", "a.nc", "-o", "b.nc")


def test_run_names_clipped_motions(output: str) -> None:
    assert re.search(r"clipped\.txt: .*; caution: flat at its largest value 0\.7 m/s2 \(", output)


def test_run_names_motions_that_are_partly_zero(output: str) -> None:
    assert re.search(r"half\.txt: .*; caution: 50% of its samples are 0", output)


def test_run_names_vertical_components_that_are_left_out(output: str) -> None:
    left_out = "left out, vertical components: a-UP.txt (UP); vertical = 'accept' takes them"
    assert left_out in output


def test_run_names_motions_with_large_factors(output: str) -> None:
    factors = "\nscale factors above 4, up to 20: weak; such motions have the frequencies"
    assert factors in output


def test_run_names_a_large_scale_of_a_single_record() -> None:
    single = SWEEP.replace('records = "m"', 'record = "m/weak.txt"')
    scaled = single.replace("amplitude", "scale").replace("[0.3, 2]", "[1, 5]")
    assert "scale factors above 4, up to 5; such motions" in run(scaled)


def test_small_factors_are_not_named() -> None:
    assert "scale factors" not in run(SWEEP.replace("[0.3, 2]", "[0.3]"))


def test_info_has_the_cautions_of_the_motions() -> None:
    run(SWEEP)
    text = told("info", "a.nc")
    assert re.search(r"^caution: .*half\.txt: 50% of its samples are 0$", text, re.MULTILINE)
    assert "left_out_vertical: a-UP.txt (UP)" in text


def test_vertical_components_are_taken_on_request_with_a_caution() -> None:
    text = run(f'{SWEEP}excitation.vertical = "accept"\n')
    assert "; caution: vertical component (UP)" in text


def test_the_request_for_vertical_components_is_of_suites_only() -> None:
    single = SWEEP.replace('records = "m"', 'record = "m/weak.txt"')
    message = run(f'{single}excitation.vertical = "accept"\n', status=2)
    assert "excitation.vertical: only beside excitation.records" in message


def test_simulate_names_its_record_first() -> None:
    text = told("simulate", "--record", "m/half.txt", "--theta", "5", "--mu-s", "0.38")
    assert text.startswith("record                  m/half.txt: ")
