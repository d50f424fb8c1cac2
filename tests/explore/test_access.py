"""The page for everybody: on a phone, by keyboard, spoken."""

import re
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from tests.support.browser import show, text_of, wait_for


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
