"""The report of a result of Newmark's block says nothing of the paper, which it
does not compute.
"""

from typing import Any

import pytest
import xarray as xr

import slipsweep
from slipsweep.charts import kinds
from slipsweep.charts.slices import Result

PAPER = ("Mendez", "one interface", "shaking-table", "not_recoupled", "near_mode_limit", "uplift")


@pytest.fixture(scope="module")
def results() -> dict[str, xr.Dataset]:
    axes: dict[str, Any] = {"theta": [0, 10], "mu_s": 0.4, "amplitude": [2.0, 4.0, 8.0]}
    axes["frequency"] = [1.0, 2.0]
    return {model: slipsweep.sweep(**axes, model=model) for model in ("mendez", "newmark")}


def title_page(result: xr.Dataset) -> str:
    figure = kinds.title_page(Result(result, "a.nc"))
    return " ".join(" ".join(text.get_text() for text in figure.texts).split())


def test_the_title_page_has_the_flags_and_the_source_of_its_model(
    results: dict[str, xr.Dataset],
) -> None:
    page = title_page(results["newmark"])
    assert [word for word in PAPER if word in page] == []
    assert "N. M. Newmark (1965), Effects of earthquakes on dams and embankments" in page
    assert "statically_unstable" in page
    assert "flexible_block" in page
    page = title_page(results["mendez"])
    assert [word for word in PAPER if word not in page] == []
    assert "Newmark (1965)" not in page


@pytest.mark.usefixtures("without_layout")
def test_newmarks_block_is_once_in_a_spread(results: dict[str, xr.Dataset]) -> None:
    for model, result in results.items():
        figure = result.slipsweep.chart("spread", at={"theta": 10, "frequency": 1})
        (legend,) = figure.legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert len([text for text in texts if "Newmark's block" in text]) == 1, texts
        curves = [text for text in texts if text.startswith(("λ", "this", "Newmark"))]
        assert len(curves) == (7 if model == "newmark" else 8), texts
