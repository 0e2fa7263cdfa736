"""Where a file lies: on a disk of this machine, or behind a URL."""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final, Self
from urllib.parse import urlsplit

from fedora_qa.errors import MisuseError

SCHEMES: Final = ("s3", "https", "http")


@dataclass(frozen=True, slots=True, repr=False)
class RemoteFile:
    """A file behind a URL, or all files below a prefix of an object store: a URL that ends with a slash.

    A URL may hold a password or a signature, which must not get into a record, a log or a traceback. Only ``url`` holds
    them, and it is never printed. What is printed has neither user nor query.
    """

    url: str

    def __str__(self) -> str:
        parts = urlsplit(self.url)
        # The last @ ends the user information: a password may hold another one.
        return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"

    def __repr__(self) -> str:
        return f"RemoteFile({str(self)!r})"

    @property
    def scheme(self) -> str:
        """``s3``, ``https`` or ``http``."""
        return urlsplit(self.url).scheme

    @property
    def is_prefix(self) -> bool:
        """Whether it stands for all objects whose names begin so."""
        return self.scheme == "s3" and self.url.endswith("/")

    @property
    def name(self) -> str:
        """The last part of its path."""
        return PurePosixPath(urlsplit(self.url).path).name

    @property
    def stem(self) -> str:
        """The name without its suffix."""
        return PurePosixPath(self.name).stem

    def absolute(self) -> Self:
        """Return itself: a URL means the same everywhere."""
        return self


Place = Path | RemoteFile


def place_of(text: str) -> Place:
    """Return the place that an argument names.

    Raises
    ------
    MisuseError
        It is a URL that cannot be read from, or an ``s3://`` one with credentials in it.
    """
    scheme, separator, _ = text.partition("://")
    if not separator:
        return Path(text)
    if scheme.lower() not in SCHEMES:
        raise MisuseError(f"Expected a path, or a URL of {', '.join(SCHEMES)}, got one of {scheme}")
    place = RemoteFile(scheme.lower() + separator + text[len(scheme) + len(separator) :])
    parts = urlsplit(place.url)
    if not parts.netloc or not (place.name or place.is_prefix):
        raise MisuseError(f"Expected a URL of a file, or of a prefix (s3://bucket/prefix/), got {place}")
    if place.scheme == "s3" and "@" in parts.netloc:
        raise MisuseError(f"Expected the credentials of {place} in the environment, got some in the URL")
    return place
