"""The mesh world: textured triangles, rendered through OpenGL.

Read ``README.md`` first, then

* ``model``: a world of triangles.
* ``places``: a park and a racetrack, each described in a file; ``from_world``: the exact world as triangles.
* ``world``, ``detail``: the images of the sensors, and options of precision and antialiasing.
* ``rasteriser``, ``frustum``: how an image is drawn.
* ``context``, ``opengl``, ``shaders``: the OpenGL context and the objects in it.
"""
