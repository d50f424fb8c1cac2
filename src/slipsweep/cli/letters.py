"""Letters that are not in a terminal's encoding, spelled in those of ASCII."""

import codecs
import unicodedata

#: Name of the handler of errors, for streams.
SPELL = "slipsweep.spell"

#: Letters and signs of the program that ASCII does not have, after accents are taken off.
_SPELLED = {
    "λ": "lambda",
    "μ": "mu",
    "θ": "theta",
    "φ": "phi",
    "ξ": "xi",
    "σ": "sigma",
    "ω": "omega",
    "Δ": "Delta",
    "°": " deg",
    "±": "+-",
    "×": "x",
    "−": "-",
    "–": "-",
}


def spell(error: UnicodeError) -> tuple[str, int]:
    """Return what is printed for letters that cannot be encoded, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = unicodedata.normalize("NFKD", error.object[error.start : error.end])
    spelled = "".join(_SPELLED.get(c, c) for c in letters if not unicodedata.combining(c))
    return spelled.encode("ascii", "backslashreplace").decode("ascii"), error.end


codecs.register_error(SPELL, spell)
