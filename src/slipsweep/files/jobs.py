"""What a run carries out and writes: a plan, and what its file says beside the results."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.files.motions import digest_of
from slipsweep.files.netcdf import described
from slipsweep.files.spec import SweepSpec, named
from slipsweep.grid.plans import Plan
from slipsweep.model.options import slides_both_ways
from slipsweep.model.variables import RESULT_DTYPES, STRENGTHS

#: Attribute by which a run knows whether a file is its own.
RUN = "slipsweep_run"


@dataclass(frozen=True)
class Job:
    """A sweep file, the plan that a command makes of it, and what the command's output says of itself."""

    spec: SweepSpec
    plan: Plan
    title: str
    options: Mapping[
        str, Any
    ]  # what the results depend on further to the sweep file, by what users know it by
    floats: str = "float64"  # data type of floating-point results in the file
    attrs: Mapping[str, str] = field(default_factory=dict)  # further attributes of the file

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
        """Settings that must agree for a run to be resumed."""
        found = {
            "version of slipsweep": __version__,
            "data type": self.floats,
            "sweep file": self.spec.text,
        }
        if self.spec.recorded is not None:
            found["recorded motion"] = digest_of(self.spec.recorded)
        return {**found, **self.options}

    @cached_property
    def digest(self) -> str:
        """The identity in short."""
        return hashlib.sha256(json.dumps(self.identity, sort_keys=True).encode()).hexdigest()

    def described(self, table: xr.Dataset, command: str) -> xr.Dataset:
        """Results with all that the file says, in the file's types."""
        found = table.assign(
            {name: table[name].astype(dtype, copy=False) for name, dtype in self.dtypes.items()}
        )
        if self.labels:
            labels = xr.Variable(
                "case", np.array(self.labels, object), {"long_name": "name of the case"}
            )
            found = found.assign_coords(label=labels)
        found = described(found, title=self.title, command=command, recorded=self.spec.recorded)
        return found.assign_attrs(self.attrs, **{RUN: self.digest})

    def outline(self, command: str) -> xr.Dataset:
        """As `described`, but with lazy arrays where the results will stand."""
        import dask.array as da  # takes as long as xarray: only for runs in chunks

        template = self.plan.template()
        zeros = {
            name: da.zeros(one.shape, dtype=one.dtype, chunks=-1)
            for name, one in template.data_vars.items()
        }
        return self.described(template.copy(data=zeros), command)


def sweep_job(spec: SweepSpec) -> Job:
    """The job of `slipsweep run`: a sweep, or the statistics of samples."""
    options = {"solver": repr(spec.solver)}
    return Job(
        spec, spec.plan(), spec.output.title, options, spec.output.dtype, {"sweep": spec.text}
    )


def limit_job(
    spec: SweepSpec, displacement: float | list[float], maximum_amplitude: float | None = None
) -> Job:
    """The job of `slipsweep limit`: amplitudes (m/s²) that displacements (m, increasing) allow, over all other axes."""
    from slipsweep.studies.limits import plan_limits  # imports numba

    with named(spec.source):
        if spec.sampling is not None:
            raise InputError(
                "has uncertain inputs; limits are those of a sweep without [uncertainty]"
            )
        plan = plan_limits(
            displacement,
            replace(spec.inputs, **dict.fromkeys(("displacement_amplitude", *STRENGTHS))),
            excitation=spec.excitation,
            model=spec.model,
            maximum_amplitude=maximum_amplitude,
        )
    options = {"--displacement": displacement, "--maximum-amplitude": maximum_amplitude}
    return Job(spec, plan, "Amplitudes at which a tolerable displacement is reached", options)


def strength_job(spec: SweepSpec, displacement: float | list[float], of: str) -> Job:
    """Return the job of `slipsweep limit --of`: strengths that displacements (m) require."""
    from slipsweep.studies import required_strength  # imports numba

    # the strength is solved for; without θ the yield coefficient needs no interface
    replaced = dict.fromkeys(("mu_s", "phi", "yield_acceleration", "yield_coefficient"))
    both_ways = slides_both_ways(spec.model)
    if of == "yield_coefficient" and not both_ways:
        replaced |= dict.fromkeys(("theta",))
    replaced |= dict.fromkeys(("structure_frequency", "decay_rate", "delta_mu"))
    replaced |= dict.fromkeys(("minimum_friction",))
    with named(spec.source):
        plan = required_strength.plan_strength(
            displacement,
            replace(spec.inputs, **replaced),
            of=of,
            excitation=spec.excitation,
            model=spec.model,
            sampling=spec.sampling,
        )
    options = {"--displacement": displacement, "--of": of}
    return Job(spec, plan, required_strength.TITLE, options)
