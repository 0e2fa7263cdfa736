"""Light on Lambert surfaces: ambient, one sun, point lamps; no cast shadows.

The light of a mover is constant: it never turns, and a scene with movers has no lit lamps (``scene.py``).

Irradiance is relative: a white surface under irradiance 1 has radiance ``WHITE_DN``.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.faces import Faces
from fedora_generator.surfaces.textures import Rgb
from fedora_generator.surfaces.world import Lamp

WHITE_DN: Final = 255.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """The light of a scene. ``lamp_scale`` multiplies the world's lamps; 0 switches them off.

    ``sun_azimuth_deg`` is counter-clockwise from east (X). The sky goes from horizon to zenith with the sine of the
    elevation, linear colours of 0 to 1.
    """

    name: str
    ambient: float
    sun_strength: float = 0.0
    sun_azimuth_deg: float = 0.0
    sun_elevation_deg: float = 45.0
    lamp_scale: float = 0.0
    lamp_radius_m: float = 0.3
    sky_horizon_rgb: Rgb
    sky_zenith_rgb: Rgb

    def __post_init__(self) -> None:
        if not self.ambient > 0:
            raise ValueError(f"Expected ambient > 0, got {self.ambient}; black surfaces have no logarithm")
        if min(self.sun_strength, self.lamp_scale) < 0:
            raise ValueError("Expected sun_strength and lamp_scale >= 0, got a negative one")
        if not self.lamp_radius_m > 0:
            raise ValueError(f"Expected lamp_radius_m > 0, got {self.lamp_radius_m}")
        if not all(0 < value <= 1 for value in (*self.sky_horizon_rgb, *self.sky_zenith_rgb)):
            raise ValueError("Expected sky colours above 0 and up to 1")

    @property
    def to_sun(self) -> NDArray[np.float64]:
        """Unit vector (3,) towards the sun, in the world frame."""
        azimuth, elevation = math.radians(self.sun_azimuth_deg), math.radians(self.sun_elevation_deg)
        flat = math.cos(elevation)
        return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def even_irradiance(light: Light, faces: Faces) -> NDArray[np.float64]:
    """Irradiance (n,) that is constant over a face: ambient, and the sun by Lambert's cosine."""
    return light.ambient + light.sun_strength * np.maximum(faces.normals @ light.to_sun, 0.0)


def lamps_over_faces(light: Light, lamps: tuple[Lamp, ...], faces: Faces) -> NDArray[np.float64]:
    """Lamps in the coordinates of every face.

    At distance r from its foot, a lamp of strength I at height h over the plane gives the irradiance
    I h / (r^2 + h^2 + radius^2)^(3/2). This is the cosine law and the inverse square, softened so that a surface beside
    the lamp stays finite.

    Parameters
    ----------
    lamps
        Of the world; those of no strength under this light are left out.
    faces
        n faces in the world frame.

    Returns
    -------
    table
        (n, lamps, 4): u and v (m), squared softened height h^2 + radius^2 (m^2), weight I h, 0 if the lamp is behind.
    """
    lit = [lamp for lamp in lamps if lamp.strength * light.lamp_scale > 0]
    table = np.empty((len(faces.textures), len(lit), 4))
    for column, lamp in enumerate(lit):
        offsets_m = np.array(lamp.position_m) - faces.centers_m
        heights_m = np.einsum("ni,ni->n", offsets_m, faces.normals)
        table[:, column, 0] = np.einsum("ni,ni->n", offsets_m, faces.u_axes)
        table[:, column, 1] = np.einsum("ni,ni->n", offsets_m, faces.v_axes)
        table[:, column, 2] = heights_m**2 + light.lamp_radius_m**2
        table[:, column, 3] = light.lamp_scale * lamp.strength * np.maximum(heights_m, 0.0)
    return table
