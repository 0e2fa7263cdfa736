"""Run the checks over files: timestamps first, fixed windows, one measuring pass, one bounded follow-up.

In order of reading: ``plan`` cuts a sequence into windows and chooses some; ``survey`` is what is known of a file
before they are measured; ``decode`` gives windows their rows; ``measure`` hands windows to checks and merges their
states; ``assemble`` makes the record of a file from them, with ``outcomes`` and ``canaries``. ``run`` does all of that
for one file in this process.

``tasks`` are the same steps for other processes, which ``task_functions`` names without loading them. An ``executor``
does tasks: in this process, in ``processes`` of this machine, or on a ``cluster``; a ``worker`` keeps its file open
between them. ``file_work`` is one file on its way
through tasks, ``files`` deals out the tasks of several files, ``budget`` within a limit of time.
"""
