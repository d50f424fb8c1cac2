"""The parameters of a block and its shaking as a caller gives them, by name."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from slipsweep.model.parameters import with_friction_coefficient


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What `slipsweep.sweep` takes beside its options; None is not given.

    Each is a number, a 1-D array, or an `xarray.Variable` or `DataArray` with dimensions of its own, in the units of
    `slipsweep.model.variables.PARAMETERS`.  The functions that take one check them.

    Examples
    --------
    >>> Inputs(theta=5.0, mu_s=0.4).given
    {'theta': 5.0, 'mu_s': 0.4}
    """

    theta: Any = None
    mu_s: Any = None
    phi: Any = None
    amplitude: Any = None
    frequency: Any = None
    displacement_amplitude: Any = None
    scale: Any = None
    pgv: Any = None
    arias_intensity: Any = None
    time_scale: Any = None
    polarity: Any = None
    azimuth: Any = None
    yield_acceleration: Any = None
    yield_coefficient: Any = None
    decay_rate: Any = None
    delta_mu: Any = None
    minimum_friction: Any = None
    structure_frequency: Any = None

    @property
    def given(self) -> dict[str, Any]:
        """The parameters that are given; of `phi` the friction coefficient, an array that has it as a coordinate."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return with_friction_coefficient({name: value for name, value in values.items() if value is not None})

    def but(self, others: Mapping[str, Any]) -> "Inputs":
        """The same with other values of some parameters; None leaves one out."""
        return replace(self, **others)
