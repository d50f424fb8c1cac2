"""What a run carries out and writes: a plan, and what its file says beside the results."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.files.motions import samples_of
from slipsweep.files.netcdf import described, history_of
from slipsweep.files.outputs import Read
from slipsweep.files.spec import SweepSpec
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.model.variables import RESULT_DTYPES
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

#: Attribute by which a run knows whether a file is its own.
RUN = "slipsweep_run"


@dataclass(frozen=True)
class Job:
    """A plan that is not made before it is needed, and what belongs to it.

    Attributes
    ----------
    source : str
        The sweep file, as the user named it.
    files : tuple of Path or int
        The files that were read for it.
    make : callable
        Makes the plan.
    title : str
    inputs : dict of str to object
        All that the results depend on, by what users know it by.
    names : tuple of str
        Names of the cases.
    recorded : Record or Suite, optional
        The motion, whose samples are written with the results.
    attrs : dict of str to str
        Further attributes of the file: `sweep`, the text that repeats the run.
    floats : str
        Data type of floating-point results in the file.
    compression : int
        Level at which the output is compressed; 0 for not.
    """

    source: str
    files: tuple[Read, ...]
    make: Callable[[], AnyPlan]
    title: str
    inputs: dict[str, Any]
    names: tuple[str, ...] = ()
    recorded: Record | Suite | None = None
    attrs: dict[str, str] = field(default_factory=dict)
    floats: str = "float64"
    compression: int = 0

    @cached_property
    def plan(self) -> AnyPlan:
        """What is to be solved."""
        return self.make()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the cases, where they are a dimension of the results."""
        return self.names if "case" in self.plan.sizes else ()

    @cached_property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Data types of the results in the file."""
        return {name: np.dtype(RESULT_DTYPES.get(name, self.floats)) for name in self.plan.names}

    @cached_property
    def identity(self) -> dict[str, Any]:
        """By what two runs know that they compute the same."""
        return {"version of slipsweep": __version__, "data type": self.floats, **self.inputs}

    @cached_property
    def digest(self) -> str:
        """The identity in short."""
        return hashlib.sha256(json.dumps(self.identity, sort_keys=True).encode()).hexdigest()

    def described(self, table: xr.Dataset, command: str) -> xr.Dataset:
        """Results (or a template of them) with all that the file says."""
        return described(
            table,
            title=self.title,
            history=history_of(command),
            labels=self.labels,
            recorded=self.recorded,
            **self.attrs,
            **{RUN: self.digest},
        )

    @contextmanager
    def named(self) -> Iterator[None]:
        """Name the sweep file in front of what turns out, while it is solved, not to be allowed."""
        try:
            yield
        except InputError as error:
            # a plan that is made late names the file itself
            raise InputError(f"{self.source}: {str(error).removeprefix(f'{self.source}: ')}") from None


def sweep_job(spec: SweepSpec) -> Job:
    """The job of `slipsweep run`: a sweep, or the statistics of samples."""
    return Job(
        spec.source,
        spec.files,
        spec.plan,
        spec.output.title,
        _inputs(spec) | {"solver": repr(spec.solver)},
        spec.labels,
        spec.recorded,
        {"sweep": spec.text},
        spec.output.dtype,
        spec.output.compression,
    )


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
        spec.source,
        spec.files,
        lambda: spec.limits(displacement, maximum_amplitude),
        "Amplitudes at which a tolerable displacement is reached",
        _inputs(spec) | {"--displacement": displacement, "--maximum-amplitude": maximum_amplitude},
        spec.labels,
        spec.recorded,
        compression=spec.output.compression,
    )


def _inputs(spec: SweepSpec) -> dict[str, Any]:
    """What the results depend on: the text of the sweep file, and the numbers of its records."""
    if spec.recorded is None:
        return {"sweep file": spec.text}
    digest = hashlib.sha256()
    for name, values in samples_of(spec.recorded).items():
        digest.update(f"{name} {values.shape}".encode() + np.ascontiguousarray(values).tobytes())
    return {"sweep file": spec.text, "recorded motion": digest.hexdigest()}
