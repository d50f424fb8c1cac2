"""Which inputs of the interface are given and which are estimated, in words, for wherever a number is shown."""

from collections.abc import Collection, Mapping

#: Inputs that the displacement depends on: symbol, and the estimate in place of one that is not given.
_INPUTS = {
    "yield_acceleration": ("Üy", "by Coulomb"),
    "decay_rate": ("λ", "by Eq. 6"),
    "delta_mu": ("Δμ", "by Eqs. 10–11"),
}


def friction_inputs(model: str, given: Collection[str], drawn: Mapping[str, str] | None = None) -> str:
    """Say where Üy, λ and Δμ of a result come from: given, drawn, or estimated; Newmark's block has only Üy.

    `drawn` has uncertain parameters, and whether a draw is the value ("absolute") or one about it ("factor", "offset").

    Examples
    --------
    >>> friction_inputs("mendez", ())
    'Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated'
    >>> friction_inputs("mendez", ("yield_acceleration", "decay_rate"))
    'Üy, λ given; Δμ by Eqs. 10–11: estimated'
    """
    drawn = drawn or {}
    if "yield_coefficient" in drawn or "yield_coefficient" in given:
        return "Üy drawn" if "yield_coefficient" in drawn else "Üy given"
    known, uncertain, estimated = [], [], []
    for name, (symbol, rule) in _INPUTS.items():
        if model == "newmark" and name != "yield_acceleration":
            continue
        if name in drawn and (name in given or drawn[name] == "absolute"):
            uncertain.append(symbol)
        elif name in given:
            known.append(symbol)
        else:
            with_minimum = ", μmin given" if name == "decay_rate" and "minimum_friction" in given else ""
            about = ", drawn about it" if name in drawn else ""
            detail = (with_minimum + about).removeprefix(", ")
            estimated.append(f"{symbol} {rule}" + (f" ({detail})" if detail else ""))
    parts = ((known, " given"), (uncertain, " drawn"), (estimated, ": estimated"))
    return "; ".join(", ".join(names) + what for names, what in parts if names)
