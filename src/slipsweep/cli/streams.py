"""Standard output and errors that no command fails over: closed ones, full disks, alphabets of one byte.

What a command is for are its files.  Where nobody reads what it prints (``| head -1``, ``>&-``) it goes on without a
word.  Where what it prints is lost (``> /dev/full``) it goes on, and says so at the end.
"""

import codecs
import errno
import io
import os
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

#: Letters of ours that have no decomposition in Unicode, as they are spelled where there are none.
_SPELLED = {
    "λ": "lambda",
    "μ": "mu",
    "µ": "mu",
    "θ": "theta",
    "φ": "phi",
    "ω": "omega",
    "π": "pi",
    "Δ": "Delta",
    "°": "deg",
    "≥": ">=",
    "≤": "<=",
    "×": "x",
    "−": "-",
    "–": "-",
    "…": "...",
}  # fmt: skip


def _spell(error: UnicodeError) -> tuple[bytes, int]:
    """Encode what an encoding has no letter for: bytes of a name as they are, letters as near as may be."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    out = b""
    for letter in error.object[error.start : error.end]:
        if "\udc80" <= letter <= "\udcff":
            out += letter.encode("ascii", "surrogateescape")
            continue
        plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
        spelled = _SPELLED.get(letter) or plain or letter.encode("ascii", "backslashreplace").decode()
        out += spelled.encode(error.encoding)
    return out, error.end


codecs.register_error("slipsweep.spell", _spell)


class _Stream(io.TextIOBase):
    """A text stream that takes what is written to it, also after it has failed.

    Attributes
    ----------
    failure : OSError or None
        Why something was lost that somebody may miss.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._open = True
        self.failure: OSError | None = None

    # typer and rich ask for these; there is no `buffer` that they could write to instead
    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._stream.encoding

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        return self._stream.errors

    def fileno(self) -> int:
        return self._stream.fileno()

    def isatty(self) -> bool:
        return self._stream.isatty()

    def writable(self) -> bool:
        return True

    def write(self, text: str, /) -> int:
        if self._open:
            try:
                self._stream.write(text)
            except OSError as error:
                self._lost(error)
        return len(text)

    def flush(self) -> None:
        if self._open:
            try:
                self._stream.flush()
            except OSError as error:
                self._lost(error)

    def _lost(self, error: OSError) -> None:
        self._open = False
        if error.errno != errno.EPIPE:
            self.failure = error
        # what the stream still holds would fail again when Python closes it
        with suppress(OSError, ValueError):
            if self._stream in (sys.__stdout__, sys.__stderr__):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())
                os.close(nowhere)


def _open_closed() -> None:
    """Open standard streams that are closed: the next file would get their number, and what is printed."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


@contextmanager
def guarded() -> Iterator[_Stream]:
    """Put streams that take everything in place of standard output and errors; yield the first."""
    _open_closed()
    stdout, stderr = sys.stdout, sys.stderr
    output = _Stream(stdout)
    with _spelled(stdout):
        sys.stdout, sys.stderr = output, _Stream(stderr)
        try:
            yield output
        finally:
            output.flush()
            sys.stdout, sys.stderr = stdout, stderr


@contextmanager
def _spelled(stream: TextIO) -> Iterator[None]:
    """Spell letters that the encoding of `stream` has not, unless the user said what to do with them."""
    how = stream.errors
    if isinstance(stream, io.TextIOWrapper) and how in ("strict", "surrogateescape"):
        stream.reconfigure(errors="slipsweep.spell")
        try:
            yield
        finally:
            stream.reconfigure(errors=how)
    else:
        yield
