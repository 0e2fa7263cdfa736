"""Choose a folder for compiled loops where Numba would find none, and so refuse to import them.

Numba keeps compiled loops in ``NUMBA_CACHE_DIR``, beside the sources, or in the user's folder of caches. It raises an
error where none of them is writable, as for a user without a home who runs an installation of somebody else.
"""

import atexit
import os
import sys
from pathlib import Path
from typing import Final

CACHE_VARIABLE: Final = "NUMBA_CACHE_DIR"
"""Environment variable of Numba; processes that are started later inherit it."""


def choose_cache_folder(package: Path) -> Path | None:
    """Set a temporary folder, which is removed at exit, where loops of a package can be kept nowhere else.

    A folder with a random name: Numba runs what it finds in its cache, so that nobody else may write there.

    Returns
    -------
    Path or None
        The folder; None where Numba has another, or where no temporary folder can be made either.
    """
    if os.environ.get(CACHE_VARIABLE) or _can_make(_users_caches()) or _is_writable(package):
        return None
    import tempfile  # noqa: PLC0415 - seldom needed

    try:
        folder = Path(tempfile.mkdtemp(prefix="fedora-qa-compiled-"))
    except OSError:
        return None
    os.environ[CACHE_VARIABLE] = str(folder)
    if "numba" in sys.modules:  # it has read its environment
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    atexit.register(_remove, folder, os.getpid())
    return folder


def _users_caches() -> Path:
    """Return the folder in which Numba keeps loops of packages that it may not write to."""
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - ``Path.home`` raises for a user without a home
    if sys.platform == "darwin":
        return home / "Library/Caches/numba"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "numba"


def _is_writable(package: Path) -> bool:
    """Whether the folder of compiled code beside each module can be written to."""
    folders = {module.parent for module in package.rglob("*.py")}
    return all(_can_make(folder / "__pycache__") for folder in folders)


def _can_make(folder: Path) -> bool:
    """Whether files can be written to a folder, which may have to be made."""
    nearest = next((place for place in (folder, *folder.parents) if os.path.lexists(place)), folder)
    return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)


def _remove(folder: Path, process: int) -> None:
    if os.getpid() == process:  # not a copy of it
        import shutil  # noqa: PLC0415 - seldom needed

        shutil.rmtree(folder, ignore_errors=True)
