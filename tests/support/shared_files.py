"""Files that all processes of a test run share: the first that needs a file writes it, the others wait for it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock


@dataclass(frozen=True, slots=True)
class SharedFiles:
    """Files in one folder of a test run. Tests must not write into them."""

    folder: Path

    def file(self, name: str, write: Callable[[Path], object]) -> Path:
        """Return the path of a file, which ``write`` writes where no process has yet.

        Parameters
        ----------
        name
            Of the file in the folder; the same name stands for the same content in all tests.
        write
            Writes the file to the path that it is given.
        """
        path = self.folder / name
        with FileLock(path.with_suffix(".lock")):
            if not path.exists():
                partial = path.with_name(f"partial-{name}")
                write(partial)
                partial.replace(path)
        return path
