"""What goes wrong, in the two kinds a caller tells apart."""


class InputError(ValueError):
    """Bad input: the message names the parameter or key, its value and what is allowed."""


class RunError(RuntimeError):
    """A run that failed for a reason outside its input (disk, memory, a rival process)."""
