"""Lengths of rays are told from z."""

import numpy as np
import pytest

from fedora_qa.checks.depth.projection import DepthProjection
from tests.support.depth_world import first_hypothesis, value, with_depth
from tests.support.flow_world import judged, rays_body


def test_ray_lengths_are_told_from_z() -> None:
    """Lengths of rays read as an exponent of 1, and are named."""
    lengths = np.linalg.norm(rays_body(), axis=-1)
    result = judged(DepthProjection(), with_depth(lambda depth: depth * lengths))
    assert value(result, "ray_exponent") == pytest.approx(1.0, abs=0.05)
    assert first_hypothesis(result).cause == "depth_ray_not_z"
