"""What makes the array of a result, of a shape and dtype."""

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

Empty = Callable[[tuple[int, ...], str], NDArray[Any]]
