"""Actions of a user in a page of `slipsweep explore`, in Chromium."""

import json
from pathlib import Path
from typing import Any

import numpy as np


def wait_for(driver: Any, script: str) -> Any:
    """Wait until a script returns something true."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(driver, 60, 0.05).until(lambda d: d.execute_script(f"return {script}"))


#: A function for scripts: a model of Bokeh by its name.
MODEL = (
    "const model = (name) =>"
    " Bokeh.documents.map((figure) => figure.get_model_by_name(name)).find(Boolean);"
)


def move(driver: Any, theta: int, mu_s: int) -> None:
    """Move both sliders to a position."""
    script = (
        "const slider = document.getElementById(arguments[0]);"
        "slider.value = arguments[1]; slider.dispatchEvent(new Event('input'))"
    )
    driver.execute_script(script, "slider-theta", theta)
    driver.execute_script(script, "slider-mu_s", mu_s)


def point(driver: Any, x: float, y: float, click: bool = False) -> None:
    """Put the pointer on the map, at shares of its width and height from the upper left."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    host = driver.find_element(By.ID, "map")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", host)
    frame = driver.execute_script(
        MODEL + "const b = Bokeh.index.find_one(model('map')).frame.bbox;"
        "return [b.left, b.top, b.width, b.height]"
    )
    left = frame[0] + x * frame[2] - host.size["width"] / 2
    top = frame[1] + y * frame[3] - host.size["height"] / 2
    actions = ActionChains(driver, duration=0).move_to_element_with_offset(
        host, round(left), round(top)
    )
    (actions.click() if click else actions).perform()


def text_of(driver: Any, element: str) -> str:
    """Text of an element, with plain spaces."""
    script = "return document.getElementById(arguments[0]).textContent"
    text = driver.execute_script(script, element)
    return str(text).replace("\u00a0", " ")


def chosen(driver: Any, element: str = "readout") -> Any:
    """Index of the cell that an element shows."""
    script = "return document.getElementById(arguments[0]).dataset.index"
    return json.loads(driver.execute_script(script, element))


def image_of_map(driver: Any) -> np.ndarray:
    """Numbers that give the pixels of the map their colours, row by row from below."""
    script = "const image = model('colours').data.image[0]; return [image.shape, [...image]]"
    shape, values = driver.execute_script(MODEL + script)
    return np.reshape(np.array(values, float), shape)


def choose_layer(driver: Any, place: int) -> None:
    """Choose the result that colours the map."""
    driver.execute_script(
        "const list = document.getElementById('layer'); list.selectedIndex = arguments[0];"
        "list.dispatchEvent(new Event('change'))",
        place,
    )


def show(driver: Any, path: Path, width: int = 1340) -> None:
    """Open a page in a window of some width, px; narrow ones are phones."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    driver.get(path.as_uri())
    wait_for(driver, "document.body.dataset.ready")
    wait_for(driver, "Bokeh.documents.every((figure) => figure.is_idle)")
