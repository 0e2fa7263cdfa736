"""Compiled shaders and their uniforms. Needs a current OpenGL context."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from OpenGL.GL import shaders

_SHADERS: Final = Path(__file__).parent / "shaders"
_VERSION: Final = "#version 330 core\n"

_SET_VECTOR: Final = {1: GL.glUniform1fv, 3: GL.glUniform3fv, 4: GL.glUniform4fv}


class Program:
    """A vertex and a fragment shader of the folder ``shaders``, with whole numbers put in for their constants."""

    def __init__(self, vertex: str, fragment: str, constants: Mapping[str, int] | None = None) -> None:
        defines = "".join(f"#define {name} {value}\n" for name, value in (constants or {}).items())
        stages = ((vertex, GL.GL_VERTEX_SHADER), (fragment, GL.GL_FRAGMENT_SHADER))
        compiled = [shaders.compileShader(_VERSION + defines + _source(name), stage) for name, stage in stages]
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
        """Set a float, a vector (3,) or (4,), vectors (n, 4), or a matrix (3, 3) of the program in use."""
        values = np.ascontiguousarray(value, dtype=np.float32)
        if values.shape == (3, 3):
            GL.glUniformMatrix3fv(self._location(name), 1, GL.GL_TRUE, values)
        elif values.ndim == 2:
            _SET_VECTOR[values.shape[1]](self._location(name), len(values), values)
        else:
            _SET_VECTOR[values.size](self._location(name), 1, values)

    def set_whole(self, name: str, value: int) -> None:
        """Set a whole number of the program in use: a count, or the unit of a texture."""
        GL.glUniform1i(self._location(name), value)

    def _location(self, name: str) -> int:
        """Place of a uniform; -1, which OpenGL ignores, where the compiler found it unused."""
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._id, name)
        return self._locations[name]


def _source(name: str) -> str:
    return (_SHADERS / name).read_text(encoding="utf-8")
