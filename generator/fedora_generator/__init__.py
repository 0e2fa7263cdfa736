"""The reference generator: FEDORA-format sequences whose truth is known.

Read in this order:

1. ``scene`` (with ``scene_tables``): what a sequence is made from, read from the TOML files of
   ``scenes/``.
2. ``flight`` (``flights/``) with ``rotations``: the trajectory in closed form; ``camera``, ``imu``: the sensors on it.
3. ``rendered_world``: what sensors need of a world. ``render`` (``surfaces/``) casts rays in float64, ``mesh/`` draws
   through OpenGL; ``surroundings`` chooses between them. ``threads`` run the loops.
4. ``generate``: the walk over time that writes the file, at the timestamps of ``rates``. ``streams`` (with ``flow``)
   and ``events/`` make its streams; ``write`` writes datasets and declarations. ``sampling`` and ``adaptive/`` choose
   when events are rendered.
5. ``resources``, ``partial_file``: refusals before any work, and a file that is complete or absent.
6. ``faults/`` changes a copy of a file so that it is wrong; ``corpus/`` makes many clean and faulty files.
7. ``cli`` and ``commands``: the command line; ``choices`` of a request; ``sequence`` does the work of its command.
"""
