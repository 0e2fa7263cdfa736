"""Differences of the same image from two worlds: depth, flow and intensity, inside surfaces and at their edges."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from fedora_generator.camera import Camera
from fedora_generator.flow import flow_px

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SAME_SURFACE: Final = 1e-2
"""Relative difference of 1/z beyond which two renders show different surfaces at a pixel."""

CREASE: Final = 1e-4
"""Relative second difference of 1/z that shows an edge: on a plane 1/z is linear in the image. Rounding gives 1e-6."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthDisagreement:
    """Relative differences of 1/z where both show the same surface, and the number of pixels with another surface."""

    median: float
    p999: float
    largest: float
    other_surface_pixels: int
    flow_largest_px: float
    """Largest difference of the flow between the two poses, where both show the same surface."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadianceDisagreement:
    """Differences of log radiance, nat: root mean square, 99th percentile, largest."""

    rms: float
    p99: float
    largest: float


def depth_disagreement(
    exact_per_m: Floats, other_per_m: Floats, camera: Camera, T_world_camera: Floats, T_world_camera_end: Floats
) -> DepthDisagreement:
    """Compare two inverse depths.

    Parameters
    ----------
    exact_per_m, other_per_m
        (height, width) 1 / z, 1/m, from the same pose.
    camera
        Camera matrix.
    T_world_camera, T_world_camera_end
        (4, 4) poses between which the flow is compared.
    """
    nearest = np.maximum(exact_per_m, other_per_m)
    difference = np.abs(exact_per_m - other_per_m)
    same = (difference <= SAME_SURFACE * nearest) & (nearest > 0)
    relative = difference[same] / nearest[same]
    flows = [flow_px(depth, camera.K, T_world_camera, T_world_camera_end) for depth in (exact_per_m, other_per_m)]
    return DepthDisagreement(
        median=float(np.median(relative)),
        p999=float(np.quantile(relative, 0.999)),
        largest=float(relative.max()),
        other_surface_pixels=int((difference > SAME_SURFACE * nearest).sum()),
        flow_largest_px=float(np.abs(flows[0] - flows[1])[same].max()),
    )


def edges(inverse_depth_per_m: Floats) -> Flags:
    """Pixels (height, width) whose 3 x 3 neighbourhood has an edge of a surface in it."""
    bent = np.zeros(inverse_depth_per_m.shape, dtype=np.bool_)
    for axis in (0, 1):
        second = np.abs(np.diff(inverse_depth_per_m, n=2, axis=axis))
        middle = [slice(None), slice(None)]
        middle[axis] = slice(1, -1)
        bent[tuple(middle)] |= second > CREASE * (inverse_depth_per_m[tuple(middle)] + 1e-6)
    return np.asarray(maximum_filter(bent, size=3))


def radiance_disagreement(exact_dn: Floats, other_dn: Floats, where: Flags) -> RadianceDisagreement:
    """Compare two luminances.

    Parameters
    ----------
    exact_dn, other_dn
        (height, width) DN.
    where
        (height, width) pixels to compare.
    """
    difference = np.abs(np.log(exact_dn[where] / other_dn[where]))
    return RadianceDisagreement(
        rms=float(np.sqrt((difference**2).mean())),
        p99=float(np.quantile(difference, 0.99)),
        largest=float(difference.max()),
    )
