"""A server of files for tests, which counts what it is asked for, and can be told to misbehave."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import md5
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any


@dataclass
class FileServer:
    """Serves the files of a folder.

    Attributes
    ----------
    ranges
        Whether it gives parts of files.
    conditions
        Whether it heeds ``If-Match``.
    password
        What must be sent as ``Authorization`` header, where there is any.
    failures
        Statuses to answer the next requests for content with, in place of what was asked for.
    sent_bytes, requests
        What it has sent, and was asked.
    """

    folder: Path
    address: str = ""
    ranges: bool = True
    conditions: bool = True
    tagged: bool = True
    authorization: str = ""
    failures: list[int] = field(default_factory=list)
    sent_bytes: int = 0
    requests: int = 0

    def url(self, name: str) -> str:
        """Return the URL of a file."""
        return f"{self.address}/{name}"


@contextmanager
def serving(folder: Path) -> Iterator[FileServer]:
    """Serve the files of a folder on this machine, while the context lasts."""
    server = FileServer(folder)

    class Handler(_Handler):
        served = server

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        server.address = f"http://127.0.0.1:{listening.server_port}"
        thread = Thread(target=listening.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            listening.shutdown()
            thread.join()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    served: FileServer

    def do_HEAD(self) -> None:
        self._answer(with_content=False)

    def do_GET(self) -> None:
        self._answer(with_content=True)

    def log_message(self, *arguments: Any) -> None:
        """Say nothing."""

    def _answer(self, *, with_content: bool) -> None:
        served = self.served
        served.requests += 1
        path = served.folder / self.path.partition("?")[0].lstrip("/")
        if served.authorization and self.headers.get("Authorization") != served.authorization:
            return self._refuse(401)
        if not path.is_file():
            return self._refuse(404)
        if with_content and served.failures:
            return self._refuse(served.failures.pop(0))
        content = path.read_bytes()
        tag = f'"{md5(content, usedforsecurity=False).hexdigest()}"'
        if served.conditions and self.headers.get("If-Match") not in {None, tag}:
            return self._refuse(412)
        asked = self.headers.get("Range") if served.ranges else None
        start, stop = _bounds(asked, len(content)) if asked else (0, len(content))
        self.send_response(206 if asked else 200)
        self.send_header("Content-Length", str(stop - start))
        if served.tagged:
            self.send_header("ETag", tag)
        if asked:
            self.send_header("Content-Range", f"bytes {start}-{stop - 1}/{len(content)}")
        self.end_headers()
        if with_content:
            served.sent_bytes += stop - start
            self.wfile.write(content[start:stop])
        return None

    def _refuse(self, status: int) -> None:
        self.send_response(status)
        self.send_header("Content-Length", "0")
        self.end_headers()


def _bounds(asked: str, size: int) -> tuple[int, int]:
    first, _, last = asked.removeprefix("bytes=").partition("-")
    return int(first), min(int(last) + 1, size)
