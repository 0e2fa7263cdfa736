"""Worlds of triangles, rendered through OpenGL."""
