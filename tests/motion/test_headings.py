"""Headings of records: units, quantities that are no acceleration, vertical components."""

from pathlib import Path

import numpy as np
import pytest

from slipsweep import InputError, read_record
from slipsweep.motion.headings import vertical_mark

TIMES = 0.01 * np.arange(200)
SHAKING = 0.3 * np.sin(9.0 * TIMES) * np.hanning(200)
SERIES = "".join(f"{value:.6f}\n" for value in SHAKING)
PAIRS = "".join(f"{time:.2f}\t{value:.6f}\n" for time, value in zip(TIMES, SHAKING, strict=True))


def written(folder: Path, heading: str) -> list[Path]:
    """Files that say the same over a column, over a single one, and in a comment."""
    texts = (
        f"time (s)\t{heading}\n{PAIRS}",
        f"{heading}\n{SERIES}",
        f"# A station\n# {heading}\n# dt = 0.01\n{SERIES}",
    )
    paths = [folder / f"{at}.txt" for at in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("velocity (cm/s)", "velocity in cm/s"),
        ("Velocity", "Velocity"),
        ("Vel. [m/s]", "Vel in m/s"),
        ("displacement (cm)", "displacement"),
        ("desplazamiento", "desplazamiento"),
        ("spectral acceleration (g)", "spectral acceleration in g"),
        ("acceleration (ft/s2)", "ft/s2"),
        ("Acc. in ft/s^2", "ft/s^2"),
        ("acc (in/sec/sec)", "in/sec/sec"),
        ("acc [mm/s²]", "mm/s²"),
        ("acc (mg)", "mg"),
        ("Acceleration, mg", "mg"),
        ("acc (%g)", "%g"),
        ("acc (g/10)", "g/10"),
        ("acc (0.001 g)", "0.001 g"),
        ("acceleration (counts)", "counts"),
    ],
)
def test_no_unit_that_is_given_overrides_a_heading(tmp_path: Path, heading: str, said: str) -> None:
    for path in written(tmp_path, heading):
        for units in ("g", "cm/s2"):
            with pytest.raises(InputError, match="its heading says") as refused:
                read_record(path, units=units, interval=None if path.stem == "0" else 0.01)
            assert f"says '{said}" in str(refused.value)
            assert str(refused.value).endswith(
                "must be an acceleration in one of m/s2, g, cm/s2, gal"
            )


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        ("acc (g)", "g"),
        ("Acceleration in g's", "g"),
        ("acc_cm/s2", "cm/s2"),
        ("acc [cm/sec/sec]", "cm/s2"),
        ("a (m s-2)", "m/s2"),
        ("acc m/s**2", "m/s2"),
        ("Beschleunigung (m/s²)", "m/s2"),
        ("aceleracion (cm/seg2)", "cm/s2"),
        ("Acc (Gal)", "gal"),
    ],
)
def test_units_as_headings_spell_them(tmp_path: Path, heading: str, unit: str) -> None:
    for path in written(tmp_path, heading):
        step = None if path.stem == "0" else 0.01
        record = read_record(path, interval=step, implausible="accept")
        assert record.attrs["record_units"] == unit
        with pytest.raises(InputError, match=f"the file itself says '{unit}'"):
            read_record(path, units="g" if unit != "g" else "gal", interval=step)


def test_headings_of_old_files_are_read(tmp_path: Path) -> None:
    """m/s² is no UTF-8 there."""
    path = written(tmp_path, "acceleration (m/s²)")[0]
    path.write_bytes(path.read_text(encoding="utf-8").encode("latin-1"))
    assert read_record(path).attrs["record_units"] == "m/s2"


@pytest.mark.parametrize(
    "heading",
    [
        "acceleration (g)\n# peak velocity (cm/s): 12\n# station height (m): 5",
        "spectrally matched acceleration (g)",
        "Units: g\n# Peak ground velocity = 12 cm/s",
        "acceleration (g)\n# Vs30 760 m/s, shear wave velocity measured",
        "acceleration (g)\n# recorded in the United States, units in metric",
    ],
)
def test_other_units_in_a_heading_are_not_those_of_the_acceleration(
    tmp_path: Path, heading: str
) -> None:
    path = written(tmp_path, heading)[2]
    assert read_record(path).attrs["record_units"] == "g"


@pytest.mark.parametrize(
    ("name", "component", "mark"),
    [
        ("RSN825_CAPEMEND_CPM-UP.AT2", "", "UP"),
        ("RSN1517_CHICHI_TCU084-V.AT2", "", "V"),
        ("C02DWN.AT2", "", "DWN"),
        ("RSN5618_IWATE_IWT010UD.AT2", "", "UD"),
        ("AOM0011801241951.UD", "", "UD"),
        ("AICH040010061330.UD2", "", "UD2"),
        ("HI.ARS1..HNZ.D.20190728.160908.C.ACC.ASC", "", "HNZ"),
        ("n.1000hyfh.BGZ.--.acc.V2c", "", "BGZ"),
        ("motion_z.csv", "", "Z"),
        ("a.VERT.txt", "", "VERT"),
        ("station_hnz.txt", "", "HNZ"),
        ("station_U-D.txt", "", "UD"),
        ("a.AT2", "UP", "UP"),
        ("a.AT2", "Vertical", "VERTICAL"),
        ("a.NS", "U-D", "UD"),
        ("a.dat", "U(+)", "U"),
        ("a.ASC", "HGZ", "HGZ"),
        ("a.csv", "acc_z (g)", "Z"),
        ("a.191", "V;+", "V"),
    ],
)
def test_vertical_components_are_known(name: str, component: str, mark: str) -> None:
    assert vertical_mark(component, Path("folder") / name) == mark


@pytest.mark.parametrize(
    ("name", "component"),
    [
        ("RSN763_LOMAP_GIL067.AT2", "67"),
        ("RSN8_CALIF.MUSEUM_B-FRN044.AT2", "S44W"),
        ("AOM0011801241951.EW", "E-W"),
        ("np01002p_4225a_u.smc", ""),
        ("CE89146.V2", "360 Deg"),
        ("group.csv", "component 1: nobody recorded it"),
        ("vertical/records/rock_H1.csv", "N90E"),
        ("SETUP.csv", "acceleration (m/s2)"),
    ],
)
def test_horizontal_components_are_not_taken_for_vertical(name: str, component: str) -> None:
    assert vertical_mark(component, Path(name)) is None
