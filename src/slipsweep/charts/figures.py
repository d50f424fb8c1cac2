"""The figure of a time history: a table in, a matplotlib figure out (`charts` has those of sweeps).

Figures are made without pyplot, hence without a window system or state between calls;
`matplotlib.figure.Figure.savefig` writes them in any format.
"""

import numpy as np
from matplotlib.figure import Figure

from slipsweep.charts.style import BLUE, VERMILION, caption
from slipsweep.grid.tables import Table
from slipsweep.model.variables import HISTORY


def history(table: Table) -> Figure:
    """Draw a time history in the manner of the paper's Figs. 5, 8 and 9.

    Parameters
    ----------
    table : Table
        What `slipsweep.studies.history.history_table` returns.

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: accelerations of plane and block, friction coefficient,
        relative velocity, relative displacement; the parameters in a caption.
    """
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    values = {name: table[name].values for name in ("time", *HISTORY) if name in table}
    panels = list(figure.subplots(len(values) - 2, sharex=True))  # both accelerations share one
    accelerations, *_, velocity, displacement = panels
    time = values["time"]

    accelerations.plot(time, values["ground_acceleration"], color=BLUE, label="plane")
    accelerations.plot(time, values["block_acceleration"], color=VERMILION, linestyle="--", label="block")
    accelerations.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    accelerations.set_ylabel("acceleration\n(m/s²)")

    if "friction_coefficient" in values:
        panels[1].plot(time, values["friction_coefficient"], color=VERMILION)
        panels[1].set_ylabel("friction\ncoefficient")

    velocity.plot(time, values["relative_velocity"], color=VERMILION)
    velocity.set_ylabel("relative\nvelocity (m/s)")

    metres = float(np.abs(values["relative_displacement"]).max()) >= 1.0
    displacement.plot(time, values["relative_displacement"] * (1 if metres else 1000), color=VERMILION)
    displacement.set_ylabel(f"relative\ndisplacement ({'m' if metres else 'mm'})")
    displacement.set_xlabel("time (s)")

    for axes in panels:
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        axes.margins(x=0)
        axes.grid(color="0.9")
    figure.align_ylabels()
    figure.supxlabel(caption(table), fontsize="small")
    return figure
