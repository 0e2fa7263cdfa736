"""What the flow leaves between two frames."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.snapshot import carried_back_dn


def ramp(shift: float, height: int = 6, width: int = 9) -> np.ndarray:
    """Grey frames whose luma grows by 10 DN a column, moved to the right."""
    luma = 100 + 10 * (np.arange(width) - shift)
    return np.broadcast_to(luma[None, :, None], (height, width, 3)).astype(np.float32)


@given(st.floats(0.0, 3.0), st.integers(1, 8))
def test_right_flow_leaves_nothing(shift: float, block: int) -> None:
    """A frame that has moved as the flow says leaves 0 wherever the flow stays inside; the flow is in stored pixels."""
    flow_px = np.zeros((6, 9, 2), np.float32)
    flow_px[..., 0] = shift * block
    left = carried_back_dn(ramp(0.0), ramp(shift), flow_px, block)
    known = np.isfinite(left)
    assert known[:, :5].all()
    np.testing.assert_allclose(left[known], 0.0, atol=0.5)  # cv2.remap interpolates to 1/32 px: 0.3 DN here


def test_wrong_flow_leaves_the_slope() -> None:
    """Without flow, a ramp that has moved by two columns is darker by twice its slope."""
    left = carried_back_dn(ramp(0.0), ramp(2.0), np.zeros((6, 9, 2), np.float32), 1)
    np.testing.assert_allclose(left, -20.0, atol=0.05)


def test_unknown_and_leaving_flow_is_nan() -> None:
    """Where flow is NaN, infinite or leads outside, there is no value; the rest is untouched."""
    flow_px = np.zeros((6, 9, 2), np.float32)
    flow_px[0, 0], flow_px[1, 1], flow_px[2, 2, 1] = np.nan, np.inf, 100.0
    left = carried_back_dn(ramp(0.0), ramp(0.0), flow_px, 1)
    assert np.argwhere(~np.isfinite(left)).tolist() == [[0, 0], [1, 1], [2, 2]]
    assert (left[np.isfinite(left)] == 0).all()
