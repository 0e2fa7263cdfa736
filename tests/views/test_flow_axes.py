"""Vectors of flow in all axes of the image, each once."""

import numpy as np

from fedora_qa.views.flow_axes import FLOW_AXES


def test_all_other_axes_are_there_once() -> None:
    """Eight signed permutations of two components map the square onto itself; one of them is the identity."""
    matrices = [axes.matrix for axes in FLOW_AXES.values()]
    assert len({matrix.tobytes() for matrix in (*matrices, np.eye(2))}) == 8
    assert all(np.array_equal(matrix @ matrix.T, np.eye(2)) for matrix in matrices)


def test_components_are_exchanged_before_they_are_negated() -> None:
    """As the matrix does it, in the type of the flow; NaN moves with its component."""
    flow = np.array([[1.0, 2.0], [np.nan, 4.0]], np.float32)
    for axes in FLOW_AXES.values():
        turned = axes.of(flow)
        assert turned.dtype == np.float32
        np.testing.assert_array_equal(turned[0], axes.matrix @ flow[0])
        assert np.isnan(turned[1]).tolist() == [component == 0 for component in axes.order]
