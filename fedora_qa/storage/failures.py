"""The error of a failed request to a server, in one sentence without any secret.

The texts of libraries may hold the whole URL, with its signature. So they are never repeated: the kind of failure is
derived from types, status codes and error numbers.
"""

import os
import ssl
from collections.abc import Iterator
from typing import Final

from fedora_qa.errors import StorageError
from fedora_qa.storage.place import RemoteFile

_UNAUTHORIZED: Final = frozenset({401, 403})
_ABSENT: Final = frozenset({404, 410})
_CHANGED: Final = 412
"""Precondition failed: the object is no longer of the version that was requested."""
_TRANSIENT: Final = frozenset({408, 425, 429, 500, 502, 503, 504})

_CREDENTIALS: Final = (
    "give credentials in the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, or AWS_PROFILE), "
    "or FSSPEC_S3_ANON=true for a public bucket"
)


def failure_of(error: BaseException, place: RemoteFile) -> StorageError:
    """Return the error for a failed request. Raise it ``from None``: the text of its cause may hold secrets.

    Parameters
    ----------
    error
        The error of a library; of it and the errors that led to it, the most specific decides.
    place
        The file that was requested.

    Returns
    -------
    StorageError
        It states what was expected, and what the server gave in its place.
    """
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


def is_transient(error: BaseException) -> bool:
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


def changed_error(place: RemoteFile) -> StorageError:
    """Return the error for a file that was changed while it was read."""
    return StorageError(
        f"Expected the file to stay as it is while it is checked, got a change; check it again: {place}"
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
            why = getattr(error, "verify_message", None) or getattr(
                error, "reason", None
            )  # aiohttp's subclass has neither
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
