"""What is made in the work folder and then renamed: a file or a folder gets its name when all chunks are in it."""

from pathlib import Path

from slipsweep.errors import RunError
from slipsweep.files.outputs import appear


class Renamed:
    """What such targets have in common.

    Attributes
    ----------
    path : Path
        The output.
    data : Path
        Where it is made.
    """

    path: Path
    data: Path

    def appear(self, overwrite: bool) -> None:
        """Give it its name."""
        appear(self.data, self.path, overwrite)

    def is_there(self) -> bool:
        """Whether it has not been taken away."""
        return self.data.exists()

    def is_complete(self) -> bool:
        """Whether something has its name."""
        return self.path.exists()

    def has_appeared(self) -> bool:
        """Whether it has its name; for a moment a file has both."""
        return self.path.exists() and (not self.data.exists() or self.data.samefile(self.path))


def removed(path: Path) -> RunError:
    """What is said where a file or folder is gone that a run was writing."""
    return RunError(f"{path}: was removed during the run; start again")
