"""Long tables hold every cell once, exactly; flags come apart as the bits say."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xarray as xr

import slipsweep
from slipsweep.errors import InputError
from slipsweep.files import export, running, spec
from slipsweep.files.jobs import sweep_job
from slipsweep.model.variables import Validity
from tests.support.commands import command

GRID = """
[axes]
theta.values = [0, 5, 20]
mu_s.values = [0.3, 0.5]
displacement_amplitude.values = [0.01, 0.05, 0.1]
frequency.values = [1, 2]
decay_rate.values = [1.0, 2.5]
[output]
variables = ["permanent_displacement", "sliding_mode", "validity", "limiting_acceleration"]
dtype = "float32"
"""

CASES = """
cases = [
    {label = "mild ± slope, wet", theta = 5, mu_s = 0.38, amplitude = 3.55},
    {label = "steep", theta = 25, mu_s = 0.38, amplitude = 3.55},
]
axes.frequency.values = [1, 2, 3]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a grid and a list of cases, solved."""
    folder = tmp_path_factory.mktemp("export")
    for name, text in (("grid", GRID), ("cases", CASES)):
        running.run(sweep_job(spec.parse(text, name)), folder / f"{name}.nc", command="x")
    return folder


def read(path: Path) -> pd.DataFrame:
    readers = {".csv": pd.read_csv, ".parquet": pd.read_parquet, ".xlsx": pd.read_excel}
    frame: pd.DataFrame = readers[path.suffix](path)
    return frame


def bare(frame: pd.DataFrame) -> pd.DataFrame:
    """The table with the names of the variables alone."""
    return frame.rename(columns=lambda header: header.partition(" (")[0])


@pytest.mark.parametrize(
    ("suffix", "chunk_cells"),
    [(".csv", 7), (".csv", export.CHUNK_CELLS), (".parquet", 7), (".xlsx", 7)],
)
def test_a_table_has_every_cell_once(
    folder: Path, tmp_path: Path, suffix: str, chunk_cells: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []

    @contextlib.contextmanager
    def progress(total: int) -> Iterator[Callable[[int], None]]:
        assert total == 3 * 2 * 3 * 2 * 2
        yield done.append

    path = tmp_path / f"t{suffix}"
    monkeypatch.setattr(export, "CHUNK_CELLS", chunk_cells)
    rows = export.export(folder / "grid.nc", path, progress=progress)
    table = bare(read(path))
    assert rows == sum(done) == len(table) == 3 * 2 * 3 * 2 * 2
    axes = ["theta", "mu_s", "displacement_amplitude", "frequency", "decay_rate"]
    with xr.open_dataset(folder / "grid.nc", mask_and_scale=False) as data:
        expected = data.to_dataframe(dim_order=axes).reset_index()
        expected["sliding_mode"] = expected["sliding_mode"].where(expected["sliding_mode"] >= 0)
    table, expected = (frame.sort_values(axes, ignore_index=True) for frame in (table, expected))
    assert {*table.columns} == {*expected.columns}
    if chunk_cells > 7:
        assert list(bare(read(path))["decay_rate"][:4]) == [
            1.0,
            2.5,
            1.0,
            2.5,
        ]  # the last one runs fastest
    for name in table:
        # exact: as many digits as bring the value back
        read_back = table[name].to_numpy(
            np.float32 if expected[name].dtype == np.float32 else np.float64
        )
        np.testing.assert_array_equal(read_back, expected[name].to_numpy(read_back.dtype))
        if read_back.dtype == np.float32 and suffix != ".parquet":  # and no more
            assert [f"{number:.9g}" for number in table[name]] == [
                f"{float(str(number)):.9g}" for number in read_back
            ]


def test_a_dimension_that_no_variable_has_is_left_out(tmp_path: Path) -> None:
    text = GRID.replace("displacement_amplitude", "amplitude").replace(
        "decay_rate", "structure_frequency"
    )
    running.run(sweep_job(spec.parse(text, "x")), tmp_path / "a.nc", command="x")
    assert (
        export.export(tmp_path / "a.nc", tmp_path / "a.csv", variables=["limiting_acceleration"])
        == 18
    )
    table = bare(pd.read_csv(tmp_path / "a.csv"))
    assert list(table) == ["theta", "mu_s", "amplitude", "limiting_acceleration"]
    tangent = np.tan(np.radians(table.theta))
    coulomb = 9.81 * (table.mu_s - tangent) / (1 + table.mu_s * tangent)
    eq7 = (coulomb + 9.81 * table.mu_s) / (1 - tangent * (table.mu_s - tangent))
    np.testing.assert_allclose(table.limiting_acceleration, eq7, rtol=1e-6)


def test_codes_are_spelled_out_on_request(folder: Path, tmp_path: Path) -> None:
    codes = tmp_path / "codes.csv"
    words = tmp_path / "words.csv"
    for path, spelled_out in ((codes, False), (words, True)):
        export.export(folder / "cases.nc", path, words=spelled_out)
    coded = bare(read(codes))
    worded = bare(read(words))
    assert list(worded["label"]) == ["mild ± slope, wet", "steep"] * 3
    modes = [
        slipsweep.SlidingMode(int(c)).name.lower() if c == c else None
        for c in coded["sliding_mode"]
    ]
    assert modes[-1] is None
    assert [None if pd.isna(mode) else mode for mode in worded["sliding_mode"]] == modes
    flags = [
        " ".join((flag.name or "").lower() for flag in Validity(code)) for code in coded["validity"]
    ]
    assert "statically_unstable" in flags
    assert ["" if pd.isna(flag) else flag for flag in worded["validity"]] == flags


def test_several_flags_of_a_cell_are_spelled_one_after_the_other(tmp_path: Path) -> None:
    """Just above the mode limit, of a block whose friction is estimated."""
    text = (
        "[axes]\ntheta.values = [5]\nmu_s.values = [0.38]\n"
        "amplitude.values = [6.8]\nfrequency.values = [1]\n"
    )
    running.run(sweep_job(spec.parse(text, "x")), tmp_path / "a.nc", command="x")
    export.export(tmp_path / "a.nc", tmp_path / "a.csv", words=True)
    (flags,) = bare(read(tmp_path / "a.csv"))["validity"]
    assert flags == "near_mode_limit friction_estimated"


def test_a_parquet_file_tells_how_it_was_made(folder: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export.export(folder / "cases.nc", tmp_path / "t.parquet")
    schema = parquet.read_schema(tmp_path / "t.parquet")
    assert schema.metadata[b"sweep"].decode() == CASES
    assert schema.field("permanent_displacement (m)").metadata[b"units"] == b"m"
    assert (
        schema.field("validity")
        .metadata[b"flag_meanings"]
        .startswith(b"statically_unstable uplift")
    )


def test_export_writes_the_rows_that_it_counts(folder: Path) -> None:
    done = command(
        folder, "export", "cases.nc", "-o", "cases.csv", "--words", "--variable", "sliding_mode"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("cases.csv  6 rows, ")
    text = (folder / "cases.csv").read_text(encoding="utf-8")
    assert text.splitlines()[1] == '5.0,0.38,3.55,1.0,"mild ± slope, wet",stick_slip'
    again = command(folder, "export", "cases.nc", "-o", "cases.csv")
    assert again.returncode == 2
    assert "cases.csv: exists already; give --overwrite" in again.stderr
    assert (folder / "cases.csv").read_text(encoding="utf-8") == text
    assert (
        command(folder, "export", "cases.nc", "-o", "cases.csv", "--overwrite", "-q").stdout == ""
    )


@pytest.mark.parametrize(
    ("source", "output", "options", "message"),
    [
        ("grid.nc", "t.txt", {}, "the name must end in one of .csv, .parquet, .xlsx"),
        (
            "grid.nc",
            "t.csv",
            {"variables": ["permanent_displacment"]},
            'did you mean "permanent_displacement"',
        ),
        ("none.nc", "t.csv", {}, "none.nc: no such file"),
        ("OTHER", "t.csv", {}, "not a netCDF file"),
    ],
)
def test_a_wrong_name_is_refused_and_nothing_written(
    folder: Path, tmp_path: Path, source: str, output: str, options: Any, message: str
) -> None:
    other = tmp_path / "other.nc"
    other.write_text("nothing")
    path = other if source == "OTHER" else folder / source
    with pytest.raises(InputError, match=message):
        export.export(path, tmp_path / output, **options)
    assert [entry.name for entry in tmp_path.iterdir()] == ["other.nc"]


# ------------------------------------------------------------------- slices and pivoted tables


def test_a_slice_has_the_values_asked_for(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By value, by several in the order given, and with a unit."""
    monkeypatch.setattr(export, "CHUNK_CELLS", 1)
    path = tmp_path / "t.csv"
    at = {"theta": "20,5", "displacement_amplitude": "5cm", "decay_rate": "2.5", "mu_s": "0.3"}
    assert export.export(folder / "grid.nc", path, at=at) == 2 * 2
    table = bare(read(path))
    with xr.open_dataset(folder / "grid.nc") as data:
        cut = data.sel(theta=[20, 5], displacement_amplitude=[0.05], decay_rate=[2.5], mu_s=[0.3])
        # coordinates stay in columns, in the file's order
        assert list(table.theta) == [20, 20, 5, 5]
        assert set(table.mu_s) == {0.3}
        np.testing.assert_array_equal(
            table.permanent_displacement.to_numpy(np.float32),
            cut.permanent_displacement.values.ravel(),
        )


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".xlsx"])
def test_a_pivoted_table_has_an_axis_as_columns(
    folder: Path, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export, "CHUNK_CELLS", 1)
    path = tmp_path / f"t{suffix}"
    export.export(
        folder / "grid.nc",
        path,
        variables=["permanent_displacement"],
        at={"decay_rate": "1", "mu_s": "0.5", "theta": "5"},
        rows=["displacement_amplitude"],
        columns="frequency",
    )
    table = read(path).set_index(read(path).columns[0])
    assert table.index.name == (
        "displacement_amplitude (m) \\ frequency (Hz): permanent_displacement (m) "
        "at theta = 5 degree, mu_s = 0.5, decay_rate = 1"
    )
    assert [*map(float, table.columns)] == [1.0, 2.0]
    assert list(table.index) == [0.01, 0.05, 0.1]
    with xr.open_dataset(folder / "grid.nc") as data:
        expected = data.permanent_displacement.sel(decay_rate=1, mu_s=0.5, theta=5)
        np.testing.assert_array_equal(table.to_numpy(np.float32), expected)


def test_the_rows_of_a_pivoted_table_are_all_other_axes_unless_chosen(
    folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / "t.csv"
    command_line = (
        "export",
        "grid.nc",
        "-o",
        path,
        "--variable",
        "limiting_acceleration",
        "--columns",
        "mu_s",
    )
    assert command(folder, *command_line).stdout.startswith(f"{path}  36 rows, ")
    assert [header.partition(" ")[0] for header in read(path)][:3] == [
        "theta",
        "displacement_amplitude",
        "frequency",
    ]
    assert list(read(path).iloc[:2, 3]) == [1.0, 2.5]
    done = command(
        folder,
        "export",
        "cases.nc",
        "-o",
        "p.csv",
        "--variable",
        "sliding_mode",
        "--columns",
        "case",
    )
    assert done.returncode == 0, done.stderr
    header = (folder / "p.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header == 'frequency (Hz) \\ case: sliding_mode,"mild ± slope, wet",steep'


def test_a_pivoted_table_of_a_result_has_the_axes_of_that_result(
    folder: Path, tmp_path: Path
) -> None:
    text = GRID.replace("displacement_amplitude", "amplitude")
    running.run(sweep_job(spec.parse(text, "x")), tmp_path / "a.nc", command="x")
    assert export.export(tmp_path / "a.nc", tmp_path / "t.xlsx", columns="theta") == 3 * 24 + 12
    sheet = pd.read_excel(tmp_path / "t.xlsx", sheet_name="limiting_acceleration")
    names = [header.partition(" ")[0] for header in map(str, sheet)]
    assert names == ["mu_s", "amplitude", "decay_rate", "0", "5", "20"]
    with pytest.raises(
        InputError, match="--columns frequency: not an axis of limiting_acceleration; choose others"
    ):
        export.export(tmp_path / "a.nc", tmp_path / "u.xlsx", columns="frequency")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--at", "theta=6"),
            "theta = 6: not among the values of the result; its neighbours are 5 and 20 degree",
        ),
        (("--at", "theta=21"), "theta = 21: outside the range of the result, 0 to 20 degree"),
        (("--at", "thet=5"), 'thet = 5: no such axis; did you mean "theta"?'),
        (("--at", "theta=5mm"), "must be a number, with a unit that converts to degree"),
        (("--at", "theta"), "--at theta: must be NAME=VALUE"),
        (("--rows", "theta"), "--rows theta: needs --columns"),
        (("--columns", "theta", "--rows", "theta"), "must be different axes"),
        (("--columns", "thet"), 'no such axis here; did you mean "theta"?'),
        (
            ("--columns", "mu_s"),
            "a table with --columns has one result; choose it with --variable (permanent_disp",
        ),
        (
            ("--columns", "mu_s", "--rows", "theta", "--at", "frequency=2"),
            "neither in --rows nor in --columns: displacement_amplitude (3 values), decay_rate "
            "(2 values)",
        ),
    ],
)
def test_wrong_options_of_a_slice_are_refused_in_a_line(
    folder: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    done = command(folder, "export", "grid.nc", "-o", tmp_path / "t.csv", *options)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert message in done.stderr
    assert not (tmp_path / "t.csv").exists()


def test_a_case_is_cut_by_its_label(folder: Path, tmp_path: Path) -> None:
    export.export(folder / "cases.nc", tmp_path / "t.csv", at={"case": "mild ± slope, wet"})
    assert set(read(tmp_path / "t.csv").label) == {"mild ± slope, wet"}


# ----------------------------------------------------------------------------- spreadsheets


def test_a_spreadsheet_says_what_it_is_of(folder: Path, tmp_path: Path) -> None:
    """Another program reads a sheet for each result, and those of inputs, flags and provenance."""
    path = tmp_path / "t.xlsx"
    export.export(
        folder / "cases.nc", path, columns="frequency", at={"case": "steep,1"}, words=True
    )
    book = openpyxl.load_workbook(path)
    assert book.sheetnames[-1] == "about"
    assert {"permanent_displacement", "sliding_mode", "validity"} <= {*book.sheetnames}
    rows = [*book["validity"].iter_rows(values_only=True)]
    assert [type(value) for value in rows[0][-3:]] == [
        int
    ] * 3  # numbers, that a formula can look up
    assert [row[-1] for row in rows[1:]] == ["statically_unstable", "yield_governs"]
    assert (
        book["permanent_displacement"].cell(2, book["permanent_displacement"].max_column).value
        is None
    )
    about = {str(name): text for name, text in book["about"].iter_rows(values_only=True) if name}
    assert about["base inclination"] == "2 values, 5 to 25 degree"
    assert about["friction_inputs"] == "Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated"
    assert about["1 statically_unstable"].startswith("no value: 50.00% of 6 cells; ")
    assert about["file"] == str(folder / "cases.nc")
    assert about["source"] == f"slipsweep {slipsweep.__version__}"
    texts = [str(text or "") for _, text in book["about"].iter_rows(values_only=True)]
    start = next(at for at, line in enumerate(texts) if line == CASES.splitlines()[1])
    assert texts[start : start + len(CASES.splitlines()) - 1] == CASES.splitlines()[1:]


def test_a_label_is_no_formula(tmp_path: Path) -> None:
    text = CASES.replace("steep", "=1+1")
    running.run(sweep_job(spec.parse(text, "x")), tmp_path / "a.nc", command="x")
    export.export(tmp_path / "a.nc", tmp_path / "t.xlsx")
    table = openpyxl.load_workbook(tmp_path / "t.xlsx").worksheets[0]
    kinds = {
        cell.value: cell.data_type
        for row in table.iter_rows()
        for cell in row
        if isinstance(cell.value, str)
    }
    assert kinds["=1+1"] == "s"
    export.export(tmp_path / "a.nc", tmp_path / "t.csv", variables=["sliding_mode"])
    assert set(read(tmp_path / "t.csv").label) == {"mild ± slope, wet", "'=1+1"}


@pytest.mark.parametrize("begins", ["=", "+", "-", "@", "\t"])
def test_texts_that_a_spreadsheet_computes_are_quoted_in_csv(tmp_path: Path, begins: str) -> None:
    """A number that begins with a minus is none of them."""
    label = f"{begins}SUM(A1:A9)"
    data = slipsweep.sweep(
        xr.DataArray([5.0, 6.0], dims="case"), 0.4, [2.0, 4.0], 1.0, polarity=None
    ).assign_coords(label=("case", [label, "plain"]), offset=("case", [-1.0, -2.0]))
    data.to_netcdf(tmp_path / "a.nc")
    export.export(tmp_path / "a.nc", tmp_path / "t.csv", variables=["sliding_mode"])
    rows = (tmp_path / "t.csv").read_text().splitlines()
    at = rows[0].split(",").index("label")
    assert {row.split(",")[at] for row in rows[1:]} == {f"'{label}", "plain"}
    at = rows[0].split(",").index("offset")
    assert {row.split(",")[at] for row in rows[1:]} == {"-1.0", "-2.0"}


def test_accelerations_are_written_in_g_on_request(folder: Path, tmp_path: Path) -> None:
    export.export(folder / "grid.nc", tmp_path / "t.csv", in_g=True)
    export.export(folder / "grid.nc", tmp_path / "u.csv")
    frame = read(tmp_path / "t.csv")
    plain = read(tmp_path / "u.csv")
    np.testing.assert_allclose(
        frame["limiting_acceleration (g)"], plain["limiting_acceleration (m s-2)"] / 9.81, rtol=1e-6
    )
    assert "permanent_displacement (m)" in frame


@pytest.mark.parametrize(
    ("num", "options", "message"),
    [
        (
            1200,
            {},
            "the table has 1440000 rows (1200 theta x 1200 mu_s) and 3 columns, a sheet of .xlsx "
            "1048576",
        ),
        (524288, {}, "the table has 1048576 rows"),
        (
            17000,
            {"columns": "theta"},
            "and 17001 columns, a sheet of .xlsx 1048576 with its header and 16384",
        ),
    ],
)
def test_a_table_larger_than_a_sheet_is_refused(
    tmp_path: Path, num: int, options: dict[str, Any], message: str
) -> None:
    shape = (num, 1200 if num == 1200 else 2)
    modes = xr.DataArray(np.zeros(shape, np.int8), dims=("theta", "mu_s"), name="sliding_mode")
    data = modes.assign_coords(theta=np.arange(shape[0]), mu_s=np.arange(shape[1])).to_dataset()
    data.assign_attrs(source="slipsweep 0").to_netcdf(tmp_path / "a.nc")
    with pytest.raises(InputError) as refused:
        export.export(tmp_path / "a.nc", tmp_path / "t.xlsx", **options)
    assert message in str(refused.value)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.nc"]


# ----------------------------------------------------------------------------------- flags


@pytest.mark.parametrize("chunks", [None, {}])
def test_flags_are_the_bits(folder: Path, chunks: dict[str, int] | None) -> None:
    with xr.open_dataset(folder / "grid.nc", chunks=chunks) as data:
        flags = slipsweep.flags(data)
        kinds = [flags[name].attrs["kind"] for name in flags.data_vars]
        assert sorted(map(str, flags.data_vars)) == sorted(
            (flag.name or "").lower() for flag in Validity
        )
        assert kinds == ["no value"] * 6 + ["caution"] * 5 + ["note"] * 2
        assert flags.uplift.dims == data.validity.dims
        assert bool(flags.chunks) == (chunks is not None)  # lazy data stay lazy
        assert flags.statically_unstable.any()
        together = sum(
            int(flag) * flags[(flag.name or "").lower()].astype(int) for flag in Validity
        )
        xr.testing.assert_equal(together, data.validity.astype(int))
        xr.testing.assert_identical(flags, slipsweep.flags(data.validity))
        for flag in Validity:
            assert flags[(flag.name or "").lower()].attrs == {
                "long_name": flag.text,
                "kind": str(flag.kind),
            }


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (xr.Dataset({"depth": 1.0}), "validity: not in this dataset, which has depth"),
        (xr.DataArray(3, name="depth"), "depth: no bit mask, 0 flag_masks and 0 flag_meanings"),
    ],
)
def test_data_without_flags_are_refused(data: xr.Dataset | xr.DataArray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        slipsweep.flags(data)


def test_one_cell_is_a_table_of_one_row(folder: Path, tmp_path: Path) -> None:
    """A file without dimensions is a table of one row."""
    cell = tmp_path / "cell.nc"
    path = tmp_path / "t.csv"
    with xr.open_dataset(folder / "cases.nc", mask_and_scale=False) as data:
        data.isel(case=0, frequency=1).to_netcdf(cell)
    assert export.export(cell, path, words=True) == 1
    row = bare(read(path)).iloc[0]
    assert (row.label, row.sliding_mode, row.frequency) == ("mild ± slope, wet", "stick_slip", 2.0)
