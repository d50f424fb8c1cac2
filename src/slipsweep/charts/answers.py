"""What is solved anew on the cells of a slice, through the public plans.

The accelerations of yield and of the mode limit, results on the limit itself, Newmark's block, and the answers
that other choices of recoupling and friction decay give.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import plan_friction_parameters, plan_sweep
from slipsweep.model.options import MODELS, SOLVERS, Mendez, Model, Newmark
from slipsweep.model.variables import PARAMETERS, WAVEFORM_INPUTS
from slipsweep.motion.amplitude import peak_acceleration
from slipsweep.motion.waveforms import WAVEFORMS

#: Friction decay that the paper measured on its shaking table: 2.30 and 2.70 (Table 2).
MEASURED_DECAY = (2.0, 3.0)

#: The dimension of the two sides of the mode limit.
SIDE = "side"

_BLOCK = ("theta", "mu_s", "yield_acceleration")
_FRICTION = ("decay_rate", "delta_mu", "minimum_friction")


def amplitude_of(displacement_amplitude: xr.Variable, frequency: xr.Variable) -> xr.Variable:
    """The amplitude A = ω²d on a slice: files do not hold it where d and the frequency span a grid."""
    dims = (*displacement_amplitude.dims, *(dim for dim in frequency.dims if dim not in displacement_amplitude.dims))
    both = (
        variable.values.reshape([variable.sizes.get(dim, 1) for dim in dims])
        for variable in (displacement_amplitude, frequency)
    )
    return xr.Variable(dims, np.asarray(peak_acceleration(*both), np.float64), PARAMETERS["amplitude"])


def solve(
    table: xr.Dataset, names: Iterable[str], model: Model | None = None, **changed: Any
) -> Mapping[str, xr.Variable]:
    """Solve the cells of a slice as the slice's result was solved.

    Parameters
    ----------
    table : xr.Dataset
        Gives the parameters and, in its attributes, model, excitation and solver.
    names : iterable of str
        Results.
    model : Model, optional
        Another model.
    changed : xr.Variable, float or None
        Parameters that differ; None stands for the model's own estimate.

    Returns
    -------
    mapping of str to xr.Variable
    """
    chosen = model or MODELS.from_attributes(table.attrs)
    wanted = [*_BLOCK, *(_FRICTION if isinstance(chosen, Mendez) else ()), *WAVEFORM_INPUTS]
    given = {name: table[name] for name in wanted if name in table.coords} | changed
    if given.get("displacement_amplitude") is not None:
        given["amplitude"] = None
    plan = plan_sweep(
        Inputs(**given),
        model=chosen,
        excitation=WAVEFORMS.from_attributes(table.attrs),
        solver=SOLVERS.from_attributes(table.attrs) if SOLVERS.attribute in table.attrs else SOLVERS.default,
        variables=list(names),
    )
    return plan.solve().data_vars


def boundaries(table: xr.Dataset, always: bool = False) -> dict[str, xr.Variable]:
    """Yield acceleration and, but for Newmark's block, limiting acceleration (Eq. 7) of a slice, m/s².

    Parameters
    ----------
    table : xr.Dataset
    always : bool
        Return both for Newmark's block, too.

    Returns
    -------
    dict of str to xr.Variable
        ``yield_acceleration`` and ``limiting_acceleration`` along those dimensions of the slice that
        they depend on; NaN where the block slides under its own weight.
    """
    given = {name: table[name] for name in _BLOCK if name in table.coords}
    # neither depends on the amplitude, nor on what it is taken for otherwise
    found = plan_friction_parameters(
        Inputs(amplitude=0.0, delta_mu=0.0, decay_rate=0.0, **given), model=Mendez(g=float(table.attrs["g"]))
    ).solve()
    slides_at_rest = found["yield_acceleration"].values <= 0
    limit = found["limiting_acceleration"]
    unstable = found["validity"].values != 0
    lines = {
        "yield_acceleration": found["yield_acceleration"].variable.where(~slides_at_rest),
        "limiting_acceleration": limit.variable.where(~unstable),
    }
    if table.attrs["model"] == "newmark" and not always:
        del lines["limiting_acceleration"]
    return lines


def newmark(table: xr.Dataset, **changed: Any) -> xr.Variable:
    """Permanent displacement of Newmark's block on the cells of a slice."""
    return solve(table, ["permanent_displacement"], Newmark(g=float(table.attrs["g"])), **changed)[
        "permanent_displacement"
    ]


def sides_of(limit: xr.Variable) -> dict[str, Any]:
    """The amplitude on the mode limit, where the block still sticks and slips, and the next number above it.

    What to give to `solve` or `newmark` for the results on either side, along a dimension ``side``.
    """
    there = np.where(np.isfinite(limit.values), limit.values, 1.0)
    both = np.stack([there, np.nextafter(there, np.inf)], axis=-1)
    return {"amplitude": xr.Variable((*limit.dims, SIDE), both), "displacement_amplitude": None}


def alternatives(table: xr.Dataset) -> dict[str, tuple[Model, dict[str, Any]]]:
    """The answers that an engineer has to choose from on a slice: what to change for `solve`, by what it is called.

    Newmark's block; the friction decay λ by Eq. 6, or as the paper measured it; the end of sliding by
    Eq. 12, or by integration.  All with the slice's own yield acceleration.
    """
    g = float(table.attrs["g"])
    own = MODELS.from_attributes(table.attrs)
    ours = own if isinstance(own, Mendez) else Mendez(g=g)
    found: dict[str, tuple[Model, dict[str, Any]]] = {"Newmark": (Newmark(g=g), {})}
    for recoupling, text in (("eq12", "stop by Eq. 12"), ("integrate", "stop by integration")):
        model = ours.but(recoupling=recoupling)
        found[f"λ by Eq. 6, {text}"] = (model, {"decay_rate": None})
        for rate in MEASURED_DECAY:
            found[f"λ = {rate:g}, {text}"] = (model, {"decay_rate": rate, "minimum_friction": None})
    return found
