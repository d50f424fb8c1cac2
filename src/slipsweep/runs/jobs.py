"""What a run carries out and writes: a plan, and what its file says beside the results."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.files.checksums import checksum
from slipsweep.files.contents import Contents, Head, contents_of
from slipsweep.files.motions import samples_of
from slipsweep.files.outputs import Read
from slipsweep.files.spec import SweepSpec
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.model.variables import RESULT_DTYPES
from slipsweep.motion.records import Record
from slipsweep.runs.solving import try_out


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
    head : Head
    floats : str
        Data type of floating-point results in the file.
    asked : dict of str to object
        All that the results depend on, by what users know it by: numbers, text, lists of these.
    compression : int
        Level at which the output is compressed; 0 for not.
    """

    source: str
    files: tuple[Read, ...]
    make: Callable[[], AnyPlan]
    head: Head
    floats: str
    asked: dict[str, Any]
    compression: int = 0

    @cached_property
    def plan(self) -> AnyPlan:
        """What is to be solved; what is refused while it is solved is refused here, before anything is begun."""
        plan = self.make()
        if not plan.is_ordinary:
            with self.named():
                try_out(plan)
        return plan

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the cases, where they are a dimension of the results."""
        return self.head.labels if "case" in self.plan.sizes else ()

    def dtype(self, name: str) -> np.dtype[Any]:
        """Data type of a result in the file."""
        return np.dtype(RESULT_DTYPES.get(name, self.floats))

    @cached_property
    def dims(self) -> dict[str, tuple[str, ...]]:
        """Dimensions of the results."""
        return {name: one.dims for name, one in self.plan.template().data_vars.items()}

    def contents(self, history: str) -> Contents:
        """What the file of the whole result holds beside the values of the results."""
        return contents_of(replace(self.head, labels=self.labels), self.plan.template(), self.dtype, history)

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
    head = Head(spec.output.title, spec.labels, spec.recorded, spec.text)
    asked = _asked(spec, solver=repr(spec.solver))
    return Job(spec.source, spec.files, spec.plan, head, spec.output.dtype, asked, spec.output.compression)


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
        Head("Amplitudes at which a tolerable displacement is reached", spec.labels, spec.recorded),
        "float64",  # a limit is exact to the last bit
        {**_asked(spec), "--displacement": displacement, "--maximum-amplitude": maximum_amplitude},
        spec.output.compression,
    )


def _asked(spec: SweepSpec, **options: str) -> dict[str, Any]:
    record: Mapping[str, Any] = {}
    if spec.recorded is not None:
        record = {"record" if isinstance(spec.recorded, Record) else "suite": checksum(samples_of(spec.recorded))}
    return {"sweep file": spec.text, **record, **options}
