"""Frusta of a camera along the path: the rays through the corners of its image, where the poses place it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.record.evidence import FRUSTA, FRUSTUM_CAMERAS, named
from fedora_qa.sequence.declared import Camera

Float64 = NDArray[np.float64]


def frusta_of(
    cameras: Mapping[str, Camera], times_us: Float64, positions_m: Float64, R_world_body: Float64
) -> dict[str, tuple[NDArray[Any], str]]:
    """Return the frusta of the first pinhole camera as arrays with titles.

    Parameters
    ----------
    cameras
        As declared, by stream.
    times_us
        (n,), on the file's clock.
    positions_m
        (n, 3) of the body in the world.
    R_world_body
        (n, 3, 3).

    Returns
    -------
    dict
        Centres of projection (n, 3), and rays (n, 4, 3) through the corners of the image: top left, top right, bottom
        right, bottom left, of length 1 along the optical axis, axes of the world. Empty where no pinhole camera is
        declared, or its lens images no ray at a corner.
    """
    for stream in FRUSTUM_CAMERAS:
        camera = cameras.get(stream)
        if camera is None or camera.model != "pinhole":
            continue
        # Integer coordinates are pixel centres: the image ends half a pixel beyond them.
        right, bottom = camera.width - 0.5, camera.height - 0.5
        with np.errstate(all="ignore"):
            x, y = rays_of_pixels(
                camera.K, camera.lens, np.array([-0.5, right, right, -0.5]), np.array([-0.5, -0.5, bottom, bottom])
            )
            # p_world = R_world_body T_body_camera p_camera + position; a direction is only turned.
            in_body = np.column_stack([x, y, np.ones(4)]) @ camera.T_body_camera[:3, :3].T
            rays = np.einsum("nij,kj->nki", R_world_body, in_body)
            centres_m = R_world_body @ camera.T_body_camera[:3, 3] + positions_m
        if not (np.isfinite(rays).all() and np.isfinite(centres_m).all()):
            continue
        return {
            named(FRUSTA, stream, "times_us"): (times_us, "Instants of the frusta, us on the file's clock"),
            named(FRUSTA, stream, "centres_world_m"): (
                centres_m,
                f"Centres of projection of the camera of {stream} in the world, m (east, north, up)",
            ),
            named(FRUSTA, stream, "rays_world"): (
                rays,
                f"Rays through the corners of the images of {stream}, of length 1 along the optical axis, in the world",
            ),
        }
    return {}
