"""Jobs of the commands: a plan to carry out, and what the file holds beside the results."""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.files.motions import digest_of
from slipsweep.files.netcdf import described
from slipsweep.files.spec import SweepSpec, named
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import Plan
from slipsweep.model.options import slides_both_ways
from slipsweep.model.variables import RESULT_DTYPES, STRENGTHS

#: Attribute that identifies the run which made a file.
RUN = "slipsweep_run"


@dataclass(frozen=True)
class Job:
    """A sweep file, the plan that a command makes from it, and the attributes of its output."""

    spec: SweepSpec
    plan: Plan
    title: str
    #: Settings beside the sweep file that the results depend on, by the names that users know.
    options: Mapping[str, Any]
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
        settings = {
            "version of slipsweep": __version__,
            "data type": self.floats,
            "sweep file": self.spec.text,
        }
        if self.spec.recorded is not None:
            settings["recorded motion"] = digest_of(self.spec.recorded)
        return {**settings, **self.options}

    @cached_property
    def digest(self) -> str:
        """Digest of the identity."""
        return hashlib.sha256(json.dumps(self.identity, sort_keys=True).encode()).hexdigest()

    def described(self, table: xr.Dataset, command: str) -> xr.Dataset:
        """Return results in the types of the file, with its labels and attributes."""
        table_in_file = table.assign(
            {name: table[name].astype(dtype, copy=False) for name, dtype in self.dtypes.items()}
        )
        if self.labels:
            labels = xr.Variable(
                "case", np.array(self.labels, object), {"long_name": "name of the case"}
            )
            table_in_file = table_in_file.assign_coords(label=labels)
        table_in_file = described(
            table_in_file, title=self.title, command=command, recorded=self.spec.recorded
        )
        return table_in_file.assign_attrs(self.attrs, **{RUN: self.digest})

    def outline(self, command: str) -> xr.Dataset:
        """Return the table of `described` with lazy arrays in place of the results."""
        import dask.array as da  # slow to import: only for runs in chunks

        template = self.plan.template()
        zeros = {
            name: da.zeros(result.shape, dtype=result.dtype, chunks=-1)
            for name, result in template.data_vars.items()
        }
        return self.described(template.copy(data=zeros), command)


def sweep_job(spec: SweepSpec) -> Job:
    """Return the job of `slipsweep run`: a sweep, or the statistics of samples."""
    options = {"solver": repr(spec.solver)}
    return Job(
        spec, spec.plan(), spec.output.title, options, spec.output.dtype, {"sweep": spec.text}
    )


def _without(inputs: Inputs, names: Collection[str]) -> Inputs:
    """Return the inputs without some of them."""
    return {name: values for name, values in inputs.items() if name not in names}


def limit_job(
    spec: SweepSpec, displacement: float | list[float], maximum_amplitude: float | None = None
) -> Job:
    """Return the job of `slipsweep limit`: amplitudes (m/s²) that displacements (m) allow."""
    from slipsweep.studies.limits import plan_limits  # imports numba

    with named(spec.source):
        if spec.sampling is not None:
            raise InputError(
                "has uncertain inputs; limits are those of a sweep without [uncertainty]"
            )
        plan = plan_limits(
            displacement,
            _without(spec.inputs, ("displacement_amplitude", *STRENGTHS)),
            excitation=spec.excitation,
            model=spec.model,
            maximum_amplitude=maximum_amplitude,
        )
    options = {"--displacement": displacement, "--maximum-amplitude": maximum_amplitude}
    return Job(spec, plan, "Amplitudes at which a tolerable displacement is reached", options)


def strength_job(spec: SweepSpec, displacement: float | list[float], of: str) -> Job:
    """Return the job of `slipsweep limit --of`: strengths that displacements (m) require."""
    from slipsweep.studies import required_strength  # imports numba

    # the strength is solved for, and the parameters of the paper's friction law play no part
    dropped = ["mu_s", "phi", "yield_acceleration", "yield_coefficient"]
    dropped += ["decay_rate", "delta_mu", "minimum_friction", "structure_frequency"]
    if of == "yield_coefficient" and not slides_both_ways(spec.model):
        dropped.append("theta")  # a yield coefficient needs no interface
    with named(spec.source):
        plan = required_strength.plan_strength(
            displacement,
            _without(spec.inputs, dropped),
            of=of,
            excitation=spec.excitation,
            model=spec.model,
            sampling=spec.sampling,
        )
    options = {"--displacement": displacement, "--of": of}
    return Job(spec, plan, required_strength.TITLE, options)
