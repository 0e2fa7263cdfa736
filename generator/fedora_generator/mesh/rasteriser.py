"""Draws meshes that may be in view: linear radiance averaged over pixels, and inverse depth.

Radiance: ``factor`` x ``factor`` fragments a pixel, each shaded once and covered by four samples, averaged in linear
light. Depth: one sample at each pixel's centre, from a depth buffer that holds ``near_m / z`` in float32.
"""

import weakref
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from fedora_generator.camera import Camera
from fedora_generator.mesh.context import open_context
from fedora_generator.mesh.model import GAMMA, MeshDetail, MeshModel, TexturedMesh
from fedora_generator.mesh.opengl import (
    SAMPLES,
    FloatFramebuffer,
    Program,
    SampledFramebuffer,
    UploadedMesh,
    upload,
    use_depth_from_zero,
)
from fedora_generator.surfaces.light import Light

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BoundingSpheres:
    """Spheres that enclose n meshes: centres (n, 3) in the world and radii (n,), metres."""

    centers_world_m: Floats
    radii_m: Floats

    @classmethod
    def of(cls, meshes: tuple[TexturedMesh, ...]) -> "BoundingSpheres":
        """Spheres around the middle of each mesh's extent."""
        extents = [(mesh.vertices_world_m.min(axis=0), mesh.vertices_world_m.max(axis=0)) for mesh in meshes]
        centers_m = np.array([0.5 * (low + high) for low, high in extents]).reshape(-1, 3)
        farthest_m = [
            np.linalg.norm(mesh.vertices_world_m - center_m, axis=1).max()
            for mesh, center_m in zip(meshes, centers_m, strict=True)
        ]
        return cls(centers_m, np.array(farthest_m))

    def may_be_visible(self, camera: Camera, T_world_camera: Floats) -> NDArray[np.bool_]:
        """Whether any point of each sphere may lie in the image.

        Parameters
        ----------
        camera
            Camera matrix and size of the image.
        T_world_camera
            (4, 4) pose of the camera.

        Returns
        -------
        visible
            (n,) never false for a sphere that has a point in the image.
        """
        # Inward unit normals (5, 3), optical frame, of the planes through the centre and the borders, and of z = 0.
        K = camera.K
        left, top = (-0.5 - K[0, 2]) / K[0, 0], (-0.5 - K[1, 2]) / K[1, 1]
        right, bottom = (camera.width - 0.5 - K[0, 2]) / K[0, 0], (camera.height - 0.5 - K[1, 2]) / K[1, 1]
        normals = np.array([[1, 0, -left], [-1, 0, right], [0, 1, -top], [0, -1, bottom], [0, 0, 1]])
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        centers_camera_m = (self.centers_world_m - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
        heights_m = centers_camera_m @ normals.T
        return np.asarray((heights_m >= -self.radii_m[:, None]).all(axis=1))


NEAR_M: Final = 0.05
"""Near plane: half of the nearest valid depth, so that a surface at that depth is drawn, not clipped."""

MOST_FRAGMENTS: Final = 2_000_000
"""Fragments drawn at once, 20 bytes a sample: larger images are drawn in bands of rows."""


class Rasteriser:
    """A model under a light in the memory of OpenGL. A single thread may use it.

    Parameters
    ----------
    model
        Meshes and lamps.
    light
        Sun, sky and the strength of the lamps.
    detail
        Precision; the number of fragments is an argument of ``radiance``.
    """

    def __init__(self, model: MeshModel, light: Light, detail: MeshDetail) -> None:
        self._context = open_context()
        self._gamma = GAMMA if detail.precision == "8bit" else 1.0
        self._format = GL.GL_RGBA8 if detail.precision == "8bit" else GL.GL_RGBA32F
        self._spheres = BoundingSpheres.of(model.meshes)
        self._meshes = [upload(mesh) for mesh in model.meshes]
        lamps = [lamp for lamp in model.lamps if lamp.strength * light.lamp_scale > 0]
        constants = {"LAMPS": max(len(lamps), 1), "LAMP_COUNT": len(lamps)}
        self._surface = Program("surface.vert", "surface.frag", constants)
        self._sky = Program("sky.vert", "sky.frag")
        self._average = Program("average.vert", "average.frag", {"SAMPLES": SAMPLES})
        self._depth = Program("surface.vert", "depth.frag")
        self._no_vertices = int(GL.glGenVertexArrays(1))
        weakref.finalize(self, _release, self._meshes).atexit = False
        self._fine: dict[tuple[int, int], SampledFramebuffer] = {}
        self._images: dict[tuple[int, int], FloatFramebuffer] = {}

        # The light stays the same for all images.
        self._surface.use()
        self._surface.set("ambient", light.ambient)
        self._surface.set("sun", light.sun_strength * light.to_sun)
        self._surface.set("lamp_radius_m", light.lamp_radius_m)
        self._surface.set("gamma", self._gamma)
        if lamps:
            table = [(*lamp.position_m, lamp.strength * light.lamp_scale) for lamp in lamps]
            self._surface.set("lamps", np.array(table))
        self._sky.use()
        self._sky.set("horizon", np.array(light.sky_horizon_rgb))
        self._sky.set("zenith", np.array(light.sky_zenith_rgb))
        self._sky.set("gamma", self._gamma)
        self._average.use()
        self._average.set("gamma", self._gamma)

    def radiance(self, camera: Camera, T_world_camera: Floats, factor: int) -> Floats:
        """Linear radiance averaged over each pixel: (height, width, 3); 1 is white.

        Parameters
        ----------
        camera
            Camera matrix and size of the image.
        T_world_camera
            (4, 4) pose of the camera.
        factor
            Fragments along each side of a pixel.
        """
        mean = self._image_of(camera)
        rows = max(1, MOST_FRAGMENTS // (camera.width * factor**2))
        size = (camera.width * factor, min(rows, camera.height) * factor)
        if size not in self._fine:
            self._fine[size] = SampledFramebuffer(*size, self._format)
        fine = self._fine[size]
        fx, fy, cx, cy = _pinhole(camera)
        device_rays = np.array([[1 / fx, 0.0, -cx / fx], [0.0, 1 / fy, -cy / fy], [0.0, 0.0, 1.0]])
        for first_row in range(0, camera.height, rows):
            fine.bind()
            # The viewport of the whole image, shifted so that the band lies in the framebuffer.
            GL.glViewport(0, -first_row * factor, camera.width * factor, camera.height * factor)
            self._sky.use()
            self._sky.set("rays", T_world_camera[:3, :3] @ device_rays)
            self._draw_everywhere()
            self._draw_meshes(self._surface, camera, T_world_camera)

            # The mean of the fragments of each pixel, in the band's rows of the image.
            band_rows = min(rows, camera.height - first_row)
            mean.bind()
            GL.glViewport(0, 0, camera.width, first_row + band_rows)
            GL.glScissor(0, first_row, camera.width, band_rows)
            GL.glEnable(GL.GL_SCISSOR_TEST)
            GL.glBindTexture(GL.GL_TEXTURE_2D_MULTISAMPLE, fine.texture)
            self._average.use()
            self._average.set_integer("factor", factor)
            self._average.set_integer("first_row", first_row)
            self._draw_everywhere()
            GL.glDisable(GL.GL_SCISSOR_TEST)
        return mean.read_rgb()

    def inverse_depth_per_m(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Inverse depth along the optical axis: (height, width) 1 / z at the pixel centres, 1/m; 0 for the sky.

        Parameters
        ----------
        camera
            Camera matrix and size of the image.
        T_world_camera
            (4, 4) pose of the camera.
        """
        target = self._image_of(camera)
        target.bind()
        GL.glViewport(0, 0, camera.width, camera.height)
        self._draw_meshes(self._depth, camera, T_world_camera)
        return target.read_depth() / NEAR_M

    def _draw_everywhere(self) -> None:
        """Run the program in use on every pixel."""
        for test in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glDisable(test)
        GL.glBindVertexArray(self._no_vertices)
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)

    def _draw_meshes(self, program: Program, camera: Camera, T_world_camera: Floats) -> None:
        """Clear the depth and draw what is nearest at each sample."""
        use_depth_from_zero()
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthFunc(GL.GL_GREATER)
        GL.glClearDepth(0.0)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        GL.glFrontFace(GL.GL_CW)  # counter-clockwise as seen with the rows counted upwards
        program.use()
        program.set("R_camera_world", T_world_camera[:3, :3].T)
        program.set("camera_m", T_world_camera[:3, 3])
        program.set("pinhole", np.array(_pinhole(camera)))
        program.set("near_m", NEAR_M)
        for index in np.flatnonzero(self._spheres.may_be_visible(camera, T_world_camera)):
            mesh = self._meshes[index]
            (GL.glDisable if mesh.two_sided else GL.glEnable)(GL.GL_CULL_FACE)
            GL.glBindTexture(GL.GL_TEXTURE_2D, mesh.texture)
            program.set("emission", mesh.emission_rgb)
            mesh.draw()

    def _image_of(self, camera: Camera) -> FloatFramebuffer:
        size = (camera.width, camera.height)
        if size not in self._images:
            self._images[size] = FloatFramebuffer(*size)
        return self._images[size]


def _release(meshes: list[UploadedMesh]) -> None:
    """Free the meshes, which take the most memory; the process frees the rest when it ends."""
    for mesh in meshes:
        mesh.delete()


def _pinhole(camera: Camera) -> tuple[float, float, float, float]:
    """Focal lengths and principal point in normalised device coordinates, -1 to 1 across the image.

    OpenGL has pixel centres at half-integers, the file at integers: hence the 1/2.
    """
    K = camera.K
    cx, cy = 2 * (K[0, 2] + 0.5) / camera.width - 1, 2 * (K[1, 2] + 0.5) / camera.height - 1
    return float(2 * K[0, 0] / camera.width), float(2 * K[1, 1] / camera.height), float(cx), float(cy)
