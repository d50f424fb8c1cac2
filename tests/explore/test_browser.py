"""The page in Chromium: it shows the dataset, and runs nothing of a file."""

import json
import math
import re
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
from tests.support.browser import FOUND, chosen, move, point, show, text_of, wait_for
from tests.support.pages import AXES, SUITE, contents


def test_page_loads_without_errors_and_without_network(opened: Any) -> None:
    move(opened, 0, 1)
    point(opened, 0.3, 0.2, click=True)
    wrong = [
        entry for entry in opened.get_log("browser") if entry["level"] not in ("INFO", "DEBUG")
    ]
    assert wrong == []
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


def test_readout_is_the_dataset(opened: Any, result: Path) -> None:
    with xr.open_dataset(result, mask_and_scale=False) as data:
        seen = set()
        for theta, mu_s, x, y in (
            (0, 0, 0.1, 0.1),
            (1, 0, 0.92, 0.6),
            (1, 0, 0.5, 0.75),
            (1, 0, 0.2, 0.97),
            (1, 1, 0.33, 0.05),
            (2, 0, 0.5, 0.5),
        ):
            move(opened, theta, mu_s)
            point(opened, x, y)
            wait_for(
                opened,
                "document.getElementById('readout-title').textContent === 'Cell under the pointer'",
            )
            places = (text_of(opened, f"readout-{name}") for name in ("amplitude", "frequency"))
            amplitude, frequency = (float(text.split()[0]) for text in places)
            # the cell is where the pointer is: axes from half a cell before the first value to half
            # a cell after
            assert abs(amplitude - (12.25 - 11.5 * y)) <= 0.27
            step = math.log(50) / 17
            assert abs(math.log(frequency / 0.2) - (-0.5 + 18 * x) * step) <= 0.54 * step
            cell = data.sel(theta=AXES[0][theta], mu_s=AXES[1][mu_s]).sel(
                amplitude=amplitude, frequency=frequency, method="nearest"
            )
            for name in ("permanent_displacement", "newmark_displacement"):
                expected = float(cell[name])
                text = text_of(opened, f"readout-{name}")
                if math.isnan(expected):
                    assert text == "no value"
                else:
                    metres = float(text.split()[0]) * {"mm": 1e-3, "m": 1.0}[text.split()[1]]
                    assert metres == pytest.approx(expected, rel=5.1e-4, abs=1e-30)
            flags = [
                [f"{kind}: {FLAG_KIND_TEXT[kind]}", f"{(flag.name or '').lower()}: {flag.text}"]
                for kind in FlagKind
                for flag in Validity(int(cell.validity)) & flags_of(kind)
            ]
            rows = opened.execute_script(
                "return [...document.querySelectorAll('dd.flag')]"
                ".map((dd) => [dd.previousSibling.textContent, dd.textContent])"
            )
            assert rows == flags
            mode = SlidingMode(int(cell.sliding_mode)).name.lower()
            assert text_of(opened, "readout-mode") == mode
            seen |= {mode, *(flag.split(":")[0] for _, flag in flags)}
        assert {"stuck", "stick_slip", "continuous", "missing", "statically_unstable"} <= seen


def test_the_page_starts_on_a_sound_cell(opened: Any, result: Path) -> None:
    index = chosen(opened)
    with xr.open_dataset(result, mask_and_scale=False) as data:
        cell = data.isel(dict(zip(("theta", "mu_s", "amplitude", "frequency"), index, strict=True)))
        assert cell.permanent_displacement > 0
        assert not Validity(int(cell.validity)) & (CAUTIONS | VALUELESS)


def test_nothing_of_a_file_runs_in_the_page(browser: Any, tmp_path: Path) -> None:
    """A dimension's and a motion's names, a title: all are text."""
    name = "<img src=x onerror=document.title='run'>"
    label = "<!--<script>document.title='run'"
    suite = read_suite([SUITE / f"{one}_H1.AT2" for one in ("rock-far", "rock-near")])
    data = sweep(5, [0.1, 0.2], amplitude=[2.0, 4.0], excitation=suite)
    data = data.assign_coords(motion=[label, "</script><script>document.title='run'</script>"])
    data = data.expand_dims({name: 2}).assign_attrs(title=name, friction_inputs=label)
    data.to_zarr(tmp_path / "own.zarr", zarr_format=3)
    write_page(tmp_path / "own.zarr", tmp_path / "page.html")
    browser.get_log("browser")
    show(browser, tmp_path / "page.html")
    assert browser.title == name
    assert label in text_of(browser, "slider-motion")
    assert browser.execute_script("return document.querySelectorAll('img').length") == 0
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    # the policy stops a script that gets into the page all the same
    browser.execute_script(
        "const s = document.createElement('script'); s.textContent = 'document.title = 1'; document.body.append(s)"
    )
    assert browser.title == name


def test_history_is_of_the_very_cell_that_is_named(opened: Any) -> None:
    move(opened, 1, 0)
    point(opened, 0.4, 0.25, click=True)
    index = chosen(opened)
    assert chosen(opened, "history-note") == index
    theta, mu_s, amplitude, frequency = (
        float(axis[at]) for axis, at in zip(AXES, index, strict=True)
    )
    assert (theta, mu_s) == (5, 0.3)
    assert text_of(opened, "history-note").endswith("the first 3 of 4 cycles.")
    drawn = opened.execute_script(
        FOUND + "const d = found('history').data; return [[...d.t], [...d.v], [...d.u]]"
    )
    expected = simulate(
        theta, mu_s, amplitude, frequency, times=drawn[0], excitation=Sine(cycles=4)
    )
    assert drawn[0][-1] == pytest.approx(3 / frequency, rel=1e-12)
    for values, exact in (
        (drawn[1], expected.relative_velocity),
        (drawn[2], expected.relative_displacement * 1000),
    ):
        assert float(exact.max()) > 0.0
        np.testing.assert_allclose(values, exact, rtol=0, atol=float(exact.max()) / 30_000)
    shown = opened.execute_script(
        FOUND + "const d = found('history').data, r = found('accelerations_range');"
        "return [[...d.ground], [...d.block], r.start, r.end, found('accelerations_g').end]"
    )
    for values, exact in (
        (shown[0], expected.ground_acceleration),
        (shown[1], expected.block_acceleration),
    ):
        differs = np.abs(np.array(values) - exact.values) > float(np.abs(exact).max()) / 30_000
        assert np.count_nonzero(differs) <= 3  # where braking begins, once a cycle
    most = 1.05 * np.abs(shown[:2]).max()
    assert shown[2:] == pytest.approx([-most, most, most / 9.81], rel=1e-12)
    summary = text_of(opened, "history-summary")
    (fastest,) = re.findall(r"Largest velocity ([\d.]+) m/s;", summary)
    assert float(fastest) == pytest.approx(max(drawn[1]), rel=1e-4)
    (said,) = re.findall(r"at the end ([\d.]+ m?m)\.$", summary)
    assert said == f"{drawn[2][-1]:.{len(said.split()[0].partition('.')[2])}f} mm"


def test_map_colours_are_the_dataset(opened: Any) -> None:
    """The picture itself: every pixel has the displacement of the cell it lies in."""
    move(opened, 1, 0)
    shape, values = opened.execute_script(
        FOUND + "const d = found('colours').data.image[0]; return [d.shape, [...d]]"
    )
    script = "return ['map_g', 'y_range'].map(found).map((one) => [one.start, one.end])"
    in_g, ends = np.array(opened.execute_script(FOUND + script))
    np.testing.assert_allclose(in_g * 9.81, ends, rtol=1e-12)
    seen = np.reshape(np.array(values, float), shape)  # from below
    mm = 1000 * sweep(5, 0.3, *AXES[2:], excitation=Sine(cycles=4)).permanent_displacement.values
    rows = ((np.arange(23) + 0.5) * seen.shape[0] / 23).astype(int)
    columns = ((np.arange(18) + 0.5) * seen.shape[1] / 18).astype(int)
    np.testing.assert_allclose(seen[np.ix_(rows, columns)], np.where(mm > 0, mm, np.nan), rtol=1e-6)


def test_the_summary_of_the_map_is_its_dataset_in_words(opened: Any, result: Path) -> None:
    """Counts of cells by kind and the range of the displacements, for those who do not see the picture."""
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
        words = [f", {int(one.sum())} {text}" for text, one in counts.items() if one.any()]
        expected = (
            "peak ground acceleration A (m/s²) over excitation frequency f (Hz). "
            f"{u.size} cells{''.join(words)}"
        )
        summary = text_of(opened, "map-summary")
        assert summary.startswith(expected)
        ends = re.findall(r"; from ([\d.]+) (m+) to ([\d.]+) (m+)\.$", summary)
        assert bool(ends) == bool((u > 0.0).any())
        for low, low_unit, high, high_unit in ends:
            metres = {"mm": 1e-3, "m": 1.0}
            slides = u.where(u > 0.0)
            assert float(low) * metres[low_unit] == pytest.approx(float(slides.min()), rel=6e-4)
            assert float(high) * metres[high_unit] == pytest.approx(float(slides.max()), rel=6e-4)


def test_the_other_layer_is_newmarks_block(opened: Any, result: Path) -> None:
    """Its colours, its title, and the line of the readout."""
    move(opened, 1, 0)
    opened.execute_script(
        "const list = document.getElementById('layer');"
        "list.selectedIndex = 1; list.dispatchEvent(new Event('change'))"
    )
    try:
        assert text_of(opened, "map-title") == RESULTS["newmark_displacement"]["long_name"]
        shape, values = opened.execute_script(
            FOUND + "const d = found('colours').data.image[0]; return [d.shape, [...d]]"
        )
        seen = np.reshape(np.array(values, float), shape)
        with xr.open_dataset(result) as data:
            mm = 1000.0 * data.newmark_displacement.isel(theta=1, mu_s=0).values
        rows = ((np.arange(23) + 0.5) * seen.shape[0] / 23).astype(int)
        columns = ((np.arange(18) + 0.5) * seen.shape[1] / 18).astype(int)
        expected = np.where(mm > 0, mm, np.nan)
        np.testing.assert_allclose(seen[np.ix_(rows, columns)], expected, rtol=1e-6)
    finally:
        show(opened, result.with_suffix(".html"))


def test_cells_with_a_history_are_marked_where_they_are(opened: Any, written: Path) -> None:
    move(opened, 1, 0)
    meta, arrays = contents(written)
    store = meta["histories"]["keep"]
    there = np.isfinite(arrays["history_scale"][..., 0])
    rows = there[store["theta"].index(1), store["mu_s"].index(0)]
    amplitudes = np.array(AXES[2])[store["amplitude"]][rows]
    expected = {(float(f), float(a)) for f in AXES[3] for a in amplitudes}
    drawn = opened.execute_script(
        FOUND + "const d = found('held').data; return [[...d.x], [...d.y]]"
    )
    points = np.array(sorted(zip(*drawn, strict=True)))
    np.testing.assert_allclose(points, sorted(expected), rtol=1e-12)


def test_zoom_shows_a_part_about_the_chosen_cell(opened: Any) -> None:
    """Half of both axes, on the scale of each; the whole map again."""

    def ranges() -> np.ndarray:
        script = "const r = ['x_range', 'y_range'].map(found); return r.map((one) => [one.start, one.end])"
        return np.array(opened.execute_script(FOUND + script))

    move(opened, 1, 0)
    whole = ranges()
    step = np.log10(50) / 17
    np.testing.assert_allclose(np.log10(whole[0]), [np.log10(0.2) - step / 2, 1 + step / 2])
    np.testing.assert_allclose(whole[1], [0.75, 12.25])
    opened.execute_script("document.getElementById('zoom-in').click()")
    part = ranges()
    assert np.ptp(np.log10(part[0])) == pytest.approx(0.5 * np.ptp(np.log10(whole[0])))
    assert np.ptp(part[1]) == pytest.approx(0.5 * np.ptp(whole[1]))
    _, _, amplitude, frequency = chosen(opened)
    assert part[0][0] < AXES[3][frequency] < part[0][1]
    assert part[1][0] < AXES[2][amplitude] < part[1][1]
    opened.execute_script("document.getElementById('zoom-whole').click()")
    np.testing.assert_allclose(ranges(), whole)
