"""The page on a phone, by keyboard, and spoken."""

import re
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from tests.support.browser import show, text_of, wait_for


@pytest.fixture(params=["harmonic", "suite"])
def page(
    request: pytest.FixtureRequest, written: Path, suite_page: tuple[xr.Dataset, Path]
) -> Path:
    return written if request.param == "harmonic" else suite_page[1]


@pytest.mark.parametrize("width", [360, 1340])
def test_nothing_is_wider_than_the_screen(browser: Any, page: Path, width: int) -> None:
    show(browser, page, width)
    document, window = browser.execute_script(
        "return [document.documentElement.scrollWidth, window.innerWidth]"
    )
    assert document <= window == width
    too_wide = browser.execute_script(
        "return [...document.querySelectorAll('body *:not(#spoken)')].filter((e) =>"
        " e.getBoundingClientRect().right > innerWidth"
        " || (e.clientWidth && e.scrollWidth > e.clientWidth + 1)"
        ").map((e) => e.outerHTML.slice(0, 80))"
    )
    assert too_wide == []


@pytest.mark.parametrize("width", [360, 1340])
def test_axe_finds_no_barrier(browser: Any, page: Path, width: int) -> None:
    axe_core = pytest.importorskip("axe_core_python")
    show(browser, page, width)
    script = Path(axe_core.__file__).parent / "axe.min.js"
    browser.execute_script(script.read_text(encoding="utf-8"))
    rules = browser.execute_async_script("axe.run().then(arguments[arguments.length - 1])")
    # whatever their impact
    assert [(rule["id"], rule["impact"]) for rule in rules["violations"]] == []
    assert len(rules["passes"]) > 15


def test_everything_is_reached_by_keyboard(
    browser: Any, suite_page: tuple[xr.Dataset, Path]
) -> None:
    from selenium.webdriver.common.keys import Keys

    show(browser, suite_page[1])
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


def test_the_cell_chosen_by_keyboard_is_spoken(
    browser: Any, suite_page: tuple[xr.Dataset, Path]
) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    data, path = suite_page
    show(browser, path)
    for name, key in (
        ("polarity", Keys.HOME),
        ("motion", "soft-far"),
        ("amplitude", Keys.END),
        ("mu_s", Keys.HOME),
    ):
        browser.find_element(By.ID, f"slider-{name}").send_keys(key)
    theta = data.theta.values[_position(browser, "theta")]
    cell = data.sel(theta=theta, polarity=-1, motion="soft-far_H1", amplitude=8, mu_s=0.1)
    wait_for(browser, "/ 8\\sm.s²/.test(document.getElementById('spoken').textContent)")
    spoken = text_of(browser, "spoken")
    displacement = re.search(r"permanent displacement, downslope: ([\d.]+) mm", spoken)
    assert displacement
    expected = 1000 * float(cell.permanent_displacement)
    assert float(displacement[1]) == pytest.approx(expected, rel=5.1e-4)


def _position(browser: Any, dim: str) -> int:
    """Position of a slider."""
    return int(browser.execute_script(f"return document.getElementById('slider-{dim}').value"))
