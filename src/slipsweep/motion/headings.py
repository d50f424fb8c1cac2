"""Headings of records: the quantity and the unit that they name, vertical components."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from slipsweep.errors import InputError
from slipsweep.motion.reading import UNITS

#: Spellings of the units that are read, as `_plain` leaves them.
_SPELLINGS = {name: name for name in UNITS} | {
    "gs": "g",
    "gals": "gal",
    "cms2": "cm/s2",
    "ms2": "m/s2",
}

_LENGTHS = r"(?:[kdcmun]?m|in|inch|inches|ft|foot|feet)"

#: Other units that a heading may name, as `_plain` leaves them.
_OTHER_UNITS = {
    "acceleration": rf"{_LENGTHS}/?s2|(?:m|milli|u|micro)-?(?:g|gals?)|%-?g|g/\d+"
    r"|[\d.]+(?:e?-?\d+)?x?(?:g|gals?|c?m/s2)|counts?|cts|volts?|mv",
    "velocity": rf"{_LENGTHS}/s|kines?",
    "displacement": rf"{_LENGTHS}|met(?:er|re)s?|centimet(?:er|re)s?|millimet(?:er|re)s?",
}

#: Words for quantities, in the languages that records are described in.
_ACCELERATION = r"acc(?:[^a-z]|el|$)|acel|accé|beschl"
_SPECTRAL = r"spectral[ -](?:acc|vel|disp)\w*|response[ -]spectr\w*"
_OTHER_QUANTITIES = (
    r"(?<![a-z])(?:vel(?:o[ck]\w*)?|pgv|vitesse|geschwindigkeit"
    rf"|dis(?:pl?\w*)?|pgd|desplaz\w*|d[ée]placement|verschiebung|jerk|{_SPECTRAL})(?![a-z])"
    r"|^p?sa\b"
)

#: Quantities of a motion or its site that headings name beside its samples.
_ASIDES = (
    r"(?:peak|max\w*\.?|initial|final|shear|wave|site)[\s_-]+(?:ground[\s_-]+|wave[\s_-]+)?"
    r"(?:vel|disp)\w*"
)

#: Marks of a vertical component: words in its description, and parts of the name of its file.
_VERTICAL = {"UP", "U", "UD", "DU", "DN", "DWN", "DOWN", "V", "VER", "VRT", "VERT", "VERTICAL", "Z"}
_VERTICAL |= {"UD1", "UD2", "ACCZ", "AZ"}
_VERTICAL_CHANNEL = r"[B-FHLMSV][NGLH]Z"
_BEHIND_A_DIGIT = r"\d(UD\d?|UP|DN|DWN|VER|VERT)$"


class _Unit(NamedTuple):
    """A unit that a heading names."""

    text: str  # as it stands there
    quantity: str
    unit: str | None  # None: one that is not read


def unit_said(header: str, column: str = "") -> str | None:
    """Return the unit in the heading of a column, or else in the whole header; None: there is none.

    InputError: the heading names another quantity than an acceleration, or an unknown unit.
    """
    unit = _first(_in_name(column)) or _first(_in_units_line(header)) or _first(_in_text(header))
    words = re.search(_OTHER_QUANTITIES, column, re.IGNORECASE)
    words = words or re.search(_SPECTRAL, header, re.IGNORECASE)
    if words is None and not (unit and unit.quantity == "acceleration"):
        text = re.sub(_ASIDES, "", header, flags=re.IGNORECASE)
        if not re.search(_ACCELERATION, f"{header}\n{column}", re.IGNORECASE):
            words = re.search(_OTHER_QUANTITIES, text, re.IGNORECASE)
    if words is None and (unit is None or unit.unit is not None):
        return unit.unit if unit else None
    said = " in ".join(
        dict.fromkeys(part for part in (words and words[0], unit and unit.text) if part)
    )
    raise InputError(
        f"its heading says {said!r}: must be an acceleration in one of {', '.join(UNITS)}"
    )


def vertical_mark(component: str, path: Path | None = None) -> str | None:
    """Return the mark of a vertical component in its description, or in the name of its file."""
    words = re.split(r"[^A-Z0-9]+", re.sub(r"\bU[-/]D\b", "UD", component.upper()))
    marks = [word for word in words if word in _VERTICAL or re.fullmatch(_VERTICAL_CHANNEL, word)]
    if marks or path is None:
        return marks[0] if marks else None
    name = re.sub(r"\bU-D\b|(?<=_)U-D\b", "UD", path.name)
    parts = [part for part in re.split(r"[._\-\s]+", name) if part]
    ends = [part.upper() for part in (*parts[-1:], *parts[-2:-1])]
    is_end = (end for end in ends if end in _VERTICAL - {"U"})
    joined = re.search(_BEHIND_A_DIGIT, path.stem, re.IGNORECASE)
    is_channel = (part for part in (*ends, *parts) if re.fullmatch(_VERTICAL_CHANNEL, part))
    return next(is_end, None) or (joined[1] if joined else next(is_channel, None))


def is_unit(text: str) -> bool:
    """Return True if a cell of a heading is a unit and nothing else, of a time or of a motion."""
    bare = text.strip("()[] ")
    return _plain(bare) in ("s", "ms", "min") or _first(iter([(bare, True)])) is not None


def _first(candidates: Iterator[tuple[str, bool]]) -> _Unit | None:
    """Return the first unit among texts, of an acceleration if there is one.

    Each text has a mark: True if a unit of length may be taken for one there.
    """
    units = []
    for text, may_be_length in candidates:
        plain = _plain(text)
        if plain in _SPELLINGS:
            units.append(_Unit(text.strip(), "acceleration", _SPELLINGS[plain]))
        for quantity, pattern in _OTHER_UNITS.items():
            if re.fullmatch(pattern, plain) and (may_be_length or quantity != "displacement"):
                units.append(_Unit(text.strip(), quantity, None))
    return min(units, key=lambda unit: unit.quantity != "acceleration", default=None)


def _plain(text: str) -> str:
    """Return a unit in one spelling: cm/sec/sec, CM/S**2, cm s^-2 and cm/s² are all cm/s2."""
    plain = re.sub(r"[\s^*·'\"]", "", text.lower()).translate(str.maketrans("²−µμ", "2-uu"))
    plain = re.sub(r"se[cg](?:onds?|undos?)?", "s", plain)
    plain = re.sub(r"s-([12])", r"/s\1", plain).replace("//", "/").replace("/s1", "/s")
    return re.sub(r"/s/s|/\(s2\)|/ss", "/s2", plain)


def _brackets(text: str) -> list[str]:
    return re.findall(r"[(\[]\s*([^()\[\]]+?)\s*[)\]]", text)[::-1]


def _in_name(name: str) -> Iterator[tuple[str, bool]]:
    """Yield texts in a column's name that may be its unit: in brackets, all of it, last words."""
    yield from ((text, True) for text in _brackets(name))
    yield name, False
    words = re.split(r"[\s,:;=_]+", re.sub(r"[(\[].*?[)\]]", " ", name).strip())
    yield " ".join(words[-2:]), False  # m s-2
    yield from ((word, False) for word in words[:0:-1])


def _in_units_line(header: str) -> Iterator[tuple[str, bool]]:
    """Yield texts behind the word "units" in a header."""
    for line in header.splitlines():
        if match := re.search(r"(?i)(?:units?|unidad(?:es)?|einheit(?:en)?)\b(.*)", line):
            words = re.split(r"[\s,:;=]+", match[1])
            bare = [re.sub(r"\(.*", "", word).rstrip(".") for word in words]
            texts = (*(word for word in bare if word.lower() != "in"), *_brackets(match[1]))
            yield from ((text, True) for text in texts if text)


def _in_text(header: str) -> Iterator[tuple[str, bool]]:
    """Yield texts in the lines of a header, the last line first, that may be a unit."""
    for line in header.splitlines()[::-1]:
        yield from ((text, False) for text in _brackets(line))
        words = re.findall(r"(?i)\bin\s+(\S+)", line)
        yield from ((word.rstrip(".,;:"), False) for word in words)
        if not is_sentence(line):
            yield line.strip(" \t#%"), False
            if re.search(_ACCELERATION, line, re.IGNORECASE):
                yield from ((text, False) for text, _ in _in_name(line))


def is_sentence(line: str) -> bool:
    """Return True if a line of a header has a value or a date, so that it names no column."""
    return bool(re.search(r"[=:]|(?<![\w^*/-])\d", line))
