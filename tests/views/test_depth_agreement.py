"""Medians of residuals by tile."""

import numpy as np

from fedora_qa.views.depth_agreement import medians_by_group


def test_medians_by_group() -> None:
    """Against masks; groups that are too small have none."""
    rng = np.random.default_rng(1)
    first, second, groups = rng.random(500), rng.random(500), rng.integers(0, 7, 500).astype(np.uint8)
    groups[:3] = 7
    medians = medians_by_group(first, second, groups, 9, 4)
    for values, by_group in zip((first, second), medians, strict=True):
        np.testing.assert_array_equal(by_group[:7], [np.median(values[groups == group]) for group in range(7)])
        assert np.isnan(by_group[7:]).all()
