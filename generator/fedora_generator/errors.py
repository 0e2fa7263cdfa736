"""The family of errors of the generator.

::

    GeneratorError              what the user should read as one sentence (exit code 2)
    ├── SceneError              the scene, or what is asked of it, cannot be generated
    ├── GraphicsMissingError    a mesh world was asked for where nothing can draw it
    └── OutputError             the target cannot be written
"""


class GeneratorError(Exception):
    """Base of every error with a message meant for people."""


class SceneError(GeneratorError, ValueError):
    """The scene's description is wrong, or what is asked of it cannot be generated."""


class GraphicsMissingError(GeneratorError, RuntimeError):
    """Neither EGL nor OSMesa gives an OpenGL context, or the packages that use them are not installed."""


class OutputError(GeneratorError, OSError):
    """The target exists already or cannot be written."""
