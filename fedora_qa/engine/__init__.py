"""Run the checks over files: timestamps first, fixed windows, one measuring pass, one bounded follow-up.

In order of reading: ``options`` is how a file is checked. ``plan`` cuts a sequence into windows and chooses some;
``survey`` is what is known of a file before they are measured; ``decode`` gives windows their rows; ``measure`` hands
windows to checks and merges their states; ``assemble`` makes the record of a file from them, with ``outcomes``.
``progress`` is reported throughout.

``trials`` measure a file again with a fault planted or undone. ``tasks`` does all of that for one file, in this
process or in parts for others. ``executors`` do tasks, which they name without loading them. ``file_work`` is one
file on its way through tasks, ``files`` deals out the tasks of several files, ``budget`` within a limit of time.
Processes are forked from one that imported ``preload``, the checks, and ``preloaded``. ``compilation`` compiles loops
before they are needed.
"""
