"""Meshes and their textures in the memory of OpenGL. Needs a current context."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrender
from numpy.typing import NDArray
from OpenGL import GL

from fedora_generator.mesh.model import TexturedMesh


@dataclass(frozen=True, slots=True)
class UploadedMesh:
    """Buffers of one mesh: a ``pyrender.Primitive`` in the context, and what is set before it is drawn."""

    primitive: Any
    index_count: int
    texture: int
    emission_rgb: NDArray[np.float64]
    two_sided: bool

    def draw(self) -> None:
        """Draw the triangles with the program in use."""
        self.primitive._bind()  # its vertex array has no public name
        GL.glDrawElements(GL.GL_TRIANGLES, self.index_count, GL.GL_UNSIGNED_INT, None)

    def delete(self) -> None:
        """Free the buffers and the texture."""
        self.primitive.delete()
        GL.glDeleteTextures([self.texture])


def upload(mesh: TexturedMesh) -> UploadedMesh:
    """Copy a mesh into the context: positions, normals and texture coordinates at locations 0, 1 and 2."""
    primitive = pyrender.Primitive(
        positions=mesh.vertices_world_m, normals=mesh.normals_world, texcoord_0=mesh.uv, indices=mesh.triangles
    )
    primitive._add_to_context()
    texture = upload_texture(mesh.reflectance_rgb, repeats=mesh.repeats)
    return UploadedMesh(primitive, mesh.triangles.size, texture, np.array(mesh.emission_rgb), mesh.two_sided)


def upload_texture(reflectance_rgb: NDArray[np.float32], *, repeats: bool) -> int:
    """Copy a linear image (h, w, 3) and its mipmaps as half floats, which keep 11 bits at every brightness.

    With 8 bits Mesa would also filter in 8 bits, and smooth motion would turn into steps.
    """
    height, width = reflectance_rgb.shape[:2]
    texture = int(GL.glGenTextures(1))
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    pixels = np.ascontiguousarray(reflectance_rgb, dtype=np.float32)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGB16F, width, height, 0, GL.GL_RGB, GL.GL_FLOAT, pixels)
    GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
    beyond = GL.GL_REPEAT if repeats else GL.GL_CLAMP_TO_EDGE
    settings = {
        GL.GL_TEXTURE_MIN_FILTER: GL.GL_LINEAR_MIPMAP_LINEAR,
        GL.GL_TEXTURE_MAG_FILTER: GL.GL_LINEAR,
        GL.GL_TEXTURE_WRAP_S: beyond,
        GL.GL_TEXTURE_WRAP_T: beyond,
    }
    for name, value in settings.items():
        GL.glTexParameteri(GL.GL_TEXTURE_2D, name, value)
    return texture
