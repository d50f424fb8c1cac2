"""The page in Chromium shows the dataset, and runs nothing of a file."""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import (
    Sine,
    SlidingMode,
    Validity,
    flags,
    read_suite,
    simulate,
    sweep,
)
from slipsweep.explore.page import write_page
from slipsweep.model.variables import (
    CAUTIONS,
    FLAG_KIND_TEXT,
    RESULTS,
    VALUELESS,
    FlagKind,
    flags_of,
)
from tests.support.browser import (
    MODEL,
    choose_layer,
    chosen,
    image_of_map,
    move,
    point,
    show,
    text_of,
    wait_for,
)
from tests.support.pages import AXES, SUITE, contents


def test_page_loads_without_errors_and_without_network(opened: Any) -> None:
    move(opened, 0, 1)
    point(opened, 0.3, 0.2, click=True)
    entries = opened.get_log("browser")
    assert [entry for entry in entries if entry["level"] not in ("INFO", "DEBUG")] == []
    events = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
    # the browser's own start page, which it may be loading still, is not ours
    urls = [
        request["request"]["url"]
        for request in sent
        if not request["documentURL"].startswith("chrome")
    ]
    assert urls
    assert {url.split(":")[0] for url in urls} <= {"file", "data", "blob"}


#: Positions of the sliders of θ and μs, and shares of the map from the upper left.
POINTED = (
    (0, 0, 0.1, 0.1),
    (1, 0, 0.92, 0.6),
    (1, 0, 0.5, 0.75),
    (1, 0, 0.2, 0.97),
    (1, 1, 0.33, 0.05),
    (2, 0, 0.5, 0.5),
)

METRES = {"mm": 1e-3, "m": 1.0}


@dataclass(frozen=True)
class Readout:
    """Readout of the cell at a point of the map, and that cell in the dataset."""

    x: float
    y: float
    amplitude: float
    frequency: float
    displacements: dict[str, str]
    flags: list[list[str]]
    mode: str
    cell: xr.Dataset


@pytest.fixture(scope="module")
def readouts(browser: Any, written: Path, result: Path) -> list[Readout]:
    show(browser, written)
    with xr.open_dataset(result, mask_and_scale=False) as data:
        return [_readout(browser, data, *place) for place in POINTED]


def _readout(browser: Any, data: xr.Dataset, theta: int, mu_s: int, x: float, y: float) -> Readout:
    move(browser, theta, mu_s)
    point(browser, x, y)
    title = "document.getElementById('readout-title').textContent"
    wait_for(browser, f"{title} === 'Cell under the pointer'")
    amplitude, frequency = (
        float(text_of(browser, f"readout-{name}").split()[0]) for name in ("amplitude", "frequency")
    )
    cell = data.sel(theta=AXES[0][theta], mu_s=AXES[1][mu_s])
    displacements = {
        name: text_of(browser, f"readout-{name}")
        for name in ("permanent_displacement", "newmark_displacement")
    }
    flag_rows = browser.execute_script(
        "return [...document.querySelectorAll('dd.flag')]"
        ".map((dd) => [dd.previousSibling.textContent, dd.textContent])"
    )
    return Readout(
        x,
        y,
        amplitude,
        frequency,
        displacements,
        flag_rows,
        text_of(browser, "readout-mode"),
        cell.sel(amplitude=amplitude, frequency=frequency, method="nearest"),
    )


def test_readout_is_of_the_cell_under_the_pointer(readouts: list[Readout]) -> None:
    """Axes reach from half a cell before the first value to half a cell after the last."""
    step = math.log(50) / 17
    for readout in readouts:
        assert abs(readout.amplitude - (12.25 - 11.5 * readout.y)) <= 0.27
        steps = math.log(readout.frequency / 0.2) / step
        assert abs(steps - (-0.5 + 18 * readout.x)) <= 0.54


def test_readout_has_the_displacements_of_the_dataset(readouts: list[Readout]) -> None:
    valueless = 0
    for readout in readouts:
        for name, text in readout.displacements.items():
            expected = float(readout.cell[name])
            if math.isnan(expected):
                assert text == "no value"
                valueless += 1
            else:
                number, unit = text.split()
                metres = float(number) * METRES[unit]
                assert metres == pytest.approx(expected, rel=5.1e-4, abs=1e-30)
    assert valueless


def test_readout_has_the_flags_of_the_dataset(readouts: list[Readout]) -> None:
    names = set()
    for readout in readouts:
        validity = Validity(int(readout.cell.validity))
        expected = [
            [f"{kind}: {FLAG_KIND_TEXT[kind]}", f"{(flag.name or '').lower()}: {flag.text}"]
            for kind in FlagKind
            for flag in validity & flags_of(kind)
        ]
        assert readout.flags == expected
        names |= {text.split(":")[0] for _, text in expected}
    assert "statically_unstable" in names


def test_readout_has_the_sliding_mode_of_the_dataset(readouts: list[Readout]) -> None:
    for readout in readouts:
        assert readout.mode == SlidingMode(int(readout.cell.sliding_mode)).name.lower()
    modes = {readout.mode for readout in readouts}
    assert {"stuck", "stick_slip", "continuous", "missing"} <= modes


DIMS = ("theta", "mu_s", "amplitude", "frequency")


def test_the_page_starts_on_a_cell_that_slides_without_a_caution(opened: Any, result: Path) -> None:
    with xr.open_dataset(result, mask_and_scale=False) as data:
        cell = data.isel(dict(zip(DIMS, chosen(opened), strict=True)))
        assert cell.permanent_displacement > 0
        assert not Validity(int(cell.validity)) & (CAUTIONS | VALUELESS)


def test_the_page_does_not_start_on_a_cell_with_a_caution(
    opened: Any, result: Path, tmp_path: Path
) -> None:
    """The cell on which it would start has one in another file."""
    first = chosen(opened)
    data = xr.load_dataset(result, mask_and_scale=False)
    data.validity[dict(zip(DIMS, first, strict=True))] |= int(CAUTIONS)
    data.to_netcdf(tmp_path / "caution.nc")
    write_page(tmp_path / "caution.nc", tmp_path / "page.html")
    show(opened, tmp_path / "page.html")
    assert chosen(opened) != first


@pytest.fixture
def hostile(browser: Any, tmp_path: Path) -> Any:
    """The page of a file whose title, dimension and motions have the names of scripts."""
    suite = read_suite([SUITE / f"{name}_H1.AT2" for name in ("rock-far", "rock-near")])
    data = sweep(5, [0.1, 0.2], amplitude=[2.0, 4.0], excitation=suite)
    data = data.assign_coords(motion=[LABEL, "</script><script>document.title='run'</script>"])
    data = data.expand_dims({NAME: 2}).assign_attrs(title=NAME, friction_inputs=LABEL)
    data.to_zarr(tmp_path / "hostile.zarr", zarr_format=3)
    write_page(tmp_path / "hostile.zarr", tmp_path / "page.html")
    browser.get_log("browser")
    show(browser, tmp_path / "page.html")
    return browser


NAME = "<img src=x onerror=document.title='run'>"
LABEL = "<!--<script>document.title='run'"


def test_names_and_titles_of_a_file_are_text_in_the_page(hostile: Any) -> None:
    assert hostile.title == NAME
    assert LABEL in text_of(hostile, "slider-motion")
    assert hostile.execute_script("return document.querySelectorAll('img').length") == 0
    assert [entry for entry in hostile.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_a_script_that_gets_into_the_page_does_not_run(opened: Any) -> None:
    title = opened.title
    opened.execute_script(
        "const script = document.createElement('script');"
        "script.textContent = 'document.title = 1'; document.body.append(script)"
    )
    assert opened.title == title


@dataclass(frozen=True)
class DrawnHistory:
    """History of a cell that was clicked: texts, columns, and ends of the axes of accelerations."""

    index: list[int]
    index_of_note: list[int]
    note: str
    summary: str
    columns: dict[str, list[float]]
    ends: list[float]


@pytest.fixture(scope="module")
def drawn(browser: Any, written: Path) -> DrawnHistory:
    """History after a click on a cell of θ = 5°, μs = 0.3."""
    show(browser, written)
    move(browser, 1, 0)
    point(browser, 0.4, 0.25, click=True)
    columns = browser.execute_script(
        MODEL + "return Object.fromEntries("
        "Object.entries(model('history').data).map(([name, values]) => [name, [...values]]))"
    )
    ends = browser.execute_script(
        MODEL + "const range = model('accelerations_range');"
        "return [range.start, range.end, model('accelerations_g').end]"
    )
    return DrawnHistory(
        chosen(browser),
        chosen(browser, "history-note"),
        text_of(browser, "history-note"),
        text_of(browser, "history-summary"),
        columns,
        ends,
    )


@pytest.fixture(scope="module")
def simulated(drawn: DrawnHistory) -> xr.Dataset:
    """History of the chosen cell, computed at the times that are drawn."""
    cell = [float(axis[place]) for axis, place in zip(AXES, drawn.index, strict=True)]
    return simulate(*cell, times=drawn.columns["t"], excitation=Sine(cycles=4))


def test_history_is_of_the_cell_that_is_named(drawn: DrawnHistory) -> None:
    assert drawn.index[:2] == [1, 0]
    assert drawn.index_of_note == drawn.index
    assert drawn.note.endswith("the first 3 of 4 cycles.")


def test_history_has_three_cycles(drawn: DrawnHistory) -> None:
    frequency = AXES[3][drawn.index[3]]
    assert drawn.columns["t"][-1] == pytest.approx(3 / frequency, rel=1e-12)


def test_history_has_the_velocity_and_displacement_of_simulate(
    drawn: DrawnHistory, simulated: xr.Dataset
) -> None:
    for values, expected in (
        (drawn.columns["v"], simulated.relative_velocity),
        (drawn.columns["u"], simulated.relative_displacement * 1000),
    ):
        assert float(expected.max()) > 0.0
        np.testing.assert_allclose(values, expected, rtol=0, atol=float(expected.max()) / 30_000)


def test_history_has_the_accelerations_of_simulate(
    drawn: DrawnHistory, simulated: xr.Dataset
) -> None:
    for values, expected in (
        (drawn.columns["ground"], simulated.ground_acceleration),
        (drawn.columns["block"], simulated.block_acceleration),
    ):
        tolerance = float(np.abs(expected).max()) / 30_000
        differs = np.abs(np.array(values) - expected.values) > tolerance
        assert np.count_nonzero(differs) <= 3  # where braking begins, once a cycle


def test_axes_of_accelerations_hold_both_in_metres_and_in_g(drawn: DrawnHistory) -> None:
    most = 1.05 * np.abs([drawn.columns["ground"], drawn.columns["block"]]).max()
    assert drawn.ends == pytest.approx([-most, most, most / 9.81], rel=1e-12)


def test_the_summary_of_a_history_has_its_largest_velocity_and_last_displacement(
    drawn: DrawnHistory,
) -> None:
    (fastest,) = re.findall(r"Largest velocity ([\d.]+) m/s;", drawn.summary)
    assert float(fastest) == pytest.approx(max(drawn.columns["v"]), rel=1e-4)
    (moved,) = re.findall(r"at the end ([\d.]+) mm\.$", drawn.summary)
    assert float(moved) == pytest.approx(drawn.columns["u"][-1], rel=5.1e-4)


def cells_of_map(driver: Any) -> np.ndarray:
    """Numbers that give the cells of the map their colours, from the pixels in their middles."""
    image = image_of_map(driver)
    rows = ((np.arange(23) + 0.5) * image.shape[0] / 23).astype(int)
    columns = ((np.arange(18) + 0.5) * image.shape[1] / 18).astype(int)
    return image[np.ix_(rows, columns)]


def test_colours_of_the_map_are_the_displacements_of_its_cells(opened: Any) -> None:
    move(opened, 1, 0)
    mm = 1000 * sweep(5, 0.3, *AXES[2:], excitation=Sine(cycles=4)).permanent_displacement.values
    np.testing.assert_allclose(cells_of_map(opened), np.where(mm > 0, mm, np.nan), rtol=1e-6)


def test_the_axis_in_g_is_the_axis_in_metres_over_g(opened: Any) -> None:
    script = "return ['map_g', 'y_range'].map(model).map((range) => [range.start, range.end])"
    in_g, ends = np.array(opened.execute_script(MODEL + script))
    np.testing.assert_allclose(in_g * 9.81, ends, rtol=1e-12)


def test_the_summary_of_the_map_counts_its_cells_and_has_their_range(
    opened: Any, result: Path
) -> None:
    """Those who do not see the picture read of its kinds of cells and its displacements."""
    names = [(flag.name or "").lower() for flag in CAUTIONS]
    for theta, mu_s in ((1, 0), (2, 0)):
        move(opened, theta, mu_s)
        with xr.open_dataset(result, mask_and_scale=False) as data:
            cells = data.isel(theta=theta, mu_s=mu_s).load()
        u = cells.permanent_displacement
        caution = flags(cells).to_array().sel(variable=names).any("variable") & (u > 0.0)
        counts = {
            "without displacement": u == 0.0,
            "without a value": u.isnull(),
            "with a caution": caution,
            "upslope": u < 0.0,
        }
        words = [f", {int(kind.sum())} {text}" for text, kind in counts.items() if kind.any()]
        expected = (
            "peak ground acceleration A (m/s²) over excitation frequency f (Hz). "
            f"{u.size} cells{''.join(words)}"
        )
        summary = text_of(opened, "map-summary")
        assert summary.startswith(expected)
        ends = re.findall(r"; from ([\d.]+) (m+) to ([\d.]+) (m+)\.$", summary)
        assert bool(ends) == bool((u > 0.0).any())
        for low, low_unit, high, high_unit in ends:
            slides = u.where(u > 0.0)
            assert float(low) * METRES[low_unit] == pytest.approx(float(slides.min()), rel=6e-4)
            assert float(high) * METRES[high_unit] == pytest.approx(float(slides.max()), rel=6e-4)


def test_the_other_layer_is_newmarks_block(opened: Any, result: Path) -> None:
    """Its title and its colours."""
    move(opened, 1, 0)
    choose_layer(opened, 1)
    assert text_of(opened, "map-title") == RESULTS["newmark_displacement"]["long_name"]
    with xr.open_dataset(result) as data:
        mm = 1000.0 * data.newmark_displacement.isel(theta=1, mu_s=0).values
    np.testing.assert_allclose(cells_of_map(opened), np.where(mm > 0, mm, np.nan), rtol=1e-6)


def test_cells_with_a_history_have_a_dot_in_the_map(opened: Any, written: Path) -> None:
    move(opened, 1, 0)
    meta, arrays = contents(written)
    store = meta["histories"]["keep"]
    has_history = np.isfinite(arrays["history_scale"][..., 0])
    rows = has_history[store["theta"].index(1), store["mu_s"].index(0)]
    amplitudes = np.array(AXES[2])[store["amplitude"]][rows]
    expected = {(float(f), float(a)) for f in AXES[3] for a in amplitudes}
    dots = opened.execute_script(
        MODEL + "const dots = model('cells_with_history').data; return [[...dots.x], [...dots.y]]"
    )
    np.testing.assert_allclose(sorted(zip(*dots, strict=True)), sorted(expected), rtol=1e-12)


def ranges(driver: Any) -> np.ndarray:
    """Ends of the axes of the map, across and up."""
    script = "return ['x_range', 'y_range'].map(model).map((range) => [range.start, range.end])"
    return np.array(driver.execute_script(MODEL + script))


def press(driver: Any, button: str) -> None:
    driver.execute_script("document.getElementById(arguments[0]).click()", button)


def test_the_map_reaches_half_a_cell_beyond_its_values(opened: Any) -> None:
    across, up = ranges(opened)
    step = np.log10(50) / 17
    np.testing.assert_allclose(np.log10(across), [np.log10(0.2) - step / 2, 1 + step / 2])
    np.testing.assert_allclose(up, [0.75, 12.25])


def test_zoom_shows_half_of_both_axes_about_the_chosen_cell(opened: Any) -> None:
    move(opened, 1, 0)
    across, up = ranges(opened)
    press(opened, "zoom-in")
    part_across, part_up = ranges(opened)
    assert np.ptp(np.log10(part_across)) == pytest.approx(0.5 * np.ptp(np.log10(across)))
    assert np.ptp(part_up) == pytest.approx(0.5 * np.ptp(up))
    _, _, amplitude, frequency = chosen(opened)
    assert part_across[0] < AXES[3][frequency] < part_across[1]
    assert part_up[0] < AXES[2][amplitude] < part_up[1]


@pytest.mark.parametrize("button", ["zoom-out", "zoom-whole"])
def test_zoom_shows_the_whole_map_again(opened: Any, button: str) -> None:
    whole = ranges(opened)
    press(opened, "zoom-in")
    press(opened, button)
    np.testing.assert_allclose(ranges(opened), whole)


def test_a_slider_takes_the_zoomed_map_along_with_the_chosen_cell(opened: Any) -> None:
    press(opened, "zoom-in")
    opened.execute_script(
        "const slider = document.getElementById('slider-amplitude');"
        "slider.value = 22; slider.dispatchEvent(new Event('input'))"
    )
    _, up = ranges(opened)
    assert up[1] == pytest.approx(12.25)
    assert np.ptp(up) == pytest.approx(0.5 * 11.5)
