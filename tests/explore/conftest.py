"""Pages of `slipsweep explore`, and a browser that shows them."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from slipsweep import read_suite, sweep
from slipsweep.explore.page import write_page
from tests.support.browser import show
from tests.support.pages import SUITE, SWEEP, make

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")

FLAGS = (
    "headless=new",
    "no-sandbox",
    "disable-gpu",
    "no-first-run",
    "disable-background-networking",
    "disable-component-update",
    "disable-sync",
    "window-size=1340,1000",
)


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("explore"), SWEEP)


@pytest.fixture(scope="session")
def written(result: Path) -> Path:
    output = result.with_suffix(".html")
    write_page(result, output)
    return output


@pytest.fixture(scope="session")
def suite_page(tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, Path]:
    """A sweep under four motions with both polarities, and its page."""
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


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver")
    if not CHROMIUM or not DRIVER:
        pytest.skip("chromium and chromedriver are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in FLAGS:
        options.add_argument(f"--{flag}")
    options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('chromium')}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser: Any, written: Path) -> Any:
    for log in ("browser", "performance"):
        browser.get_log(log)
    show(browser, written)
    return browser
