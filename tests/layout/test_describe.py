"""What `fedora-qa layout` says of a file."""

import os
from contextlib import closing
from pathlib import Path
from typing import get_args

import h5py
import pytest

from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.conversions import ConversionName
from fedora_qa.layout.describe import _CONVERSIONS, describe
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.resolve import resolve
from tests.support.foreign import write_mvsec, write_purdue_lab
from tests.support.handmade import write_handmade


def test_canonical_file(tmp_path: Path) -> None:
    """Every dataset with path, shape, codec and label; nothing is converted, unused or wrong."""
    with h5py.File(write_handmade(tmp_path / "hand.h5")) as file:
        said = describe(file, resolve(file))
    rows = {row.key: row for row in said.datasets}
    assert list(rows) == [key for key, spec in DATASETS.items() if not spec.optional]
    assert rows["path/depth"].codec == "blosc + fletcher32"
    assert rows["path/depth"].chunks == (1, 27, 36)
    assert rows["metadata/depth_range"].codec == "none"
    assert all(row.units == DATASETS[row.key].units and not row.conversion for row in said.datasets)
    assert not said.absent
    assert not said.unused
    assert not said.problems


def test_conversions_are_said(tmp_path: Path) -> None:
    """Whatever is done to stored values is said, and so is what the dialect does not use."""
    with h5py.File(write_mvsec(tmp_path / "mvsec.h5")) as file:
        said = describe(file, resolve(file))
    rows = {row.key: row.conversion for row in said.datasets}
    assert rows["path/events/t"] == "columns 2 of the last axis, stamps in s"
    assert rows["path/events/p"] == "columns 3 of the last axis, polarity 1, -1 to 1, 0"
    assert "davis/left/imu" in said.unused
    assert rows["metadata/rgb_to_event"] == "names the last event before"
    assert dict(said.inferred)["layout.dialect"] == "mvsec"


def test_scale_and_problems_are_said(tmp_path: Path) -> None:
    """A unit that is converted is named, and a problem is a sentence."""
    path = write_purdue_lab(tmp_path / "lab.h5")
    with h5py.File(path, "r+") as file:
        del file["path/imgts"]
        said = describe(file, resolve(file))
    assert {row.key: row.conversion for row in said.datasets}["path/depth"] == "values times 1000 to mm"
    assert said.problems == ("Expected path/imgts beside path/img, got nothing there",)
    assert dict(said.absent)["rgb"] == said.problems[0]


def test_every_conversion_is_said() -> None:
    """A dialect may name any conversion, and each has words."""
    assert set(_CONVERSIONS) == set(get_args(ConversionName))


def test_a_link_is_described_where_it_may_lead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The label is that of the allowed file beside this one, not of a file that HDF5 finds before it by a variable."""
    for name, label in (("allowed", "mm"), ("elsewhere/allowed", "decoy")):
        (tmp_path / name).mkdir(parents=True)
        with h5py.File(write_handmade(tmp_path / "hand.h5")) as file, h5py.File(tmp_path / name / "d.h5", "w") as other:
            file.copy("path/depth", other, "depth")
            other["depth"].attrs["units"] = label
    with h5py.File(tmp_path / "hand.h5", "r+") as file:
        del file["path/depth"]
        file["path/depth"] = h5py.ExternalLink("allowed/d.h5", "/depth")
    monkeypatch.setenv("HDF5_EXT_PREFIX", os.fspath(tmp_path / "elsewhere"))
    with closing(ExternalFiles([tmp_path / "allowed"])) as external_files, h5py.File(tmp_path / "hand.h5") as file:
        said = describe(file, resolve(file, None, external_files), external_files)
    assert {row.key: row.units for row in said.datasets}["path/depth"] == "mm"
