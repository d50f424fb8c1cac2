"""Arrays with named dimensions, and tables of them: as much of xarray as a sweep needs.

xarray itself, with what it brings along, takes longer to import than most sweeps take to
run; the command line does without it.  The names here are its names.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Makes the array of a result, of a shape and dtype: `np.empty`, or what hands out memory again.
Empty = Callable[[tuple[int, ...], str], NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Variable:
    """An array, the names of its dimensions, and its attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sizes(self) -> dict[str, int]:
        """Dimensions and their lengths."""
        return dict(zip(self.dims, self.values.shape, strict=True))

    def cut(self, chunk: Mapping[str, slice]) -> "Variable":
        """Its part in a chunk of the grid; dimensions not named are taken whole."""
        return Variable(self.dims, self.values[tuple(chunk.get(dim, slice(None)) for dim in self.dims)], self.attrs)

    def pick(self, where: Mapping[str, int]) -> "Variable":
        """Its part at one place along each of some dimensions, which it has no more."""
        left = tuple(dim for dim in self.dims if dim not in where)
        return Variable(left, self.values[tuple(where.get(dim, slice(None)) for dim in self.dims)], self.attrs)

    def item(self) -> Any:
        """The one value of an array of size 1."""
        return self.values.item()


@dataclass(frozen=True, eq=False)
class Table:
    """Results and the coordinates they belong to."""

    coords: dict[str, Variable]
    data_vars: dict[str, Variable]
    attrs: dict[str, Any]

    def __getitem__(self, name: str) -> Variable:
        return self.coords[name] if name in self.coords else self.data_vars[name]

    def __contains__(self, name: object) -> bool:
        return name in self.coords or name in self.data_vars

    @property
    def sizes(self) -> dict[str, int]:
        """Dimensions and their lengths."""
        sizes: dict[str, int] = {}
        for variable in (*self.coords.values(), *self.data_vars.values()):
            sizes |= variable.sizes
        return sizes

    def pick(self, where: Mapping[str, int]) -> "Table":
        """The table at one place along each of some dimensions, which it has no more."""

        def picked(variables: Mapping[str, Variable]) -> dict[str, Variable]:
            return {name: one.pick(where) for name, one in variables.items()}

        return Table(picked(self.coords), picked(self.data_vars), self.attrs)
