"""Published equations on charts: curves are those of the functions; captions name conditions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import slipsweep
from slipsweep import InputError, published

G = 9.81

SUITE = Path(__file__).parents[2] / "sweeps" / "data" / "suite"

STRENGTHS = np.linspace(0.02, 0.34, 17)


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    """A suite over the strength of Newmark's block."""
    return slipsweep.sweep(
        yield_coefficient=STRENGTHS,
        amplitude=[2.0, 4.0],
        excitation=slipsweep.read_suite(str(SUITE / "*_H1.AT2")),
        model="newmark",
    )


@pytest.fixture(scope="module")
def wave() -> xr.Dataset:
    """Ten cycles of a sine."""
    return slipsweep.sweep(
        yield_coefficient=[0.05, 0.1, 0.2],
        amplitude=np.linspace(0.5, 8.0, 16),
        frequency=[1.0, 2.0],
        model="newmark",
    )


def line(figure: Figure, gid: str) -> Any:
    (found,) = [one for one in figure.axes[0].lines if one.get_gid() == gid]
    return found


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def caption(figure: Figure) -> str:
    return " ".join(figure.get_supxlabel().split())


def test_curves_over_the_strength(result: xr.Dataset) -> None:
    figure = result.slipsweep.chart(
        "motions", x="yield_coefficient", at={"amplitude": 4.0}, equations=["jibson-2007"]
    )
    estimate = published.jibson_2007(STRENGTHS, 4.0 / G)
    factor = np.exp(estimate.log_standard_deviation)
    inside = STRENGTHS >= 0.05
    for share, expected in (
        ("50%", estimate.median),
        ("16%", estimate.median / factor),
        ("84%", estimate.median * factor),
    ):
        drawn = line(figure, f"jibson-2007 {share}")
        np.testing.assert_allclose(drawn.get_xdata(), STRENGTHS)
        shown = np.where(inside, 1000.0 * expected, np.nan)
        np.testing.assert_allclose(drawn.get_ydata(), shown, rtol=1e-9)
        assert drawn.get_linestyle() == "--"
        beyond = line(figure, f"jibson-2007 {share} beyond")
        assert beyond.get_linestyle() == ":"
        there = np.isfinite(beyond.get_ydata())
        np.testing.assert_array_equal(np.flatnonzero(there), [0, 1, 2])
        np.testing.assert_allclose(beyond.get_ydata()[:3], 1000.0 * expected[:3], rtol=1e-9)
    assert {"Jibson 2007", "equation beyond its range"} <= {*legend(figure)}
    assert "equation, ± one standard deviation" in legend(figure)


def test_the_caption_says_what_equations_are_for(result: xr.Dataset) -> None:
    figure = result.slipsweep.chart(
        "motions",
        x="yield_coefficient",
        at={"amplitude": 4.0},
        equations="jibson-2007,bray-travasarou-2007",
        magnitude=7.0,
    )
    assert (
        "Published equations are for other conditions: Newmark's rigid block, other shaking. "
        "Jibson 2007: under 2270 records of 30 earthquakes, M 5.3 to 7.6; for ky 0.05 to 0.4. "
        "Bray and Travasarou 2007: under 688 records of earthquakes, Ts < 0.05 s; less than 1 cm "
        "counts as zero; for ky 0.02 to 0.4. M = 7."
    ) in caption(figure)


def test_zeros_of_an_equation_count_as_those_of_the_suite(result: xr.Dataset) -> None:
    """Bray and Travasarou give displacements that are not zero, and how likely zero is."""
    figure = result.slipsweep.chart(
        "motions",
        x="yield_coefficient",
        at={"amplitude": 2.0},
        equations="bray-travasarou-2007",
        magnitude=7.0,
    )
    estimate = published.bray_travasarou_2007(STRENGTHS, 2.0 / G, 7.0)
    median = 1000.0 * estimate.quantile(0.5)
    drawn = line(figure, "bray-travasarou-2007 50%").get_ydata()
    np.testing.assert_allclose(drawn, np.where(median > 0, median, np.nan), rtol=1e-9)
    assert (median[STRENGTHS > 0.12] == 0.0).all()


def test_curves_over_the_acceleration(wave: xr.Dataset) -> None:
    at = {"yield_coefficient": 0.1, "frequency": 2.0}
    figure = wave.slipsweep.chart("curve", x="amplitude", at=at, units="g", equations="yegian-1991")
    drawn = line(figure, "yegian-1991 50%")
    amplitude = wave.amplitude.values
    np.testing.assert_allclose(drawn.get_xdata(), amplitude / G)
    median = 1000.0 * published.yegian_1991(0.1, amplitude / G, 0.5, 10).median
    np.testing.assert_allclose(drawn.get_ydata(), np.where(median > 0, median, np.nan), rtol=1e-9)


def test_the_dimensionless_chart(wave: xr.Dataset) -> None:
    """uω²/A of N cycles: 4π²N times Yegian's normalised u, and π²N/2 (1/r − 1) of Sarma."""
    figure = wave.slipsweep.chart("dimensionless", equations="yegian-1991,sarma-1975,newmark-1965")
    drawn = line(figure, "yegian-1991 50%")
    ratio = 1.0 / drawn.get_xdata()
    normalised = 10.0 ** (0.22 - 10.12 * ratio + 16.38 * ratio**2 - 11.48 * ratio**3)
    np.testing.assert_allclose(drawn.get_ydata(), 40.0 * np.pi**2 * normalised, rtol=1e-9)
    upper = line(figure, "yegian-1991 84%")
    np.testing.assert_allclose(upper.get_ydata(), drawn.get_ydata() * 10.0**0.45, rtol=1e-9)
    sarma = line(figure, "sarma-1975 50%").get_ydata()
    np.testing.assert_allclose(sarma, 5.0 * np.pi**2 * (1.0 / ratio - 1.0), rtol=1e-9)
    # a sine gives its base the velocity 2A/ω
    newmark = line(figure, "newmark-1965 50%").get_ydata()
    np.testing.assert_allclose(newmark, 20.0 * (1.0 / ratio - 1.0), rtol=1e-9)
    gids = [one.get_gid() for one in figure.axes[0].lines]
    assert "sarma-1975 84%" not in gids


@pytest.mark.parametrize("measure", ["pga", "pgv", "arias_intensity"])
def test_curves_over_an_intensity_measure(result: xr.Dataset, measure: str) -> None:
    at = {"yield_coefficient": 0.1, "amplitude": 4.0}
    figure = result.slipsweep.chart(
        "intensity", x=measure, at=at, equations="jibson-2007,saygili-rathje-2008-pgv"
    )
    xs = line(figure, "jibson-2007 50%").get_xdata()
    ratio = float((result.motion_pgv / result.motion_pga).median())
    pga = xs / G if measure == "pga" else np.full_like(xs, 4.0 / G)
    pgv = xs if measure == "pgv" else ratio * pga * G
    jibson = published.jibson_2007(0.1, pga).median
    saygili = published.saygili_rathje_2008_pgv(0.1, pga, pgv).median
    for name, median in (("jibson-2007", jibson), ("saygili-rathje-2008-pgv", saygili)):
        drawn = line(figure, f"{name} 50%").get_ydata()
        np.testing.assert_allclose(drawn, 1000.0 * median, rtol=1e-9)


def test_medians_are_within_the_axes(wave: xr.Dataset) -> None:
    """A median above all displacements of the result is not cut off."""
    at = {"yield_coefficient": 0.05, "frequency": 1.0}
    figure = wave.slipsweep.chart("curve", x="amplitude", at=at, equations="sarma-1975")
    drawn = line(figure, "sarma-1975 50%").get_ydata()
    assert np.nanmax(drawn) < figure.axes[0].get_ylim()[1]


def test_without_colour_equations_differ_by_dash_and_marker(result: xr.Dataset) -> None:
    names = [
        "ambraseys-menu-1988",
        "jibson-2007",
        "saygili-rathje-2008",
        "rathje-saygili-2009",
        "bray-travasarou-2007",
    ]
    figure = result.slipsweep.chart(
        "motions",
        x="yield_coefficient",
        at={"amplitude": 4.0},
        equations=names,
        magnitude=7.0,
        grey=True,
    )
    medians = [line(figure, f"{name} 50%") for name in names]
    assert all(len({*to_rgb(one.get_color())}) == 1 for one in medians)
    handles = dict(zip(legend(figure), figure.legends[0].legend_handles, strict=True))
    looks = [handles[published.EQUATIONS[name].label] for name in names]
    assert len({one.get_marker() for one in looks}) == len(names)
    assert len({str(one._unscaled_dash_pattern) for one in looks}) == len(names)


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("histogram", {"equations": "jibson-2007"}, "--equations: not with --kind histogram"),
        ("motions", {"equations": "jibson"}, "no such published equation; did you mean"),
        ("motions", {"magnitude": 7.0}, "magnitude = 7.0: only with equations"),
        (
            "motions",
            {"equations": list(published.EQUATIONS)[:6], "magnitude": 7.0},
            "--equations: 6: a chart shows 5 at most",
        ),
        ("motions", {"equations": "rathje-saygili-2009"}, "needs moment magnitude M (magnitude)"),
    ],
)
def test_what_a_chart_of_a_suite_refuses(
    result: xr.Dataset, kind: str, options: dict[str, Any], message: str
) -> None:
    at = {} if kind == "histogram" else {"amplitude": 4.0}
    with pytest.raises(InputError) as error:
        result.slipsweep.chart(kind, at=at, **options)
    assert message in str(error.value)


def test_what_a_chart_of_a_wave_refuses(wave: xr.Dataset) -> None:
    with pytest.raises(InputError, match="draws those for equal cycles: yegian-1991, newmark-1965"):
        wave.slipsweep.chart("dimensionless", equations="jibson-2007")
    with pytest.raises(InputError, match="not with --kind families"):
        wave.slipsweep.chart("families", equations="jibson-2007")
    with pytest.raises(InputError, match=r"only with --kind curve, .* of permanent_displacement"):
        wave.slipsweep.chart(
            "curve",
            at={"yield_coefficient": 0.1, "frequency": 1.0},
            variable="peak_relative_velocity",
            equations="jibson-2007",
        )


def test_motions_of_different_accelerations_have_no_level_line() -> None:
    scaled = slipsweep.sweep(
        yield_coefficient=0.05,
        scale=2.0,
        excitation=slipsweep.read_suite(str(SUITE / "*_H1.AT2")),
        model="newmark",
    )
    with pytest.raises(InputError, match="choose --x pga, or scale them with the axis amplitude"):
        scaled.slipsweep.chart("intensity", x="pgv", equations="jibson-2007")
    figure = scaled.slipsweep.chart("intensity", x="pga", equations="jibson-2007")
    drawn = line(figure, "jibson-2007 50%")
    expected = published.jibson_2007(0.05, drawn.get_xdata() / G).median
    np.testing.assert_allclose(drawn.get_ydata(), 1000.0 * expected, rtol=1e-9)


def test_equations_are_drawn_in_all_charts_that_can(result: xr.Dataset) -> None:
    """Without a kind those are chosen that draw equations."""
    from slipsweep.charts.kinds import fitting
    from slipsweep.charts.slices import Result
    from slipsweep.charts.style import Options

    fits = fitting(Result(result, "suite"), Options(equations=("jibson-2007",)))
    assert fits == ["motions", "intensity"]
