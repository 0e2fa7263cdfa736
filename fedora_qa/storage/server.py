"""Request the length and version of a file, and ranges of its bytes, from a server. Through fsspec, an extra."""

import gc
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

from fedora_qa.errors import MisuseError, StorageError
from fedora_qa.storage.failures import failure_of, is_transient
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic
from fedora_qa.storage.version import Version, local_version

T = TypeVar("T")

_CONNECT_S: Final = 10.0
_SILENCE_S: Final = 60.0
"""Longest silence of a server after which a request is given up."""

_WAITS_S: Final = (0.5, 2.0)
"""Pauses before a failed request is repeated that may succeed a moment later."""


class Server:
    """The server's side of one file.

    Attributes
    ----------
    traffic
        Requests and bytes so far.

    Raises
    ------
    MisuseError
        The extra that reads such URLs is not installed.
    StorageError
        Here and from every request: the file cannot be read; the message states why.
    """

    def __init__(self, place: RemoteFile) -> None:
        self._place = place
        self._files = file_system(place)
        self._open: Any = None
        self.traffic = NO_TRAFFIC
        self.version = self.ask_version()

    def ask_version(self) -> Version:
        """Request the present length and version of the file."""
        # s3fs caches the facts of an object; a change shows only in a new answer.
        refresh = {"refresh": True} if self._place.scheme == "s3" else {}
        facts = self._request(lambda: self._files.info(self._place.url, **refresh))
        size = facts.get("size")
        if facts.get("type") == "directory":
            raise StorageError(f"Expected one HDF5 file, got a folder: {self._place}")
        if size is None:
            raise StorageError(
                f"Expected a server that states the length of a file, got one that does not: {self._place}"
            )
        # The tag that the server gives a version; empty where it states the size only.
        return Version(
            int(size), str(facts.get("ETag") or facts.get("LastModified") or facts.get("Last-Modified") or "")
        )

    def fetch(self, start: int, stop: int) -> bytes:
        """Return the bytes from ``start`` to ``stop``, both within the file, of the version at the first request."""
        fetched: bytes = self._request(lambda: self._read_range(start, stop))
        # HDF5 would report missing bytes as damage of the file.
        if len(fetched) != stop - start:
            raise StorageError(f"Expected {stop - start} bytes from {start} on, got {len(fetched)}: {self._place}")
        self.traffic += Traffic(transferred_bytes=len(fetched))
        return fetched

    def close(self) -> None:
        """Close the file; fsspec keeps the connections for other files."""
        if self._open is not None:
            self._open.close()

    def _read_range(self, start: int, stop: int) -> bytes:
        if self._open is None:
            # Requests must be answered from one version of the file: s3fs ensures this, HTTP has a header for it.
            bound: dict[str, Any] = {}
            if self._place.scheme != "s3":
                # If-Match needs a strong tag (RFC 9110, 13.1.1). It begins with a quote; a weak tag or a date does not.
                strong = self.version.tag.startswith('"')
                bound = {"size": self.version.size, "headers": {"If-Match": self.version.tag} if strong else {}}
            # Without a cache of fsspec: ``RemoteBytes`` caches, and the traffic is what was transferred.
            self._open = self._files.open(self._place.url, "rb", cache_type="none", **bound)
            self.traffic += Traffic(requests=int(self._place.scheme == "s3"))  # s3fs requests the version by itself
        self._open.seek(start)
        return bytes(self._open.read(stop - start))

    def _request(self, request: Callable[[], T]) -> T:
        return repeated(request, self._place, self._count)

    def _count(self) -> None:
        self.traffic += Traffic(requests=1)


def file_system(place: RemoteFile) -> Any:
    """Return what reads files of the scheme of a place; raises ``MisuseError`` where its extra is not installed."""
    try:
        import aiohttp  # noqa: PLC0415 - an extra
        import fsspec  # noqa: PLC0415 - an extra

        if place.scheme == "s3":
            config = {"connect_timeout": _CONNECT_S, "read_timeout": _SILENCE_S}
            return fsspec.filesystem("s3", use_listings_cache=False, config_kwargs=config)
        # Only silence is limited: a large chunk over a slow line takes as long as it takes.
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=_CONNECT_S, sock_read=_SILENCE_S)
        return fsspec.filesystem(place.scheme, client_kwargs={"timeout": timeout})
    except ImportError:
        raise MisuseError(
            f"Expected what reads {place.scheme}:// files; install it: pip install 'fedora-qa[remote]'"
        ) from None


def repeated(request: Callable[[], T], place: RemoteFile, count: Callable[[], None] = lambda: None) -> T:
    """Return what a request returns, and repeat it where it may succeed a moment later.

    Parameters
    ----------
    place
        For the message.
    count
        Called at each try.

    Raises
    ------
    StorageError
        The request failed; the message states why.
    """
    for wait_s in (*_WAITS_S, None):
        count()
        # No garbage collection until the request is done. h5py holds its lock while it reads, and needs it to free
        # its objects. If the thread that does the requests collected them meanwhile, both threads would wait for
        # each other forever (h5py issue 2019).
        collects = gc.isenabled()
        gc.disable()
        try:
            return request()
        except Exception as error:  # noqa: BLE001 - the libraries raise errors of many types; the user gets one sentence
            if wait_s is None or not is_transient(error):
                # Without its cause, whose text may hold the URL with its signature.
                raise failure_of(error, place) from None
        finally:
            if collects:
                gc.enable()
        time.sleep(wait_s)
    raise AssertionError("Expected the last try to return or raise, got neither")


def version_of(place: Place) -> Version:
    """Return the current version of a file, wherever it lies; raises ``StorageError`` if its server withholds it."""
    return Server(place).version if isinstance(place, RemoteFile) else local_version(place)
