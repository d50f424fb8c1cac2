"""Codes of a result into labelled truth values."""

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown
from slipsweep.model.variables import VALIDITY_TEXT

_TEXT = {(flag.name or "").lower(): text for flag, text in VALIDITY_TEXT.items()}


def flags(data: xr.Dataset | xr.DataArray) -> xr.Dataset:
    """Take a bit mask apart: one boolean variable a flag.

    Names and bits come from the attributes `flag_meanings` and `flag_masks` (CF conventions, 3.5),
    so that a file of any version is read by its own words.  Lazy data stay lazy.

    Parameters
    ----------
    data : Dataset or DataArray
        A result of `sweep`, `friction_parameters` or `simulate`, or a file of it opened with
        xarray, of which `validity` is taken; or a bit mask itself.

    Returns
    -------
    Dataset
        `statically_unstable`, `uplift`, …: True where the flag is set; dimensions and
        coordinates of the bit mask, what the flag means as `long_name`.

    Raises
    ------
    InputError
        There is no `validity`, it is no bit mask, or its values are not whole numbers.

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=[5, 25], mu_s=0.38, amplitude=3.0, frequency=1.0)
    >>> slipsweep.flags(result).statically_unstable.values.tolist()
    [False, True]
    """
    if isinstance(data, xr.Dataset):
        if "validity" not in data:
            raise InputError(
                f"validity: not in this dataset, which has {', '.join(map(str, data.data_vars)) or 'nothing'}"
            )
        data = data["validity"]
    if not isinstance(data, xr.DataArray):
        raise InputError(f"data = {shown(data)}: must be a Dataset or a DataArray")
    mask = data.variable
    names = str(mask.attrs.get("flag_meanings", "")).split()
    bits = np.atleast_1d(mask.attrs.get("flag_masks", ()))
    if not names or len(names) != len(bits):
        raise InputError(
            f"{data.name}: no bit mask, {len(bits)} flag_masks and {len(names)} flag_meanings in its attributes"
        )
    if mask.dtype.kind not in "iu":
        raise InputError(f"{data.name}: {mask.dtype} values; must be whole numbers (mask_and_scale=False keeps them)")
    limits = np.iinfo(mask.dtype)
    if bits.dtype.kind not in "iu" or bits.min() < limits.min or bits.max() > limits.max:
        raise InputError(f"{data.name}: flag_masks = {shown(bits.tolist())}: must be whole numbers of {mask.dtype}")
    for name in names:
        if name in data.coords or name in data.dims:
            raise InputError(f"{data.name}: has a coordinate {name!r}, as its flag is called: must have another name")
    return xr.Dataset(
        {
            name: _flag(mask, bit, _TEXT.get(name, name.replace("_", " ")))
            for name, bit in zip(names, bits, strict=True)
        },
        coords=data.coords,
    )


def _flag(mask: xr.Variable, bit: int, text: str) -> xr.Variable:
    # the bit in the type of the mask: a wider one would widen all cells with it
    values = (mask & mask.dtype.type(bit)) != 0
    values.attrs = {"long_name": text}
    return values
