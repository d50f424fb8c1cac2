"""Result files in the programs of others: CF checker, ncdump, NCO, CDO and GNU Octave."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from slipsweep.files.opening import read_result
from slipsweep.model.variables import Validity
from tests.support.commands import command

#: Missing values, every sliding mode and four flags.
GRID = """
[axes]
theta.values = [0, 5, 20]
mu_s.values = [0.3, 0.5]
amplitude.values = [1, 4, 8]
frequency.values = [1, 2]
structure_frequency.values = [0.5, 4]
[output]
variables = [
    "permanent_displacement",
    "peak_relative_velocity",
    "sliding_mode",
    "validity",
    "acceleration_ratio",
]
"""

CASES = """
cases = [
    {label = "mild ± slope", theta = 5, mu_s = 0.38, amplitude = 3.55, frequency = 1.8},
    {label = "steep", theta = 25, mu_s = 0.38, amplitude = 3.55, frequency = 1.8},
]
[output]
dtype = "float32"
"""

BLOCKS = """
[axes]
theta.values = [0, 5, 25]
mu_s.values = [0.3, 0.4]
scale.values = [1, 2]
"""

RECORD = f"""
{BLOCKS}
[excitation]
record = "{Path(__file__).parents[2] / "sweeps" / "data" / "synthetic.csv"}"
polarity = "both"
"""

#: Labels beyond ASCII, and of different lengths.
SUITE = f"""
{BLOCKS}
[excitation]
records = "motions"
"""

PAIRS = (
    SUITE.replace('"motions"', '[["motions/a.csv", "motions/Düzce.csv"]]')
    + "[axes.azimuth]\nvalues = [0, 45]\n"
)

#: Statistics, with samples that have no value and a slope on which none has.
STATISTICS = """
[axes]
theta.values = [0, 15, 60]
amplitude.values = [2, 4]
frequency.values = [1, 2]
[uncertainty]
samples = 64
sensitivity = true
mu_s = {distribution = "lognorm", s = 0.2, scale = 0.3}
"""

SWEEPS = {
    "grid": GRID,
    "cases": CASES,
    "statistics": STATISTICS,
    "record": RECORD,
    "suite": SUITE,
    "pairs": PAIRS,
}
NAMES = (*SWEEPS, "history")


def run(*arguments: str | Path, folder: Path) -> str:
    done = subprocess.run(
        [*map(str, arguments)],
        cwd=folder,
        capture_output=True,
        encoding="utf-8",
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one file of every kind."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "motions").mkdir()
    for name, sign in (("a", 1), ("Düzce", -1)):
        rows = (f"{at / 20},{sign * 3 * (at % 7 - 3)}\n" for at in range(60 + sign))
        (folder / "motions" / f"{name}.csv").write_text(
            "time (s),acceleration (m/s2)\n" + "".join(rows)
        )
    for name, text in SWEEPS.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        assert command(folder, "run", f"{name}.toml", "--quiet").returncode == 0
    block = ("--theta", "5", "--mu-s", "0.38", "--amplitude", "3.55", "--frequency", "1.8")
    done = command(
        folder, "simulate", *block, "--cycles", "2", "--points", "16", "-o", "history.nc", "--quiet"
    )
    assert done.returncode == 0
    return folder


def numbers(path: Path) -> dict[str, np.ndarray]:
    """The numeric variables of a file as they are stored."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {
            name: np.asarray(variable[...])
            for name, variable in file.variables.items()
            if variable.dtype != "S1"
        }


def filled(path: Path) -> set[str]:
    """The whole numbers in which a fill value stands for what is missing."""
    with netCDF4.Dataset(path) as file:
        return {
            name
            for name, v in file.variables.items()
            if v.dtype.kind == "i" and "_FillValue" in v.ncattrs()
        }


def program(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    return path


def test_the_files_hold_what_is_to_be_read(files: Path) -> None:
    stored = numbers(files / "grid.nc")
    assert {*stored["sliding_mode"].flat} == {-1, 0, 1, 2}
    assert np.isnan(stored["permanent_displacement"]).any()
    assert np.isnan(numbers(files / "statistics.nc")["displacement_quantile"]).any()
    assert np.bitwise_or.reduce(stored["validity"], axis=None) & (1 | 16 | 64 | 128) == (
        1 | 16 | 64 | 128
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_cf_checker_finds_nothing(
    files: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    runner = pytest.importorskip(
        "compliance_checker.runner", reason="compliance-checker is not installed"
    )
    suite = runner.CheckSuite
    suite.load_all_available_checkers()

    def no_network(*arguments: object, **options: object) -> None:
        raise AssertionError("the checker wants the network")

    monkeypatch.setattr(
        "requests.sessions.Session.request", no_network
    )  # its own table of standard names will do
    newest = max(
        (checker for checker in suite.checkers if re.fullmatch(r"cf:1\.\d+", checker)),
        key=lambda checker: int(checker.rpartition(".")[2]),
    )
    checks = suite()
    with checks.load_dataset(str(files / f"{name}.nc")) as dataset:
        scores, errors = checks.run_all(dataset, [newest])[newest]
    assert not errors
    assert len(scores) > 20
    # a check that passes may still have something to tell
    failed = [
        score for score in scores if score.value is not True and score.value[0] != score.value[1]
    ]
    told = [message for score in failed for message in score.msgs]
    assert told == [], [(score.name, score.msgs) for score in failed]


@pytest.mark.parametrize("name", NAMES)
def test_history_times_are_seconds(files: Path, name: str) -> None:
    """No program may take seconds of shaking for dates: `time` is never a dimension."""
    with netCDF4.Dataset(files / f"{name}.nc") as file:
        assert "time" not in file.dimensions
        if name == "history":
            assert (file["time"].dimensions, file["time"].units) == (("instant",), "s")
            assert file["time"][-1] == pytest.approx(2 / 1.8, rel=1e-15)
            assert "time" in file["relative_velocity"].coordinates.split()


# ------------------------------------------------------------------------------ programs


def listed(text: str, name: str) -> list[str]:
    """The values of a variable in CDL."""
    match = re.search(
        rf"^ ?{name} =\s*(.*?) ;", text.partition("\ndata:\n")[2], re.MULTILINE | re.DOTALL
    )
    assert match is not None, name
    return match[1].replace(",", " ").split()


def same(words: list[str], stored: np.ndarray, missing: str = "", fills: bool = False) -> None:
    """Compare printed values with those stored; `missing` is printed for a fill value."""
    read = np.array([float(word) if word != missing else np.nan for word in words]).astype(
        stored.dtype
        if stored.dtype.kind == "f"
        else float  # 17 and 9 digits bring a double and a float back exactly
    )
    expected = stored.ravel().astype(read.dtype)
    if fills:
        expected[expected == -1] = np.nan
    np.testing.assert_array_equal(read, expected)


@pytest.mark.parametrize("name", NAMES)
def test_ncdump_reads_every_variable(files: Path, name: str) -> None:
    text = run(program("ncdump"), "-p", "9,17", f"{name}.nc", folder=files)
    for variable, stored in numbers(files / f"{name}.nc").items():
        same(listed(text, variable), stored, "_", variable in filled(files / f"{name}.nc"))
    assert ':flag_meanings = "statically_unstable uplift limit_undefined' in text
    assert "string " not in text  # netCDF strings, that older programs do not read
    if name == "cases":
        assert r'"mild \302\261 slope"' in text  # the octets of UTF-8


@pytest.mark.parametrize("name", NAMES)
def test_nco_reads_every_variable(files: Path, name: str) -> None:
    ncks = program("ncks")
    for variable, stored in numbers(files / f"{name}.nc").items():
        # -C: without its coordinates
        form = "%.17g\\n" if stored.dtype.kind == "f" else "%d\\n"
        text = run(ncks, "-H", "-C", "-v", variable, "-s", form, f"{name}.nc", folder=files)
        same(text.split(), stored, "_", variable in filled(files / f"{name}.nc"))


@pytest.mark.parametrize("name", NAMES)
def test_cdo_reads_every_variable(files: Path, name: str) -> None:
    """CDO knows three dimensions beside time; of larger grids NCO cuts slices for it."""
    cdo = program("cdo")
    ncks = program("ncks")
    ncwa = program("ncwa")
    with read_result(files / f"{name}.nc") as table:
        coordinates = {*table.coords}
    with netCDF4.Dataset(files / f"{name}.nc") as file:
        widest = max((variable.dimensions for variable in file.variables.values()), key=len)
        cut = list(widest)[:-3]
        dims = {variable: file[variable].dimensions for variable in file.variables}
    stored = numbers(files / f"{name}.nc")
    for place in ([1, 0], [2, 0]) if cut else ([],):
        place = place[: len(cut)]
        path = f"{name}.nc"
        where = dict(zip(cut, place, strict=True))
        if cut:
            path = f"{name}_slice.nc"
            limits = [word for dim, index in where.items() for word in ("-d", f"{dim},{index}")]
            run(ncks, "-O", *limits, f"{name}.nc", "cut.nc", folder=files)
            run(ncwa, "-O", "-a", ",".join(cut), "cut.nc", path, folder=files)
        for variable in stored.keys() - coordinates:  # these are grids and levels to CDO
            text = run(cdo, "-s", "outputf,%.17g,1", f"-selname,{variable}", path, folder=files)
            same(
                text.split(),
                stored[variable][tuple(where.get(dim, slice(None)) for dim in dims[variable])],
            )


@pytest.mark.parametrize("name", NAMES)
def test_octave_reads_every_variable(files: Path, name: str) -> None:
    octave = program("octave")
    folder = files / f"octave_{name}"
    folder.mkdir()
    stored = numbers(files / f"{name}.nc")
    script = "pkg load netcdf;\n" + "".join(
        f"x = ncread('{name}.nc', '{key}'); f = fopen('octave_{name}/{key}', 'w'); "
        f"fprintf(f, '%.17g\\n', double(x)); fclose(f);\n"
        for key in stored
    )
    flags, bits = ("flag", "flag_values") if name == "statistics" else ("validity", "flag_masks")
    script += f"m = ncreadatt('{name}.nc', '{flags}', '{bits}'); printf('%d ', m); "
    script += f"printf('\\n%s\\n', ncreadatt('{name}.nc', '{flags}', 'flag_meanings'));\n"
    done = subprocess.run(
        [octave, "--no-gui", "--norc", "--quiet", "--eval", script],
        cwd=files,
        env={**os.environ, "HOME": str(folder)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    if "package netcdf" in done.stderr:
        pytest.skip("Octave has no package netcdf")
    assert done.returncode == 0, done.stderr
    masks, meanings = done.stdout.splitlines()
    assert masks.split() == [str(int(flag)) for flag in Validity]
    assert len(meanings.split()) == len(Validity)
    for key, values in stored.items():
        # Octave's arrays have the dimensions in reverse and the first one runs fastest: the same
        # order
        same((folder / key).read_text().split(), values, "NaN", key in filled(files / f"{name}.nc"))
