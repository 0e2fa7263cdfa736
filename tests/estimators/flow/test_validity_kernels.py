"""Patterns of flow and depth are counted as pixel by pixel, whatever the numbers are."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fedora_qa.estimators.flow.mask import compare_patterns, depth_range_m

SHAPE = (4, 9)
NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-42, -2.5, 1.5, 40.0, 3e38])
MOSTLY_PLAIN = st.one_of(st.just(3.0), NUMBERS)


@settings(deadline=None)  # the first call compiles
@given(
    arrays(np.float32, (*SHAPE, 2), elements=MOSTLY_PLAIN, fill=st.just(3.0)),
    arrays(np.float32, SHAPE, elements=MOSTLY_PLAIN, fill=st.just(3.0)),
    arrays(np.bool_, SHAPE),
)
def test_counts_and_range_are_those_of_numpy(flow_px: np.ndarray, depth_m: np.ndarray, moving: np.ndarray) -> None:
    """Flow without depth, depth that stands without flow, infinite flow; least and largest depth that stands."""
    standing_m = np.where(moving, np.float32(np.nan), depth_m)
    present, valid = np.isfinite(flow_px).all(axis=-1), np.isfinite(depth_m) & (depth_m > 0)
    stands = valid & np.isfinite(standing_m)
    expected = (present & ~valid).sum(), (stands & ~present).sum(), np.isinf(flow_px).any(axis=-1).sum()
    assert compare_patterns(flow_px.reshape(SHAPE[0], -1), depth_m, standing_m) == expected
    found = depth_range_m(depth_m, standing_m)
    assert found == ((depth_m[stands].min(), depth_m[stands].max()) if stands.any() else None)
