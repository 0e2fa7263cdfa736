"""What the rasteriser keeps in OpenGL: framebuffers, shader programs, meshes. Needs a current context."""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyrender
from numpy.typing import NDArray
from OpenGL import GL, platform
from OpenGL.GL import shaders

from fedora_generator.mesh.model import TexturedMesh

SAMPLES: Final = 4
"""Coverage samples a fragment; Mesa's software rasteriser and every card have these."""

_SHADERS: Final = Path(__file__).parent / "shaders"
_VERSION: Final = "#version 330 core\n"

_SET_VECTOR: Final = {1: GL.glUniform1fv, 3: GL.glUniform3fv, 4: GL.glUniform4fv}

# Constants of glClipControl (OpenGL 4.5, ARB_clip_control), which PyOpenGL 3.1.0 does not have.
_GL_LOWER_LEFT: Final = 0x8CA1
_GL_NEGATIVE_ONE_TO_ONE: Final = 0x935E
_GL_ZERO_TO_ONE: Final = 0x935F


class SampledFramebuffer:
    """Colour and depth with ``SAMPLES`` samples a fragment; its colour can be read as a texture."""

    def __init__(self, width: int, height: int, colour_format: int) -> None:
        self.width, self.height = width, height
        self.texture = int(GL.glGenTextures(1))
        GL.glBindTexture(GL.GL_TEXTURE_2D_MULTISAMPLE, self.texture)
        GL.glTexImage2DMultisample(GL.GL_TEXTURE_2D_MULTISAMPLE, SAMPLES, colour_format, width, height, GL.GL_TRUE)
        self._depth = int(GL.glGenRenderbuffers(1))
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, self._depth)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, SAMPLES, GL.GL_DEPTH_COMPONENT32F, width, height)
        self._id = _new_framebuffer()
        GL.glFramebufferTexture2D(
            GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_TEXTURE_2D_MULTISAMPLE, self.texture, 0
        )
        _attach_depth(self._depth)

    def bind(self) -> None:
        """Draw into this from now on."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._id)


class FloatFramebuffer:
    """Float colour and depth, one sample at each pixel's centre."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._colour, self._depth = (int(name) for name in GL.glGenRenderbuffers(2))
        for name, layout in ((self._colour, GL.GL_RGBA32F), (self._depth, GL.GL_DEPTH_COMPONENT32F)):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, name)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, layout, width, height)
        self._id = _new_framebuffer()
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_RENDERBUFFER, self._colour)
        _attach_depth(self._depth)

    def bind(self) -> None:
        """Draw into this from now on."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._id)

    def read_rgb(self) -> NDArray[np.float64]:
        """Colour (height, width, 3)."""
        return self._read(GL.GL_RGB, 3).astype(np.float64)

    def read_depth(self) -> NDArray[np.float64]:
        """Value of the depth buffer (height, width), 0 to 1."""
        return self._read(GL.GL_DEPTH_COMPONENT, 1)[..., 0].astype(np.float64)

    def _read(self, what: Any, channels: int) -> NDArray[np.float32]:
        self.bind()
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        values = np.empty((self.height, self.width, channels), dtype=np.float32)
        GL.glReadPixels(0, 0, self.width, self.height, what, GL.GL_FLOAT, values)
        return values


class Program:
    """A vertex and a fragment shader of the folder ``shaders``, compiled with integer ``constants``."""

    def __init__(self, vertex: str, fragment: str, constants: Mapping[str, int] | None = None) -> None:
        defines = "".join(f"#define {name} {value}\n" for name, value in (constants or {}).items())
        stages = ((vertex, GL.GL_VERTEX_SHADER), (fragment, GL.GL_FRAGMENT_SHADER))
        compiled = [
            shaders.compileShader(_VERSION + defines + (_SHADERS / name).read_text(encoding="utf-8"), stage)
            for name, stage in stages
        ]
        self._id = GL.glCreateProgram()
        for shader in compiled:
            GL.glAttachShader(self._id, shader)
        GL.glLinkProgram(self._id)
        if not GL.glGetProgramiv(self._id, GL.GL_LINK_STATUS):
            raise RuntimeError(f"Expected {vertex} and {fragment} to link, got: {GL.glGetProgramInfoLog(self._id)!r}")
        for shader in compiled:
            GL.glDeleteShader(shader)
        self._locations: dict[str, int] = {}

    def use(self) -> None:
        """Draw with this program from now on."""
        GL.glUseProgram(self._id)

    def set(self, name: str, value: float | NDArray[Any]) -> None:
        """Set a uniform of the program in use.

        Parameters
        ----------
        value
            A float, a vector (3,) or (4,), vectors (n, 4), or a matrix (3, 3).
        """
        values = np.ascontiguousarray(value, dtype=np.float32)
        if values.shape == (3, 3):
            GL.glUniformMatrix3fv(self._location(name), 1, GL.GL_TRUE, values)
        elif values.ndim == 2:
            _SET_VECTOR[values.shape[1]](self._location(name), len(values), values)
        else:
            _SET_VECTOR[values.size](self._location(name), 1, values)

    def set_integer(self, name: str, value: int) -> None:
        """Set an integer of the program in use: a count, or the unit of a texture."""
        GL.glUniform1i(self._location(name), value)

    def _location(self, name: str) -> int:
        """Location of a uniform; -1, which OpenGL ignores, if the shaders do not use it."""
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._id, name)
        return self._locations[name]


@dataclass(frozen=True, slots=True)
class UploadedMesh:
    """A mesh in OpenGL: a ``pyrender.Primitive`` with its buffers, its texture, and its settings when it is drawn."""

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
    # The texture and its mipmaps as half floats, which keep 11 bits at every brightness. With 8 bits Mesa also filters
    # in 8 bits, and smooth motion turns into steps.
    height, width = mesh.reflectance_rgb.shape[:2]
    texture = int(GL.glGenTextures(1))
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    pixels = np.ascontiguousarray(mesh.reflectance_rgb, dtype=np.float32)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGB16F, width, height, 0, GL.GL_RGB, GL.GL_FLOAT, pixels)
    GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
    wrap = GL.GL_REPEAT if mesh.repeats else GL.GL_CLAMP_TO_EDGE
    settings = {
        GL.GL_TEXTURE_MIN_FILTER: GL.GL_LINEAR_MIPMAP_LINEAR,
        GL.GL_TEXTURE_MAG_FILTER: GL.GL_LINEAR,
        GL.GL_TEXTURE_WRAP_S: wrap,
        GL.GL_TEXTURE_WRAP_T: wrap,
    }
    for name, value in settings.items():
        GL.glTexParameteri(GL.GL_TEXTURE_2D, name, value)
    return UploadedMesh(primitive, mesh.triangles.size, texture, np.array(mesh.emission_rgb), mesh.two_sided)


def use_depth_from_zero() -> None:
    """Take the depth of clip space from 0 to 1 as it is. OpenGL's default, -1 to 1 halved, rounds small values away.

    Raises
    ------
    RuntimeError
        The driver has no such function.
    """
    _clip_control(_GL_ZERO_TO_ONE)


def use_depth_from_minus_one() -> None:
    """Take the depth of clip space from -1 to 1: OpenGL's default, which pyrender's own renderer expects."""
    _clip_control(_GL_NEGATIVE_ONE_TO_ONE)


def _new_framebuffer() -> int:
    name = int(GL.glGenFramebuffers(1))
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, name)
    return name


def _attach_depth(renderbuffer: int) -> None:
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, renderbuffer)
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RuntimeError(f"Expected a complete framebuffer, got status {status:#x}; the driver lacks its format")


def _clip_control(depth: int) -> None:
    address = platform.PLATFORM.getExtensionProcedure(b"glClipControl")
    if not address:
        raise RuntimeError("Expected glClipControl (OpenGL 4.5, ARB_clip_control), got a driver without it; update it")
    ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_uint)(address)(_GL_LOWER_LEFT, depth)
