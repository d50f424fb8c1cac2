"""Displacements of a block that slides both ways, drawn without their signs."""

import xarray as xr

from slipsweep.model.variables import SIGNED, has_signed_displacements
from slipsweep.studies.solved_again import DISPLACEMENT

#: Attribute of a slice whose displacements have lost their signs: the share that ends upslope.
UPSLOPE_SHARE = "share_upslope"


def by_magnitude(data: xr.Dataset) -> xr.Dataset:
    """Return a slice with |u| in place of u, and the share that ends upslope, if u has signs."""
    if not has_signed_displacements(data.attrs):
        return data
    share = {}
    if DISPLACEMENT in data:
        moved = data[DISPLACEMENT]
        sliding = max(int((moved.fillna(0.0) != 0.0).sum()), 1)
        share = {UPSLOPE_SHARE: int((moved < 0.0).sum()) / sliding}
    magnitudes = {
        name: abs(data[name]).assign_attrs(data[name].attrs) for name in SIGNED if name in data
    }
    return data.assign(magnitudes).assign_attrs(share)
