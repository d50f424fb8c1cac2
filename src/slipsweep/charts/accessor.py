"""`Dataset.slipsweep`: charts and flags of a result.

Importing this module registers the accessor with xarray.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import xarray as xr

from slipsweep.studies.flags import flags

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from slipsweep.files.selection import At


@xr.register_dataset_accessor("slipsweep")
class SlipsweepAccessor:
    """Charts and flags of a result of slipsweep, or of a file of one opened with xarray.

    See Also
    --------
    slipsweep.flags : the function behind the method
    slipsweep.open_result : a result from a file

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=5, mu_s=0.4, amplitude=[3.0, 4.0, 5.0], frequency=[1.0, 2.0])
    >>> result.slipsweep.chart("families").savefig("families.png")
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def flags(self) -> xr.Dataset:
        """`slipsweep.flags` of the dataset."""
        return flags(self._dataset)

    def chart(
        self,
        kind: str | None = None,
        *,
        at: "Mapping[str, At] | None" = None,
        x: str | None = None,
        y: str | None = None,
        panels: Sequence[str] = (),
        variable: str = "permanent_displacement",
        levels: Sequence[float | str] = (),
        units: Literal["m/s2", "g"] = "m/s2",
        show_cautions: bool = False,
        width: float | str | None = None,
        grey: bool = False,
        title: str | None = None,
        caption: Literal["full", "short"] | None = None,
        ax: "Axes | None" = None,
        equations: Sequence[str] | str = (),
        magnitude: float | None = None,
    ) -> "Figure | Axes":
        """Draw a chart, as `slipsweep chart` does.

        Parameters
        ----------
        kind : str, optional
            Of a sweep "contours", "modes", "families", "curve", "dimensionless", "newmark" or
            "spread"; of a sweep under a suite "motions", "fragility", "intensity" or "histogram",
            under one record "motions"; of statistics (`sample`, `suite_statistics`) "fragility",
            "quantiles" or "sensitivity".  Results of `simulate` ("history"), `limit_amplitude`
            ("limit"), `required_strength` ("strength"), `displacement_hazard` ("hazard"),
            `calibrate` ("calibration") and `measured_friction` ("friction") have one chart each.
            By default the first one that a dataset has; of a sweep with one axis left "curve".
        at : mapping of axis to value, optional
            Value of an axis: a number in its own unit, a text with another ("0.3g"), the label of a
            case or motion; by default its middle.  "ky" is `yield_coefficient`, and "mu_s" beside
            an axis `phi` the angle to it. Several values choose the curves or panels of an axis, or
            the motions of a suite.
        x, y : str, optional
            Axis to draw over, or an intensity measure; vertical axis of a map, or the curve
            parameter.
        panels : sequence of str
            One or two axes to draw panels over, across and down.
        variable : str
            Result that contours and families show.
        levels : sequence of float or str
            Contours, in the variable's own unit or as texts with another ("5cm"); of a suite's
            fragility the displacements to exceed.
        units : {"m/s2", "g"}
            Unit of accelerations on the main axis and in the caption.
        show_cautions : bool
            Draw values flagged `not_recoupled`, too; by default they are left out, because they are
            unreliable.
        width : float or str, optional
            Width of the figure: mm, or a text with another unit ("3.5 inch").  Below 127 mm text is
            smaller.
        grey : bool
            Draw without colour.
        title : str, optional
            A title of your own.
        caption : {"full", "short"}, optional
            In full, or without the options of the model, the equations of the estimates, the ratio
            to Newmark's block and the version; by default short where the width is below 127 mm.
        ax : matplotlib.axes.Axes, optional
            Axes to draw a chart of one panel in, with its legend and caption.
        equations : sequence of str or str
            Published equations to draw beside, of `slipsweep.published.EQUATIONS`; with "curve",
            "motions", "intensity", "dimensionless" and "strength".
        magnitude : float, optional
            Moment magnitude M, for the equations that need it.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            The figure: write it with `savefig`; a notebook shows it.  With `ax`, these axes.

        Raises
        ------
        InputError
            The chart cannot be drawn of this dataset, or a value or variable is not in it.

        Examples
        --------
        >>> import slipsweep
        >>> result = slipsweep.sweep(5, [0.3, 0.4], amplitude=[2.0, 4.0, 6.0], frequency=[1, 2])
        >>> figure = result.slipsweep.chart("families", at={"frequency": 1})
        >>> figure.axes[0].get_ylabel()
        'permanent displacement, downslope (mm)'
        """
        from slipsweep.charts.kinds import figure_of

        figure = figure_of(
            self._dataset,
            kind,
            at=at,
            x=x,
            y=y,
            panels=panels,
            variable=variable,
            levels=levels,
            units=units,
            show_cautions=show_cautions,
            width=width,
            grey=grey,
            title=title,
            caption=caption,
            ax=ax,
            equations=equations,
            magnitude=magnitude,
        )
        return figure if ax is None else ax
