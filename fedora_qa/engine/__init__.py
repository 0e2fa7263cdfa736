"""Run the checks over files: timestamps first, fixed windows, one measuring pass, one bounded follow-up.

In order of reading: ``options`` is how a file is checked. ``plan`` cuts a sequence into windows and chooses some;
``survey`` is what is known of a file before they are measured; ``decode`` gives windows their rows; ``measure`` hands
windows to checks and merges their states; ``assemble`` makes the record of a file from them, with ``outcomes``.
``progress`` is reported throughout.

After that a file may be measured again in ``views`` of it (``altered``): ``canaries`` test the checks, and ``trials``
with ``trial_evidence`` the causes, which ``cause_explanation`` and ``composite_faults`` name.

``tasks`` does all of that for one file, in this process or in parts for others. An ``executor`` does tasks, which it
names without loading them: in this process, in ``processes`` of this machine, or on a ``cluster``. ``file_work`` is one
file on its way through tasks, ``files`` deals out the tasks of several files, ``budget`` within a limit of time.
Processes come from the ``fork_server``, which imports ``preload``, the checks, and ``preloaded``. ``kernels`` compiles
loops before they are needed, and ``kernel_groups`` lists them.
"""
