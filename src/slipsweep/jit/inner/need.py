"""Whether this version of numba has what is relied on."""

import inspect
from typing import Any

#: What was asked for: an owner, and one of its names.
NEEDED: list[tuple[Any, str]] = []


def need(owner: Any, **names: str | None) -> None:
    """Raise ImportError unless `owner` has these names.

    Parameters
    ----------
    owner : class or module
    names
        The parameters of a function or method, in order; None for another attribute, of a class or of its
        instances.
    """
    for name, parameters in names.items():
        NEEDED.append((owner, name))
        if not hasattr(owner, name) and (parameters is not None or name not in _set_by(owner)):
            raise ImportError(f"{owner.__name__} has no {name}")
        if parameters is not None:
            has = " ".join(inspect.signature(getattr(owner, name)).parameters)
            if has != parameters:
                raise ImportError(f"{owner.__name__}.{name} takes ({has}), not ({parameters})")


def _set_by(owner: Any) -> set[str]:
    """Names in the constructors of a class, and in what numba has in their place where an object is made anew."""
    classes = inspect.getmro(owner) if inspect.isclass(owner) else ()
    constructors = (vars(one).get(name) for one in classes for name in ("__init__", "_init"))
    return {name for one in constructors if inspect.isfunction(one) for name in one.__code__.co_names}
