"""What numba asks again and again while it compiles, asked once a kernel.

Seconds are of processor, of the 8 that the first `slipsweep run sweeps/design_chart.toml` takes.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.cpu import CPUContext
from numba.core.types import Array, Boolean, Number
from numba.core.types.functions import Function
from numba.core.typing.context import Context

from slipsweep.jit.inner.need import need

need(Function, get_call_type="self context args kws", typing_key=None)
need(Context, load_additional_registries="self")
need(CPUContext, load_additional_registries="self", install_registry="self registry", _registries=None)

#: Modules of functions, and types of their arguments, of which nothing but the types decides on what comes out.
_MODULES = ("_operator", "builtins")
_PLAIN = (Number, Boolean, Array)


@contextmanager
def asked_once() -> Iterator[None]:
    """Have numba ask once in the block what an operator makes of numbers and arrays, and nothing of what it has loaded.

    For each a * b it goes, twice, through all that it knows of products, those of strings among it; and it compiles
    `max` once more for each kind of function that calls it (1.2 s).  For each array that is read it goes through
    fifty imports that it has made before (0.2 s).
    """
    known: dict[Any, Any] = {}
    find = Function.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        plain = getattr(self.typing_key, "__module__", "") in _MODULES and all(isinstance(one, _PLAIN) for one in args)
        if kws or not plain:
            return find(self, context, args, kws)
        key = self, tuple(args)
        if key not in known:
            known[key] = find(self, context, args, kws)
        return known[key]

    def typing_is_loaded(self: Any) -> None:
        pass

    def only_what_is_new(self: Any) -> None:
        for registry in list(self._registries):
            self.install_registry(registry)

    with (
        _instead(Function, "get_call_type", get_call_type),
        _instead(Context, "load_additional_registries", typing_is_loaded),
        _instead(CPUContext, "load_additional_registries", only_what_is_new),
    ):
        yield


@contextmanager
def _instead(owner: type, name: str, method: Callable[..., Any]) -> Iterator[None]:
    """Put a method in the place of one that a class has or inherits."""
    own = vars(owner).get(name)
    setattr(owner, name, method)
    try:
        yield
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)
