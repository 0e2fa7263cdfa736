"""Access to a file in canonical units: lazy, read-only, timestamps first, by windows.

In order of reading: ``sequence`` opens a file and reads its rows, with its declarations (``declared``), which
``read_declared`` reads. ``scan`` reads all timestamps once and returns ``facts``. A ``window`` is what checks get of a
file; it leases arrays that neighbouring windows share. ``inputs`` notes what was read for a result, and ``stored_step``
is the step to which values were rounded.

``scan`` and the windows use only the members of ``sequence.SequenceRows``, so that they also take a view of a
sequence, such as one with a fault undone. ``open_sequence`` is the only function that opens a file.
"""
