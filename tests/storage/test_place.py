"""URLs are told from paths, and what is secret in them is never shown."""

import pickle
from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import RemoteFile, place_of

SIGNED = "https://user:pass@host.org:8443/data/day%201.h5?X-Amz-Signature=0123456789"


def test_a_path_is_a_path() -> None:
    """Whatever has no scheme is a path, also with colons in it."""
    assert place_of("a:b/c.h5") == Path("a:b/c.h5")


def test_secrets_are_kept_for_the_server() -> None:
    """User, password and signature go to the server, through a pickle too, and into no text."""
    place = pickle.loads(pickle.dumps(place_of(SIGNED)))
    assert isinstance(place, RemoteFile)
    assert place.url == SIGNED
    assert str(place) == "https://host.org:8443/data/day%201.h5"
    assert (place.name, place.stem) == ("day%201.h5", "day%201")
    for shown in (repr(place), f"{place}", repr([place]), str({"path": place})):
        assert not any(secret in shown for secret in ("user", "pass@", "0123456789", "X-Amz"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("gs://bucket/seq.h5", "got one of gs"),
        ("https:///seq.h5", "a URL of a file"),
        ("s3://bucket", "a URL of a file"),
        ("s3://key:secret@bucket/seq.h5", "in the environment"),
    ],
)
def test_what_cannot_be_read_from(text: str, told: str) -> None:
    """Another scheme, no file, or a secret where it does not belong: one sentence without the secret."""
    with pytest.raises(MisuseError, match=told) as refused:
        place_of(text)
    assert "key:secret" not in str(refused.value)


@pytest.mark.parametrize(("text", "is_prefix"), [("s3://b/", True), ("s3://b/p/", True), ("https://h/p/", False)])
def test_a_slash_at_the_end_names_a_prefix(text: str, is_prefix: bool) -> None:
    place = place_of(text)
    assert isinstance(place, RemoteFile)
    assert place.is_prefix == is_prefix


def test_schemes_in_capitals() -> None:
    """A scheme means the same in capitals."""
    assert place_of("S3://bucket/Seq.h5") == RemoteFile("s3://bucket/Seq.h5")
