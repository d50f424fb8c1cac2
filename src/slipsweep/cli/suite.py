"""What commands make of a suite: statistics that `run` and `info` print, the fragility that others write."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slipsweep.cli.common import displacements, echo

if TYPE_CHECKING:
    import xarray as xr


def echo_suite(table: "xr.Dataset", most: int, typed: Sequence[str] = ()) -> None:
    """Print median, 16 and 84 %, share of zeros and P(u > d) at each grid point of a result under a suite.

    Parameters
    ----------
    table : Dataset
    most : int
        Most grid points that are printed.
    typed : sequence of str
        Displacements d as typed.
    """
    stored = {"permanent_displacement", "validity"} <= {*table.data_vars} and "limit_amplitude" not in table
    if not stored or table["permanent_displacement"].sizes.get("motion", 1) < 2:
        return
    from slipsweep.studies.suite_statistics import summary_lines

    lengths = displacements(typed, float(table.attrs["g"])) if typed else None
    for line in summary_lines(table, lengths, most):
        echo(line)


def write_fragility(table: "xr.Dataset", path: Path, overwrite: bool, lengths: Sequence[float] | None = None) -> None:
    """Write P(u > d) along the axis amplitude as an .xml file of OpenQuake, for displacements in m."""
    from slipsweep.files import outputs
    from slipsweep.studies.fragility import fragility, openquake_fragility

    text = openquake_fragility(fragility(table, lengths))
    with outputs.complete_or_absent(path, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
