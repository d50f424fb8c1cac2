"""Displacements typed on the command line."""

from collections.abc import Sequence

from slipsweep.errors import InputError

#: The largest displacement that a number without a unit is taken for, m: more is likely to be meant in millimetres.
_MOST_WITHOUT_UNIT = 2.0


def displacements(texts: Sequence[str], g: float) -> list[float]:
    """Return the displacements given with ``-d``, in m, in order and each once.

    Raises
    ------
    InputError
        One is no length, not > 0, or a number so large that its unit is in doubt.
    """
    from slipsweep.model.parameters import check_values
    from slipsweep.model.units import quantity

    found = set()
    for text in texts:
        length = quantity("--displacement", text, "displacement_amplitude", g)
        if length > _MOST_WITHOUT_UNIT and not text.strip()[-1].isalpha():
            raise InputError(
                f"--displacement = {text}: without a unit that is {length:g} m; give the unit: -d {text.strip()}mm or "
                f"-d {text.strip()}m"
            )
        found.add(length)
    return [float(one) for one in check_values("displacement", sorted(found), "--displacement")]
