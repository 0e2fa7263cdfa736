"""The reference generator: FEDORA-format sequences whose truth is known.

Read in this order:

1. ``scene`` (with ``scene_tables``): what a sequence is made from, read from the TOML files of
   ``scenes/``.
2. ``flight`` (``flights/``), ``camera``, ``imu``, ``pose``: the trajectory in closed form, and the sensors on it.
3. ``rendered_world``: what sensors need of a world. ``render`` (``surfaces/``) casts rays in float64, ``mesh/`` draws
   through OpenGL; ``surroundings`` chooses between them.
4. ``generate``: the walk over time that writes the file. ``frames``, ``inertial_streams`` and ``events/`` write its
   streams, ``metadata`` what the file declares. ``sampling`` and ``adaptive/`` choose when events are rendered.
5. ``memory``, ``disk_space``, ``partial_file``: refusals before any work, and a file that is complete or absent.
6. ``faults/`` changes a copy of a file so that it is wrong; ``corpus/`` makes many clean and faulty files.
7. ``cli`` and ``commands``: the command line; ``arguments`` and ``choices`` of a request; ``sequence`` does the work of
   its command.
"""
