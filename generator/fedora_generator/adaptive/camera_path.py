"""The path of the camera over a short time, as polynomials that differ from the flight by rounding.

Compiled code needs poses at millions of instants, and a flight is evaluated in Python. Its motion is smooth, so a few
Chebyshev polynomials represent it; where they do not, the time is halved. A moving body looks like a body at rest from
a camera that moves the other way, so that every body has its own place of the camera.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.projection import pixel_rays
from fedora_qa.conventions import NS_PER_S

Floats = NDArray[np.float64]

RAY_ENTRIES: Final = 9
"""A row of coefficients holds the matrix of rays (3, 3), row by row, then for each body the camera's place (3,)."""

NODES: Final = 16
ROUNDING: Final = 1e-13
"""Coefficients that are smaller than this share of their vector (a column of the rays, a place) are left out.

Of the vector, not of their own entry: one that crosses zero is rounded as its neighbours are, and the phase of a swing
of half a radian minutes after its start, thousands of radians on, is known to 1e-13.
"""
SHORTEST_NS: Final = 1_000

_NODES: Final = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_COEFFICIENTS: Final = (
    2 / NODES * chebyshev.chebvander(_NODES, NODES - 1).T * np.where(np.arange(NODES), 1, 0.5)[:, None]
)


@dataclass(frozen=True, slots=True)
class CameraPath:
    """Rays and places of a camera from ``start_ns`` to ``stop_ns`` of the flight's clock."""

    start_ns: int
    stop_ns: int
    coefficients: Floats
    """(terms, 9 + 3 bodies) of Chebyshev polynomials of -1 (start) to 1 (stop)"""

    def at(self, share: float) -> tuple[Floats, Floats]:
        """Rays (3, 3), which take (column, row, 1) to world directions of optical z = 1, and places (bodies, 3), m.

        A place is the camera's, less the body's displacement. ``share`` is 0 at the start and 1 at the end.
        """
        row = np.asarray(chebyshev.chebval(2 * share - 1, self.coefficients))
        return row[:RAY_ENTRIES].reshape(3, 3), row[RAY_ENTRIES:].reshape(-1, 3)


def camera_paths(world: ExactWorld, camera: Camera, flight: Flight, start_ns: int, stop_ns: int) -> list[CameraPath]:
    """Paths past the bodies of a world, each short enough for its polynomials.

    Parameters
    ----------
    world
        Its bodies and their movements.
    camera
        Its intrinsics and mounting.
    flight
        The trajectory of the body.
    start_ns, stop_ns
        Ends of the time, ns of the flight's clock.

    Returns
    -------
    paths
        One after the other from start to stop.

    Raises
    ------
    SceneError
        The camera shakes faster than any polynomial over a microsecond.
    """
    middle_s, half_s = (start_ns + stop_ns) / 2 / NS_PER_S, (stop_ns - start_ns) / 2 / NS_PER_S
    times_s = middle_s + half_s * _NODES
    poses = camera.poses_between(flight, times_s)
    rays = np.array([pixel_rays(camera.K, pose).ravel() for pose in poses])
    places_m = [poses[:, :3, 3] - world.displacement_m(body, times_s) for body in range(1 + len(world.movements))]
    rows = np.concatenate([rays, *places_m], axis=1)
    coefficients = _TO_COEFFICIENTS @ rows
    lengths = [np.tile(np.linalg.norm(rays.reshape(-1, 3, 3), axis=1), 3)]
    lengths += [np.repeat(np.linalg.norm(place_m, axis=1)[:, None], 3, axis=1) for place_m in places_m]
    scales = np.concatenate(lengths, axis=1).max(axis=0)
    needed = np.flatnonzero((np.abs(coefficients) > ROUNDING * np.maximum(scales, 1e-3)).any(axis=1))
    terms = int(needed[-1]) + 1 if needed.size else 1
    if terms <= NODES - 2:  # the last two are nothing but rounding: so is all that is missing
        return [CameraPath(start_ns, stop_ns, coefficients[:terms])]
    if stop_ns - start_ns < SHORTEST_NS:
        raise SceneError(f"Expected a flight that moves smoothly, got a turn within a microsecond at {middle_s:g} s")
    middle_ns = (start_ns + stop_ns) // 2
    halves = ((start_ns, middle_ns), (middle_ns, stop_ns))
    return [path for half in halves for path in camera_paths(world, camera, flight, *half)]
