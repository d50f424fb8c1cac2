"""`flags`: the bit mask `validity` of a result as labelled truth values."""

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown
from slipsweep.model.variables import FlagKind, Validity

#: Our flags by their names in files.
_FLAGS = {(flag.name or "").lower(): flag for flag in Validity}


def flags(data: xr.Dataset | xr.DataArray) -> xr.Dataset:
    """Decode a bit mask: one boolean variable per flag.

    Names and bits come from the attributes `flag_meanings` and `flag_masks` (CF conventions,
    https://cfconventions.org, 3.5), so that files of any version can be read.  Lazy data stay lazy.

    Parameters
    ----------
    data : Dataset or DataArray
        A result of `sweep`, `friction_parameters` or `simulate`, or a file of it opened with
        xarray, of which `validity` is taken; or a bit mask itself.

    Returns
    -------
    Dataset
        `statically_unstable`, `uplift`, …: True where the flag is set; dimensions and coordinates
        of the bit mask. First the flags under which there is no value, then cautions, then notes:
        the attribute `kind` says which, `long_name` what the flag means.

    Raises
    ------
    InputError
        There is no `validity`, it is no bit mask, or its values are not whole numbers.

    See Also
    --------
    Validity : the flags by name

    Examples
    --------
    >>> import slipsweep
    >>> result = slipsweep.sweep(theta=[5, 25], mu_s=0.38, amplitude=3.0, frequency=1.0)
    >>> slipsweep.flags(result).statically_unstable.values.tolist()
    [False, True]
    """
    if isinstance(data, xr.Dataset):
        if "validity" not in data:
            there = ", ".join(map(str, data.data_vars)) or "nothing"
            raise InputError(f"validity: not in this dataset, which has {there}")
        data = data["validity"]
    if not isinstance(data, xr.DataArray):
        raise InputError(f"data = {shown(data)}: must be a Dataset or a DataArray")
    mask = data.variable
    names = str(mask.attrs.get("flag_meanings", "")).split()
    bits = np.atleast_1d(mask.attrs.get("flag_masks", ()))
    if not names or len(names) != len(bits):
        raise InputError(
            f"{data.name}: no bit mask, {len(bits)} flag_masks and {len(names)} flag_meanings in "
            "its attributes"
        )
    if mask.dtype.kind not in "iu":
        raise InputError(
            f"{data.name}: {mask.dtype} values; must be whole numbers, of which none is missing "
            "(mask_and_scale=False keeps them)"
        )
    # flags of other programs have no kind, and go last
    order = {
        name: list(FlagKind).index(_FLAGS[name].kind) if name in _FLAGS else len(FlagKind)
        for name in names
    }
    results = {}
    for name, bit in sorted(zip(names, bits, strict=True), key=lambda pair: order[pair[0]]):
        # the bit in the type of the mask: a wider one would widen all cells with it
        results[name] = (mask & mask.dtype.type(bit)) != 0
        results[name].attrs = {"long_name": name.replace("_", " ")}
        if name in _FLAGS:
            flag = _FLAGS[name]
            results[name].attrs = {"long_name": flag.text, "kind": str(flag.kind)}
    return xr.Dataset(results, coords=data.coords)
