"""A file from somewhere else does not decide which other files are read."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.layout.hdf5_objects import RefusedError, find_dataset, has_group


@pytest.fixture
def file(tmp_path: Path) -> h5py.File:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["secret"] = np.arange(3)
    opened = h5py.File(tmp_path / "file.h5", "w")
    opened["group/inside"] = np.arange(4)
    yield opened
    opened.close()


def test_plain_path(file: h5py.File) -> None:
    """A dataset is found with or without a leading slash; what is not there is None."""
    assert find_dataset(file, "group/inside").shape == (4,)
    assert find_dataset(file, "/group/inside").shape == (4,)
    assert find_dataset(file, "group/nothing") is None
    assert find_dataset(file, "group/inside/deeper") is None


@pytest.mark.parametrize("target", ["/group/inside", "inside"], ids=["absolute", "relative"])
def test_soft_links_inside_are_followed(file: h5py.File, target: str) -> None:
    """A soft link to a dataset of the same file is that dataset."""
    file["group/alias"] = h5py.SoftLink(target)
    assert find_dataset(file, "group/alias").shape == (4,)


def test_soft_link_to_a_group_is_followed(file: h5py.File) -> None:
    """A soft link may lie in the middle of a path."""
    file["alias"] = h5py.SoftLink("/group")
    assert has_group(file, "alias")
    assert find_dataset(file, "alias/inside").shape == (4,)


@pytest.mark.parametrize("through", ["direct", "group", "soft"])
def test_external_links_are_refused(file: h5py.File, through: str) -> None:
    """Links to other files are refused, also as a group on the way and behind a soft link."""
    file["away"] = h5py.ExternalLink("other.h5", "secret" if through == "direct" else "/")
    file["soft"] = h5py.SoftLink("/away")
    path = {"direct": "away", "group": "away/secret", "soft": "soft/secret"}[through]
    with pytest.raises(RefusedError, match=r"other\.h5"):
        find_dataset(file, path)


def test_dangling_links_and_loops_are_refused(file: h5py.File) -> None:
    """A link to nothing, and one that leads to itself, end."""
    file["dangling"] = h5py.SoftLink("/nowhere")
    file["loop"] = h5py.SoftLink("/loop")
    for path in ("dangling", "loop"):
        with pytest.raises(RefusedError, match="where there is nothing"):
            find_dataset(file, path)


def test_virtual_datasets_are_refused(file: h5py.File) -> None:
    """A virtual dataset reads other files."""
    layout = h5py.VirtualLayout(shape=(3,), dtype="i8")
    layout[:] = h5py.VirtualSource("other.h5", "secret", shape=(3,))
    file.create_virtual_dataset("virtual", layout)
    with pytest.raises(RefusedError, match="virtual"):
        find_dataset(file, "virtual")


def test_external_storage_is_refused(file: h5py.File, tmp_path: Path) -> None:
    """A dataset whose bytes are those of any file at all is refused."""
    secret = tmp_path / "secret.txt"
    secret.write_bytes(b"x" * 8)
    file.create_dataset("raw", (8,), "u1", external=[(str(secret), 0, 8)])
    with pytest.raises(RefusedError, match="externally stored"):
        find_dataset(file, "raw")


def test_group_is_no_dataset(file: h5py.File) -> None:
    """A group where a dataset is expected is named."""
    with pytest.raises(RefusedError, match="got a group"):
        find_dataset(file, "group")
