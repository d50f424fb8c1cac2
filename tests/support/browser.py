"""Chromium, and what a user does in a page of `slipsweep explore`."""

import json
from pathlib import Path
from typing import Any


def wait_for(driver: Any, script: str) -> Any:
    """Wait until a script returns something true."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(driver, 60, 0.05).until(lambda d: d.execute_script(f"return {script}"))


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


def show(driver: Any, path: Path, width: int = 1340) -> None:
    """Open a page in a window of some width; narrow ones are phones."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    driver.get(path.as_uri())
    wait_for(driver, "document.body.dataset.ready")
    wait_for(driver, "Bokeh.documents.every((one) => one.is_idle)")
