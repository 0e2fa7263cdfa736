"""Reports: HTML pages and drawings from finished records. No module opens a sequence or computes a result.

Read in this order: ``page`` (the values of a report; most imports are sections of it), and ``html`` with ``templates``
(the document that shows them) and ``anchors`` (its places). Sections are ``problems`` with ``trials``, ``subjects``
with ``maps``, ``statistics`` and ``detection_power``; pictures are ``evidence``, ``snapshots``, ``panels``, ``strip``
and ``colour_maps``; drawings ``scales``, ``charts`` and ``timeline``; the path ``flight``, ``trajectory_path``,
``trajectory``, ``trajectory_views``, ``world`` and ``clouds``. ``trajectory_render`` runs in a process of its own,
because VTK without OpenGL ends its process. ``comparison``, ``score`` and ``power`` are pages of their own.
"""
