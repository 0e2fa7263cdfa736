"""Write a file entirely or not at all."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory, mkstemp


def is_special(target: Path) -> bool:
    """Whether a path leads to a device, a pipe or a socket, which takes no file in its place."""
    return target.exists() and not (target.is_file() or target.is_dir())


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``target`` that takes its place when the block ends well.

    When the block raises, the temporary file is removed and ``target`` stays as it was. A link stays a link: the file
    to which it leads is replaced. A device or a pipe stays what it is, and receives what was written.
    """
    target = target.resolve()
    if is_special(target):
        with TemporaryDirectory() as folder:
            temporary = Path(folder) / "content"
            yield temporary
            with temporary.open("rb") as content, target.open("wb") as sink:
                copyfileobj(content, sink)
        return
    # In the same folder, because `replace` is atomic only within one file system.
    handle, name = mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # The file mode mask of the process can only be read by setting it.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp makes mode 0600; a record gets the usual one
        temporary.replace(target)
    # Also KeyboardInterrupt: an interrupted command must leave no partial file.
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@contextmanager
def staging_path(target: Path) -> Iterator[Path]:
    """Yield a path to write to, and then to rename to ``target``.

    It lies in a folder that is removed when the block ends, even if another process that was writing there has died.
    """
    # Beside the target, because `replace` is atomic only within one file system.
    with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
        yield Path(folder) / target.name


def write_text(target: Path, text: str | Iterable[str]) -> None:
    """Write UTF-8 text, or the parts of one, entirely or not at all."""
    with replacing(target) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.writelines([text] if isinstance(text, str) else text)
