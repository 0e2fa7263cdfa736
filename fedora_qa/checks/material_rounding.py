"""From which size the errors are material that rounding to a stored step makes in derived quantities."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

MATERIAL: Final[Mapping[str, tuple[float, str, str]]] = MappingProxyType(
    {
        "flow": (0.02, "px", "flow_geometry.endpoint.error"),
        "path/depth": (0.001, "of the depth", "depth.scale.factor"),
        "path/pose/position": (0.001, "m", "pose.continuity.position"),
        "path/pose/orientation": (1.7e-4, "rad", "pose.noise.rotation"),
        "path/imu/angular_velocity": (1e-3, "rad/s", "imu.rotation.bias"),
        "path/imu/linear_acceleration": (0.01, "m/s^2", "imu.translation.bias"),
    }
)
"""By dataset: the size from which an error of the derived quantity is material, its unit, and the code of that size."""

UNIFORM: Final = float(3.0**0.5)
"""Largest error of uniform rounding over its standard deviation: ``(s / 2) / (s / sqrt(12))``."""
