"""The exact world: planar faces with closed-form textures, projected by a pinhole camera in float64.

Read ``README.md`` first, then

* ``world``, ``textures``, ``light``: the world as options that are read from TOML.
* ``faces``: the same as arrays of faces, and lines of the image for each face and camera pose.
* ``visibility_kernels``, ``pixel_kernels``: which faces a tile or a pixel shows, and how a pixel is cut between them.
* ``texture_kernels``, ``shading_kernels``: the radiance of a face over a footprint.
* ``render_kernels``: the loops over tiles and pixels.
"""
