"""A release is what lies in its folder, and nothing outside it."""

from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.gating.release import find_release, find_sequences, inside


def test_sequences_in_order_of_their_names(tmp_path: Path) -> None:
    """Files at any depth that match, each once, none hidden, no folder."""
    for name in ("b.h5", "a/c.h5", "a/d.txt", ".cache/e.h5", "a/.f.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "folder.h5").mkdir()
    found = find_sequences(tmp_path, ("**/*.h5", "*.h5"))
    assert [sequence.name for sequence in found] == ["a/c.h5", "b.h5"]
    assert found[0].path == tmp_path / "a/c.h5"


def test_nothing_to_check_is_misuse(tmp_path: Path) -> None:
    """An empty folder, and no folder, are refused."""
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(MisuseError, match="Expected"):
            find_release(folder, ("**/*.h5",))


@pytest.mark.parametrize("name", ["../a", "a/../../b", "/etc/passwd", "", ".", "a\\..\\b", "a\0b", "a\udcff"])
def test_no_name_leads_out(name: str, tmp_path: Path) -> None:
    """What is no plain name within the folder is refused."""
    with pytest.raises(MisuseError, match="Expected"):
        inside(tmp_path, name)


def test_no_link_leads_out(tmp_path: Path) -> None:
    """A link to a file outside is refused, one to a file inside is followed."""
    folder = tmp_path / "release"
    folder.mkdir()
    (tmp_path / "out.h5").touch()
    (folder / "in.h5").touch()
    (folder / "link.h5").symlink_to("in.h5")
    assert len(find_sequences(folder, ("*.h5",))) == 2
    (folder / "leads-out.h5").symlink_to(tmp_path / "out.h5")
    with pytest.raises(MisuseError, match="leads out"):
        find_sequences(folder, ("*.h5",))
