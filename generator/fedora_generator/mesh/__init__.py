"""The mesh world: textured triangles, rendered through OpenGL.

Read ``README.md`` first, then

* ``model``: a world of triangles, with options of precision and antialiasing.
* ``places``: a park and a racetrack, each described in a file; ``from_world``: the exact world as triangles.
* ``world``: the images of the sensors.
* ``rasteriser``: how an image is drawn.
* ``context``, ``opengl``, ``shaders``: the OpenGL context and the objects in it.
"""
