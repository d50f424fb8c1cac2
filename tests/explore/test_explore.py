"""The page that `slipsweep explore` writes: what is in it, and what it does in Chromium."""

import base64
import json
import math
import os
import re
import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import (
    InputError,
    Sine,
    SlidingMode,
    Validity,
    read_suite,
    simulate,
    suite_statistics,
    sweep,
)
from slipsweep.explore.page import write_page
from slipsweep.model.variables import CAUTIONS, FLAG_KIND_TEXT, VALUELESS, FlagKind, flags_of
from tests.support.commands import command

#: Stuck, stick-slip, continuous, flagged and statically unstable cells.
SWEEP = """
axes.theta.values = [0, 5, 20]
axes.mu_s.values = [0.3, 0.5]
axes.amplitude = {start = 1, stop = 12, num = 23}
axes.frequency = {start = 0.2, stop = 10, num = 18, spacing = "log"}
excitation.cycles = 4
output.variables = ["permanent_displacement", "newmark_displacement", "sliding_mode", "validity"]
"""

SUITE = Path(__file__).parents[2] / "sweeps" / "data" / "suite"

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")


def make(folder: Path, text: str) -> Path:
    """Run a sweep in `folder`."""
    (folder / "sweep.toml").write_text(text)
    done = command(folder, "run", "sweep.toml", "-o", "small.nc", "--quiet")
    assert done.returncode == 0, done.stderr
    return folder / "small.nc"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("explore"), SWEEP)


@pytest.fixture(scope="module")
def written(result: Path) -> Path:
    output = result.with_suffix(".html")
    write_page(result, output)
    return output


def contents(page: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What a page says of itself, and its arrays."""
    found = re.search(
        r'<script type="application/json" id="meta">(.*?)</script>',
        page.read_text(encoding="utf-8"),
    )
    assert found
    meta = json.loads(found[1])
    arrays = {}
    for name, about in meta["arrays"].items():
        data = zlib.decompress(base64.b64decode(about["data"]))
        arrays[name] = np.frombuffer(data, "<" + about["dtype"]).reshape(about["shape"])
        if law := about.get(
            "law"
        ):  # displacements at the first value of this dimension give all others
            dims = [dim["name"] for dim in meta["dims"]]
            values = np.array(meta["dims"][dims.index(law["dim"])]["values"]) ** law["power"]
            arrays[name] = arrays[name] * values.reshape(
                [-1 if dim == law["dim"] else 1 for dim in dims]
            )
    return meta, arrays


def axes_of(meta: dict[str, Any]) -> dict[str, list[float]]:
    return {dim["name"]: dim["values"] for dim in meta["dims"]}


# -------------------------------------------------------------------- what is in the page


def test_page_holds_the_dataset(result: Path, written: Path) -> None:
    meta, arrays = contents(written)
    with xr.open_dataset(result, mask_and_scale=False) as data:
        expected = data.sel(axes_of(meta)).transpose(*axes_of(meta))
        assert axes_of(meta)["theta"] == [0.0, 5.0, 20.0]
        for name in ("sliding_mode", "validity"):
            np.testing.assert_array_equal(
                np.broadcast_to(arrays[name], expected[name].shape), expected[name]
            )
        # single precision, and once more by the law of frequencies
        np.testing.assert_allclose(
            arrays["permanent_displacement"], expected.permanent_displacement, rtol=4e-7, atol=0
        )
        lengths = expected[["permanent_displacement", "newmark_displacement"]].to_array() * 1000.0
    # u = W/ω²: stored at one frequency
    assert meta["arrays"]["permanent_displacement"]["shape"] == [3, 2, 23, 1]
    assert [dim["log"] for dim in meta["dims"]] == [False, False, False, True]
    text = json.dumps(meta["figures"], ensure_ascii=False)
    assert '"excitation frequency f (Hz), logarithmic scale"' in text
    assert '"peak ground acceleration A (m/s²)"' in text
    assert '[10.0, "10 mm"]' in text  # of the bar of colours
    low, high = np.nanpercentile(np.log10(lengths.where(lengths > 0)), (5, 95))  # nine cells in ten
    assert (
        f"those beyond {10 ** math.floor(low):g} and {10 ** math.ceil(high):g} mm have"
        in written.read_text()
    )
    assert meta["unsound"] == int(CAUTIONS | VALUELESS)
    assert "All 2,484 cells of the file are in this page." in written.read_text()


def test_histories_are_those_of_simulate(written: Path) -> None:
    meta, arrays = contents(written)
    axes = axes_of(meta)
    store = meta["histories"]
    assert list(store["keep"]) == ["theta", "mu_s", "amplitude"]
    frequency = 1.7
    omega = 2.0 * math.pi * frequency
    seen = set()
    factors = {
        "block_acceleration": 1.0,
        "relative_velocity": 1.0 / omega,
        "relative_displacement": 1.0 / omega**2,
    }
    for place in np.ndindex(*(len(kept) for kept in store["keep"].values())):
        case = {
            dim: axes[dim][kept[at]]
            for (dim, kept), at in zip(store["keep"].items(), place, strict=True)
        }
        scale = arrays["history_scale"][place]
        if case["amplitude"] % 2 != 0 or case["theta"] == 0.0:
            continue
        times = np.array(store["phase"]) / omega
        expected = simulate(**case, frequency=frequency, times=times, excitation=Sine(cycles=4))
        if np.isnan(scale).any():
            assert expected.validity & Validity.STATICALLY_UNSTABLE
            continue
        seen.add(int(expected.sliding_mode))
        ground = case["amplitude"] * np.array(store["ground"])
        np.testing.assert_allclose(
            expected.ground_acceleration, ground, atol=1e-12 * case["amplitude"]
        )
        for row, (name, factor) in enumerate(factors.items()):
            kept = arrays["histories"][(*place, row)] * float(scale[row]) * factor
            differs = (
                np.abs(kept - expected[name].values) > float(np.abs(expected[name]).max()) / 60_000
            )
            # the acceleration jumps where braking begins, which rounding of t = φ/ω may put on
            # either side
            assert np.count_nonzero(differs) <= (
                store["cycles"] if name == "block_acceleration" else 0
            )
    assert seen == {SlidingMode.STUCK, SlidingMode.STICK_SLIP, SlidingMode.CONTINUOUS}


def test_large_result_is_thinned_to_the_size_and_says_how(tmp_path: Path) -> None:
    # A = ω²d: no frequency gives another
    amplitudes = np.linspace(0.1, 0.001, 460)
    frequencies = np.geomspace(0.2, 10, 180)
    data = sweep([0, 5, 20], [0.3, 0.5], displacement_amplitude=amplitudes, frequency=frequencies)
    data.to_netcdf(tmp_path / "own.nc")
    excerpt = write_page(tmp_path / "own.nc", tmp_path / "page.html", size=2_500_000)
    assert 1_800_000 < (tmp_path / "page.html").stat().st_size <= 2_500_000
    meta, arrays = contents(tmp_path / "page.html")
    axes = axes_of(meta)
    kept = {dim: len(values) for dim, values in axes.items()}
    assert kept == excerpt.sizes != excerpt.lengths
    assert axes["displacement_amplitude"][:: kept["displacement_amplitude"] - 1] == [
        0.001,
        0.1,
    ]  # in order, with ends
    expected = data.permanent_displacement.sel(axes).values.astype("f4")
    np.testing.assert_array_equal(arrays["permanent_displacement"], expected)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f"Thinned: {math.prod(kept.values()):,} of the file&#39;s 496,800 cells" in text
    assert f"displacement_amplitude: {kept['displacement_amplitude']} of 460 values" in text


# ------------------------------------------------------------------ other shaking, and statistics


@pytest.fixture(scope="module")
def suite_page(tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, Path]:
    """Of four motions and both polarities, with a frequency of the structure nowhere."""
    folder = tmp_path_factory.mktemp("suite")
    suite = read_suite(
        [SUITE / f"{name}_H1.AT2" for name in ("rock-far", "rock-near", "soft-far", "stiff-pulse")]
    )
    data = sweep(
        [0, 5], [0.1, 0.2, 0.3], amplitude=[1.0, 2.0, 4.0, 8.0], excitation=suite, polarity="both"
    )
    data.to_netcdf(folder / "suite.nc")
    write_page(folder / "suite.nc", folder / "suite.html")
    return data, folder / "suite.html"


def test_a_suite_shows_its_motions_and_their_statistics(
    suite_page: tuple[xr.Dataset, Path],
) -> None:
    data, path = suite_page
    data = data.sortby("polarity")
    meta, arrays = contents(path)
    assert (meta["map"]["y"], meta["map"]["x"]) == ("amplitude", "mu_s")
    motion = next(dim for dim in meta["dims"] if dim["name"] == "motion")
    assert motion["labels"] == data.motion.values.tolist()
    order = [dim["name"] for dim in meta["dims"]]

    def spread(values: xr.DataArray) -> np.ndarray:
        values = values.expand_dims([dim for dim in order if dim not in values.dims])
        return values.transpose(*order).values

    np.testing.assert_array_equal(
        arrays["permanent_displacement"], spread(data.permanent_displacement).astype("f4")
    )
    np.testing.assert_array_equal(arrays["validity"], spread(data.validity))
    found = suite_statistics(data, quantiles=[0.16, 0.5, 0.84])
    for name in ("displacement_quantile", "exceedance_probability"):
        expected = spread(found[name])
        np.testing.assert_allclose(
            np.broadcast_to(arrays[name], expected.shape), expected, rtol=1e-6
        )
        assert meta["arrays"][name]["dims"] == list(found[name].dims)
    assert 0.0 < arrays["exceedance_probability"].mean() < 1.0
    assert meta["histories"] is None


CASES = "[axes]\namplitude.values = [2, 6]\nfrequency.values = [1, 2]\n" + "".join(
    f'[[cases]]\nlabel = "{phi}"\ntheta = 5\nphi = {phi}\n' for phi in (20, 25)
)


@pytest.mark.parametrize(
    ("text", "dim"),
    [(SWEEP.replace("mu_s.values = [0.3, 0.5]", "phi.values = [20, 30]"), "phi"), (CASES, "case")],
)
def test_friction_angles(tmp_path: Path, text: str, dim: str) -> None:
    write_page(make(tmp_path, text), tmp_path / "a.html")
    meta, _ = contents(tmp_path / "a.html")
    assert meta["histories"] is not None
    assert dim in axes_of(meta)


@pytest.mark.parametrize("ramp", ["ramp_in", "ramp_out"])
def test_no_histories_of_waves_that_end_beyond_them(tmp_path: Path, ramp: str) -> None:
    write_page(make(tmp_path, f"{SWEEP}excitation.{ramp} = 1\n"), tmp_path / "a.html")
    assert (contents(tmp_path / "a.html")[0]["histories"] is None) == (ramp == "ramp_out")


@pytest.mark.parametrize("drawn", [False, True])
def test_records_and_uncertain_inputs(tmp_path: Path, drawn: bool) -> None:
    text = f'excitation.record = "{(SUITE / "rock-far_H1.AT2").as_posix()}"\naxes.theta.values = [2, 5]\n'
    text += "axes.scale.values = [1, 2, 4]\naxes.time_scale.values = [0.5, 1, 2]\n"
    uncertain = (
        "uncertainty = {samples = 64, mu_s = {distribution = 'uniform', loc = 0.1, scale = 0.2}}\n"
    )
    result = make(tmp_path, text + (uncertain if drawn else "axes.mu_s.values = [0.2]\n"))
    output = tmp_path / "page.html"
    write_page(result, output)
    meta, arrays = contents(output)
    assert meta["map"] == {"y": "scale", "x": "time_scale"}
    with xr.open_dataset(result) as data:
        names = (
            ("displacement_quantile", "exceedance_probability")
            if drawn
            else ("permanent_displacement",)
        )
        for name in names:
            order = [dim["name"] for dim in meta["dims"] if dim["name"] in data[name].dims]
            expected = data[name].transpose(*order).values
            np.testing.assert_allclose(
                arrays[name].reshape([data.sizes[d] for d in order]), expected, rtol=4e-7
            )
            assert np.nanmax(expected) > 0.0


# ---------------------------------------------------------------------- errors and outputs


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            SWEEP.replace('"permanent_displacement", "newmark_displacement", ', ""),
            "holds no permanent_displacement",
        ),
        (
            2 * "[[cases]]\ntheta = 5\nmu_s = 0.4\namplitude = 4\nfrequency = 2\n",
            "the dimensions are: case (2)",
        ),
    ],
)
def test_result_without_a_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    result = make(tmp_path, text)
    output = tmp_path / "page.html"
    with pytest.raises(InputError, match=re.escape(message)):
        write_page(result, output)
    assert not output.exists()


def test_command(result: Path, tmp_path: Path) -> None:
    done = command(tmp_path, "explore", str(result), "-o", "page.html")
    assert done.returncode == 0, done.stderr
    assert "23 values" in done.stdout
    page = (tmp_path / "page.html").read_bytes()
    for arguments, message in (
        ((str(result), "-o", "page.html"), "exists already"),
        ((str(result), "-o", "other.html", "--size", "20"), "--size = 20: must be"),
        ((str(result), "-o", "other.html", "--size", "100kB"), "--size = 100 kB: must be"),
        (("page.html", "-o", "other.html"), "not a netCDF file"),
        (("absent.nc", "-o", "other.html"), "no such file"),
    ):
        done = command(tmp_path, "explore", *arguments)
        assert done.returncode == 2
        assert done.stderr.startswith("slipsweep: error: ")
        assert message in done.stderr
        assert done.stderr.count("\n") == 1
    assert (tmp_path / "page.html").read_bytes() == page
    assert os.listdir(tmp_path) == ["page.html"]


# ------------------------------------------------------------------------- in the browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver")
    if not CHROMIUM or not DRIVER:
        pytest.skip("chromium and chromedriver are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    flags = "headless=new no-sandbox disable-gpu no-first-run disable-background-networking disable-component-update"
    for flag in (*flags.split(), "disable-sync", "window-size=1340,1000"):
        options.add_argument(f"--{flag}")
    options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('chromium')}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def wait_for(driver: Any, script: str) -> Any:
    """Wait until a script returns something true."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(driver, 60, 0.05).until(lambda d: d.execute_script(f"return {script}"))


@pytest.fixture
def opened(browser: Any, written: Path) -> Any:
    for log in ("browser", "performance"):
        browser.get_log(log)
    show(browser, written)
    return browser


#: A function of the page's: a model of Bokeh by its name.
FOUND = "const found = (name) => Bokeh.documents.map((one) => one.get_model_by_name(name)).find(Boolean);"


def move(driver: Any, theta: int, mu_s: int) -> None:
    """Move both sliders to a position."""
    script = (
        "const slider = document.getElementById(arguments[0]);"
        "slider.value = arguments[1]; slider.dispatchEvent(new Event('input'))"
    )
    driver.execute_script(script, "slider-theta", theta)
    driver.execute_script(script, "slider-mu_s", mu_s)


def point(driver: Any, x: float, y: float, click: bool = False) -> None:
    """Put the pointer on a place of the map, in shares of its width and height from the upper left."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    host = driver.find_element(By.ID, "map")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", host)
    frame = driver.execute_script(
        FOUND + "const m = found('map'); const b = Bokeh.index.find_one(m).frame.bbox;"
        "return [b.left, b.top, b.width, b.height]"
    )
    left = frame[0] + x * frame[2] - host.size["width"] / 2
    top = frame[1] + y * frame[3] - host.size["height"] / 2
    actions = ActionChains(driver, duration=0).move_to_element_with_offset(
        host, round(left), round(top)
    )
    (actions.click() if click else actions).perform()


def text_of(driver: Any, name: str) -> str:
    text = driver.execute_script("return document.getElementById(arguments[0]).textContent", name)
    return str(text).replace("\u00a0", " ")


def chosen(driver: Any, element: str = "readout") -> Any:
    """The index of the cell that an element is of."""
    return json.loads(
        driver.execute_script("return document.getElementById(arguments[0]).dataset.index", element)
    )


AXES: list[Any] = [[0, 5, 20], [0.3, 0.5], np.linspace(1, 12, 23), np.geomspace(0.2, 10, 18)]


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
    (said,) = re.findall(r"at the end ([\d.]+ m?m)\.$", text_of(opened, "history-summary"))
    assert said == f"{drawn[2][-1]:.{len(said.split()[0].partition('.')[2])}f} mm"


def test_map_colours_are_the_dataset(opened: Any) -> None:
    """The picture itself: every pixel has the displacement of the cell it lies in."""
    move(opened, 1, 0)
    shape, values = opened.execute_script(
        FOUND + "const d = found('colours').data.image[0]; return [d.shape, [...d]]"
    )
    in_g, top = opened.execute_script(FOUND + "return [found('map_g').end, found('y_range').end]")
    assert in_g * 9.81 == pytest.approx(top)
    seen = np.reshape(np.array(values, float), shape)  # from below
    mm = 1000 * sweep(5, 0.3, *AXES[2:], excitation=Sine(cycles=4)).permanent_displacement.values
    rows = ((np.arange(23) + 0.5) * seen.shape[0] / 23).astype(int)
    columns = ((np.arange(18) + 0.5) * seen.shape[1] / 18).astype(int)
    np.testing.assert_allclose(seen[np.ix_(rows, columns)], np.where(mm > 0, mm, np.nan), rtol=1e-6)


# ------------------------------------------------------------------------- for everybody


def show(driver: Any, path: Path, width: int = 1340) -> None:
    """Open a page in a window of some width; narrow ones are phones."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    driver.get(path.as_uri())
    wait_for(driver, "document.body.dataset.ready")
    wait_for(driver, "Bokeh.documents.every((one) => one.is_idle)")


@pytest.mark.parametrize("width", [360, 1340])
def test_nothing_is_wider_than_the_screen_and_axe_finds_nothing(
    browser: Any, written: Path, suite_page: tuple[xr.Dataset, Path], width: int
) -> None:
    axe_core = pytest.importorskip("axe_core_python")
    script = (Path(axe_core.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
    for path in (written, suite_page[1]):
        show(browser, path, width)
        wide = browser.execute_script(
            "return [document.documentElement.scrollWidth, window.innerWidth]"
        )
        assert wide[0] <= wide[1] == width
        beyond = browser.execute_script(
            "return [...document.querySelectorAll('body *:not(#spoken)')].filter((e) =>"
            " e.getBoundingClientRect().right > innerWidth || (e.clientWidth && e.scrollWidth > e.clientWidth + 1)"
            ").map((e) => e.outerHTML.slice(0, 80))"
        )
        assert beyond == []
        browser.execute_script(script)
        found = browser.execute_async_script("axe.run().then(arguments[arguments.length - 1])")
        # one rule and one name each: all of them, whatever their impact
        assert [(broken["id"], broken["impact"]) for broken in found["violations"]] == []
        assert len(found["passes"]) > 15


def test_everything_is_reached_by_keyboard_and_spoken(
    browser: Any, suite_page: tuple[xr.Dataset, Path]
) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    data, path = suite_page
    show(browser, path)
    order: list[str] = []
    while "zoom-whole" not in order and len(order) < 30:
        browser.switch_to.active_element.send_keys(Keys.TAB)
        order.append(browser.execute_script("return document.activeElement.id"))
    assert order == [
        "layer",
        "slider-theta",
        "slider-polarity",
        "slider-motion",
        "slider-amplitude",
        "slider-mu_s",
        "zoom-in",
        "zoom-out",
        "zoom-whole",
    ]
    for name, key in (
        ("polarity", Keys.HOME),
        ("motion", "soft-far"),
        ("amplitude", Keys.END),
        ("mu_s", Keys.HOME),
    ):
        browser.find_element(By.ID, f"slider-{name}").send_keys(key)
    cell = data.isel(theta=0).sel(polarity=-1, motion="soft-far_H1", amplitude=8, mu_s=0.1)
    wait_for(browser, "/ 8\\sm.s²/.test(document.getElementById('spoken').textContent)")
    number = re.search(
        r"permanent displacement, downslope: ([\d.]+) mm", text_of(browser, "spoken")
    )
    assert number
    assert float(number[1]) == pytest.approx(1000 * float(cell.permanent_displacement), rel=5.1e-4)
