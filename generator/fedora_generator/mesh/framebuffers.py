"""What is drawn into: many samples a pixel, their mean, and depth. Needs a current context."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

SAMPLES: Final = 4
"""Coverage samples a fragment; Mesa's software rasteriser and every card have these."""


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


def _new_framebuffer() -> int:
    name = int(GL.glGenFramebuffers(1))
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, name)
    return name


def _attach_depth(renderbuffer: int) -> None:
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, renderbuffer)
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RuntimeError(f"Expected a complete framebuffer, got status {status:#x}; the driver lacks its format")
