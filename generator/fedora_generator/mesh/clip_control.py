"""``glClipControl`` (OpenGL 4.5, ARB_clip_control), which PyOpenGL 3.1.0 does not have. Needs a current context."""

import ctypes
from typing import Final

from OpenGL import platform

_GL_LOWER_LEFT: Final = 0x8CA1
_GL_NEGATIVE_ONE_TO_ONE: Final = 0x935E
_GL_ZERO_TO_ONE: Final = 0x935F


def use_depth_from_zero() -> None:
    """Keep the depth of clip space from 0 to 1 as it is, instead of -1 to 1 halved, which rounds small values away.

    Raises
    ------
    RuntimeError
        The driver has no such function.
    """
    _clip_control(_GL_ZERO_TO_ONE)


def use_depth_from_minus_one() -> None:
    """Take back ``use_depth_from_zero``: OpenGL's default, which pyrender's own renderer expects."""
    _clip_control(_GL_NEGATIVE_ONE_TO_ONE)


def _clip_control(depth: int) -> None:
    address = platform.PLATFORM.getExtensionProcedure(b"glClipControl")
    if not address:
        raise RuntimeError("Expected glClipControl (OpenGL 4.5, ARB_clip_control), got a driver without it; update it")
    ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_uint)(address)(_GL_LOWER_LEFT, depth)
