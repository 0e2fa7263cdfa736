"""Reports: HTML pages and drawings from finished records. No module opens a sequence or computes a result.

Read in this order: ``page`` (the values of a report; most imports are sections of it), ``html`` and ``templates`` (the
document that shows them); ``evidence``, ``snapshots``, ``panels`` and ``strip`` (pictures); ``scales``, ``charts`` and
``timeline`` (drawings); ``flight`` and ``trajectory`` (the path). ``trajectory_render`` runs in a process of its own,
because VTK without OpenGL ends its process. ``comparison`` and ``power`` are pages of their own.
"""
