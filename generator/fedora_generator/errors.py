"""The family of errors of the generator.

::

    GeneratorError              an error in one sentence for the user (exit code 2)
    ├── SceneError              the scene, or a request for it, cannot be generated
    ├── GraphicsMissingError    a mesh world is requested where nothing can draw it
    └── OutputError             the target cannot be written
"""


class GeneratorError(Exception):
    """Base of every error with a message for the user."""


class SceneError(GeneratorError, ValueError):
    """The scene's description is wrong, or the request cannot be generated."""


class GraphicsMissingError(GeneratorError, RuntimeError):
    """Neither EGL nor OSMesa gives an OpenGL context, or the packages that use them are not installed."""


class OutputError(GeneratorError, OSError):
    """The target exists already or cannot be written."""
