"""Servers of this machine: of plain files, and of objects."""

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.handmade import write_handmade
from tests.support.servers import FileServer, serving

BUCKET = "release"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one small clean file."""
    write_handmade(tmp_path / "seq.h5")
    return tmp_path


@pytest.fixture
def server(folder: Path) -> Iterator[FileServer]:
    """A server of that folder."""
    with serving(folder) as running:
        yield running


@pytest.fixture(scope="session")
def s3_address() -> Iterator[str]:
    """The address of an S3-compatible server."""
    from moto.server import ThreadedMotoServer  # noqa: PLC0415 - slow to load

    running = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    running.start()
    host, port = running.get_host_and_port()
    yield f"http://{host}:{port}"
    running.stop()


@pytest.fixture
def bucket(s3_address: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """An S3 client and, in its bucket, the small file."""
    import boto3  # noqa: PLC0415 - slow to load
    from s3fs import S3FileSystem  # noqa: PLC0415 - slow to load

    for name, value in (
        ("AWS_ENDPOINT_URL", s3_address),
        ("AWS_ACCESS_KEY_ID", "AKIAEXAMPLEKEY"),
        ("AWS_SECRET_ACCESS_KEY", "example-of-a-secret"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
    ):
        monkeypatch.setenv(name, value)
    # One that another test left was made in the environment of that test.
    S3FileSystem.clear_instance_cache()
    client = boto3.client("s3")
    client.create_bucket(Bucket=BUCKET)
    client.put_object(Bucket=BUCKET, Key="seq.h5", Body=(folder / "seq.h5").read_bytes())
    yield client
    for listed in client.list_objects(Bucket=BUCKET)["Contents"]:
        client.delete_object(Bucket=BUCKET, Key=listed["Key"])
    client.delete_bucket(Bucket=BUCKET)
