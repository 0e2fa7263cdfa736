"""An OpenGL context without a window: EGL, or OSMesa where there is no EGL."""

import ctypes.util
import functools
import os
from typing import Any, Final

from fedora_generator.errors import GraphicsMissingError

_REMEDY: Final = (
    "install Debian's libegl1 and libgl1-mesa-dri (or libosmesa6), or use a scene with renderer = 'exact', "
    "which needs no graphics"
)

# PyOpenGL's name of the platform, and the library that it loads; the first installed one is used.
_PLATFORMS: Final = (("egl", "EGL"), ("osmesa", "OSMesa"))


@functools.cache
def open_context() -> Any:
    """Open the process's only context and make it current: a ``pyrender.OffscreenRenderer``, which owns it.

    There is only one because closing one ends the display connection of all (``eglTerminate``). PyOpenGL reads its
    platform once, from the environment, when it is first imported; so it is set here.

    Raises
    ------
    GraphicsMissingError
        pyrender, a library or a driver is missing.
    """
    if "PYOPENGL_PLATFORM" not in os.environ:
        platforms = [platform for platform, library in _PLATFORMS if ctypes.util.find_library(library)]
        if not platforms:
            raise GraphicsMissingError(f"Expected OpenGL through libEGL or libOSMesa, got neither; {_REMEDY}")
        os.environ["PYOPENGL_PLATFORM"] = platforms[0]
    try:
        import pyrender  # noqa: PLC0415 - heavy, and absent where only the exact world is used
    except ImportError as error:
        raise GraphicsMissingError(
            f"Expected pyrender for a mesh world, got: {error}; install fedora-qa[generator] or {_REMEDY}"
        ) from error
    try:
        return pyrender.OffscreenRenderer(1, 1)  # its own framebuffer is never used
    except Exception as error:  # whatever a driver raises, it cannot draw
        raise GraphicsMissingError(
            f"Expected an OpenGL context from {os.environ['PYOPENGL_PLATFORM']}, got {type(error).__name__}: {error}; "
            f"{_REMEDY}"
        ) from error
