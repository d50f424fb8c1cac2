"""Processes on a file system that has no locks, as the system's calls answer there."""

import ctypes
import functools
import platform
import struct
from collections.abc import Callable

import pytest

#: Number of the system call `flock`, by processor.
_FLOCK = {"x86_64": 73, "aarch64": 32}

_PR_SET_NO_NEW_PRIVS = 38
_PR_SET_SECCOMP = 22
_SECCOMP_MODE_FILTER = 2


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("instructions", ctypes.c_void_p))


def refusing_locks(error: int) -> Callable[[], None]:
    """Return a function after whose call `flock` fails with an error, in children too."""
    if platform.system() != "Linux" or platform.machine() not in _FLOCK:
        pytest.skip("filters of system calls are Linux's")
    return functools.partial(_refuse_locks, error)


def _refuse_locks(error: int) -> None:
    instructions = [
        (0x20, 0, 0, 0),  # load the number of the call
        (0x15, 0, 1, _FLOCK[platform.machine()]),  # go on if it is flock, else pass over one
        (0x06, 0, 0, 0x00050000 | error),  # return the error
        (0x06, 0, 0, 0x7FFF0000),  # allow the call
    ]
    code = ctypes.create_string_buffer(
        b"".join(struct.pack("HBBI", *instruction) for instruction in instructions)
    )
    program = _Program(len(instructions), ctypes.addressof(code))
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) or library.prctl(
        _PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, ctypes.byref(program), 0, 0
    ):
        raise OSError(ctypes.get_errno(), "no filter of system calls")
