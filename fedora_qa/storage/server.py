"""Requests to a server: lengths, versions, ranges of bytes, listings, and their errors. Needs fsspec, an extra.

The texts of libraries may hold the whole URL, with its signature. So they are never repeated: the kind of failure is
derived from types, status codes and error numbers.
"""

import gc
import os
import ssl
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Final, Self, TypeVar

from fedora_qa.errors import MisuseError, StorageError
from fedora_qa.storage.folder import Version, local_version
from fedora_qa.storage.place import Place, RemoteFile

# Statuses of answers of HTTP.
_UNAUTHORIZED: Final = frozenset({401, 403})
_ABSENT: Final = frozenset({404, 410})
_CHANGED: Final = 412
"""Precondition failed: the object is no longer of the version that was requested."""
_TRANSIENT: Final = frozenset({408, 425, 429, 500, 502, 503, 504})

_CREDENTIALS: Final = (
    "give credentials in the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, or AWS_PROFILE), "
    "or FSSPEC_S3_ANON=true for a public bucket"
)

T = TypeVar("T")

_CONNECT_S: Final = 10.0
_SILENCE_S: Final = 60.0
"""Longest silence of a server after which a request is given up."""

_WAITS_S: Final = (0.5, 2.0)
"""Pauses before a failed request is repeated that may succeed a moment later."""

MOST_OBJECTS: Final = 200_000
"""Objects below one prefix, as files below one folder."""

_PARTS_OF_URLS: Final = frozenset("?#")


@dataclass(frozen=True, slots=True)
class Traffic:
    """Bytes of files that were transferred, and requests, including those for size and version."""

    transferred_bytes: int = 0
    requests: int = 0

    def __add__(self, other: Self) -> "Traffic":
        return Traffic(self.transferred_bytes + other.transferred_bytes, self.requests + other.requests)

    def __sub__(self, other: Self) -> "Traffic":
        return Traffic(self.transferred_bytes - other.transferred_bytes, self.requests - other.requests)


NO_TRAFFIC: Final = Traffic()


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
        self._files = _file_system(place)
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


def version_of(place: Place) -> Version:
    """Return the current version of a file, wherever it lies; raises ``StorageError`` if its server withholds it."""
    return Server(place).version if isinstance(place, RemoteFile) else local_version(place)


@dataclass(frozen=True, slots=True)
class RemoteObject:
    """An object below a prefix; ``name`` is relative to it, with slashes."""

    name: str
    place: RemoteFile
    size: int


def list_objects(prefix: RemoteFile) -> tuple[RemoteObject, ...]:
    """Return the objects below a prefix, in the order of their names; hidden ones are left out, as of a folder.

    Raises
    ------
    MisuseError
        There are more than ``MOST_OBJECTS``, or an object whose name is no part of a URL.
    StorageError
        The store cannot be listed; the message states why.
    """
    files = _file_system(prefix)
    listed: dict[str, dict[str, Any]] = repeated(lambda: files.find(prefix.url, detail=True), prefix)
    if len(listed) > MOST_OBJECTS:
        raise MisuseError(f"Expected {MOST_OBJECTS} objects at most below {prefix}, got {len(listed)}")
    root = prefix.url.removeprefix("s3://")
    objects = []
    for path, facts in sorted(listed.items()):
        name = path.removeprefix(root)
        parts = PurePosixPath(name).parts
        if not parts or any(part.startswith(".") for part in parts) or not name.isprintable():
            continue
        if _PARTS_OF_URLS & set(name):
            raise MisuseError(
                f"Expected names without ? and # below {prefix}, got {name!r}; name the objects one by one"
            )
        objects.append(RemoteObject(name, RemoteFile(f"{prefix.url}{name}"), int(facts.get("size") or 0)))
    return tuple(objects)


def _file_system(place: RemoteFile) -> Any:
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
            if wait_s is None or not _is_transient(error):
                # Without its cause, whose text may hold the URL with its signature.
                raise _failure_of(error, place) from None
        finally:
            if collects:
                gc.enable()
        time.sleep(wait_s)
    raise AssertionError("Expected the last try to return or raise, got neither")


def changed_error(place: RemoteFile) -> StorageError:
    """Return the error for a file that was changed while it was read."""
    return StorageError(
        f"Expected the file to stay as it is while it is checked, got a change; check it again: {place}"
    )


def _failure_of(error: BaseException, place: RemoteFile) -> StorageError:
    """Return the error for a failed request. Raise it ``from None``: the text of its cause may hold secrets."""
    errors = tuple(_chain(error))
    status, certificate = _status(errors), _certificate(errors)
    unreached = _any_of_type(errors, ConnectionError) or _any_named(
        errors, "ClientConnectorError", "ClientConnectorDNSError", "EndpointConnectionError", "ConnectTimeoutError"
    )
    # fsspec raises FileNotFoundError for any first failure: only the root of the chain counts.
    absent = status is None and isinstance(errors[-1], FileNotFoundError)
    forbidden = status in _UNAUTHORIZED or _any_of_type(errors, PermissionError)
    without_ranges = any(isinstance(failure, ValueError) and "range requests" in str(failure) for failure in errors)
    advice = _CREDENTIALS if place.scheme == "s3" else "sign in, or have the URL signed anew"
    # From specific to general, because several may apply: 412 is a status too.
    explanations: tuple[tuple[bool, str, str], ...] = (
        (
            status == _CHANGED or _any_named(errors, "FileExpired"),
            "the file to stay as it is while it is checked",
            "a change; check it again",
        ),
        (forbidden, "access to the file", f"a refusal ({status or 'forbidden'}); {advice}"),
        (
            status in _ABSENT or absent,
            "an HDF5 file",
            "a path that does not exist",
        ),
        (status is not None, "the server to send the file", f"the answer {status}"),
        (certificate is not None, "a server whose certificate can be verified", certificate or ""),
        (
            _any_named(errors, "NoCredentialsError", "PartialCredentialsError"),
            "credentials for the bucket",
            f"none; {_CREDENTIALS}",
        ),
        (
            _any_of_type(errors, TimeoutError) or _any_named(errors, "FSTimeoutError", "ReadTimeoutError"),
            "an answer of the server",
            "none in time",
        ),
        (
            without_ranges,
            "a server that gives parts of a file (range requests)",
            "one that does not; download the file first",
        ),
        (unreached, "a connection to the server", f"none{_number(errors)}"),
    )
    otherwise = ("the server to send the file", f"{type(errors[-1]).__name__}{_number(errors)}")
    expected, got = next(((expected, got) for holds, expected, got in explanations if holds), otherwise)
    return StorageError(f"Expected {expected}, got {got}: {place}")


def _is_transient(error: BaseException) -> bool:
    """Whether the same request may succeed a moment later."""
    errors = tuple(_chain(error))
    status = _status(errors)
    # An HTTP status decides alone: the other errors of the chain only wrap it.
    if status is not None:
        return status in _TRANSIENT
    if (
        # These last longer than seconds: a further request would only delay the message.
        _any_of_type(errors, ConnectionRefusedError)
        or _certificate(errors) is not None
        or _any_named(errors, "FileExpired", "NoCredentialsError")
    ):
        return False
    return _any_of_type(errors, TimeoutError, ConnectionError) or _any_named(
        errors, "ClientPayloadError", "ServerDisconnectedError", "FSTimeoutError", "IncompleteRead"
    )


def _chain(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and the errors that led to it: libraries wrap each other's errors."""
    link: BaseException | None = error
    while link is not None:
        yield link
        link = link.__cause__ or link.__context__


def _status(errors: tuple[BaseException, ...]) -> int | None:
    """Return the status of an HTTP answer, as aiohttp or botocore give it."""
    for error in errors:
        status = getattr(error, "status", None)
        # aiohttp gives status 0 where there was no answer.
        if isinstance(status, int) and status:
            return status
        response = getattr(error, "response", None)
        if isinstance(response, dict):
            status = response.get("ResponseMetadata", {}).get("HTTPStatusCode")
            if isinstance(status, int):
                return status
    return None


def _certificate(errors: tuple[BaseException, ...]) -> str | None:
    """Return the reason of OpenSSL for refusing a certificate, or for a handshake that failed; None without one."""
    for error in errors:
        if isinstance(error, ssl.SSLError):
            # The subclass of aiohttp has neither.
            why = getattr(error, "verify_message", None) or getattr(error, "reason", None)
            if isinstance(why, str):
                return why
    return None


def _number(errors: tuple[BaseException, ...]) -> str:
    """Return the system's text of an error number, in brackets; empty where there is no number."""
    numbers = (
        failure.errno
        for failure in errors
        # Errors of name resolution (EAI_*) are negative on Linux and not numbers of errno.
        if isinstance(failure, OSError) and isinstance(failure.errno, int) and failure.errno > 0
    )
    number = next(numbers, None)
    return f" ({os.strerror(number)})" if number is not None else ""


def _any_named(errors: tuple[BaseException, ...], *names: str) -> bool:
    """Whether the type of any error has one of these names; the extras that define them may not be installed."""
    return any(type(error).__name__ in names for error in errors)


def _any_of_type(errors: tuple[BaseException, ...], *types: type[BaseException]) -> bool:
    return any(isinstance(error, types) for error in errors)
