"""What a run carries out and writes: a plan, and what its file says beside the results."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.files.motions import samples_of
from slipsweep.files.netcdf import described
from slipsweep.files.spec import SweepSpec
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.model.variables import RESULT_DTYPES

#: Attribute by which a run knows whether a file is its own.
RUN = "slipsweep_run"


@dataclass(frozen=True)
class Job:
    """A sweep file, the plan that a command makes of it, and what the command's output says of itself.

    Attributes
    ----------
    spec : SweepSpec
    make : callable
        Makes the plan, when it is needed.
    title : str
    options : dict of str to object
        What the results depend on further to the sweep file, by what users know it by.
    floats : str
        Data type of floating-point results in the file.
    attrs : dict of str to str
        Further attributes of the file.
    """

    spec: SweepSpec
    make: Callable[[], AnyPlan]
    title: str
    options: Mapping[str, Any]
    floats: str = "float64"
    attrs: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def plan(self) -> AnyPlan:
        """What is to be solved."""
        return self.make()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the cases, where they are a dimension of the results."""
        return self.spec.labels if "case" in self.plan.sizes else ()

    @cached_property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Data types of the results in the file."""
        return {name: np.dtype(RESULT_DTYPES.get(name, self.floats)) for name in self.plan.names}

    @cached_property
    def identity(self) -> dict[str, Any]:
        """By what two runs know that they compute the same."""
        found = {"version of slipsweep": __version__, "data type": self.floats, "sweep file": self.spec.text}
        if self.spec.recorded is not None:
            digest = hashlib.sha256()
            for name, values in samples_of(self.spec.recorded).items():
                digest.update(f"{name} {values.shape}".encode() + np.ascontiguousarray(values).tobytes())
            found["recorded motion"] = digest.hexdigest()
        return {**found, **self.options}

    @cached_property
    def digest(self) -> str:
        """The identity in short."""
        return hashlib.sha256(json.dumps(self.identity, sort_keys=True).encode()).hexdigest()

    def described(self, table: xr.Dataset, command: str) -> xr.Dataset:
        """Results with all that the file says, in the file's types."""
        return described(
            table.assign({name: table[name].astype(dtype, copy=False) for name, dtype in self.dtypes.items()}),
            title=self.title,
            command=command,
            labels=self.labels,
            recorded=self.spec.recorded,
            attrs={**self.attrs, RUN: self.digest},
        )

    def outline(self, command: str) -> xr.Dataset:
        """As `described`, but with lazy arrays where the results will stand."""
        import dask.array as da  # takes as long as xarray: only for runs in chunks

        template = self.plan.template()
        for name, one in template.data_vars.items():
            template[name] = (one.dims, da.zeros(one.shape, dtype=one.dtype, chunks=-1), one.attrs)
        return self.described(template, command)


def sweep_job(spec: SweepSpec) -> Job:
    """The job of `slipsweep run`: a sweep, or the statistics of samples."""
    options, attrs = {"solver": repr(spec.solver)}, {"sweep": spec.text}
    return Job(spec, spec.plan, spec.output.title, options, spec.output.dtype, attrs)


def limit_job(spec: SweepSpec, displacement: float | list[float], maximum_amplitude: float | None = None) -> Job:
    """The job of `slipsweep limit`: limit amplitudes over all axes of a sweep but the amplitude.

    Parameters
    ----------
    spec : SweepSpec
    displacement : float or list of float
        m, increasing.
    maximum_amplitude : float, optional
        m/s².
    """
    return Job(
        spec,
        lambda: spec.limits(displacement, maximum_amplitude),
        "Amplitudes at which a tolerable displacement is reached",
        {"--displacement": displacement, "--maximum-amplitude": maximum_amplitude},
    )
