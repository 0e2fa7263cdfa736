"""Values in documents."""

from pathlib import Path

import pytest

from fedora_qa.sources import text
from fedora_qa.sources.source import SourceError
from fedora_qa.sources.text import document_value

DOCUMENTS = {
    "a.yaml": "cam:\n  K: [1.5, 2]\n  name: left\n",
    "a.json": '{"cam": {"K": [1.5, 2], "name": "left"}}',
    "a.toml": '[cam]\nK = [1.5, 2]\nname = "left"\n',
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_values(name: str, tmp_path: Path) -> None:
    """Tables by name, lists by number; nothing where a path leads nowhere."""
    path = tmp_path / name
    path.write_text(DOCUMENTS[name])
    assert document_value(path, "cam/K") == [1.5, 2]
    assert document_value(path, "cam/K/1") == 2
    assert document_value(path, "cam/name") == "left"
    for nowhere in ("cam/D", "cam/K/2", "cam/K/x", "cam/name/left"):
        assert document_value(path, nowhere) is None


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.yaml", "a: &x [1]\nb: [*x, *x]\n"),  # aliases multiply
        ("a.yaml", "a: !!python/object/apply:os.getcwd []\n"),
        ("a.yaml", "a: [1\n"),
        ("a.json", "[" * 100_000),
        ("a.toml", "a ="),
    ],
)
def test_refusals(name: str, content: str, tmp_path: Path) -> None:
    """Aliases, objects, damage and deep nesting are one sentence."""
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(SourceError, match=f"Expected a document in {name}"):
        document_value(path, "a")


def test_size_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A large document is not read."""
    path = tmp_path / "a.yaml"
    path.write_text("a: 1\n")
    monkeypatch.setattr(text, "LARGEST_DOCUMENT_BYTES", 2)
    with pytest.raises(SourceError, match="in 2 bytes at most"):
        document_value(path, "a")
