"""Stand-ins of real samples, made here, are read as the study says."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import load_choice
from fedora_qa.sequence.sequence import open_sequence
from tests.benchmarks.real_data.samples import read_flo, read_kitti, sample_of
from tests.benchmarks.real_data.study import section

TRUTH = np.array([[[1.5, -2.0], [0.0, 3.0]], [[4.0, 5.0], [6.0, 7.0]]], np.float32)


def write_flo(path: Path) -> Path:
    """As Middlebury's code writes it; the last pixel has no flow."""
    stored = TRUTH.copy()
    stored[1, 1] = 1e10
    path.write_bytes(np.float32(202021.25).tobytes() + np.array([2, 2], "<i4").tobytes() + stored.tobytes())
    return path


def test_flow_of_middlebury(tmp_path: Path) -> None:
    flow = read_flo(write_flo(tmp_path / "flow.flo"))
    np.testing.assert_array_equal(flow[:1], TRUTH[:1])
    assert np.isnan(flow[1, 1]).all()
    (tmp_path / "flow.flo").write_bytes((tmp_path / "flow.flo").read_bytes()[12:])
    with pytest.raises(MisuseError, match=r"Expected a \.flo file"):
        read_flo(tmp_path / "flow.flo")


def test_flow_of_kitti(tmp_path: Path) -> None:
    """The channels of the image are u, v and validity as R, G and B; OpenCV has B first."""
    stored = np.zeros((2, 2, 3), np.uint16)
    stored[..., 2:0:-1] = np.rint(TRUTH * 64 + 2**15)
    stored[..., 0] = [[1, 1], [1, 0]]
    cv2.imwrite(str(tmp_path / "flow.png"), stored)
    flow = read_kitti(tmp_path / "flow.png")
    np.testing.assert_array_equal(flow[:1], TRUTH[:1])
    assert np.isnan(flow[1, 1]).all()


def test_a_pair_is_a_sequence(tmp_path: Path) -> None:
    (tmp_path / "pair").mkdir()
    for name in ("first.ppm", "second.ppm"):
        cv2.imwrite(str(tmp_path / "pair" / name), np.full((2, 2, 3), 9, np.uint8))
    write_flo(tmp_path / "pair/flow.flo")
    sample = sample_of(tmp_path / "pair", "", tmp_path)
    with open_sequence(sample.sequence, load_choice(str(sample.dialect), str(sample.metadata))) as sequence:
        assert sequence.layout.streams == {"rgb", "flow/10hz"}
        assert not sequence.layout.problems
        np.testing.assert_array_equal(sequence.rows("path/flow/10hz", 0, 1)[0, :1], TRUTH[:1])


def test_ground_truth_of_euroc(tmp_path: Path) -> None:
    """Quaternions have w first."""
    (tmp_path / "imu.txt").write_text("#t,w,w,w,a,a,a\n" + "1403715523912143104,1,2,3,4,5,6\n" * 2)
    (tmp_path / "groundtruth.csv").write_text("#t,p,p,p,q,q,q,q\n" + "1403715523912143104,1,2,3,1,0,0,0\n" * 2)
    sample = sample_of(tmp_path, "", tmp_path)
    with open_sequence(sample.sequence, load_choice(str(sample.dialect), None)) as sequence:
        assert sequence.layout.streams == {"imu", "pose"}
        np.testing.assert_array_equal(sequence.rows("path/pose/orientation", 0, 1), [[0, 0, 0, 1]])


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(b"none")
    (tmp_path / "work").mkdir()
    assert "Not read: fedora-qa: Expected a recording" in "".join(section(tmp_path / "a.raw", "", tmp_path / "work"))
