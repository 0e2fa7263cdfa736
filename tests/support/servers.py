"""A server of files for tests, which counts what it is asked for, and can be told to misbehave."""

import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from pathlib import Path
from threading import Thread
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID


@dataclass
class FileServer:
    """Serves the files of a folder.

    Attributes
    ----------
    ranges
        Whether it gives parts of files.
    conditions
        Whether it heeds ``If-Match``.
    tagged
        Whether it tells versions of a file apart.
    authorization
        What must be sent as the header of that name, where it is not empty.
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
def serving(folder: Path, certificate: Path | None = None) -> Iterator[FileServer]:
    """Serve the files of a folder on this machine, while the context lasts.

    Parameters
    ----------
    certificate
        Where to write a certificate that nobody else has signed, and a key; then it is an HTTPS server.
    """
    server = FileServer(folder)

    class Handler(_Handler):
        served = server

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        if certificate:
            listening.socket = _own_certificate(certificate).wrap_socket(listening.socket, server_side=True)
        server.address = f"http{'s' if certificate else ''}://127.0.0.1:{listening.server_port}"
        thread = Thread(target=listening.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            listening.shutdown()
            thread.join()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    wbufsize = -1  # head and content together: apart they wait for each other's acknowledgement
    served: FileServer

    def do_HEAD(self) -> None:
        self._answer(with_content=False)

    def do_GET(self) -> None:
        self._answer(with_content=True)

    def handle(self) -> None:
        """Answer, unless the other end has gone: it need not like what it sees."""
        with suppress(OSError):
            super().handle()

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
        size, tag = path.stat().st_size, f'"{path.stat().st_mtime_ns}"'
        if served.conditions and self.headers.get("If-Match") not in {None, tag}:
            return self._refuse(412)
        asked = self.headers.get("Range") if served.ranges else None
        start, stop = _bounds(asked, size) if asked else (0, size)
        self.send_response(206 if asked else 200)
        self.send_header("Content-Length", str(stop - start))
        if served.tagged:
            self.send_header("ETag", tag)
        if asked:
            self.send_header("Content-Range", f"bytes {start}-{stop - 1}/{size}")
        self.end_headers()
        if with_content:
            with path.open("rb") as file, suppress(ConnectionError):  # a client may have enough
                file.seek(start)
                self.wfile.write(file.read(stop - start))
                served.sent_bytes += stop - start
        return None

    def _refuse(self, status: int) -> None:
        self.send_response(status)
        self.send_header("Content-Length", "0")
        self.end_headers()


def _bounds(asked: str, size: int) -> tuple[int, int]:
    first, _, last = asked.removeprefix("bytes=").partition("-")
    return int(first), min(int(last) + 1, size)


def _own_certificate(target: Path) -> ssl.SSLContext:
    """Write a key and a certificate for this machine, signed by nobody else."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), now, now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False)
        .sign(key, hashes.SHA256())
    )
    private = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    target.write_bytes(key.private_bytes(*private) + certificate.public_bytes(serialization.Encoding.PEM))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(target)
    return context
