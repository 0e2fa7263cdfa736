"""Conversions are those of the formats' documents, and of closed forms."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from fedora_qa.layout.conversions import Conversion, converted, depth_from_disparity, intervals, stored_part_of_pose
from tests.support.dsec_folder import encode_flow

FLOW = Conversion("flow16")
POSITION, ORIENTATION = "path/pose/position", "path/pose/orientation"


@given(arrays.arrays(np.float32, (3, 4, 2), elements=st.floats(-200, 200, width=32)), st.integers(0, 11))
def test_flow_of_16_bits(flow_px: np.ndarray, invalid: int) -> None:
    """What DSEC's encoding holds comes back within half a step, and NaN where it is invalid."""
    flow_px.reshape(-1, 2)[invalid] = np.nan
    stored = encode_flow(flow_px)
    read = converted(stored[np.newaxis], "path/flow/10hz", FLOW)[0]
    np.testing.assert_allclose(read, flow_px, atol=0.5 / 128 + 1e-6)
    assert np.isnan(read).sum() == 2


@given(st.floats(100, 900), st.floats(0.05, 2), st.floats(-5, 5), st.integers(1, 65535))
def test_disparity_is_reprojected_as_opencv_does(focal_px: float, baseline_m: float, shift: float, stored: int) -> None:
    """The depth is that of cv2.reprojectImageTo3D with the same matrix."""
    Q = np.array([[1, 0, 0, -3], [0, 1, 0, -2], [0, 0, 0, focal_px], [0, 0, 1 / baseline_m, shift / baseline_m]])
    coefficients = depth_from_disparity(Q)
    assert coefficients is not None
    raw = np.full((1, 2, 2), stored, np.uint16)
    depth_m = converted(raw, "path/depth", Conversion("disparity16", depth_from_disparity=coefficients))
    expected = cv2.reprojectImageTo3D(raw[0].astype(np.float32) / 256, Q)[..., 2]
    if abs(stored / 256 + shift) > 1e-2:
        np.testing.assert_allclose(depth_m[0], expected, rtol=1e-3)


def test_no_disparity_is_no_depth() -> None:
    """0 marks an invalid pixel; a matrix by which depth would depend on the pixel is refused."""
    depth_m = converted(np.array([[[0.0, 2.0]]]), "path/depth", Conversion("disparity"))
    np.testing.assert_array_equal(depth_m, [[[np.nan, 0.5]]])
    for Q in (np.eye(3), np.ones((4, 4)), np.zeros((4, 4)), np.full((4, 4), np.nan)):
        assert depth_from_disparity(Q) is None


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_transformations(seed: int, invert: bool) -> None:
    """Position and orientation are those of the transformation, or of its inverse."""
    random = np.random.default_rng(seed)
    rotations = Rotation.random(5, random_state=random)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = rotations.as_matrix(), random.normal(0, 10, (5, 3))
    stored = np.linalg.inv(matrices) if invert else matrices
    conversion = Conversion("matrix4", invert=invert)
    np.testing.assert_allclose(converted(stored, POSITION, conversion), matrices[:, :3, 3], atol=1e-12)
    read = Rotation.from_quat(converted(stored, ORIENTATION, conversion))
    np.testing.assert_allclose((read * rotations.inv()).magnitude(), 0, atol=1e-7)


@pytest.mark.parametrize("columns", [12, 16])
def test_transformations_row_by_row(columns: int) -> None:
    """The numbers of a matrix in one row, with the last row 0, 0, 0, 1 or without it, are the same poses."""
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = (
        Rotation.random(5, random_state=3).as_matrix(),
        np.arange(15).reshape(5, 3),
    )
    flat = matrices.reshape(5, 16)[:, :columns]
    for key in (POSITION, ORIENTATION):
        expected = converted(matrices, key, Conversion("matrix4"))
        np.testing.assert_array_equal(converted(flat, key, Conversion("matrix4")), expected)
        np.testing.assert_array_equal(converted(matrices[:, :3], key, Conversion("matrix4")), expected)
        assert len(converted(flat[:0], key, Conversion("matrix4"))) == 0


def test_what_is_no_rotation_is_not_taken_for_one() -> None:
    """A scaled matrix gives a quaternion that is not unit, a mirrored one and NaN give none."""
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[0, :3, :3] *= 1.1
    matrices[1, 0, 0] = -1
    matrices[2, 1, 1] = np.nan
    read = converted(matrices, ORIENTATION, Conversion("matrix4"))
    assert np.linalg.norm(read[0]) == pytest.approx(1.1)
    assert np.isnan(read[1:]).all()


@pytest.mark.parametrize("invalid", [0.0, float("inf"), -1.0, 65535.0])
def test_marks_of_invalid_pixels(invalid: float) -> None:
    """A marked value is NaN, and no other."""
    raw = np.array([[[invalid, 2.0]]])
    np.testing.assert_array_equal(converted(raw, "path/depth", Conversion(invalid=invalid)), [[[np.nan, 2.0]]])
    if 0 <= invalid <= 65535:
        whole = converted(raw.astype(np.uint16), "path/depth", Conversion(invalid=invalid))
        np.testing.assert_array_equal(whole, [[[np.nan, 2.0]]])


@given(st.integers(0, 2**32 - 1))
def test_poses_of_another_frame_than_the_body(seed: int) -> None:
    """T_world_body = T_world_posed T_posed_body."""
    random = np.random.default_rng(seed)
    posed, body = (np.tile(np.eye(4), (4, 1, 1)) for _ in range(2))
    for matrices in (posed, body):
        matrices[:, :3, :3] = Rotation.random(4, random_state=random).as_matrix()
        matrices[:, :3, 3] = random.normal(0, 10, (4, 3))
    expected = posed @ body[0]
    conversion = Conversion("matrix4", T_posed_body=tuple(map(tuple, body[0].tolist())))
    np.testing.assert_allclose(converted(posed, POSITION, conversion), expected[:, :3, 3], atol=1e-12)
    read = Rotation.from_quat(converted(posed, ORIENTATION, conversion))
    np.testing.assert_allclose(read.as_matrix(), expected[:, :3, :3], atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_positions_and_quaternions_of_another_frame_than_the_body(seed: int, invert: bool) -> None:
    """They are the same transformations as matrices."""
    random = np.random.default_rng(seed)
    rotations = Rotation.random(6, random_state=random)
    posed = np.tile(np.eye(4), (6, 1, 1))
    posed[:, :3, :3], posed[:, :3, 3] = rotations.as_matrix(), random.normal(0, 10, (6, 3))
    rows = np.concatenate([posed[:, :3, 3], rotations.as_quat()], axis=1)
    frame = {"invert": invert, "T_posed_body": tuple(map(tuple, posed[5].tolist()))}
    of_rows, of_matrices = (Conversion(name, **frame) for name in ("position_quaternion", "matrix4"))  # type: ignore[arg-type]
    body = [converted(rows, key, of_rows) for key in (POSITION, ORIENTATION)]
    for key, read in zip((POSITION, ORIENTATION), body, strict=True):
        np.testing.assert_allclose(read, converted(posed, key, of_matrices), atol=1e-12)
    np.testing.assert_allclose(stored_part_of_pose(*body, POSITION, of_rows), rows[:, :3], atol=1e-12)
    stored = stored_part_of_pose(*body, ORIENTATION, of_rows)
    np.testing.assert_allclose(np.abs(np.sum(stored * rows[:, 3:], axis=1)), 1, atol=1e-12)


def test_a_quaternion_that_is_not_unit_stays_so() -> None:
    """Its length is kept, the position does not depend on it, and one of length 0 is no rotation."""
    rows = np.array([[1, 2, 3, 0, 0, 0.5, 0], [1, 2, 3, 0, 0, 0, 0]], np.float64)
    conversion = Conversion(
        "position_quaternion", T_posed_body=((1, 0, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    )
    np.testing.assert_allclose(converted(rows, POSITION, conversion)[0], [0, 2, 3])
    read = converted(rows, ORIENTATION, conversion)
    np.testing.assert_allclose(np.abs(read[0]), [0, 0, 0.5, 0], atol=1e-15)
    assert np.isnan(read[1]).all()


def test_channels_first() -> None:
    """(n, 2, H, W) becomes (n, H, W, 2), after what is invalid was marked."""
    stored = np.arange(24.0).reshape(2, 2, 2, 3)
    read = converted(stored, "path/flow/10hz", Conversion("chw", invalid=0))
    np.testing.assert_array_equal(read[1, 1, 2], [17, 23])
    assert np.isnan(read[0, 0, 0, 0])


def test_intervals_reach_to_the_next_instant() -> None:
    """n instants give n - 1 intervals, and none gives none."""
    np.testing.assert_array_equal(intervals(np.array([1, 4, 6])), [[1, 4], [4, 6]])
    assert intervals(np.array([1])).shape == intervals(np.empty(0)).shape == (0, 2)
