"""Spelling in ASCII of letters that the encoding of a terminal lacks."""

import codecs
import unicodedata

#: Name of the handler of errors, for streams.
SPELL = "slipsweep.spell"

#: Spelling of the program's letters and signs that ASCII lacks; accents are removed before.
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
    """Return the spelling of letters that cannot be encoded, and the place after them."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = unicodedata.normalize("NFKD", error.object[error.start : error.end])
    spelled = "".join(_SPELLED.get(c, c) for c in letters if not unicodedata.combining(c))
    return spelled.encode("ascii", "backslashreplace").decode("ascii"), error.end


codecs.register_error(SPELL, spell)
